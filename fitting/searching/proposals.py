"""Proposals: starts that differ from the lowest minima in what wrong minima are wrong in.

A wrong minimum of a film often has another order of the fringes, an oscillator in place of the free
electrons, or a right thickness with a wrong dispersion. `PROPOSALS` lists what is tried; the search
follows the starts of all of them, generation after generation.

The fringes of a film whose index is nearly that of a medium beside it are as weak as noise: it
describes the data at any thickness, and at some thicknesses a part of the noise as well. No random
index is near enough to such an index: of 707 films 12 were fitted with a chi2 that was .3 to 7
above the best one for this reason. All thicknesses of such a film are tried, held while all else is
fitted, and so are those of the lowest minima known: with another index other fringes fit the noise,
and of 25 films that were .06 to 6 above the best minimum this led 18 to it.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from fitting.problem.lanes import LANES, Ends
from fitting.problem.problem import Problem
from fitting.samples.parameters import from_parameter, start_range, value_and_slope
from fitting.searching.film_starts import (
    Film,
    coordinate,
    films_of,
    middle,
    phase_rates,
    scaled_index,
    thickness_um,
)
from fitting.searching.fringes import phase_rate, thickness_grid
from fitting.searching.minima import NEAR_CHI2, lowest_ends
from fitting.searching.oscillators import likely_lines, oscillators

# Fringe orders beside a minimum that are tried, and how many of them with other electrons.
_ORDERS, _FEW = [sign * n for n in range(1, 9) for sign in (1, -1)], 6
# Share of the parameters that is taken from other starts.
_ANEW = 0.4
# Evaluations of a film of a given thickness: so many tell whether it may fit; after so many the
# lowest _SOME of all thicknesses are chosen.
_HELD, _FIRST, _SOME = 24, 8, 3 * LANES
# Every other thickness that the data tell apart is tried, of so many of the lowest minima.
_EVERY, _WEAK_PARENTS = 2, 6


class Generation(NamedTuple):
    """What proposals are made from.

    new: the lowest minima (p, n) that none was made from before, the best first. ends: all ends.
    start: random starts (p, S). noise: that the ends were run at.
    """

    new: np.ndarray
    ends: Ends
    start: np.ndarray
    noise: float
    random: np.random.Generator


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


def _other_orders(fit: Problem, of: Generation) -> list[np.ndarray]:
    """Return the best new minimum at other orders of the fringes."""
    films = films_of(fit.u.spec, fit.u.moving)
    return [beside(fit, film, of.new[:, :1], _ORDERS) for film in films]


def _other_electrons(fit: Problem, of: Generation) -> list[np.ndarray]:
    """Return `as_free_electrons` of the best new minimum, and at orders beside: it has others."""
    y = of.new[:, :1]
    moved = as_free_electrons(fit, y, of.start[:, : y.shape[1]])
    moved = moved[:, (moved != y).any(0)]
    films = films_of(fit.u.spec, fit.u.moving)
    return [moved, *(beside(fit, film, moved, _ORDERS[:_FEW]) for film in films)]


def as_free_electrons(fit: Problem, y: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return y (p, L) with the first oscillator of a film as its free electrons, and a weak one.

    An oscillator below the spectrum does the same as free electrons, so that it may take their
    place, and they its own as a background: a minimum of its own, far above the best one.
    other: (p, L), the parameters of the weak one.
    """
    row, out = {name: i for i, name in enumerate(fit.u.spec.moving)}, y.copy()
    for place in fit.u.spec.media.places:
        names = [f"{place}.{n}" for n in ("plasma_ev", "width_ev", "strength_ev2_1", "width_ev_1")]
        rows = [row[n] for n in names if n in row]
        if len(rows) < 4 or not all(fit.u.moving[i].free for i in rows):
            continue
        kinds = [fit.u.moving[i].parameter.coordinate for i in rows]
        strength, width = (value_and_slope(kinds[i], y[rows[i]])[0] for i in (2, 3))
        out[rows[0]] = from_parameter(kinds[0], np.sqrt(strength))
        out[rows[1]] = from_parameter(kinds[1], width)
        new = [i for name, i in row.items() if name.startswith(place) and name.endswith("_1")]
        out[new] = other[new]
        out[rows[2]] = from_parameter(kinds[2], start_range(fit.u.moving[rows[2]])[0])
    return out


def _crossed(fit: Problem, of: Generation) -> list[np.ndarray]:
    """Return the lowest ends with some parameters of random starts, LANES of them."""
    parents = np.repeat(lowest_ends(of.ends), LANES // 8, 1)
    other = of.start[:, of.random.integers(of.start.shape[1], size=LANES)]
    mixed = np.where(of.random.random(parents.shape) < _ANEW, other, parents)
    mixed[:, ::4] = as_free_electrons(fit, parents[:, ::4], other[:, ::4])
    return [mixed]


def _other_lines(fit: Problem, of: Generation) -> list[np.ndarray]:
    """Return the new minima, each oscillator of each moved to where it explains most."""
    terms, out = oscillators(fit), []
    for y, term in itertools.product(of.new.T, terms):
        without = y.copy()
        without[term[0]] = fit.limits[0][term[0]]
        out.append(likely_lines(fit, without, term, LANES // (4 * len(terms))))
    return out


def hardly_seen(fit: Problem, of: Generation) -> list[np.ndarray]:
    """Return films like a medium beside them at their best thicknesses, and the lowest minima so.

    None where no such film is near the best end.
    """
    out, near = [], of.ends.cost.min()
    near += NEAR_CHI2 * fit.unit(near)
    for film in films_of(fit.u.spec, fit.u.moving):
        several: list[np.ndarray] = []
        for y in _like_a_neighbour(fit, film, of.start[:, : 4 * LANES]):
            start = _at_all_thicknesses(fit, film, y)
            some = np.linspace(0, start.shape[1] - 1, LANES // 2).astype(int)
            probe = fit.pinned(start[:, some], film.row, of.noise, _HELD)
            if probe.cost.min() < near:
                # From a random index, and from one that has been fitted.
                fitted = _at_all_thicknesses(fit, film, probe.lowest(1))
                several.append(np.concatenate([start, fitted], 1))
        if several:
            lowest = lowest_ends(of.ends)[:, :_WEAK_PARENTS]
            several += [_at_all_thicknesses(fit, film, y[:, None]) for y in lowest.T]
        for start in several:
            lowest = fit.pinned(start, film.row, of.noise, _FIRST).lowest(_SOME)
            out.append(fit.pinned(lowest, film.row, of.noise, _HELD).lowest(LANES))
    return out


def _like_a_neighbour(fit: Problem, film: Film, y: np.ndarray) -> list[np.ndarray]:
    """Return a film (p, 1) with an index like that of the medium before it, and of that behind it.

    y: (p, L), of which those are taken whose index times a number is nearest. None of a film whose
    index is known.
    """
    points, media, rows = fit.seen.points, fit.u.spec.media, fit.seen.measured
    wavelength, angle = points.wavelength_um[:, 0], points.angle_deg[:, 0]
    outside = np.broadcast_to(fit.targets.eta_i, points.wavelength_um.shape)[:, 0]
    rates, out = phase_rates(fit, film, y)[:, rows], []
    for medium in (film.medium - 1, film.medium + 1):
        if 0 <= medium < len(media.index):
            target = phase_rates(fit, film._replace(medium=medium), y)
        else:
            target = phase_rate(outside, wavelength, angle, outside)[None]
        target = target[:, rows]
        scaled = scaled_index(fit, film, y, np.median(target / rates, axis=1))
        off = np.abs(phase_rates(fit, film, scaled)[:, rows] / target - 1.0).max(axis=1)
        if (scaled != y).any():
            out.append(scaled[:, [int(np.argmin(off))]])
    return out


def _at_all_thicknesses(fit: Problem, film: Film, y: np.ndarray) -> np.ndarray:
    """Return y (p, 1) at thicknesses in even steps, (p, S)."""
    rate = phase_rates(fit, film, y)[0, fit.seen.measured]
    thickness = thickness_grid(rate, film.low_um, film.high_um).even[::_EVERY]
    out = np.repeat(y, len(thickness), 1)
    out[film.row] = coordinate(fit, film, thickness)
    return out


# What is tried beside the minima of every sample; `hardly_seen` follows where these lead no lower.
PROPOSALS: tuple[Callable[[Problem, Generation], list[np.ndarray]], ...] = (
    _other_lines, _crossed, _other_electrons, _other_orders,
)  # fmt: skip
