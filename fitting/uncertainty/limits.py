"""How many standard errors 95 % are, and the mean square of what cannot be negative."""

from __future__ import annotations

import functools
import math

import numpy as np
from scipy.special import erfcx, stdtrit

CONFIDENCE = 0.95
# Below this part of the data's sum of squares a rise of the cost is rounding: 1e4 eps^2.
ROUNDING = 5e-28
# This far below 0 the mean square is a small difference of large numbers, and the first term of its
# series is accurate to 6e-5.
_FAR_BELOW = -300.0


def mean_square(value: np.ndarray, sigma: np.ndarray) -> np.ndarray:
    """Return the mean square of a quantity known to be >= 0; NaN where an argument is.

    Of the part of the normal law (value, sigma) that lies above 0, with t = value / sigma and the
    law's density p and distribution P: sigma^2 (1 + t^2 + t p(t) / P(t)); sigma^2 for an estimate
    of 0, falling to 2 sigma^4 / value^2 far below. For ``value`` <= 0; right to 6e-5.
    """
    with np.errstate(all="ignore"):
        t = value / sigma
        slope = math.sqrt(2.0 / math.pi) / erfcx(-t / math.sqrt(2.0))  # p / P
        return sigma**2 * np.where(t < _FAR_BELOW, 2.0 / t**2, 1.0 + t * (t + slope))


@functools.lru_cache(maxsize=4096)
def student_quantile(dof: int) -> float:
    """Return t with P(|T| < t) = .95 for ``dof`` degrees of freedom; the normal law's 1.96 for 0.

    0 stands for an error that was stated and not estimated.
    """
    return float(stdtrit(dof if dof > 0 else np.inf, 0.5 + 0.5 * CONFIDENCE))


def student_quantiles(dof: np.ndarray) -> np.ndarray:
    """Return `student_quantile` of every number in an array (N,)."""
    if len(dof) and (dof == dof[0]).all():  # nearly always, and then not worth sorting
        return np.full(len(dof), student_quantile(int(dof[0])))
    different, where = np.unique(dof, return_inverse=True)
    return np.array([student_quantile(d) for d in different.tolist()])[where]
