"""Fits of coherent films in three programs, of which only the first one knows the model.

Where an evaluation is one program, the film (1.5 s to compile) and the solver's step (1 to 3 s) are
compiled again for every model of its index, every number of rows and of lanes. Of three,

    quantities   unknowns -> indices, thicknesses, instrument; and their derivatives
    optics       these -> what each channel shows; and its derivatives by them
    step         normal equations (a small program of their own) -> the next place to try

the second one is shared by all models and shapes of one size, the third one by all models of about
as many unknowns, which are filled up.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from fitting.compiled import compiled, in_turn
from fitting.film_quantities import Core, core_of, has_parts, quantities
from fitting.observe import NCS, Points, Spec, predicted
from fitting.problem import SOLVER, Bounds, Targets, linearised, robust, rows_of, solve, weighted
from fitting.solver import BatchState, packed

# Unknowns are filled up to a multiple of the first number, lanes to the second.
_SIZE, _LANES = 8, 64
# Of fewer rows an evaluation is over before three programs are called: a film of free index, fitted
# at each wavelength for many thicknesses, took three times as long.
_FEW_ROWS = 32


def _optics(
    moving: list[Array], fixed: list[Array], points: Points, eta_i: Any, *, core: Core
) -> tuple[Array, Array]:
    """Return what each channel shows, (K, N), and its derivatives by each that moves, (A, K, N).

    K counts NCS as three.
    """

    shape = moving[0].shape

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
    shown: Array, slopes: Array, columns: list[Array], targets: Targets, *, spec: Spec
) -> Array:
    """Return the normal equations, packed, of _LANES lanes, some of which are none."""
    lanes = max(c.shape[-1] for c in columns)
    shape = (len(shown), -1, lanes)
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
    rows = rows.reshape(len(rows), -1, lanes)
    sums = packed(jnp.einsum("pml,qml->pql", rows, rows))
    return jnp.pad(sums, ((0, 0), (0, max(0, _LANES - lanes))))


def _step(
    state: BatchState, y: Array, trial: Array, sums: Array, bounds: Bounds
) -> tuple[BatchState, Array, Array, Array]:
    """Return the state and y after a trial, the next one, and whether all lanes are done."""
    options = bounds._asdict()
    y, state = SOLVER.advanced(y, trial, sums, options, state)
    return state, y, SOLVER.next_trial(y, options, state), state.done.all()


def _shared(function: Callable, static: tuple[str, ...]) -> Callable:
    return in_turn(compiled(function, static))


_quantities_of = _shared(quantities, ("spec", "core", "lanes"))
_optics_of = _shared(_optics, ("core",))
_summed = _shared(_sums, ("spec",))
_stepped = _shared(_step, ())


def _filled(unknowns: int) -> int:
    return -(-unknowns // _SIZE) * _SIZE


def in_parts(spec: Any, targets: Targets) -> bool:
    """Whether a fit runs in these programs: of few coherent films, in one file of enough rows."""
    return has_parts(spec) and len(targets.points.angle_deg) > _FEW_ROWS


def _normal(targets: Targets) -> bool:
    return not np.any(targets.points.angle_deg)


def _flat(points: Points, eta_i: Any, lanes: int) -> tuple[Points, Any]:
    """Return the points of all lanes in one row, and the index before."""
    shape = (points.angle_deg.shape[0], lanes)

    def flat(x: Any) -> np.ndarray:
        return np.broadcast_to(np.asarray(x), shape).reshape(1, -1)

    angle, wavelength, share = map(flat, points[:3])
    row = Points(angle, wavelength, share, np.zeros(1, int))
    return row, flat(eta_i) if np.ndim(eta_i) else eta_i


def solved_in_parts(
    targets: Targets, start: Any, damping: Any, bounds: Bounds, max_steps: Any, *, spec: Spec
) -> tuple[Any, ...]:
    """Return what `problem.solve` does."""
    if not in_parts(spec, targets):
        return solve(targets, start, damping, bounds, max_steps, spec=spec)
    core, (p, lanes) = core_of(spec, _normal(targets)), start.shape
    size = _filled(p)
    # Lanes that are none have nothing to do in the step.
    more = max(_LANES - lanes, 0)
    fill = (0, size - p), (0, more)
    start, low, high = (np.pad(a, fill) for a in (start, bounds.lower, bounds.upper))
    degrees, scale, damping = (
        np.pad(a, (0, more), constant_values=1.0) for a in (bounds.degrees, bounds.scale, damping)
    )
    points, eta_i = _flat(targets.points, targets.eta_i, lanes)
    # Everything that stays the same is moved once.
    own, points, eta_i, given, bounds, y = jax.device_put(
        ((targets.held, targets.points, targets.eta_i), points, eta_i,
         targets._replace(points=None, held=None, eta_i=None, prior=None, prior_weight=None),
         Bounds(low, high, degrees, scale), start)
    )  # fmt: skip
    state = SOLVER.begun(y, jnp.asarray(damping))
    trial = jnp.clip(y, bounds.lower, bounds.upper)
    for _ in range(int(max_steps)):
        moving, fixed, columns = _quantities_of(trial, *own, spec=spec, core=core, lanes=lanes)
        shown, slopes = _optics_of(moving, fixed, points, eta_i, core=core)
        sums = _summed(shown, slopes, columns, given, spec=core.spec)
        state, y, trial, over = _stepped(state, y, trial, sums, bounds)
        if over:
            break
    cost, y = np.asarray(state.sums[0])[:lanes], np.asarray(y)[:p, :lanes]
    done = np.asarray(state.done)[:lanes] & np.isfinite(cost) & np.isfinite(y).all(0)
    return y, cost, done, state.evaluations[:lanes], state.damping[:lanes]


def slopes_in_parts(targets: Targets, y: Any, *, spec: Spec) -> tuple[Any, Any]:
    """Return what `problem.linearised` does."""
    if not in_parts(spec, targets):
        return linearised(targets, y, spec=spec)
    core = core_of(spec, _normal(targets))
    own = targets.held, targets.points, targets.eta_i
    moving, fixed, columns = _quantities_of(y[:, None], *own, spec=spec, core=core, lanes=1)
    points, eta_i = _flat(targets.points, targets.eta_i, 1)
    shown, slopes = map(np.asarray, _optics_of(moving, fixed, points, eta_i, core=core))
    by_unknown = sum(
        d[..., None] * np.asarray(c)[..., 0].T for d, c in zip(slopes, columns, strict=True)
    )
    return shown, np.broadcast_to(by_unknown, (*shown.shape, len(y)))


def eta_in_parts(targets: Targets, y: np.ndarray, medium: int, *, spec: Spec) -> np.ndarray:
    """Return eta of a medium that moves, (M, L), at y (p, L), by the program of the solver."""
    core, count = core_of(spec, _normal(targets)), y.shape[1]
    own = targets.held, targets.points, targets.eta_i
    at, found = 2 * core.indices.index(medium), []
    for first in range(0, count, _LANES):
        pick = np.minimum(np.arange(first, first + _LANES), count - 1)
        some = np.pad(y[:, pick], ((0, _filled(len(y)) - len(y)), (0, 0)))
        moving = _quantities_of(some, *own, spec=spec, core=core, lanes=_LANES)[0]
        found.append(np.asarray(moving[at]).reshape(-1, _LANES))
    return np.concatenate(found, 1)[:, :count]


def eta_moves(spec: Any, targets: Targets, medium: int) -> bool:
    """Whether the solver's program of a fit knows the index of a medium, for `eta_in_parts`."""
    return in_parts(spec, targets) and medium in core_of(spec, False).indices
