"""Stated errors that the residuals contradict: one factor on all, or one common error added.

    factor:  sigma_i^2 -> f^2 sigma_i^2          floor:  sigma_i^2 -> sigma_i^2 + s^2

Each has one number, found by maximum likelihood, so that the two are compared by their likelihoods.
A factor keeps the stated weights: if the stated errors of one polarization are a hundred times
smaller than those of the other and both have the same further error, only the first one has
weight, and 95 % intervals contain the true value in 60 % of repeats, those with a floor in 94 %.
Conversely, if all errors are too small by one factor and unequal, the floor gives values ten times
worse.

Where residuals are autocorrelated (lag-1 correlation rho, see `pattern`) fewer are independent;
the variance of a mean grows by (1 + rho) / (1 - rho), and errors are widened by its root.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

# What may be believed of stated errors; see `fitting.fit`.
ERRORS = ("auto", "stated", "scaled", "floor", "equal")

# Doublings and halvings of the search for s: to 1e-6 of itself.
_STEPS = 60
# How often the weights are updated and the fit is repeated; then s changes by less than 1 %.
ROUNDS = 4
# A common error is used only if it is likelier by this much (2 in 2 log L: a factor e).
GAIN = 1.0
# Beyond this correlation the factor would exceed 6, and the errors are unknown.
MOST_CORRELATED = 0.95


class Floor(NamedTuple):
    """A common error s, and by how much its log likelihood is above that of one factor."""

    s: np.ndarray
    gain: np.ndarray


def _minus_two_log(square: np.ndarray, variance: np.ndarray) -> np.ndarray:
    """Return -2 log likelihood, (...), of squares of residuals (..., n); variance 0: no datum."""
    used = variance > 0.0
    safe = np.where(used, variance, 1.0)
    return np.where(used, square / safe + np.log(safe), 0.0).sum(-1)


def likeliest_floor(residual: np.ndarray, sigma: np.ndarray) -> Floor:
    """Return the common error of residuals (..., n) with stated errors (..., n) > 0.

    A sigma of inf leaves a datum out. The likelihood in s has one maximum if the residuals are of
    one size; its derivative is bisected from the largest residual downwards.
    """
    used = np.isfinite(sigma)
    square = np.where(used, residual, 0.0) ** 2
    stated = np.where(used, sigma, 0.0) ** 2
    count = used.sum(-1)

    def slope(s2: np.ndarray) -> np.ndarray:
        total = np.where(used, stated + s2[..., None], 1.0)
        return np.where(used, (1.0 - square / total) / total, 0.0).sum(-1)

    high = np.sqrt(square.max(-1)) + 1e-300
    low = np.zeros_like(high)
    for _ in range(_STEPS):
        middle = 0.5 * (low + high)
        rising = slope(middle**2) > 0.0
        low, high = np.where(rising, low, middle), np.where(rising, middle, high)
    s = np.where(slope(np.zeros_like(high)) >= 0.0, 0.0, 0.5 * (low + high))
    safe = np.where(used, stated, 1.0)
    factor2 = np.where(used, square / safe, 0.0).sum(-1) / np.maximum(count, 1)
    by_factor = _minus_two_log(square, stated * np.maximum(factor2, 1e-300)[..., None])
    with_floor = np.where(used, stated + (s**2)[..., None], 0.0)
    # A factor on top of both, as the errors of the parameters are scaled by the scatter, too.
    by_floor = _minus_two_log(square, with_floor)
    return Floor(s, 0.5 * (by_factor - by_floor))


def widening(correlation: np.ndarray) -> np.ndarray:
    """Return sqrt((1 + rho) / (1 - rho)) for a lag-1 correlation; 1 if it is NaN or below 0."""
    rho = np.clip(np.nan_to_num(correlation), 0.0, MOST_CORRELATED)
    return np.sqrt((1.0 + rho) / (1.0 - rho))


def beyond_chance(chi2_reduced: Any, dof: Any) -> tuple[Any, Any]:
    """Return where chi2 / dof is above 1 by 5 sigma and by half, and where it is so far below."""
    with np.errstate(all="ignore"):
        error = np.sqrt(2.0 / np.asarray(dof))
        large = (chi2_reduced > 1.0 + 5.0 * error) & (chi2_reduced > 1.5)
        # The distribution is skew: for fewer than 50 degrees of freedom 5 sigma below 1 is below 0.
        small = (chi2_reduced < 1.0 / (1.0 + 5.0 * error)) & (chi2_reduced < 1.0 / 1.5)
    return large, small
