"""What keeps XLA's compiler from undoing or repeating arithmetic; none of it changes a value.

Its CPU compiler has no loops with several outputs: it fuses a cheap producer into the loop of every
consumer, so that R, dR/dn and dR/dk would each repeat all exact sums (measured: 996 instructions a
point instead of 476). Only divisions and roots are never repeated, and an optimization barrier is
gone before fusion. Hence `computed_once`, and a quotient here and there where a product with the
reciprocal would do.
"""

from __future__ import annotations

import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, ArrayLike, Float


def computed_once(x: Array) -> Array:
    """x, divided by a one that the compiler cannot see through; exact."""
    return x / jnp.where(x == x, 1.0, 2.0)


def opaque(x: Array) -> Array:
    """x itself, but never a compile-time constant.

    XLA rewrites (x + 1) - 1 as x when both ones are constants, which turns the rounding errors of
    `arithmetic` into 0: for an eta closed over by a jitted function T lost all digits near grazing
    incidence at index match. What enters exact sums and products passes through here first.
    """
    return lax.optimization_barrier(x)


def fenced(x: ArrayLike) -> Float[Array, "..."]:
    """x unchanged, as an argument that keeps a sum under `jax.jit` fast on the CPU.

        loss = jnp.mean(fenced(weights * residual**2))

    XLA's CPU compiler hands the last products and sums before a reduction to another library, which
    splits the loop that computes x in two: a summed loss then takes 1.8 to 3.5 times the time of x
    alone, its gradient 1.5 times. With `fenced`, which that library does not take, it is 1.1 and
    1.2 times (docs/losses.md).

    Args:
        x: floats, shape (...).

    Returns:
        x, exactly, of its shape and dtype. Its derivative is fenced as well.
    """
    x = jnp.asarray(x)
    info = jnp.finfo(x.dtype)
    return lax.reduce_precision(x, info.nexp, info.nmant)
