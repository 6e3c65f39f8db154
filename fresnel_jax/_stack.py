"""The public function `stack` of `layers`: any number of layers between two half-spaces."""

import functools
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, ArrayLike

from ._arithmetic import squared_modulus, times
from ._boundary import unsigned
from ._double_word import ratio
from ._stack_coherent import (
    UNROLLED,
    ambient,
    far_fields,
    inverse,
    layer_wave,
    medium,
    normal_flux,
    reflected,
    scaled,
    square,
    through_layer,
)


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

    @property
    def R(self) -> Array:
        """Reflectance of unpolarized light."""
        return 0.5 * (self.R_s + self.R_p)

    @property
    def T(self) -> Array:
        """Transmittance of unpolarized light."""
        return 0.5 * (self.T_s + self.T_p)


def _at(i, tree):
    return jax.tree.map(lambda z: z[i], tree)


def _coherent(c, n, k, thickness, wavelength, shape):
    front = ambient(c, n[0], None if k is None else k[0])
    behind = medium(n[1:], None if k is None else k[1:], n[0], None if k is None else k[0])
    x = ratio(thickness, wavelength)
    layers, far = _at(slice(-1), behind), _at(-1, behind)
    q_far, fields = far_fields(far, front)
    fields = jax.tree.map(lambda z: jnp.broadcast_to(z, shape), fields)

    def step(fields, layer):
        here, x = layer
        out = through_layer(fields, here, layer_wave(here, x, front), front)
        return out, None

    count = thickness.shape[0]
    if count <= UNROLLED:
        for i in reversed(range(count)):
            fields, _ = step(fields, _at(i, (layers, x)))
    else:
        fields, _ = lax.scan(step, fields, (layers, x), reverse=True)
    return _powers(fields, front, far, q_far)


def _powers(fields, front, far, q_far):
    r, through = reflected(fields, front)
    n02 = square((front.n, front.k))
    into = normal_flux(front.q, front.transverse2, n02)
    out = normal_flux(q_far, front.transverse2, far.n2)
    R = [squared_modulus(z) for z in r]
    t = [times(scaled(2.0, front.q), z) for z in through]
    T = []
    for z, flux_in, flux_out, n2 in zip(through, into, out, ((1.0, None), n02), strict=True):
        if front.k is None:
            # flux_in / |Q_0|^2 is 1 / (Q_0 n2): no division by a cosine of 0
            T.append(4.0 * front.q[0] * n2[0] * flux_out * squared_modulus(z))
        else:
            T.append(4.0 * squared_modulus(front.q) * flux_out / flux_in * squared_modulus(z))
    return r, R, t, T


@functools.partial(jax.jit, static_argnums=5)
def _jit_stack(c, n, k, thickness, wavelength, shape):
    r, R, t, T = _coherent(unsigned(c)[0], n, k, thickness, wavelength, shape)
    n_far = (n[-1], None if k is None else k[-1])
    n_front = (n[0], None if k is None else k[0])
    t[1] = times(t[1], times(n_front, inverse(n_far)))
    values = (*R, *T, *(lax.complex(*z) for z in (*r, *t)))
    return Stack(*(jnp.broadcast_to(z, shape) for z in values))


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
