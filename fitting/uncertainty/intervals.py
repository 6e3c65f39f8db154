"""95 % intervals of the parameters of a model: quadratic where that is accurate, else by profile.

The quadratic ones are value +- t sigma, cut at the ends of the range of the parameter. If the data
depend on the square of a parameter (k of a bare interface), they follow from the square.

"auto" tests whether an end by profile lies between 1 - OFF and 1 + OFF of the distance of the
quadratic end, by the rise of the cost at these two places with the other parameters fitted again.
(The rise at the quadratic end itself does not show that: where the floor of a valley flattens, its
root may be near 1 and the end far away.) OFF is the error of the quadratic ends for which a bare
surface takes the profile (sigma_eta of 2 % of eta; `region_intervals`). Parameters compatible with
0 always have a profile interval, and so have all parameters if one lies on a bound.

For a profile interval of a parameter all others may move within their ranges, also those on a
bound. A standard error, however, assumes that a parameter on a bound stays there.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from fitting.problem.problem import Problem
from fitting.problem.programs import LOSSES
from fitting.residuals.error_model import ERRORS
from fitting.results.result_parts import NONE, PROFILE, QUADRATIC
from fitting.samples.parameters import LOG, SQUARE, Unknown, from_parameter, value_and_slope
from fitting.uncertainty.beside_zero import interval_from_zero
from fitting.uncertainty.bounded_parameters import aim_beside_zero, may_be_zero, unbounded
from fitting.uncertainty.covariance import End, Uncertainty
from fitting.uncertainty.limits import ROUNDING, student_quantile
from fitting.uncertainty.profile import FEW_ROUNDS, ROUNDS, Base, Search, follow, visit

AUTO = "auto"
KINDS = (AUTO, QUADRATIC, PROFILE)
OFF = 0.1


class Intervals(NamedTuple):
    """Of one minimum, over all p unknowns: ends (p, 2), the quadratic ones too; kind of each.

    NaN where there is none. limits: (p,), upper limits of what is compatible with 0; NaN for what
    is not, by the profile or at once. lowest: the least cost that was met, and where (p,).
    inside: (K, p), the places within these intervals that lie next to their ends by profile, all
    unknowns in the solver's coordinates. t: half an interval in standard errors.
    """

    ends: np.ndarray
    quadratic: np.ndarray
    kind: tuple[str, ...]
    limits: np.ndarray
    lowest: tuple[float, np.ndarray]
    inside: np.ndarray
    t: float


def check_choices(loss: str, errors: str, intervals: str) -> None:
    """Raise ValueError for an unknown value of these options of a fit."""
    named = {"loss": (loss, LOSSES), "errors": (errors, ERRORS), "intervals": (intervals, KINDS)}
    for name, (came, wanted) in named.items():
        if came not in wanted:
            raise ValueError(f"{name} is {came!r}; one of {', '.join(wanted)} was wanted.")


def _from_zero(moving: Sequence[Unknown], y: np.ndarray, known: Uncertainty, t: Any) -> np.ndarray:
    """Return quadratic intervals (..., p, 2) of parameters that cannot be negative and may be 0.

    NaN for the others. A square (k where the data depend on k^2) is compatible with 0 within three
    standard errors of the square; another parameter whose range begins at 0, if it ended there.
    """
    out = np.full((*y.shape, 2), np.nan)
    for i, u in enumerate(moving):
        value, sigma = unbounded(u, y[..., i], known, i)
        ends = np.stack(interval_from_zero(value, sigma, np.asarray(t)), -1)
        if u.parameter.coordinate == SQUARE:
            near = y[..., i] < 3.0 * sigma
            out[..., i, :] = np.sqrt(np.where(near[..., None], ends, np.nan))
        else:
            out[..., i, :] = np.where((known.at_bound[..., i] == "low")[..., None], ends, np.nan)
    return out


def _of(fit: Problem, j: int, y: float) -> float:
    """Return the parameter at the solver's coordinate."""
    return float(value_and_slope(fit.u.moving[j].parameter.coordinate, np.array(y))[0])


@np.errstate(all="ignore")
def quadratic(
    moving: Sequence[Unknown], y: np.ndarray, known: Uncertainty, t: Any
) -> tuple[np.ndarray, np.ndarray]:
    """Return the quadratic intervals (..., p, 2) at minima y (..., p), and upper limits (..., p).

    t: (...), half an interval in standard errors. NaN where there is none.
    """
    from_zero = _from_zero(moving, y, known, t)
    out, sides = np.full((*y.shape, 2), np.nan), np.array([-1.0, 1.0])
    variance = np.diagonal(known.covariance, axis1=-2, axis2=-1)
    for i, unknown in enumerate(moving):
        kind = unknown.parameter.coordinate
        if not unknown.free:
            continue
        half = (t * np.sqrt(variance[..., i]))[..., None]
        if kind == SQUARE:
            ends = np.sqrt(np.maximum(y[..., i, None] + half * sides, 0.0))
        else:
            x = value_and_slope(kind, y[..., i, None])[0]
            ends = x + half * (x if kind == LOG else 1.0) * sides
        ends = np.where(np.isnan(half), np.nan, ends)
        ends = np.where(np.isfinite(from_zero[..., i, :]), from_zero[..., i, :], ends)
        ends = np.where(known.unseen_of[..., i, None], np.nan, ends)
        out[..., i, :] = np.clip(ends, unknown.low, unknown.high)
    return out, from_zero[..., 1]


class _Pair(NamedTuple):
    """The two searches for the ends of one parameter."""

    base: int
    j: int
    searches: tuple[Search, Search]


def _pair(
    fit: Problem, end: End, base: Base, at: int, j: int, ends: np.ndarray, t: float, wanted: str
) -> _Pair:
    """Return the searches, whose first places are the ends of the quadratic interval.

    To see whether that is right (AUTO): places on either side of them.
    """
    kind = fit.u.moving[j].parameter.coordinate
    usual = t * end.known.edge[j] * np.sqrt(end.known.variance)
    if not (np.isfinite(usual) and usual > 0.0):
        usual = 0.1 * max(abs(end.y[j]), 1.0)
    first: list[list[float]] = []
    for sign, place in ((-1.0, ends[0]), (1.0, ends[1])):
        limit = base.high[j] if sign > 0.0 else base.low[j]
        c = float(from_parameter(kind, place)) if np.isfinite(place) else np.nan
        far = sign * (c - end.y[j])
        # A symmetric interval of a parameter with a logarithmic coordinate may reach nearly to 0.
        odd = kind == LOG and (far > 3.0 * usual or c == limit)
        good = np.isfinite(far) and far > 0.0 and not odd
        far = far if good else usual
        both = [(1.0 - OFF) * far, (1.0 + OFF) * far]
        first.append(both if wanted == AUTO and good else [far])
    lower = Search(base, j, -1.0, first[0], limit_too=may_be_zero(fit, end, j))
    return _Pair(at, j, (lower, Search(base, j, 1.0, first[1])))


def _right(pair: _Pair) -> bool:
    """Whether the first places show that the quadratic interval is accurate."""
    for s in pair.searches:
        if s.room == 0.0 or len(s.first) < 2:  # the minimum lies on a bound; no quadratic end
            return False
        near, far = s.first
        outside = s.root_at(far) > 1.0 or far == s.room
        if not (s.root_at(near) <= 1.0 and outside):
            return False
    return True


def _start(fit: Problem, end: End, t: float) -> tuple[Intervals, Base]:
    """Return the quadratic intervals at a minimum, and from where the search goes out."""
    plain, limits = quadratic(fit.u.moving, end.y, end.known, t)
    with np.errstate(all="ignore"):
        own = np.diagonal(end.known.wide)
        along = np.nan_to_num(np.where(own > 0.0, end.known.wide / own, 0.0))
    kind = tuple(NONE if np.isnan(q).any() else QUADRATIC for q in plain)
    base = Base(end.y, end.cost, along, *fit.limits, t**2 * end.known.rise, [], [])
    lowest, inside = (end.cost, end.y), end.y[None][:0]
    found = Intervals(plain.copy(), plain, kind, limits, lowest, inside, t)
    return found, base


def intervals(
    fit: Problem,
    ends: Sequence[End],
    noise: float,
    *,
    wanted: str,
    estimated: bool,
    enough: float = -np.inf,
) -> list[Intervals]:
    """Return the 95 % intervals at some minima of a fit.

    wanted: one of KINDS. estimated: whether the scale of the errors comes from the scatter (t with
    its degrees of freedom, else the normal law). enough: where a cost below it is met, the search
    for ends by profile stops; `lowest` says where.
    Accuracy: at the ends by profile the root of the rise is right to 1e-3 of itself (coverage to
    .0002), and so is their distance from the minimum, but where the cost hardly rises.
    """
    t = student_quantile(max(fit.dof, 1) if estimated else 0)
    starts = [_start(fit, end, t) for end in ends]
    out = [found for found, _ in starts]
    if wanted == QUADRATIC:
        return out
    pairs = [
        _pair(fit, ends[at], base, at, int(j), out[at].quadratic[j], t, wanted)
        for at, (_, base) in enumerate(starts)
        if base.rise > ROUNDING * fit.squares / noise**2
        for j in np.flatnonzero(fit.u.free)
        if wanted == PROFILE or not ends[at].known.unseen_of[j]
    ]
    if wanted == AUTO and pairs:
        visit(fit, [s for pair in pairs for s in pair.searches], noise)
        pairs = [
            pair for pair in pairs
            if any(ends[pair.base].known.at_bound)
            or np.isfinite(out[pair.base].limits[pair.j])
            or not _right(pair)
        ]  # fmt: skip
    rounds = ROUNDS if wanted == PROFILE else FEW_ROUNDS
    follow(fit, [s for pair in pairs for s in pair.searches], noise, rounds, enough)
    moved = []
    for at, end in enumerate(ends):
        own = {pair.j: pair.searches for pair in pairs if pair.base == at}
        moved += aim_beside_zero(fit, end, t, own)
    follow(fit, moved, noise, rounds, enough)
    for at, j, both in pairs:
        found = out[at]
        # Exponential and logarithm return a bound up to rounding only.
        unknown = fit.u.moving[j]
        values = np.clip([_of(fit, j, s.end) for s in both], unknown.low, unknown.high)
        kind = list(found.kind)
        if not np.isnan(values).any():
            found.ends[j], kind[j] = values, PROFILE
            if np.isfinite(found.limits[j]):
                found.limits[j] = values[1] if values[0] == 0.0 else np.nan
        inside = np.concatenate([found.inside, *(s.y[s.out - 1][None] for s in both)])
        out[at] = found._replace(kind=tuple(kind), inside=inside)
    return [
        found._replace(lowest=min([found.lowest, *base.lower], key=lambda met: met[0]))
        for found, (_, base) in zip(out, starts, strict=True)
    ]
