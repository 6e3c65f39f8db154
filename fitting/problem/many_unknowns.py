"""Damped normal equations of many unknowns in every lane, by a loop; `solver` unrolls them.

For up to half a dozen unknowns an unrolled Cholesky factor is the fastest and compiles in a second.
Its program grows as p^3: for 12 unknowns (three oscillators) it takes 6.8 s to compile, this form
3.2 s; this form is a fifth slower per iteration.
"""

from __future__ import annotations

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jax import Array


def solve_lanes(matrix: Array, rhs: Array, free: Array) -> Array:
    """Return x with ``matrix x = rhs`` in each lane over the ``free`` unknowns, 0 for the others.

    matrix (p, p, L), rhs and free (p, L). Cholesky as in `solver.solve_lanes`, with pivots raised
    to 1e-15 of their diagonal.
    """
    p = rhs.shape[0]
    both = free[:, None] & free[None]
    unit = jnp.eye(p, dtype=rhs.dtype)[:, :, None]
    a = jnp.where(both, matrix, 0.0)
    diagonal = jnp.einsum("iil->il", a)
    diagonal = jnp.where(diagonal > 0.0, diagonal, 1.0)
    a = jnp.where(unit > 0.0, diagonal[None], a)
    right = jnp.where(free, rhs, 0.0)

    def eliminate(j, carry):
        # The right side is one more row, so that it comes out as the forward solution.
        a, right, factor, inverse, z = carry
        scale = jax.lax.rsqrt(jnp.maximum(a[j, j], 1e-15 * diagonal[j]))
        column = jnp.where((jnp.arange(p) > j)[:, None], a[:, j] * scale, 0.0)
        z_j = right[j] * scale
        return (
            a - column[:, None] * column[None],
            right - column * z_j,
            factor.at[j].set(column),
            inverse.at[j].set(scale),
            z.at[j].set(z_j),
        )

    none = jnp.zeros_like(rhs)
    *_, factor, inverse, z = jax.lax.fori_loop(
        0, p, eliminate, (a, right, jnp.zeros_like(a), none, none)
    )

    def substitute(i, x):
        j = p - 1 - i
        return x.at[j].set((z[j] - (factor[j] * x).sum(0)) * inverse[j])

    x = jax.lax.fori_loop(0, p, substitute, none)
    return jnp.where(free, x, 0.0)


def two_steps(
    damped: Array, gradient: Array, y: Array, lower: Array, upper: Array, out_of: Callable
) -> tuple[Array, Array]:
    """Return the two steps of `solver.bounded_step`, its three solutions in a loop.

    The first solution finds which unknowns are left out, the second one is the step, the third one
    is the step of the others where it is cut at a bound. As a loop it compiles in .8 s instead of
    1.4 s for 16 unknowns.
    """

    def solved(i: Array, carry: tuple[Array, ...]) -> tuple[Array, ...]:
        free, held, step, _ = carry
        by_held = jnp.where(held[None] == 0.0, 0.0, damped * held[None]).sum(1)
        found = solve_lanes(damped, -gradient - by_held, free)
        step = jnp.where(i == 1, found, step)
        cut = (i == 1) & ((y + step < lower) | (y + step > upper))
        free = free & jnp.where(i == 0, ~out_of(found), ~cut)
        return free, jnp.where(cut, jnp.clip(y + step, lower, upper) - y, 0.0), step, held + found

    none = jnp.zeros_like(y)
    *_, step, along = jax.lax.fori_loop(0, 3, solved, (~out_of(-gradient), none, none, none))
    return step, along
