"""The compiled program behind `fit` and `fit_many`: starts, and the descent from each of them.

One program per set of channels and number of angles, for 8 curves (a few), 64 (several) or a
multiple of 64 (many). Of the first two every start of a curve is followed in one call: curves and
further starts are jobs, and jobs run in groups of 8 lanes, so that a slow lane keeps 7 others
waiting and not a whole batch. Of many curves the first starts alone run here, 64 side by side;
`batch` collects the remaining work of all of them.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import Array

from fitting.bare_surface import mesh as starts
from fitting.bare_surface.descent import ROW, Solved, descend, descend_in_both_charts
from fitting.bare_surface.reflectances import Curves
from fitting.problem.solver import START_DAMPING
from fitting.process.compiled import compiled

# A further start is near the best minimum of its curve at a cost less than 4 times that one, or
# than what an error of .3 % of all data costs. With less than five degrees of freedom the cost of
# another minimum that is reported may be higher than 4 times the best one (`alternative_chi2`).
NEAR_COST, NEAR_SHARE = 4.0, 1e-5


# The lanes of a group, and the curves that the mesh is compared with side by side.
LANES, BLOCK = 8, 64


def near_cost(cost: Any, scale: Any, count: Any, lib: Any = jnp) -> Any:
    """Return the cost below which a further start is near a minimum of ``count`` data.

    lib: jax.numpy, or numpy for arrays that are no part of a program.
    """
    times = 400.0 ** (1.0 / lib.maximum(count - 2.0, 1.0))
    return lib.maximum(times, NEAR_COST) * cost + NEAR_SHARE * scale


class Steps(NamedTuple):
    """After how many evaluations a lane is left as it is, not done: numbers.

    first: of a first start. further: of a further one that is not near the best minimum. near: of
    one that is. turned: of one that goes on in the other chart (0: none does).
    """

    first: Any
    further: Any = 0
    near: Any = 0
    turned: Any = 0


# The row of the table of jobs below those of ``Solved``: which job each is.
JOB = len(Solved._fields)


def _jobs(
    curves: Curves,
    start: Array,
    used: Array,
    nodes: tuple[Array, ...],
    searched: Array,
    mesh: str,
    channels: tuple[str, ...],
) -> tuple[Array, Array]:
    """Return the table of the jobs of a block of B curves, before any is done, (fields + 1, J).

    The curves first, then their further starts: x, w and chart where they start, the rest NaN; and
    in the row JOB the curve plus B for every start before this one of it, -1 where there is no job.
    And how many further starts there are: none where no lane is ``searched``.
    """
    block = start.shape[1]

    def from_mesh():
        own = nodes or starts.node_curves(curves, channels, mesh)
        found = starts.mesh_starts(curves, own, mesh)
        has = (jnp.isfinite(found[1:, 0]) & (jnp.arange(block) < used)).ravel()
        return found, jnp.argsort(~has, stable=True), has.sum()

    def none():
        found = starts.no_starts(block, mesh)
        return found, jnp.arange((len(found) - 1) * block), jnp.array(0)

    found, order, further = jax.lax.cond(searched, from_mesh, none)
    first = jnp.where(jnp.isfinite(start[0]), start[:3], found[0])
    rest = jnp.moveaxis(found[1:], 1, 0).reshape(3, -1)[:, order]
    points = jnp.concatenate([first, rest], 1)
    number = jnp.where(jnp.arange(len(order)) < further, block + order, -1)
    job = jnp.concatenate([jnp.arange(block), number]).astype(points.dtype)
    nothing = jnp.full((JOB - 3, len(job)), jnp.nan)
    return jnp.concatenate([points, nothing, job[None]]), further


def _carried_out(
    curves: Curves,
    start: Array,
    used: Array,
    steps: Steps,
    table: Array,
    further: Array,
    channels: tuple[str, ...],
) -> Array:
    """Return the table of jobs with ``Solved`` of every job, group by group.

    start: (5, B), of which damping and the largest w are asked here. used: how many curves there
    are.
    """
    block = start.shape[1]
    first = (used + LANES - 1) // LANES
    groups = first + (further + LANES - 1) // LANES

    def of_lanes(a: Array, curve: Array) -> Array:
        return a if a.shape[-1] == 1 else jnp.take(a, curve, axis=-1, mode="clip")

    def group(carry):
        g, table = carry
        is_first = g < first
        place = jnp.where(is_first, g * LANES, block + (g - first) * LANES)
        jobs = jax.lax.dynamic_slice_in_dim(table, place, LANES, axis=1)
        curve = jobs[JOB].astype(int) % block
        data = jax.tree.map(lambda a: of_lanes(a, curve), curves)
        damping = jnp.where(is_first, of_lanes(start[3], curve), START_DAMPING)
        begin = jnp.stack([*jobs[:3], damping, of_lanes(start[4], curve)])
        most = (
            jnp.where(is_first, steps.first, steps.further),
            jnp.where(is_first, steps.first, steps.near),
        )
        rows = (table[row] for row in (ROW.cost, ROW.scale, ROW.count))
        near = near_cost(*(of_lanes(row, curve) for row in rows))
        solved = descend_in_both_charts(data, begin, most, near, steps.turned, channels)
        return g + 1, jax.lax.dynamic_update_slice(table, solved, (0, place))

    begin = (jnp.zeros_like(groups), table)
    return jax.lax.while_loop(lambda carry: carry[0] < groups, group, begin)[1]


def _first_carried_out(
    curves: Curves, start: Array, steps: Steps, table: Array, channels: tuple[str, ...]
) -> Array:
    """Return the table of jobs with ``Solved`` of the first start of every curve.

    What `_carried_out` does where only these are followed, in one chart: a tenth less time, since
    no data need be gathered.
    """
    block = start.shape[1]
    begin = jnp.concatenate([table[:3, :block], start[3:]])
    most = jnp.broadcast_to(steps.first, (block,))
    solved = descend(curves, begin, (most, most), jnp.zeros(block), channels)
    return jax.lax.dynamic_update_slice(table, solved, (0, 0))


def _solve(
    cos_theta: Array,
    s_share: Array,
    values: tuple[Array, ...],
    weights: tuple[Array, ...],
    start: Array,
    numbers: Array,
    nodes: tuple[Array, ...],
    *,
    channels: tuple[str, ...],
    mesh: str,
) -> Array:
    """Return ``Solved`` of S curves and of their further starts, in blocks of up to BLOCK curves.

    That is the table of `_jobs` of each block, (blocks, fields + 1, J), with every job done, but
    for further starts where there are several blocks. S is a multiple of LANES and of the block.

    cos_theta, s_share: (M,), or (S, M) where curves have angles of their own; M is a multiple of
        reflectances.SIDE_BY_SIDE.
    values: C arrays (S, M), finite. weights: C arrays (M,) or (S, M), 0 where there is no datum.
    start: (5, S): x, w, chart, damping and the largest w; where x is NaN, from the mesh.
    numbers: how many of the S are curves (the rest is left out), and the `Steps`.
    nodes: curves of the mesh, of `mesh.node_curves`; () to evaluate them here.
    mesh: which of `starts.MESHES`.
    """
    block = min(start.shape[1], BLOCK)
    blocks, used, steps = start.shape[1] // block, numbers[0], Steps(*numbers[1:])

    def lanes_last(a: Array) -> Array:
        """(S, M) -> (blocks, M, block)"""
        return jnp.swapaxes(a.reshape(blocks, block, a.shape[-1]), -1, -2)

    own: dict[str, Any] = {
        "values": tuple(map(lanes_last, values)),
        "start": start.reshape(-1, blocks, block).swapaxes(0, 1),
        "used": jnp.clip(used - block * jnp.arange(blocks), 0, block),
    }
    shared: dict[str, Any] = {}
    for name, a in (("cos_theta", cos_theta), ("s_share", s_share)):
        (own if a.ndim == 2 else shared)[name] = lanes_last(a) if a.ndim == 2 else a[:, None]
    if weights[0].ndim == 2:
        own["weights"] = tuple(map(lanes_last, weights))
    else:
        shared["weights"] = tuple(w[:, None] for w in weights)
    # Lanes that go on from where they are need no mesh.
    searched = jnp.isnan(start[0]).any()

    def one_block(parts: dict[str, Any]) -> Array:
        every = {**shared, **parts}
        curves = Curves(*(every[name] for name in Curves._fields))
        begin, here = every["start"], every["used"]
        table, further = _jobs(curves, begin, here, nodes, searched, mesh, channels)
        if blocks > 1:
            return _first_carried_out(curves, begin, steps, table, channels)
        return _carried_out(curves, begin, here, steps, table, further, channels)

    return jax.lax.map(one_block, own)


solve = compiled(_solve, ("channels", "mesh"))
