"""Whether a fitted curve misses the data by more than their noise, estimated from neighbours."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fitting.residuals.noise import INDEPENDENT, neighbour_noise

# A good fit is called a misfit by chance in one curve of a thousand (3.09 standard deviations of a
# normal distribution), and never below twice the noise.
_DEVIATIONS, _LEAST_RATIO = 3.09, 2.0
# A residual below this part of the largest value is rounding.
_ROUNDING = 1e-7


class Misfit(NamedTuple):
    """(L,) each: rms of the residuals of a curve, noise from neighbours, whether it is a misfit."""

    rms: np.ndarray
    noise: np.ndarray
    found: np.ndarray


def _ratio(count: np.ndarray, triples: np.ndarray) -> np.ndarray:
    """Return the root of the F quantile for ``count`` residuals and the noise of ``triples``.

    By the cubes of E. Paulson, Ann. Math. Stat. 13, 233 (1942), doi:10.1214/aoms/1177731608;
    infinite below 6 triples, too few for a test.
    """
    a = 2.0 / (9.0 * np.maximum(count, 1.0))
    b = 2.0 / (9.0 * np.maximum(INDEPENDENT * triples, 1.0))
    z = _DEVIATIONS
    below = (1.0 - b) ** 2 - b * z * z
    root = np.sqrt((1.0 - a) ** 2 * b + (1.0 - b) ** 2 * a - a * b * z * z)
    cube = ((1.0 - a) * (1.0 - b) + z * root) / below
    return np.where((below > 0.0) & (triples >= 6), cube**1.5, np.inf)


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
        ratio = _ratio(count, noise.triples)
        least = _ROUNDING * np.nanmax(np.abs(np.atleast_2d(value)), axis=1, initial=0.0)
        sigma = np.maximum(noise.sigma, least)
        found = rms > np.maximum(ratio, _LEAST_RATIO) * sigma
    return Misfit(rms, noise.sigma, found)


def misses_its_noise(
    position: np.ndarray, values: tuple[np.ndarray, ...], rms: np.ndarray
) -> np.ndarray:
    """Return the same for curves of which only the ``rms`` (L,) of all residuals is known.

    values: the data by channel, (L, M) each, NaN for gaps. The noise is estimated from these, which
    gives an upper bound: curvature within three points counts as noise.
    """
    each = [neighbour_noise(position, value) for value in values]
    triples = np.sum([noise.triples for noise in each], axis=0)
    with np.errstate(all="ignore"):
        squares = np.sum([np.nan_to_num(n.sigma) ** 2 * n.triples for n in each], axis=0)
        sigma = np.sqrt(squares / triples)
        count = np.sum([np.isfinite(value).sum(1) for value in values], axis=0)
        return rms > np.maximum(_ratio(count, triples), _LEAST_RATIO) * sigma
