"""The distinct minima of a curve among the ends of all its starts: the best and the next ones."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fitting.bare_surface.coordinates import index_derivatives, xi_of
from fitting.bare_surface.descent import Solved

# Number of minima beside the best one: R_p over a few degrees has up to three equally good ones.
OTHERS = 3
# Share of the sum of squares of the data that their rounding alone leaves, for exact curves.
ROUNDING_COST = (64.0 * np.finfo(float).eps) ** 2
_COST = Solved._fields.index("cost")
_EVALUATIONS = Solved._fields.index("evaluations")
_DONE = Solved._fields.index("done")


class Minima(NamedTuple):
    """The best minimum of every curve, and others, lowest first (NaN where there is none)."""

    best: Solved
    others: tuple[Solved, ...]


def _same(found: np.ndarray, new: np.ndarray) -> np.ndarray:
    """Whether each solution ``found``, (..., fields, N), and ``new`` are one minimum, (..., N).

    Whatever their charts.
    """
    p, q = Solved(*np.moveaxis(found, -2, 0)), Solved(*new)
    log_p, log_q = (s.chart * (2.0 * xi_of(s.x) - s.w) for s in (p, q))  # log|N|^2
    near = np.abs(log_p - log_q) <= 1e-3 * (p.w + q.w) + 1e-6
    return near & (np.abs(p.x - q.x) <= 1e-3 * p.x)


def as_minima(found: np.ndarray) -> Minima:
    """Return minima from an array (1 + OTHERS, fields, N), lowest first."""
    best, *others = (Solved(*one) for one in found)
    return Minima(best, tuple(others))


def with_arrival(found: np.ndarray, new: np.ndarray) -> np.ndarray:
    """Return minima (1 + OTHERS, fields, N), lowest first, after one more end for each curve."""
    total = found[0][_EVALUATIONS] + new[_EVALUATIONS]
    known = _same(found, new)
    # Of two ends at one minimum the first is kept if it converged: only rounding makes one lower.
    unfinished = known[0] & ~(found[0][_DONE] > 0) & (new[_COST] < found[0][_COST])
    found = found.copy()
    found[0] = np.where(unfinished, new, found[0])
    new = np.where(known.any(0), np.nan, new)
    for i, one in enumerate(found):
        lower = (new[_COST] < one[_COST]) | (np.isnan(one[_COST]) & np.isfinite(new[_COST]))
        found[i], new = np.where(lower, new, one), np.where(lower, one, new)
    found[0][_EVALUATIONS] = total
    return found


def less_absorbing_first(found: np.ndarray) -> Minima:
    """Return the minima; of two that differ by rounding only, that of smaller k comes first."""
    b = Solved(*found[1])
    with np.errstate(invalid="ignore"):
        exact = (b.cost <= ROUNDING_COST * b.scale) & (b.done > 0)
    if not exact.any():
        return as_minima(found)
    a = Solved(*found[0])
    with np.errstate(invalid="ignore"):
        k_a, k_b = (index_derivatives(s.x, s.w, s.chart)[1] for s in (a, b))
        swap = exact & (k_b < k_a)
    evaluations = found[0][_EVALUATIONS].copy()
    found[:2] = np.where(swap, found[1::-1], found[:2])
    found[0][_EVALUATIONS] = evaluations
    return as_minima(found)
