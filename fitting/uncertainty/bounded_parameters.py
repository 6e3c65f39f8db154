"""Where the ends of profile intervals lie beside a parameter that cannot be negative."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fitting.samples.parameters import LOG, Unknown
from fitting.uncertainty.beside_zero import TWO_SIDED, by_valley, other_roots, own_roots
from fitting.uncertainty.covariance import Uncertainty
from fitting.uncertainty.profile import Search

# So many standard errors of the quadratic model.
_NEAR = 8.0
# An end that moves by less than this part of its distance stays where it is.
_LEAST = 0.01


def unbounded(u: Unknown, y: Any, known: Uncertainty, i: int) -> tuple[Any, Any]:
    """Return the estimate (...) that parameter i would have without bounds, and its standard error.

    y: (...), where it is. In the solver's coordinate; NaN if it is known, has a prior, or its range
    does not begin at 0.
    """
    if not u.free or u.low != 0.0 or u.prior is not None or u.parameter.coordinate == LOG:
        return np.full_like(y, np.nan), np.full_like(y, np.nan)
    sigma = known.edge[..., i] * np.sqrt(known.variance)
    sigma = np.where(np.isfinite(sigma), sigma, np.nan)
    step = np.where(known.at_bound[..., i] == "low", known.wide_step[..., i], 0.0)
    return np.where(np.isnan(sigma), np.nan, y + np.minimum(step, 0.0)), sigma


def may_be_zero(u: Unknown, y: Any, known: Uncertainty, i: int) -> Any:
    """Whether parameters (...) that cannot be negative are so near 0 that their ends may move."""
    value, sigma = unbounded(u, y, known, i)
    return value < _NEAR * sigma


@np.errstate(all="ignore")
def aim_beside_zero(
    moving: Sequence[Unknown], m: Any, pairs: Mapping[tuple[int, int], tuple[Search, Search]]
) -> list[Search]:
    """Aim the searches at where a truth is held in 95 %, and return those that move.

    m: the straight `Minima`. pairs: by minimum and unknown the two searches that have found the
    ends of one rise. The ends of a parameter that cannot be negative move if it is near 0; those of
    the others if there is just one such parameter.
    """
    known, unit = m.known, m.t / TWO_SIDED * np.sqrt(m.known.variance)
    x, one = (np.full(m.y.shape, np.nan) for _ in range(2))
    for j in {j for _, j in pairs}:
        rows = np.array([i for i, other in pairs if other == j])
        root, high = np.transpose([
            (TWO_SIDED * lower.root_at(lower.room), upper.end)
            for lower, upper in (pairs[i, j] for i in rows.tolist())
        ])  # fmt: skip
        reach, sigma = (a[rows] for a in unbounded(moving[j], m.y[:, j], known, j))
        slope = np.maximum(-2.0 * reach / (m.t[rows] * sigma / TWO_SIDED) ** 2, 0.0)
        high = np.where(m.linear[rows, j], np.sqrt(high), high)
        best = np.where(known.at_bound[rows, j] == "low", 0.0, m.y[rows, j])
        x[rows, j], one[rows, j] = by_valley(best, slope, root, high)
    near = x < 2.0 * TWO_SIDED
    roots = np.where(near[..., None], np.stack(own_roots(x), -1), np.nan)
    single = np.flatnonzero(near.sum(1) == 1)
    if len(single):
        i = near[single].argmax(1)
        wide = known.wide[single]
        row = np.take_along_axis(wide, i[:, None, None], 1)[:, 0]
        own = np.take_along_axis(row, i[:, None], 1)
        along = row / own * one[single, i][:, None]
        left = np.maximum(np.diagonal(wide, axis1=1, axis2=2) - row**2 / own, 0.0)
        apart = unit[single, None] * np.sqrt(left)
        both = other_roots(x[single, i][:, None], along / np.hypot(along, apart))
        roots[single] = np.where(near[single][..., None], roots[single], np.stack(both, -1))
    moved = []
    for (i, j), searches in pairs.items():
        for search, root in zip(searches, roots[i, j].tolist(), strict=True):
            aim = root / TWO_SIDED  # NaN: nothing is known of the correlation
            if abs(aim - 1.0) > _LEAST and np.isfinite(search.found):
                search.aim(aim)
                moved.append(search)
    return moved
