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

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from fitting.problem.lanes import Limits
from fitting.problem.programs import LOSSES
from fitting.problem.unknowns import Unknowns
from fitting.residuals.error_model import ERRORS
from fitting.results.result_parts import NONE, PROFILE, QUADRATIC
from fitting.samples.parameters import (
    LEAST_SQUARE,
    LOG,
    SQUARE,
    Unknown,
    from_parameter,
    value_and_slope,
)
from fitting.uncertainty.beside_zero import (
    TWO_SIDED,
    by_valley,
    interval_from_zero,
    other_roots,
    own_roots,
)
from fitting.uncertainty.covariance import Uncertainty
from fitting.uncertainty.profile import ROUNDS, Base, Lanes, Search, follow, visit

AUTO = "auto"
KINDS = (AUTO, QUADRATIC, PROFILE)
OFF = 0.1
# So many standard errors of the quadratic model.
_NEAR = 8.0
# An end that moves by less than this part of its distance stays where it is.
_LEAST = 0.01


class Minima(NamedTuple):
    """n minima, of one fit or of many, of which intervals are wanted.

    which: (n,) the curve of each. y: (n, p). cost: (n,). t: (n,) half an interval in standard
    errors. rounding: (n,), a rise of the cost below it is rounding. wanted: (n,), of KINDS. linear:
    (n, p), of which unknowns in squares the data are linear in the parameter itself.
    """

    which: np.ndarray
    y: np.ndarray
    cost: np.ndarray
    known: Uncertainty
    t: np.ndarray
    rounding: np.ndarray
    wanted: np.ndarray
    linear: np.ndarray

    def straight(self) -> Minima:
        """Return these in the coordinates in which the data are nearly linear."""
        x = np.where(self.linear, np.sqrt(np.maximum(self.y, LEAST_SQUARE)), 0.5)
        slope, known = 0.5 / x, self.known
        both = slope[:, :, None] * slope[:, None, :]
        return self._replace(
            y=np.where(self.linear, np.sqrt(np.abs(self.y)), self.y),
            known=known._replace(
                covariance=known.covariance * both, wide=known.wide * both,
                wide_step=known.wide_step * slope,
            ),
        )  # fmt: skip


class Intervals(NamedTuple):
    """Of n minima, over all p unknowns: ends (n, p, 2), the quadratic ones too; kind (n, p).

    NaN where there is none. limits: (n, p), upper limits of what is compatible with 0; NaN for what
    is not, by the profile or at once. lowest: the least cost that was met, (n,), and where (n, p).
    inside: (n, 2p, p), the places within these intervals that lie next to their ends by profile,
    all unknowns in the solver's coordinates; NaN where there is none. t: half an interval in
    standard errors.
    """

    ends: np.ndarray
    quadratic: np.ndarray
    kind: np.ndarray
    limits: np.ndarray
    lowest: tuple[Any, np.ndarray]
    inside: np.ndarray
    t: Any


def check_choices(loss: str, errors: str, intervals: str) -> None:
    """Raise ValueError for an unknown value of these options of a fit."""
    named = {"loss": (loss, LOSSES), "errors": (errors, ERRORS), "intervals": (intervals, KINDS)}
    for name, (came, wanted) in named.items():
        if came not in wanted:
            raise ValueError(f"{name} is {came!r}; one of {', '.join(wanted)} was wanted.")


def total_reflection(u: Unknowns, y: np.ndarray, critical: Any) -> np.ndarray:
    """Return `Minima.linear` (n, p) at y (n, p): k of an interface in total reflection.

    Its reflectance falls with k there, not with k^2, of which the limit would be 12 times too
    small. critical: the largest index (n,) that reflects totally.
    """
    out, names = np.zeros(y.shape, bool), [n.rpartition(".")[2] for n in u.spec.moving]
    if sorted(n for n in names if n in ("eta", "k")) == ["eta", "k"]:
        k = names.index("k")
        eta = y[:, names.index("eta")]
        square = u.moving[k].parameter.coordinate == SQUARE
        out[:, k] = square & (eta < critical) & (y[:, k] < eta**2)
    return out


def _unbounded(u: Unknown, y: Any, known: Uncertainty, i: int) -> tuple[Any, Any]:
    """Return the estimate (...) that parameter i would have without bounds, and its standard error.

    y: (...), where it is. In the solver's coordinate; NaN if it is known, has a prior, or its range
    does not begin at 0.
    """
    if not u.free or u.low != 0.0 or u.prior is not None or u.parameter.coordinate == LOG:
        return np.full_like(y, np.nan), np.full_like(y, np.nan)
    sigma = known.edge[..., i] * np.sqrt(known.variance)
    sigma = np.where(np.isfinite(sigma), sigma, np.nan)
    step = np.where(known.at_bound[..., i] == "low", known.wide_step[..., i], 0.0)
    return np.where(np.isnan(sigma), np.nan, y + np.minimum(step, 0.0)), sigma


def _may_be_zero(u: Unknown, y: Any, known: Uncertainty, i: int) -> Any:
    """Whether parameters (...) that cannot be negative are so near 0 that their ends may move."""
    value, sigma = _unbounded(u, y, known, i)
    return value < _NEAR * sigma


@np.errstate(all="ignore")
def _aim_beside_zero(
    moving: Sequence[Unknown], m: Minima, pairs: Mapping[tuple[int, int], tuple[Search, Search]]
) -> list[Search]:
    """Aim the searches at where a truth is held in 95 %, and return those that move.

    m: the straight `Minima`. pairs: by minimum and unknown the two searches that have found the
    ends of one rise. The ends of a parameter that cannot be negative move if it is near 0; those of
    the others if there is just one such parameter.
    """
    known, unit = m.known, m.t / TWO_SIDED * np.sqrt(m.known.variance)
    x, one = (np.full(m.y.shape, np.nan) for _ in range(2))
    for j in {j for _, j in pairs}:
        rows = np.array([i for i, other in pairs if other == j])
        root, high = np.transpose([
            (TWO_SIDED * lower.root_at(lower.room), upper.end)
            for lower, upper in (pairs[i, j] for i in rows.tolist())
        ])  # fmt: skip
        reach, sigma = (a[rows] for a in _unbounded(moving[j], m.y[:, j], known, j))
        slope = np.maximum(-2.0 * reach / (m.t[rows] * sigma / TWO_SIDED) ** 2, 0.0)
        high = np.where(m.linear[rows, j], np.sqrt(high), high)
        best = np.where(known.at_bound[rows, j] == "low", 0.0, m.y[rows, j])
        x[rows, j], one[rows, j] = by_valley(best, slope, root, high)
    near = x < 2.0 * TWO_SIDED
    roots = np.where(near[..., None], np.stack(own_roots(x), -1), np.nan)
    single = np.flatnonzero(near.sum(1) == 1)
    if len(single):
        i = near[single].argmax(1)
        wide = known.wide[single]
        row = np.take_along_axis(wide, i[:, None, None], 1)[:, 0]
        own = np.take_along_axis(row, i[:, None], 1)
        along = row / own * one[single, i][:, None]
        left = np.maximum(np.diagonal(wide, axis1=1, axis2=2) - row**2 / own, 0.0)
        apart = unit[single, None] * np.sqrt(left)
        both = other_roots(x[single, i][:, None], along / np.hypot(along, apart))
        roots[single] = np.where(near[single][..., None], roots[single], np.stack(both, -1))
    moved = []
    for (i, j), searches in pairs.items():
        for search, root in zip(searches, roots[i, j].tolist(), strict=True):
            aim = root / TWO_SIDED  # NaN: nothing is known of the correlation
            if abs(aim - 1.0) > _LEAST and np.isfinite(search.found):
                search.aim(aim)
                moved.append(search)
    return moved


def _from_zero(moving: Sequence[Unknown], m: Minima) -> np.ndarray:
    """Return quadratic intervals (n, p, 2) of parameters that cannot be negative and may be 0.

    NaN for the others. A square (k where the data depend on k^2) is compatible with 0 within three
    standard errors of the square; another parameter whose range begins at 0, if it ended there.
    """
    out = np.full((*m.y.shape, 2), np.nan)
    for i, u in enumerate(moving):
        value, sigma = _unbounded(u, m.y[:, i], m.known, i)
        ends, near = np.stack(interval_from_zero(value, sigma, m.t), -1), m.known.at_bound[:, i]
        if u.parameter.coordinate == SQUARE:
            ends = np.where(m.linear[:, i, None], ends, np.sqrt(ends))
            near = np.where(m.y[:, i] < 3.0 * sigma, "low", "")
        out[:, i] = np.where((near == "low")[:, None], ends, np.nan)
    return out


@np.errstate(all="ignore")
def _quadratic(moving: Sequence[Unknown], m: Minima) -> tuple[np.ndarray, np.ndarray]:
    """Return the quadratic intervals (n, p, 2) at straight minima, and upper limits (n, p).

    NaN where there is none.
    """
    from_zero, known = _from_zero(moving, m), m.known
    out, sides = np.full((*m.y.shape, 2), np.nan), np.array([-1.0, 1.0])
    variance = np.diagonal(known.covariance, axis1=1, axis2=2)
    for i, unknown in enumerate(moving):
        kind = unknown.parameter.coordinate
        if not unknown.free:
            continue
        y, half = m.y[:, i, None], (m.t * np.sqrt(variance[:, i]))[:, None]
        x = value_and_slope(kind, y)[0] if kind == LOG else y
        ends = x + half * (x if kind == LOG else 1.0) * sides
        if kind == SQUARE:
            ends = np.where(m.linear[:, i, None], ends, np.sqrt(np.maximum(ends, 0.0)))
        ends = np.where(np.isnan(half), np.nan, ends)
        ends = np.where(np.isfinite(from_zero[:, i]), from_zero[:, i], ends)
        ends = np.where(known.unseen_of[:, i, None], np.nan, ends)
        out[:, i] = np.clip(ends, unknown.low, unknown.high)
    return out, np.where(known.unseen_of, np.nan, from_zero[:, :, 1])


class _Pair(NamedTuple):
    """The two searches for the ends of one parameter of a minimum."""

    base: int
    j: int
    searches: tuple[Search, Search]


@np.errstate(all="ignore")
def _pairs(
    moving: Sequence[Unknown], limits: Limits, m: Minima, plain: np.ndarray, near: np.ndarray,
    some: np.ndarray,
) -> list[_Pair]:  # fmt: skip
    """Return the searches, whose first places are the ends of the quadratic intervals.

    To see whether these are right (AUTO): places on either side of them. near: (n, p), what may be
    0. some: (n, p), of which they are wanted.
    """
    usual = m.t[:, None] * m.known.edge * np.sqrt(m.known.variance)[:, None]
    usual = np.where(usual < np.inf, usual, 0.0)
    usual = np.where(usual > 0.0, usual, 0.1 * np.maximum(np.abs(m.y), 1.0))[..., None]
    kinds = [w.parameter.coordinate for w in moving]
    places = [from_parameter(kind, plain[:, j]) for j, kind in enumerate(kinds)]
    places = np.stack(places, 1) if places else plain
    far = (places - m.y[..., None]) * [-1.0, 1.0]
    # A symmetric interval of a parameter with a logarithmic coordinate may reach nearly to 0.
    logs = np.array([kind == LOG for kind in kinds])[:, None]
    odd = logs & ((far > 3.0 * usual) | (places == np.stack(limits, -1)))
    good = np.isfinite(far) & (far > 0.0) & ~odd
    far = np.where(good, far, usual)
    own = np.diagonal(m.known.wide, axis1=1, axis2=2)[:, None]
    along = np.nan_to_num(np.where(own > 0.0, m.known.wide / own, 0.0))
    rise = m.t**2 * m.known.rise
    test = good & (m.wanted == AUTO)[:, None, None]
    first = far[..., None] * np.where(test[..., None], [1.0 - OFF, 1.0 + OFF], 1.0)
    out, first, cost, rise = [], first.tolist(), m.cost.tolist(), rise.tolist()
    for i in np.flatnonzero(some.any(1)).tolist():
        base = Base(m.which[i], m.y[i], cost[i], along[i], *limits, rise[i], [], [])
        for j in np.flatnonzero(some[i]).tolist():
            lower, upper = (
                Search(base, j, sign, first[i][j][side], limit_too=side == 0 and near[i, j])
                for side, sign in enumerate((-1.0, 1.0))
            )
            out.append(_Pair(i, j, (lower, upper)))
    return out


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


def intervals(
    u: Unknowns, limits: Limits, m: Minima, at: Lanes, enough: float = -np.inf
) -> Intervals:
    """Return the 95 % intervals at some minima.

    limits: bounds (p,). at: where the searches take their steps. enough: where a cost below it is
    met, the search for ends by profile stops; `lowest` says where.
    Accuracy: at the ends by profile the root of the rise is right to 1e-3 of itself (coverage to
    .0002), and so is their distance from the minimum, but where the cost hardly rises.
    """
    moving, (count, size), straight = u.moving, m.y.shape, m.straight()
    plain, upper = _quadratic(moving, straight)
    out = Intervals(
        plain.copy(), plain, np.where(np.isnan(plain).any(-1), NONE, QUADRATIC), upper,
        (m.cost.copy(), m.y.copy()), np.full((count, 2 * size, size), np.nan), m.t,
    )  # fmt: skip
    some = (m.wanted != QUADRATIC) & (m.t**2 * m.known.rise > m.rounding)
    some = some[:, None] & u.free
    if not some.any():
        return out
    near = [_may_be_zero(w, straight.y[:, j], straight.known, j) for j, w in enumerate(moving)]
    pairs = _pairs(moving, limits, m, plain, np.transpose(near), some)
    visit(at, [s for pair in pairs for s in pair.searches if m.wanted[pair.base] == AUTO])
    sure = (m.wanted == AUTO)[:, None] & ~np.isfinite(upper)
    sure &= ~(m.known.at_bound != "").any(1, keepdims=True)
    pairs = [pair for pair in pairs if not (sure[pair.base, pair.j] and _right(pair))]
    follow(at, [s for pair in pairs for s in pair.searches], ROUNDS, enough)
    by_place = {(pair.base, pair.j): pair.searches for pair in pairs}
    moved = _aim_beside_zero(moving, straight, by_place)
    follow(at, moved, ROUNDS, enough)
    for i, j, both in pairs:
        # Exponential and logarithm return a bound up to rounding only.
        ends = value_and_slope(moving[j].parameter.coordinate, np.array([s.end for s in both]))[0]
        # That the data leave all the range of what they do not see goes without saying.
        told = m.wanted[i] == PROFILE or not m.known.unseen_of[i, j] or ends[1] < moving[j].high
        if told and not np.isnan(ends).any():
            ends = np.clip(ends, moving[j].low, moving[j].high)
            out.ends[i, j], out.kind[i, j] = ends, PROFILE
            if np.isfinite(upper[i, j]):
                upper[i, j] = ends[1] if ends[0] == 0.0 else np.nan
        out.inside[i, 2 * j : 2 * j + 2] = [s.y[s.out - 1] for s in both]
        for cost, y in both[0].base.lower:
            if cost < out.lowest[0][i]:
                out.lowest[0][i], out.lowest[1][i] = cost, y
    return out
