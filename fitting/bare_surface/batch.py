"""Any number of curves, fitted by the compiled program: first starts, further ones, slow lanes."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any

import numpy as np

from fitting.bare_surface import mesh as starts
from fitting.bare_surface.calls import FEW, Further, run, start_rows
from fitting.bare_surface.coordinates import EPS, W_MIN, from_eps, to_eps, xi_of
from fitting.bare_surface.curve_data import Data, Extent
from fitting.bare_surface.descent import ROW, Solved, at_far_end
from fitting.bare_surface.engine import Steps, near_cost
from fitting.bare_surface.kept_minima import (
    OTHERS,
    Minima,
    less_absorbing_first,
    with_arrival,
)
from fitting.problem.solver import START_DAMPING

# Most lanes converge within 4 evaluations. The others would keep their whole group waiting, and so
# they are collected and continued in groups of their own.
FIRST_STEPS, MOST_STEPS = 4, 2000
# Lanes with n < 1 that have not converged after so many evaluations move slowly along a curved
# valley. They take up to as many steps in coordinates in which it is straighter, and then go on.
CREEP_STEPS = 40
# After so many evaluations a further start goes on only if it is near the best minimum; after the
# second number only if it is below that (otherwise it moves slowly along a plateau).
FURTHER_STEPS = 10, 40
# In the call of its curve, where others of a group wait for it, a near one goes on to this number.
NEAR_STEPS = 14


def _to_the_end(
    data: Data, curve: np.ndarray, solved: np.ndarray, stages: Sequence[tuple[int, Any]]
) -> np.ndarray:
    """Return ``solved`` after continuing the lanes that had not converged.

    curve: which of the curves each lane is of. stages: evaluations, and the cost below which a lane
    takes part, less from stage to stage. Lanes that have come to the far end of their chart go on
    in the other one, and before the last but one stage those that creep move through the chart EPS.
    """
    for left, (steps, below) in zip(range(len(stages), 0, -1), stages, strict=True):
        flip = at_far_end(*solved[:2])
        short = (solved[ROW.done] == 0) & (solved[ROW.cost] < below)
        if left == 2:
            _straightened(data, curve, solved, np.flatnonzero(short & ~flip))
        todo = np.flatnonzero(short | flip)
        if not len(todo):
            break
        s = Solved(*solved)
        turned = flip[todo]
        again = start_rows(len(todo))
        again[0] = s.x[todo]
        again[1] = np.where(turned, W_MIN, s.w[todo])
        again[2] = np.where(turned, -s.chart[todo], s.chart[todo])
        again[3] = np.where(turned, START_DAMPING, s.damping[todo])
        more, _ = run(data.take(curve[todo]), again, Steps(steps))
        more[ROW.evaluations] += s.evaluations[todo]
        solved[:, todo] = more
    return solved


def _straightened(data: Data, curve: np.ndarray, solved: np.ndarray, todo: np.ndarray) -> None:
    """Move those of the lanes ``todo`` with n < 1 along their valley, in the chart EPS."""
    s = Solved(*solved[:, todo])
    inside = s.chart * (2.0 * xi_of(s.x) - s.w) < 0.0  # log|N|^2
    todo = todo[inside & (s.w > W_MIN)]
    if not len(todo):
        return
    s = Solved(*solved[:, todo])
    start = start_rows(len(todo), np.stack([*to_eps(s.x, s.w, s.chart), np.full_like(s.x, EPS)]))
    moved = Solved(*run(data.take(curve[todo]), start, Steps(CREEP_STEPS))[0])
    x, w, chart = from_eps(moved.x, moved.w)
    better = moved.cost < s.cost
    used = s.evaluations + moved.evaluations
    for row, value in ((ROW.x, x), (ROW.w, w), (ROW.chart, chart), (ROW.cost, moved.cost)):
        solved[row, todo] = np.where(better, value, solved[row, todo])
    solved[ROW.damping, todo] = np.where(better, START_DAMPING, s.damping)
    solved[ROW.evaluations, todo] = used


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
    data = data._replace(few=data.curves <= 2 * FEW)
    kinds = _mesh_kinds(data, extent)
    if (kinds == kinds[0]).all():
        data = data._replace(mesh=str(kinds[0]))
        return _minima(data, points), data
    names, counts = np.unique(kinds, return_counts=True)
    data = data._replace(mesh=str(names[np.argmax(counts)]))
    best = np.empty((len(Solved._fields), data.curves))
    curves, others = [], []
    for mesh in dict.fromkeys(kinds.tolist()):
        mine = np.flatnonzero(kinds == mesh)
        part = data.take(mine)._replace(mesh=mesh)
        new = _minima(part, None if points is None else points[:, mine])
        best[:, mine] = new.best
        curves.append(mine[new.curve])
        others.append(new.others)
    return Minima(best, np.concatenate(curves), np.concatenate(others, axis=-1)), data


def _minima(data: Data, points: np.ndarray | None) -> Minima:
    steps = Steps(FIRST_STEPS, FURTHER_STEPS[0], NEAR_STEPS, CREEP_STEPS)
    best, further = run(data, start_rows(data.curves), steps)
    every, last = np.arange(data.curves), (MOST_STEPS, -np.inf)
    best = _to_the_end(data, every, best, [(CREEP_STEPS, np.inf), (MOST_STEPS, np.inf), last])
    if points is not None:
        further = _with_points(further, points)
    curve, again = further.curve, further.solved
    if not len(curve):
        return Minima(best, curve, np.empty((OTHERS, len(best), 0)))
    waiting = np.isnan(again[ROW.cost]).nonzero()[0]
    if len(waiting):
        start = start_rows(len(waiting), again[:3, waiting])
        again[:, waiting], _ = run(data.take(curve[waiting]), start, Steps(FURTHER_STEPS[0]))
    least = best[ROW.cost, curve]
    near = near_cost(least, best[ROW.scale, curve], best[ROW.count, curve], np)
    stages = [(FURTHER_STEPS[1], near), (MOST_STEPS, least), last]
    again = _to_the_end(data, curve, again, stages)
    has = np.zeros(data.curves, bool)
    has[curve] = True
    some = has.nonzero()[0]
    place = np.searchsorted(some, curve)
    found = np.full((1 + OTHERS, len(best), len(some)), np.nan)
    found[0] = best[:, some]
    for job in sorted(set(further.which.tolist())):
        mine = (further.which == job).nonzero()[0]
        todo = place[mine]
        found[:, :, todo] = with_arrival(found[:, :, todo], again[:, mine])
    best[:, some], *others = less_absorbing_first(found)
    return Minima(best, some, np.array(others))


def _with_points(further: Further, points: np.ndarray) -> Further:
    """Return further starts and one more for each curve, (3, N), which was not followed yet."""
    count = points.shape[1]
    own = np.full(count, further.which.max(initial=0) + 1)
    nothing = np.full((len(further.solved) - 3, count), np.nan)
    more = Further(np.arange(count), own, np.concatenate([points, nothing]))
    return Further(*(np.concatenate(a, axis=-1) for a in zip(further, more, strict=True)))
