"""Ends of eta and k beside k = 0, at which a truth is held in 95 % (see `beside_zero`).

The rise of chi2 at such an end depends on how far k^2 lies from 0, in its standard errors, and on
the correlation of eta with it. The region is traced a second time with the least rise that can be
due, and every end is found between the two, in proportion to the root of the rise, which is linear
in the distance for a quadratic cost.
"""

from __future__ import annotations

import numpy as np

from fitting.bare_surface.curve_data import Data
from fitting.bare_surface.descent import Solved
from fitting.bare_surface.estimate import K_MIN, Estimated
from fitting.bare_surface.region import Region, profile
from fitting.uncertainty.beside_zero import (
    ONE_SIDED,
    TWO_SIDED,
    by_valley,
    other_roots,
    own_roots,
)


def near_zero(e: Estimated, k: np.ndarray) -> np.ndarray:
    """Return where k = 0 is less than two half widths away, for ends of k (N, 2)."""
    power = np.where(e.linear, 1.0, 2.0)
    return k[:, 0] ** power < 0.5 * e.k**power


def _where(
    e: Estimated, v: np.ndarray, narrow: np.ndarray, wide: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return v in standard errors without the bound, and the correlation of eta with it, (N,).

    v: k^2, in total reflection k. narrow, wide: its ends (N, 2).
    """
    i_nn, i_nu, i_uu = (e.information[:, i, j] for i, j in ((0, 0), (0, 1), (1, 1)))
    du = np.where(e.linear, 2.0 * np.maximum(e.k, K_MIN), 1.0)
    variance = (e.t / TWO_SIDED) ** 2 * e.variance  # in which 3.84 are the rise of ``wide``
    slope = np.maximum(-2.0 * e.reach * du**2 * (i_uu - i_nu**2 / i_nn) / variance, 0.0)
    cut = wide[:, 0] <= 0.0
    low = np.where(cut, narrow[:, 0], wide[:, 0]), np.where(cut, ONE_SIDED, TWO_SIDED)
    x, sigma = by_valley(np.where(e.at_zero, 0.0, v), slope, low, wide[:, 1])
    along = -i_nu / i_nn * du * sigma
    return x, along / np.hypot(along, np.sqrt(variance / i_nn))


def beside_zero(
    data: Data, s: Solved, e: Estimated, rise: np.ndarray, first: np.ndarray, wide: Region
) -> Region:
    """Return the ends at which a truth is held in 95 %; where they are not found, ``wide``.

    wide: the ends with this rise. first: see `region.profile`.
    """
    narrow = profile(data, s, (ONE_SIDED / TWO_SIDED) ** 2 * rise, first)
    with np.errstate(all="ignore"):
        power = np.where(e.linear, 1.0, 2.0)[:, None]
        v, within, without = e.k ** power[:, 0], narrow.k**power, wide.k**power
        x, correlation = _where(e, v, within, without)

        def between(roots: tuple, low: np.ndarray, high: np.ndarray) -> np.ndarray:
            part = (np.stack(roots, -1) - ONE_SIDED) / (TWO_SIDED - ONE_SIDED)
            return low + part * (high - low)

        eta = between(other_roots(x, correlation), narrow.eta, wide.eta)
        k = np.maximum(between(own_roots(x), within, without), 0.0) ** (1.0 / power)
    good = (
        np.isfinite(eta).all(1) & np.isfinite(k).all(1) & np.isfinite(x) & np.isfinite(correlation)
    )
    # Another piece of the region, or one that was not followed to its end.
    for inner, outer in ((narrow.eta, wide.eta), (narrow.k, wide.k)):
        good &= (inner[:, 0] >= outer[:, 0]) & (inner[:, 1] <= outer[:, 1])
    good = good[:, None]
    return Region(np.where(good, eta, wide.eta), np.where(good, k, wide.k))
