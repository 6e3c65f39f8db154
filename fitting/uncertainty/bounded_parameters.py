"""Where the ends of profile intervals lie beside a parameter that cannot be negative."""

from __future__ import annotations

from typing import Any

import numpy as np

from fitting.problem.problem import Problem
from fitting.samples.parameters import LOG, Unknown
from fitting.uncertainty.beside_zero import TWO_SIDED, by_valley, other_roots, own_roots
from fitting.uncertainty.covariance import End, Uncertainty
from fitting.uncertainty.profile import Search

# So many standard errors of the quadratic model.
_NEAR = 8.0
# An end that moves by less than this part of its distance stays where it is.
_LEAST = 0.01


def unbounded(u: Unknown, y: Any, known: Uncertainty, i: int) -> tuple[Any, Any]:
    """Return the estimate (...) that parameter i would have without bounds, and its standard error.

    y: (...), where it is. In the solver's coordinate; NaN if it is known, has a prior, or its range
    does not begin at 0.
    """
    if not u.free or u.low != 0.0 or u.prior is not None or u.parameter.coordinate == LOG:
        return np.full_like(y, np.nan), np.full_like(y, np.nan)
    sigma = known.edge[..., i] * np.sqrt(known.variance)
    sigma = np.where(np.isfinite(sigma), sigma, np.nan)
    step = np.where(known.at_bound[..., i] == "low", known.wide_step[..., i], 0.0)
    return np.where(np.isnan(sigma), np.nan, y + np.minimum(step, 0.0)), sigma


def may_be_zero(fit: Problem, end: End, i: int) -> bool:
    """Whether a parameter that cannot be negative is so near to 0 that its ends may move."""
    value, sigma = unbounded(fit.u.moving[i], end.y[i], end.known, i)
    return bool(value < _NEAR * sigma)


def _in_errors(
    fit: Problem, end: End, t: float, i: int, ends: tuple[Search, Search]
) -> tuple[float, float]:
    """Return the estimate of a parameter without the bound at 0, in standard errors, and one."""
    reach, sigma = map(float, unbounded(fit.u.moving[i], end.y[i], end.known, i))
    lower, upper = ends
    slope = max(-2.0 * reach / (t * sigma / TWO_SIDED) ** 2, 0.0)
    best = 0.0 if end.known.at_bound[i] == "low" else end.y[i]
    root = TWO_SIDED * lower.root_at(lower.room)
    x, unit = by_valley(*(np.array(a) for a in (best, slope, root, upper.end)))
    return float(x), float(unit)


def aim_beside_zero(
    fit: Problem, end: End, t: float, pairs: dict[int, tuple[Search, Search]]
) -> list[Search]:
    """Aim the searches of one minimum at where a truth is held in 95 %, and return those that move.

    pairs: the two searches of unknowns, which have found the ends of one rise. t: half an interval
    in standard errors. The ends of a parameter that cannot be negative move if it is near 0; those
    of the others if there is just one such parameter.
    """
    near = {}
    for i, ends in pairs.items():
        x, unit = _in_errors(fit, end, t, i, ends)
        if np.isfinite(x) and x < 2.0 * TWO_SIDED:
            near[i] = x, unit
    roots = {i: own_roots(np.array([x])) for i, (x, _) in near.items()}
    if len(near) == 1:
        ((i, (x, unit)),) = near.items()
        wide = end.known.wide
        with np.errstate(all="ignore"):
            along = wide[i] / wide[i, i] * unit
            left = np.maximum(np.diagonal(wide) - wide[i] ** 2 / wide[i, i], 0.0)
            apart = t / TWO_SIDED * np.sqrt(end.known.variance * left)
            low, high = other_roots(np.array(x), along / np.hypot(along, apart))
        roots |= {j: (low[j : j + 1], high[j : j + 1]) for j in pairs if j != i}
    moved = []
    for j, both in roots.items():
        for search, root in zip(pairs[j], both, strict=True):
            aim = float(root[0]) / TWO_SIDED  # NaN: nothing is known of the correlation
            if abs(aim - 1.0) > _LEAST and np.isfinite(search.found):
                search.aim(aim)
                moved.append(search)
    return moved
