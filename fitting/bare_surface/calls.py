"""Calls of the compiled program with curves in blocks of one size, several in parallel."""

from __future__ import annotations

import functools
import os
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import jax
import numpy as np

from fitting.bare_surface.coordinates import W_MAX
from fitting.bare_surface.curve_data import Data
from fitting.bare_surface.descent import Solved
from fitting.bare_surface.engine import JOB, Steps, solve
from fitting.bare_surface.mesh_curves import mesh_curves
from fitting.bare_surface.reflectances import CHANNELS
from fitting.problem.solver import START_DAMPING

FEW = 8
# Up to that many curves go in calls for FEW side by side; that program serves every file.
FEW_CALLS = 2
MANY, BLOCK = 1024, 64
# Up to SEVERAL curves one block a call: most of a call for MANY would be spent on empty lanes.
# Calls side by side of so many curves at least: one takes as long without any as with 20.
SEVERAL, LEAST_OF_CALL = 256, 24


def start_rows(count: int, points: np.ndarray | None = None) -> np.ndarray:
    """Return the start array of the program, from ``points`` (3, count) or, if None, the mesh."""
    start = np.full((5, count), np.nan)
    if points is not None:
        start[:3] = points
    start[3], start[4] = START_DAMPING, W_MAX
    return start


@functools.cache
def _threads(process: int) -> ThreadPoolExecutor:
    """Return the threads of this process, which are kept between calls.

    Starting and ending them takes as long as fitting 20 curves. A forked process has its own.
    """
    del process
    return ThreadPoolExecutor(os.cpu_count() or 1)


class Further(NamedTuple):
    """Further starts of some curves, K in all: of which curve, which one of it, and what came.

    solved: (fields, K), ``Solved`` after the steps of the call; of a start that was not followed
    x, w and chart, where it is, and the rest NaN.
    """

    curve: np.ndarray
    which: np.ndarray
    solved: np.ndarray


NO_FURTHER = Further(np.empty(0, int), np.empty(0, int), np.empty((JOB, 0)))


def _shape(data: Data) -> tuple[int, int, int]:
    """Return how many curves a call takes, how many make a block of it, and a group of that."""
    if data.few:
        return FEW, FEW, FEW
    return (BLOCK, BLOCK, FEW) if data.curves <= SEVERAL else (MANY, BLOCK, BLOCK)


def _call(
    data: Data, start: np.ndarray, steps: Steps, shape: tuple[int, int, int]
) -> tuple[np.ndarray, tuple[Any, ...]]:
    """Return the result of one call of the program, for as many curves as ``shape`` allows."""
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
        tables, fitted = solve(
            part.cos_theta, part.s_share, part.values, part.weights, begin,
            np.array([here, *steps]), nodes,
            channels=part.channels, mesh=data.mesh, block=block, lanes=lanes, fitted=size == FEW,
        )  # fmt: skip
        return np.asarray(tables), fitted


def _apart(tables: np.ndarray, here: int, first: int, block: int) -> tuple[np.ndarray, Further]:
    """Return ``Solved`` of the curves of a call, from number ``first`` on, and what came further.

    tables: (G, fields + 1, J), of one block of so many curves each.
    """
    if len(tables) == 1:
        solved = tables[0, :JOB, :here].copy()
    else:
        solved = np.concatenate(tables[:, :JOB, :block], axis=1)[:, :here]
    in_block, place = np.nonzero(tables[:, JOB, block:] >= 0.0)
    if not len(place):
        return solved, NO_FURTHER
    found = tables[in_block, :, block + place].T
    which, curve = np.divmod(found[JOB].astype(int), block)
    return solved, Further(first + in_block * block + curve, which, found[:JOB])


def run(data: Data, start: np.ndarray, steps: Steps) -> tuple[np.ndarray, Further]:
    """Return ``Solved`` of all curves as one (fields, N) array, each after at most these steps.

    And what came of the further starts that the mesh offers. Of many curves these are not followed.
    """
    count = data.curves
    if not count:
        return np.empty((JOB, 0)), NO_FURTHER
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
        tables, _ = _call(part, begin, steps, shape)
        return _apart(tables, part.curves, first, shape[1])

    if count <= size:
        return one(0)
    # Threads, because a call blocks its thread, without holding the GIL.
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
        _, at = _call(data.take(chunk), start[:, chunk], Steps(0), (FEW, FEW, FEW))
        parts.append([np.asarray(at[CHANNELS.index(c)]) for c in data.channels])
    return np.concatenate(parts, axis=1)[:, : data.curves, :angles]
