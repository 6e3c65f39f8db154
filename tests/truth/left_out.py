"""Intervals that leave out a true index which fits as well as their ends."""

from __future__ import annotations

import numpy as np
from scipy import stats

from fitting import Fit
from fitting.uncertainty.beside_zero import ONE_SIDED, TWO_SIDED
from tests.truth.random_measurements import Batch, textbook


def cost_of(found: Fit) -> np.ndarray:
    """Return the sum of squares of the fits, (N,)."""
    return found.rms**2 * found.n_data


def cost_of_truth(batch: Batch) -> np.ndarray:
    """Return the sum of squares of the true index, (N,)."""
    g = batch.geometry
    exact = textbook(g.angles, (batch.eta + 1j * batch.k)[:, None], g.eta_i)
    return np.sum([((exact[q] - v) ** 2).sum(1) for q, v in batch.data.items()], axis=0)


LEAST_ROOT = ONE_SIDED / TWO_SIDED
"""The root of the least rise that ends an interval by profile, in parts of t (`beside_zero`)."""


def rise_allowed(rise: np.ndarray, dof: np.ndarray, root: float = LEAST_ROOT) -> np.ndarray:
    """Return where the root of a rise of chi2 is at most this part of t."""
    with np.errstate(all="ignore"):
        return (dof > 0) & (rise <= (root * stats.t.ppf(0.975, dof)) ** 2)


def far_outside(result: Fit, eta: np.ndarray, k: np.ndarray) -> np.ndarray:
    """Return where an interval leaves out the truth by more than a tenth of its width, (N,)."""
    outside = np.zeros(len(eta), bool)
    for name, truth in (("eta", eta), ("k", k)):
        low, high = np.moveaxis(result.parameters[name].interval, -1, 0)
        outside |= np.maximum(low - truth, truth - high) > 0.1 * np.maximum(high - low, 1e-9)
    return outside


def left_out(batch: Batch, result: Fit, root: float = LEAST_ROOT) -> np.ndarray:
    """Return whose interval leaves out a true index that fits as well as its ends, (N,).

    root: of the rise at the ends, in parts of t: 1 for quadratic intervals.
    """
    cost, dof = cost_of(result), result.n_data - 2
    with np.errstate(all="ignore"):
        allowed = rise_allowed((cost_of_truth(batch) - cost) / (cost / dof), dof, root)
    return allowed & far_outside(result, batch.eta, batch.k)
