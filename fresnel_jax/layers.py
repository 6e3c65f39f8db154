"""Layers between two boundaries. Here: a slab so thick that its reflections do not interfere.

A slab is thick in this sense if its thickness varies by more than a wavelength over the spot, or if
the light is less coherent than twice its optical thickness: windows, wafers seen in white light,
sheets of glass. Powers are then summed, not amplitudes, for s and for p apart:

    R = R1 + R1 A T,    T = T1^2 A / (1 - (R1 A)^2),    A = exp(-4 pi thickness Im(Q) / wavelength)

with R1 and T1 = 1 - R1 of one face and Q = N cos_t of the refracted wave: the geometric series of
what is reflected to and fro. Nothing is lost but what the slab absorbs.

The mean over the phase of the coherent film has |t1 t2|^2 where T1^2 stands here, which is larger
by |Y|^2 / (Re Y)^2, with Y = Q for s and Q / N^2 for p. The two agree within k^2 / n^2, and where
k^2 / n^2 could be seen a thick slab lets nothing through; for thin absorbing ones neither holds,
since their reflections interfere.

Time dependence exp(-i w t): k >= 0 absorbs. Source: M. Born and E. Wolf, Principles of Optics, 7th
ed., sec. 1.6.4, for the coherent film, and O. S. Heavens, Optical Properties of Thin Solid Films,
1955, sec. 4.11, for the incoherent sum.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jaxtyping import ArrayLike

from ._numerics.arguments import (
    as_floats,
    broadcast_shape,
    check_length,
    check_positive,
    real,
    structure,
)
from ._numerics.arithmetic import reciprocal_or_zero
from ._numerics.index import IndexLike
from .boundary.boundary import boundary, within_one
from .boundary.powers import powers_kernel
from .interface import Powers
from .stacks.depth import DepthFields as DepthFields
from .stacks.depth import fields_at_depth as fields_at_depth
from .stacks.fast import FEW_LAYERS as FEW_LAYERS
from .stacks.graded import graded_layer as graded_layer
from .stacks.stack import Stack as Stack
from .stacks.stack import stack as stack
from .stacks.uniaxial import Uniaxial as Uniaxial

__all__ = [
    "DepthFields",
    "Stack",
    "Uniaxial",
    "fields_at_depth",
    "graded_layer",
    "slab",
    "stack",
]


def _both_faces(R_1, T_1, passage, absorbed_twice):
    """R and T of the slab from one face's R and T, A, and 1 - A^2."""
    # 1 - (R1 A)^2 without cancellation for mirrors (R1 near 1) that absorb little (A near 1)
    lost = T_1 * (1.0 + R_1) + (R_1 * R_1) * absorbed_twice
    # The quotient comes first: T1^2 of grazing light underflows in float32.
    through = T_1 * (T_1 * reciprocal_or_zero(lost)) * passage
    return R_1 + R_1 * passage * through, through


@jax.jit
def _jit_slab(cos_theta_i, eta, k, eta_i, thickness_um, wavelength_um):
    c, n, k, m, thickness, wavelength = as_floats(
        cos_theta_i, eta, k, eta_i, thickness_um, wavelength_um
    )
    R_s, R_p, T_s, T_p = powers_kernel(c, n, k, m)
    _, b = boundary(within_one(c), n, k, m).q
    depth = 4.0 * jnp.pi * (thickness / wavelength) * b
    passage, absorbed_twice = jnp.exp(-depth), -jnp.expm1(-2.0 * depth)
    R_s, T_s = _both_faces(R_s, T_s, passage, absorbed_twice)
    R_p, T_p = _both_faces(R_p, T_p, passage, absorbed_twice)
    return Powers(R_s, R_p, T_s, T_p)


def slab(
    cos_theta_i: ArrayLike,
    eta: IndexLike,
    k: ArrayLike = 0.0,
    *,
    thickness_um: ArrayLike,
    wavelength_um: ArrayLike,
    eta_i: IndexLike = 1.0,
) -> Powers:
    """Power reflectance and transmittance of a thick plane slab with the same medium on both sides.

    All reflections between the two faces are summed incoherently; formulas in the module's text.

    Args:
        cos_theta_i: cosine of the angle of incidence, in [-1, 1]; its sign is ignored.
        eta, k: real part > 0 and imaginary part >= 0 of the slab's absolute index; or as `eta`
            alone its complex index or an `Index`.
        thickness_um: micrometres, >= 0; 0 is a slab that absorbs nothing but has both faces.
        wavelength_um: vacuum wavelength in micrometres, > 0.
        eta_i: real index > 0 of the medium before and behind the slab.

    Returns:
        `Powers(R_s, R_p, T_s, T_p)` with `.R` and `.T` for unpolarized light, of the broadcast
        shape, float32 or float64 as the arguments. R from the other face is the same. Error
        within 24 eps of R and (24 + 4 ln(1 / A)) eps of T (a transmittance of 1e-30 is a power of a
        rounded number). In total reflection R is 1 and T is 0.

    Derivatives are those of `interface.powers` carried through, within 100 eps of the norm of each
    gradient in relative changes of the arguments, times the same factor 1 + ln(1 / A) / 6 for T (or
    of what one eps of each argument does to it, if more: where T has a maximum over the angle);
    with respect to k at k = 0 the one-sided one, which is not 0: T falls by the path through the
    slab.

    Raises:
        ValueError: the shapes do not broadcast; an argument other than eta is complex; or, where it
            can be read (see the module `interface`), a value is outside of the domain above.
    """
    c, n, kappa, m = structure(cos_theta_i, eta, k, eta_i)
    thickness_um = real(thickness_um, "thickness_um")
    wavelength_um = real(wavelength_um, "wavelength_um")
    check_length(thickness_um, "thickness_um")
    check_positive(wavelength_um, "wavelength_um")
    broadcast_shape(
        cos_theta_i=c,
        eta=n,
        k=kappa,
        eta_i=m,
        thickness_um=thickness_um,
        wavelength_um=wavelength_um,
    )
    return _jit_slab(c, n, kappa, m, thickness_um, wavelength_um)
