"""The minima that many starts reached: the best one, how many starts found it, the others."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fitting.searching.starts import Ends

# Two end points are one minimum if their chi2 differs by less than the first number; a minimum is
# reported if its chi2 is higher by less than the second: the 95 % quantile of chi2 with two degrees
# of freedom is 6.
SAME_CHI2, ALTERNATIVE_CHI2 = 0.02, 6.0


class Minimum(NamedTuple):
    """One minimum: the lane that represents it, and how many starts ended there."""

    lane: int
    reached: int


def minima(
    ends: Ends, x: np.ndarray, scatter: float, rounding: float, spread: np.ndarray
) -> list[Minimum]:
    """Return the minima within ALTERNATIVE_CHI2 of the best one, the best first.

    x: (p, L) parameters where the lanes ended, with terms in one order. scatter: unit of
    differences of the cost. rounding: differences of the cost below this are rounding. spread:
    (p,), distances below which two end points are one (a few standard errors at the best one,
    large for undetermined parameters).
    """
    lanes = np.flatnonzero(ends.done & np.isfinite(ends.cost))
    if not len(lanes):
        return []
    lanes = lanes[np.argsort(ends.cost[lanes], kind="stable")]
    least = ends.cost[lanes[0]]
    lanes = lanes[ends.cost[lanes] - least <= ALTERNATIVE_CHI2 * scatter + rounding]
    found: list[list[int]] = []
    for lane in lanes:
        for group in found:
            near = np.abs(x[:, lane] - x[:, group[0]]) <= spread + 1e-6 * np.abs(x[:, group[0]])
            if near.all():
                group.append(int(lane))
                break
        else:
            found.append([int(lane)])
    same = SAME_CHI2 * scatter + rounding
    return [
        Minimum(group[0], int((ends.cost[group] - ends.cost[group[0]] <= same).sum()))
        for group in found
    ]
