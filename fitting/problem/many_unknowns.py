"""Damped normal equations of many unknowns in every lane, by LAPACK; `solver` unrolls them.

For up to half a dozen unknowns an unrolled Cholesky factor is the fastest. Its program grows as
p^3: for 12 unknowns (three oscillators) it takes 6.8 s to compile. The calls of LAPACK compile in
.6 s for any number of them; 64 lanes of 16 unknowns take .7 ms.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jax import Array

# Added to the diagonal of unit length, where rounding would leave a pivot below 0: of thousands of
# singular matrices of 7 to 80 unknowns no factor failed with it, a fifth of those of 16 with 1e-15.
LEAST_PIVOT = 1e-14


def solve_lanes(matrix: Array, rhs: Array, free: Array) -> Array:
    """Return x with ``matrix x = rhs`` in each lane over the ``free`` unknowns, 0 for the others.

    matrix (p, p, L), rhs and free (p, L).
    """
    diagonal = jnp.where(free, jnp.einsum("iil->il", matrix), 0.0)
    size = jnp.where(diagonal > 0.0, jax.lax.rsqrt(jnp.where(diagonal > 0.0, diagonal, 1.0)), 1.0)
    unit = jnp.where(free[:, None] & free[None], matrix, 0.0) * size[:, None] * size[None]
    on_diagonal = jnp.eye(len(rhs), dtype=bool)
    lanes_first = jnp.where(on_diagonal, 1.0 + LEAST_PIVOT, jnp.moveaxis(unit, -1, 0))
    factor = jnp.linalg.cholesky(lanes_first, symmetrize_input=False)
    x = jnp.where(free, rhs * size, 0.0).T[..., None]
    for transposed in (False, True):
        x = jax.lax.linalg.triangular_solve(
            factor, x, left_side=True, lower=True, transpose_a=transposed
        )
    return x[..., 0].T * size
