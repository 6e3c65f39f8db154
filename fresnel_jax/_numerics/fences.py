"""Fences: what keeps the compiler, XLA and LLVM, from undoing or repeating arithmetic.

None of them changes a value, and none would be needed with a better compiler: test_fences.py has
one test for each that says with which versions of jaxlib the defect was seen, and fails with one
that no longer has it.

XLA's CPU compiler has no loops with several outputs: it fuses a cheap producer into the loop of
every consumer, so that R, dR/dn and dR/dk would each repeat all exact sums (measured: 996
instructions a point instead of 476). Only divisions and roots are never repeated, and before
jaxlib 0.11 an optimization barrier is gone before fusion. Hence `computed_once`, and a quotient
here and there where a product with the reciprocal would do.
"""

from __future__ import annotations

import jax.numpy as jnp
import jaxlib.version
from jax import lax
from jaxtyping import Array, ArrayLike, Float


def hidden_one(x: Array) -> Array:
    """A one that the compiler cannot see through (a 2 where x is NaN, which stays NaN)."""
    return jnp.where(x == x, 1.0, 2.0)


def computed_once(x: Array) -> Array:
    """x, exactly, but not computed again for every result that is made of it.

        cosine = computed_once(jnp.cos(jnp.radians(angle_deg)))

    XLA's CPU compiler repeats what stands before a loop in every loop behind it, except for
    divisions and roots: the cosine of the angle of incidence was formed 18 times in the program of
    a film, a third of its time. This is x divided by a one that the compiler cannot see through.
    Put it around what is costly and read by several results; it costs a division. A result that
    divides x once more computes it anew: of (a / b) / c XLA makes a / (b c).

    Args:
        x: floats, shape (...).

    Returns:
        x, exactly, of its shape and dtype; its derivative is that of x, and computed once as well.
    """
    return x / hidden_one(x)


# Up to 0.11 XLA merges constants that are added one after the other.
_MERGES_CONSTANTS = jaxlib.version.__version_info__ < (0, 12)


def opaque(x: Array) -> Array:
    """x itself, but never a constant that the compiler merges with others.

    XLA up to 0.11 rewrites (x + 1) - 1 as x when both ones are constants, which turns the rounding
    errors of `arithmetic` into 0: for an eta closed over by a jitted function T lost all digits
    near grazing incidence at index match. What enters exact sums and products passes through here
    first. From 0.12 on it does not, and there the barrier would cost `reflectance` a third to a
    half of its speed, since each is an array in memory.
    """
    return lax.optimization_barrier(x) if _MERGES_CONSTANTS else x


def rounded(x: Array) -> Array:
    """x itself, but never the unrounded product that it stands for.

    LLVM contracts x y + z to a fused multiply-add where the product has no other use in the loop.
    High and low word are computed in loops of their own, so that one saw the rounded product and
    the other did not: squares of double words were wrong by an eps. A select cannot be contracted;
    reduce_precision, minima and bit casts were seen to be.
    """
    return jnp.where(x == x, x, jnp.inf)


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
