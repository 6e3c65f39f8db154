"""The rows of a fit cut into blocks, which fill the columns of a call.

A program then has one shape for all numbers of rows and of lanes, and only lanes that have not
converged are evaluated: of 64 side by side three in five had.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import jax
import numpy as np
from jax import Array

from fitting.optics.spec import Points
from fitting.problem.programs import Targets

# A call evaluates blocks of so many rows, one in each of so many columns. With 8192 points in a
# call, not 2048, each takes a tenth longer, and more are evaluated for nothing if lanes are few. A
# search of films that fit in one block has 9 to 19 lanes at work on average: with half the columns
# it takes two thirds to four fifths of the time.
ROWS, COLUMNS, FEW_COLUMNS = 64, 32, 16
# Number of lanes side by side: a step of 16 unknowns takes .4 ms for 32 lanes, .9 ms for 64.
SLOTS = 32


class Blocks(NamedTuple):
    """Blocks of rows as columns of a call, repeated for as many lanes as there is room for.

    first, count: which blocks. points, eta_i, data: there, on the device. known: of the media that
    do not move.
    """

    first: int
    count: int
    points: Points
    eta_i: Any
    data: Targets
    known: tuple[Array, ...] = ()

    @property
    def columns(self) -> int:
        """The number of columns of a call."""
        return self.points.angle_deg.shape[1]

    @property
    def rows(self) -> slice:
        """Which rows of the fit these are."""
        return slice(self.first * ROWS, (self.first + self.count) * ROWS)

    def calls(self, active: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yield the slots of one call after the other, and the slot of each column; SLOTS: none."""
        room = self.columns // self.count
        for start in range(0, len(active), room):
            some = active[start : start + room]
            slot = np.full(self.columns, SLOTS)
            slot[: len(some) * self.count] = np.repeat(some, self.count)
            yield some, slot


def blocks_of(targets: Targets) -> list[Blocks]:
    """Return all rows; of more blocks than columns in several parts."""
    total, out = len(targets.points.angle_deg) // ROWS, []
    columns = COLUMNS if total > 1 else FEW_COLUMNS
    for first in range(0, total, columns):
        count = min(total - first, columns)
        pick = first + np.arange(columns) % count

        def cut(a: Any, pick: np.ndarray = pick) -> np.ndarray:
            """Return (..., M, 1) as (..., ROWS, columns)."""
            by_block = np.asarray(a).reshape(*np.shape(a)[:-2], total, ROWS)
            return np.ascontiguousarray(np.swapaxes(by_block[..., pick, :], -1, -2))

        angle, wavelength, share = map(cut, targets.points[:3])
        points = Points(angle, wavelength, share, np.zeros(1, int))
        eta_i = cut(targets.eta_i) if np.ndim(targets.eta_i) else targets.eta_i
        ncs, weights = (cut(a) if np.size(a) else () for a in (targets.ncs, targets.ncs_weights))
        data = targets._replace(
            points=None, held=None, eta_i=None, prior=None, prior_weight=None,
            values=tuple(map(cut, targets.values)), weights=tuple(map(cut, targets.weights)),
            ncs=ncs, ncs_weights=weights,
        )  # fmt: skip
        out.append(Blocks(first, count, *jax.device_put((points, eta_i, data))))
    return out
