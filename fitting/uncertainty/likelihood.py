"""BIC and AICc, by which models of the same data are compared.

    -2 log(likelihood) = sum_i rho(r_i / s) + 2 n log(s) + constant

of residuals r whose density is exp(-rho/2) / (s Z): Gaussian for least squares; for Student's loss,
4 log(1 + r^2 / 4), the t law of 3 degrees of freedom; for Huber's Gaussian with exponential tails
(P. J. Huber, Ann. Math. Stat. 35, 73 (1964), doi:10.1214/aoms/1177703732).

If the noise s is not known, it is the one that minimises this sum, for each model by itself (the
profile likelihood). The noise from the median of the residuals, with which robust fits run, cannot
be used here: the sum is not stationary there, and 5 % more or less of it, by chance, change the sum
by 1 to 3 units at 80 data. For unknown noise, fits with Huber's loss are compared by the t law as
well: with his tails outliers alone determine the likeliest s (12 % of outliers at 100 times the
noise make it 16 times the noise; with the t law 1.1 times, and .7 without outliers), and all models
look alike. BIC of robust fits by a robust likelihood: J. A. F. Machado, Econometric Theory 9, 478
(1993).
"""

from __future__ import annotations

import math

import numpy as np

from fitting.problem.programs import HUBER
from fitting.problem.slopes import influence, loss_of

_EPS = float(np.finfo(float).eps)
_ROOT = math.sqrt(2.0 * math.pi)
# Z of each loss: the integral of exp(-rho/2).
_AREA = {
    "squares": _ROOT,
    "huber": _ROOT * math.erf(HUBER / math.sqrt(2.0)) + 2.0 * math.exp(-0.5 * HUBER**2) / HUBER,
    "student": math.pi,
}


def likeliest_noise(loss: str, residual: np.ndarray, n: int) -> float:
    """Return the s with the least sum of rho(r/s) + 2 n log(s), at least the rounding of 1.

    That is where sum of psi(x) x is n, x = r / s, psi = rho'/2; the sum falls as s grows.
    """
    size = math.sqrt(float(residual @ residual) / n)
    if loss == "squares" or size <= _EPS:
        return max(size, _EPS)
    low, high = math.log(_EPS), math.log(size)  # psi(x) x is at most x^2
    for _ in range(60):
        middle = 0.5 * (low + high)
        x = residual / math.exp(middle)
        if influence(loss, x)[0] @ x > n:
            low = middle
        else:
            high = middle
    return math.exp(0.5 * (low + high))


def reduced_chi2(loss: str, residual: np.ndarray, dof: int) -> float:
    """Return chi2 / dof; for a robust loss from the median of the residuals, without outliers.

    The median of |residual| is .6745 standard deviations of Gaussian noise.
    """
    if dof == 0:
        return math.nan
    if loss == "squares":
        return float(residual @ residual) / dof
    return (1.4826 * float(np.median(np.abs(residual)))) ** 2 * len(residual) / dof


def criteria(
    loss: str, residual: np.ndarray, n: int, unknowns: int, scaled: bool
) -> tuple[float, float]:
    """Return BIC and AICc.

    residual: (R,) weighted. n: data. unknowns: free parameters. scaled: whether the noise is
    unknown, or 1. The constant is that of least squares: chi2 or n log(chi2 / n).
    """
    loss = "student" if scaled and loss == "huber" else loss
    s = likeliest_noise(loss, residual, n) if scaled else 1.0
    # The noise of a perfect fit is that of rounding.
    least = loss_of(loss, residual / s) + 2.0 * n * math.log(s * _AREA[loss] / _ROOT)
    least -= n if scaled else 0.0
    count = unknowns + 1 if scaled else unknowns
    return float(least + unknowns * math.log(n)), corrected_aic(float(least), count, n)


def corrected_aic(least: float, count: int, n: int) -> float:
    """Return AICc of n data: of ``count`` unknowns, the noise among them if it is one."""
    room = n - count - 1
    return least + 2.0 * count * n / room if room > 0 else math.inf
