"""Lanes: starts of one fit, or of many, which run side by side until they rest."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from fitting.problem.programs import Targets, solve
from fitting.problem.solver import START_DAMPING
from fitting.process.compiled import fit_settings
from fitting.process.progress import tell
from fitting.samples.parameters import LOG, SQUARE, Unknown, from_parameter

# After STAGE evaluations a lane that is above the lowest one of its fit that has converged goes no
# further; none takes more than MOST.
STAGE, MOST = 60, 480
# Number of starts that are followed; of more the lowest after SIFT evaluations go on.
LANES, SIFT = 64, 12
# Lanes of a call. When so many of them have ended the call ends, and those that are left go on
# together with those of other calls: one lane would keep the others waiting, which ended after half
# its evaluations. So they do after so many evaluations, if they fill more than one call.
WIDTH, _ENOUGH, _FEW = 16, 0.75, 10

# Lowest and highest values of unknowns in the solver's coordinates.
Limits = tuple[np.ndarray, np.ndarray]


class Ends(NamedTuple):
    """The ends of starts: y (p, L); cost, done (converged) and evaluations (L,)."""

    y: np.ndarray
    cost: np.ndarray
    done: np.ndarray
    evaluations: np.ndarray

    @classmethod
    def begun(cls, y: np.ndarray) -> Ends:
        """Return lanes at y (p, L) of which nothing is known yet."""
        none = np.zeros(y.shape[1], int)
        return cls(y, none + np.inf, none > 0, none)

    def put(self, lanes: np.ndarray, others: Ends) -> None:
        """Update the state of some of the lanes, which went on from where they were."""
        for mine, theirs in zip(self[:3], others[:3], strict=True):
            mine[..., lanes] = theirs
        self.evaluations[lanes] += others.evaluations

    def lowest(self, count: int) -> np.ndarray:
        """Return where the lowest of them are, (p, count)."""
        return self.y[:, np.argsort(self.cost, kind="stable")[:count]]


def joined(ends: Sequence[Ends]) -> Ends:
    """Return several sets of ends as one."""
    return Ends(*(np.concatenate(parts, -1) for parts in zip(*ends, strict=True)))


def coordinate_bounds(unknowns: Sequence[Unknown]) -> Limits:
    """Return bounds in the solver's coordinates, (p,) each."""
    low, high = [], []
    for u in unknowns:
        kind = u.parameter.coordinate
        least = max(u.low, 0.0) if kind in (LOG, SQUARE) else u.low
        low.append(float(from_parameter(kind, least)))
        high.append(float(from_parameter(kind, u.high)))
    return np.array(low), np.array(high)


def with_fixed(limits: Limits, start: np.ndarray, row: Any) -> Limits:
    """Return bounds (p, S) of starts of each of which one coordinate stays: ``row``, () or (S,)."""
    low, high = (np.repeat(a[:, None], start.shape[1], 1) for a in limits)
    at = row, np.arange(start.shape[1])
    low[at] = high[at] = np.clip(start[at], low[at], high[at])
    return low, high


def best_of(ends: Ends) -> int | None:
    """Return the lowest lane that is done; None if none is."""
    good = ends.done & np.isfinite(ends.cost)
    if not good.any():
        return None
    return int(np.argmin(np.where(good, ends.cost, np.inf)))


def ahead(calls: Iterable[Any]) -> Iterator[Any]:
    """Yield calls of programs, each once the next one is made: XLA runs beside what is done here.

    jax returns from a call before its program has ended, and waits where its results are read.
    """
    last: list[Any] = []
    for each in calls:
        yield from last
        last = [each]
    yield from last


def in_calls(lanes: np.ndarray, width: int) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield lanes in calls of one width: those that count, and all, the last of them repeated."""
    for first in range(0, len(lanes), width):
        some = lanes[first : first + width]
        yield some, np.pad(some, (0, width - len(some)), "edge")


@fit_settings()
def run_lanes(
    spec: Any, targets: Callable[[np.ndarray], Targets], start: np.ndarray, limits: Limits,
    degrees: np.ndarray, scale: np.ndarray, most: int, width: int = WIDTH,
    fit: np.ndarray | None = None,
) -> Ends:  # fmt: skip
    """Return where starts (p, L) are after ``most`` evaluations at most.

    targets: returns those of some lanes by their numbers. limits: bounds (p,), or (p, L) of each
    lane. degrees, scale: (L,), see `BatchLevenbergMarquardt`. width: lanes of a call. fit: (L,) the
    number of the fit of each lane, among which the best is wanted; None: each lane is.
    """
    low, high = (np.broadcast_to(a.reshape(len(a), -1), start.shape) for a in limits)
    out, todo = Ends.begun(np.clip(start, low, high)), np.arange(start.shape[1])
    damping, fit = np.full(len(todo), START_DAMPING), todo if fit is None else fit

    def begun(todo: np.ndarray) -> Iterator[tuple]:
        for some, lanes in in_calls(todo, width):
            left = int((most - out.evaluations[some]).min())
            options = {
                "lower": low[:, lanes], "upper": high[:, lanes], "degrees": degrees[lanes],
                "scale": scale[lanes], "damping": damping[lanes], "enough": _ENOUGH,
                "max_steps": np.int64(min(_FEW if len(todo) > width else STAGE, left)),
            }  # fmt: skip
            yield some, solve(targets(lanes), out.y[:, lanes], options, spec=spec)

    while len(todo):
        for some, (y, stats) in ahead(begun(todo)):
            y = np.asarray(y)[:, : len(some)]
            end = {name: np.asarray(a)[..., : len(some)] for name, a in stats.items() if np.ndim(a)}
            out.y[:, some], damping[some] = y, end["damping"]
            finite = np.isfinite(end["cost"]) & np.isfinite(y).all(0)
            out.cost[some] = np.where(np.isfinite(end["cost"]), end["cost"], np.inf)
            out.done[some] = end["done"] & finite
            out.evaluations[some] += end["evaluations"]
        tell(done=0)
        going = ~out.done & np.isfinite(out.cost) & (out.evaluations < most)
        best = np.full(fit.max() + 1, np.inf)
        np.minimum.at(best, fit[out.done], out.cost[out.done])
        going &= (out.evaluations < STAGE) | (out.cost < best[fit])
        todo = todo[going[todo]]
    return out
