"""The iterations that take lanes from their starts to their minima, in either chart."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from fitting.bare_surface import coordinates as co
from fitting.bare_surface.reflectances import (
    Curves,
    Residuals,
    count_and_scale,
    model,
    sums_of_squares,
)
from fitting.problem.solver import (
    START_DAMPING,
    BatchLevenbergMarquardt,
    BatchState,
    normal_sums,
    unpack,
)

SOLVER = BatchLevenbergMarquardt()


class Solved(NamedTuple):
    """The result of the program, each (L,)."""

    x: Any
    w: Any
    chart: Any
    cost: Any  # weighted sum of squares
    plain: Any  # the same without weights
    together: Any  # squares of the sums of a few residuals side by side, with weights
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


# The row of each number in an array (fields, L) of them.
ROW = Solved(*range(len(Solved._fields)))


def _last_step(
    curves: Curves,
    chart: Array,
    best: Array,
    trial: Array,
    allowed: Array,
    channels: tuple[str, ...],
) -> tuple[Array, ...]:
    """Return ``trial``, in lanes where its cost is above ``allowed`` ``best``, and the sums there.

    A loop that runs once, or twice when a lane steps back: one copy of the model in the program.
    """

    def body(carry):
        y, *_, runs = carry
        found = model(curves, y[0], y[1], chart, channels)
        sums = sums_of_squares(curves, found)
        worse = ~(sums[0] <= allowed) & (y != best).any(0)
        return jnp.where(worse, best, y), sums, worse.any(), runs + 1

    none = jnp.zeros_like(allowed)
    # The count ends the loop for NaN, which is unequal to itself and would step back for ever.
    y, sums, *_ = jax.lax.while_loop(
        lambda carry: carry[2] & (carry[3] < 2),
        body,
        (trial, (none, none, none), jnp.array(True), jnp.array(0)),
    )
    return y, *sums


def descend(
    curves: Curves,
    start: Array,
    most: tuple[Array, Array],
    near: Array,
    channels: tuple[str, ...],
) -> Array:
    """Return ``Solved`` of L lanes as one (fields, L) array.

    start: (5, L): x, w, chart, damping and the largest w. most: (L,) evaluations, and evaluations
    of lanes whose cost is then less than ``near``.
    """
    x, w, chart, damping, w_max = start
    y = jnp.stack([x, jnp.minimum(w, w_max)])
    by_eps = chart == co.EPS
    low, high = co.EPS_BOUNDS
    lower = jnp.stack([jnp.where(by_eps, low[0], co.X_MIN), jnp.where(by_eps, low[1], co.W_MIN)])
    upper = jnp.stack([jnp.where(by_eps, high[0], co.X_MAX), jnp.where(by_eps, high[1], w_max)])
    count, scale = count_and_scale(curves)
    degrees = jnp.maximum(count - 2, 1)
    options = {"lower": lower, "upper": upper, "degrees": degrees, "scale": scale}
    residuals = Residuals(channels)

    def under_way(state: BatchState) -> Array:
        goes_on = (state.evaluations < most[1]) & (state.sums[0] < near)
        return ~state.done & ((state.evaluations < most[0]) | goes_on)

    def step(carry):
        y, state = carry
        moving = under_way(state)
        # A lane that has reached its limit is not moved, whether or not it has converged.
        resting = state._replace(done=~moving)
        trial = SOLVER.next_trial(y, options, resting)
        sums = normal_sums(lambda z, _: (residuals(z, (curves, chart)), None), trial, None)
        y, new = SOLVER.advanced(y, trial, sums, options, resting)
        return y, new._replace(done=jnp.where(moving, new.done, state.done))

    value, state = jax.lax.while_loop(
        lambda carry: under_way(carry[1]).any(), step, (y, SOLVER.begun(y, damping))
    )
    cost_before, gradient, matrix = unpack(state.sums, 2)
    # The undamped step at the end promised less than a hundredth of a standard error, and so was
    # not worth an evaluation of derivatives; taken all the same it squares the error that is left.
    trial = jnp.clip(value + jnp.where(state.done, state.full, 0.0), lower, upper)
    allowed = cost_before * (1.0 + 1e-6) + 4.0 * SOLVER.atol**2 * scale
    last, cost, plain, together = _last_step(curves, chart, value, trial, allowed, channels)
    gradient = gradient + (matrix * (last - value)[None]).sum(1)
    solved = (
        last[0], last[1], chart, cost, plain, together, state.done & jnp.isfinite(cost),
        state.evaluations, state.damping, count, scale,
        gradient[0], gradient[1], matrix[0, 0], matrix[0, 1], matrix[1, 1],
    )  # fmt: skip
    fields = Solved(*(a.astype(y.dtype) for a in solved))
    return jnp.stack(fields)


def at_far_end(x: Any, w: Any, xp: Any = np) -> Any:
    """Where k = 0 was reached at the end of the line that the chart does not measure from."""
    return w >= 4.0 * co.xi_of(x, xp) * (1.0 - 64.0 * co.FAR_END)


def descend_in_both_charts(
    curves: Curves,
    start: Array,
    most: tuple[Array, Array],
    near: Array,
    turned: Array,
    channels: tuple[str, ...],
) -> Array:
    """Return what `descend` does, once more for lanes that came to the far end of their chart.

    These go on in the other one, for up to ``turned`` evaluations; the others stay where they are.
    """
    lanes = start.shape[1]

    def body(carry):
        begin, solved, again, most, runs = carry
        new = descend(curves, begin, most, near, channels)
        new = new.at[ROW.evaluations].add(jnp.where(runs > 0, solved[ROW.evaluations], 0.0))
        solved = jnp.where(again, new, solved)
        s = Solved(*solved)
        again = at_far_end(s.x, s.w, jnp) & (turned > 0)
        other = jnp.stack([
            s.x, jnp.full(lanes, co.W_MIN), -s.chart, jnp.full(lanes, START_DAMPING), begin[4]
        ])  # fmt: skip
        some = jnp.where(again, turned, 0)
        return other, solved, again, (some, some), runs + 1

    none = jnp.zeros((len(Solved._fields), lanes))
    every = tuple(jnp.broadcast_to(m, (lanes,)) for m in most)
    begin = (start, none, jnp.ones(lanes, bool), every, jnp.array(0))
    _, solved, *_ = jax.lax.while_loop(lambda carry: carry[2].any() & (carry[4] < 2), body, begin)
    return solved
