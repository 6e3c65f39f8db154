"""Directions of reflected and refracted light, the local frame, Brewster's and critical angle.

Directions are unit vectors of shape (..., 3) that point away from the surface, the normal points
outside, and a relative index is inside over outside: a direction with a negative cosine lies
inside. All arguments broadcast as in NumPy (the last axis of a direction apart).
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Bool, Float

from ._numerics.arguments import lossless_index
from ._numerics.arithmetic import positive_sqrt
from ._numerics.index import IndexLike
from ._numerics.results import exported
from ._numerics.vectors import Vector, add, components, dot, dot_exactly, normalize, scale, stack
from .boundary.boundary import boundary, within_one

__all__ = [
    "Frame",
    "Refraction",
    "brewster_angle_deg",
    "critical_angle_deg",
    "entering",
    "faceforward",
    "local_frame",
    "reflect",
    "refract",
    "snells_window",
    "to_local",
    "to_world",
]


@exported
class Refraction(NamedTuple):
    """The result of `refract`."""

    direction: Float[Array, "... 3"]  # unit vector
    eta: Float[Array, "..."]  # index of the medium entered over that of the medium left
    valid: Bool[Array, "..."]  # False in total reflection


@exported
class Frame(NamedTuple):
    """An orthonormal right-handed frame; each axis has shape (..., 3)."""

    tangent: Float[Array, "... 3"]
    bitangent: Float[Array, "... 3"]
    normal: Float[Array, "... 3"]


class _Refracted(NamedTuple):
    direction: Vector
    cos_theta_t: Array
    valid: Array


def sides(inside: Array, eta: Array) -> tuple[Array, Array]:
    """Indices (of the medium that a direction lies in, of the other one), the outside being 1.

    The quotient of the two is never formed: near index match it would lose their difference.
    """
    one = jnp.ones_like(eta)
    return jnp.where(inside, eta, one), jnp.where(inside, one, eta)


def reflect_components(wo: Vector, n: Vector, cosine: Array) -> Vector:
    """2 (wo . n) n - wo, given wo . n."""
    return add(scale(2.0 * cosine, n), scale(-1.0, wo))


def refract_components(
    wi: Vector, n: Vector, cosine: Array, eta_i: Array, eta_t: Array
) -> _Refracted:
    """`refract`, given wi . n and the indices of both sides, with the refracted ray's cosine >= 0.

    eta_t cos_t = Q, the normal wavevector of `boundary`, which keeps its relative accuracy at the
    critical angle. The tangential part comes from wi itself, not from 1 - cos^2: near normal
    incidence a cosine no longer knows the tilt. What wi lacks to unit length would come out
    multiplied by 1 / eta^2 (16 eps in length for eta = 1/4), hence the normalisation.
    """
    dtype = jnp.result_type(cosine, eta_i)
    cosine, eta_i, eta_t = (a.astype(dtype) for a in (cosine, eta_i, eta_t))
    unsigned = within_one(cosine)
    root, _ = boundary(unsigned, eta_t, None, eta_i).q
    # Only where the squared cosine has underflown: elsewhere the root carries d cos_t / d eta.
    straight_on = (eta_i == eta_t) & (root == 0.0)
    cos_t = jnp.where(straight_on, unsigned, root / eta_t)
    valid = (root > 0.0) | straight_on
    ratio = eta_i / eta_t
    tangential = add(scale(cosine, n), scale(-1.0, wi))
    normal_part = jnp.where(cosine < 0.0, cos_t, -cos_t)
    return _Refracted(normalize(add(scale(ratio, tangential), scale(normal_part, n))), cos_t, valid)


def reflect(wo: ArrayLike, n: ArrayLike) -> Float[Array, "... 3"]:
    """Mirror direction of wo about the normal n: 2 (wo . n) n - wo.

    With the normal +z of the local frame this is (-x, -y, z). It is the same for n and -n.

    Args:
        wo: unit direction away from the surface, shape (..., 3).
        n: unit normal, shape (..., 3).

    Returns:
        The direction, of the broadcast shape. Its length is 1 within 4 eps, if those of wo and n
        are, each component within 6 eps. It is differentiable everywhere.

    Raises:
        ValueError: the last axis of an argument is not 3.

    Source: PBRT 3rd ed. eq. 8.5, 4th ed. eq. 9.1.
    """
    w, normal = components(wo, "wo"), components(n, "n")
    return stack(reflect_components(w, normal, dot_exactly(w, normal)))


def refract(wi: ArrayLike, n: ArrayLike, eta: IndexLike) -> Refraction:
    """Refracted direction of wi, relative index along the ray, and whether light is refracted.

    By Snell's law, eta_i sin_i = eta_t sin_t, with wi, n and the result in one plane:
    direction = -(wi - (wi . n) n) eta_i / eta_t - cos_t n if wi lies outside (wi . n >= 0), with
    + cos_t n if it lies inside.

    Args:
        wi: unit direction away from the surface, toward where the light comes from, shape (..., 3).
        n: unit normal that points outside, shape (..., 3).
        eta: index inside over index outside, > 0, shape (...). For a normal on the side of wi this
            is eta_t / eta_i (the inverse of the ratio that PBRT's 3rd edition asks for).

    Returns:
        `Refraction(direction, eta, valid)`.
        direction: of length 1 within 4 eps, components within a few eps. For the normal +z its
        cosine, the component z, has a relative error of a few eps, also next to the critical angle
        and at grazing incidence, for the cosine wi . n and the index as given. For a tilted normal
        the cosine is a sum of rounded components, and its error a few eps of 1, not of itself: if
        that matters, turn into the local frame first. Each component of the direction is then
        within 8 eps (1 + q + q^2 abs(cos_i) / cos_t), q = eta_i / eta_t, for the unit vectors along
        wi and n (`make accuracy-search` found at most 1 in place of 8).
        eta: index of the medium entered over that of the medium left.
        valid: False in total reflection and at the critical angle itself; direction is then the
        unit vector along the surface in which the evanescent wave travels.
        The derivative is infinite at the critical angle, where 0 is returned, and finite everywhere
        else. NaN in is NaN out.

    Raises:
        ValueError: the last axis of wi or n is not 3.

    Source: PBRT 4th ed. eq. 9.4, 9.5.
    """
    w, normal, eta = components(wi, "wi"), components(n, "n"), lossless_index(eta, "eta")
    cosine = dot_exactly(w, normal)
    eta_i, eta_t = sides(cosine < 0.0, eta)
    refracted = refract_components(w, normal, cosine, eta_i, eta_t)
    # which side a NaN lies on is unknown
    relative = jnp.where(cosine == cosine, eta_t / eta_i, jnp.nan)
    return Refraction(stack(refracted.direction), relative, refracted.valid)


def faceforward(n: ArrayLike, v: ArrayLike) -> Float[Array, "... 3"]:
    """The normal on the side of v: n where n . v >= 0, else -n.

    Args:
        n, v: vectors, shape (..., 3).

    Returns:
        n or -n, exactly, of the broadcast shape. The derivative with respect to v is 0.

    Raises:
        ValueError: the last axis of an argument is not 3.

    Source: PBRT 3rd ed. sec. 2.4.
    """
    normal = components(n, "n")
    cosine = dot_exactly(normal, components(v, "v"))
    sign = jnp.where(cosine == cosine, jnp.where(cosine < 0.0, -1.0, 1.0), jnp.nan)
    return stack(scale(sign, normal))


def entering(wi: ArrayLike, n: ArrayLike) -> Bool[Array, "..."]:
    """True where light from wi (a direction away from the surface) comes from outside: wi . n >= 0.

    Arguments: `wi` and `n`, shape (..., 3). ValueError for a last axis that is not 3.
    Source: PBRT 3rd ed. sec. 8.2.3.
    """
    return dot_exactly(components(wi, "wi"), components(n, "n")) >= 0.0


def local_frame(n: ArrayLike) -> Frame:
    """An orthonormal frame whose third axis is n.

    Argument: `n`, unit vector, shape (..., 3). Returns `Frame(tangent, bitangent, normal)`,
    orthonormal to 4 eps for every n. The frame jumps where n.z changes sign; its derivative holds
    on either side. ValueError for a last axis that is not 3.
    Source: Duff et al. 2017, JCGT 6(1), building an orthonormal basis, revisited.
    """
    v = components(n, "n")
    # The sign keeps 1 + |z| away from 0: without it the frame loses all digits at n = -z.
    sign = jnp.copysign(jnp.ones_like(v.z), v.z)
    a = -1.0 / (sign + v.z)
    b = v.x * v.y * a
    tangent = Vector(1.0 + sign * v.x * v.x * a, sign * b, -sign * v.x)
    bitangent = Vector(b, sign + v.y * v.y * a, -v.y)
    return Frame(stack(tangent), stack(bitangent), stack(v))


def to_local(v: ArrayLike, frame: Frame) -> Float[Array, "... 3"]:
    """The components of v along the axes of the frame, shape (..., 3); inverse of `to_world`.

    Arguments: `v`, shape (..., 3); `frame`, from `local_frame`. Rounded to an eps of |v|.
    ValueError for a last axis that is not 3.
    """
    parts = components(v, "v")
    return stack(Vector(*(dot(parts, components(axis, "frame")) for axis in frame)))


def to_world(v: ArrayLike, frame: Frame) -> Float[Array, "... 3"]:
    """The vector whose components along the axes of the frame are v; inverse of `to_local`.

    Arguments: `v`, shape (..., 3); `frame`, from `local_frame`. Rounded to an eps of |v|.
    ValueError for a last axis that is not 3.
    """
    x, y, z = components(v, "v")
    t, b, n = (components(axis, "frame") for axis in frame)
    return stack(add(add(scale(x, t), scale(y, b)), scale(z, n)))


def critical_angle_deg(eta: IndexLike) -> Array:
    """The angle of incidence, on the denser side, above which all light is reflected.

    arcsin(min(eta, 1 / eta)), written as an arctangent because arcsin loses half its digits near
    index match.

    Argument: `eta` > 0, relative index, inside over outside. Returns degrees, to 4 eps; 90 at
    eta = 1, where the derivative is infinite (0 is returned).
    Source: PBRT 4th ed. sec. 9.3.4.
    """
    eta = lossless_index(eta, "eta")
    small, large = jnp.minimum(eta, 1.0), jnp.maximum(eta, 1.0)
    return jnp.rad2deg(jnp.arctan2(small, positive_sqrt((large - small) * (large + small))))


def brewster_angle_deg(eta: IndexLike) -> Array:
    """The angle of incidence at which no p-polarized light is reflected: arctan(eta).

    Argument: `eta` > 0, index of the medium entered over that of the medium left. Returns degrees,
    to 4 eps. Smooth. Source: Born and Wolf, Principles of Optics, sec. 1.5.3.
    """
    return jnp.rad2deg(jnp.arctan(lossless_index(eta, "eta")))


def snells_window(eta: IndexLike) -> Array:
    """The fraction of the denser side's hemisphere, by solid angle, that sees across the surface.

    1 - cos(critical angle), written without the subtraction; .339 for water.

    Argument: `eta` > 0, relative index, inside over outside. Returns a number in (0, 1], to 4 eps;
    1 at eta = 1, where the derivative is infinite (0 is returned).
    Source: PBRT 4th ed. fig. 9.18.
    """
    eta = lossless_index(eta, "eta")
    small, large = jnp.minimum(eta, 1.0), jnp.maximum(eta, 1.0)
    root = positive_sqrt((large - small) * (large + small))
    return (small / large) * (small / (large + root))
