"""Depths to which light reaches in a medium; public in `polarization`, whose conventions hold."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike

from ._arguments import as_floats, check_extinction, real, structure
from ._arithmetic import reciprocal_or_zero
from ._boundary import boundary, within_one


@jax.jit
def _jit_penetration(wavelength_um, cos_theta_i, eta, k, eta_i):
    c, n, k, m = as_floats(cos_theta_i, eta, k, eta_i)
    _, b = boundary(within_one(c), n, k, m).q
    return _depth(wavelength_um, b)


@jax.jit
def _depth(wavelength_um, k):
    per_k = jnp.where(k == 0.0, jnp.inf, reciprocal_or_zero(4.0 * jnp.pi * k))
    return wavelength_um * per_k


def _checked_wavelength(wavelength_um, *arguments):
    wavelength_um = real(wavelength_um, "wavelength_um")
    shapes = [jnp.shape(x) for x in (wavelength_um, *arguments) if x is not None]
    try:
        jnp.broadcast_shapes(*shapes)
    except ValueError:
        raise ValueError(
            f"the shape of wavelength_um, {shapes[0]}, does not broadcast with those of the other "
            f"arguments, {', '.join(map(str, shapes[1:]))}; add axes of length 1 so that it does"
        ) from None
    return wavelength_um


def penetration_depth(
    wavelength_um: ArrayLike,
    cos_theta_i: ArrayLike,
    eta: ArrayLike,
    k: ArrayLike = 0.0,
    eta_i: ArrayLike = 1.0,
) -> Array:
    """The depth in micrometres at which the power density behind the boundary has fallen to 1/e.

    wavelength_um / (4 pi Im Q),    Q^2 = (eta + ik)^2 - eta_i^2 sin^2

    for the refracted wave in an absorbing medium and for the evanescent wave of total reflection
    (Im Q = sqrt(eta_i^2 sin^2 - eta^2)) alike. The field falls to 1/e at twice this depth, which is
    what texts on internal reflection call the penetration depth.

    Args: `wavelength_um` in vacuum, > 0; the others as in `powers`. In a lossless medium without
    total reflection the depth is inf, and its derivative is returned as 0.
    Source: Born and Wolf, 7th ed., secs. 1.5.4 and 14.2.
    """
    arguments = structure(cos_theta_i, eta, k, eta_i)
    wavelength_um = _checked_wavelength(wavelength_um, *arguments)
    return _jit_penetration(wavelength_um, *arguments)


def absorption_depth(wavelength_um: ArrayLike, k: ArrayLike) -> Array:
    """The depth in micrometres at which light in a medium has fallen to 1/e of its power.

    wavelength_um / (4 pi k), the reciprocal of the absorption coefficient; inf, with derivative 0,
    for k = 0. About .01 um for metals in the visible: they are opaque at a tenth of a micrometre.
    Source: Born and Wolf, 7th ed., sec. 14.1.
    """
    k = real(k, "k")
    check_extinction(k)
    return _depth(_checked_wavelength(wavelength_um, k), k)
