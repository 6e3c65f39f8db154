"""Whether the residuals of a curve are smooth in part, which those of noise are not.

A model that is wrong misses its data smoothly. The part of the residuals r that a smooth function
describes, in directions in which the parameters of the fit cannot move the curve,

    S = |Q^T r|^2        Q: orthonormal; spans the smooth functions without the slopes of the model

is compared with that of noise: by F, for errors of one size, and then with the S of the same
residuals with random signs (J. G. MacKinnon, Journal of Econometrics 7, 1 (1986), calls a test of
such draws a wild bootstrap), so that a few large residuals at one end of the curve are no misfit.
Fourteen angles are enough where the misfit is 3 times the noise; a test of neighbours alone
(`noise.misfit`) needs 4 times, or more angles.
"""

from __future__ import annotations

import numpy as np
from scipy.special import fdtrc

# The degree of the smooth functions: Chebyshev polynomials of the position, of each curve its own.
DEGREE = 3
# The noise of a good fit is called smooth by chance in less than this part of fits.
_CHANCE = 1e-3
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
