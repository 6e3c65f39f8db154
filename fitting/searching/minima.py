"""The minima that many starts reached: the best one, how many starts found it, the others."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from fitting.searching.starts import Ends

# Two end points are one minimum if their chi2 differs by less than the first number; a minimum is
# reported if its chi2 is higher by less than the second: the 95 % quantile of chi2 with two degrees
# of freedom is 6.
SAME_CHI2, ALTERNATIVE_CHI2 = 0.02, 6.0
# Square of the number of standard errors from which on two end points with different chi2 are two
# minima.
_APART = 25.0


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
    ends: Ends, scatter: float, rounding: float, around: Callable[[int], Around]
) -> list[Minimum]:
    """Return the minima within ALTERNATIVE_CHI2 of the best one, the best first.

    scatter: unit of differences of the cost. rounding: differences of the cost below this are
    rounding. around: of a lane.
    """
    lanes = np.flatnonzero(ends.done & np.isfinite(ends.cost))
    if not len(lanes):
        return []
    lanes = lanes[np.argsort(ends.cost[lanes], kind="stable")]
    least = ends.cost[lanes[0]]
    lanes = lanes[ends.cost[lanes] - least <= ALTERNATIVE_CHI2 * scatter + rounding]
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
