"""The sum of squares of all wavelengths over one thickness that they share, and its lowest place.

At each thickness every wavelength is a fit by itself, with eta and k of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fitting.problem.lanes import LANES, Limits
from fitting.searching.batch_search import BatchSearch
from fitting.searching.fringes import local_minima
from fitting.searching.minima import alternative_chi2
from fitting.searching.starts import starts as start_points
from fitting.uncertainty.limits import student_quantile
from fitting.wavelengths import Wavelengths

# The thickness is first scanned in _GRID steps, each wavelength from _STARTS starts. At most
# _CLOSER finer scans of _WITHIN steps follow, each a third as wide, until the cost beside the best
# thickness is higher by less than _NEAR of the scatter, which is within two standard errors. A
# second scan there, with k of either sign, ends at less than _FLAT: within .03 standard errors.
_STARTS, _GRID, _CLOSER, _WITHIN = 16, 25, 14, 7
# Before these, one finer scan in each of so many valleys: the lowest one may be narrow.
_VALLEYS = (3, 2)
_NEAR, _FLAT = 4.0, 1e-3
# So many thicknesses of the scan follow one another, each from the solutions at the one before it.
_CHAIN = 5
# Of the starts those from so many wavelengths on either side, at the nearest thickness known.
_BESIDE = 3
# With k >= 0 at every wavelength a transparent film would seem too thick, by two standard errors
# for 30 wavelengths: there k can follow a larger thickness, but not a smaller one. So the thickness
# is determined with the k that the data ask for, down to this one.
_LEAST_K = -0.1


class SharedThickness(NamedTuple):
    """The best thickness, its standard error and interval, and others that fit nearly as well.

    interval: the 95 % interval (2,), also beyond the ends of the range. others: thickness and the
    rise of chi2 of each.
    """

    nm: float
    sigma: float
    interval: np.ndarray
    others: tuple[tuple[float, float], ...]


class _Place(NamedTuple):
    """Sum of the lowest costs of all wavelengths at a thickness, and where these are, (p, W)."""

    cost: float
    y: np.ndarray


class _Profile(NamedTuple):
    """Cost over thickness, (D,) each, in rising order.

    scatter: the unit of a rise of the cost. dof: degrees of freedom from which it was estimated, 0
    where it was stated. y: (p, W) where the wavelengths ended at the best.
    """

    thickness_nm: np.ndarray
    cost: np.ndarray
    scatter: float
    dof: int
    y: np.ndarray

    @property
    def best(self) -> int:
        """The place of the best thickness."""
        return int(np.argmin(self.cost))


def shared_thickness(
    waves: Wavelengths, row: int, place: str, ends: tuple[float, float]
) -> SharedThickness:
    """Return the thickness between two that fits all wavelengths best.

    row: of the thickness among the constants of the fits. place: name of the film.
    """
    grid = np.geomspace if ends[1] > 4.0 * ends[0] else np.linspace
    limits = waves.job.limits
    p = _profile(waves, row, limits, grid(*ends, _GRID), _NEAR)
    best, sigma = float(p.thickness_nm[p.best]), _error(p)
    if not np.isfinite(sigma):
        return SharedThickness(best, sigma, np.full(2, np.nan), ())
    around = np.clip(best + sigma * np.linspace(-6.0, 6.0, _WITHIN), *ends)
    around = np.append(around[np.argsort(np.abs(around - best))], ends)
    low, high = limits
    own = [name == f"{place}.k" for name in waves.job.u.spec.moving]
    # Unless it is fixed at 0.
    gain = np.where(own & (low == 0.0) & (high > 0.0), _LEAST_K, low), high
    near = _profile(waves, row, gain, around, _FLAT, p.y)
    best, sigma = float(near.thickness_nm[near.best]), _error(near)
    half = student_quantile(near.dof) * sigma
    return SharedThickness(best, sigma, np.array([best - half, best + half]), _others(p))


def best_within_error(
    waves: Wavelengths, row: int, nm: float, sigma: float, ends: tuple[float, float]
) -> float:
    """Return the thickness within one standard error that fits best with k >= 0, or ``nm``.

    ``nm`` if the best one is hardly better.
    """
    places = np.clip(nm + sigma * np.append(0.0, np.linspace(-1.0, 1.0, _WITHIN - 1)), *ends)
    found = _at(waves, row, waves.job.limits, [(d, None) for d in places.tolist()])
    costs = [place.cost for place in found]
    return float(places[np.argmin(costs)]) if min(costs) < costs[0] - _NEAR else nm


def _at(
    waves: Wavelengths, row: int, limits: Limits,
    asked: Sequence[tuple[float, np.ndarray | None]],
) -> list[_Place]:  # fmt: skip
    """Return the lowest costs of all wavelengths at each of some thicknesses, all in one run.

    asked: a thickness in nm, and where costs are lowest at one close to it, (p, W), for starts.
    """
    job, count = waves.job, waves.curves.count
    curves = waves.curves.at(np.tile(np.arange(count), len(asked)))
    curves.own["held"][row] = np.repeat([thickness_nm for thickness_nm, _ in asked], count)
    usual = np.repeat(start_points(job.u.moving, LANES, job.asked.seed)[:, None], count, 1)
    beside = np.clip(
        np.arange(count)[:, None] + np.arange(-_BESIDE, _BESIDE + 1), 0, count - 1
    )  # fmt: skip
    starts = [
        usual if near is None else np.concatenate([near[:, beside], usual], 2) for _, near in asked
    ]  # (p, W, S) each
    start = np.concatenate([s[:, :, :_STARTS] for s in starts], 1)
    search = BatchSearch(job, curves, limits)
    search.run(start.reshape(len(start), -1), np.repeat(np.arange(curves.count), _STARTS))
    cost = search.best.cost.reshape(len(asked), count).sum(1)
    y = search.best.y.reshape(len(start), len(asked), count)
    return [_Place(float(c), y[:, i]) for i, c in enumerate(cost)]


def _profile(
    waves: Wavelengths, row: int, limits: Limits, places: np.ndarray, flat: float,
    near: np.ndarray | None = None,
) -> _Profile:  # fmt: skip
    """Return the costs at thicknesses (D,), and at others ever closer to the best one.

    Until the cost beside the best one is higher by less than ``flat`` of the scatter. near: (p, W),
    starts at the first thickness.
    """
    known: dict[float, _Place] = {}

    def look(places: np.ndarray) -> None:
        asked: list[tuple[float, np.ndarray | None]] = []
        for d in places.tolist():
            # A place that differs from the best one by rounding only would become its neighbour,
            # and hide those beyond.
            if all(abs(d - other) > 1e-10 * d for other in known):
                closest = min(known, key=lambda other: abs(d - other)) if known else None
                asked.append((d, near if closest is None else known[closest].y))
        found = _at(waves, row, limits, asked) if asked else []
        known.update({d: place for (d, _), place in zip(asked, found, strict=True)})

    job, curves = waves.job, waves.curves
    dof = max(int(BatchSearch(job, curves).dof.sum()) - 1, 1)
    least = 1e-24 * job.squares
    estimated = job.asked.scaled or not curves.stated

    def scatter() -> float:
        lowest = min(place.cost for place in known.values())
        return max(lowest / dof if estimated else 1.0, least)

    # Each from the one before it, _CHAIN in a row; all at once where a start is known.
    chain = _CHAIN if near is None else 1
    for first in range(chain):
        look(places[first::chain])
    for several in (*_VALLEYS, *[1] * _CLOSER):
        order = sorted(known)
        costs = np.array([known[d].cost for d in order])
        best = np.flatnonzero(local_minima(costs))
        best = best[np.argsort(costs[best], kind="stable")][:several].tolist()
        beside = [(max(i - 1, 0), min(i + 1, len(order) - 1)) for i in best]
        if max(costs[i] for i in beside[0]) - costs[best[0]] < flat * scatter():
            break
        for low, high in beside:
            look(np.linspace(order[low], order[high], _WITHIN))
    order = sorted(known)
    best = min(order, key=lambda d: known[d].cost)
    costs = np.array([known[d].cost for d in order])
    return _Profile(np.array(order), costs, scatter(), dof if estimated else 0, known[best].y)


def _error(p: _Profile) -> float:
    """Return the standard error of the thickness, over which the cost rises by the scatter.

    A parabola through the valley of the best one: another valley may be as low.
    """
    rise = (p.cost - p.cost[p.best]) / p.scatter
    valley = np.cumsum(rise >= 9.0)
    near = (valley == valley[p.best]) & (rise < 9.0)
    if near.sum() < 5:
        near = np.zeros(len(rise), bool)
        near[np.argsort(np.abs(p.thickness_nm - p.thickness_nm[p.best]))[:5]] = True
    away = p.thickness_nm[near] - p.thickness_nm[p.best]
    size = np.abs(away).max()
    bend = np.polyfit(away / size, rise[near], 2)[0]
    return float(size / np.sqrt(bend)) if bend > 0.0 else np.inf


def _others(p: _Profile) -> tuple[tuple[float, float], ...]:
    """Return other thicknesses that fit nearly as well, with the rise of chi2."""
    rise = (p.cost - p.cost[p.best]) / p.scatter
    out = []
    for i in np.flatnonzero(local_minima(rise) & (rise < alternative_chi2(p.dof))):
        between = rise[min(i, p.best) : max(i, p.best) + 1]
        if i != p.best and between.max() > rise[i] + 1.0:
            out.append((float(p.thickness_nm[i]), float(rise[i])))
    return tuple(out)
