"""A linear function with a transpose that is written out, and with derivatives of both.

`jax.custom_derivatives.linear_call` is the same, but can be neither batched nor differentiated by
what the function is not linear in. Without a written transpose JAX keeps the coefficients of a
linear function for the way back: those of 100 layers at 20,000 points are 320 MB.
"""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jax.core import ShapedArray
from jax.extend.core import Primitive
from jax.interpreters import ad, batching, mlir

_call = Primitive("transposable_call")
_call.multiple_results = True


def transposable(
    function: Callable[[Any, Any], Any],
    transpose: Callable[[Any, Any], Any],
    given: Any,
    linear: Any,
) -> Any:
    """function(given, linear), linear in `linear`; transpose(given, cotangents of the result).

    Both are functions of trees of arrays, and close over no arrays. The transpose returns a tree
    like `linear`.
    """
    leaves, tree = jax.tree.flatten(given)
    linear_leaves, linear_tree = jax.tree.flatten(linear)
    result = jax.tree.structure(jax.eval_shape(function, given, linear))
    count = len(leaves)

    def forward(*flat):
        return jax.tree.leaves(
            function(
                jax.tree.unflatten(tree, flat[:count]),
                jax.tree.unflatten(linear_tree, flat[count:]),
            )
        )

    def backward(*flat):
        cotangents = jax.tree.unflatten(result, flat[count:])
        return jax.tree.leaves(transpose(jax.tree.unflatten(tree, flat[:count]), cotangents))

    flat = _call.bind(*leaves, *linear_leaves, forward=forward, backward=backward, count=count)
    return jax.tree.unflatten(result, flat)


@_call.def_impl
def _evaluate(*flat, forward, backward, count):
    return forward(*flat)


@_call.def_abstract_eval
def _shapes(*flat, forward, backward, count):
    arguments = [jax.ShapeDtypeStruct(z.shape, z.dtype) for z in flat]
    return [ShapedArray(z.shape, z.dtype) for z in jax.eval_shape(forward, *arguments)]


def _jvp(primals, tangents, *, forward, backward, count):
    parameters = {"forward": forward, "backward": backward, "count": count}
    if all(type(z) is ad.Zero for z in tangents[:count]):
        moved = [ad.instantiate_zeros(z) for z in tangents[count:]]
        return _call.bind(*primals, **parameters), _call.bind(
            *primals[:count], *moved, **parameters
        )
    return jax.jvp(forward, tuple(primals), tuple(ad.instantiate_zeros(z) for z in tangents))


def _transpose(cotangents, *flat, forward, backward, count):
    cotangents = [ad.instantiate_zeros(z) for z in cotangents]
    out = backward(*flat[:count], *cotangents)
    # An argument that is known although it is linear is the zero tangent of a constant.
    wanted = [ad.is_undefined_primal(z) for z in flat[count:]]
    return [None] * count + [z if yes else None for z, yes in zip(out, wanted, strict=True)]


def _batch(flat, axes, *, forward, backward, count):
    (size,) = {z.shape[axis] for z, axis in zip(flat, axes, strict=True) if axis is not None}
    linear = [
        jnp.broadcast_to(z, (size, *z.shape)) if axis is None else jnp.moveaxis(z, axis, 0)
        for z, axis in zip(flat[count:], axes[count:], strict=True)
    ]
    given = tuple(axes[:count])

    def of_all(function):
        def mapped(*flat):
            return jax.vmap(function, (*given, *(0,) * (len(flat) - count)))(*flat)

        return mapped

    parameters = {"forward": of_all(forward), "backward": of_all(backward), "count": count}
    out = _call.bind(*flat[:count], *linear, **parameters)
    return out, [0] * len(out)


ad.primitive_jvps[_call] = _jvp
ad.primitive_transposes[_call] = _transpose
batching.primitive_batchers[_call] = _batch
mlir.register_lowering(_call, mlir.lower_fun(_evaluate, multiple_results=True))
