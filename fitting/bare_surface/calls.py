"""Calls of the compiled program with curves in blocks of one size, several in parallel."""

from __future__ import annotations

import functools
import os
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
from jax import Array

from fitting.bare_surface.coordinates import W_MAX
from fitting.bare_surface.curve_data import Data
from fitting.bare_surface.engine import BLOCK, JOB, LANES, Steps, solve
from fitting.bare_surface.mesh import node_curves
from fitting.bare_surface.reflectances import SIDE_BY_SIDE, Curves
from fitting.problem.solver import START_DAMPING
from fitting.process.compiled import compiled, in_float64
from fitting.process.side_by_side import PROCESSORS

# Curves of a call. Up to 16 go in two calls for a few; that program serves every file. Up to
# SEVERAL go in calls of one block: most of a call for many would be spent on empty lanes.
FEW, SEVERAL, MANY = LANES, 256, 1024
# Calls side by side of so many curves at least: one takes as long without any as with 20.
LEAST_OF_CALL = 24
# A mesh has as many nodes as some hundred lanes (3,000 for R_p alone), and to evaluate them takes
# as long as a third of the fit of 64 curves. Most calls are at angles that an earlier one had.
# Up to that many angles (19 MB with every channel and the largest mesh) they are kept.
KEPT, KEPT_ANGLES = 4, 256


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
    return ThreadPoolExecutor(PROCESSORS)


class Further(NamedTuple):
    """Further starts of some curves, K in all: of which curve, which one of it, and what came.

    solved: (fields, K), ``Solved`` after the steps of the call; of a start that was not followed
    x, w and chart, where it is, and the rest NaN.
    """

    curve: np.ndarray
    which: np.ndarray
    solved: np.ndarray


NO_FURTHER = Further(np.empty(0, int), np.empty(0, int), np.empty((JOB, 0)))


def _of_nodes(cos_theta, s_share, *, channels: tuple[str, ...], mesh: str) -> tuple[Array, ...]:
    return node_curves(Curves(cos_theta[:, None], s_share[:, None], (), ()), channels, mesh)


_of_nodes = compiled(_of_nodes, ("channels", "mesh"))


@functools.lru_cache(maxsize=KEPT)
def _kept(
    cos_theta: bytes, s_share: bytes, channels: tuple[str, ...], mesh: str
) -> tuple[Array, ...]:
    angles = np.frombuffer(cos_theta), np.frombuffer(s_share)
    return _of_nodes(*angles, channels=channels, mesh=mesh)


def _nodes(data: Data) -> tuple[Array, ...]:
    """Return `mesh.node_curves` at a few angles that all curves share; else nothing."""
    if data.cos_theta.ndim == 2 or len(data.cos_theta) > KEPT_ANGLES:
        return ()
    return _kept(data.cos_theta.tobytes(), data.s_share.tobytes(), data.channels, data.mesh)


def _call(data: Data, start: np.ndarray, steps: Steps, size: int) -> np.ndarray:
    """Return the result of one call of the program, for up to ``size`` curves."""
    here, angles = data.curves, data.values[0].shape[1]
    wide, part = angles + -angles % SIDE_BY_SIDE, data
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
    with in_float64():
        return np.asarray(solve(
            part.cos_theta, part.s_share, part.values, part.weights, begin,
            np.array([here, *steps]), _nodes(part), channels=part.channels, mesh=data.mesh,
        ))  # fmt: skip


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
    most = size = FEW if data.few else BLOCK if count <= SEVERAL else MANY
    if size < MANY:  # as many calls as there are processors, if not too small, of whole groups
        calls = max(-(-count // size), min(PROCESSORS, count // LEAST_OF_CALL))
        size = -(-count // (calls * LANES)) * LANES

    def one(first: int) -> tuple[np.ndarray, Further]:
        part, begin = data, start
        if count > size:
            chunk = slice(first, first + size)
            part, begin = data.take(chunk), start[:, chunk]
        tables = _call(part, begin, steps, most)
        return _apart(tables, part.curves, first, min(most, BLOCK))

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
