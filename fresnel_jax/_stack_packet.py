"""A packet: coherent films between two media, seen from the side of the first one.

Media and layers come with their leading axis; the result has the broadcast shape.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array

from ._arithmetic import (
    Complex,
    conjugate_times,
    one_if_zero,
    reciprocal_or_zero,
    squared_modulus,
    times,
)
from ._double_word import DoubleWord
from ._stack_absorption import absorbed
from ._stack_coherent import (
    Ambient,
    Fields,
    far_fields,
    inverse,
    medium,
    minus,
    normal_flux,
    normal_squared,
    plus,
    rescaled,
    scaled,
    square,
    through_layer,
)
from ._stack_roughness import rough_boundary
from ._stack_wave import choose, wave

_UNROLLED = 2  # up to so many layers are written out; more run through one loop


class Packet(NamedTuple):
    """What a packet does to a wave of unit amplitude and unit power, each for s and p."""

    r: list[Complex]
    t: list[Complex]  # of E for s, of H for p
    R: list[Array]
    T: list[Array]
    absorption: tuple[Array, Array]  # leading axis: layers
    flux_in: tuple[Array, Array]


def _at(i: Any, tree: Any) -> Any:
    return jax.tree.map(lambda z: z[i], tree)


@jax.custom_jvp
def _reflected_amplitude(u: Complex, w: Complex, m: Complex, q0: Complex) -> Complex:
    """r = M / B, B = Q_0 U + W; and M = Q_0 U - W, where that loses nothing."""
    q0_u = times(q0, u)
    bottom = plus(q0_u, w)
    strong = squared_modulus(m) > 0.5 * squared_modulus(bottom)
    # Next to |r| = 1 the errors of Q_0 U - W are those of B, and cancel; those of M do not: R of a
    # guided mode at grazing incidence (cosine 1e-6) was off by 590 eps.
    return times(choose(strong, minus(q0_u, w), m), inverse(bottom))


@_reflected_amplitude.defjvp
def _reflected_amplitude_jvp(primals, tangents):
    (u, w, _, q0), (du, dw, dm, dq0) = primals, tangents
    q0_u = times(q0, u)
    per, d_q0_u = inverse(plus(q0_u, w)), plus(times(dq0, u), times(q0, du))
    r = _reflected_amplitude(*primals)
    weak = minus(dm, times(r, plus(d_q0_u, dw)))
    # Both terms of `weak` are near dW or Q_0 dU where |r| is near 1: at a cosine of 6e-6 their
    # difference left an error of 4,800 eps. Without M, dr is 2 Q_0 (W dU - U dW) / B^2.
    strong = scaled(2.0, minus(times(times(w, per), d_q0_u), times(times(q0_u, per), dw)))
    return r, times(choose(squared_modulus(r) > 0.5, strong, weak), per)


def _reflected_power(u: Complex, w: Complex, m: Complex, q0: Complex) -> Array:
    """|M|^2 / |B|^2, and 1 - 4 Re(conj(Q_0 U) W) / |B|^2 where most is reflected.

    In total reflection r only turns its phase: dR is what is left of a much larger dr.
    """
    q0_u = times(q0, u)
    bottom = one_if_zero(squared_modulus(plus(q0_u, w)))
    R = squared_modulus(m) / bottom
    return jnp.where(R > 0.5, 1.0 - 4.0 * (conjugate_times(q0_u, w)[0] / bottom), R)


def packet(
    front: Ambient,
    n: Array,
    k: Array | None,
    x: DoubleWord,
    shape: tuple[int, ...],
    roughness: Array | None = None,
) -> Packet:
    """The packet of the media n + ik, of which the first is the one of `front`.

    x is thickness / wavelength of the layers, roughness that of the boundaries over wavelength.
    """
    k0 = None if k is None else k[0]
    behind = medium(n[1:], None if k is None else k[1:], n[0], k0)
    layers, far = _at(slice(-1), behind), _at(-1, behind)
    n02 = square((front.n, front.k))
    q_far, fields = far_fields(far, front)
    fields = jax.tree.map(lambda z: jnp.broadcast_to(z, shape), fields)

    def rough(fields: Fields, sigma: Array, above: Any, below: Any) -> Fields:
        fields = rough_boundary(fields, sigma, above, below, front.q)
        return jax.tree.map(lambda z: jnp.broadcast_to(z, shape), fields)

    def step(carry, layer):
        fields, below = carry
        here, x, sigma = layer
        re, im = normal_squared(here, front)
        inside = wave(re, im, x, squared_modulus(front.q))
        if sigma is not None:
            above = (inside.q, here.g)
            fields = rough(fields, sigma, above, below)
            below = jax.tree.map(lambda z: jnp.broadcast_to(z, shape), above)
        media = (here.n2, here.g, here.per_g, n02, front.transverse2)
        ends = ((fields.u[0], fields.w[0]), (fields.u[1], fields.w[1]))
        losses = absorbed(ends, inside, re, im, x[0], media)
        passage2 = jnp.broadcast_to(squared_modulus(inside.passage), shape)
        fields = through_layer(fields, here, inside, front)
        return (fields, below), tuple((jnp.broadcast_to(z, shape), passage2) for z in losses)

    def scaled_step(carry, layer):
        fields, scales = rescaled(carry[0])
        carry, parts = step((fields, carry[1]), layer)
        return carry, tuple(
            (loss, passage2 * scale * scale)
            for (loss, passage2), scale in zip(parts, scales, strict=True)
        )

    below = jax.tree.map(lambda z: jnp.broadcast_to(z, shape), (q_far, far.g))
    carry = (fields, None if roughness is None else below)
    passed = (layers, x, None if roughness is None else roughness[1:])
    count = x[0].shape[0]
    if count <= _UNROLLED:
        parts = []
        for i in reversed(range(count)):
            carry, part = step(carry, _at(i, passed))
            parts.insert(0, part)
        losses = jax.tree.map(lambda *z: jnp.stack(z), *parts) if parts else None
    else:
        carry, losses = lax.scan(scaled_step, carry, passed, reverse=True)
    fields, below = carry
    if roughness is not None:
        one = (jnp.ones_like(front.n), None if k is None else jnp.zeros_like(front.n))
        fields = rough(fields, roughness[0], (front.q, one), below)
    whole = _packet(fields, front, far, q_far, losses, shape)
    if roughness is not None:
        return whole
    lossless = True if k is None else (k == 0.0).all(axis=0)
    return whole._replace(R=_all_of_it(whole.R, lossless & (q_far[0] == 0.0) & (q_far[1] > 0.0)))


def _all_of_it(R: list[Array], total: Array) -> list[Array]:
    """R where nothing absorbs and nothing leaves: exactly 1, with the derivatives that it has.

    The fields of a stack at grazing incidence know it to 101 eps.
    """
    return [jnp.where(total, r + lax.stop_gradient(1.0 - r), r) for r in R]


def _packet(fields, front, far, q_far, losses, shape):
    n02 = square((front.n, front.k))
    flux_in = normal_flux(front.q, front.transverse2, n02)
    flux_out = normal_flux(q_far, front.transverse2, far.n2)
    r, t, R, T, absorption = [], [], [], [], []
    for i, n2 in enumerate(((1.0, None), n02)):
        u, w, m, f = (z[i] for z in fields)
        bottom = plus(times(front.q, u), w)
        per = inverse(bottom)
        # Matched media at grazing incidence: nothing is left to reflect, and all goes through.
        matched = squared_modulus(bottom) == 0.0
        r.append(_reflected_amplitude(u, w, m, front.q))
        through = times(f, per)
        amplitude = times(scaled(2.0, front.q), through)
        t.append((jnp.where(matched, 1.0, amplitude[0]), amplitude[1]))
        R.append(jnp.where(matched, 0.0, _reflected_power(u, w, m, front.q)))
        if front.k is None and front.q[1] is None:
            # |Q_0|^2 / flux_in, without a division by a cosine of 0
            gain = 4.0 * front.q[0] * n2[0]
        else:
            gain = 4.0 * squared_modulus(front.q) * reciprocal_or_zero(flux_in[i])
        T.append(jnp.where(matched, 1.0, gain * flux_out[i] * squared_modulus(through)))
        if losses is None:
            absorption.append(jnp.zeros((0, *shape), R[i].dtype))
            continue
        light = jnp.broadcast_to(gain * squared_modulus(per), shape)

        def into_next(light, layer):
            loss, passed = layer
            return light * passed, light * loss

        absorption.append(lax.scan(into_next, light, losses[i])[1])
    return Packet(r, t, R, T, (absorption[0], absorption[1]), flux_in)
