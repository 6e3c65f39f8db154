"""Three-vectors as three arrays.

A public direction is an array of shape (..., 3). Inside, its components stay apart: XLA fuses
elementwise work on three arrays into one vectorised loop, and breaks the loop at every sum over an
axis of length 3.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike

from .arguments import as_float
from .arithmetic import one_if_zero, sum_exactly, two_product
from .fences import computed_once, opaque


class Vector(NamedTuple):
    """Components that broadcast against each other."""

    x: Array
    y: Array
    z: Array


def components(v: ArrayLike, name: str) -> Vector:
    """The components of an array of shape (..., 3); ValueError, with `name`, for other shapes."""
    v = as_float(v, name)
    if v.ndim == 0 or v.shape[-1] != 3:
        raise ValueError(
            f"{name} has shape {v.shape}; wanted (..., 3), a direction along the last axis."
        )
    return Vector(v[..., 0], v[..., 1], v[..., 2])


def stack(v: Vector) -> Array:
    """The array of shape (..., 3) with these components."""
    return jnp.stack(jnp.broadcast_arrays(*v), axis=-1)


def dot(v: Vector, w: Vector) -> Array:
    """v . w, with an error of an eps of the largest product."""
    return v.x * w.x + v.y * w.y + v.z * w.z


@jax.custom_jvp
def dot_exactly(v: Vector, w: Vector) -> Array:
    """v . w rounded once or twice, also where the products cancel (grazing incidence)."""
    pairs = [jnp.broadcast_arrays(a, b) for a, b in zip(v, w, strict=True)]
    products = [two_product(opaque(a), opaque(b)) for a, b in pairs]
    total, error = sum_exactly([product for product, _ in products])
    return total + (error + (products[0][1] + products[1][1] + products[2][1]))


@dot_exactly.defjvp
def _dot_exactly_jvp(primals, tangents):
    (v, w), (dv, dw) = primals, tangents
    return dot_exactly(v, w), dot(dv, w) + dot(v, dw)


def cross(v: Vector, w: Vector) -> Vector:
    """v x w."""
    return Vector(v.y * w.z - v.z * w.y, v.z * w.x - v.x * w.z, v.x * w.y - v.y * w.x)


def add(v: Vector, w: Vector) -> Vector:
    """v + w."""
    return Vector(v.x + w.x, v.y + w.y, v.z + w.z)


def scale(factor: Array | float, v: Vector) -> Vector:
    """factor v."""
    return Vector(factor * v.x, factor * v.y, factor * v.z)


def select(condition: Array, v: Vector, w: Vector) -> Vector:
    """v where the condition holds, w elsewhere."""
    return Vector(*(jnp.where(condition, a, b) for a, b in zip(v, w, strict=True)))


def once(v: Vector) -> Vector:
    """v itself, never computed anew in the loops of several results: see `computed_once`."""
    return Vector(*(computed_once(x) for x in v))


@jax.custom_jvp
def normalize(v: Vector) -> Vector:
    """v / |v|, to 3 eps; the zero vector, or one whose square underflows, is given back as it is.

    The derivative at the zero vector is 0 and means nothing. Divisions, not products with 1 / |v|,
    for the reason in `fences` (a sample of a rough conductor: 642 operations instead of 849).
    """
    length = _length(v)
    return Vector(v.x / length, v.y / length, v.z / length)


@normalize.defjvp
def _normalize_jvp(primals, tangents):
    """(m x dv) x m / |v|, m = v / |v|.

    Its equal dv - m (m . dv) loses the component along an axis that v is close to: 17,000 eps of
    the change of a microfacet normal's z by u2 (tests/physics/test_microfacet.py).
    """
    (v,), (dv,) = primals, tangents
    m = normalize(v)
    turned = cross(cross(m, dv), m)
    return m, scale(1.0 / _length(v), turned)


def _length(v: Vector) -> Array:
    """|v|, and 1 for the zero vector."""
    return jnp.sqrt(one_if_zero(dot(v, v)))
