"""A fence between elementwise arithmetic and a sum."""

from __future__ import annotations

import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, ArrayLike, Float


def fenced(x: ArrayLike) -> Float[Array, "..."]:
    """x itself, kept in one loop with what computes it: for what is summed under `jax.jit`.

        loss = jnp.mean(fenced(weights * residual**2))

    XLA's CPU compiler hands the last products and sums before a reduction to another library, which
    tears the one loop of a kernel apart (measured: a summed loss took 1.8 to 3.5 times the kernel,
    its gradient 1.5 times; with this 1.1 and 1.2). That library does not take this operation.
    docs/losses.md has the measurements.

    Args: `x`: floats, shape (...). Returns x, exactly; its derivative is fenced likewise.
    """
    x = jnp.asarray(x)
    info = jnp.finfo(x.dtype)
    return lax.reduce_precision(x, info.nexp, info.nmant)
