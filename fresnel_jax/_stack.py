"""The public function `stack` of `layers`: any number of layers between two half-spaces."""

import functools
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, ArrayLike

from ._arithmetic import times
from ._boundary import unsigned
from ._double_word import ratio
from ._stack_coherent import ambient, inverse
from ._stack_packet import packet


class Stack(NamedTuple):
    """What a stack of layers reflects, transmits and absorbs, for s and p polarization.

    Powers are fractions of the incident power, of the broadcast shape; the absorptions have the
    layers on their leading axis. The amplitudes are complex.
    """

    R_s: Array
    R_p: Array
    T_s: Array
    T_p: Array
    r_s: Array
    r_p: Array
    t_s: Array
    t_p: Array
    A_s: Array
    A_p: Array

    @property
    def R(self) -> Array:
        """Reflectance of unpolarized light."""
        return 0.5 * (self.R_s + self.R_p)

    @property
    def T(self) -> Array:
        """Transmittance of unpolarized light."""
        return 0.5 * (self.T_s + self.T_p)

    @property
    def A(self) -> Array:
        """Absorptance of every layer for unpolarized light; layers on the leading axis."""
        return 0.5 * (self.A_s + self.A_p)


@functools.partial(jax.jit, static_argnums=5)
def _jit_stack(c, n, k, thickness, wavelength, shape):
    front = ambient(unsigned(c)[0], n[0], None if k is None else k[0])
    whole = packet(front, n, k, ratio(thickness, wavelength), shape)
    n_far = (n[-1], None if k is None else k[-1])
    t_p = times(whole.t[1], times((front.n, front.k), inverse(n_far)))
    amplitudes = (lax.complex(*z) for z in (*whole.r, whole.t[0], t_p))
    values = (jnp.broadcast_to(z, shape) for z in (*whole.R, *whole.T, *amplitudes))
    return Stack(*values, *whole.absorption)


def _media(values: Any, name: str, least: int) -> Array:
    """An array with the media or layers on its leading axis, from an array or a sequence."""
    if isinstance(values, (list, tuple)):
        try:
            values = jnp.stack(jnp.broadcast_arrays(*values)) if values else jnp.zeros((0,))
        except ValueError:
            shapes = ", ".join(str(jnp.shape(z)) for z in values)
            raise ValueError(
                f"the entries of {name} have the shapes {shapes}, which do not broadcast"
            ) from None
    values = jnp.asarray(values)
    if values.ndim == 0 or values.shape[0] < least:
        raise ValueError(
            f"{name} has the shape {values.shape}; its leading axis counts the "
            + ("media: before the stack, each layer, behind it" if least else "layers")
        )
    return values


def stack(
    cos_theta_i: ArrayLike,
    index: ArrayLike,
    thickness_um: ArrayLike,
    wavelength_um: ArrayLike,
    coherent: bool = True,
) -> Stack:
    """Amplitudes and powers of a stack of films between two half-spaces, for s and p polarization.

    Args:
        cos_theta_i: cosine of the angle of incidence in the first medium, in [-1, 1]; its sign is
            ignored.
        index: absolute indices eta + ik, k >= 0, of the L + 2 media, from the one that the light
            comes from to the one behind, on the leading axis; real (faster) or complex. What
            follows the leading axis broadcasts with the other arguments. A list or tuple of
            entries that broadcast with each other is stacked.
        thickness_um: micrometres, >= 0, of the L layers, on the leading axis; likewise.
        wavelength_um: vacuum wavelength in micrometres, > 0.
        coherent: True.

    Returns:
        `Stack`.

    Raises:
        ValueError: shapes that do not fit each other, or a complex argument other than index.
    """
    media: Array = _media(index, "index", 2)
    thickness: Array = _media(thickness_um, "thickness_um", 0)
    for name, value in (
        ("cos_theta_i", cos_theta_i),
        ("thickness_um", thickness),
        ("wavelength_um", wavelength_um),
    ):
        if jnp.iscomplexobj(value):
            raise ValueError(f"{name} is complex, a real number is wanted; only index is complex")
    if media.shape[0] != thickness.shape[0] + 2:
        raise ValueError(
            f"index has {media.shape[0]} media and thickness_um {thickness.shape[0]} layers on "
            "their leading axes; L layers lie between L + 2 media"
        )
    shapes = (
        jnp.shape(cos_theta_i),
        media.shape[1:],
        thickness.shape[1:],
        jnp.shape(wavelength_um),
    )
    try:
        shape = jnp.broadcast_shapes(*shapes)
    except ValueError:
        raise ValueError(
            "the shapes of cos_theta_i, index and thickness_um after their leading axes, and "
            f"wavelength_um, {', '.join(map(str, shapes))}, do not broadcast to one shape; "
            "add axes of length 1 so that they do"
        ) from None
    dtype = jnp.result_type(cos_theta_i, jnp.real(media), thickness, wavelength_um, 1.0)

    def layered(z):
        z = jnp.asarray(z, dtype)
        return z.reshape(z.shape[:1] + (1,) * (len(shape) - z.ndim + 1) + z.shape[1:])

    n = layered(jnp.real(media))
    k = layered(jnp.imag(media)) if jnp.iscomplexobj(media) else None
    c, wavelength = jnp.asarray(cos_theta_i, dtype), jnp.asarray(wavelength_um, dtype)
    return _jit_stack(c, n, k, layered(thickness), wavelength, shape)
