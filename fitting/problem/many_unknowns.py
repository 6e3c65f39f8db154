"""Damped normal equations of many unknowns in every lane, in a loop; `solver` unrolls it for few.

For up to half a dozen unknowns an unrolled Cholesky factor is the fastest. Its program grows as
p^3: for 12 unknowns (three oscillators) it takes 6.8 s to compile. The loop takes .15 s for any
number of them; 64 lanes of 16 unknowns take .1 ms, as much as LAPACK.

Not LAPACK: jaxlib 0.10.2 divides its calls among the threads of XLA and waits for them, so that two
fits of more than 20 unknowns side by side wait for each other forever.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jax import Array

# A pivot below so many eps of its diagonal is rounding; it is raised to that.
_LEAST_PIVOT = 64.0


def solve_lanes(matrix: Array, rhs: Array, free: Array) -> Array:
    """Return x with ``matrix x = rhs`` in each lane over the ``free`` unknowns, 0 for the others.

    matrix (p, p, L), rhs and free (p, L).
    """
    diagonal = jnp.where(free, jnp.einsum("iil->il", matrix), 0.0)
    size = jnp.where(diagonal > 0.0, jax.lax.rsqrt(jnp.where(diagonal > 0.0, diagonal, 1.0)), 1.0)
    unit = jnp.where(free[:, None] & free[None], matrix, 0.0) * size[:, None] * size[None]
    on_diagonal = jnp.eye(len(rhs), dtype=bool)[..., None]
    right = jnp.where(free, rhs * size, 0.0)
    rows = jnp.concatenate([jnp.where(on_diagonal, 1.0, unit), right[:, None]], 1)
    return _solved(rows) * size


def _solved(rows: Array) -> Array:
    """Return x (p, L) of positive matrices of unit diagonal, beside their right hand sides.

    rows: (p, p + 1, L).
    """
    p, least = len(rows), _LEAST_PIVOT * jnp.finfo(rows.dtype).eps
    column = jnp.arange(p + 1)[:, None]

    def eliminated(j: Array, rows: Array) -> Array:
        pivot = jnp.maximum(rows[j, j], least)
        row = jnp.where(column > j, rows[j], jnp.where(column == j, pivot, 0.0))
        row = row * jax.lax.rsqrt(pivot)
        below = jnp.where(column[:p] > j, row[:p], 0.0)
        return (rows - below[:, None] * row).at[j].set(row)

    def found(i: Array, x: Array) -> Array:
        j = p - 1 - i
        row = jnp.where(column[:p] > j, factor[j, :p], 0.0)
        return x.at[j].set((x[j] - (row * x).sum(0)) / factor[j, j])

    factor = jax.lax.fori_loop(0, p, eliminated, rows)
    return jax.lax.fori_loop(0, p, found, factor[:, p])
