"""From where the lanes of many curves ended to one `Fit` of their batch shape.

Covariance and intervals are those of `uncertainty`, for all curves at once; the warnings are the
conditions on one curve's minimum, over arrays.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from fitting.data.measurement import Measurement
from fitting.outcomes.findings import findings_of_all
from fitting.outcomes.outcome import Shaped, combinations_unseen, estimates, fixed_and_tied
from fitting.problem.curve_lanes import Curves, slopes
from fitting.problem.evaluation import Evaluated
from fitting.problem.lanes import Ends
from fitting.problem.problem import Problem
from fitting.problem.unknowns import Unknowns
from fitting.residuals.error_model import misses_without_freedom
from fitting.results import result_parts as status
from fitting.results.diagnostics import Finding, ranked
from fitting.results.result import FitData
from fitting.results.result_parts import (
    Alternative,
    ErrorModel,
    Estimate,
    Evaluator,
    IndexBand,
    Prediction,
)
from fitting.samples.sample import Sample
from fitting.searching.minima import alternative_chi2
from fitting.uncertainty.covariance import Uncertainty, uncertainty
from fitting.uncertainty.intervals import quadratic
from fitting.uncertainty.limits import student_quantiles

# Two ends are two minima if some parameter differs by so many standard errors.
_APART = 4.0


class BatchCurves(NamedTuple):
    """The evaluator of N fits of one sample, one after the other; see `result.Evaluator`.

    y: (N, p) solver coordinates. covariance: (N, p, p).
    """

    pattern: Evaluated
    y: np.ndarray
    covariance: np.ndarray
    shape: tuple[int, ...]

    def at(self, index: tuple[int, ...]) -> Evaluator:
        """Return the evaluator of one fit."""
        i = int(np.ravel_multi_index(index, self.shape)) if self.shape else 0
        return self.pattern._replace(y=self.y[i], covariance=self.covariance[i])

    def _each(self, of: Any, kind: Any) -> Any:
        found = [of(self.at(i)) for i in np.ndindex(*self.shape)]
        parts = (np.stack(part) for part in zip(*found, strict=True))
        return kind(*(part.reshape(*self.shape, *part.shape[1:]) for part in parts))

    def predict(self, measurement: Measurement | None = None) -> Prediction:
        """Return every fit at every row of a measurement, shape + (N,)."""
        return self._each(lambda one: one.predict(measurement), Prediction)

    def over_angle(self, angle_deg: np.ndarray, quantity: str) -> Prediction:
        """Return every fit over angles (A,), shape + (A,)."""
        return self._each(lambda one: one.over_angle(angle_deg, quantity), Prediction)

    def index(self, wavelength_um: Any = None, medium: str | None = None) -> IndexBand:
        """Return eta and k of a medium in every fit, shape + (W,)."""
        return self._each(lambda one: one.index(wavelength_um, medium), IndexBand)

    def widened(self, factor: np.ndarray) -> BatchCurves:
        """Return the same with the errors of each fit times its factor, (N,)."""
        return self._replace(covariance=self.covariance * factor[:, None, None] ** 2)


class _Minima(NamedTuple):
    """Minima of N curves: y (N, p), what is known there, costs, and unweighted residuals' rms."""

    y: np.ndarray
    known: Uncertainty
    cost: np.ndarray
    rms: np.ndarray


def _minima_of(
    job: Problem, curves: Curves, dof: np.ndarray, ends: Ends, which: np.ndarray
) -> _Minima:
    """Return the minima of the curves ``which`` next to where they ended, by a last step."""
    u, stated = job.u, curves.sigma is not None
    first, y = ends.y[:, which].copy(), ends.y[:, which].copy()
    low, high = (a[:, None] for a in job.limits)
    parts: list[_Minima] = []
    for turn in range(2):
        parts = []
        for some, s in slopes(job.u.spec, job.targets, curves, y, which):
            sane = np.asarray(np.isfinite(s.residual).all(1) & np.isfinite(s.jacobian).all((1, 2)))
            r = np.where(sane[:, None], s.residual, 0.0)
            J = np.where(sane[:, None, None], s.jacobian, 0.0)
            known = uncertainty(
                u, r, J, y[:, some].T, job.limits, 1.0, dof[which[some]], job.asked.scaled, stated
            )
            cost = np.where(sane, np.vecdot(r, r), np.inf)
            with np.errstate(all="ignore"):
                rms = np.sqrt(np.nanmean(s.plain**2, (1, 2)))
            parts.append(_Minima(y[:, some].T, known, cost, rms))
        whole = _joined(parts)
        if turn:
            break
        before = whole
        y = np.clip(first + whole.known.step.T, low, high)
    return _chosen(whole.cost < before.cost, whole, before)


def _joined(parts: Sequence[_Minima]) -> _Minima:
    known = Uncertainty(*(np.concatenate(a) for a in zip(*(p.known for p in parts), strict=True)))
    y, cost, rms = (np.concatenate([getattr(p, n) for p in parts]) for n in ("y", "cost", "rms"))
    return _Minima(y, known, cost, rms)


def _chosen(where: np.ndarray, one: _Minima, other: _Minima) -> _Minima:
    def pick(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return np.where(where.reshape(-1, *[1] * (a.ndim - 1)), a, b)

    known = Uncertainty(*(pick(a, b) for a, b in zip(one.known, other.known, strict=True)))
    return _Minima(
        pick(one.y, other.y), known, pick(one.cost, other.cost), pick(one.rms, other.rms)
    )


def _estimates(
    u: Unknowns, m: _Minima, t: np.ndarray, failed: np.ndarray, put: Shaped
) -> tuple[dict[str, Estimate], np.ndarray]:
    """Return the fitted parameters by name, and their covariance (n, P, P)."""
    ends, limits = quadratic(u.moving, m.y, m.known, t)
    limits = np.where(m.known.unseen_of, np.nan, limits)
    return estimates(u, m.y, m.known, ends, status.QUADRATIC, limits, failed, put)


def _others(
    job: Problem, curves: Curves, dof: np.ndarray, m: _Minima, which: np.ndarray,
    minima: Sequence[Ends], scatter: np.ndarray, t: np.ndarray, put: Shaped,
) -> tuple[np.ndarray, tuple[Alternative, ...]]:  # fmt: skip
    """Return how many other minima each curve has that fit nearly as well, and the best of them."""
    width = _APART * m.known.edge * np.sqrt(scatter)[:, None]
    width = np.where(np.isfinite(width), width, np.inf)
    most = scatter * alternative_chi2(np.where(curves.sigma is None, dof[which], 0))
    count, least = np.zeros(len(which), int), np.full(len(which), np.inf)
    places = m.y.copy()
    for ends in minima:
        y, cost = ends.y[:, which].T, np.where(ends.done, ends.cost, np.inf)[which]
        apart = (np.abs(y - m.y) > width + 1e-6 * np.abs(m.y)).any(1)
        there = apart & (cost - m.cost <= most)
        count += there
        lower = there & (cost < least)
        least[lower], places[lower] = cost[lower], y[lower]
    some = np.flatnonzero(count)
    if not len(some):
        return count, ()
    at = Ends(np.zeros_like(minima[0].y), minima[0].cost, minima[0].done, minima[0].evaluations)
    at.y[:, which[some]] = places[some].T
    found = _minima_of(job, curves, dof, at, which[some])
    own = Shaped(put.shape, put.count, which[some])
    free, _ = _estimates(job.u, found, t[some], np.zeros(len(some), bool), own)
    rise = (found.cost - m.cost[some]) / scatter[some]
    nan = own(np.full(len(some), np.nan))
    return count, (Alternative(parameters=free, delta_chi2=own(rise), reached=nan),)


@np.errstate(all="ignore")
def fit_of_batch(
    job: Problem, curves: Curves, dof: np.ndarray, best: Ends, minima: Sequence[Ends],
    shape: tuple[int, ...], sample: Sample,
) -> FitData:  # fmt: skip
    """Return the result of N curves.

    best: where the lowest lane of each ended; minima: where all lanes did, N at a time.
    """
    u, stated, count = job.u, curves.sigma is not None, curves.count
    n_data = curves.n_data
    which = np.flatnonzero(n_data > 0)
    put = Shaped(shape, count, which)
    m = _minima_of(job, curves, dof, best, which)
    own = dof[which]
    # Relative to the noise: the stated one, or the scatter if that is more.
    scatter = np.where(own > 0, m.cost / np.maximum(own, 1), 0.0)
    scatter = np.maximum(scatter, 1.0 if stated else 1e-300)
    missed = misses_without_freedom(m.cost, m.rms**2 * n_data[which], n_data[which], own, stated)
    failed = ~best.done[which] | ~np.isfinite(m.cost) | missed
    t = student_quantiles(np.where(job.asked.scaled & (own > 0), own, 0))
    free, covariance = _estimates(u, m, t, failed, put)
    found, others = _others(job, curves, dof, m, which, minima, scatter, t, put)
    unseen = m.known.hidden.any(1) & ~failed
    state = np.where(failed, status.NOT_CONVERGED, np.where(
        unseen, status.UNDETERMINED, status.CONVERGED
    ))  # fmt: skip
    reduced = np.where((own > 0) & stated, m.cost / np.maximum(own, 1), np.nan)
    known = np.unique(job.seen.points.wavelength_um[job.seen.measured, 0])
    waves = np.broadcast_to(known, (*shape, len(known)))
    pattern = Evaluated(
        sample, u, job.seen, job.targets, m.y[0], m.known.covariance[0], known,
        inside=(np.empty((0, u.size)), 1.96),
    )  # fmt: skip
    whole = np.full((count, u.size), np.nan)
    whole[which] = m.y
    spread = np.full((count, u.size, u.size), np.nan)
    spread[which] = m.known.covariance
    taken = "equal" if not stated else "stated" if job.asked.errors == "stated" else "scaled"
    factor = np.sqrt(np.broadcast_to(m.known.variance, own.shape))
    none = status.NO_DATA
    fits = FitData(
        sample=sample, parameters=free | fixed_and_tied(u, m.y[0], free),
        covariance=np.asarray(put(covariance)),
        wavelength_um=waves[..., 0] if len(known) == 1 else waves,
        chi2=put(m.cost if stated else np.full_like(m.cost, np.nan)), chi2_reduced=put(reduced),
        dof=put(own, 0), n_data=put(n_data[which], 0), rms=put(m.rms), cost=put(m.cost),
        status=put(state, none),
        errors=ErrorModel(
            taken=put(np.full(len(which), taken), taken), factor=put(factor),
            added=put(np.zeros(len(which))), stated=stated, widened=put(np.ones(len(which))),
        ),
        evaluations=put(best.evaluations[which], 0), others=others,
        evaluator=BatchCurves(pattern, whole, spread, shape),
    )  # fmt: skip
    told = findings_of_all(
        fits, fits.chi2_reduced, put(missed, False), combinations_unseen(u, m.known, put)
    )
    if others:
        one = others[0]
        told.append(Finding("other_minima", np.isfinite(one.delta_chi2), {
            "count": put(found, 0), "parameters": tuple(one.parameters),
            "values": np.stack([np.asarray(e.value) for e in one.parameters.values()], -1),
            "delta_chi2": one.delta_chi2,
        }))  # fmt: skip
    return replace(fits, findings=ranked(told))
