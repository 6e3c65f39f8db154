"""95 % intervals of a quantity that cannot be negative, and of one whose error was estimated."""

from __future__ import annotations

import functools
import math
from statistics import NormalDist

import numpy as np

CONFIDENCE = 0.95
_LOWEST, _HIGHEST, _STEP = -30.0, 8.0, 0.05


@functools.cache
def _table() -> tuple[np.ndarray, np.ndarray]:
    """Return t, and the mean square in units of sigma for an estimate of t sigma."""
    law = NormalDist()  # its cdf is 0 below -8: erfc keeps the digits
    t = np.arange(_LOWEST, _HIGHEST + _STEP / 2, _STEP)
    above_zero = [0.5 * math.erfc(-ti / math.sqrt(2.0)) for ti in t.tolist()]
    slope = [law.pdf(ti) / p for ti, p in zip(t.tolist(), above_zero, strict=True)]
    return t, 1.0 + t * (t + np.array(slope))


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

    Of the part of the normal law (value, sigma) that lies above 0: sigma^2 for an estimate of 0,
    falling to 2 sigma^4 / value^2 far below. For ``value`` <= 0.
    """
    t, square = _table()
    with np.errstate(all="ignore"):
        scaled = value / sigma
        far_below = 2.0 / scaled**2
        inner = np.interp(scaled, t, square)
        return sigma**2 * np.where(scaled < _LOWEST, far_below, inner)


def _student_within(t: float, dof: int) -> float:
    """Return P(|T| < t) of Student's law, in closed form for a whole number of degrees of freedom.

    M. Abramowitz and I. A. Stegun, *Handbook of Mathematical Functions* (1964), 26.7.3 and 26.7.4.
    """
    angle = math.atan(t / math.sqrt(dof))
    sine, cosine = math.sin(angle), math.cos(angle)
    odd = dof % 2
    term = cosine if odd else 1.0
    total = term if dof > 1 else 0.0
    for j in range(2 + odd, dof, 2):
        term *= cosine**2 * (j - 1) / j
        total += term
    return 2.0 / math.pi * (angle + sine * total) if odd else sine * total


@functools.cache
def student_quantile(dof: int) -> float:
    """Return t with P(|T| < t) = .95 for ``dof`` degrees of freedom; the normal law's 1.96 for 0.

    0 stands for an error that was stated and not estimated. Right to 3e-9.
    """
    normal = NormalDist().inv_cdf(0.5 + 0.5 * CONFIDENCE)
    if dof <= 0:
        return normal
    if dof > 1000:  # the next term is below 2e-9
        cube = normal**3
        return normal + (cube + normal) / (4 * dof) + (
            5 * normal**5 + 16 * cube + 3 * normal
        ) / (96 * dof**2)  # fmt: skip
    low, high = normal, 13.0
    while high - low > 1e-12 * high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _student_within(middle, dof) < CONFIDENCE else (low, middle)
    return low


def student_quantiles(dof: np.ndarray) -> np.ndarray:
    """Return `student_quantile` of every number of an array (N,)."""
    if dof.size and (dof == dof[0]).all():
        return np.full(dof.shape, student_quantile(int(dof[0])))
    different, where = np.unique(dof, return_inverse=True)
    return np.array([student_quantile(int(d)) for d in different])[where]
