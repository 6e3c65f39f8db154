"""A quantity that cannot be negative, seen with a normal error: its limit and its mean square."""

from __future__ import annotations

import functools
import math
from statistics import NormalDist

import numpy as np

CONFIDENCE = 0.95
_LOWEST, _HIGHEST, _STEP = -30.0, 8.0, 0.05


@functools.cache
def _table() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return t, and the limit and the mean square in units of sigma for an estimate of t sigma."""
    law = NormalDist()  # its cdf is 0 below -8: erfc keeps the digits
    t = np.arange(_LOWEST, _HIGHEST + _STEP / 2, _STEP)
    above_zero = [0.5 * math.erfc(-ti / math.sqrt(2.0)) for ti in t.tolist()]
    beyond = [law.inv_cdf((1.0 - CONFIDENCE) * p) for p in above_zero]
    slope = [law.pdf(ti) / p for ti, p in zip(t.tolist(), above_zero, strict=True)]
    return t, t - np.array(beyond), 1.0 + t * (t + np.array(slope))


def normal_upper_limit(value: np.ndarray, sigma: np.ndarray) -> np.ndarray:
    """Return the 95 % upper limit of a quantity known to be >= 0; NaN where an argument is.

    value: the unconstrained estimate, which may be negative. sigma: its standard error.
    The limit U leaves 5 % of the part of the normal law that lies above 0: P(< U | > 0) = .95 (a
    flat prior on [0, inf)). It never vanishes, however negative ``value`` is: far below 0 it tends
    to log(20) sigma^2 / |value|. From a table in steps of .05 sigma, right to 1e-3 of itself.
    """
    t, limit, _ = _table()
    with np.errstate(all="ignore"):
        scaled = value / sigma
        inner = np.interp(scaled, t, limit)
        far_below = np.log(1.0 / (1.0 - CONFIDENCE)) / -scaled
        far_above = scaled - NormalDist().inv_cdf(1.0 - CONFIDENCE)
        outer = np.where(scaled > _HIGHEST, far_above, inner)
        return sigma * np.where(scaled < _LOWEST, far_below, outer)


def mean_square(value: np.ndarray, sigma: np.ndarray) -> np.ndarray:
    """Return the mean square of the same quantity under the same law; NaN where an argument is.

    sigma^2 for an estimate of 0, falling to 2 sigma^4 / value^2 far below. For ``value`` <= 0.
    """
    t, _, square = _table()
    with np.errstate(all="ignore"):
        scaled = value / sigma
        far_below = 2.0 / scaled**2
        inner = np.interp(scaled, t, square)
        return sigma**2 * np.where(scaled < _LOWEST, far_below, inner)
