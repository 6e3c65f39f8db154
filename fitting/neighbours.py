"""Starts beside the lowest ends: what a right minimum most often lacks is one thing alone.

The order of the fringes, an oscillator in the wrong place, some parameters of a random start: each
is tried on the lowest ends while something lower is found.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fitting.error_model import CHI2_LARGE, chi2_flags
from fitting.film_parts import followed_to_half, joined, parts
from fitting.film_starts import (
    MANY_CANDIDATES,
    SHIFTS,
    Film,
    by_fringes,
    coordinate,
    films_of,
    many_fringes,
    middle,
    phase_rates,
)
from fitting.minima import ALTERNATIVE_CHI2
from fitting.next_term import likely_lines, oscillators
from fitting.parameters import from_parameter, value_and_slope
from fitting.search import in_order, lowest_ends
from fitting.starts import LANES, STAGE, Ends, best_of, start_range

if TYPE_CHECKING:
    from fitting.search import Solving

# Fringe orders on either side of the best minimum that are looked at.
_ORDERS = 8
# Stages in which the starts beside the best minimum go on.
_FURTHER = 8
# Parameters that the index of a film, or its square, is proportional to.
_INDEX = {
    "eta": 1, "k": 1, "A": 1, "B": 1, "C": 1, "plasma": 1, "eps": 2, "strength": 2, "amplitude": 2,
}  # fmt: skip
# Rounds of starts beside the lowest ends, and the share of parameters that is taken from others.
_ROUNDS, _ANEW = 6, 0.4
# Of so many of the lowest ends each oscillator is looked for anew.
_PARENTS = 4


def with_neighbours(fit: Solving, ends: Ends, start: np.ndarray, noise: float) -> Ends:
    """Return the ends, and those of starts beside the lowest of them, while these are lower.

    start: (p, S) random starts. Of films always, and once from parts of the spectrum where the
    residuals are no noise then. Of other samples with oscillators where these are none, until two
    rounds were in vain: after one, 2 of 8 fits of a glass plate ended far above the best minimum.
    """
    films = films_of(fit.u.spec, fit.u.moving)
    worth = bool(films) or (fit.lanes == LANES and bool(oscillators(fit)))
    random, in_vain, tried = np.random.default_rng(fit.asked.seed), 0, False
    for _ in range(_ROUNDS if worth else 0):
        best = best_of(ends)
        if best is None:
            break
        least, y = float(ends.cost[best]), ends.y[:, best]
        if not films and _is_noise(fit, y):
            break
        beside = [_other_lines(fit, ends), _crossed(fit, ends, start, random)]
        beside += [_orders(fit, film, y) for film in films[:1]]
        ends = joined([ends, _followed(fit, np.concatenate(beside, 1), noise, least)])
        in_vain = 0 if ends.cost.min() < least - _unit(fit, least) else in_vain + 1
        if in_vain == 0 or (in_vain == 1 and not films):
            continue
        if tried or not (films and many_fringes(fit, films[0], y)) or _is_noise(fit, y):
            break
        tried = True
        ends = joined([ends, *_from_parts(fit, films[0], start, noise, least)])
    return ends


def _followed(fit: Solving, start: np.ndarray, noise: float, best: float) -> Ends:
    """Return where starts (p, S) end; those that are far above the best cost on the way."""
    low, high = (np.repeat(a[:, None], start.shape[1], 1) for a in fit.limits)
    ends = fit.held(start, low, high, noise, STAGE)
    shown = best + ALTERNATIVE_CHI2 * _unit(fit, best)
    for _ in range(_FURTHER):
        live = np.flatnonzero(~ends.done & (ends.cost < shown))
        if not len(live):
            break
        ends.put(live, fit.held(ends.y[:, live], low[:, live], high[:, live], noise, STAGE))
        # After the first of them what still crawls along a valley, unless it is the lowest of all.
        shown = best - _unit(fit, best)
    return ends._replace(y=in_order(fit.u, ends.y, fit.settings))


def _unit(fit: Solving, cost: float) -> float:
    """Return a unit of chi2."""
    return max(1.0, cost / max(fit.dof, 1)) if not fit.asked.scaled else cost / max(fit.dof, 1)


def _is_noise(fit: Solving, y: np.ndarray) -> bool:
    """Whether the residuals at y may be noise: not alike from neighbour to neighbour.

    And, where errors are stated, not larger than these.
    """
    r = fit.slopes(y).residual
    square = float(r @ r)
    alike = float(r[1:] @ r[:-1]) > 3.0 * square / np.sqrt(len(r))
    chi2_reduced, dof = np.array([square / max(fit.dof, 1)]), np.array([fit.dof])
    large = fit.seen.stated and (chi2_flags(chi2_reduced, dof) & CHI2_LARGE).any()
    return not (alike or large)


def _crossed(fit: Solving, ends: Ends, start: np.ndarray, random: np.random.Generator):
    """Return starts (p, LANES) made of the lowest ends with some parameters of random starts.

    A right thickness with a wrong dispersion, or the other way round, is a minimum of its own.
    """
    parents = np.repeat(lowest_ends(ends.y, ends.cost), LANES // 8, 1)
    other = start[:, random.integers(start.shape[1], size=LANES)]
    mixed = np.where(random.random(parents.shape) < _ANEW, other, parents)
    mixed[:, ::4] = _as_free_electrons(fit, parents[:, ::4], other[:, ::4])
    return mixed


def _as_free_electrons(fit: Solving, y: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return y (p, L) with the first oscillator of a film as its free electrons, and a weak one.

    An oscillator below the spectrum does the same as free electrons, so that it may take their
    place, and they its own as a background: a minimum of its own, far above the best one.
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


def _other_lines(fit: Solving, ends: Ends) -> np.ndarray:
    """Return starts (p, S): the lowest ends with each oscillator where it explains most."""
    terms = oscillators(fit)
    if not terms:
        return ends.y[:, :0]
    parents = lowest_ends(ends.y, ends.cost)[:, :_PARENTS]
    out = []
    for y in parents.T:
        for term in terms:
            without = y.copy()
            without[term[0]] = fit.limits[0][term[0]]
            out.append(likely_lines(fit, without, term, LANES // (_PARENTS * len(terms))))
    return np.concatenate(out, 1)


def _orders(fit: Solving, film: Film, y: np.ndarray) -> np.ndarray:
    """Return starts (p, S) one or more fringe orders beside y (p,).

    With the index as it is, and scaled so that the optical thickness stays: where the data tell
    little of the order, these are the solutions that fit as well.
    """
    rate = float(middle(phase_rates(fit, film, y[:, None]))[0])
    limits = fit.u.moving[film.row]
    x, _ = value_and_slope(limits.parameter.coordinate, y[film.row : film.row + 1])
    thickness = 1e-3 * float(x[0])
    starts = [np.empty((0, len(y)))]
    for order in (o for n in range(1, _ORDERS + 1) for o in (n, -n)):
        moved = thickness + order / rate
        if max(1e-3 * limits.low, 0.0) < moved < 1e-3 * limits.high:
            for factor in (1.0, thickness / moved):
                start = _scaled(fit, film, y, factor)
                start[film.row] = coordinate(fit, film, np.array([moved]))[0]
                starts.append(start[None])
    return np.concatenate(starts).T


def _scaled(fit: Solving, film: Film, y: np.ndarray, factor: float) -> np.ndarray:
    """Return y (p,) with the index of the film times a factor, where its model lets it."""
    out = y.copy()
    place = fit.u.spec.media.places[film.medium]
    for i, (name, unknown) in enumerate(zip(fit.u.spec.moving, fit.u.moving, strict=True)):
        of, _, own = name.rpartition(".")
        power = _INDEX.get(own.partition("_")[0])
        if of == place and power and unknown.free:
            kind = unknown.parameter.coordinate
            x, _ = value_and_slope(kind, y[i : i + 1])
            out[i] = from_parameter(kind, x * factor**power)[0]
    return out


def _from_parts(fit: Solving, film: Film, y: np.ndarray, noise: float, least: float) -> list[Ends]:
    """Return where starts end that were found in parts of the spectrum; y: candidates (p, L)."""
    rates = phase_rates(fit, film, y[:, :MANY_CANDIDATES])
    out, each = [], parts(fit.seen)
    for part, rows in enumerate(each):
        start = by_fringes(fit, film, y, rates, rows, LANES // len(SHIFTS))
        half = followed_to_half(fit, start, each, part, noise)
        out.append(_followed(fit, half, noise, least))
    return out
