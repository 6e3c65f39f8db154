"""Other thicknesses of films beside the lowest minima, and starts that were left on their way.

Of a film with fringes these are other orders. Where the index may change with the wavelength,
dozens of orders can fit within the noise, and so can other thicknesses of one order, with another
index. From each that does, the ones beside it are looked at, until the last of them fits no longer;
and so are those whose fringes differ only between the measured points.

The thickness of a film with less than a fringe follows from the form of a curve alone, and another
index may give the same form with another thickness. Thicknesses around the lowest minima are held
while all else is fitted, and then released. So are those of films that are hardly seen.

The fringes of a film whose index is nearly that of a medium beside it are as weak as noise. Where
the data hardly show that there is a film, one that reflects next to no light at one of its faces
describes them at any thickness, and at some thicknesses a part of the noise as well. Then the
lowest minimum is one of these, and no random index is near enough to it: of 707 films 12 were
fitted with a chi2 that was .3 to 7 above the best one for this reason. The lowest minima known are
then tried at all thicknesses, too: with another index other fringes fit the noise, and of 25 films
that were .06 to 6 above the best minimum this led 18 to it.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from fitting.problem.lanes import LANES, STAGE, Ends, best_of, joined
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
from fitting.searching.fringes import phase_rate, thickness_grid
from fitting.searching.last_steps import followed
from fitting.searching.minima import NEAR_CHI2, lowest_ends, scatter_of

# Evaluations of a film of a given thickness: so many tell whether it may fit; after so many the
# lowest _SOME of all thicknesses are chosen.
_HELD, _FIRST, _SOME = 24, 8, 3 * LANES
# Every other thickness that the data tell apart is tried, of so many of the lowest minima.
_EVERY, _WEAK_PARENTS = 2, 6


def weak_fringes(
    fit: Problem, film: Film, lowest: np.ndarray, random: np.ndarray, noise: float, below: float
) -> list[Ends]:
    """Return the ends of films like a medium beside them, which had all thicknesses at first.

    None if no such film has a cost below ``below``. lowest: (p, 8) ends, which are then tried at
    all thicknesses. random: (p, S) starts, of which those are taken whose index times a number is
    nearest to that of the medium.
    """
    out = []
    for y in _alike(fit, film, random[:, : 4 * LANES]):
        start = _at_all_thicknesses(fit, film, y)
        some = np.linspace(0, start.shape[1] - 1, LANES // 2).astype(int)
        probe = fit.pinned(start[:, some], film.row, noise, _HELD)
        if probe.cost.min() < below:
            # From a random index, and from one that has been fitted.
            fitted = _at_all_thicknesses(fit, film, probe.lowest(1))
            out.append(_released(fit, film, np.concatenate([start, fitted], 1), noise))
    if out:
        for y in lowest[:, :_WEAK_PARENTS].T:
            out.append(_released(fit, film, _at_all_thicknesses(fit, film, y[:, None]), noise))
    return out


def _released(fit: Problem, film: Film, start: np.ndarray, noise: float) -> Ends:
    """Return the ends of the best of starts (p, S), whose thickness is held at first."""
    lowest = fit.pinned(start, film.row, noise, _FIRST).lowest(_SOME)
    lowest = fit.pinned(lowest, film.row, noise, _HELD).lowest(LANES)
    return fit.held(lowest, noise, STAGE)


def _alike(fit: Problem, film: Film, y: np.ndarray) -> list[np.ndarray]:
    """Return a film (p, 1) like the medium before it, and one like that behind it.

    y: (p, L), one of which is taken. None of a film whose index is known.
    """
    rows, out = fit.seen.measured, []
    rates = phase_rates(fit, film, y)[:, rows]
    for target in _beside(fit, film, y):
        scaled = scaled_index(fit, film, y, np.median(target[:, rows] / rates, axis=1))
        off = np.abs(phase_rates(fit, film, scaled)[:, rows] / target[:, rows] - 1.0).max(axis=1)
        nearest = int(np.argmin(off))
        if (scaled != y).any():
            out.append(scaled[:, [nearest]])
    return out


def _beside(fit: Problem, film: Film, y: np.ndarray) -> list[np.ndarray]:
    """Return the phase rates (L, M) that a film would have with the index of a medium beside it."""
    points, media = fit.seen.points, fit.u.spec.media
    wavelength, angle = points.wavelength_um[:, 0], points.angle_deg[:, 0]
    outside = np.broadcast_to(fit.targets.eta_i, points.wavelength_um.shape)[:, 0]
    first = np.tile(phase_rate(outside, wavelength, angle, outside), (y.shape[1], 1))
    around = [film.medium - 1, film.medium + 1]
    return [
        first if not 0 <= i < len(media.index) else phase_rates(fit, film._replace(medium=i), y)
        for i in around
    ]


def _at_all_thicknesses(fit: Problem, film: Film, y: np.ndarray) -> np.ndarray:
    """Return y (p, 1) at thicknesses in even steps, (p, S)."""
    rate = phase_rates(fit, film, y)[0, fit.seen.measured]
    thickness = thickness_grid(rate, film.low_um, film.high_um).even[::_EVERY]
    out = np.repeat(y, len(thickness), 1)
    out[film.row] = coordinate(fit, film, thickness)
    return out


# Thicknesses that are tried, as parts of that of each of so many of the lowest minima.
_FACTORS, _PARENTS = np.geomspace(0.1, 8.0, 24), 2
# Films of more fringes than that are told apart by them; see `with_all_orders`.
_FRINGES = 2.0
# The thinnest film that is tried with a random index, as a part of the thickest.
_THIN = 1e-3


def with_other_thicknesses(fit: Problem, ends: Ends, start: np.ndarray, noise: float) -> Ends:
    """Return the ends, and those at other thicknesses of thin films; starts that were left go on.

    start: (p, S) random starts.

    What fits as well as the best minimum is told, but for what was not looked at: 59 nm of a
    Drude-Lorentz film, of which psi and Delta were measured, was found as 106 +- 6 nm with a chi2
    that was .05 lower, and as nothing else.
    """
    films = films_of(fit.u.spec, fit.u.moving)
    for film in films:
        if best_of(ends) is not None:
            ends = joined([ends, *_at_thicknesses(fit, film, lowest_ends(ends), start, noise)])
            lowest = lowest_ends(ends)
            ends = joined([ends, *weak_fringes(fit, film, lowest, start, noise, _near(fit, ends))])
    if films and best_of(ends) is not None:
        least = float(ends.cost[ends.done].min())
        shown = least + scatter_of(fit, least, noise)[1]
        left = np.flatnonzero(~ends.done & (ends.cost < _near(fit, ends)))
        if len(left):
            ends.put(left, followed(fit, ends.y[:, left], noise, shown))
    return ends


def _at_thicknesses(
    fit: Problem, film: Film, lowest: np.ndarray, random: np.ndarray, noise: float
) -> list[Ends]:
    """Return the ends of starts whose thickness was held at first; none of a thick film.

    They are beside ``lowest`` (p, 8), and thin films of the indices of ``random`` (p, S), of which
    hardly any is thin by itself.
    """
    y = lowest[:, :_PARENTS]
    thickness = thickness_um(fit, film, y)
    thin = thickness * middle(phase_rates(fit, film, y)) < _FRINGES
    bounds, tried = fit.u.moving[film.row], np.outer(thickness, _FACTORS)
    inside = thin[:, None] & (tried > max(1e-3 * bounds.low, 0.0)) & (tried < 1e-3 * bounds.high)
    if not inside.any():
        return []
    parent, _ = np.nonzero(inside)
    start = np.concatenate([y[:, parent], random[:, :LANES]], 1)
    most = np.minimum(_FRINGES / middle(phase_rates(fit, film, random[:, :LANES])), film.high_um)
    least = max(film.low_um, _THIN * float(most.max()))
    thin_um = least * np.maximum(most / least, 1.0) ** np.linspace(0.0, 1.0, len(most))
    start[film.row] = coordinate(fit, film, np.append(tried[inside], thin_um))
    held = fit.pinned(start, film.row, noise, STAGE)
    return [fit.held(held.y, noise, STAGE)]


def _near(fit: Problem, ends: Ends) -> float:
    """Return the cost up to which a start is near the best end, of which there is one."""
    least = float(ends.cost[ends.done].min())
    return least + NEAR_CHI2 * fit.unit(least)


# Orders on either side of one that fits, and how many starts there are for them at most, of a film.
_STEPS, _MOST_ORDERS = (1, -1, 2, -2), 200
# Thicknesses whose fringes, apart from all else, have a misfit of at most so many times the least.
_LIKELY, _AS_WELL = 12, 4.0
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
    """Return the ends, and those of the orders beside every end that fits as well as the best.

    And of thicknesses with the same fringes at the measured points: fringes that are sampled less
    than twice look like others with as many more or fewer periods between two neighbouring points.
    """
    for film in films_of(fit.u.spec, fit.u.moving) if best_of(ends) is not None else ():
        looked_at, known, asked = np.zeros(len(ends.cost), bool), np.empty((0, 2)), 0
        while asked < _MOST_ORDERS:
            least = float(ends.cost[ends.done].min())
            well = ends.cost < least + scatter_of(fit, least, noise)[1]
            new = np.flatnonzero(well & ~looked_at)
            if not len(new):
                break
            looked_at[new] = True
            y, lowest = ends.y[:, new], ends.y[:, new[[np.argmin(ends.cost[new])]]]
            rates = phase_rates(fit, film, lowest)
            alike = by_fringes(fit, film, lowest, rates, fit.seen.measured, _LIKELY, _AS_WELL)
            start = np.concatenate([beside(fit, film, y, _STEPS), alike], 1)
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


def _places(fit: Problem, film: Film, y: np.ndarray) -> np.ndarray:
    """Return the thickness (um) and the number of fringes, (L, 2), of y (p, L)."""
    thickness = thickness_um(fit, film, y)
    return np.stack([thickness, thickness * middle(phase_rates(fit, film, y))], 1)
