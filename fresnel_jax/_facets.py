"""One bounce on a Trowbridge-Reitz microfacet, on components (directions in the local frame).

Every quantity is written through the stretched length S(w) = sqrt(z^2 + alpha_x^2 x^2 +
alpha_y^2 y^2), which is never zero. The textbook forms use tan^2 theta and cos phi; these are
infinite at grazing incidence and undefined at the pole. In

    f_r        = F D G / (4 |z_o z_i|)          = F D / (2 (|z_o| S_i + |z_i| S_o))
    p(w_i)     = G1 D |w_o . m| / |z_o| / (4 |w_o . m|) = D / (2 (|z_o| + S_o))
    f_r z_i / p                                 = F |z_i| (|z_o| + S_o) / (|z_o| S_i + |z_i| S_o)

every cosine that could vanish under a fraction has cancelled, and D, which overflows first, drops
out of the weight. Refraction multiplies the first by 4 eta_o^2 |w_o . m| |w_i . m| / |H|^2 and the
second by 4 eta_i^2 |w_o . m| |w_i . m| / |H|^2, with H = eta_o w_o + eta_i w_i.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array

from ._numerics.arithmetic import one_if_zero, positive_sqrt, sine_cosine
from ._numerics.fences import computed_once
from ._numerics.vectors import Vector, add, normalize, once, scale, select


class Alphas(NamedTuple):
    """Roughness along x and y, both positive."""

    x: Array
    y: Array


class Bounce(NamedTuple):
    """Reflection by a facet without its Fresnel factor."""

    value: Array  # f / F
    density: Array  # of w_i
    weight: Array  # value |z_i| / density


def stretched_length(alphas: Alphas, w: Vector) -> Array:
    """S(w)."""
    return jnp.sqrt(w.z * w.z + (alphas.x * w.x) ** 2 + (alphas.y * w.y) ** 2)


def normal_density(alphas: Alphas, m: Vector) -> Array:
    """D(m) for m on the upper side."""
    root = (m.x / alphas.x) ** 2 + (m.y / alphas.y) ** 2 + m.z * m.z
    return 1.0 / (jnp.pi * alphas.x * alphas.y * root * root)


def visible_normal(alphas: Alphas, w: Vector, u1: Array, u2: Array) -> Vector:
    """A visible normal on the upper side for w on either (Dupuy and Benyoub 2023).

    In the frame in which the surface is stretched to roughness 1, the visible normals are half
    vectors between w and the points of a spherical cap z > -w.z. The cap needs no tangent frame
    around w, which is what has no derivative at the pole. With t = u2 (1 + w.z) the cap's z is
    1 - t, the half vector's z is h = (1 + w.z)(1 - u2), and 1 - z^2 = t (2 - t) is
    u2 (2 h + u2 (w.x^2 + w.y^2)): no subtraction that cancels. Of 3,000 points with 1 - u2 from
    1e-6 to .1, 99 % are within 13 eps at the exact arguments; with 2 - t it was 7,700.
    """
    w = select(w.z < 0.0, scale(-1.0, w), w)
    v = normalize(Vector(alphas.x * w.x, alphas.y * w.y, w.z))
    u2 = jnp.minimum(u2, 1.0 - 0.5 * jnp.finfo(u2.dtype).eps)
    height = (1.0 + v.z) * (1.0 - u2)
    # The root of u2 is taken apart: its derivative is infinite at u2 = 0, that of the other factor
    # never is.
    radius = positive_sqrt(u2) * jnp.sqrt(2.0 * height + u2 * (v.x * v.x + v.y * v.y))
    sine, cosine = map(computed_once, sine_cosine(u1 - jnp.round(u1)))
    half = Vector(radius * cosine + v.x, radius * sine + v.y, height)
    return normalize(Vector(alphas.x * half.x, alphas.y * half.y, half.z))


def bounce(alphas: Alphas, wo: Vector, wi: Vector, m: Vector) -> Bounce:
    """f / F, density and weight of one reflection, for |z| of both directions > 0."""
    z_o, z_i = jnp.abs(wo.z), jnp.abs(wi.z)
    s_o, s_i = stretched_length(alphas, wo), stretched_length(alphas, wi)
    facets = 0.5 * normal_density(alphas, m)
    both = z_o * s_i + z_i * s_o
    return Bounce(facets / both, facets / (z_o + s_o), z_i * ((z_o + s_o) / both))


def half_vector_of(wo: Vector, wi: Vector, eta: Array) -> Vector:
    """The normal, on the upper side, that reflects or refracts wo into wi.

    eta_o w_o + eta_i w_i is formed as (w_o + w_i) + (eta - 1) w, w the direction inside: near index
    match w_o and w_i are almost opposite, their sum is exact, and what is left is not. Where the
    two cancel altogether no facet does it, and +z stands in to keep derivatives finite.
    """
    added = add(wo, wi)
    across = add(added, scale(eta - 1.0, select(wo.z < 0.0, wo, wi)))
    m = normalize(select(wo.z * wi.z < 0.0, across, added))
    m = Vector(m.x, m.y, jnp.where((m.x == 0.0) & (m.y == 0.0) & (m.z == 0.0), 1.0, m.z))
    return once(select(m.z < 0.0, scale(-1.0, m), m))


def per_length_squared(inside: Array, c_o: Array, c_i: Array, eta: Array) -> Array:
    """1 / |H|^2 from |w_o . m| and |w_i . m|; 0 at index match, where there is no H.

    |H| is the difference of eta_i c_i and eta_o c_o, whose squares differ by eta^2 - 1 (Snell):
    |H| = |eta - 1| (eta + 1) / (eta_o c_o + eta_i c_i) has no difference.
    """
    total = jnp.where(inside, eta * c_o + c_i, c_o + eta * c_i)
    apart = (eta - 1.0) * (eta + 1.0)
    root = jnp.where(apart == 0.0, 0.0, total / one_if_zero(apart))
    return root * root
