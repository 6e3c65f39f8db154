"""From where the lanes of many curves ended to one `Fit` of their batch shape.

Covariance and intervals are those of `uncertainty`, for all curves at once; the warnings are the
conditions on one curve's minimum, over arrays.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import jax
import numpy as np

from fitting.optics.spec import NCS
from fitting.outcomes.findings import findings_of_all
from fitting.outcomes.outcome import Shaped, combinations_unseen, estimates, fixed_and_tied, too_few
from fitting.problem.curve_lanes import slopes
from fitting.problem.evaluation import Alike, EachFit, Evaluated
from fitting.residuals.error_model import misses_without_freedom
from fitting.results import result_parts as status
from fitting.results.diagnostics import ranked
from fitting.results.result import FitData
from fitting.results.result_parts import (
    Alternative,
    ErrorModel,
)
from fitting.samples.sample import Sample
from fitting.searching.batch_search import BatchSearch
from fitting.searching.minima import SAME_CHI2, scatters
from fitting.uncertainty.covariance import Uncertainty, uncertainty
from fitting.uncertainty.intervals import quadratic
from fitting.uncertainty.limits import ROUNDING, student_quantiles

# Undamped steps after the solver, each as long as it lowers the cost by more than this share.
_STEPS, _FALL = 3, 1e-9
# Two ends are two minima if some parameter differs by so many standard errors: lanes end within a
# few hundredths of one. With 4 a fifth of the other minima of R_p were taken for the best one.
_APART = 1.0
# Without a degree of freedom lanes that end at k = 0 with a misfit stop within 1e-4 of the cost.
_LEVEL = 2e-4


class _Minima(NamedTuple):
    """Minima of the n curves ``which``, and what is known there.

    y (n, p); costs; sum of squares of the data and (n, C) of the unweighted residuals, with their
    numbers (n, C), by channel. reached: how many lanes ended there.
    """

    which: np.ndarray
    y: np.ndarray
    known: Uncertainty
    cost: np.ndarray
    squares: np.ndarray
    plain: np.ndarray
    counts: np.ndarray
    reached: np.ndarray

    def but(self, where: np.ndarray, other: _Minima) -> _Minima:
        """Return these, and where (n,) says so the others."""

        def pick(a: np.ndarray, b: np.ndarray) -> np.ndarray:
            return np.where(where.reshape(-1, *[1] * (a.ndim - 1)), b, a)

        return jax.tree.map(pick, self, other)

    def of(self, some: np.ndarray) -> _Minima:
        """Return those of some places."""
        return jax.tree.map(lambda a: a[some], self)

    def put(self, some: np.ndarray, others: _Minima) -> None:
        """Take those of some places from others."""
        jax.tree.map(lambda mine, a: mine.__setitem__(some, a), self, others)


def _minima_at(search: BatchSearch, which: np.ndarray, y: np.ndarray, pooled: Any) -> _Minima:
    """Return what is known of the curves ``which`` (n,) at y (p, n)."""
    job, curves, parts = search.job, search.curves, list[_Minima]()
    ncs, kinds = NCS in job.u.spec.channels, len(job.u.spec.channels)
    channel: np.ndarray = np.minimum(np.arange(kinds + 2 * ncs), kinds - 1)
    for some, s in slopes(job.u.spec, curves, y, which):
        sane = np.asarray(np.isfinite(s.residual).all(1) & np.isfinite(s.jacobian).all((1, 2)))
        r = np.where(sane[:, None], s.residual, 0.0)
        J = np.where(sane[:, None, None], s.jacobian, 0.0)
        known = uncertainty(
            job.u, r, J, y[:, some].T, search.limits, 1.0, search.dof[which[some]],
            job.asked.scaled, curves.stated, pooled,
        )  # fmt: skip
        square, there = np.nansum(s.plain**2, -1), np.isfinite(s.plain).sum(-1)
        own = [channel == c for c in range(kinds)]
        plain, counts = (np.stack([a[:, c].sum(1) for c in own], 1) for a in (square, there))
        cost = np.where(sane, np.vecdot(r, r), np.inf)
        parts.append(_Minima(
            which[some], y[:, some].T, known, cost, s.squares, plain, counts,
            np.zeros(len(some), int),
        ))  # fmt: skip
    return jax.tree.map(lambda *a: np.concatenate(a), *parts)


def _minima_beside(search: BatchSearch, which: np.ndarray, y: np.ndarray, pooled: Any) -> _Minima:
    """Return the minima of the curves ``which`` (n,) next to the ends y (p, n) of lanes."""
    low, high = (a[:, None] for a in search.limits)
    out = _minima_at(search, which, y, pooled)
    go = np.arange(len(which))
    for _ in range(_STEPS):
        here = out.of(go)
        there = _minima_at(
            search, which[go], np.clip((here.y + here.known.step).T, low, high), pooled
        )
        lower = there.cost < here.cost
        out.put(go, here.but(lower, there))
        go = go[lower & (there.cost < (1.0 - _FALL) * here.cost)]
        if not len(go):
            break
    return out


def _minima(
    search: BatchSearch, which: np.ndarray, pooled: float | None
) -> tuple[list[_Minima], np.ndarray]:
    """Return the best minima of the curves ``which``, others that fit nearly as well; the scatter.

    The others: the second of all curves that have one, the third, ... At normal incidence N and
    eta_i^2 / N have the same reflectance; of two that fit equally well that above eta_i is first.
    scatter: (N,), the unit of a rise of the cost.
    """
    job, best = search.job, search.best
    of_lane, ends = search.lanes
    scatter, most = scatters(
        best.cost, search.dof, job.asked.scaled, search.curves.stated, pooled
    )  # fmt: skip
    done = np.flatnonzero(ends.done & np.isfinite(ends.cost))
    left = done[np.lexsort((ends.cost[done], of_lane[done]))]
    out, some, y, cost = list[_Minima](), which, best.y[:, which], best.cost[which]
    rounding, same = np.zeros_like(scatter), scatter
    while len(some):
        m = _minima_beside(search, some, y, pooled)
        if not out:
            rounding[which] = ROUNDING * m.squares
            level = np.where(search.dof == 0, _LEVEL * best.cost, 0.0)
            same = SAME_CHI2 * scatter + rounding + level
            left = left[(ends.cost - (best.cost + most + rounding)[of_lane])[left] <= 0.0]
        row = np.searchsorted(some, of_lane[left])
        width = _APART * np.sqrt(scatter + rounding)[some, None] * m.known.edge
        width = np.where(np.isfinite(width), width, np.inf) + 1e-6 * np.abs(y.T)
        near = (np.abs(ends.y[:, left].T - y.T[row]) <= width[row]).all(1)
        alike = near & (ends.cost[left] - cost[row] <= same[some[row]])
        out.append(m._replace(reached=np.bincount(row[alike], minlength=len(some))))
        left = left[~near]
        some, first = np.unique(of_lane[left], return_index=True)
        y, cost = ends.y[:, left[first]], ends.cost[left[first]]
    indices = [i for i, name in enumerate(job.u.spec.moving) if name.endswith(".eta")]
    if len(indices) == 1:  # of the surface, or of a plate
        outside = search.curves.outside
        for turn, m in enumerate(out[1:], 1):
            rows = np.searchsorted(which, m.which)
            first = out[0].of(rows)
            below, other = (a.y[:, indices[0]] < outside[m.which] for a in (first, m))
            swap = below & ~other & (m.cost <= first.cost + same[m.which])
            out[0].put(rows, first.but(swap, m))
            out[turn] = m.but(swap, first)
    return out, scatter


@np.errstate(all="ignore")
def fit_of_batch(
    search: BatchSearch, shape: tuple[int, ...], sample: Sample, pooled: float | None = None,
) -> FitData:  # fmt: skip
    """Return the result of N curves, of which all lanes have ended.

    pooled: the scatter of all curves, where each has too few data to estimate its own.
    """
    job, curves, best = search.job, search.curves, search.best
    u, stated, count = job.u, curves.stated, curves.count
    which = np.flatnonzero(search.known)
    put = Shaped(shape, count, which)
    minima, scatter = _minima(search, which, pooled)
    m, own, n_data = minima[0], search.dof[which], curves.n_data[which]
    plain, rows = m.plain.sum(1), m.counts.sum(1)
    failed = ~best.done[which] | ~np.isfinite(m.cost)
    unseen = m.known.hidden.any(1)
    missed = misses_without_freedom(m.cost, plain, rows, own, stated) & ~(failed | unseen)
    failed |= missed
    few = too_few(u, sample, n_data) & ~(failed | unseen)
    estimated = job.asked.scaled and pooled is None
    t = student_quantiles(np.where(estimated & (own > 0), own, 0))

    def estimates_of(m: _Minima, t: np.ndarray, failed: np.ndarray, put: Shaped) -> Any:
        ends, limits = quadratic(u.moving, m.y, m.known, t)
        limits = np.where(m.known.unseen_of, np.nan, limits)
        return estimates(u, m.y, m.known, ends, status.QUADRATIC, limits, failed, put)

    free, covariance = estimates_of(m, t, failed | few, put)
    others = list[Alternative]()
    for other in minima[1:]:
        rows_of = np.searchsorted(which, other.which)
        at = Shaped(shape, count, other.which)
        parameters, _ = estimates_of(other, t[rows_of], failed[rows_of], at)
        rise = (other.cost - m.cost[rows_of]) / scatter[other.which]
        rise = np.where(failed[rows_of], np.nan, rise)
        others.append(Alternative(
            parameters=parameters, delta_chi2=at(rise), reached=at(other.reached.astype(float))
        ))  # fmt: skip
    state = np.where(failed, status.NOT_CONVERGED, np.where(
        unseen | few, status.UNDETERMINED, status.CONVERGED
    ))  # fmt: skip
    reduced = np.where((own > 0) & stated, m.cost / np.maximum(own, 1), np.nan)
    known = np.unique(job.seen.points.wavelength_um[job.seen.measured, 0])
    waves = np.broadcast_to(known, (*shape, len(known)))
    pattern = Evaluated(
        sample, u, job.seen, job.targets, m.y[0], m.known.covariance[0], known,
        inside=(np.empty((0, u.size)), 1.96),
    )  # fmt: skip
    in_turn = Shaped((count,), count, which)
    # Pixels begin where others ended, which are no starts of their own.
    starts = search.starts[which] if curves.own else np.zeros(len(which), int)
    alone = np.where((own > 0) & job.asked.scaled, "scaled", "stated")
    taken = alone if stated else np.full(own.shape, "equal")
    factor = np.sqrt(np.broadcast_to(m.known.variance, own.shape))
    none = status.NO_DATA
    fits = FitData(
        sample=sample, parameters=free | fixed_and_tied(u, m.y[0], free),
        covariance=np.asarray(put(covariance)),
        wavelength_um=waves[..., 0] if len(known) == 1 else waves,
        chi2=put(m.cost if stated else np.full_like(m.cost, np.nan)), chi2_reduced=put(reduced),
        dof=put(own, 0), n_data=put(n_data, 0), rms=put(np.sqrt(plain / rows)), cost=put(m.cost),
        status=put(state, none),
        rms_of={
            c: put(np.sqrt(m.plain[:, i] / m.counts[:, i])) for i, c in enumerate(u.spec.channels)
        },
        errors=ErrorModel(
            taken=put(taken, "scaled" if stated else "equal"), factor=put(factor),
            added=put(np.zeros(len(which))), stated=stated, widened=put(np.ones(len(which))),
        ),
        evaluations=put(best.evaluations[which], 0), others=tuple(others),
        evaluator=EachFit(Alike(pattern, in_turn(m.y), in_turn(m.known.covariance)), shape),
        starts=put(starts, 0), reached=put(np.minimum(m.reached, starts), 0),
    )  # fmt: skip
    unseen_each = combinations_unseen(u, m.known, put)
    told = findings_of_all(fits, fits.chi2_reduced, put(missed, False), unseen_each)
    return replace(fits, findings=ranked(told))
