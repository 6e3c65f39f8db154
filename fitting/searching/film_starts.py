"""Starts of a sample with films: thicknesses that agree with the interference fringes."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from fitting.optics.observe import medium_index
from fitting.optics.spec import NCS, Spec
from fitting.problem.lanes import LANES
from fitting.problem.observations import Observations
from fitting.problem.problem import Problem
from fitting.process.compiled import compiled, fit_settings
from fitting.samples.parameters import Unknown, from_parameter, start_range, value_and_slope
from fitting.searching.fringes import likely_thicknesses, phase_rate

# Number of indices in the scan of the thickness, and of thicknesses that are taken from it; the
# same for many starts. Each thickness is tried with these shifts, in parts of a period, since the
# scan does not know the phases of the reflections at the two faces.
_CANDIDATES, _LIKELY = 40, 40
_MANY_CANDIDATES, _MANY_LIKELY = 128, 80
SHIFTS = (0.0, 0.25, -0.25, 0.5)
# For each film beyond the second so many times as many ways to divide a phase are tried.
_SPLITS = 4
# Parameters that the index of a film, or its square, is proportional to.
_INDEX = {
    "eta": 1, "k": 1, "A": 1, "B": 1, "C": 1, "plasma": 1, "eps": 2, "strength": 2, "amplitude": 2,
}  # fmt: skip
# A film of fewer fringes at most has none to be found by, beside one that has more.
_LEAST_FRINGES = 0.5
# Rows of a call; the lanes of one are LANES.
_ROWS = 64


class Film(NamedTuple):
    """A film whose thickness is free: its medium, its row in y, and the range of its starts."""

    medium: int
    row: int
    low_um: float
    high_um: float


def _index(y: Any, held: Any, wavelength_um: Any, eta_i: Any, *, spec: Spec, medium: int) -> Any:
    return medium_index(spec, medium, spec.values(y, held), wavelength_um, eta_i)


_index_of = compiled(_index, "spec", "medium")


def films_of(spec: Spec, moving: Sequence[Unknown]) -> list[Film]:
    """Return the films whose thickness is free, the one that may be thickest first."""
    out = []
    for medium, coherent in enumerate(spec.media.coherent):
        name = f"{spec.media.places[medium]}.thickness_nm"
        if not coherent or name not in spec.moving:
            continue
        row = spec.moving.index(name)
        if moving[row].free:
            low, high = start_range(moving[row])
            out.append(Film(medium, row, 1e-3 * low, 1e-3 * high))
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


def film_index(fit: Problem, film: Film, y: np.ndarray) -> np.ndarray:
    """Return eta and k of a film in every lane of y (p, L), (2, M, L)."""
    rows, count = len(fit.seen.points.wavelength_um), y.shape[1]
    # One program for all numbers of rows and lanes: blocks of both, the last ones filled up.
    um, eta_i = (
        np.pad(np.broadcast_to(a, (rows, 1)), ((0, -rows % _ROWS), (0, 0)), "edge")
        for a in (fit.seen.points.wavelength_um, fit.targets.eta_i)
    )
    whole = np.pad(y, ((0, 0), (0, -count % LANES)), "edge")
    out = np.empty((2, len(um), whole.shape[1]))
    with fit_settings():
        for row, lane in itertools.product(
            range(0, len(um), _ROWS), range(0, whole.shape[1], LANES)
        ):
            block, some = slice(row, row + _ROWS), slice(lane, lane + LANES)
            out[0, block, some], out[1, block, some] = _index_of(
                whole[:, some], fit.u.held, um[block], eta_i[block],
                spec=fit.u.spec, medium=film.medium,
            )  # fmt: skip
    return out[:, :rows, :count]


def phase_rates(fit: Problem, film: Film, y: np.ndarray) -> np.ndarray:
    """Return the phase rate of every lane of y (p, L), (L, M)."""
    points, (eta, _) = fit.seen.points, film_index(fit, film, y)
    eta_i = np.broadcast_to(fit.targets.eta_i, points.wavelength_um.shape)[:, 0]
    rate = phase_rate(eta.T, points.wavelength_um[:, 0], points.angle_deg[:, 0], eta_i)
    return np.where(np.isfinite(rate), rate, 1.0)


def middle(rates: np.ndarray) -> np.ndarray:
    """Return the phase rate amid the fringes, (L,), of (L, M); metallic ranges have no fringes."""
    fringed = rates > 0.5 * rates.max(axis=1, keepdims=True)
    return np.nanmedian(np.where(fringed, rates, np.nan), axis=1)


def film_starts(fit: Problem, y: np.ndarray) -> np.ndarray:
    """Return more starts (p, S) for a sample with films; (p, 0) for one without.

    y: (p, L) starts as of any other sample, whose indices are the candidates for that of the film.
    """
    films = films_of(fit.u.spec, fit.u.moving)
    if not films:
        return y[:, :0]
    many = y.shape[1] > 4 * LANES
    indices, count = (_MANY_CANDIDATES, _MANY_LIKELY) if many else (_CANDIDATES, _LIKELY)
    rates = [phase_rates(fit, film, y[:, :indices]) for film in films]
    most = [
        film.high_um * float(np.median(middle(r))) for film, r in zip(films, rates, strict=True)
    ]
    # A film that can have next to no fringe beside one that has them is not looked for by its own.
    with_fringes = [i for i, n in enumerate(most) if n > _LEAST_FRINGES or n == max(most)]
    films, rates = [films[i] for i in with_fringes], [rates[i] for i in with_fringes]
    each = [by_fringes(fit, film, y, r, count) for film, r in zip(films, rates, strict=True)]
    if len(films) > 1:
        again = _SPLITS ** (len(films) - 2)
        each += [
            _split(fit, films, film, np.tile(start, again))
            for film, start in zip(films, each, strict=True)
        ]
    return np.concatenate(each, 1)


def _split(fit: Problem, films: list[Film], film: Film, y: np.ndarray) -> np.ndarray:
    """Return y (p, L) with the phase of one film divided among all films at random.

    The strongest fringes of several films are often those of the light from the last interface,
    which are those of all their phases together.
    """
    random, out = np.random.default_rng(fit.asked.seed), y.copy()
    phase = thickness_um(fit, film, y) * middle(phase_rates(fit, film, y))
    shares = random.dirichlet(np.ones(len(films)), y.shape[1])
    for one, share in zip(films, shares.T, strict=True):
        thickness = np.clip(
            share * phase / middle(phase_rates(fit, one, y)), one.low_um, one.high_um
        )
        out[one.row] = coordinate(fit, one, thickness)
    return out


def by_fringes(
    fit: Problem, film: Film, y: np.ndarray, rates: np.ndarray, count: int, most: float = np.inf
) -> np.ndarray:
    """Return starts (p, 4 count) from the fringes, y (p, L) at likely thicknesses.

    most: leave out thicknesses whose misfit is so many times that of the best.
    """
    values, weights = _curves(fit.seen)
    rows = fit.seen.measured
    lane, thickness = likely_thicknesses(
        rates[:, rows], film.low_um, film.high_um, values[:, rows], weights[:, rows], count, most
    )
    between = middle(rates[lane][:, rows])
    shifted = np.concatenate([thickness + shift / between for shift in SHIFTS])
    out = np.tile(y[:, lane], len(SHIFTS))
    out[film.row] = coordinate(fit, film, np.clip(shifted, film.low_um, film.high_um))
    return out


def scaled_index(fit: Problem, film: Film, y: np.ndarray, factor: float | np.ndarray) -> np.ndarray:
    """Return y (p, L) with the film's index times a factor () or (L,), if its model allows."""
    out = y.copy()
    place = fit.u.spec.media.places[film.medium]
    for i, (name, unknown) in enumerate(zip(fit.u.spec.moving, fit.u.moving, strict=True)):
        of, _, own = name.rpartition(".")
        power = _INDEX.get(own.partition("_")[0])
        if of == place and power and unknown.free:
            kind = unknown.parameter.coordinate
            x, _ = value_and_slope(kind, y[i : i + 1])
            out[i : i + 1] = from_parameter(kind, x * factor**power)
    low, high = (a[:, None] for a in fit.limits)
    return np.clip(out, low, high)


def coordinate(fit: Problem, film: Film, um: np.ndarray) -> np.ndarray:
    """Return a thickness in the solver's coordinate."""
    kind = fit.u.moving[film.row].parameter.coordinate
    return from_parameter(kind, 1e3 * np.maximum(um, 0.0))


def thickness_um(fit: Problem, film: Film, y: np.ndarray) -> np.ndarray:
    """Return the thickness of a film in every lane of y (p, L), (L,)."""
    return 1e-3 * value_and_slope(fit.u.moving[film.row].parameter.coordinate, y[film.row])[0]
