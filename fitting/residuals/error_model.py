"""Stated errors that the residuals contradict: a factor on all, or a further error added to them.

    factor:    sigma_i^2 -> f^2 sigma_i^2
    floor:     sigma_i^2 -> sigma_i^2 + s^2
    relative:  sigma_i^2 -> sigma_i^2 + (s R_i)^2        with the fitted R_i

Each has one number, found by maximum likelihood, so that they are compared by their likelihoods, of
each at its own best fit. A factor keeps the stated weights: if the stated errors of one
polarization are a hundred times smaller than those of the other and both have the same further
error, only the first one has weight, and 95 % intervals contain the true value in 60 % of repeats,
those with a floor in 94 %. Conversely, if all errors are too small by one factor and unequal, the
floor gives values ten times worse. And with an error in proportion to R the data near Brewster's
angle are the best ones: for silicon and 5 % of R the intervals with equal weights are three times
as wide.

Where residuals are autocorrelated (lag-1 correlation rho, see `pattern`) fewer are independent;
the variance of a mean grows by (1 + rho) / (1 - rho), and errors are widened by its root.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy.special import chdtr, chdtrc

ADDED = FLOOR, RELATIVE = "floor", "relative"
# Without stated errors: each quantity has the scatter of its own residuals.
OF_EACH = "of each quantity"
# What may be believed of stated errors; see `fitting.fit`.
ERRORS = ("auto", "stated", "scaled", *ADDED, "equal")
# Those of them that need a stated error of every datum.
NEED_STATED = ("stated", *ADDED)
# An rms of residuals, in units of R, T, N, C, S, that no measurement has by its noise.
OUT_OF_MODEL = 0.1

# Doublings and halvings of the search for s: to 1e-6 of itself.
_STEPS = 60
# How often the weights are updated and the fit is repeated at most; then s changes by less than
# SETTLED of itself.
ROUNDS, SETTLED = 4, 0.01
# A further error is used only if its log likelihood is higher by this much. With 1 one in forty
# curves whose errors are wrong by one factor had another error, with 2 one in a hundred; intervals
# hold the truth equally often.
GAIN = 2.0
# The fit with one factor may follow the few best data alone where errors are stated that are more
# unequal than this; its residuals then say little of a further error.
UNEQUAL = 10.0
# So few of right fits have so small, or so large, a chi2 that their stated errors are doubted.
UNLIKELY = 1e-3
# Beyond this correlation the factor would exceed 6, and the errors are unknown.
MOST_CORRELATED = 0.95


class Added(NamedTuple):
    """The likeliest error s that is added to stated ones in squares, and -2 log likelihood."""

    s: np.ndarray
    minus_two_log: np.ndarray


def added_kinds(errors: str) -> tuple[str, ...]:
    """Return the kinds of further errors that ``errors`` lets a fit consider."""
    return tuple(kind for kind in ADDED if errors in ("auto", kind))


def sizes(kind: Any, fitted: np.ndarray, power: Any = True) -> np.ndarray:
    """Return what s is multiplied with for each datum.

    kind: a kind of further error, or one for each datum. fitted: their fitted values. power: which
    of them are powers; an error in proportion to psi or Delta means nothing, and these keep their
    stated errors.
    """
    relative = np.where(power, np.abs(fitted), 0.0)
    return np.where(np.asarray(kind) == RELATIVE, relative, 1.0)


def _minus_two_log(square: np.ndarray, variance: np.ndarray) -> np.ndarray:
    """Return -2 log likelihood, (...), of squares of residuals (..., n); variance 0: no datum."""
    used = variance > 0.0
    safe = np.where(used, variance, 1.0)
    return np.where(used, square / safe + np.log(safe), 0.0).sum(-1)


def one_factor(residual: np.ndarray, sigma: np.ndarray) -> np.ndarray:
    """Return -2 log likelihood of residuals (..., n) with the likeliest factor on sigma.

    A sigma of inf leaves a datum out.
    """
    used = np.isfinite(sigma)
    square = np.where(used, residual, 0.0) ** 2
    stated = np.where(used, sigma, 0.0) ** 2
    of_each = np.where(used, square / np.where(used, stated, 1.0), 0.0)
    factor2 = of_each.sum(-1) / np.maximum(used.sum(-1), 1)
    return _minus_two_log(square, stated * np.maximum(factor2, 1e-300)[..., None])


def likeliest_added(residual: np.ndarray, sigma: np.ndarray, size: np.ndarray) -> Added:
    """Return the further error of residuals (..., n) with stated errors sigma (..., n) > 0.

    size: see `sizes`. A sigma of inf leaves a datum out. The likelihood in s has one maximum if the
    residuals are of one size; its derivative is bisected from the largest residual downwards.
    """
    used = np.isfinite(sigma)
    square = np.where(used, residual, 0.0) ** 2
    stated = np.where(used, sigma, 0.0) ** 2
    size2 = np.where(used, size, 0.0) ** 2

    def slope(s2: np.ndarray) -> np.ndarray:
        total = np.where(used, stated + s2[..., None] * size2, 1.0)
        return np.where(used, size2 * (1.0 - square / total) / total, 0.0).sum(-1)

    with np.errstate(divide="ignore", invalid="ignore"):
        high = np.sqrt(np.where(size2 > 0.0, square / size2, 0.0).max(-1)) + 1e-300
    low = np.zeros_like(high)
    for _ in range(_STEPS):
        middle = 0.5 * (low + high)
        rising = slope(middle**2) > 0.0
        low, high = np.where(rising, low, middle), np.where(rising, middle, high)
    s = np.where(slope(np.zeros_like(high)) >= 0.0, 0.0, 0.5 * (low + high))
    return Added(s, _minus_two_log(square, np.where(used, stated + (s**2)[..., None] * size2, 0.0)))


def worth_a_fit(errors: str, residual: np.ndarray, sigma: np.ndarray, added: Added) -> np.ndarray:
    """Return where a fit with the further error, known from the fit with one factor, is made.

    By "auto" it is one that is likelier there, or whose stated errors are UNEQUAL.
    """
    if errors != "auto":
        return added.s > 0.0
    used = np.isfinite(sigma)
    most, least = np.where(used, sigma, 0.0).max(-1), np.where(used, sigma, np.inf).min(-1)
    gain = 0.5 * (one_factor(residual, sigma) - added.minus_two_log)
    return (added.s > 0.0) & ((gain >= GAIN) | (most > UNEQUAL * least))


def widening(correlation: np.ndarray) -> np.ndarray:
    """Return sqrt((1 + rho) / (1 - rho)) for a lag-1 correlation; 1 if it is NaN or below 0."""
    rho = np.clip(np.nan_to_num(correlation), 0.0, MOST_CORRELATED)
    return np.sqrt((1.0 + rho) / (1.0 - rho))


def misses_without_freedom(cost: Any, plain: Any, count: Any, dof: Any, stated: bool) -> Any:
    """Return where a fit without a degree of freedom misses its data all the same.

    That is by four stated standard errors (rms); by `OUT_OF_MODEL` if none are stated.
    cost, plain: sums of squared residuals, in units of their errors and of R, T, N, C, S.
    """
    far = cost > 16.0 * count if stated else plain > OUT_OF_MODEL**2 * count
    return (dof == 0) & (count > 0) & far


def beyond_chance(chi2_reduced: Any, dof: Any, unlikely: float = UNLIKELY) -> tuple[Any, Any]:
    """Return where chi2 / dof is far above 1, and where it is far below.

    That is beyond the ``unlikely`` quantiles of its distribution, and above 1.3 or below 1 / 1.5:
    less changes no error by much.
    """
    with np.errstate(all="ignore"):
        chi2 = np.asarray(dof) * chi2_reduced
        large, small = chdtrc(dof, chi2) < unlikely, chdtr(dof, chi2) < unlikely
    return large & (chi2_reduced > 1.3), small & (chi2_reduced < 1.0 / 1.5)
