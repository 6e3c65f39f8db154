"""Starts of a film from a part of the spectrum, which are then followed to the whole of it.

Where a film absorbs, or reflects like a metal, there are no fringes, and the edge of that range
dominates a scan over the whole spectrum. In a quarter of the spectrum without it there are a few
regular fringes, whose number gives the optical thickness for any dispersion. A fit of that quarter
is followed to half of the spectrum and to all of it.
"""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np

from fitting.observe import NCS
from fitting.starts import Ends

if TYPE_CHECKING:
    from fitting.observations import Observations
    from fitting.problem import Targets
    from fitting.search import Solving

# Number of parts in which a film is searched for; evaluations before the next larger part.
PARTS, _STEPS = 4, 30
# The least number of wavelengths in a part.
_LEAST = 16


def parts(seen: Observations) -> list[np.ndarray]:
    """Return the rows of each part, as bool over all rows; nothing for a short spectrum."""
    wavelength = seen.points.wavelength_um[:, 0]
    used = np.arange(len(wavelength)) <= seen.row.max()
    distinct = np.unique(wavelength[used])
    if len(distinct) < PARTS * _LEAST:
        return []
    ends = np.append(distinct[:: -(-len(distinct) // PARTS)], np.inf)
    return [used & (wavelength >= a) & (wavelength < b) for a, b in itertools.pairwise(ends)]


def _at(fit: Solving, rows: np.ndarray) -> Targets:
    """Return what is compared with the data of some rows only."""
    t = fit.targets
    weights = tuple(np.where(rows[:, None], w, 0.0) for w in t.weights)
    if NCS not in fit.seen.channels:
        return t._replace(weights=weights)
    return t._replace(weights=weights, ncs_weights=np.where(rows[:, None], t.ncs_weights, 0.0))


def followed_to_half(
    fit: Solving, start: np.ndarray, each: list[np.ndarray], part: int, noise: float
) -> np.ndarray:
    """Return where starts (p, S) of one of the parts end in a fit of half of the spectrum."""
    low, high = (np.repeat(a[:, None], start.shape[1], 1) for a in fit.limits)
    half = each[part] | each[min(part ^ 1, len(each) - 1)]
    y = start
    for rows in (each[part], half):
        y = fit.held(y, low, high, noise, _STEPS, _at(fit, rows)).y
    return y


def joined(ends: list[Ends]) -> Ends:
    """Return several sets of ends as one."""
    return Ends(*(np.concatenate(parts, -1) for parts in zip(*ends, strict=True)))
