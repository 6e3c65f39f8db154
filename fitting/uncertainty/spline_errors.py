"""Errors of a free-form index, which are larger than those of its fitted amplitudes.

Two things are missing in the covariance of a minimum. An amplitude that ended at 0 counts as known,
so that k had no error at all beside an absorption edge. And a spline rounds off what is narrower
than the distance of its knots, which is no noise: at a jump of the curvature, as at a gap, the
rounding falls as the square of that distance. The knots are therefore thinned, to every second one,
and the fit is repeated to first order: the index changes by about four times what is missing. Both
concern the other parameters as well: without them the thickness of a film was up to 3 standard
errors off.
"""

from __future__ import annotations

import numpy as np

from fitting.problem.problem import Problem
from fitting.problem.slopes import influence, prior_rows
from fitting.problem.unknowns import Unknowns
from fitting.samples.dispersion import Model, every_second_left_out
from fitting.samples.parameters import value_and_slope
from fitting.uncertainty.covariance import End, inverse_of
from fitting.uncertainty.intervals import Intervals

# Share of the change by thinner knots that is taken as error. On the average a quarter is missing,
# but it is not known where between two knots an edge lies: with a quarter, intervals at the worst
# place beside an edge held the true value in 89 % of the cases.
_SHARE = 0.5


def _splines(u: Unknowns) -> list[tuple[str, Model]]:
    """Return the media with a free-form index, each with its place."""
    return [
        (place, model) for place, model in zip(u.spec.media.places, u.spec.media.index, strict=True)
        if isinstance(model, Model) and model.knots_ev
    ]  # fmt: skip


def _of_splines(u: Unknowns) -> np.ndarray:
    """Return which unknowns (p,) are amplitudes of a free-form index."""
    own = tuple(f"{place}.{name}" for place, _ in _splines(u) for name in ("eps", "pole", "drude"))
    return np.array([bool(own) and name.startswith(own) for name in u.spec.moving], bool)


def with_errors_of_curves(
    u: Unknowns, end: End, known: Intervals, errors: np.ndarray
) -> tuple[np.ndarray, Intervals]:
    """Return covariance and intervals of one minimum with the errors of all but the amplitudes.

    errors: what `errors_of_curves` returned. Those of a sample without splines are as they were.
    """
    if errors is end.known.covariance:
        return errors, known
    with np.errstate(invalid="ignore", divide="ignore"):
        factor = np.sqrt(np.diagonal(errors) / np.diagonal(end.known.covariance))
    factor = np.where(~_of_splines(u) & (factor > 1.0), factor, 1.0)
    ends, quadratic = known.ends.copy(), known.quadratic.copy()
    for i in np.flatnonzero(factor > 1.0):
        w = u.moving[i]
        x = float(value_and_slope(w.parameter.coordinate, end.y[i])[0])
        for some in (ends, quadratic):
            some[:, i] = np.clip(x + factor[i] * (some[:, i] - x), w.low, w.high)
    # A limit is the upper end of an interval from 0.
    limits = np.where(np.isfinite(known.limits), ends[..., 1], known.limits)
    covariance = end.known.covariance * np.outer(factor, factor)
    return covariance, known._replace(ends=ends, quadratic=quadratic, limits=limits)


def errors_of_curves(fit: Problem, end: End, noise: float) -> np.ndarray:
    """Return the covariance (p, p) for the errors of indices and of fitted curves.

    That of the minimum for a sample without splines.
    """
    u, known = fit.u, end.known
    splines = _splines(u)
    if not splines or not end.finite:
        return known.covariance
    off, lines = prior_rows(u, end.y)
    rows = np.concatenate([end.slopes.jacobian / noise, lines])
    pull = np.concatenate([influence(u.spec.loss, end.slopes.residual / noise)[0], off])
    inside = (known.at_bound == "") | _of_splines(u)
    covariance = known.variance * inverse_of(rows, pull, u.free & inside).covariance
    for place, model in splines:
        change = _SHARE * _change_by_thinner_knots(fit, end.y, rows, pull, place, model)
        covariance += np.outer(change, change)
    return covariance


def _change_by_thinner_knots(
    fit: Problem, y: np.ndarray, rows: np.ndarray, pull: np.ndarray, place: str, model: Model
) -> np.ndarray:
    """Return by how much y (p,) changes to first order, within the bounds, with half of the knots.

    0 where an amplitude is held or tied.
    """
    from scipy.optimize import lsq_linear  # slow to import, seldom needed

    u = fit.u
    at = {name: i for i, name in enumerate(u.spec.moving)}
    own = [at.get(f"{place}.eps2_{j}", -1) for j in range(1, model.terms + 1)]
    if min(own) < 0 or not u.free[own].all():
        return np.zeros_like(y)
    others = [i for i in np.flatnonzero(u.free) if i not in set(own)]
    sums = every_second_left_out(model.terms, model.knots_ev)
    every = np.zeros((len(y), len(others) + sums.shape[1]))
    every[others, np.arange(len(others))] = 1.0
    every[own, len(others) :] = sums
    ends = [np.concatenate([a[others], np.full(sums.shape[1], a[own[0]])]) for a in fit.limits]
    columns = rows @ every
    size = np.linalg.norm(columns, axis=0)
    size = np.where(size > 0.0, size, 1.0)
    held = np.where(u.free, 0.0, y)
    found = lsq_linear(
        columns / size, rows @ (y - held) - pull, (ends[0] * size, ends[1] * size), method="bvls"
    ).x
    return np.where(u.free, every @ (found / size) - y, 0.0)
