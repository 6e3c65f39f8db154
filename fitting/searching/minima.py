"""The minima that many starts reached: the best one, how many starts found it, the others."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from fitting.problem.lanes import Ends
from fitting.problem.problem import Problem

# The standard error that is assumed where neither stated errors nor scatter give one.
ASSUMED_SIGMA = 1e-3

# Two end points are one minimum if their chi2 differs by less than the first number; a minimum is
# reported if its chi2 is higher by less than the second: the 95 % quantile of chi2 with two degrees
# of freedom is 6. Where the residuals tell the noise, it is that of `alternative_chi2`.
SAME_CHI2, ALTERNATIVE_CHI2 = 0.02, 6.0
# An end that was left on its way goes on if its chi2 is less than so far above the best: one of
# 11.6 led to a minimum of .05.
NEAR_CHI2 = 30.0
# Ends whose costs differ by a smaller part are taken for the same minimum, where starts beside the
# lowest ones are looked for.
SAME_MINIMUM = 1e-4
# Square of the number of standard errors from which on two end points with different chi2 are two
# minima.
_APART = 25.0


def alternative_chi2(dof: Any) -> Any:
    """Return the rise of chi2 up to which a minimum is reported, in units of the scatter.

    dof: degrees of freedom (N,) from which the scatter was estimated; 0: it was stated. Twice the
    95 % quantile of F with 2 and ``dof`` degrees of freedom, dof (20^(2 / dof) - 1): 399 for 1, 38
    for 2, 8.2 for 10, and the 6 of chi2 for many. With few of them the scatter at the lowest
    minimum is often far below the noise.
    """
    dof = np.asarray(dof)
    many = np.maximum(dof, 1)
    return np.where(dof > 0, many * np.expm1(2.0 * np.log(20.0) / many), ALTERNATIVE_CHI2)


def scatters(
    cost: Any, dof: Any, scaled: bool, stated: Any, pooled: float | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return the unit of differences of the cost, and up to which one a minimum is reported, (N,).

    cost, dof: the lowest costs (N,) and degrees of freedom. stated: whether the cost is in units of
    the noise. pooled: the scatter of many fits alike, of which each has too few data.
    """
    if pooled is not None and scaled:
        unit = np.full(np.shape(cost), pooled)
        return unit, ALTERNATIVE_CHI2 * unit
    unit = np.where(np.asarray(dof) > 0, cost / np.maximum(dof, 1), 0.0)
    few = (np.asarray(dof) < 3) & (unit < ASSUMED_SIGMA**2)
    known = np.asarray(stated) | (not scaled)
    assumed = np.where(known, 1.0, ASSUMED_SIGMA**2)
    unit = np.where(known | few, np.maximum(unit, assumed), unit)
    return unit, np.where(known | few, ALTERNATIVE_CHI2, alternative_chi2(dof)) * unit


def scatter_of(fit: Problem, cost: float, noise: float) -> tuple[float, float]:
    """Return `scatters` of one fit. cost: the lowest one."""
    stated = fit.seen.stated or noise != 1.0
    unit, most = scatters(cost, fit.dof, fit.asked.scaled, stated)
    return float(unit), float(most)


def by_cost(ends: Ends) -> tuple[np.ndarray, np.ndarray]:
    """Return the lanes by rising cost, and which minimum each is by its cost: 0, 1, ..."""
    cost = np.minimum(ends.cost, 1e300)
    order = np.argsort(cost, kind="stable")
    rises = np.diff(cost[order]) > SAME_MINIMUM * cost[order][1:]
    return order, np.cumsum(np.append(False, rises))


def lowest_lanes(ends: Ends) -> np.ndarray:
    """Return the lanes (8,) of the lowest ends, one of each cost as far as there are so many.

    Of fewer than eight some come again.
    """
    order, which = by_cost(ends)
    new = np.diff(which, prepend=-1) > 0
    return np.resize(np.concatenate([order[new], order[~new]]), 8)


def lowest_ends(ends: Ends) -> np.ndarray:
    """Return the ends (p, 8) of `lowest_lanes`."""
    return ends.y[:, lowest_lanes(ends)]


class Minimum(NamedTuple):
    """One minimum: the lane that represents it, and how many starts ended there."""

    lane: int
    reached: int


class Around(NamedTuple):
    """How the data see the parameters near an end point.

    spread: (p,), changes below which another end point may be the same minimum (a few standard
    errors, infinite for undetermined parameters). rows: (M, p) derivatives of the residuals, in
    units of the scatter: parameters of which each may change by so much need not do so together.
    """

    spread: np.ndarray
    rows: np.ndarray


def minima(
    ends: Ends, scatter: float, most: float, rounding: float, around: Callable[[int], Around]
) -> list[Minimum]:
    """Return the minima that fit nearly as well as the best one, the best first.

    scatter: unit of differences of the cost. most: the largest of them. rounding: differences of
    the cost below this are rounding. around: of a lane.
    """
    lanes = np.flatnonzero(ends.done & np.isfinite(ends.cost))
    if not len(lanes):
        return []
    lanes = lanes[np.argsort(ends.cost[lanes], kind="stable")]
    least = ends.cost[lanes[0]]
    lanes = lanes[ends.cost[lanes] - least <= most + rounding]
    same = SAME_CHI2 * scatter + rounding
    found: list[tuple[Around, list[int]]] = []
    for lane in lanes:
        for near, group in found:
            alike = ends.cost[lane] - ends.cost[group[0]] <= same
            if _one(ends.y[:, group[0]], ends.y[:, lane], near, alike):
                group.append(int(lane))
                break
        else:
            found.append((around(int(lane)), [int(lane)]))
    return [
        Minimum(group[0], int((ends.cost[group] - ends.cost[group[0]] <= same).sum()))
        for _, group in found
    ]


def _one(y: np.ndarray, other: np.ndarray, near: Around, alike: bool) -> bool:
    """Whether two end points (p,) are one minimum. alike: whether their costs are the same."""
    step = other - y
    if (np.abs(step) > near.spread + 1e-6 * np.abs(y)).any():
        return False
    return alike or float(np.sum((near.rows @ step) ** 2)) <= _APART
