"""What the ends of many starts say: the best minimum, how many found it, the others."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fitting.starts import Ends

# Two ends are one minimum if their chi2 differ by less than this; and a minimum is reported if its
# chi2 is less than that higher: 6 is the 95 % quantile of chi2 with two degrees of freedom.
SAME_CHI2, ALTERNATIVE_CHI2 = 0.02, 6.0


class Minimum(NamedTuple):
    """One minimum: the lane that stands for it, and how many ended there."""

    lane: int
    reached: int


def minima(
    ends: Ends, x: np.ndarray, scatter: float, rounding: float, spread: np.ndarray
) -> list[Minimum]:
    """Return the minima within ALTERNATIVE_CHI2 of the best one, the best first.

    x: (p, L) parameters at the ends, terms in one order. scatter: what a difference of the cost is
    measured in. rounding: differences of the cost that are rounding. spread: (p,), distances below
    which two ends are one (a few standard errors at the best one, large where the data say
    nothing).
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
