"""Candidates for the thickness of a film: a scan that compares its fringes with the data.

The misfit of a film's thickness has a minimum at every fringe order, some 10 to 200 of them, and
Levenberg and Marquardt's method ends in the nearest. The order follows from the rate at which the
phase

    phase = 2 pi d g,    g = 2 sqrt(N^2 - eta_i^2 sin^2) / wavelength

runs along the data. So for every thickness of a fine grid, and for each of many candidates for the
film's index, smooth curves times 1, cos(phase) and sin(phase) are fitted to the data by linear
least squares: neither the substrate nor the contrast of the fringes need be known. The best of them
are refined by the full model (`starts`), on all sides by a fringe.

Source: the idea of a least-squares periodogram, N. R. Lomb, Astrophys. Space Sci. 39, 447 (1976),
doi:10.1007/BF00648343, in the phase of a dispersive film.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

# Tolerated error of the phase between the two ends of the data, in periods.
_STEP = 0.15
_LARGEST_GRID = 6000
# Thicknesses below a quarter of a fringe differ in no phase: a few are tried, even in logarithm.
_THIN = 8
# Points of the window of the Fourier transform. Its shape suits twice as many points as there are
# thicknesses.
_WIDTH = 12
_SHAPE = np.pi * np.sqrt((0.75 * _WIDTH) ** 2 - 0.8)


def phase_rate(
    eta: np.ndarray, wavelength_um: np.ndarray, angle_deg: np.ndarray, eta_i: np.ndarray | float
) -> np.ndarray:
    """Return g, periods per micrometre of thickness, (..., M)."""
    transverse = eta_i * np.sin(np.radians(angle_deg))
    return 2.0 * np.sqrt(np.maximum(eta * eta - transverse**2, 0.01)) / wavelength_um


class Grid(NamedTuple):
    """Thicknesses in micrometres: small ones, and ``count`` from ``first`` on in even steps."""

    thin: np.ndarray
    first: float
    step: float
    count: int

    @property
    def even(self) -> np.ndarray:
        """Those in even steps."""
        return self.first + self.step * np.arange(self.count)

    @property
    def thickness_um(self) -> np.ndarray:
        """All of them, (D,)."""
        return np.concatenate([self.thin, self.even])


def thickness_grid(rate: np.ndarray, low_um: float, high_um: float) -> Grid:
    """Return thicknesses between two, so close that the data do not resolve their phases."""
    spread = max(float(np.ptp(rate)), 1e-3 * float(rate.max()))
    count = int(np.clip(np.ceil((high_um - low_um) * spread / _STEP), 1, _LARGEST_GRID))
    step = (high_um - low_um) / count
    least = max(low_um, 1e-4 * high_um)
    thin = np.geomspace(least, max(min(high_um, 2.0 * _STEP / spread), least), _THIN)
    return Grid(thin, low_um + 0.5 * step, step, count)


def harmonic_sums(vectors: np.ndarray, rate: np.ndarray, grid: Grid) -> np.ndarray:
    """Return sum_m vectors[v, m] exp(2 pi i rate[m] d) at all thicknesses d of a grid, (V, D).

    By a fast Fourier transform of the vectors (V, M), spread over an even grid of rates with Kaiser
    and Bessel's window (J. Fessler and B. Sutton, IEEE Trans. Signal Process. 51, 560 (2003),
    doi:10.1109/TSP.2002.807005). Its error is below 1e-11 of the sum of abs(vectors).
    """
    thin = vectors @ np.exp(2j * np.pi * np.outer(rate, grid.thin))
    from scipy import sparse, special  # slow to import, of use for films alone

    size = 1 << int(np.ceil(np.log2(2 * grid.count)))
    # Thicknesses count from the middle one: at the ends the transform of the window is small.
    middle = grid.count // 2
    place = size * (rate * grid.step)
    near = np.floor(place).astype(int)[:, None] + np.arange(1 - _WIDTH // 2, 1 + _WIDTH // 2)
    distance = (near - place[:, None]) / (0.5 * _WIDTH)
    window = special.i0(_SHAPE * np.sqrt(np.maximum(1.0 - distance * distance, 0.0)))
    turned = vectors * np.exp(2j * np.pi * rate * grid.even[middle])
    rows = sparse.csr_array(
        (window.ravel(), (near % size).ravel(), np.arange(len(rate) + 1) * _WIDTH),
        shape=(len(rate), size),
    )
    off = np.arange(grid.count) - middle
    found = size * np.fft.ifft((rows.T @ turned.T).T)[:, off]
    x = np.sqrt(_SHAPE**2 - (np.pi * _WIDTH * off / size) ** 2)
    return np.concatenate([thin, found * (x / (_WIDTH * np.sinh(x)))], 1)


def _alike(values: np.ndarray, weights: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return groups of curves (C, M) with one weight (M,), which share most sums over the data."""
    groups: dict[bytes, list[int]] = {}
    scale = weights.max(1, keepdims=True)
    for i in np.flatnonzero(scale[:, 0]).tolist():
        groups.setdefault((weights[i] / scale[i]).tobytes(), []).append(i)
    # A factor on the weight of a curve is one on its values.
    return [((values * scale)[rows], weights[rows[0]] / scale[rows[0]]) for rows in groups.values()]


def _misfit(rate: np.ndarray, grid: Grid, values: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Return the sum of squares (D,) of curves (C, M) less smooth curves and fringes.

    rate, weight: (M,); weight 0 leaves out. The smooth curves are 1, x and x^2, what fringes are
    multiplied by 1 and x, where x is g itself, which runs evenly along a spectrum and an angle.
    """
    x, w = (rate - rate.mean()) / (np.ptp(rate) or 1.0), weight * weight
    powers = np.stack([np.ones_like(x), x, x * x, x * x * x])
    a, b = 3, 2
    size = a + 2 * b
    i, j = np.arange(b)[:, None], np.arange(a)
    moments = (powers[:, None] * powers[:a] * w).sum(-1)  # (4, a)
    seen = powers[None, :b] * (w * values)[:, None]  # (C, b, M)
    vectors = np.concatenate([powers * w, seen.reshape(-1, len(w))])
    once = harmonic_sums(vectors, rate, grid)
    twice = harmonic_sums(powers[:3] * w, 2.0 * rate, grid)
    count = once.shape[1]
    even, twice = moments[:b, :b], np.moveaxis(twice[i + np.arange(b)], -1, 0)
    mixed = np.moveaxis(once[i + j], -1, 0)  # (D, b, a)
    matrix = np.empty((count, size, size))
    matrix[:, :a, :a] = moments[:a]
    matrix[:, a : a + b, :a], matrix[:, a + b :, :a] = np.real(mixed), np.imag(mixed)
    matrix[:, a : a + b, a : a + b] = 0.5 * (even + np.real(twice))
    matrix[:, a + b :, a + b :] = 0.5 * (even - np.real(twice))
    matrix[:, a + b :, a : a + b] = 0.5 * np.imag(twice)
    matrix[:, :a, a:] = np.swapaxes(matrix[:, a:, :a], 1, 2)
    matrix[:, a : a + b, a + b :] = np.swapaxes(matrix[:, a + b :, a : a + b], 1, 2)
    right = np.empty((count, size, len(values)))
    right[:, :a] = powers[:a] @ (w * values).T
    of_fringes = np.moveaxis(once[4:].reshape(len(values), b, count), -1, 0).swapaxes(1, 2)
    right[:, a : a + b], right[:, a + b :] = np.real(of_fringes), np.imag(of_fringes)
    # A thin film's fringes are nearly smooth curves: a little damping, in parts of the diagonal.
    diagonal = np.einsum("dii->di", matrix)
    diagonal += 1e-7 * np.maximum(diagonal, 1e-300) + 1e-300
    found = np.linalg.solve(matrix, right)
    return np.sum(w * values * values) - np.sum(found * right, axis=(1, 2))


def local_minima(cost: np.ndarray) -> np.ndarray:
    """Return which costs (D,) are not above those beside them."""
    return np.r_[True, cost[1:] <= cost[:-1]] & np.r_[cost[:-1] <= cost[1:], True]


def likely_thicknesses(
    rates: np.ndarray,
    low_um: float,
    high_um: float,
    values: np.ndarray,
    weights: np.ndarray,
    count: int,
    most: float = np.inf,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the candidate indices and thicknesses that describe the fringes best, (count,) each.

    rates: (J, M) of the candidates. The lowest local minima of the misfit over thickness, of all
    candidates together, the best first. most: leave out those whose misfit is so many times that
    of the best.
    """
    groups = _alike(values, weights)
    which, where, left = [], [], []
    for j, rate in enumerate(rates):
        grid = thickness_grid(rate, low_um, high_um)
        thickness = grid.thickness_um
        rising = np.argsort(thickness, kind="stable")
        thickness = thickness[rising]
        cost = np.sum([_misfit(rate, grid, *group) for group in groups], 0)[rising]
        best = np.flatnonzero(local_minima(cost))
        best = best[np.argsort(cost[best], kind="stable")[: max(6, count // len(rates))]]
        which.append(np.full(len(best), j))
        where.append(thickness[best])
        left.append(cost[best])
    misfits = np.concatenate(left)
    order = np.argsort(misfits, kind="stable")[:count]
    order = order[misfits[order] <= most * misfits[order[0]]]
    return np.concatenate(which)[order], np.concatenate(where)[order]
