"""A packet: coherent films between two media, seen from the side of the first one.

Media and layers come with their leading axis; the result has the broadcast shape.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array

from .._numerics.arithmetic import one_if_zero, reciprocal_or_zero
from .._numerics.complex import Complex, Pair, pair, scaled, square, squared_modulus, times
from .._numerics.double_word import DoubleWord
from .._numerics.fences import computed_once
from .coherent import (
    Ambient,
    Medium,
    at,
    decaying_root,
    medium,
    normal_flux,
    normal_squared,
    outgoing_root,
)
from .derivative import solve
from .fields import Solved
from .roughness import boundary_factors


class Packet(NamedTuple):
    """What a packet does to a wave of unit amplitude and unit power, each for s and p."""

    r: list[Complex]
    t: list[Complex]  # of E for s, of H for p
    R: list[Array]
    T: list[Array]
    absorption: tuple[Array, Array]  # leading axis: layers


def packet(
    front: Ambient,
    n: Array,
    k: Array | None,
    x: DoubleWord,
    shape: tuple[int, ...],
    roughness: Array | None = None,
    q2: Any = None,
) -> Packet:
    """The packet of the media n + ik, of which the first is the one of `front`.

    x is thickness / wavelength of the layers, roughness that of the boundaries over wavelength; q2
    is Q^2 of all media but the first, where it is known already.
    """
    k0 = None if k is None else k[0]
    behind = medium(n[1:], None if k is None else k[1:], n[0], k0)._replace(q2=q2)
    # Without a division the compiler writes these sums anew into each of some thirty loops.
    front, behind, x = jax.tree.map(computed_once, (front, behind, x))
    layers, far = at(slice(-1), behind), at(-1, behind)
    q_far = outgoing_root(*normal_squared(far, front))
    if roughness is not None:
        rough = _rough(roughness, front, layers, far, q_far, shape)
        return _packet(solve(front, layers, far, q_far, x, rough, shape), front, far, q_far, shape)
    whole = _packet(solve(front, layers, far, q_far, x, None, shape), front, far, q_far, shape)
    lossless = True if k is None else (k == 0.0).all(axis=0)
    return whole._replace(R=_all_of_it(whole.R, lossless & (q_far[0] == 0.0) & (q_far[1] > 0.0)))


def _rough(roughness: Array, front: Ambient, layers: Medium, far: Medium, q_far: Pair, shape):
    """`boundary_factors` of all boundaries, in the broadcast shape."""

    def joined(*parts):
        return jnp.concatenate([jnp.broadcast_to(z, (len(z), *shape)) for z in parts])

    ends = [jax.tree.map(lambda z: z[None], pair(z)) for z in (front.q, q_far, far.g)]
    one = (jnp.ones_like(ends[0][0]), jnp.zeros_like(ends[0][0]))
    q_layers = decaying_root(*normal_squared(layers, at(None, front)))
    q = jax.tree.map(joined, ends[0], q_layers, ends[1])
    g = jax.tree.map(joined, one, pair(layers.g), ends[2])
    return boundary_factors(roughness, q, g)


def _all_of_it(R: list[Array], total: Array) -> list[Array]:
    """R where nothing absorbs and nothing leaves: exactly 1, with the derivatives that it has.

    The fields of a stack at grazing incidence know it to 101 eps.
    """
    return [jnp.where(total, r + lax.stop_gradient(1.0 - r), r) for r in R]


def _transmitted(gain: Array, through: Complex) -> Array:
    """gain |through|^2. In float32, parts below 1e-19 are lifted: their squares underflow."""
    if gain.dtype == jnp.float64:
        return gain * squared_modulus(through)
    small = squared_modulus(through) < 2.0**40 * float(jnp.finfo(gain.dtype).tiny)
    lift, per_lift2 = jnp.where(small, 2.0**30, 1.0), jnp.where(small, 2.0**-60, 1.0)
    lifted = scaled(lift.astype(gain.dtype), through)
    return gain * per_lift2.astype(gain.dtype) * squared_modulus(lifted)


def _gains(front: Ambient, n02: Complex) -> tuple[Array, Array]:
    """4 |Q_0|^2 / flux_in for s and p, whose flux is Re Q_0 and Re(Q_0 / N_0^2).

    By Im Q_0 / Re Q_0, since the reciprocal of a flux at a cosine of 0 has no derivative, and one
    close to it has factors that underflow in float32.
    """
    re, im = front.q
    if im is None:
        return 4.0 * re, 4.0 * re * n02[0]
    at_grazing = 0.0 if front.k is None else front.k * reciprocal_or_zero(front.n)
    ratio = jnp.where(re == 0.0, at_grazing, im / one_if_zero(re))
    moduli = squared_modulus(front.q) + front.transverse2[0]
    if front.transverse2[1] is not None:
        moduli = moduli + ratio * front.transverse2[1]
    s = 4.0 * (re + im * ratio)
    return s, s * (squared_modulus(n02) * reciprocal_or_zero(moduli))


def _packet(solved: Solved, front: Ambient, far: Medium, q_far: Pair, shape) -> Packet:
    n02 = square((front.n, front.k))
    gains = _gains(front, n02)
    flux_out = normal_flux(q_far, far.n2)
    t, R, T, absorption = [], [], [], []
    for i, gain in enumerate(gains):
        through = solved.through[i]
        # Matched media at grazing incidence: nothing is left to reflect, and all goes through.
        matched = solved.nothing[i]
        amplitude = times(scaled(2.0, front.q), through)
        t.append((jnp.where(matched, 1.0, amplitude[0]), amplitude[1]))
        R.append(jnp.where(matched, 0.0, solved.R[i]))
        T.append(jnp.where(matched, 1.0, _transmitted(gain * flux_out[i], through)))
        lost = solved.absorbed[i]
        absorption.append(jnp.zeros((0, *shape), R[i].dtype) if lost is None else gain[None] * lost)
    return Packet(list(solved.r), t, R, T, (absorption[0], absorption[1]))
