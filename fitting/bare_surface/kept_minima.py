"""The distinct minima of a curve among the ends of all its starts: the best and the next ones."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fitting.bare_surface.coordinates import index_derivatives, xi_of
from fitting.bare_surface.descent import ROW, Solved

# Number of minima beside the best one: R_p over a few degrees has up to three equally good ones.
OTHERS = 3
# Share of the sum of squares of the data that their rounding alone leaves, for exact curves.
ROUNDING_COST = (64.0 * np.finfo(float).eps) ** 2


class Minima(NamedTuple):
    """The best minimum of N curves, and others of the K curves that have further starts.

    best: (fields, N), as in ``Solved``. curve: (K,), which curves. others: (OTHERS, fields, K),
    lowest first, NaN where there is none.
    """

    best: np.ndarray
    curve: np.ndarray
    others: np.ndarray


def _same(found: np.ndarray, new: np.ndarray) -> np.ndarray:
    """Whether each solution ``found``, (..., fields, N), and ``new`` are one minimum, (..., N).

    Whatever their charts.
    """
    (x, w, log), (new_x, new_w, new_log) = map(_place, (found, new))
    near = np.abs(log - new_log) <= 1e-3 * (w + new_w) + 1e-6
    return near & (np.abs(x - new_x) <= 1e-3 * x)


def _place(solved: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return x, w and log|N|^2 of solutions (..., fields, N)."""
    x, w, chart = (solved[..., row, :] for row in (ROW.x, ROW.w, ROW.chart))
    return x, w, chart * (2.0 * xi_of(x) - w)


def with_arrival(found: np.ndarray, new: np.ndarray) -> np.ndarray:
    """Return minima (1 + OTHERS, fields, N), lowest first, after one more end for each curve."""
    total = found[0][ROW.evaluations] + new[ROW.evaluations]
    known = _same(found, new)
    # Of two ends at one minimum the first is kept if it converged: only rounding makes one lower.
    unfinished = known[0] & ~(found[0][ROW.done] > 0) & (new[ROW.cost] < found[0][ROW.cost])
    found = found.copy()
    found[0] = np.where(unfinished, new, found[0])
    new = np.where(known.any(0), np.nan, new)
    for i, one in enumerate(found):
        cost, old = new[ROW.cost], one[ROW.cost]
        lower = (cost < old) | (np.isnan(old) & np.isfinite(cost))
        if lower.any():
            found[i], new = np.where(lower, new, one), np.where(lower, one, new)
    found[0][ROW.evaluations] = total
    return found


def less_absorbing_first(found: np.ndarray) -> np.ndarray:
    """Return the minima; of two that differ by rounding only, that of smaller k comes first."""
    b = Solved(*found[1])
    exact = (b.cost <= ROUNDING_COST * b.scale) & (b.done > 0)
    if not exact.any():
        return found
    a = Solved(*found[0])
    k_a, k_b = (index_derivatives(s.x, s.w, s.chart)[1] for s in (a, b))
    swap = exact & (k_b < k_a)
    evaluations = found[0][ROW.evaluations].copy()
    found[:2] = np.where(swap, found[1::-1], found[:2])
    found[0][ROW.evaluations] = evaluations
    return found
