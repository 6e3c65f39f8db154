"""The sum of squares of all wavelengths over one thickness that they share, and its lowest place.

At each thickness every wavelength is a fit by itself, with eta and k of its own.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fitting.searching.fringes import local_minima
from fitting.searching.minima import alternative_chi2
from fitting.uncertainty.limits import student_quantile
from fitting.wavelengths import One, solved_each

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
    ones: Sequence[One], row: int, place: str, ends: tuple[float, float], scaled: bool
) -> SharedThickness:
    """Return the thickness between two that fits all wavelengths best.

    row: of the thickness among the constants of the fits. place: name of the film. scaled: whether
    the error is multiplied by the scatter of the data.
    """
    grid = np.geomspace if ends[1] > 4.0 * ends[0] else np.linspace
    p = _profile(ones, row, grid(*ends, _GRID), scaled, _NEAR)
    best, sigma = float(p.thickness_nm[p.best]), _error(p)
    if not np.isfinite(sigma):
        return SharedThickness(best, sigma, np.full(2, np.nan), ())
    around = np.clip(best + sigma * np.linspace(-6.0, 6.0, _WITHIN), *ends)
    around = np.append(around[np.argsort(np.abs(around - best))], ends)
    near = _profile(_with_gain(ones, place), row, around, scaled, _FLAT, p.y)
    best, sigma = float(near.thickness_nm[near.best]), _error(near)
    half = student_quantile(near.dof) * sigma
    return SharedThickness(best, sigma, np.array([best - half, best + half]), _others(p))


def best_within_error(
    ones: Sequence[One], row: int, nm: float, sigma: float, ends: tuple[float, float]
) -> float:
    """Return the thickness within one standard error that fits best with k >= 0, or ``nm``.

    ``nm`` if the best one is hardly better.
    """
    places = np.clip(nm + sigma * np.append(0.0, np.linspace(-1.0, 1.0, _WITHIN - 1)), *ends)
    costs = [place.cost for place in _at(ones, row, [(d, None) for d in places.tolist()])]
    return float(places[np.argmin(costs)]) if min(costs) < costs[0] - _NEAR else nm


def _at(
    ones: Sequence[One], row: int, asked: Sequence[tuple[float, np.ndarray | None]]
) -> list[_Place]:
    """Return the lowest costs of all wavelengths at each of some thicknesses, all in one run.

    asked: a thickness in nm, and where costs are lowest at one close to it, (p, W), for starts.
    """
    moved = []
    for thickness_nm, near in asked:
        for i, one in enumerate(ones):
            job, start = copy.copy(one.fit), one.start[:, :_STARTS]
            held = one.fit.targets.held.copy()
            held[row] = thickness_nm
            job.targets = one.fit.targets._replace(held=held)
            if near is not None:
                beside = np.clip(i + np.arange(-_BESIDE, _BESIDE + 1), 0, len(ones) - 1)
                start = np.concatenate([near[:, beside], start], 1)[:, :_STARTS]
            moved.append(one._replace(fit=job, start=start, place=len(moved)))
    ends = [e for _, e in solved_each(moved, _STARTS)]
    cost = np.array([np.where(np.isfinite(e.cost), e.cost, np.inf) for e in ends])
    lowest = [e.y[:, lane] for e, lane in zip(ends, np.argmin(cost, 1), strict=True)]
    each = range(0, len(moved), len(ones))
    return [
        _Place(float(cost[i : i + len(ones)].min(1).sum()), np.stack(lowest[i : i + len(ones)], 1))
        for i in each
    ]


def _with_gain(ones: Sequence[One], place: str) -> list[One]:
    """Return the wavelengths with the k of a film down to _LEAST_K, unless it is fixed at 0."""
    out = []
    for one in ones:
        job = copy.copy(one.fit)
        low, high = job.limits
        own = [name == f"{place}.k" for name in job.u.spec.moving]
        job.limits = np.where(own & (low == 0.0) & (high > 0.0), _LEAST_K, low), high
        out.append(one._replace(fit=job))
    return out


def _profile(
    ones: Sequence[One], row: int, places: np.ndarray, scaled: bool, flat: float,
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
        found = _at(ones, row, asked) if asked else []
        known.update({d: place for (d, _), place in zip(asked, found, strict=True)})

    dof = max(sum(one.fit.dof for one in ones) - 1, 1)
    least = 1e-24 * sum(one.fit.squares for one in ones)

    estimated = scaled or not ones[0].fit.seen.stated

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
