"""Fringe orders beside a minimum: the same optical thickness but for some half wavelengths.

Where the index may change with the wavelength, dozens of orders can fit within the noise. From each
that does, the ones beside it are looked at, until the last of them fits no longer.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from fitting.samples.parameters import value_and_slope
from fitting.searching.film_parts import joined
from fitting.searching.film_starts import (
    Film,
    coordinate,
    films_of,
    middle,
    phase_rates,
    scaled_index,
)
from fitting.searching.followed import followed
from fitting.searching.minima import ALTERNATIVE_CHI2
from fitting.searching.starts import Ends, best_of

if TYPE_CHECKING:
    from fitting.searching.search import Solving

# Orders on either side of one that fits, and how many starts there are for them at most.
_STEPS, _MOST = (1, -1, 2, -2), 600
# Thicknesses closer than that are one order, in orders.
_SAME = 0.4


def thickness_um(fit: Solving, film: Film, y: np.ndarray) -> np.ndarray:
    """Return the thickness of a film in every lane of y (p, L), (L,)."""
    return 1e-3 * value_and_slope(fit.u.moving[film.row].parameter.coordinate, y[film.row])[0]


def beside(
    fit: Solving, film: Film, y: np.ndarray, orders: Iterable[int], scaled: bool = True
) -> np.ndarray:
    """Return starts (p, S) some fringe orders beside those of y (p, L), all lanes of each order.

    Within the bounds of the thickness. scaled: whether the index changes as much, so that the
    optical thickness stays.
    """
    thickness, out = thickness_um(fit, film, y), [y[:, :0]]
    rate = middle(phase_rates(fit, film, y))
    bounds = fit.u.moving[film.row]
    for order in orders:
        moved = thickness + order / rate
        inside = (max(1e-3 * bounds.low, 0.0) < moved) & (moved < 1e-3 * bounds.high)
        moved = moved[inside]
        factor = thickness[inside] / moved if scaled else 1.0
        start = scaled_index(fit, film, y[:, inside], factor)
        start[film.row] = coordinate(fit, film, moved)
        out.append(start)
    return np.concatenate(out, 1)


def with_all_orders(fit: Solving, ends: Ends, noise: float) -> Ends:
    """Return the ends, and those of the orders beside every end that fits as well as the best."""
    films = films_of(fit.u.spec, fit.u.moving)
    if not films or best_of(ends) is None:
        return ends
    film, looked_at, asked = films[0], np.zeros(len(ends.cost), bool), np.empty(0)
    while len(asked) < _MOST:
        least = float(ends.cost[ends.done].min())
        shown = ends.cost < least + ALTERNATIVE_CHI2 * fit.unit(least)
        new = np.flatnonzero(shown & ~looked_at)
        looked_at[new] = True
        start = beside(fit, film, ends.y[:, new], _STEPS)
        if not start.shape[1]:
            break
        known = np.append(thickness_um(fit, film, ends.y[:, shown]), asked)
        at, same = thickness_um(fit, film, start), _SAME / middle(phase_rates(fit, film, start))
        fresh = []
        for i, (x, least_away) in enumerate(zip(at.tolist(), same.tolist(), strict=True)):
            if np.abs(known - x).min() > least_away:
                known = np.append(known, x)
                fresh.append(i)
        if not fresh:
            break
        start, asked = start[:, fresh], np.append(asked, at[fresh])
        ends = joined([ends, followed(fit, start, noise, least)])
        looked_at = np.append(looked_at, np.zeros(len(fresh), bool))
    return ends
