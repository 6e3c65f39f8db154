"""Derivatives of an elementwise function of few arguments, in many directions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jax.custom_derivatives import SymbolicZero


def by_partial_derivatives(f: Callable, args: Any, directions: int) -> Any:
    """Return ``f(*args)``, f elementwise, for derivatives in this number of directions.

    If fewer arguments vary than there are directions, a derivative is a sum over partial
    derivatives, which are formed once, instead of evaluating f along each direction. (A film with
    four oscillators, 14 directions, 3 arguments, 491 wavelengths: 45 ms instead of 119.)
    """

    def derivatives(primals: Any, tangents: Any) -> tuple[Any, Any]:
        flat, tree = jax.tree.flatten(primals)
        along = jax.tree.leaves(tangents, is_leaf=_is_zero)
        moving = [i for i, t in enumerate(along) if not _is_zero(t)]

        def of_moving(*some: Any) -> Any:
            whole = list(flat)
            for i, x in zip(moving, some, strict=True):
                whole[i] = x
            return f(*jax.tree.unflatten(tree, whole))

        at, steps = [flat[i] for i in moving], [along[i] for i in moving]
        if len(moving) >= directions:
            return jax.jvp(of_moving, at, steps)
        out, slope = jax.linearize(of_moving, *at)
        total = jax.tree.map(jnp.zeros_like, out)
        for i, step in enumerate(steps):
            ones = [jnp.ones_like(x) if j == i else jnp.zeros_like(x) for j, x in enumerate(at)]
            partial = slope(*ones)
            total = jax.tree.map(lambda t, d, step=step: t + d * step, total, partial)
        return out, total

    g = jax.custom_jvp(f)
    g.defjvp(derivatives, symbolic_zeros=True)
    return g(*args)


def _is_zero(x: Any) -> bool:
    return isinstance(x, SymbolicZero)
