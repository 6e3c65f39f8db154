"""Starts of a film from a part of the spectrum, which are then followed to the whole of it.

Where a film absorbs, or reflects like a metal, there are no fringes, and the edge of that range
dominates a scan over the whole spectrum. In a quarter of the spectrum without it there are a few
regular fringes, whose number gives the optical thickness for any dispersion. A fit of that quarter
is followed to the whole of the spectrum step by step.
"""

from __future__ import annotations

import itertools

import numpy as np

from fitting.optics.spec import NCS
from fitting.problem.observations import Observations
from fitting.problem.problem import Problem
from fitting.problem.programs import Targets

# Number of parts in which a film is searched for; the factor by which they grow; the number of
# evaluations of each; and how many of the lowest starts go on. In the end the _LAST_KEPT lowest
# have _LAST_STEPS evaluations, since they move along a valley in which only the product of index
# and thickness is well determined.
PARTS, _GROWTH, _STEPS, _KEPT = 4, 1.35, 30, 16
_LAST_STEPS, _LAST_KEPT = 300, 4
# The least number of wavelengths in a part.
_LEAST = 16


def parts(seen: Observations) -> list[np.ndarray]:
    """Return the rows of each part, as bool over all rows; nothing for a short spectrum."""
    wavelength = seen.points.wavelength_um[:, 0]
    used = seen.measured
    distinct = np.unique(wavelength[used])
    if len(distinct) < PARTS * _LEAST:
        return []
    ends = np.append(distinct[:: -(-len(distinct) // PARTS)], np.inf)
    return [used & (wavelength >= a) & (wavelength < b) for a, b in itertools.pairwise(ends)]


def _at(fit: Problem, rows: np.ndarray) -> Targets:
    """Return what is compared with the data of some rows only."""
    t = fit.targets
    weights = tuple(np.where(rows[:, None], w, 0.0) for w in t.weights)
    if NCS not in fit.seen.channels:
        return t._replace(weights=weights)
    return t._replace(weights=weights, ncs_weights=np.where(rows[:, None], t.ncs_weights, 0.0))


def followed_to_all(
    fit: Problem, start: np.ndarray, each: list[np.ndarray], part: int, noise: float
) -> np.ndarray:
    """Return the points that the best of starts (p, S) in one part reach for the whole spectrum.

    The part grows by a third at a time: a fit within it predicts the phase of the fringes to less
    than half a period just beside it, but not far away.
    """
    used = np.logical_or.reduce(each)
    rank = np.argsort(np.argsort(fit.seen.points.wavelength_um[used, 0], kind="stable"))
    along = np.full(len(used), -1.0)
    along[used] = rank / len(rank)  # from 0 to 1 along the spectrum
    low, high = part / len(each), (part + 1) / len(each)
    y, steps, kept = start, _STEPS, _KEPT
    while True:
        if high - low >= 1.0:
            steps, kept = _LAST_STEPS, _LAST_KEPT
        part_of = _at(fit, (along >= low) & (along < high))
        y = fit.held(y, noise, steps, targets=part_of).lowest(kept)
        if high - low >= 1.0:
            return y
        size = min(_GROWTH * (high - low), 1.0)
        low = min(max(0.5 * (low + high - size), 0.0), 1.0 - size)
        high = low + size
