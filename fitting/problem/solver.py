"""Levenberg-Marquardt for many small least-squares problems at once, as an optimistix solver.

optimistix solves one problem; under ``vmap`` every lane takes as long as the slowest one, and the
Jacobian is written to memory (about 250 fits a second for 60 angles, s and p, slower than scipy one
at a time). Here the unknowns of all lanes are one array y of shape (p, L) and the residual function
works on all lanes at once, so the normal equations (p (p + 1) / 2 + p + 1 numbers a lane) come from
p Jacobian-vector products in one pass, and are solved in closed form.

Each lane has its own damping and ends by itself, when the undamped step of its linear model gains
next to nothing: less than ``rtol`` of a standard error, less than the rounding of the cost, or less
than the rounding of the data. This is tested after a rejected step too, since at the level of
rounding no step is accepted (right answers would otherwise run to ``max_steps``).

Bounds: a lane on a bound whose gradient points outwards keeps that unknown fixed; a step that would
cross a bound is cut there, and the other unknowns are solved again with it fixed, so that the lane
moves along the bound.

Marquardt's scaling: D. W. Marquardt, J. SIAM 11, 431 (1963), doi:10.1137/0111030, with the largest
diagonal that a lane has met: J. J. More, Lecture Notes in Mathematics 630, 105 (1978). Where the
data do not change with an unknown, as R does not with n at n^2 = 1 + k^2, its own diagonal would
not damp it; such a lane went to and fro, and crept along its valley. Gain ratio and bounds: J.
Nocedal and S. J. Wright, *Numerical Optimization* (2006), sections 10.3 and 16.7.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jax import Array
from jaxtyping import PyTree

# A pivot below so many eps of its diagonal is rounding (the data do not distinguish two unknowns);
# it is raised to that, which keeps the step finite.
_LEAST_PIVOT = 64.0
# XLA ends the process when it compiles a `lax.reduce` of a thousand operands, those of 44 unknowns.
_MOST_SUMS = 900
START_DAMPING = 1e-3
# The bend of a step is solved for with at least this damping, since along the valley it is not
# known; and none is taken that is longer than this part of the step.
_BEND_DAMPING, _LONGEST_BEND = 0.1, 0.5


# Below this part of the sum of squares of the data no misfit is noise, and so much less of a
# "standard error" is then the end of a lane.
NO_NOISE, _WITHOUT_NOISE = 1e-12, 1e-6


class BatchState(NamedTuple):
    """State of a batch: the sums at y, and the next step that follows from them.

    sums: as `normal_sums` has them, (p + 1, p + 1, L). scale: of the damping, (p, L). trial,
    promised: the damped step (p, L) and the decrease of the cost by the linear model (L,). full:
    the same step without damping. done, damping, evaluations: (L,). steps: ().
    """

    sums: Array
    scale: Array
    damping: Array
    trial: Array
    promised: Array
    full: Array
    done: Array
    evaluations: Array
    steps: Array


def normal_sums(fn: Callable, y: Array, args: PyTree) -> Array:
    """Return [r, J]^T [r, J] of residuals r and derivatives J of every lane, (p + 1, p + 1, L).

    ``fn(y, args)`` gives a pytree of (..., L) arrays of one shape, and None.

    There is one linearisation, since the compiler would compute the values again for each jvp (1.6
    times the time), and one ``lax.reduce`` of several operands, in which the last products and all
    sums run in registers (separate sums take 1.2 to 2 times the time, a loop over angles twice, and
    so does the matrix product of 13 unknowns; of 40 it takes 1.3 times the time).
    """
    p = y.shape[0]
    (residual, _), along = jax.linearize(lambda z: fn(z, args), y)
    columns = [along(jnp.zeros_like(y).at[j].set(1.0))[0] for j in range(p)]
    together = list(zip(*map(jax.tree.leaves, [residual, *columns]), strict=True))
    first, second = np.triu_indices(p + 1)
    if len(first) > _MOST_SUMS:
        rows = [jnp.stack(leaves).reshape(p + 1, -1, y.shape[1]) for leaves in together]
        whole = jnp.concatenate(rows, 1)
        return jnp.einsum("pml,qml->pql", whole, whole)
    products: list[Array] = []
    for leaves in together:
        of_leaf = [leaves[i] * leaves[j] for i, j in zip(first, second, strict=True)]
        products = add(products, of_leaf) if products else of_leaf
    zero = [jnp.zeros((), y.dtype)] * len(products)
    sums = jnp.stack(jax.lax.reduce(products, zero, add, range(products[0].ndim - 1)))
    place = np.zeros((p + 1, p + 1), int)
    place[first, second] = place[second, first] = np.arange(len(first))
    return sums[place]


def add(a: Sequence[Array], b: Sequence[Array]) -> list[Array]:
    """Return the sums of two lists of arrays, as `jax.lax.reduce` asks for them."""
    return [u + v for u, v in zip(a, b, strict=True)]


@jax.jit  # traced and lowered once for all uses
def solve_lanes(matrix: Array, rhs: Array, free: Array) -> Array:
    """Return x with ``matrix x = rhs`` in each lane over the ``free`` unknowns, 0 for the others.

    matrix (p, p, L), rhs and free (p, L). Cholesky in a loop, whose program takes .15 s to compile
    for any number of unknowns; unrolled it takes 1 s for four unknowns, 7 s for twelve. Not LAPACK:
    jaxlib 0.10.2 divides its calls among the threads of XLA and waits for them, so that two fits of
    more than 20 unknowns side by side wait for each other forever.
    """
    p = len(rhs)
    diagonal = jnp.where(free, jnp.einsum("iil->il", matrix), 0.0)
    size = jnp.where(diagonal > 0.0, jax.lax.rsqrt(jnp.where(diagonal > 0.0, diagonal, 1.0)), 1.0)
    unit = jnp.where(free[:, None] & free[None], matrix, 0.0) * size[:, None] * size[None]
    unit = jnp.where(jnp.eye(p, dtype=bool)[..., None], 1.0, unit)
    rows = jnp.concatenate([unit, jnp.where(free, rhs * size, 0.0)[:, None]], 1)
    least = _LEAST_PIVOT * jnp.finfo(rows.dtype).eps
    column = jnp.arange(p + 1)[:, None]

    def eliminated(j: Array, rows: Array) -> Array:
        pivot = jnp.maximum(rows[j, j], least)
        row = jnp.where(column > j, rows[j], jnp.where(column == j, pivot, 0.0))
        row = row * jax.lax.rsqrt(pivot)
        below = jnp.where(column[:p] > j, row[:p], 0.0)
        return (rows - below[:, None] * row).at[j].set(row)

    def substituted(i: Array, x: Array) -> Array:
        j = p - 1 - i
        row = jnp.where(column[:p] > j, factor[j, :p], 0.0)
        return x.at[j].set((x[j] - (row * x).sum(0)) / factor[j, j])

    factor = jax.lax.fori_loop(0, p, eliminated, rows)
    return jax.lax.fori_loop(0, p, substituted, factor[:, p]) * size


def bounded_step(
    y: Array, sums: Array, lower: Array, upper: Array, damping: Array
) -> tuple[Array, Array]:
    """Return the damped step within the bounds, and the decrease of the cost by the model.

    damping: (p, L), of the diagonal.
    """
    gradient, matrix = sums[0, 1:], sums[1:, 1:]
    damped = matrix + jnp.eye(len(y), dtype=y.dtype)[:, :, None] * damping

    def out_of(step: Array) -> Array:
        return ((y <= lower) & (step < 0.0)) | ((y >= upper) & (step > 0.0))

    def fall_of(step: Array) -> Array:
        return -((2.0 * gradient + (matrix * step[None]).sum(1)) * step).sum(0)

    # An unknown on a bound that would move outwards, by itself or by the others, is left out.
    free = ~out_of(-gradient)
    free &= ~out_of(solve_lanes(damped, -gradient, free))
    step = solve_lanes(damped, -gradient, free)
    # The step to the bound, with the best step of the others there: nearly always the better one,
    # except if two bounds are crossed.
    cut = (y + step < lower) | (y + step > upper)
    held = jnp.where(cut, jnp.clip(y + step, lower, upper) - y, 0.0)
    pulled = gradient + (damped * held[None]).sum(1)
    along = held + solve_lanes(damped, -pulled, free & ~cut)
    # The whole step cut at the first bound always lowers the cost.
    ahead = jnp.where(step > 0.0, upper - y, lower - y)
    room = jnp.where(step == 0.0, jnp.inf, ahead / jnp.where(step == 0.0, 1.0, step))
    short = step * jnp.minimum(room.min(0), 1.0)
    along = jnp.clip(y + along, lower, upper) - y
    gain_short, gain_along = fall_of(short), fall_of(along)
    better = gain_along >= gain_short
    return jnp.where(better, along, short), jnp.where(better, gain_along, gain_short)


def bent(before: Array, after: Array, move: Array, step: Array, damping: Array) -> Array:
    """Return the step (p, L), bent as the valley is in which the last move led.

    Geodesic acceleration: M. K. Transtrum and J. P. Sethna, arXiv:1201.5885. The second derivative
    of the residuals r along the move d that it needs, J^T r'' = J^T (dJ) d, follows from the normal
    matrices before and after the move, (A' - A) d, but for what is small across a narrow valley.
    """
    matrix = after[1:, 1:]
    bend = ((matrix - before[1:, 1:]) * move[None]).sum(1)
    scale = jnp.einsum("iil->il", matrix)

    def product(a: Array, b: Array) -> Array:
        return (scale * a * b).sum(0)

    # The next step is so many times the last one.
    times = product(move, step) / jnp.where(product(move, move) > 0.0, product(move, move), 1.0)
    damped = matrix * (1.0 + jnp.eye(len(step))[:, :, None] * jnp.maximum(damping, _BEND_DAMPING))
    aside = -0.5 * times**2 * solve_lanes(damped, bend, step != 0.0)
    short = product(aside, aside) <= _LONGEST_BEND**2 * product(step, step)
    return step + jnp.where(short, aside, 0.0)


class BatchLevenbergMarquardt(optx.AbstractLeastSquaresSolver):
    """Levenberg-Marquardt on a batch: y is (p, L), every residual array ends in the L lanes.

    rtol: a lane is done when its undamped step is below this many standard errors (0.01).
    atol: or when the expected decrease is below atol^2 times options["scale"]; the scale is the sum
        of squares of the data, so that an atol of one eps is the rounding of the data.
    norm: part of optimistix's interface, not used.

    ``options``: "lower", "upper" (p, L) bounds; "degrees" (L,), data minus unknowns, at least 1;
    "scale" (L,); "max_steps" (), a traced number, after which the remaining lanes stop (not done);
    "damping" (L,), START_DAMPING if absent; "enough", the share of lanes that, once done, ends the
    call (1). Statistics of the solution: "cost", "damping", "done", "evaluations", and "step", the
    last undamped step, not taken.
    """

    rtol: float = 0.01
    atol: float = 2.0**-52
    norm: Callable[[PyTree], Any] = optx.max_norm

    def _nothing(self, cost: Array, options: dict[str, Any]) -> Array:
        """Return the decrease of each lane's cost that is too small for another evaluation."""
        # A misfit that is no noise tells no error: data without noise lie at the end of a valley.
        of_errors = jnp.where(cost < NO_NOISE * options["scale"], _WITHOUT_NOISE, 1.0)
        enough = of_errors * self.rtol**2 / options["degrees"] + 32.0 * jnp.finfo(cost.dtype).eps
        return enough * cost + self.atol**2 * options["scale"]

    def init(self, fn, y, args, options, f_struct, aux_struct, tags):
        """Return the state before the start is evaluated, which the first step does.

        With an infinite cost and no gradient that step is zero and accepted, so that the program
        contains the residual function once and not twice (half a second to compile).
        """
        del fn, args, f_struct, aux_struct, tags
        p, none = y.shape[0], jnp.zeros_like(y[0])
        sums = jnp.zeros((p + 1, p + 1, *none.shape), y.dtype).at[0, 0].set(jnp.inf)
        damping = options.get("damping", none + START_DAMPING)
        count, zero = jnp.zeros(none.shape, jnp.int32), jnp.zeros_like(y)
        return BatchState(sums, zero, damping, zero, none, zero, none > 0.0, count, jnp.array(0))

    def step(self, fn, y, args, options, state, tags):
        """Return (y, state) after one trial step of every lane that is not done."""
        del tags
        lower, upper = options["lower"], options["upper"]
        trial = jnp.where(state.done, y, jnp.clip(y + state.trial, lower, upper))
        sums = normal_sums(fn, trial, args)
        fell = state.sums[0, 0] - sums[0, 0]
        better = (fell > 0.0) & ~state.done
        gain = fell / jnp.where(state.promised > 0.0, state.promised, 1.0)
        # With a good model (gain near 1) damping falls fast, so that 3 or 4 evaluations suffice.
        eased = state.damping * jnp.where(gain > 0.75, 0.1, jnp.where(gain > 0.25, 0.5, 2.0))
        refused = jnp.maximum(state.damping, 1e-6) * 8.0
        keep = state.done | (better & (state.evaluations == 0))
        damping = jnp.where(keep, state.damping, jnp.where(better, eased, refused))
        before, move = state.sums, trial - y
        y = jnp.where(better, trial, y)
        sums = jnp.where(better, sums, state.sums)
        # The damped and the full step are one call, side by side: half the code to compile.
        twice = [jnp.concatenate([a, a], -1) for a in (y, sums, lower, upper)]
        scale = jnp.maximum(state.scale, jnp.einsum("iil->il", sums[1:, 1:]))
        both = jnp.concatenate([scale * damping, jnp.zeros_like(scale)], -1)
        step, falls = bounded_step(twice[0], twice[1], twice[2], twice[3], both)
        lanes = y.shape[1]
        promised, fall = falls[:lanes], falls[lanes:]
        cost = sums[0, 0]
        nothing = self._nothing(cost, options)
        # Or the step is refused and damped until it gains nothing, since no neighbour has a lower
        # cost; or the start has no finite cost.
        ended = (fall <= nothing) | (~better & (promised <= nothing)) | ~jnp.isfinite(cost)
        ahead = jnp.where(
            better & (state.evaluations > 0),
            bent(before, sums, move, step[:, :lanes], damping),
            step[:, :lanes],
        )
        evaluations = state.evaluations + jnp.where(state.done, 0, 1).astype(jnp.int32)
        done, full = state.done | ended, step[:, lanes:]
        after = BatchState(
            sums, scale, damping, ahead, promised, full, done, evaluations, state.steps + 1
        )  # fmt: skip
        return y, after, None

    def terminate(self, fn, y, args, options, state, tags):
        """Return whether enough lanes are done or the steps are used up, and success."""
        del fn, y, args, tags
        enough = options.get("enough", 1.0) * state.done.size
        over = (state.done.sum() >= enough) | (state.steps >= options["max_steps"])
        return over, optx.RESULTS.successful

    def postprocess(self, fn, y, aux, args, options, state, tags, result):
        """Return y, and in the statistics the state of every lane with the step not taken."""
        del fn, args, tags, result, options
        stats = {
            "cost": state.sums[0, 0],
            "damping": state.damping,
            "done": state.done,
            "evaluations": state.evaluations,
            "step": state.full,
        }
        return y, aux, stats
