"""Other thicknesses that may fit as well as a minimum: one or more fringes larger or smaller.

Where the index may change with the wavelength, dozens of orders can fit within the noise, and so
can other thicknesses of one order, with another index. From each that does, the ones beside it are
looked at, until the last of them fits no longer; and so are those whose fringes differ only
between the measured points.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from fitting.problem.lanes import Ends, best_of, joined
from fitting.problem.problem import Problem
from fitting.searching.film_starts import (
    Film,
    by_fringes,
    coordinate,
    films_of,
    middle,
    phase_rates,
    scaled_index,
    thickness_um,
)
from fitting.searching.last_steps import followed
from fitting.searching.minima import scatter_of

# Orders on either side of one that fits, and how many starts there are for them at most, of a film.
_STEPS, _MOST = (1, -1, 2, -2), 200
# Thicknesses whose fringes, apart from all else, have a misfit of at most so many times the least.
_ALIKE, _AS_WELL = 12, 4.0
# Two films closer than that in thickness and number of fringes are one, in fringes.
_SAME = 0.4


def beside(fit: Problem, film: Film, y: np.ndarray, orders: Sequence[int]) -> np.ndarray:
    """Return starts (p, S) some fringe orders beside those of y (p, L), all lanes of each order.

    Within the bounds of the thickness. First with the index changed as much, so that the optical
    thickness stays, and with it the number of fringes; then with the index as it is.
    """
    thickness, out = thickness_um(fit, film, y), [y[:, :0]]
    rate = middle(phase_rates(fit, film, y))
    bounds = fit.u.moving[film.row]
    for scaled, order in itertools.product((True, False), orders):
        moved = thickness + order / rate
        inside = (max(1e-3 * bounds.low, 0.0) < moved) & (moved < 1e-3 * bounds.high)
        moved = moved[inside]
        factor = thickness[inside] / moved if scaled else 1.0
        start = scaled_index(fit, film, y[:, inside], factor)
        start[film.row] = coordinate(fit, film, moved)
        out.append(start)
    return np.concatenate(out, 1)


def with_all_orders(fit: Problem, ends: Ends, noise: float) -> Ends:
    """Return the ends, and those of the orders beside every end that fits as well as the best."""
    if best_of(ends) is not None:
        for film in films_of(fit.u.spec, fit.u.moving):
            ends = _with_orders(fit, film, ends, noise)
    return ends


def _with_orders(fit: Problem, film: Film, ends: Ends, noise: float) -> Ends:
    looked_at, asked = np.zeros(len(ends.cost), bool), 0
    known = np.empty((0, 2))
    while asked < _MOST:
        least = float(ends.cost[ends.done].min())
        new = np.flatnonzero((ends.cost < least + scatter_of(fit, least, noise)[1]) & ~looked_at)
        looked_at[new] = True
        y = ends.y[:, new]
        lowest = ends.y[:, new[[np.argmin(ends.cost[new])]]] if len(new) else y
        start = np.concatenate([beside(fit, film, y, _STEPS), _alike(fit, film, lowest)], 1)
        if not start.shape[1]:
            break
        known, fresh = np.concatenate([known, _places(fit, film, y)]), []
        for i, at in enumerate(_places(fit, film, start)):
            # The step between two orders is one fringe, whatever the index.
            if (np.abs(known - at) > _SAME * np.array([at[0] / at[1], 1.0])).any(1).all():
                known = np.concatenate([known, at[None]])
                fresh.append(i)
        if not fresh:
            break
        asked += len(fresh)
        ends = joined([ends, followed(fit, start[:, fresh], noise, least)])
        looked_at = np.append(looked_at, np.zeros(len(fresh), bool))
    return ends


def _alike(fit: Problem, film: Film, y: np.ndarray) -> np.ndarray:
    """Return starts (p, S) at other thicknesses with the same fringes at the measured points.

    Of y (p, 1) or (p, 0). Fringes that are sampled less than twice look like others with as many
    more or fewer periods between two neighbouring points.
    """
    if not y.shape[1]:
        return y
    rates = phase_rates(fit, film, y)
    return by_fringes(fit, film, y, rates, fit.seen.measured, _ALIKE, _AS_WELL)


def _places(fit: Problem, film: Film, y: np.ndarray) -> np.ndarray:
    """Return the thickness (um) and the number of fringes, (L, 2), of y (p, L)."""
    thickness = thickness_um(fit, film, y)
    return np.stack([thickness, thickness * middle(phase_rates(fit, film, y))], 1)
