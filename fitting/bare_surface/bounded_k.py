"""Ends of eta and k beside k = 0, at which a truth is held in 95 % (see `beside_zero`).

The rise of chi2 at such an end depends on how far k^2 lies from 0, in its standard errors, and on
the correlation of eta with it. The region is traced a second time with the least rise that can be
due, and every end is found between the two, in proportion to the root of the rise, which is linear
in the distance for a quadratic cost.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fitting.bare_surface.curve_data import Data
from fitting.bare_surface.descent import Solved
from fitting.bare_surface.estimate import K_MIN, Estimated
from fitting.bare_surface.region import Region, profile, rise_at_zero
from fitting.uncertainty.beside_zero import (
    ONE_SIDED,
    TWO_SIDED,
    by_valley,
    other_roots,
    own_roots,
)

# Half of those of the region itself: how far an end moves need not be known as well as where it is.
_LINES = 4


class _Beside(NamedTuple):
    """Of N curves: v = k^2 (in total reflection k) without the bound, in standard errors; the
    correlation of eta with it; the standard error of eta for known k."""

    x: np.ndarray
    correlation: np.ndarray
    sigma_eta: np.ndarray

    def take(self, rows: np.ndarray) -> _Beside:
        """Return that of the curves ``rows``."""
        return _Beside(*(of[rows] for of in self))


def _beside(e: Estimated, root: np.ndarray, v: np.ndarray, high: np.ndarray) -> _Beside:
    """Return where v lies beside 0. root: of the rise at k = 0; high: the upper end of v."""
    i_nn, i_nu, i_uu = (e.information[:, i, j] for i, j in ((0, 0), (0, 1), (1, 1)))
    du = np.where(e.linear, 2.0 * np.maximum(e.k, K_MIN), 1.0)
    variance = (e.t / TWO_SIDED) ** 2 * e.variance  # in which 3.84 are the rise at the ends
    slope = np.maximum(-2.0 * e.reach * du**2 * (i_uu - i_nu**2 / i_nn) / variance, 0.0)
    x, sigma = by_valley(np.where(e.at_zero, 0.0, v), slope, root, high)
    along, sigma_eta = -i_nu / i_nn * du * sigma, np.sqrt(variance / i_nn)
    return _Beside(x, along / np.hypot(along, sigma_eta), sigma_eta)


def _between(roots: tuple, narrow: np.ndarray, wide: np.ndarray) -> np.ndarray:
    """Return ends (N, 2) at these roots of the rise, up to those of ``wide``."""
    share = (np.stack(roots, -1) - ONE_SIDED) / (TWO_SIDED - ONE_SIDED)
    return narrow + np.minimum(share, 1.0) * (wide - narrow)


def _on_the_edge(b: _Beside, roots: tuple) -> np.ndarray:
    """Return how much farther out ends of eta lie for roots above 1.96, (N, 2).

    There k is 0, and the square of the root that of the distance in errors of eta for known k, and
    of x if that is above 0.
    """
    root, above = np.stack(roots, -1), np.maximum(b.x, 0.0)[:, None] ** 2
    far, near = (np.sqrt(np.maximum(r * r - above, 0.0)) for r in (root, TWO_SIDED))
    return np.where(root > TWO_SIDED, (far - near) * b.sigma_eta[:, None], 0.0) * [-1.0, 1.0]


def beside_zero(
    data: Data, s: Solved, e: Estimated, rise: np.ndarray, first: np.ndarray, wide: Region
) -> Region:
    """Return the ends at which a truth is held in 95 %; where they are not found, ``wide``.

    wide: the ends with this rise. first: see `region.profile`.
    """
    power = np.where(e.linear, 1.0, 2.0)[:, None]
    with np.errstate(all="ignore"):
        v, low, high = e.k ** power[:, 0], *(wide.k**power).T
        root = TWO_SIDED * np.sqrt(rise_at_zero(data, s, rise) / rise)
        # An end above 0 tells it from nearer by.
        b = _beside(e, np.where(low > 0.0, TWO_SIDED * v / (v - low), root), v, high)
        rows = np.flatnonzero((b.x < 2.0 * TWO_SIDED) & np.isfinite(b.correlation))
        if not len(rows):
            return wide
        b, power = b.take(rows), power[rows]
        part = Solved(*np.array(s)[:, rows])
        least = (ONE_SIDED / TWO_SIDED) ** 2 * rise[rows]
        narrow = profile(data.take(rows), part, least, first[rows], _LINES)
        roots = other_roots(b.x, b.correlation)
        eta = _between(roots, narrow.eta, wide.eta[rows]) + _on_the_edge(b, roots)
        k = _between(own_roots(b.x), narrow.k**power, wide.k[rows] ** power)
        k = np.maximum(k, 0.0) ** (1.0 / power)
    good = np.isfinite(np.column_stack([eta, k])).all(1)
    # Another piece of the region, or one that was not followed to its end.
    for inner, outer in ((narrow.eta, wide.eta[rows]), (narrow.k, wide.k[rows])):
        good &= (inner[:, 0] >= outer[:, 0]) & (inner[:, 1] <= outer[:, 1])
    found = Region(wide.eta.copy(), wide.k.copy())
    found.eta[rows[good]], found.k[rows[good]] = eta[good], k[good]
    return found
