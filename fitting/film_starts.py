"""Starts of a sample with films: where the fringes put the thickness, and the orders beside it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import numpy as np

from fitting.compiled import compiled
from fitting.fringes import likely_thicknesses, phase_rate
from fitting.minima import ALTERNATIVE_CHI2
from fitting.observe import NCS, Spec, medium_index
from fitting.parameters import from_parameter, value_and_slope
from fitting.starts import STAGE, STAGES, Ends, best_of, start_range

if TYPE_CHECKING:
    from fitting.observations import Observations
    from fitting.search import Solving
    from fitting.starts import Unknown

# So many thicknesses are taken from the fringes, each with these shifts in parts of a period: the
# phase of the reflections at both faces is not known to the scan.
_LIKELY = 40
# Indices that are tried in the scan of the thickness.
_CANDIDATES = 40
_SHIFTS = (0.0, 0.25, -0.25, 0.5)
# Fringe orders on either side of the best minimum that are looked at.
_ORDERS = 8
# Evaluations after which it shows which of them may fit as well.
_BRIEF = 20
_INDEX = ("eta", "A")


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
    points, held = fit.seen.points, fit.u.held
    with jax.enable_x64(True):
        eta = np.asarray(_eta_of(
            y, held, points.wavelength_um, fit.targets.eta_i, spec=fit.u.spec, medium=film.medium,
        ))  # fmt: skip
    eta_i = np.broadcast_to(fit.targets.eta_i, points.wavelength_um.shape)[:, 0]
    rate = phase_rate(eta.T, points.wavelength_um[:, 0], points.angle_deg[:, 0], eta_i)
    return np.where(np.isfinite(rate), rate, 1.0)


def film_starts(fit: Solving, y: np.ndarray) -> np.ndarray:
    """Return more starts (p, S) for a sample with films; (p, 0) for one without.

    y: (p, L) starts as of any other sample, whose indices are the candidates for that of the film.
    """
    films = films_of(fit.u.spec, fit.u.moving)
    if not films:
        return y[:, :0]
    film = films[0]
    rates = _rates(fit, film, y[:, :_CANDIDATES])
    used = fit.seen.row.max() + 1  # the rows behind are padding
    values, weights = _curves(fit.seen)
    lane, thickness = likely_thicknesses(
        rates[:, :used], film.low_um, film.high_um, values[:, :used], weights[:, :used], _LIKELY
    )
    middle = np.median(rates[lane, :used], axis=1)
    out = []
    for shift in _SHIFTS:
        start = y[:, lane].copy()
        moved = np.clip(thickness + shift / middle, film.low_um, film.high_um)
        start[film.row] = _coordinate(fit, film, moved)
        out.append(start)
    return np.concatenate(out, 1)


def _coordinate(fit: Solving, film: _Film, thickness_um: np.ndarray) -> np.ndarray:
    kind = fit.u.moving[film.row].parameter.coordinate
    return from_parameter(kind, 1e3 * np.maximum(thickness_um, 0.0))


def with_neighbours(fit: Solving, ends: Ends, noise: float) -> Ends:
    """Return the ends, and those of starts one or more fringe orders beside the best of them.

    With the index as it is, and scaled so that the optical thickness stays: where the data tell
    little of the order, these are the solutions that fit as well.
    """
    films = films_of(fit.u.spec, fit.u.moving)
    best = best_of(ends)
    if not films or best is None:
        return ends
    film, y = films[0], ends.y[:, best]
    rate = float(np.median(_rates(fit, film, y[:, None])))
    x, _ = value_and_slope(fit.u.moving[film.row].parameter.coordinate, y[film.row : film.row + 1])
    thickness = 1e-3 * float(x[0])
    limits = fit.u.moving[film.row]
    place = fit.u.spec.media.places[film.medium]
    rows = [i for i, n in enumerate(fit.u.spec.moving)
            if n.rpartition(".")[0] == place and n.rpartition(".")[2] in _INDEX
            and fit.u.moving[i].free]  # fmt: skip
    starts = []
    for order in (o for n in range(1, _ORDERS + 1) for o in (n, -n)):
        moved = thickness + order / rate
        if not max(1e-3 * limits.low, 0.0) < moved < 1e-3 * limits.high:
            continue
        for scaled in (False, True):
            start = y.copy()
            start[film.row] = _coordinate(fit, film, np.array([moved]))[0]
            if scaled and rows:
                start[rows] = y[rows] * thickness / moved
            starts.append(start)
    if not starts:
        return ends
    start = np.stack(starts, 1)
    low, high = (np.repeat(a[:, None], start.shape[1], 1) for a in fit.limits)
    more = fit.held(start, low, high, noise, _BRIEF)
    # 18 in 20 of them are far worse by now: on with those alone that may be shown.
    shown = ends.cost[best] + ALTERNATIVE_CHI2 * max(1.0, ends.cost[best] / max(fit.dof, 1))
    for _ in range(STAGES):
        if not (~more.done & (more.cost < shown)).any():
            break
        more = fit.held(more.y, low, high, noise, STAGE)
    return Ends(*(np.concatenate(both, -1) for both in zip(ends, more, strict=True)))
