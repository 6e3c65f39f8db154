"""How thick a film may be: where its interference fringes put it, and a scan of the thickness.

The misfit of a film's thickness has a minimum at every fringe order, some 10 to 200 of them, and
Levenberg and Marquardt's method ends in the nearest. What tells the order is how fast the phase

    phase = 2 pi d g,    g = 2 sqrt(N^2 - eta_i^2 sin^2) / wavelength

runs along the data. So for every thickness of a fine grid, and for each of many candidates for the
film's index, smooth curves times 1, cos(phase) and sin(phase) are fitted to the data by linear
least squares: neither the substrate nor the contrast of the fringes need be known. The best of them
are refined by the full model (`starts`), on all sides by a fringe.

Source: the idea of a least-squares periodogram, N. R. Lomb, Astrophys. Space Sci. 39, 447 (1976),
doi:10.1007/BF00648343, in the phase of a dispersive film.
"""

from __future__ import annotations

import numpy as np

# Parts of a period that the relative phase between the ends of the data may be off by.
_STEP = 0.15
_LARGEST_GRID = 6000
# Thicknesses below a quarter of a fringe differ in no phase: a few, evenly in the logarithm.
_THIN = 8


def phase_rate(
    eta: np.ndarray, wavelength_um: np.ndarray, angle_deg: np.ndarray, eta_i: np.ndarray | float
) -> np.ndarray:
    """Return g, periods per micrometre of thickness, (..., M)."""
    transverse = eta_i * np.sin(np.radians(angle_deg))
    return 2.0 * np.sqrt(np.maximum(eta * eta - transverse**2, 0.01)) / wavelength_um


def thickness_grid(rate: np.ndarray, low_um: float, high_um: float) -> np.ndarray:
    """Return thicknesses (D,) between two, no phase between which the data could tell."""
    spread = max(float(np.ptp(rate)), 1e-3 * float(rate.max()))
    step = _STEP / spread
    count = int(np.clip(np.ceil((high_um - low_um) / step), 1, _LARGEST_GRID))
    even = low_um + (high_um - low_um) * (np.arange(count) + 0.5) / count
    least = max(low_um, 1e-4 * high_um)
    thin = np.geomspace(least, max(min(high_um, 2.0 * step), least), _THIN)
    return np.unique(np.concatenate([thin, even]))


def misfit(rate: np.ndarray, thickness_um: np.ndarray, values: np.ndarray, weights: np.ndarray):
    """Return the sum of squares that is left at each thickness, (D,).

    rate: (M,). values, weights: (C, M), one row for each measured curve; weight 0 leaves out.
    """
    phase = np.exp(2j * np.pi * np.outer(thickness_um, rate))
    # Smooth curves in g itself, which runs evenly along a spectrum and along the angle.
    x = (rate - rate.mean()) / (np.ptp(rate) or 1.0)
    smooth = np.stack([np.ones_like(x), x, x * x])
    envelope = smooth[:2]
    total = np.zeros(len(thickness_um))
    for value, weight in zip(values, weights, strict=True):
        w = weight * weight
        if not w.any():
            continue
        total += _left(phase, smooth, envelope, value, w)
    return total


def _left(phase, smooth, envelope, y, w) -> np.ndarray:
    """Return the weighted squares left by smooth curves and fringes of one curve, (D,)."""
    count, a, b = len(phase), len(smooth), len(envelope)
    size = a + 2 * b
    # sums over the data of products of columns, with cos and sin by the phase and its square
    # (einsum, not a matrix product: several threads for such small ones take eight times as long)
    pairs = np.einsum("im,jm,m->ijm", envelope, envelope, w)
    mixed = np.einsum("im,jm,m->ijm", envelope, smooth, w)
    once = np.einsum("dm,ijm->dij", phase, mixed)
    twice = np.einsum("dm,ijm->dij", phase * phase, pairs)
    even = pairs.sum(-1)
    seen = np.einsum("dm,im->di", phase, envelope * (w * y))
    matrix = np.empty((count, size, size))
    matrix[:, :a, :a] = np.einsum("im,jm,m->ij", smooth, smooth, w)
    matrix[:, a : a + b, :a], matrix[:, a + b :, :a] = once.real, once.imag
    matrix[:, a : a + b, a : a + b] = 0.5 * (even + twice.real)
    matrix[:, a + b :, a + b :] = 0.5 * (even - twice.real)
    matrix[:, a + b :, a : a + b] = 0.5 * twice.imag
    matrix[:, :a, a:] = np.swapaxes(matrix[:, a:, :a], 1, 2)
    matrix[:, a : a + b, a + b :] = np.swapaxes(matrix[:, a + b :, a : a + b], 1, 2)
    right = np.empty((count, size))
    right[:, :a] = smooth @ (w * y)
    right[:, a : a + b], right[:, a + b :] = seen.real, seen.imag
    # A thin film's fringes are nearly smooth curves: a little damping, in parts of the diagonal.
    diagonal = np.einsum("dii->di", matrix)
    diagonal += 1e-7 * np.maximum(diagonal, 1e-300) + 1e-300
    found = np.linalg.solve(matrix, right[..., None])[..., 0]
    return np.sum(w * y * y) - np.sum(found * right, axis=-1)


def likely_thicknesses(
    rates: np.ndarray,
    low_um: float,
    high_um: float,
    values: np.ndarray,
    weights: np.ndarray,
    count: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Return which candidate index, and which thickness, the fringes speak for, (count,) each.

    rates: (J, M) of the candidates. The lowest local minima of the misfit over thickness, of all
    candidates together, the best first.
    """
    which, where, left = [], [], []
    for j, rate in enumerate(rates):
        grid = thickness_grid(rate, low_um, high_um)
        cost = misfit(rate, grid, values, weights)
        lower = np.r_[True, cost[1:] <= cost[:-1]] & np.r_[cost[:-1] <= cost[1:], True]
        best = np.flatnonzero(lower)
        best = best[np.argsort(cost[best], kind="stable")[:6]]
        which.append(np.full(len(best), j))
        where.append(grid[best])
        left.append(cost[best])
    order = np.argsort(np.concatenate(left), kind="stable")[:count]
    return np.concatenate(which)[order], np.concatenate(where)[order]
