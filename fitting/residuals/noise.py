"""The noise of a curve, from the scatter of neighbours, and whether a fit misses the data by more.

The scatter is that about a polynomial through the neighbours: the divided difference of order
count - 1 of ``count`` neighbours is 0 for a polynomial of lower degree. Divided by the root of the
sum of its squared weights it has the variance of one datum, for any spacing of positions. Three
neighbours show the deviation from a straight line (T. Gasser, L. Sroka and C. Jennen-Steinmetz,
Biometrika 73, 625 (1986), doi:10.1093/biomet/73.3.625).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import fdtri

# For white noise the mean square of differences of three neighbours scatters like a mean of this
# number of independent squares for each difference (neighbouring differences are correlated: at
# equal distances 35 / 18 times as many are needed).
INDEPENDENT = 18.0 / 35.0
# From fewer values no noise can be estimated with outliers and curvature left out.
LEAST_VALUES = 8
_QUARTILE = 0.6745  # of the normal distribution, in standard deviations
# Repeats of one position are separated by this part of the range, in the order in which they come.
_APART = 1e-9
# A good fit is called a misfit by chance in less than one curve of a thousand, and never below
# twice the noise.
_CHANCE, _LEAST_RATIO = 1e-3, 2.0
# A residual below this part of the largest value is rounding, or the tolerance of the solver.
ROUNDING = 1e-7
# Digits after the decimal point that are counted.
_DIGITS = 8


class Noise(NamedTuple):
    """(L,) each: sigma, standard deviation, NaN for none; triples, the number of differences."""

    sigma: np.ndarray
    triples: np.ndarray


def _differences(position: np.ndarray, value: np.ndarray, count: int) -> np.ndarray:
    """Return the divided differences of ``count`` neighbours, of unit variance: (L, M - count + 1).

    position, value: (L, M), NaN where there is no datum; positions in any order.
    """
    position = np.where(np.isfinite(value), position, np.nan)
    order = np.argsort(position, axis=1, kind="stable")  # NaN last
    x, y = (np.take_along_axis(a, order, axis=1) for a in (position, value))
    span = np.fmax.reduce(x, axis=1, keepdims=True, initial=-np.inf) - x[:, :1]
    x = (x - x[:, :1]) / np.where(span > 0.0, span, 1.0) + _APART * np.arange(x.shape[1])
    width = x.shape[1] - count + 1
    near = [x[:, j : j + width] for j in range(count)]
    weights = []
    for here in near:
        gaps = [here - other for other in near if other is not here]
        weights.append(1.0 / np.prod(gaps, axis=0))
    length = np.sqrt(np.sum(np.square(weights), axis=0))
    return np.sum([w / length * y[:, j : j + width] for j, w in enumerate(weights)], axis=0)


def neighbour_noise(position: np.ndarray, value: np.ndarray) -> Noise:
    """Return the noise of each curve, (L,): root mean square of differences of three neighbours.

    position, value: (L, M), NaN where there is no datum; positions in any order. Repeats of one
    position count as neighbours of each other.
    """
    position, value = (np.atleast_2d(np.asarray(a, float)) for a in (position, value))
    position, value = np.broadcast_arrays(position, value)
    if value.shape[1] < 3:
        none = np.zeros(len(value), int)
        return Noise(np.full(len(value), np.nan), none)
    with np.errstate(all="ignore"):
        square = _differences(position, value, 3) ** 2
        triples = np.isfinite(square).sum(1)
        sigma = np.sqrt(np.nansum(square, axis=1) / np.maximum(triples, 1))
    return Noise(np.where(triples > 0, sigma, np.nan), triples)


def robust_noise(position: np.ndarray, value: np.ndarray) -> float:
    """Return the noise of one curve (M,) with outliers and curvature; NaN for too few values.

    It is the smallest of the medians for 3, 4 and 5 neighbours: a median does not depend on single
    outliers, and the smallest of the three hardly on curvature.
    """
    if len(value) < LEAST_VALUES:
        return float("nan")
    found = []
    with np.errstate(all="ignore"):
        for count in (3, 4, 5):
            each = np.abs(_differences(position[None], value[None], count))
            each = each[np.isfinite(each)]
            found.append(np.median(each) / _QUARTILE if len(each) else np.nan)
    return float(min(found))


def rounding(value: np.ndarray) -> np.ndarray:
    """Return the rounding error of values (L, M) as they are printed, (L,): half the last digit.

    NaN for gaps. The last digit is the power of ten of which all values are multiples; 0 below
    1e-7. If values are printed with few digits, many neighbours may have the same rounding error.
    """
    last = np.zeros(len(value))
    with np.errstate(invalid="ignore"):
        for digits in range(_DIGITS):
            size = value * 10.0**digits
            exact = ~(np.abs(size - np.round(size)) >= 1e-6).any(1)
            last = np.where(exact & (last == 0.0), 10.0**-digits, last)
            if last.all():
                break
        least = ROUNDING * np.fmax.reduce(np.abs(value), axis=1, initial=0.0)
    return np.maximum(0.5 * last, least)


class Misfit(NamedTuple):
    """(L,) each: rms of the residuals of a curve, noise from neighbours, whether it is a misfit."""

    rms: np.ndarray
    noise: np.ndarray
    found: np.ndarray


def misfit(position: np.ndarray, value: np.ndarray, residual: np.ndarray) -> Misfit:
    """Return where the residuals are larger than the noise, for curves (L, M), NaN for gaps.

    position: angle (or wavelength). value: the data, for the size of the rounding.
    The noise is estimated from differences of neighbouring residuals, in which a smooth misfit
    cancels. The limit is that of F for the mean squares of residuals and of differences.
    """
    residual = np.atleast_2d(residual)
    noise = neighbour_noise(position, residual)
    with np.errstate(all="ignore"):
        count = np.isfinite(residual).sum(1)
        rms = np.sqrt(np.nansum(residual**2, axis=1) / count)
        freedom = INDEPENDENT * np.maximum(noise.triples, 1)
        ratio = np.sqrt(fdtri(np.maximum(count, 1), freedom, 1.0 - _CHANCE))
        ratio = np.where(noise.triples >= 6, ratio, np.inf)  # less are too few for a test
        least = ROUNDING * np.nanmax(np.abs(np.atleast_2d(value)), axis=1, initial=0.0)
        sigma = np.maximum(noise.sigma, least)
        found = rms > np.maximum(ratio, _LEAST_RATIO) * sigma
    return Misfit(rms, noise.sigma, found)
