"""Curves through the compiled program, cut into calls of one size that run side by side."""

from __future__ import annotations

import functools
import os
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import jax
import numpy as np

from fitting.bare_surface.coordinates import W_MAX
from fitting.bare_surface.curve_data import Data
from fitting.bare_surface.descent import Solved
from fitting.bare_surface.engine import Program, Steps, solve
from fitting.bare_surface.mesh_curves import mesh_curves
from fitting.bare_surface.reflectances import CHANNELS
from fitting.solver import START_DAMPING

FEW = 8
# Up to that many curves go in calls for FEW side by side; that program serves every file.
FEW_CALLS = 2
MANY, BLOCK = 1024, 64
# Up to SEVERAL curves one block a call: most of a call for MANY would be spent on empty lanes.
# Calls side by side of so many curves at least: one takes as long without any as with 20.
SEVERAL, LEAST_OF_CALL = 256, 24


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


class Further(NamedTuple):
    """Further starts of some curves, K in all: of which curve, which one of it, and what came.

    points: (3, K), x, w and chart. solved: (fields, K), ``Solved`` after the steps of the call.
    """

    curve: np.ndarray
    which: np.ndarray
    points: np.ndarray
    solved: np.ndarray


NO_FURTHER = Further(
    np.empty(0, int), np.empty(0, int), np.empty((3, 0)), np.empty((len(Solved._fields), 0))
)


def _shape(data: Data) -> tuple[int, int, int]:
    """Return how many curves a call takes, how many make a block of it, and a group of that."""
    if data.few:
        return FEW, FEW, FEW
    return (BLOCK, BLOCK, FEW) if data.curves <= SEVERAL else (MANY, BLOCK, BLOCK)


def _call(data: Data, start: np.ndarray, steps: Steps, shape: tuple[int, int, int]) -> Program:
    """Return what one call of the program gives for up to so many curves as ``shape`` has."""
    here, angles = data.curves, data.values[0].shape[1]
    size, block, lanes = shape
    wide, part = angles, data
    # Of a few curves the number of angles is rounded up (with no data), to 64 at least, and every
    # channel is there, so that a handful of compiled programs serves every file: a program takes
    # 5 s to compile, and 14 or 64 angles 20 ms to fit. Not of many curves, where what is empty
    # costs as much as what is full.
    if size == FEW:
        wide = max(64, 1 << (angles - 1).bit_length())
        part = data.with_all_channels()
    elif size < MANY:
        wide = -(-angles // 16) * 16
    part = part.padded(size, wide)
    begin = np.ones((len(start), size))
    begin[:, :here] = start
    with jax.enable_x64(True):
        nodes = mesh_curves(part, bool(np.isnan(start[0]).any()))
        return solve(
            part.cos_theta, part.s_share, part.values, part.weights, begin, np.int64(here),
            Steps(*map(np.int64, steps)), nodes,
            channels=part.channels, mesh=data.mesh, block=block, lanes=lanes, fitted=size == FEW,
        )  # fmt: skip


def _apart(found: Program, here: int, first: int, searched: bool) -> tuple[np.ndarray, Further]:
    """Return ``Solved`` of the curves of a call, from number ``first`` on, and what came further.

    searched: whether a lane started from the mesh.
    """
    solved = np.asarray(found.solved)
    block = solved.shape[2] - found.order.shape[1]
    of_curves = np.array(np.moveaxis(solved[:, :, :block], 1, 0))
    of_curves = of_curves.reshape(solved.shape[1], -1)[:, :here]
    if not searched:
        return of_curves, NO_FURTHER
    count, order = np.asarray(found.further), np.asarray(found.order)
    there = np.arange(order.shape[1]) < count[:, None]
    job = order[there]
    curve = first + np.nonzero(there)[0] * block + job % block
    points, ends = (
        np.moveaxis(np.asarray(a)[:, :, block:], 1, 0)[:, there] for a in (found.points, solved)
    )
    return of_curves, Further(curve, job // block, points, ends)


def run(data: Data, start: np.ndarray, steps: Steps) -> tuple[np.ndarray, Further]:
    """Return ``Solved`` of all curves as one (fields, N) array, each after at most these steps.

    And what came of the further starts that the mesh offers. Of many curves these are not followed.
    """
    count = data.curves
    if not count:
        return np.empty((len(Solved._fields), 0)), NO_FURTHER
    shape = _shape(data)
    size = shape[0]
    if size == MANY:
        steps = steps._replace(further=0, turned=0)
    else:  # calls of one size, and as many of them as there are processors, if not too small
        calls = max(-(-count // size), min(os.cpu_count() or 1, count // LEAST_OF_CALL))
        size = -(-count // calls)

    def one(first: int) -> tuple[np.ndarray, Further]:
        part, begin = data, start
        if count > size:
            chunk = slice(first, first + size)
            part, begin = data.take(chunk), start[:, chunk]
        found = _call(part, begin, steps, shape)
        return _apart(found, part.curves, first, bool(np.isnan(begin[0]).any()))

    if count <= size:
        return one(0)
    # Threads, because a call keeps the thread waiting that makes it, without the GIL.
    rest = [_threads(os.getpid()).submit(one, first) for first in range(size, count, size)]
    try:
        parts = [one(0), *(task.result() for task in rest)]
    finally:
        for task in rest:
            task.cancel()  # of an interrupted call; the others are done
    solved, further = zip(*parts, strict=True)
    joined = (np.concatenate(a, axis=-1) for a in zip(*further, strict=True))
    return np.concatenate(solved, axis=-1), Further(*joined)


def fitted_curves(data: Data, s: Solved) -> np.ndarray:
    """Return the reflectances at the solutions, (C, N, M), by the program for a few curves."""
    start = start_rows(data.curves, np.stack([s.x, s.w, s.chart]))
    angles, parts = data.values[0].shape[1], []
    for first in range(0, data.curves, FEW):
        chunk = slice(first, first + FEW)
        found = _call(data.take(chunk), start[:, chunk], Steps(0), (FEW, FEW, FEW))
        parts.append([np.asarray(found.fitted[CHANNELS.index(c)]) for c in data.channels])
    return np.concatenate(parts, axis=1)[:, : data.curves, :angles]
