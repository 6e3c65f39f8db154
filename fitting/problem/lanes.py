"""Lanes: where the starts of one fit are, which run side by side until they rest."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

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
        """Update the state of some of the lanes, which went on from where they were."""
        for mine, theirs in zip(self[:3], others[:3], strict=True):
            mine[..., lanes] = theirs
        self.evaluations[lanes] += others.evaluations

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


def best_of(ends: Ends) -> int | None:
    """Return the lowest lane that is done; None if none is."""
    good = ends.done & np.isfinite(ends.cost)
    if not good.any():
        return None
    return int(np.argmin(np.where(good, ends.cost, np.inf)))
