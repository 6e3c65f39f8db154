"""BIC and AICc, by which models of the same data are compared.

    -2 log(likelihood) = sum_i rho(r_i / s) + 2 n log(s) + constant

of residuals r whose density is exp(-rho/2) / (s Z): Gaussian for least squares; for Huber's loss
Gaussian with exponential tails (P. J. Huber, Ann. Math. Stat. 35, 73 (1964),
doi:10.1214/aoms/1177703732).

If the noise s is not known, it is the one that minimises this sum, for each model by itself (the
profile likelihood). The noise from the median of the residuals, with which robust fits run, cannot
be used here: the sum is not stationary there, and 5 % more or less of it, by chance, change the sum
by 1 to 3 units at 80 data. For unknown noise, fits with Huber's loss are compared by the t law of 3
degrees of freedom, rho(x) = 4 log(1 + x^2 / 4): with his tails outliers alone determine the
likeliest s (12 % of outliers at 100 times the noise make it 16 times the noise; with the t law 1.1
times, and .7 without outliers), and all models look alike. BIC of robust fits by a robust
likelihood: J. A. F. Machado, Econometric Theory 9, 478 (1993).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from fitting.problem.programs import HUBER
from fitting.problem.slopes import loss_of

# "Positive" evidence ends and "strong" begins at a difference of BIC of 6 (Kass and Raftery).
MARGIN = 6.0
_EPS = float(np.finfo(float).eps)
_ROOT = math.sqrt(2.0 * math.pi)
# Z of each loss, and of the t law: the integral of exp(-rho/2).
_AREA = {
    "squares": _ROOT,
    "huber": _ROOT * math.erf(HUBER / math.sqrt(2.0)) + 2.0 * math.exp(-0.5 * HUBER**2) / HUBER,
}
_AREA_T = math.pi


def likeliest_noise(loss: str, residual: np.ndarray, n: int) -> float:
    """Return the s with the least sum of rho(r/s) + 2 n log(s), at least the rounding of 1.

    For a robust loss that of the t law, where sum of x^2 / (1 + x^2 / 4) is n, x = r / s; the sum
    falls as s grows.
    """
    size = math.sqrt(float(residual @ residual) / n)
    if loss == "squares" or size <= _EPS:
        return max(size, _EPS)
    low, high = math.log(_EPS), math.log(size)  # no term is above x^2
    for _ in range(60):
        middle = 0.5 * (low + high)
        square = (residual / math.exp(middle)) ** 2
        if (square / (1.0 + square / 4.0)).sum() > n:
            low = middle
        else:
            high = middle
    return math.exp(0.5 * (low + high))


@np.errstate(all="ignore")
def reduced_chi2(loss: str, residual: np.ndarray, dof: Any) -> Any:
    """Return chi2 / dof (...) of residuals (..., R); NaN without a degree of freedom.

    For a robust loss from the median of the residuals that are not 0, without outliers: the median
    of |residual| is .6745 standard deviations of Gaussian noise.
    """
    square, used = (residual**2).sum(-1), residual != 0.0
    if loss != "squares":
        some = used | ~used.any(-1, keepdims=True)
        median = np.nanmedian(np.where(some, np.abs(residual), np.nan), -1)
        square = (1.4826 * median) ** 2 * used.sum(-1)
    return np.where(np.asarray(dof) > 0, square / dof, np.nan)[()]


def noise_of(loss: str, residual: np.ndarray, dof: Any, squares: Any, n_data: Any) -> Any:
    """Return the noise (...) that residuals (..., R) tell, at least that of rounding.

    squares: (...), the sum of squares of the data.
    """
    least = 1e-9 * np.sqrt(squares / np.maximum(n_data, 1)) + 1e-300
    return np.maximum(np.sqrt(reduced_chi2(loss, residual, np.maximum(dof, 1))), least)


def criteria(
    loss: str, residual: np.ndarray, n: int, unknowns: int, scaled: bool
) -> tuple[float, float]:
    """Return BIC and AICc.

    residual: (R,) weighted. n: data. unknowns: free parameters. scaled: whether the noise is
    unknown, or 1. The constant is that of least squares: chi2 or n log(chi2 / n).
    """
    s = likeliest_noise(loss, residual, n) if scaled else 1.0
    # The noise of a perfect fit is that of rounding.
    least, area = loss_of(loss, residual / s), _AREA[loss]
    if scaled and loss == "huber":
        least, area = 4.0 * float(np.log1p((residual / s) ** 2 / 4.0).sum()), _AREA_T
    least += 2.0 * n * math.log(s * area / _ROOT)
    least -= n if scaled else 0.0
    count = unknowns + 1 if scaled else unknowns
    return float(least + unknowns * math.log(n)), corrected_aic(float(least), count, n)


def corrected_aic(least: float, count: int, n: int) -> float:
    """Return AICc of n data: of ``count`` unknowns, the noise among them if it is one."""
    room = n - count - 1
    return least + 2.0 * count * n / room if room > 0 else math.inf
