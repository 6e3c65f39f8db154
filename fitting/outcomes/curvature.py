"""Parameters that the data determine though the fitted curve does not change with them at first.

The reflectance of an antireflection coating is least at the best index, and changes with the square
of what is off. Noise that asks for less than that ends there in half of all measurements: the
derivative is 0, as where the data say nothing, but the profile likelihood has ends.
"""

from __future__ import annotations

import numpy as np

from fitting.problem.lanes import STAGE
from fitting.problem.problem import Problem
from fitting.results.result_parts import PROFILE
from fitting.uncertainty.covariance import End
from fitting.uncertainty.intervals import Intervals

# Half way to the end of an interval chi2 rises by 1/4 of its rise there if it is a square, by 1/16
# if it is a fourth power; along a valley of equal chi2, which may be closed, by nothing.
_RISES = 0.02


def by_curvature(fit: Problem, end: End, found: Intervals, noise: float) -> End | None:
    """Return a minimum whose unseen parameters have intervals, as one without any; else None.

    found: the intervals at this minimum, all by profile. The parameters have no standard errors.
    """
    unseen = np.flatnonzero(end.known.unseen_of)
    ends, limits = found.ends[unseen], [(w.low, w.high) for w in fit.u.moving]
    low, high = np.array(limits)[unseen].T
    lanes = [2 * int(j) + side for j in unseen for side in (0, 1)]
    if (found.kind[unseen] != PROFILE).any() or np.isnan(found.inside[lanes]).any():
        return None
    if not ((low < ends[:, 0]) & (ends[:, 1] < high)).all():
        return None
    half = 0.5 * (end.y + found.inside[lanes]).T
    rise = fit.pinned(half, np.repeat(unseen, 2), noise, STAGE).cost - end.cost
    if not (rise > _RISES * found.t**2 * end.known.rise).all():
        return None
    covariance = end.known.covariance.copy()
    covariance[unseen] = covariance[:, unseen] = np.nan
    known = end.known._replace(
        covariance=covariance, hidden=np.zeros_like(end.known.hidden),
        unseen_of=np.zeros_like(end.known.unseen_of),
    )  # fmt: skip
    return end._replace(known=known)
