"""Lanes: starts of one fit, run side by side until they rest.

One random start found the best minimum of a spectral model in a third to a half of the cases, 64 in
all of them, at hardly any cost: the starts are lanes of one program.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from fitting.optics.spec import Spec
from fitting.problem.programs import Bounds, Targets
from fitting.problem.programs_in_parts import in_parts, solved_in_parts
from fitting.problem.solver import START_DAMPING
from fitting.process.compiled import fit_settings
from fitting.process.progress import tell
from fitting.samples.parameters import LOG, SQUARE, Unknown, from_parameter

# Evaluations in a stage, and number of stages; a start goes on while it may become the best.
STAGE, STAGES = 60, 8
# Number of lanes side by side; of more starts the lowest after SIFT evaluations go on.
LANES, SIFT = 64, 12

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
        """Update the state of some of the lanes."""
        for mine, theirs in zip(self, others, strict=True):
            mine[..., lanes] = theirs

    def moved(self, lanes: Sequence[int], y: np.ndarray, cost: Sequence[float]) -> Ends:
        """Return the ends with some of them at other places y (p, l)."""
        out = self._replace(y=self.y.copy(), cost=self.cost.copy())
        out.y[:, lanes], out.cost[lanes] = y, cost
        return out

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


def _stage(
    spec: Spec, targets: Targets, y: np.ndarray, damping: np.ndarray, bounds: Bounds, steps: int
) -> tuple[Ends, np.ndarray]:
    """Return where the lanes are after at most ``steps`` evaluations, and their damping."""
    with fit_settings():
        out = solved_in_parts(targets, y, damping, bounds, np.int64(steps), spec=spec)
        y, cost, done, evaluations, damping = (np.array(a) for a in out)
    tell()
    return Ends(y, np.where(np.isfinite(cost), cost, np.inf), done, evaluations), damping


def _bounds(limits: Limits, degrees: float, scale: float, shape: tuple[int, ...]) -> Bounds:
    low, high = (np.broadcast_to(a.reshape(len(a), -1), shape) for a in limits)
    return Bounds(low, high, *(np.broadcast_to(a, shape[1:]) for a in (degrees, scale)))


def each_within(
    spec: Spec, targets: Targets, start: np.ndarray, limits: Limits, degrees: float, scale: float,
    steps: int, lanes: int,
) -> Ends:  # fmt: skip
    """Return where starts (p, S) end after ``steps`` evaluations, each within bounds of its own.

    limits: (p,) or (p, S) each. lanes: how many run side by side, as the program was compiled for.
    """
    count = start.shape[1]
    parts = []
    lanes = count if in_parts(spec, targets) else lanes  # no more than there are
    bounds = _bounds(limits, degrees, scale, start.shape)
    for first in range(0, count, lanes):
        pick = np.minimum(np.arange(first, first + lanes), count - 1)
        own = Bounds(*(a[..., pick] for a in bounds))
        damping = np.full(lanes, START_DAMPING)
        parts.append(_stage(spec, targets, start[:, pick], damping, own, steps)[0])
    return Ends(*(a[..., :count] for a in joined(parts)))


def run(
    spec: Spec, targets: Targets, start: np.ndarray, limits: Limits, degrees: float, scale: float
) -> Ends:
    """Return where the starts (p, L) of a fit end, all side by side.

    limits: bounds (p,) each. A lane goes on while it is below the best finished one.
    """
    bounds = _bounds(limits, degrees, scale, start.shape)
    y, lanes = np.clip(start, bounds.lower, bounds.upper), start.shape[1]
    damping = np.full(lanes, START_DAMPING)
    ends = Ends.begun(y)
    # In one compiled program all go on together.
    alone = in_parts(spec, targets)
    live = np.arange(lanes)
    for _ in range(STAGES):
        pick = live if alone else np.arange(lanes)
        some = Bounds(*(a[..., pick] for a in bounds))
        further, damping[pick] = _stage(spec, targets, ends.y[:, pick], damping[pick], some, STAGE)
        further = further._replace(evaluations=ends.evaluations[pick] + further.evaluations)
        ends.put(pick, further)
        best = np.min(ends.cost[ends.done], initial=np.inf)
        live = np.flatnonzero(~ends.done & (ends.cost < best))
        if not len(live):
            break
    return ends


def best_of(ends: Ends) -> int | None:
    """Return the lowest lane that is done; None if none is."""
    good = ends.done & np.isfinite(ends.cost)
    if not good.any():
        return None
    return int(np.argmin(np.where(good, ends.cost, np.inf)))
