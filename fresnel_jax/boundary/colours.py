"""Indices from colours and back: exact relations at normal incidence. Exported by `approximate`."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike

from .._numerics.arguments import looked_at, named_floats
from .._numerics.index import IndexLike


def reflectance_at_normal(eta: Array, k: Array, eta_i: Array | float) -> Array:
    near, far = eta - eta_i, eta + eta_i
    return (near * near + k * k) / (far * far + k * k)


@looked_at
@jax.jit
def normal_reflectance(eta: IndexLike, k: ArrayLike = 0.0, eta_i: IndexLike = 1.0) -> Array:
    """Power reflectance at normal incidence, ((eta - eta_i)^2 + k^2) / ((eta + eta_i)^2 + k^2).

    Args:
        eta, k: real and imaginary part of the absolute index of the medium entered; > 0 and >= 0.
        eta_i: absolute index of the medium that the light comes from, real, > 0.

    Returns:
        R in [0, 1], exact to 5 eps, of the broadcast shape.
    """
    return reflectance_at_normal(*named_floats(eta=eta, k=k, eta_i=eta_i))


@jax.jit
def real_index(R_0: ArrayLike, eta_i: IndexLike = 1.0) -> Array:
    """The lossless index above eta_i that has a given reflectance at normal incidence.

    eta = eta_i (1 + sqrt(R_0)) / (1 - sqrt(R_0)), computed as eta_i (1 + sqrt(R_0))^2 / (1 - R_0).

    For a metal the curve over angle of this eta is wrong by up to .5: k is what was dropped.

    Args:
        R_0: reflectance at normal incidence, in [0, 1).
        eta_i: absolute index of the medium that the light comes from, real, > 0.

    Returns:
        eta >= eta_i, exact to 5 eps. Its derivative with respect to R_0 is infinite at R_0 = 0, and
        so is what `grad` returns there.
    """
    R_0, eta_i = named_floats(R_0=R_0, eta_i=eta_i)
    root = jnp.sqrt(R_0)
    return eta_i * ((1.0 + root) * (1.0 + root) / (1.0 - R_0))


@jax.jit
def gulbrandsen_index(r: ArrayLike, g: ArrayLike) -> tuple[Array, Array]:
    """(eta, k) of a metal from two colours: reflectance r at normal incidence, edge tint g.

    eta = g eta_min + (1 - g) eta_max,  eta_min = (1 - r) / (1 + r),
                                        eta_max = (1 + sqrt(r)) / (1 - sqrt(r)),
    k^2 = (r (eta + 1)^2 - (eta - 1)^2) / (1 - r),
    the index relative to the medium outside. Printed like this k^2 cancels for small g (for
    g = 1e-12 half the digits of k are lost); it is (eta_max - eta) (eta - 1 / eta_max), whose
    factors are sums of positive terms in g and r.

    Args:
        r: reflectance at normal incidence, in [0, 1).
        g: edge tint in [0, 1]; 0 is the lossless index of that reflectance.

    Returns:
        (eta, k), exact to 16 eps. The derivative of k with respect to g is infinite at g = 0, and
        those with respect to r at r = 0; infinity (NaN for k at r = g = 0) is returned there.

    Source: O. Gulbrandsen, Artist friendly metallic Fresnel, JCGT 3(4), 2014.
    """
    r, g = named_floats(r=r, g=g)
    root = jnp.sqrt(r)
    up2, less, more = (1.0 + root) * (1.0 + root), 1.0 - r, 1.0 + r
    eta = g * (less / more) + (1.0 - g) * (up2 / less)
    # (eta_max - eta) / (2 sqrt(r) g) and (eta - 1 / eta_max) / (2 sqrt(r))
    below_max = up2 / (less * more)
    above_inverse = g * (less / (more * up2)) + (1.0 - g) * (2.0 / less)
    return eta, 2.0 * root * (jnp.sqrt(g) * jnp.sqrt(below_max * above_inverse))


@looked_at
@jax.jit
def gulbrandsen_parameters(eta: IndexLike, k: ArrayLike = 0.0) -> tuple[Array, Array]:
    """(r, g) of a metal of relative index eta + ik; `gulbrandsen_index` undoes it.

    A metal with eta below eta_min = (1 - r) / (1 + r) has g > 1 (1.6 % of measured ones).

    Args:
        eta, k: real and imaginary part of the index relative to the medium outside; > 0 and >= 0.

    Returns:
        (r, g), exact to 8 eps for r and 16 eps / abs(log(eta)) for g; the way back multiplies what
        they lost by 1 / (1 - r) and 1 / (1 - g). For r = 0 (eta = 1, k = 0) g is undetermined; 0 is
        returned, with derivative 0.

    Source: as `gulbrandsen_index`.
    """
    eta, k = named_floats(eta=eta, k=k)
    r = reflectance_at_normal(eta, k, 1.0)
    matched = r == 0.0
    root = jnp.sqrt(jnp.where(matched, 1.0, r))
    far = (eta + 1.0) * (eta + 1.0) + k * k
    less, up = 4.0 * eta / far, 1.0 + root  # less = 1 - r
    eta_max = up * up / less
    # eta_max - eta cancels for small k above eta = 1, where eta - 1 / eta_max does not
    dense = eta > 1.0
    above = jnp.where(dense, eta - less / (up * up), 1.0)
    below_max = jnp.where(dense, k * k / above, eta_max - eta)
    g = below_max * (less * (1.0 + r)) / (2.0 * root * (up * up))
    return r, jnp.where(matched, 0.0, g)
