"""The lowest minimum of a curve by a dense search that shares nothing with the fit it judges.

All nodes of a dense grid of eta and k are compared with the curve by the textbook formula; the
lowest grid minima are polished by scipy.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares

from tests.truth.random_measurements import Batch, Geometry, textbook

# Relative index: n from .03 to 30, k of 0 and 1e-4 to 30, steps of 5 to 12 %.
N = np.geomspace(0.03, 30.0, 140)
K = np.concatenate([[0.0], np.geomspace(1e-4, 0.03, 12)[:-1], np.geomspace(0.03, 30.0, 60)])
GRID_MINIMA = 3


def grid_misfits(batch: Batch) -> np.ndarray:
    """Return the sums of squares of all curves at all nodes, (len(N), len(K), curves)."""
    g = batch.geometry
    index = (N[:, None] + 1j * K[None, :]).reshape(-1, 1) * g.eta_i
    nodes = textbook(g.angles, index, g.eta_i)
    total = np.zeros((len(index), len(batch.eta)), np.float32)
    for name, value in batch.data.items():
        # About the mean of the data, so that single precision does.
        middle = value.mean(0)
        at, off = (nodes[name] - middle).astype(np.float32), (value - middle).astype(np.float32)
        total += (at * at).sum(1)[:, None] - 2.0 * (at @ off.T) + (off * off).sum(1)[None]
    return np.maximum(total, 0.0).reshape(len(N), len(K), -1)


def _among_neighbours(misfit: np.ndarray, of) -> np.ndarray:
    """Return ``of`` (np.minimum or np.maximum) each node and its eight neighbours."""
    fill = np.inf if of is np.minimum else -np.inf
    for axis in (0, 1):
        widths = [(1, 1) if a == axis else (0, 0) for a in range(3)]
        wide = np.pad(misfit, widths, constant_values=fill)
        size = misfit.shape[axis]
        parts = [np.take(wide, range(i, i + size), axis=axis) for i in range(3)]
        misfit = of(of(parts[0], parts[1]), parts[2])
    return misfit


def suspects(
    batch: Batch, eta: np.ndarray, k: np.ndarray, cost: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return grid minima that may hide a fit better than the one found: curve, eta and k of each.

    eta, k, cost: (N,), the fit that is judged, and its sum of squares. A grid minimum is suspect if
    it is not beside that fit and the cost could fall below ``cost`` within its cell: by half of the
    rise to its highest neighbour at most.
    """
    misfit = grid_misfits(batch)
    low = misfit <= _among_neighbours(misfit, np.minimum)
    rise = _among_neighbours(misfit, np.maximum) - misfit
    eta_i = batch.geometry.eta_i
    at_n = np.argmin(np.abs(np.log(N[:, None] * eta_i / eta[None])), axis=0)
    at_k = np.argmin(np.abs(K[:, None] * eta_i - k[None]), axis=0)
    near = (np.abs(np.arange(len(N))[:, None, None] - at_n) <= 1) & (
        np.abs(np.arange(len(K))[None, :, None] - at_k) <= 1
    )
    low &= ~near & (misfit - 0.5 * rise < cost)
    i, j, curve = np.nonzero(low)
    # The lowest of each curve.
    order = np.lexsort((misfit[i, j, curve], curve))
    i, j, curve = i[order], j[order], curve[order]
    rank = np.arange(len(curve)) - np.searchsorted(curve, curve)
    keep = rank < GRID_MINIMA
    return curve[keep], N[i[keep]] * eta_i, K[j[keep]] * eta_i


def polished(
    geometry: Geometry, data: dict[str, np.ndarray], eta: float, k: float
) -> tuple[float, float, float]:
    """Return the sum of squares, eta and k of the minimum that scipy reaches from a start.

    data: (M,) each. In log eta and k^2 (beyond k = 0 as at 0), free of bounds.
    """

    def residuals(y: np.ndarray) -> np.ndarray:
        index = np.exp(y[0]) + 1j * np.sqrt(max(y[1], 0.0))
        found = textbook(geometry.angles, index, geometry.eta_i)
        return np.concatenate([found[name] - value for name, value in data.items()])

    start = np.array([np.log(eta), max(k * k, 1e-8)])
    bounds = ([-7.0, 0.0], [7.0, 1e5])
    best = least_squares(
        residuals, start, bounds=bounds, x_scale=[0.1, max(k * k, 0.01)], xtol=1e-12, ftol=1e-12,
        gtol=1e-15, max_nfev=100,
    )  # fmt: skip
    return 2.0 * float(best.cost), float(np.exp(best.x[0])), float(np.sqrt(best.x[1]))
