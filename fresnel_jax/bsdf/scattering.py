"""What the models of `bsdf` share: modes, lobes, the record of a sample, guarded directions."""

import enum
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Bool, Float

from .._numerics.arguments import check_unit
from .._numerics.results import exported
from .._numerics.vectors import Vector, components, select, stack


class TransportMode(enum.Enum):
    """What travels along the sampled path.

    Radiance (paths that start at the camera) is multiplied by eta_o^2 / eta_i^2 when it is
    refracted, importance (paths that start at a light) is not. A static Python value.
    Source: PBRT 4th ed. sec. 9.5.2.
    """

    RADIANCE = enum.auto()
    IMPORTANCE = enum.auto()


class Lobes(enum.Flag):
    """Which side of the surface light may go to. A static Python value."""

    NONE = 0
    REFLECTION = enum.auto()
    TRANSMISSION = enum.auto()
    ALL = REFLECTION | TRANSMISSION


@exported
class ScatteringFlags(NamedTuple):
    """What a model does, as boolean arrays of the shape of its parameters."""

    reflection: Bool[Array, "..."]
    transmission: Bool[Array, "..."]
    specular: Bool[Array, "..."]  # all scattering is a delta distribution
    glossy: Bool[Array, "..."]


@exported
class BSDFSample(NamedTuple):
    """One sampled direction; arrays of shape (...), direction (..., 3).

    Where `valid` is False (no lobe wanted, total reflection with transmission alone, a direction
    that ends on the wrong side), value, density and weight are 0 and direction is finite. A NaN
    among what the sample is made from makes it invalid, with a direction that may be NaN.
    """

    direction: Float[Array, "... 3"]  # w_i, a unit vector that points away from the surface
    value: Float[Array, "..."]  # f; of a delta distribution the coefficient F / |cos_i|
    density: Float[Array, "..."]  # per solid angle; of a delta distribution that of the lobe
    weight: Float[Array, "..."]  # f |cos_i| / density, in a form that neither over- nor underflows
    eta: Float[Array, "..."]  # index of the medium of w_i over that of w_o; 1 in reflection
    transmission: Bool[Array, "..."]  # True: across the surface
    specular: Bool[Array, "..."]  # True: value and density are those of a delta distribution
    valid: Bool[Array, "..."]


def upward(like: Vector) -> Vector:
    """The normal +z in the shape and dtype of another direction."""
    return Vector(jnp.zeros_like(like.z), jnp.zeros_like(like.z), jnp.ones_like(like.z))


def local_direction(w: ArrayLike, name: str) -> tuple[Vector, Array]:
    """The components of w, and whether it leaves the surface at all.

    A direction in the surface (|z|^2 below the smallest normal number) carries no flux. It is
    replaced by the normal, so that what is computed for it, and every derivative, is finite before
    it is masked. A direction with a NaN is kept: it does not leave, and `zero_or_nan` tells it.
    """
    if name == "wo":
        check_unit(w, name)
    v = components(w, name)
    flux = v.z * v.z
    unknown = zero_or_nan(*v) != 0.0
    leaves = (flux > jnp.finfo(v.z.dtype).tiny) & ~unknown
    return select(leaves | unknown, v, upward(v)), leaves


def zero_or_nan(*values: Array) -> Array:
    """0, and NaN where one of the values is NaN: what masked results are filled with."""
    total = sum(values[1:], values[0])
    return jnp.where(total == total, 0.0, jnp.nan).astype(total.dtype)


def nothing(model, *directions: Vector) -> Array:
    """`zero_or_nan` of the directions and of every parameter of the model."""
    return zero_or_nan(*(x for v in directions for x in v), *jax.tree.leaves(model))


def in_lobes(lobes: Lobes, reflected: Array, transmitted: Array) -> tuple[Array, Array]:
    """Both powers, 0 for a lobe that is not among those wanted."""
    none = jnp.zeros_like(reflected)
    return (
        reflected if Lobes.REFLECTION in lobes else none,
        transmitted if Lobes.TRANSMISSION in lobes else none,
    )


class LobeChoice(NamedTuple):
    """One of two lobes; `probability` is constant to differentiation: see the module `bsdf`."""

    reflection: Array
    power: Array
    probability: Array  # 1 where both powers are 0
    possible: Array


def choose_lobe(u_lobe: ArrayLike, reflected: Array, transmitted: Array) -> LobeChoice:
    """Reflection where u_lobe < R / (R + T), transmission elsewhere.

    The probability of transmission is T / (R + T) and not the rest to 1, which near total
    reflection would leave T / probability without a right digit.
    """
    total = reflected + transmitted
    total = jnp.where(total > 0.0, total, 1.0)
    u_lobe = jnp.asarray(u_lobe)
    # The second condition keeps u_lobe = 1 in total reflection from a lobe without power.
    reflection = (u_lobe < reflected / total) | (transmitted == 0.0)
    power = jnp.where(reflection, reflected, transmitted)
    possible = (power > 0.0) & (u_lobe == u_lobe)  # not for NaN
    probability = jax.lax.stop_gradient(jnp.where(possible, power / total, 1.0))
    return LobeChoice(reflection, power, probability, possible)


def assemble(
    direction: Vector,
    value: Array,
    density: Array,
    weight: Array,
    eta: Array,
    transmission: Array,
    specular: Array,
    valid: Array,
) -> BSDFSample:
    """A `BSDFSample` of one shape with everything masked where it is not valid."""
    value, density, weight, eta, transmission, specular, valid, _ = jnp.broadcast_arrays(
        value, density, weight, eta, transmission, specular, valid, direction.z
    )
    dtype = jnp.result_type(value, direction.z)
    valid = valid & (zero_or_nan(value, density, weight, *direction) == 0.0)
    value, density, weight = (
        jnp.where(valid, a, 0.0).astype(dtype) for a in (value, density, weight)
    )
    return BSDFSample(
        jnp.broadcast_to(stack(direction), (*valid.shape, 3)),
        value,
        density,
        weight,
        eta.astype(dtype),
        transmission,
        specular,
        valid,
    )
