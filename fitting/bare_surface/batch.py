"""Any number of curves through the compiled program: chunks, second starts, the last stragglers."""

from __future__ import annotations

import functools
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import jax
import numpy as np

from fitting.bare_surface import mesh as starts
from fitting.bare_surface.coordinates import (
    EPS,
    FAR_END,
    W_MAX,
    W_MIN,
    from_eps,
    to_eps,
    xi_of,
)
from fitting.bare_surface.curve_data import Data, Extent
from fitting.bare_surface.engine import Solved, solve
from fitting.bare_surface.kept_minima import (
    OTHERS,
    Minima,
    as_minima,
    less_absorbing_first,
    with_arrival,
)
from fitting.bare_surface.mesh_curves import mesh_curves
from fitting.solver import START_DAMPING

FEW = 8
# Up to that many curves go in groups of FEW at once: a call for LANES takes longer than two such.
FEW_GROUPS = 2
MANY, LANES = 1024, 64
# Up to SEVERAL curves one group at a time: most of a call for MANY would be spent on empty lanes.
SEVERAL = 256
# Most lanes end within 4 evaluations; the others would make their whole group wait, so they are
# collected and go on among themselves.
FIRST_STEPS, MOST_STEPS = 4, 2000
# Lanes with n < 1 that have not come to rest after that many creep along a bent valley; they take
# up to as many steps in coordinates in which it is straighter, and then go on.
CREEP_STEPS = 40
# A further start is looked at again after that many: it goes on if it is near the best minimum by
# then, and after the second only if it is below (else it creeps along a plateau).
FURTHER_STEPS = 10, 40
# "Near": a cost less than 4 times the best one, or what an error of .3 % of all data costs.
NEAR_COST, NEAR_SHARE = 4.0, 1e-5
_COST = Solved._fields.index("cost")
_EVALUATIONS = Solved._fields.index("evaluations")
_DAMPING = Solved._fields.index("damping")


def start_rows(count: int, points: np.ndarray | None = None, w_max: float = W_MAX) -> np.ndarray:
    """Return the start array of the program, from ``points`` (3, count) or, if None, the mesh."""
    start = np.full((5, count), np.nan)
    if points is not None:
        start[:3] = points
    start[3], start[4] = START_DAMPING, w_max
    return start


@functools.cache
def _threads(process: int) -> ThreadPoolExecutor:
    """Return the threads of this process, which wait for work from call to call.

    To begin and end them takes as long as to fit 20 curves. A forked process has its own.
    """
    del process
    return ThreadPoolExecutor(os.cpu_count() or 1)


def _call(
    data: Data, start: np.ndarray, steps: int, size: int, lanes: int
) -> tuple[np.ndarray, np.ndarray, dict[str, Any]]:
    """Return what one call of the program gives for up to ``size`` curves.

    ``Solved``, further starts, and of a few curves the reflectances (size, angles) by channel.
    """
    here, angles = data.curves, data.values[0].shape[1]
    few, wide, part = size == FEW, angles, data
    # Of a few curves the number of angles is rounded up (with no data), to 64 at least, and every
    # channel is there, so that a handful of compiled programs serves every file: a program takes
    # 5 s to compile, and 14 or 64 angles 20 ms to fit. Not of many curves, where what is empty
    # costs as much as what is full.
    if few:
        wide = max(64, 1 << (angles - 1).bit_length())
        part = data.with_all_channels()
    elif size < MANY:
        wide = -(-angles // 16) * 16
    part = part.padded(size, wide)
    begin = np.ones((len(start), size))
    begin[:, :here] = start
    with jax.enable_x64(True):
        solved, further, fitted = solve(
            part.cos_theta, part.s_share, part.values, part.weights,
            begin, np.int64(steps), mesh_curves(part, bool(np.isnan(start[0]).any())),
            channels=part.channels, mesh=data.mesh, lanes=lanes, fitted=few,
        )  # fmt: skip
        by_channel = dict(zip(part.channels, fitted, strict=False))
        return np.array(solved)[:, :here], np.asarray(further)[..., :here], by_channel


def run(
    data: Data, start: np.ndarray, steps: int, few: bool | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return ``Solved`` of all curves as one (fields, N) array, each after at most ``steps``.

    And the further starts that the mesh offers, (E, 3, N). few: whether by the program for a few
    curves; None: as their number has it.
    """
    count = data.curves
    if not count:
        return np.empty((len(Solved._fields), 0)), np.empty((0, 3, 0))
    size, lanes = (LANES if count <= SEVERAL else MANY), LANES
    if count <= FEW_GROUPS * FEW if few is None else few:
        size, lanes = FEW, FEW

    def one(first: int) -> tuple[np.ndarray, np.ndarray]:
        if count <= size:
            return _call(data, start, steps, size, lanes)[:2]
        chunk = slice(first, first + size)
        return _call(data.take(chunk), start[:, chunk], steps, size, lanes)[:2]

    if count <= size:
        return one(0)
    # Threads, because a program this small runs on the thread that calls it, without the GIL.
    rest = [_threads(os.getpid()).submit(one, first) for first in range(size, count, size)]
    try:
        parts = [one(0), *(task.result() for task in rest)]
    finally:
        for task in rest:
            task.cancel()  # of an interrupted call; the others are done
    solved, further = (np.concatenate(a, axis=-1) for a in zip(*parts, strict=True))
    return solved, further


def fitted_curves(data: Data, s: Solved) -> np.ndarray:
    """Return the reflectances at the solutions, (C, N, M), by the program for a few curves."""
    start = start_rows(data.curves, np.stack([s.x, s.w, s.chart]))
    parts = []
    for first in range(0, data.curves, FEW):
        chunk = slice(first, first + FEW)
        at = _call(data.take(chunk), start[:, chunk], 0, FEW, FEW)[2]
        parts.append([np.asarray(at[name]) for name in data.channels])
    angles = data.values[0].shape[1]
    return np.concatenate(parts, axis=1)[:, : data.curves, :angles]


def _at_far_end(s: Solved) -> np.ndarray:
    """Where k = 0 was reached at the end of the line that the chart does not measure from."""
    return s.w >= 4.0 * xi_of(s.x) * (1.0 - 64.0 * FAR_END)


def _to_the_end(
    data: Data, start: np.ndarray, stages: Sequence[tuple[int, Any]]
) -> tuple[np.ndarray, np.ndarray]:
    """Return ``run``, with the lanes that were cut short run to their end.

    stages: evaluations, and the cost below which a lane takes part (for the first stage: all do).
    Lanes that have come to the far end of their chart go on in the other one, and before the last
    but one stage those that creep move through the chart EPS.
    """
    solved, further = run(data, start, stages[0][0])
    for left, (steps, below) in zip(range(len(stages) - 1, 0, -1), stages[1:], strict=True):
        s = Solved(*solved)
        flip, undone = _at_far_end(s), s.done == 0
        if not (flip | undone).any():
            break
        short = undone & (s.cost < below)
        if left == 2:
            _straightened(data, solved, np.flatnonzero(short & ~flip))
            s = Solved(*solved)
        todo = np.flatnonzero(short | flip)
        if not len(todo):
            continue
        turned = flip[todo]
        again = start[:, todo].copy()
        again[0] = s.x[todo]
        again[1] = np.where(turned, W_MIN, s.w[todo])
        again[2] = np.where(turned, -s.chart[todo], s.chart[todo])
        again[3] = np.where(turned, START_DAMPING, s.damping[todo])
        more, _ = run(data.take(todo), again, steps)
        more[_EVALUATIONS] += s.evaluations[todo]
        solved[:, todo] = more
    return solved, further


def _straightened(data: Data, solved: np.ndarray, todo: np.ndarray) -> None:
    """Move those of the lanes ``todo`` with n < 1 along their valley, in the chart EPS."""
    s = Solved(*solved[:, todo])
    inside = s.chart * (2.0 * xi_of(s.x) - s.w) < 0.0  # log|N|^2
    todo = todo[inside & (s.w > W_MIN)]
    if not len(todo):
        return
    s = Solved(*solved[:, todo])
    start = start_rows(len(todo), np.stack([*to_eps(s.x, s.w, s.chart), np.full_like(s.x, EPS)]))
    moved = Solved(*run(data.take(todo), start, CREEP_STEPS)[0])
    x, w, chart = from_eps(moved.x, moved.w)
    better = moved.cost < s.cost
    used = s.evaluations + moved.evaluations
    for name, value in (("x", x), ("w", w), ("chart", chart), ("cost", moved.cost)):
        row = Solved._fields.index(name)
        solved[row, todo] = np.where(better, value, solved[row, todo])
    solved[_DAMPING, todo] = np.where(better, START_DAMPING, s.damping)
    solved[_EVALUATIONS, todo] = used


def _mesh_kinds(data: Data, extent: Extent) -> np.ndarray:
    """Return the mesh that each curve needs, (N,) or (1,)."""
    share: Any = 0.0
    if "R" in data.channels:
        some = functools.reduce(np.logical_or, [np.atleast_2d(w) > 0.0 for w in data.weights])
        share = np.where(some, data.s_share, 0.0).max(1)
    low, high = extent.low_deg, extent.high_deg
    return starts.kinds(data.channels, extent.count, low, high, share, data.eta_i > 1.0)


def minima(data: Data, extent: Extent, points: np.ndarray | None = None) -> tuple[Minima, Data]:
    """Return the minima of every curve, lowest first; and the data with their mesh.

    points: None, or (3, N): x, w and chart of one more start of each curve, beside the mesh's.
    """
    if not data.curves:
        return _minima(data, points), data
    kinds = _mesh_kinds(data, extent)
    if (kinds == kinds[0]).all():
        data = data._replace(mesh=str(kinds[0]))
        return _minima(data, points), data
    names, counts = np.unique(kinds, return_counts=True)
    data = data._replace(mesh=str(names[np.argmax(counts)]))
    found = np.full((1 + OTHERS, len(Solved._fields), data.curves), np.nan)
    for mesh in dict.fromkeys(kinds.tolist()):
        mine = np.flatnonzero(kinds == mesh)
        part = data.take(mine)._replace(mesh=mesh)
        new = _minima(part, None if points is None else points[:, mine])
        found[:, :, mine] = np.array([new.best, *new.others])
    return as_minima(found), data


def _minima(data: Data, points: np.ndarray | None) -> Minima:
    stages = [
        (FIRST_STEPS, np.inf), (CREEP_STEPS, np.inf), (MOST_STEPS, np.inf), (MOST_STEPS, -np.inf)
    ]  # fmt: skip
    best, further = _to_the_end(data, start_rows(data.curves), stages)
    if points is not None:
        further = np.concatenate([further, points[None]])
    has = np.isfinite(further[:, 0])
    if not has.any():
        nothing = Solved(*np.full_like(best, np.nan))
        return Minima(Solved(*best), (nothing,) * OTHERS)
    found = np.full((1 + OTHERS, *best.shape), np.nan)
    found[0] = best
    which, curve = np.nonzero(has)
    start = start_rows(len(curve), further[which, :, curve].T)
    part, least = data.take(curve), best[_COST, curve]
    near = NEAR_COST * least + NEAR_SHARE * Solved(*best).scale[curve]
    stages = [
        *zip(FURTHER_STEPS, (np.inf, near), strict=True),
        (MOST_STEPS, least), (MOST_STEPS, -np.inf),
    ]  # fmt: skip
    again, _ = _to_the_end(part, start, stages)
    for job in range(len(further)):
        mine = np.flatnonzero(which == job)
        todo, new = curve[mine], again[:, mine]
        found[:, :, todo] = with_arrival(found[:, :, todo], new)
    return less_absorbing_first(found)
