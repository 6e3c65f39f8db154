"""Fields in a stack of coherent films, and where it absorbs, against depth.

In medium j the tangential field, E of s and H of p, is a_j (exp(i k_0 Q z) + Gamma exp(i k_0 Q
(2 d - z))), z from its front, with Gamma what all that follows reflects, as in the recursion of
`fast`. From a_0 = 1 on,

    a_(j+1) = a_j exp(i k_0 Q d) 2 Y_j / (Y_j + Y_(j+1)) / (1 + r_j G_(j+1)),

of which nothing grows; the factor of Y is 1 + r_j, and keeps its digits at grazing incidence. The
other field is Y a_j times the difference of the two waves, and across an optical axis
E_z = -K H / N_e^2. A medium absorbs k_0 (Im(N_o^2) (|E_x|^2 + |E_y|^2) + Im(N_e^2) |E_z|^2) of a
wave of unit E for each length, over N_0 cos(theta) of what falls in.

Source: S. J. Byrnes, Multilayer optical calculations, arXiv:1603.02720, sec. 4 and 5.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Complex, Float

from .._numerics.arguments import as_floats, check_cosine, check_positive, real
from .._numerics.index import IndexLike
from .._numerics.results import exported
from ..boundary.boundary import unsigned
from .fast import admittances, as_complex, recursion
from .stack import behind_leading_axis, lossless_first, read_media


@exported
class DepthFields(NamedTuple):
    """Complex electric fields where the incident wave has 1 at the first boundary, and absorption.

    E_y is that of s, E_x and E_z are those of p, z along the normal. absorption_s and absorption_p
    are the fractions of the incident power that are absorbed for each micrometre of depth.
    """

    E_x: Complex[Array, "..."]
    E_y: Complex[Array, "..."]
    E_z: Complex[Array, "..."]
    absorption_s: Float[Array, "..."]
    absorption_p: Float[Array, "..."]

    @property
    def absorption(self) -> Float[Array, "..."]:
        """Absorption of unpolarized light for each micrometre."""
        return 0.5 * (self.absorption_s + self.absorption_p)


def _waves(admittance: Any, phase: Any) -> tuple[Array, Array]:
    """The amplitude at the front of each medium and what comes back at its far side, over it."""
    _, (r, inverse, passage, G, g) = recursion(admittance, phase)
    one = jnp.ones_like(admittance[0])
    behind = zip(r[:-1], G, g, strict=True)
    returned = [*((r + G) * g for r, G, g in behind), r[-1], jnp.zeros_like(one)]
    steps = zip([one, *passage], admittance[:-1], inverse, [*g, one], strict=True)
    amplitudes = [one, *(2.0 * f * Y * i * g for f, Y, i, g in steps)]
    return jnp.cumprod(jnp.stack(amplitudes), axis=0), jnp.stack(returned)


def _power(field: Array) -> Array:
    return field.real**2 + field.imag**2


@jax.jit
def _jit_fields(c, eta_i, index, extraordinary, thickness, wavelength, depth):
    """All arguments have one shape; those of media and layers a leading axis before it."""
    c = jnp.maximum(unsigned(c)[0], 1e-15)
    both, phases = admittances(c, eta_i, index, thickness, wavelength, extraordinary)
    first = as_complex(eta_i)[None]
    of_axis = index if extraordinary is None else extraordinary
    across2, along2 = (jnp.concatenate([first, z]) ** 2 for z in (index, of_axis))
    nothing = jnp.zeros_like(thickness[:1], shape=first.shape)
    edges = jnp.concatenate([nothing, jnp.cumsum(thickness, axis=0)])
    below = depth[None] >= edges
    always = jnp.ones_like(below[:1])
    inside = jnp.concatenate([always, below]) & jnp.concatenate([~below, always])
    z = jnp.where(inside, depth[None] - jnp.concatenate([nothing, edges]), 0.0)
    through = 2.0 * jnp.concatenate([nothing, thickness, nothing])
    k0, fields = as_complex(2.0 * jnp.pi / wavelength)[None], []
    for admittance, phase, q_over_y in zip(both, phases, (None, across2), strict=True):
        amplitude, returned = _waves(admittance, phase)
        Y = jnp.stack(list(admittance))
        turn = 1j * k0 * (Y if q_over_y is None else Y * q_over_y)
        down, up = (jnp.exp(turn * as_complex(x)) for x in (z, through - z))
        up = returned * up
        fields.append([jnp.where(inside, amplitude * w, 0.0) for w in (down + up, Y * (down - up))])
    (E_y, _), (H, W) = fields
    E_x, E_z = first * W, -(first * first) * H / along2  # E_z over the sine
    s2 = ((1.0 - c) * (1.0 + c))[None]
    # Where the sine is 0, its slope over the cosine is infinite, that of its square is not.
    sine = jnp.where(s2 > 0.0, jnp.sqrt(jnp.where(s2 > 0.0, s2, 1.0)), 0.0)
    s = across2.imag * _power(E_y)
    p = across2.imag * _power(E_x) + along2.imag * (s2 * _power(E_z))
    lost = (2.0 * jnp.pi / (wavelength * eta_i * c))[None]
    out = (E_x, E_y, as_complex(sine) * E_z, lost * s, lost * p)
    return DepthFields._make(jnp.sum(x, axis=0) for x in out)


def fields_at_depth(
    cos_theta_i: ArrayLike,
    index: IndexLike | Sequence[Any],
    *,
    thickness_um: ArrayLike | Sequence[Any],
    wavelength_um: ArrayLike,
    depth_um: ArrayLike,
) -> DepthFields:
    """Electric fields and absorbed power at given depths of a stack of coherent layers.

    Args:
        cos_theta_i, index, thickness_um, wavelength_um: as of `stack`, whose fast tier has these
            formulas: the first medium is lossless, and all layers are coherent.
        depth_um: micrometres below the first boundary; negative in the first medium, beyond all
            layers in the last. At a boundary the fields are those behind it.

    Returns:
        `DepthFields(E_x, E_y, E_z, absorption_s, absorption_p)` with `.absorption`, of the
        broadcast shape. The integral of an absorption over a layer is A of `stack`. Errors are
        within 200 eps for each radian of 2 pi |N| thickness / wavelength of all layers, relative to
        the larger of the two waves in the layer, or to what one eps of each argument does. Next to
        the critical angle of a layer its waves are large, cancel, and leave half of the digits.

    Derivatives with respect to every argument are those of the fields in their medium; a boundary
    that moves over a depth is not seen. Along the normal E_z grows as the sine, and 0 is returned
    for its infinite derivative by the cosine.

    Raises:
        ValueError: as `stack`; a first medium that absorbs.
    """
    index, _, media, along, thickness = read_media(index, thickness_um)
    c, wavelength, depth = (
        real(x, name)
        for x, name in (
            (cos_theta_i, "cos_theta_i"), (wavelength_um, "wavelength_um"), (depth_um, "depth_um"),
        )
    )  # fmt: skip
    check_cosine(c)
    check_positive(wavelength, "wavelength_um")
    first = lossless_first(index if isinstance(index, list | tuple) else media, "fields_at_depth")
    parts = (None if z is None else f(z) for z in (media, along) for f in (jnp.real, jnp.imag))
    floats = as_floats(c, first, wavelength, depth, thickness, *parts)
    shape = jnp.broadcast_shapes(
        *(x.shape for x in floats[:4]), *(x.shape[1:] for x in floats[4:] if x is not None)
    )
    c, first, wavelength, depth = (jnp.broadcast_to(x, shape) for x in floats[:4])
    wide: Any = (
        None if x is None
        else jnp.broadcast_to(behind_leading_axis(x, len(shape)), (len(x), *shape))
        for x in floats[4:]
    )  # fmt: skip
    d, n, k, n_e, k_e = wide
    along = None if n_e is None else jax.lax.complex(n_e, k_e)[1:]
    return _jit_fields(c, first, jax.lax.complex(n, k)[1:], along, d, wavelength, depth)
