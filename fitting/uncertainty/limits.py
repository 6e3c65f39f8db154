"""95 % intervals of a quantity that cannot be negative, and of one whose error was estimated."""

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


def interval_from_zero(
    value: np.ndarray, sigma: np.ndarray, t: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the 95 % interval of a quantity known to be >= 0; NaN where an argument is.

    value: the unconstrained estimate, which may be negative. sigma: its standard error. t: how many
    of them 95 % are.
    The ends of the profile likelihood, [(x - value) / sigma]^2 <= t^2 + [(x0 - value) / sigma]^2
    with x0 = max(value, 0): value +- t sigma, cut at 0, and for a negative estimate

        0 <= x <= value + sqrt(value^2 + t^2 sigma^2),

    which never vanishes. It holds a true 0 in 97.5 % of all cases, a truth above 2 t sigma in 95 %,
    and one between in 95 to 97.5 %.
    """
    with np.errstate(all="ignore"):
        wide = t * sigma
        below = wide**2 / (np.hypot(value, wide) - value)  # no cancellation
        return np.maximum(value - wide, 0.0), np.where(value < 0.0, below, value + wide)


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
