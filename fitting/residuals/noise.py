"""Whether a fit misses the data by more than their noise, which the scatter of neighbours shows.

Three neighbours show the deviation from a straight line (T. Gasser, L. Sroka and
C. Jennen-Steinmetz, Biometrika 73, 625 (1986), doi:10.1093/biomet/73.3.625).

A model that is wrong misses its data smoothly. The part of the residuals r that a smooth function
describes, in directions in which the parameters of the fit cannot move the curve,

    S = |Q^T r|^2        Q: orthonormal; spans the smooth functions without the slopes of the model

is compared with that of noise: by F, for errors of one size, and then with the S of the same
residuals with random signs (J. G. MacKinnon, Journal of Econometrics 7, 1 (1986), calls a test of
such draws a wild bootstrap), so that a few large residuals at one end of the curve are no misfit.
Fourteen angles are enough where the misfit is 3 times the noise; a test of neighbours alone
(`misfit`) needs 4 times, or more angles.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.special import fdtrc, fdtri

from fitting.data.scatter import differences

# For white noise the mean square of differences of three neighbours scatters like a mean of this
# number of independent squares for each difference (neighbouring differences are correlated: at
# equal distances 35 / 18 times as many are needed).
INDEPENDENT = 18.0 / 35.0
# A good fit is called a misfit by chance in less than one curve of a thousand, and never below
# twice the noise.
_CHANCE, _LEAST_RATIO = 1e-3, 2.0
_LEAST_TRIPLES = 6  # less are too few for a test
# A residual below this part of the largest value is rounding, or the tolerance of the solver.
ROUNDING = 1e-7
# Digits after the decimal point that are counted.
_DIGITS = 8


class Noise(NamedTuple):
    """(L,) each: sigma, standard deviation, NaN for none; triples, the number of differences."""

    sigma: np.ndarray
    triples: np.ndarray


def neighbour_noise(position: np.ndarray, value: np.ndarray) -> Noise:
    """Return the noise of each curve, (L,): root mean square of differences of three neighbours.

    position: (M,) or (L, M), in any order. value: (L, M), NaN where there is no datum. Repeats of
    one position count as neighbours of each other.
    """
    position, value = (np.atleast_2d(np.asarray(a, float)) for a in (position, value))
    count, size = value.shape
    if size < 3:
        return Noise(np.full(count, np.nan), np.zeros(count, int))
    with np.errstate(all="ignore"):
        if len(position) == 1 and count > size and np.isfinite(value).all():
            # Differences at the same positions are the same linear function of the values.
            square = (value @ differences(position, np.eye(size), 3)) ** 2
        else:
            square = differences(np.broadcast_to(position, value.shape), value, 3) ** 2
        triples = np.isfinite(square).sum(1)
        sigma = np.sqrt(np.nansum(square, axis=1) / np.maximum(triples, 1))
    return Noise(np.where(triples > 0, sigma, np.nan), triples)


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
        ratio = np.where(noise.triples >= _LEAST_TRIPLES, ratio, np.inf)
        least = ROUNDING * np.nanmax(np.abs(np.atleast_2d(value)), axis=1, initial=0.0)
        sigma = np.maximum(noise.sigma, least)
        found = rms > np.maximum(ratio, _LEAST_RATIO) * sigma
    return Misfit(rms, noise.sigma, found)


# Scatters of n residuals differ beyond chance by a factor of more than 1 + _DIFFER / sqrt(n): the
# ratio of two estimates of white noise is known to 1.4 / sqrt(n).
_DIFFER = 6.0


@np.errstate(all="ignore")
def scatter_of_each(
    angle_deg: np.ndarray, wavelength_um: np.ndarray, curve: np.ndarray, value: np.ndarray,
    residual: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """Return the noise of the curve of each datum, (N, D); NaN in fits whose curves may have one.

    angle_deg: (D,) or (N, D). wavelength_um, curve: (D,), the number of the quantity of a file.
    value, residual: (N, D) of N fits, NaN where there is none. The noise is that of neighbours
    along the wavelength, or along the angle: what the fit misses smoothly is not in it, so that it
    does not depend on which minimum was found.
    """
    value, residual = np.broadcast_arrays(value, residual)
    out, angle_deg = np.full(residual.shape, np.nan), np.atleast_2d(angle_deg)
    if not curve.any():
        return out
    axis, other = np.atleast_2d(wavelength_um), angle_deg[0]
    if len(np.unique(wavelength_um)) == 1:
        axis, other = angle_deg, np.zeros(len(curve))
    square, least, count = np.zeros((3, curve.max() + 1, len(residual)))
    for c, at in {*zip(curve.tolist(), other.tolist(), strict=True)}:
        rows = np.flatnonzero((curve == c) & (other == at))
        sigma, size = neighbour_noise(axis[:, rows], residual[:, rows])
        square[c] += np.nan_to_num(sigma**2 * size)
        count[c] += size
    noise, enough = np.sqrt(square / count), count.min(0)
    apart = 1.0 + _DIFFER / np.sqrt(enough)
    some = np.flatnonzero((enough >= _LEAST_TRIPLES) & (noise.max(0) > noise.min(0) * apart))
    for c in range(len(noise)):
        least[c, some] = rounding(value[some][:, curve == c])
    seen, noise = noise > least, np.maximum(noise, least)
    differ = np.take_along_axis(seen, noise.argmax(0)[None], 0)[0, some]
    some = some[differ & (noise.max(0) > noise.min(0) * apart)[some]]
    out[some] = noise.T[some][:, curve]
    return out


# The degree of the smooth functions: Chebyshev polynomials of the position, of each curve its own.
DEGREE = 3
# Draws of random signs, and curves whose draws are made side by side.
_DRAWS, _BLOCK = 4000, 64


def smooth_functions(position: np.ndarray) -> np.ndarray:
    """Return polynomials (L, M, DEGREE + 1) of positions (L, M), over the range of each curve."""
    low, high = (f(position, axis=-1, keepdims=True) for f in (np.min, np.max))
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    return np.polynomial.chebyshev.chebvander(
        (position - middle) / np.where(half > 0.0, half, 1.0), DEGREE
    )


def smooth_misfit(residual: np.ndarray, slopes: np.ndarray, smooth: np.ndarray) -> np.ndarray:
    """Return which residuals are smooth beyond chance, (L,).

    residual: (L, n), weighted, 0 where there is no datum. slopes: (L, n, p) of the weighted model
    by its parameters. smooth: (L, n, q), functions with the same weights.
    """
    unknowns, functions = slopes.shape[-1], smooth.shape[-1]
    count = (smooth != 0.0).any(-1).sum(-1)
    freedom = count - unknowns - functions
    found = np.zeros(len(residual), bool)
    some = np.flatnonzero(freedom > 0)
    if not len(some):
        return found
    r = residual[some]
    size = np.linalg.norm(slopes[some], axis=1, keepdims=True)
    unit = slopes[some] / np.where(size > 0.0, size, 1.0)
    q = np.linalg.qr(np.concatenate([unit, smooth[some]], -1))[0][..., unknowns:]
    square = (np.einsum("lnq,ln->lq", q, r) ** 2).sum(-1)
    rest = (r * r).sum(-1) - square
    with np.errstate(all="ignore"):
        ratio = (square / functions) / (rest / freedom[some])
    by_chance = fdtrc(functions, freedom[some], np.maximum(np.nan_to_num(ratio), 0.0))
    large = np.flatnonzero(by_chance < _CHANCE)
    if not len(large):
        return found
    signs = np.random.default_rng(0).integers(0, 2, (_DRAWS, r.shape[1]), dtype=np.int8)
    signs = 2.0 * signs.astype(np.float32) - 1.0
    for start in range(0, len(large), _BLOCK):
        rows = large[start : start + _BLOCK]
        scale = 1.0 / np.sqrt(square[rows])
        drawn = (q[rows] * (r[rows] * scale[:, None])[..., None]).astype(np.float32)
        columns = np.ascontiguousarray(np.swapaxes(drawn, 1, 2)).reshape(-1, r.shape[1])
        # Not a matrix product: the threads of one go on waiting for 20 ms, a large batch's time.
        other = np.einsum("dn,cn->dc", signs, columns) ** 2
        other = other.reshape(_DRAWS, len(rows), functions).sum(-1)
        found[some[rows]] = (other >= 1.0 - 1e-5).mean(0) < _CHANCE
    return found


@np.errstate(all="ignore")
def noise_of_misfits(
    angle_deg: np.ndarray, value: np.ndarray, off: np.ndarray, weight: np.ndarray,
    slopes: Callable[[np.ndarray], np.ndarray],
) -> np.ndarray:  # fmt: skip
    """Return the noise of the kind of data that a fit misses most, (N,); NaN where it is no misfit.

    angle_deg: (N, M). value, off, weight: (N, K, M), K kinds of data, the difference of the model
    from them, and 1 / sigma, 0 where there is none. slopes: of the curves of numbers (n,) the
    derivatives (n, K, M, p) of the model, whose directions alone count.
    """
    used = (weight > 0.0).any((0, 1))
    angle_deg, value, off, weight = (a[..., used] for a in (angle_deg, value, off, weight))
    there, (count, kinds, size) = weight > 0.0, weight.shape
    if not size:
        return np.full(count, np.nan)
    value, rows = np.where(there, value, np.nan), (-1, size)
    each = misfit(np.repeat(angle_deg, kinds, 0), value.reshape(rows),
                  np.where(there, off, np.nan).reshape(rows))  # fmt: skip
    rms, noise, found = (a.reshape(count, kinds) for a in each)
    some = np.flatnonzero(~found.any(1))
    if len(some):
        w = weight[some][..., None]
        smooth = smooth_functions(angle_deg[some])
        own = np.zeros((len(some), kinds, size, kinds, smooth.shape[-1]))
        for i in range(kinds):
            own[:, i, :, i] = smooth
        own = own.reshape(len(some), kinds, size, -1)
        parts = (
            np.where(there, off, 0.0)[some][..., None] * w,
            slopes(some)[:, :, used] * w,
            own * w,
        )
        r, J, S = (a.reshape(len(some), kinds * size, -1) for a in parts)
        wrong = some[smooth_misfit(r[..., 0], J, S)]
        found[wrong] = rms[wrong] > rounding(value[wrong].reshape(rows)).reshape(-1, kinds)
    worst = np.where(found, rms, -np.inf).argmax(1)
    return np.where(found.any(1), noise[np.arange(count), worst], np.nan)
