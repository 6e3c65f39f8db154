"""Fits in three programs, of which only the first one knows the model of the index.

In a single program the optics (1.5 s to compile for a film) and the step of the solver (1 to 3 s)
are compiled again for every model, number of rows and number of lanes. Of the three programs

    quantities   unknowns -> indices, thicknesses, instrument; and their derivatives
    optics       these -> what each channel shows; and its derivatives by them
    step         normal equations (a small program of their own) -> the next place to try

the second one is shared by all models, the third one by all models of about as many unknowns, which
are filled up. All of them have one shape, for all numbers of rows and of lanes: rows are cut into
blocks, which fill the columns of a call, and only lanes that have not converged are evaluated (of
64 side by side three in five had).
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from fitting.optics.observe import predicted
from fitting.optics.spec import NCS, Points, Spec
from fitting.problem.optics_inputs import Core, core_of, has_parts, quantities, spec_at
from fitting.problem.programs import (
    SOLVER,
    Bounds,
    Targets,
    robust,
    rows_of,
    solve,
    weighted,
)
from fitting.problem.solver import FEW_UNKNOWNS, BatchState, packed
from fitting.process.compiled import compiled, in_turn

# A call evaluates blocks of so many rows, one in each of so many columns. With 8192 points in a
# call, not 2048, each takes a tenth longer, and more are evaluated for nothing if lanes are few. A
# search of films that fit in one block has 9 to 19 lanes at work on average: with half the columns
# it takes two thirds to four fifths of the time.
ROWS, COLUMNS, FEW_COLUMNS = 64, 32, 16
# Number of lanes side by side: a step of 16 unknowns takes .4 ms for 32 lanes, .9 ms for 64.
SLOTS = 32
# Unknowns are filled up to one of these numbers, and from the last one on to a multiple of 4.
_SIZES = (8, 16)
# Of more rows at several angles a search takes a part.
_FEW_ROWS = 256


class Blocks(NamedTuple):
    """Blocks of rows as columns of a call, repeated for as many lanes as there is room for.

    count: how many blocks. points, eta_i, data: there, on the device.
    """

    count: int
    points: Points
    eta_i: Any
    data: Targets

    @property
    def columns(self) -> int:
        """The number of columns of a call."""
        return self.points.angle_deg.shape[1]

    def calls(self, active: np.ndarray) -> Iterator[np.ndarray]:
        """Yield the slot of each column in one call after the other; SLOTS: none."""
        room = self.columns // self.count
        for start in range(0, len(active), room):
            some = active[start : start + room]
            slot = np.full(self.columns, SLOTS)
            slot[: len(some) * self.count] = np.repeat(some, self.count)
            yield slot


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
        folded = None if targets.points.folded is None else cut(targets.points.folded)
        points = Points(angle, wavelength, share, np.zeros(1, int), folded=folded)
        eta_i = cut(targets.eta_i) if np.ndim(targets.eta_i) else targets.eta_i
        ncs, weights = (cut(a) if np.size(a) else () for a in (targets.ncs, targets.ncs_weights))
        data = targets._replace(
            points=None, held=None, eta_i=None, prior=None, prior_weight=None,
            values=tuple(map(cut, targets.values)), weights=tuple(map(cut, targets.weights)),
            ncs=ncs, ncs_weights=weights,
        )  # fmt: skip
        out.append(Blocks(count, *jax.device_put((points, eta_i, data))))
    return out


def _flat(points: Points, eta_i: Any) -> tuple[Points, Any]:
    """Return points and the index before in one row."""
    angle, wavelength, share = (x.reshape(1, -1) for x in points[:3])
    folded = None if points.folded is None else points.folded.reshape(1, -1)
    row = Points(angle, wavelength, share, jnp.zeros(1, int), folded=folded)
    return row, eta_i.reshape(1, -1) if jnp.ndim(eta_i) else eta_i


def _optics(
    moving: list[Array], fixed: Sequence[Array], points: Points, eta_i: Any, *, core: Core
) -> tuple[Array, Array]:
    """Return what each channel shows, (K, N), and its derivatives by each that moves, (A, K, N).

    K counts NCS as three.
    """

    shape = moving[0].shape
    points, eta_i = _flat(points, eta_i)
    if core.spec.media.normal:
        # Else XLA forms a cosine for each of some twenty numbers that are made of it.
        points = points._replace(angle_deg=jnp.zeros(shape))

    def shown(some: list[Array]) -> Array:
        moves, stays = iter(some), iter(fixed)
        index = []
        for i in range(len(core.spec.media.index)):
            here = moves if i in core.indices else stays
            index.append([(next(here), next(here))])
        v = {name: next(moves)[0] for name in core.moving}
        v |= {name: next(stays)[0] for name in core.held}
        found = predicted(core.spec, v, points, eta_i, index=index)
        return rows_of(core.spec, found, shape)[:, 0]

    value, along = jax.linearize(shown, moving)
    slopes = [
        along([jnp.ones_like(x) if j == i else jnp.zeros_like(x) for j, x in enumerate(moving)])
        for i in range(len(moving))
    ]
    return value, jnp.stack(slopes)


def _sums(
    sums: Array, slot: Array, shown: Array, slopes: Array, columns: list[Array], targets: Targets,
    *, spec: Spec,
) -> Array:  # fmt: skip
    """Return the packed normal equations of all slots with those of these columns added."""
    shape = (len(shown), ROWS, len(slot))
    shown = shown.reshape(shape)
    by_unknown = sum(
        d.reshape(shape) * column[:, None] for d, column in zip(slopes, columns, strict=True)
    )

    def residuals(rows: Array) -> Array:
        places, found = iter(rows), {}
        for channel in spec.channels:
            found[channel] = [next(places) for _ in range(3)] if channel == NCS else next(places)
        return jnp.stack([robust(spec.loss, r) for r in weighted(spec, found, targets)])

    off, along = jax.linearize(residuals, shown)
    rows = jnp.concatenate([off[None], jax.vmap(along)(by_unknown)])
    rows = rows.reshape(len(rows), -1, len(slot))
    more = packed(jnp.einsum("pml,qml->pql", rows, rows))
    return sums.at[:, slot].add(more, mode="drop")


def _step(
    y: Array, state: BatchState, trial: Array, sums: Array, bounds: Bounds, active: Array, most: Any
) -> tuple[BatchState, Array, Array, Array]:
    """Return the state and y after a trial, the next trial, and which slots are finished."""
    options = bounds._asdict()
    state = state._replace(done=state.done | ~active)
    y, state = SOLVER.advanced(y, trial, sums, options, state)
    over = state.done | (state.evaluations >= most)
    return state, y, SOLVER.next_trial(y, options, state), over


def _shared(function: Callable, static: tuple[str, ...]) -> Callable:
    return in_turn(compiled(function, static), by_first=True)


_quantities_of = _shared(quantities, ("spec", "core"))
_optics_of = _shared(_optics, ("core",))
_summed = _shared(_sums, ("spec",))
_stepped = _shared(_step, ())


@functools.lru_cache
def _blank(unknowns: int) -> Any:
    """Return a state of zeros."""
    y = np.zeros((unknowns, SLOTS))
    shapes = jax.eval_shape(SOLVER.begun, y, y[0])
    return jax.tree.map(lambda a: np.zeros(a.shape, a.dtype), shapes)


def filled(y: np.ndarray) -> np.ndarray:
    """Return y (p, L) with more unknowns, which are none."""
    size = next((size for size in _SIZES if len(y) <= size), -(-len(y) // 4) * 4)
    return np.pad(y, ((0, size - len(y)), (0, 0)))


def in_parts(spec: Any, targets: Targets) -> bool:
    """Whether a fit runs in these programs: if others share them, for films, for many unknowns.

    A first `choose` takes half the time, and so does the first fit of a silver mirror by three
    oscillators. One program for all is, once compiled, up to three times as fast for a bare surface
    of few unknowns, and where wavelengths come again at other angles: it forms the index once. But
    a search in parts takes each wavelength of many at some of the angles only (see
    `searching.fewer_rows`): a first fit of a film at seven angles takes 14 s, not 34. One program
    is traced anew for the search and for all rows: T of a film on a plate at 780 wavelengths took
    19 s of processor time, once compiled 10, and takes 9 and 7 in parts.
    """
    if not has_parts(spec) or len(targets.points.angle_deg) % ROWS:
        return False
    films = any(spec.media.coherent)
    worth = films or len(spec.moving) > FEW_UNKNOWNS
    fewer = films and len(targets.points.angle_deg) > _FEW_ROWS
    return spec.shared or fewer or (worth and targets.points.place is None)


class Parts:
    """A fit in these programs: everything that stays the same while it runs."""

    def __init__(self, spec: Spec, targets: Targets):
        self.spec, self.held = spec, targets.held
        self.core = core_of(spec, not np.any(targets.points.angle_deg))
        self.blocks = blocks_of(targets)

    def shown(self, trial: Any, slot: np.ndarray, blocks: Blocks) -> tuple[Any, Any, Any]:
        """Return the result of `_optics`, and the derivatives of what moves by the unknowns."""
        moving, columns, fixed = _quantities_of(
            trial, slot, self.held, blocks.points, spec=self.spec, core=self.core
        )
        shown = _optics_of(moving, fixed, blocks.points, blocks.eta_i, core=self.core)
        return *shown, columns

    def sums(self, trial: Any, active: np.ndarray) -> Any:
        """Return the packed normal equations of the active slots at trial (P, SLOTS)."""
        unknowns = len(trial)
        total = np.zeros(((unknowns + 1) * (unknowns + 2) // 2, SLOTS))
        for blocks in self.blocks:
            for slot in blocks.calls(active):
                shown, slopes, columns = self.shown(trial, slot, blocks)
                total = _summed(
                    total, slot, shown, slopes, columns, blocks.data, spec=self.core.spec
                )
        return total


def solved_in_parts(
    targets: Targets, start: Any, damping: Any, bounds: Bounds, max_steps: Any, *, spec: Spec
) -> tuple[Any, ...]:
    """Return the result of `programs.solve`; the next lane takes the place of a finished one."""
    if not in_parts(spec, targets):
        if isinstance(spec, Spec):
            spec = spec_at(spec, targets.points.angle_deg)
        return solve(targets, start, damping, bounds, max_steps, spec=spec)
    parts = Parts(spec, targets)
    p, lanes = start.shape
    start, low, high = map(filled, (start, bounds.lower, bounds.upper))
    given = Bounds(low, high, bounds.degrees, bounds.scale)
    ends, cost = start[:p].copy(), np.full(lanes, np.inf)
    done, evaluations, left = np.zeros(lanes, bool), np.zeros(lanes, int), np.array(damping)
    lane_in, waiting = np.full(SLOTS, -1), 0
    y = trial = np.zeros((len(start), SLOTS))
    state = _blank(len(start))
    while True:
        free = np.flatnonzero(lane_in < 0)[: lanes - waiting]
        if len(free):
            new = np.arange(waiting, waiting + len(free))
            waiting += len(free)
            lane_in[free] = new
            state, y, trial = jax.tree.map(np.array, (state, y, trial))
            for each in jax.tree.leaves(state._replace(steps=None)):
                each[..., free] = 0
            state.sums[0, free], state.damping[free] = np.inf, damping[new]
            y[:, free] = start[:, new]
            trial[:, free] = np.clip(start, low, high)[:, new]
            own = jax.device_put(jax.tree.map(lambda a: a[..., np.maximum(lane_in, 0)], given))
        active = lane_in >= 0
        if not active.any():
            break
        sums = parts.sums(trial, np.flatnonzero(active))
        state, y, trial, over = _stepped(y, state, trial, sums, own, active, max_steps)
        ended = np.flatnonzero(active & np.asarray(over))
        if len(ended):
            of = lane_in[ended]
            ends[:, of], cost[of] = np.asarray(y)[:p, ended], np.asarray(state.sums)[0, ended]
            done[of], left[of] = np.asarray(state.done)[ended], np.asarray(state.damping)[ended]
            evaluations[of] = np.asarray(state.evaluations)[ended]
            lane_in[ended] = -1
    return ends, cost, done & np.isfinite(cost) & np.isfinite(ends).all(0), evaluations, left
