"""From where the lanes of many curves ended to one `Fit` of their batch shape.

Covariance and intervals are those of `uncertainty`, for all curves at once; the warnings are the
conditions on one curve's minimum, over arrays.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import jax
import numpy as np

from fitting.data.quantities import POWERS
from fitting.outcomes.findings import findings_of_all, not_quadratic
from fitting.outcomes.outcome import (
    OTHERS,
    Shaped,
    all_unseen,
    combinations_unseen,
    estimates,
    fixed_and_tied,
    too_few,
)
from fitting.outcomes.surface_verdicts import marked, verdicts_of_batch
from fitting.problem.curve_lanes import shown_at, slopes
from fitting.problem.evaluation import Alike, EachFit, Evaluated
from fitting.residuals.error_model import misses_without_freedom
from fitting.residuals.noise import noise_of_misfits
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
from fitting.uncertainty.intervals import Minima, intervals, total_reflection
from fitting.uncertainty.limits import ROUNDING, student_quantiles
from fitting.uncertainty.profile import Lanes

# Undamped steps after the solver, and the part of a standard error below which one is taken without
# being looked at: what is left after a step is a thousandth of it.
_STEPS, _SMALL = 3, 1e-2
# Residuals of a curve are looked at only if the squares of the sums of four side by side are
# together so many times the sum of the squares. That is 1 for noise (above 1.7 in .4 % of fits of
# 50 to 100 data) and 2.5 for a smooth misfit as large as the noise. Steps of derivatives then.
_ALIKE, _STEP = 1.7, 1e-5
# Two ends are two minima if some parameter differs by so many standard errors: lanes end within a
# few hundredths of one. With 4 a fifth of the other minima of R_p were taken for the best one.
_APART = 1.0
# Without a degree of freedom lanes that end at k = 0 with a misfit stop within 1e-4 of the cost.
_LEVEL = 2e-4


class _Minima(NamedTuple):
    """Minima of the n curves ``which``, and what is known there.

    y (n, p); costs, and those that a step promises; sum of squares of the data and (n, C) of the
    unweighted residuals, with their numbers (n, C), by channel; together: see `Slopes`. reached:
    lanes that ended there.
    """

    which: np.ndarray
    y: np.ndarray
    known: Uncertainty
    cost: np.ndarray
    promised: np.ndarray
    squares: np.ndarray
    plain: np.ndarray
    counts: np.ndarray
    together: np.ndarray
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
    job, curves = search.job, search.curves
    at = slopes(job.u.spec, curves, y, which)
    known = uncertainty(
        job.u, at.triangle[..., -1], at.triangle[..., :-1], y.T, search.limits, 1.0,
        search.dof[which], job.asked.scaled, curves.stated, curves.squares[which], pooled,
    )  # fmt: skip
    fall = (at.triangle[..., :-1] @ known.step[..., None])[..., 0]
    found = _Minima(
        which, y.T, known, at.cost, at.cost - np.vecdot(fall, fall), curves.squares[which],
        at.plain, at.counts, at.together, np.zeros(len(which), int),
    )  # fmt: skip
    return jax.tree.map(np.array, found)  # which `put` writes to


def _minima_beside(search: BatchSearch, which: np.ndarray, y: np.ndarray, pooled: Any) -> _Minima:
    """Return the minima of the curves ``which`` (n,) next to the ends y (p, n) of lanes."""
    low, high = (a[:, None] for a in search.limits)
    out = _minima_at(search, which, y, pooled)
    go = np.arange(len(which))
    for _ in range(_STEPS):
        here = out.of(go)
        step, error = here.known.step, here.known.edge * np.sqrt(here.known.variance)[:, None]
        ahead = np.clip((here.y + step).T, low, high)
        # Without a known scatter every step is looked at.
        far = ((step != 0.0) & ~(np.abs(step) <= _SMALL * error)).any(1)
        out.y[go[~far]], out.cost[go[~far]] = ahead[:, ~far].T, here.promised[~far]
        go, here = go[far], here.of(far)
        if not len(go):
            break
        there = _minima_at(search, which[go], ahead[:, far], pooled)
        lower = there.cost < here.cost
        out.put(go, here.but(lower, there))
        go = go[lower]
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
    absorbs = [i for i, name in enumerate(job.u.spec.moving) if name.endswith(".k")]
    if len(indices) == 1:  # of the surface, or of a plate
        outside = search.curves.outside
        for turn, m in enumerate(out[1:], 1):
            rows = np.searchsorted(which, m.which)
            first = out[0].of(rows)
            below, other = (a.y[:, indices[0]] < outside[m.which] for a in (first, m))
            swap = below & ~other & (m.cost <= first.cost + same[m.which])
            if absorbs:  # of two that only rounding tells apart, the one that absorbs less
                less = m.y[:, absorbs[0]] < first.y[:, absorbs[0]]
                swap |= (below == other) & less & (m.cost <= first.cost + rounding[m.which])
            out[0].put(rows, first.but(swap, m))
            out[turn] = m.but(swap, first)
    return out, scatter


def _noise_of_misfits(search: BatchSearch, m: _Minima) -> np.ndarray:
    """Return the noise of curves over the angle that are missed by more, (n,), else NaN.

    Looked at are those whose residuals are alike side by side, or where angles are in no order.
    """
    spec, curves, out = search.job.u.spec, search.curves, np.full(len(m.which), np.nan)
    rows = np.unique(curves.seen.row)
    steps = np.diff(curves.of_points("angle_deg", m.which)[:, rows], axis=1)
    ordered = (steps >= 0.0).all(1) | (steps <= 0.0).all(1)
    some = np.flatnonzero((m.together > _ALIKE * m.cost) | ~ordered)
    if not len(some):
        return out
    y, which = m.y[some], m.which[some]
    targets, angle = curves.targets(which), curves.of_points("angle_deg", which)
    weight, value = (np.moveaxis(np.stack(a), -1, 0) for a in (targets.weights, targets.values))
    fitted = shown_at(spec, curves, y.T, which)

    def slopes_of(rows: np.ndarray) -> np.ndarray:
        at, step = y[rows], _STEP * (1.0 + np.abs(y[rows]))
        parts = [shown_at(spec, curves, (at + step * e).T, which[rows]) - fitted[rows]
                 for e in np.eye(y.shape[1])]  # fmt: skip
        return np.stack(parts, -1)

    out[some] = noise_of_misfits(angle, value, fitted - value, weight, slopes_of)
    return out


@np.errstate(all="ignore")
def fit_of_batch(
    search: BatchSearch, shape: tuple[int, ...], sample: Sample, pooled: float | None = None,
    known: np.ndarray | None = None,
) -> FitData:  # fmt: skip
    """Return the result of N curves, of which all lanes have ended.

    pooled: the scatter of all curves, where each has too few data to estimate its own. known: the
    wavelengths, if not those of the points: NaN for none.
    """
    job, curves, best = search.job, search.curves, search.best
    u, stated, count = job.u, curves.stated, curves.count
    which = np.flatnonzero(search.known)
    put = Shaped(shape, count, which)
    minima, scatter = _minima(search, which, pooled)
    m, own, n_data = minima[0], search.dof[which], curves.n_data[which]
    if known is None:
        known = np.unique(job.seen.points.wavelength_um[job.seen.measured, 0])
    noise, told = np.full(len(which), np.nan), None
    if set(u.spec.channels) <= set(POWERS) and (len(known) == 1 or "wavelength_um" in curves.own):
        noise = _noise_of_misfits(search, m)
        told = verdicts_of_batch(search, which, m.y, m.known, m.cost, scatter[which])
    if told is not None:
        asked, verdicts, y = told
        new = np.flatnonzero((y != m.y[asked]).any(1))
        if len(new):
            m.put(asked[new], _minima_at(search, which[asked[new]], y[new].T, pooled))
        others = [o.of(~np.isin(o.which, which[asked[verdicts.open]])) for o in minima[1:]]
        minima = [m, *(o for o in others if len(o.which))]
    plain, rows = m.plain.sum(1), m.counts.sum(1)
    failed = ~best.done[which] | ~np.isfinite(m.cost)
    unseen = m.known.hidden.any(1)
    missed = misses_without_freedom(m.cost, plain, rows, own, stated) & ~(failed | unseen)
    failed |= missed
    several = np.zeros(len(which), bool)  # indices that fit alike, of which profiles tell the range
    if told is not None:
        several[asked] = verdicts.open & np.isfinite(verdicts.eta)
        several &= np.isfinite(m.cost)
        failed &= ~several
    few = too_few(u, sample, n_data) & ~(failed | unseen)
    estimated = job.asked.scaled and pooled is None
    t = student_quantiles(np.where(estimated & (own > 0), own, 0))
    minima = [
        o._replace(known=all_unseen(o.known, (few | several)[np.searchsorted(which, o.which)]))
        for o in minima
    ]
    m, every = minima[0], jax.tree.map(lambda *a: np.concatenate(a), *minima)
    turn = np.repeat(np.arange(len(minima)), [len(m.which) for m in minima])
    row, rounding = np.searchsorted(which, every.which), ROUNDING * every.squares
    ranges = intervals(u, search.limits, Minima(
        every.which, every.y, every.cost, every.known, t[row], rounding,
        np.where(failed[row] | (turn > OTHERS), status.QUADRATIC, job.asked.intervals),
        total_reflection(u, every.y, curves.critical[every.which]),
    ), Lanes(search.pinned, curves.width))  # fmt: skip
    # The search for the ends of an interval may meet a lower minimum.
    lowest, place = ranges.lowest
    least = best.cost.copy()
    np.minimum.at(least, every.which, every.cost)
    least[which] -= SAME_CHI2 * scatter[which] + ROUNDING * m.squares
    lower = ~failed[row] & (lowest < least[every.which])
    if lower.any():
        search.run(place[lower].T, every.which[lower])
        if (best.done & (best.cost < least)).any():
            return fit_of_batch(search, shape, sample, pooled)

    def estimates_of(at: int, failed: np.ndarray, put: Shaped) -> Any:
        m, r = minima[at], jax.tree.map(lambda a: a[turn == at], ranges)
        return estimates(u, m.y, m.known, r.ends, r.kind, r.limits, failed, put)

    free, covariance = estimates_of(0, failed, put)
    others = list[Alternative]()
    for at, other in enumerate(minima[1:], 1):
        rows_of = row[turn == at]
        there = Shaped(shape, count, other.which)
        parameters, _ = estimates_of(at, failed[rows_of], there)
        rise = (other.cost - m.cost[rows_of]) / scatter[other.which]
        rise = np.where(failed[rows_of], np.nan, rise)
        others.append(Alternative(
            parameters=parameters, delta_chi2=there(rise),
            reached=there(other.reached.astype(float)),
        ))  # fmt: skip
    state = np.where(failed, status.NOT_CONVERGED, np.where(
        unseen | few, status.UNDETERMINED, status.CONVERGED
    ))  # fmt: skip
    reduced = np.where((own > 0) & stated, m.cost / np.maximum(own, 1), np.nan)
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
    none, channels = status.NO_DATA, u.spec.channels
    fits = FitData(
        sample=sample, parameters=free | fixed_and_tied(u, m.y[0], free),
        covariance=np.asarray(put(covariance)),
        wavelength_um=waves[..., 0] if len(known) == 1 else waves,
        chi2=put(m.cost if stated else np.full_like(m.cost, np.nan)), chi2_reduced=put(reduced),
        dof=put(own, 0), n_data=put(n_data, 0), rms=put(np.sqrt(plain / rows)), cost=put(m.cost),
        status=put(state, none),
        rms_of={c: put(r) for c, r in zip(channels, np.sqrt(m.plain / m.counts).T, strict=True)},
        n_of={c: put(n, 0) for c, n in zip(channels, m.counts.T, strict=True)},
        errors=ErrorModel(
            taken=put(taken, "scaled" if stated else "equal"), factor=put(factor),
            added=put(np.zeros(len(which))), stated=stated, widened=put(np.ones(len(which))),
        ),
        evaluations=put(best.evaluations[which], 0), others=tuple(others),
        evaluator=EachFit(Alike(
            pattern, in_turn(m.y), in_turn(m.known.covariance),
            (in_turn(ranges.inside[turn == 0]), in_turn(t)),
        ), shape),
        starts=put(starts, 0), reached=put(np.minimum(m.reached, starts), 0),
    )  # fmt: skip
    unseen_each = combinations_unseen(u, m.known, put)
    plain = put(ranges.quadratic[turn == 0][:, u.free])
    findings = [
        *findings_of_all(fits, fits.chi2_reduced, put(missed, False), unseen_each, put(noise)),
        *not_quadratic(free, plain),
    ]
    fits = replace(fits, findings=ranked(findings))
    if told is None:
        return fits
    return marked(fits, verdicts, Shaped(shape, count, which[asked]))
