"""95 % intervals beside a bound: of a quantity that cannot be negative, and of one tied to it.

Where the best fit lies on a bound or close to it, the rise of chi2 at the truth is not distributed
as chi2 of one degree of freedom, and all values with a rise of at most 3.84 hold the truth in 94 to
97.5 % of repeats instead of 95. The rise at an end of the interval is chosen here such that a truth
at this end would be held in 95 %, under the quadratic model of the data: estimates of the quantity
v >= 0 and of another parameter e that follow the normal law, with errors of 1 and a correlation.

For v alone that is the construction of G. J. Feldman and R. D. Cousins, Phys. Rev. D 57, 3873
(1998), doi:10.1103/PhysRevD.57.3873, and holds the truth in 95 %. For e the rise depends on the
true v, for which its most likely value for this e is taken (B. Sen, M. Walker and M. Woodroofe,
Statistica Sinica 19, 301 (2009)): the truth is held in 93 to 96 %, whatever v and correlation
(tests/uncertainty/test_beside_zero.py).

Errors that were estimated from the scatter have Student's t in place of the normal law's 1.96. The
same intervals are then taken, stretched by the ratio of the two.
"""

from __future__ import annotations

import functools
import math

import numpy as np
from scipy.special import ndtr, ndtri

from fitting.uncertainty.limits import CONFIDENCE

# 95 % of the normal law lie within so many standard errors, on one side and on both.
ONE_SIDED, TWO_SIDED = (float(ndtri(share)) for share in (CONFIDENCE, 0.5 + 0.5 * CONFIDENCE))
_ROUNDS = 6

# The table of `other_roots`: estimates of v in standard errors, dense where the lower end leaves
# 0, and the angle whose cosine is the correlation. Outside of it the nearest place is taken.
_ESTIMATES = np.concatenate(
    [np.arange(-6.0, 1.5, 0.25), np.arange(1.5, 2.1, 0.025), np.arange(2.1, 4.1, 0.2)]
)
_ANGLES = 0.01 + (0.5 * math.pi - 0.02) * np.linspace(0.0, 1.0, 17) ** 2
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)
_HALVINGS = 24
# So small is the part of a rise that is quadratic at least.
_LEAST = 1e-3
_MOST = 4.0  # the root of a rise that holds the truth in more than 99.9 %, in any case
_FAR = 8.0  # standard errors: beyond lies less than 1e-15 of the normal law


def _density(x: np.ndarray) -> np.ndarray:
    return np.exp(-0.5 * x * x) / math.sqrt(2.0 * math.pi)


def own_roots(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the roots of the rises at the lower and the upper end of v >= 0.

    x: the estimate in standard errors, which may be negative. The rise is counted from the best
    v >= 0, and its root lies between 1.645 and 1.96. The condition that a truth at the end be held
    in 95 % is

        P(root) - P(-h) = .95,      h = hypot(x, root) at the upper end for x < 0, and
                                    h = (v^2 + root^2) / 2v at the lower end v = x - root < 1.96,

    with the normal law's distribution P.
    """
    x = np.asarray(x, float)
    low, high = np.full_like(x, TWO_SIDED), np.full_like(x, TWO_SIDED)
    with np.errstate(all="ignore"):
        below = np.minimum(x, -1e-12)
        # Between 0 and 1.645 the interval begins at 0, and any root says so.
        between = np.clip(x, ONE_SIDED + 1e-9, 2.0 * TWO_SIDED)
        for _ in range(_ROUNDS):
            h = np.hypot(below, high)
            off = ndtr(high) - ndtr(-h) - CONFIDENCE
            high = high - off / (_density(high) + _density(h) * high / h)
            high = np.clip(high, ONE_SIDED, TWO_SIDED)
            v = np.maximum(between - low, 1e-12)
            h = 0.5 * (v + low**2 / v)
            off = ndtr(low) - ndtr(-h) - CONFIDENCE
            slope = _density(low) + _density(h) * (low / v + 0.5 * (low / v) ** 2 - 0.5)
            low = np.clip(low - off / slope, ONE_SIDED, TWO_SIDED)
    return low, np.where(x < 0.0, high, TWO_SIDED)


def interval_from_zero(
    value: np.ndarray, sigma: np.ndarray, t: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the 95 % interval of a quantity known to be >= 0; NaN where an argument is.

    value: the unconstrained estimate, which may be negative. sigma: its standard error. t: how many
    of them 95 % are. It holds any truth in 95 % of repeats. For a negative estimate it is

        0 <= v <= value + sqrt(value^2 + root^2),

    which never vanishes.
    """
    with np.errstate(all="ignore"):
        unit = t * sigma / TWO_SIDED
        low, high = (root * unit for root in own_roots(value / unit))
        below = high**2 / (np.hypot(value, high) - value)  # no cancellation
        return np.maximum(value - low, 0.0), np.where(value < 0.0, below, value + high)


def by_valley(
    v: np.ndarray, slope: np.ndarray, root: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the estimate of v >= 0 without the bound, in standard errors, and one of these.

    They are those of a quadratic cost with the rises that were found, since where the cost is not
    quadratic its curvature at the minimum says little of its ends. v: the best one. root: of the
    rise at 0, if v is above it. slope: of the rise, if v is 0. high: the upper end, where it is
    3.84.
    """
    with np.errstate(all="ignore"):
        # From v = 0 on the rise is square v^2 + slope v.
        square = np.maximum(TWO_SIDED**2 - slope * high, _LEAST) / high**2
        sigma = np.where(v > 0.0, v / root, 1.0 / np.sqrt(square))
        return np.where(v > 0.0, v / sigma, -0.5 * slope * sigma), sigma


def held_share(correlation: np.ndarray, v: np.ndarray, rise: np.ndarray) -> np.ndarray:
    """Return how often the rise of chi2 at the true e is at most ``rise``.

    correlation: between 0 and 1, neither of them. v: the true v, in standard errors of v for known
    e. With a = e - truth and b = estimate of v for the true e, in the same unit, both independent
    with errors of 1, the rise is

        a^2 + min(b, 0)^2 - min(s b + r a, 0)^2,        r = correlation, s = sqrt(1 - r^2),

    which for a given a is at most ``rise`` in one range of b. Right to 1e-5.
    """
    root = np.sqrt(np.clip(rise, 0.0, _MOST**2))
    r, v, root = (x[..., None] for x in np.broadcast_arrays(correlation, v, root))
    s = np.sqrt(1.0 - r * r)

    def lowest(a: np.ndarray, flat: np.ndarray) -> np.ndarray:
        """Return the least b < 0: of a rise of a^2 + b^2, or where v hits 0, (r b - s a)^2."""
        return np.where(s * flat + r * a >= 0.0, flat, (s * a - root) / r)

    # |a| <= root: every b > 0 is in the range.
    turn = 0.5 * math.pi * _NODES
    a, flat = root * np.sin(turn), -root * np.cos(turn)
    inner = 0.5 * math.pi * _WEIGHTS * _density(a) * -flat * ndtr(v - lowest(a, flat))
    # a < -root: only b whose v is below 0 by so much that the best fit is no better.
    width = np.arccosh(np.maximum(_FAR / np.maximum(root, 1e-6), 1.0))
    out = 0.5 * width * (1.0 + _NODES)
    a, beyond = -root * np.cosh(out), root * np.sinh(out)
    high = (-r * a - beyond) / s
    high = np.where(high > 0.0, high, (s * a + root) / r)
    low = (s * a - root) / r
    outer = 0.5 * width * _WEIGHTS * _density(a) * beyond * (ndtr(high - v) - ndtr(low - v))
    return inner.sum(-1) + outer.sum(-1)


def _root_at_end(r: np.ndarray, x: np.ndarray, side: float) -> np.ndarray:
    """Return the root of the rise at the end of e at which a truth is held in 95 %.

    side: 1 for the end at which v is smaller, -1 for the other. The end is found by its distance
    from the best e, in standard errors of e.
    """
    s = np.sqrt(1.0 - r * r)
    near, far, rise = np.zeros(x.shape), np.full(x.shape, _FAR), np.zeros(x.shape)
    for _ in range(_HALVINGS):
        middle = 0.5 * (near + far)
        a = r * np.minimum(x, 0.0) + side * middle
        b = (x - r * a) / s
        rise = a * a + np.minimum(b, 0.0) ** 2 - np.minimum(x, 0.0) ** 2
        outside = held_share(r, np.maximum(b, 0.0), rise) > CONFIDENCE
        near, far = np.where(outside, near, middle), np.where(outside, middle, far)
    return np.sqrt(rise)


@functools.cache
def _table() -> np.ndarray:
    """Return the roots of `other_roots`, (2, angles, estimates): v smaller, v larger."""
    r, x = np.meshgrid(np.cos(_ANGLES), _ESTIMATES, indexing="ij")
    return np.stack([_root_at_end(r, x, side) for side in (1.0, -1.0)])


def _cell(value: np.ndarray, grid: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return in which cell of a grid values lie, or the nearest one, and where in it, 0 to 1."""
    at = np.interp(value, grid, np.arange(len(grid)))
    cell = np.minimum(at.astype(int), len(grid) - 2)
    return cell, at - cell


def other_roots(x: np.ndarray, correlation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the roots of the rises at the lower and the upper end of e, 1.64 to 2.05.

    x: the estimate of v >= 0 in standard errors, which may be negative. correlation: of e and v.
    NaN where an argument is. Right to .01, from a table.
    """
    known = np.isfinite(x) & np.isfinite(correlation)
    angle = np.arccos(np.clip(np.abs(np.where(known, correlation, 0.0)), 0.0, 1.0))
    (i, f), (j, g) = _cell(angle, _ANGLES), _cell(np.where(known, x, 0.0), _ESTIMATES)
    both = _table()
    left, right = (both[:, i, c] * (1.0 - f) + both[:, i + 1, c] * f for c in (j, j + 1))
    smaller, larger = np.where(known, left * (1.0 - g) + right * g, np.nan)
    swap = np.asarray(correlation) < 0.0
    return np.where(swap, larger, smaller), np.where(swap, smaller, larger)
