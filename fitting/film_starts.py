"""Starts of a sample with films: where the fringes put the thickness, and the orders beside it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import numpy as np

from fitting.compiled import compiled
from fitting.film_parts import followed_to_half, joined, parts
from fitting.film_programs import eta_in_parts, eta_moves
from fitting.fringes import likely_thicknesses, phase_rate
from fitting.minima import ALTERNATIVE_CHI2
from fitting.observe import NCS, Spec, medium_index
from fitting.parameters import from_parameter, value_and_slope
from fitting.search import in_order, lowest_ends
from fitting.starts import LANES, STAGE, Ends, best_of, start_range

if TYPE_CHECKING:
    from fitting.observations import Observations
    from fitting.search import Solving
    from fitting.starts import Unknown

# Indices that are tried in the scan of the thickness, and so many thicknesses that are taken from
# the fringes; of many starts, which are those of many unknowns. Each with these shifts in parts of
# a period: the phase of the reflections at both faces is not known to the scan.
_CANDIDATES, _LIKELY = 40, 40
_MANY_CANDIDATES, _MANY_LIKELY = 128, 80
_SHIFTS = (0.0, 0.25, -0.25, 0.5)
# Fringe orders on either side of the best minimum that are looked at.
_ORDERS = 8
# Fringes of the thickest film that is looked for, from which on parts of the spectrum are searched.
_FRINGES = 20.0
# Stages in which the starts beside the best minimum go on.
_FURTHER = 8
# Parameters that the index of a film, or its square, is proportional to.
_INDEX = {
    "eta": 1, "k": 1, "A": 1, "B": 1, "C": 1, "plasma": 1, "eps": 2, "strength": 2, "amplitude": 2,
}  # fmt: skip
# Rounds of starts beside the lowest ends, and the share of parameters that is taken from others.
_ROUNDS, _ANEW = 6, 0.4


class _Film(NamedTuple):
    """A film whose thickness is free: its medium, its row in y, and the range of its starts."""

    medium: int
    row: int
    low_um: float
    high_um: float


def _eta(y: Any, held: Any, wavelength_um: Any, eta_i: Any, *, spec: Spec, medium: int) -> Any:
    return medium_index(spec, medium, spec.values(y, held), wavelength_um, eta_i)[0]


_eta_of = compiled(_eta, ("spec", "medium"))


def films_of(spec: Spec, moving: Sequence[Unknown]) -> list[_Film]:
    """Return the films whose thickness is free, the one that may be thickest first."""
    out = []
    for medium, coherent in enumerate(spec.media.coherent):
        name = f"{spec.media.places[medium]}.thickness_nm"
        if not coherent or name not in spec.moving:
            continue
        row = spec.moving.index(name)
        if moving[row].free:
            low, high = start_range(moving[row])
            out.append(_Film(medium, row, 1e-3 * low, 1e-3 * high))
    return sorted(out, key=lambda film: -film.high_um)


def _curves(seen: Observations) -> tuple[np.ndarray, np.ndarray]:
    """Return all measured curves and their weights, (C, M) each."""
    values = [v[:, 0] for v in seen.values]
    weights = [w[:, 0] for w in seen.weights]
    if NCS in seen.channels:
        some = np.sqrt(np.abs(seen.ncs_weights[..., 0]).sum(axis=(0, 1)))
        values += list(seen.ncs[..., 0])
        weights += [some] * 3
    values, weights = np.array(values), np.array(weights)
    # Each curve counts alike, by its own size: the fringes are looked for, not their contrast.
    for i, (v, w) in enumerate(zip(values, weights, strict=True)):
        if w.any():
            mean = np.average(v, weights=w)
            size = np.sqrt(np.average((v - mean) ** 2, weights=w))
            weights[i] = (w > 0.0) / (size if size > 0.0 else 1.0)
    return values, weights


def _rates(fit: Solving, film: _Film, y: np.ndarray) -> np.ndarray:
    """Return the phase rate of every lane of y (p, L), (L, M)."""
    points, spec, medium = fit.seen.points, fit.u.spec, film.medium
    with jax.enable_x64(True):
        if eta_moves(spec, fit.targets, medium):
            eta = eta_in_parts(fit.targets, y, medium, spec=spec)
        else:
            eta = np.asarray(_eta_of(
                y, fit.u.held, points.wavelength_um, fit.targets.eta_i, spec=spec, medium=medium,
            ))  # fmt: skip
    eta_i = np.broadcast_to(fit.targets.eta_i, points.wavelength_um.shape)[:, 0]
    rate = phase_rate(eta.T, points.wavelength_um[:, 0], points.angle_deg[:, 0], eta_i)
    return np.where(np.isfinite(rate), rate, 1.0)


def _middle(rates: np.ndarray) -> np.ndarray:
    """Return the phase rate amid the fringes, (L,), of (L, M): where a film is a metal are none."""
    fringed = rates > 0.5 * rates.max(axis=1, keepdims=True)
    return np.nanmedian(np.where(fringed, rates, np.nan), axis=1)


def film_starts(fit: Solving, y: np.ndarray) -> np.ndarray:
    """Return more starts (p, S) for a sample with films; (p, 0) for one without.

    y: (p, L) starts as of any other sample, whose indices are the candidates for that of the film.
    """
    films = films_of(fit.u.spec, fit.u.moving)
    if not films:
        return y[:, :0]
    film = films[0]
    many = y.shape[1] > 4 * LANES
    indices, count = (_MANY_CANDIDATES, _MANY_LIKELY) if many else (_CANDIDATES, _LIKELY)
    rates = _rates(fit, film, y[:, :indices])
    used = np.arange(rates.shape[1]) <= fit.seen.row.max()  # the rows behind are padding
    return _by_fringes(fit, film, y, rates, used, count)


def _by_fringes(
    fit: Solving, film: _Film, y: np.ndarray, rates: np.ndarray, rows: np.ndarray, count: int
) -> np.ndarray:
    """Return starts (p, 4 count) by the fringes that some rows (bool, of all) show."""
    values, weights = _curves(fit.seen)
    lane, thickness = likely_thicknesses(
        rates[:, rows], film.low_um, film.high_um, values[:, rows], weights[:, rows], count
    )
    middle = _middle(rates[lane][:, rows])
    out = []
    for shift in _SHIFTS:
        start = y[:, lane].copy()
        moved = np.clip(thickness + shift / middle, film.low_um, film.high_um)
        start[film.row] = _coordinate(fit, film, moved)
        out.append(start)
    return np.concatenate(out, 1)


def _from_parts(fit: Solving, film: _Film, y: np.ndarray, noise: float, least: float) -> list[Ends]:
    """Return where starts end that were found in parts of the spectrum; y: candidates (p, L)."""
    rates = _rates(fit, film, y[:, :_MANY_CANDIDATES])
    out, each = [], parts(fit.seen)
    for part, rows in enumerate(each):
        start = _by_fringes(fit, film, y, rates, rows, LANES // len(_SHIFTS))
        half = followed_to_half(fit, start, each, part, noise)
        out.append(_followed(fit, half, noise, least))
    return out


def _coordinate(fit: Solving, film: _Film, thickness_um: np.ndarray) -> np.ndarray:
    kind = fit.u.moving[film.row].parameter.coordinate
    return from_parameter(kind, 1e3 * np.maximum(thickness_um, 0.0))


def _many_fringes(fit: Solving, film: _Film, y: np.ndarray) -> bool:
    """Whether so thick a film may be looked for that its parts of the spectrum have fringes."""
    used = np.arange(fit.seen.points.wavelength_um.shape[0]) <= fit.seen.row.max()
    return film.high_um * float(np.ptp(_rates(fit, film, y[:, None])[0, used])) > _FRINGES


def _residuals_alike(fit: Solving, y: np.ndarray) -> bool:
    """Whether neighbouring residuals at y are alike, as noise is not."""
    r = fit.slopes(y).residual
    return float(r[1:] @ r[:-1]) > 3.0 * float(r @ r) / np.sqrt(len(r))


def _followed(fit: Solving, start: np.ndarray, noise: float, best: float) -> Ends:
    """Return where starts (p, S) end; those that are far above the best cost on the way."""
    low, high = (np.repeat(a[:, None], start.shape[1], 1) for a in fit.limits)
    ends = fit.held(start, low, high, noise, STAGE)
    shown = best + ALTERNATIVE_CHI2 * _unit(fit, best)
    for _ in range(_FURTHER):
        if not (~ends.done & (ends.cost < shown)).any():
            break
        ends = fit.held(ends.y, low, high, noise, STAGE)
        # After the first of them what still crawls along a valley, unless it is the lowest of all.
        shown = best - _unit(fit, best)
    return ends._replace(y=in_order(fit.u, ends.y, fit.settings))


def _unit(fit: Solving, cost: float) -> float:
    """Return a unit of chi2."""
    return max(1.0, cost / max(fit.dof, 1)) if not fit.asked.scaled else cost / max(fit.dof, 1)


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


def _orders(fit: Solving, film: _Film, y: np.ndarray) -> np.ndarray:
    """Return starts (p, S) one or more fringe orders beside y (p,).

    With the index as it is, and scaled so that the optical thickness stays: where the data tell
    little of the order, these are the solutions that fit as well.
    """
    rate = float(_middle(_rates(fit, film, y[:, None]))[0])
    limits = fit.u.moving[film.row]
    x, _ = value_and_slope(limits.parameter.coordinate, y[film.row : film.row + 1])
    thickness = 1e-3 * float(x[0])
    starts = [np.empty((0, len(y)))]
    for order in (o for n in range(1, _ORDERS + 1) for o in (n, -n)):
        moved = thickness + order / rate
        if max(1e-3 * limits.low, 0.0) < moved < 1e-3 * limits.high:
            for factor in (1.0, thickness / moved):
                start = _scaled(fit, film, y, factor)
                start[film.row] = _coordinate(fit, film, np.array([moved]))[0]
                starts.append(start[None])
    return np.concatenate(starts).T


def with_neighbours(fit: Solving, ends: Ends, start: np.ndarray, noise: float) -> Ends:
    """Return the ends, and those of starts beside the best of them: `_crossed` and `_orders`.

    start: (p, S) random starts. Again from what is found so, while it is lower; once from parts of
    the spectrum, where the residuals of what is found otherwise are no noise.
    """
    films = films_of(fit.u.spec, fit.u.moving)
    random, tried = np.random.default_rng(fit.asked.seed), False
    for _ in range(_ROUNDS if films else 0):
        best = best_of(ends)
        if best is None:
            break
        least, y = float(ends.cost[best]), ends.y[:, best]
        both = [_crossed(fit, ends, start, random), _orders(fit, films[0], y)]
        found = [_followed(fit, s, noise, least) for s in both if s.size]
        ends = joined([ends, *found])
        if ends.cost.min() < least - _unit(fit, least):
            continue
        if tried or not _many_fringes(fit, films[0], y) or not _residuals_alike(fit, y):
            break
        tried = True
        ends = joined([ends, *_from_parts(fit, films[0], start, noise, least)])
    return ends


def _scaled(fit: Solving, film: _Film, y: np.ndarray, factor: float) -> np.ndarray:
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
