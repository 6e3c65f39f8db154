"""The one compiled program behind `fit` and `fit_many`: starts, solve, last step, derivatives.

One program per set of channels and number of angles, for 8 curves (a few) or for 1024 (many);
inside it curves run in groups of 8 or 64 lanes, whose arrays fit the cache. Nothing here knows how
many curves there are; that is the business of `batch`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import optimistix as optx
from jax import Array

from fitting.bare_surface import coordinates as co
from fitting.bare_surface import mesh as starts
from fitting.bare_surface.reflectances import (
    Curves,
    Residuals,
    count_and_scale,
    model,
    sums_of_squares,
)
from fitting.compiled import compiled
from fitting.solver import BatchLevenbergMarquardt, unpack

SOLVER = BatchLevenbergMarquardt()


class Solved(NamedTuple):
    """What the program gives back, each (L,)."""

    x: Any
    w: Any
    chart: Any
    cost: Any  # weighted sum of squares
    plain: Any  # the same without weights
    done: Any
    evaluations: Any
    damping: Any
    count: Any  # data
    scale: Any  # weighted sum of squares of the data
    g_x: Any  # half the gradient of the cost
    g_w: Any
    h_xx: Any  # Gauss-Newton matrix
    h_xw: Any
    h_ww: Any


def _last_step(
    curves: Curves,
    chart: Array,
    best: Array,
    trial: Array,
    allowed: Array,
    channels: tuple[str, ...],
) -> tuple[Array, Array, Array, tuple[Array, ...]]:
    """Return ``trial``, in lanes where its cost is above ``allowed`` ``best``, and sums and curves.

    A loop that runs once, or twice when a lane steps back: one copy of the model in the program.
    """

    def body(carry):
        y, *_, runs = carry
        found = model(curves, y[0], y[1], chart, channels)
        weighted, plain = sums_of_squares(curves, found)
        worse = ~(weighted <= allowed) & (y != best).any(0)
        return jnp.where(worse, best, y), weighted, plain, found, worse.any(), runs + 1

    none = jnp.zeros_like(allowed)
    nowhere = tuple(jnp.zeros_like(v) for v in curves.values)
    # The count ends it where NaN, which is unlike itself, would have it step back for ever.
    y, weighted, plain, found, _, _ = jax.lax.while_loop(
        lambda carry: carry[4] & (carry[5] < 2),
        body,
        (trial, none, none, nowhere, jnp.array(True), jnp.array(0)),
    )
    return y, weighted, plain, found


def _solve_lanes(
    curves: Curves, start: Array, from_mesh: Array, max_steps: Array, channels: tuple[str, ...]
) -> tuple[Array, tuple[Array, ...]]:
    given = jnp.isfinite(start[0])
    x, w, chart = jnp.where(given, start[:3], from_mesh)
    y = jnp.stack([x, jnp.minimum(w, start[4])])
    by_eps = chart == co.EPS
    low, high = co.EPS_BOUNDS
    lower = jnp.stack([jnp.where(by_eps, low[0], co.X_MIN), jnp.where(by_eps, low[1], co.W_MIN)])
    upper = jnp.stack([
        jnp.where(by_eps, high[0], co.X_MAX), jnp.where(by_eps, high[1], start[4])
    ])  # fmt: skip
    count, scale = count_and_scale(curves)
    options = {
        "lower": lower,
        "upper": upper,
        "degrees": jnp.maximum(count - 2, 1),
        "scale": scale,
        "max_steps": max_steps,
        "damping": start[3],
    }
    solution = optx.least_squares(
        Residuals(channels), SOLVER, y, (curves, chart), options, max_steps=None, throw=False
    )
    stats = solution.stats
    done = stats["done"]
    cost_before, gradient, matrix = unpack(stats["sums"], 2)
    # The undamped step at the end promised less than a hundredth of a standard error, and so was
    # not worth an evaluation of derivatives; taken all the same it squares the error that is left.
    trial = jnp.clip(solution.value + jnp.where(done, stats["step"], 0.0), lower, upper)
    allowed = cost_before * (1.0 + 1e-6) + 4.0 * SOLVER.atol**2 * scale
    last, cost, plain, fitted = _last_step(curves, chart, solution.value, trial, allowed, channels)
    gradient = gradient + (matrix * (last - solution.value)[None]).sum(1)
    solved = (
        last[0], last[1], chart, cost, plain, done & jnp.isfinite(cost), stats["evaluations"],
        stats["damping"], count, scale,
        gradient[0], gradient[1], matrix[0, 0], matrix[0, 1], matrix[1, 1],
    )  # fmt: skip
    fields = Solved(*(a.astype(y.dtype) for a in solved))
    return jnp.stack(fields), fitted


def _solve(
    cos_theta: Array,
    s_share: Array,
    values: tuple[Array, ...],
    weights: tuple[Array, ...],
    start: Array,
    max_steps: Array,
    nodes: tuple[Array, ...],
    *,
    channels: tuple[str, ...],
    mesh: str,
    lanes: int,
    fitted: bool,
) -> tuple[Array, Array, tuple[Array, ...]]:
    """Return ``Solved`` of S curves as one (fields, S) array, and their further starts, (E, 3, S).

    And, if ``fitted``, C arrays (S, M): the curves at the solutions.

    S is a multiple of ``lanes``. The starts are x, w and chart, NaN where the mesh offers none.

    cos_theta, s_share: (M,), or (S, M) where curves have angles of their own.
    values: C arrays (S, M), finite. weights: C arrays (M,) or (S, M), 0 where there is no datum.
    start: (5, S): x, w, chart, damping and the largest w; where x is NaN, from the mesh.
    max_steps: after that many evaluations a lane is left as it is, not done.
    nodes: of `mesh_curves` where curves share their angles; of curves with angles of their own
        they are evaluated here.
    mesh: which of `starts.MESHES`.
    """
    groups = start.shape[1] // lanes

    def lanes_last(a: Array) -> Array:
        """(S, M) -> (groups, M, lanes)"""
        return jnp.swapaxes(a.reshape(groups, lanes, a.shape[-1]), -1, -2)

    own: dict[str, Any] = {
        "values": tuple(map(lanes_last, values)),
        "start": start.reshape(-1, groups, lanes).swapaxes(0, 1),
    }
    shared: dict[str, Any] = {}
    for name, a in (("cos_theta", cos_theta), ("s_share", s_share)):
        (own if a.ndim == 2 else shared)[name] = lanes_last(a) if a.ndim == 2 else a[:, None]
    if weights[0].ndim == 2:
        own["weights"] = tuple(map(lanes_last, weights))
    else:
        shared["weights"] = tuple(w[:, None] for w in weights)

    def curves_of(parts: dict[str, Any]) -> Curves:
        return Curves(parts["cos_theta"], parts["s_share"], parts["values"], parts["weights"])

    # Lanes that go on from where they are need no mesh.
    searched = jnp.isnan(start[0]).any()

    def one_group(parts: dict[str, Any]) -> tuple[Array, Array, tuple[Array, ...]]:
        curves = curves_of({**shared, **parts})

        def from_mesh() -> Array:
            own_nodes = nodes or starts.node_curves(curves, channels, mesh)
            return starts.mesh_starts(curves, own_nodes, mesh)

        begin = jax.lax.cond(searched, from_mesh, lambda: starts.no_starts(lanes, mesh))
        solved, at = _solve_lanes(curves, parts["start"], begin[0], max_steps, channels)
        return solved, begin[1:], at if fitted else ()

    solved, further, at = jax.lax.map(one_group, own)
    solved = jnp.moveaxis(solved, 0, 1).reshape(solved.shape[1], -1)
    further = jnp.moveaxis(further, 0, 2).reshape(*further.shape[1:3], -1)
    return solved, further, tuple(jnp.swapaxes(a, 1, 2).reshape(-1, a.shape[1]) for a in at)


solve = compiled(_solve, ("channels", "mesh", "lanes", "fitted"))
