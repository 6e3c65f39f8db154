"""Packets of coherent films, and stacks of packets between which light does not interfere.

A packet lies between two media and is seen from the side of the first one; media and layers come
with their leading axis, and the result has the broadcast shape. A coherent stack is one packet.

Layers that are too thick for interference, or in which the light is too broad for it, cut a stack
into packets. Powers, not amplitudes, are summed over the reflections
in an incoherent layer, whose single pass lets through P = exp(-2 k_0 thickness Im Q). With R, R' of
a packet from its front and its back and T,

    R_total = R + T^2 P^2 R_next / (1 - R' P^2 R_next)

from the far side on, R_next being what all the rest reflects. T of a packet is the same in both
directions; between a lossless and an absorbing medium it is the power that enters the absorbing
one, as in `layers.slab`. What light inside an absorbing layer loses where it meets its own
reflection counts as absorbed in that layer.

The wave that an absorbing first medium sends obliquely into a clear layer grows with the depth
(Im Q < 0, P > 1): it comes from where the light was stronger. Where the sum over the reflections
then diverges the result is NaN.

Source: O. S. Heavens, Optical Properties of Thin Solid Films, 1955, sec. 4.11.
"""

import itertools
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array

from .._numerics.arithmetic import one_if_zero, reciprocal_or_zero
from .._numerics.complex import Complex, Pair, inverse, pair, scaled, square, squared_modulus, times
from .._numerics.double_word import DoubleWord
from .._numerics.fences import computed_once
from .coherent import (
    Ambient,
    Medium,
    Solved,
    at,
    boundary_factors,
    medium,
    normal_flux,
    normal_squared,
    outgoing_root,
)
from .derivative import solve
from .uniaxial import Extraordinary, medium_of_p
from .wave import wave


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
    e: Extraordinary | None = None,
) -> Packet:
    """The packet of the media n + ik, of which the first is the one of `front`.

    x is thickness / wavelength of the layers, roughness that of the boundaries over wavelength; q2
    is Q^2 of all media but the first, where it is known already, e their extraordinary index.
    """
    k0 = None if k is None else k[0]
    behind = medium(n[1:], None if k is None else k[1:], n[0], k0)._replace(q2=q2)
    if e is None:
        return _of_media(front, behind, None, k, x, shape, roughness)
    s = _of_media(front, behind, None, k, x, shape, None)
    both = None if k is None or e.k is None else jnp.maximum(k, e.k)
    p = _of_media(front, *medium_of_p(behind, front, n, k, e), both, x, shape, None)
    return Packet(*(type(x)((x[0], y[1])) for x, y in zip(s, p, strict=True)))  # type: ignore


def _of_media(
    front: Ambient,
    behind: Medium,
    q_far: Pair | None,
    k: Array | None,
    x: DoubleWord,
    shape: tuple[int, ...],
    roughness: Array | None,
) -> Packet:
    """`packet` of the media behind `front`; q_far: Q of the last, if it is not the root of Q^2."""
    # Without a division the compiler writes these sums anew into each of some thirty loops.
    front, behind, x = jax.tree.map(computed_once, (front, behind, x))
    layers, far = at(slice(-1), behind), at(-1, behind)
    q_far = outgoing_root(*normal_squared(far, front)) if q_far is None else q_far
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
    # Smooth films are even in Q, rough boundaries are not: with Im Q >= 0 the wave in a clear film
    # behind a medium of k = 1e-14 ran backward, and T had the squared factors of both faces in it.
    q_layers = outgoing_root(*normal_squared(layers, at(None, front)))
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


class _Face(NamedTuple):
    """One side of a packet, for one polarization: what becomes of light that meets it."""

    R: Array
    T: Array
    absorption: Array  # leading axis: the packet's layers, from this side
    own: Array  # lost in the medium that the light comes from


def _faces(seen: Packet, front: Ambient, inside: bool) -> list[_Face]:
    """What becomes of s and p light that meets the packet; inside: from an incoherent layer."""
    n2 = square((front.n, front.k))
    admittances = (front.q, times(front.q, inverse(n2)))
    faces = []
    for r, R, T, A, y in zip(seen.r, seen.R, seen.T, seen.absorption, admittances, strict=True):
        own = jnp.zeros_like(R)
        if inside and y[1] is not None:
            per = reciprocal_or_zero(squared_modulus(y))
            share = y[0] * y[0] * per
            T, A = T * share, A * share[None]
            # Of unit light in the medium itself, 1 - R - T - sum(A); as the difference of what
            # crosses the boundary and of R, A beyond the critical angle was 8e8 eps off.
            own = y[1] * per * (y[1] * (1.0 - R) - 2.0 * y[0] * pair(r)[1])
        faces.append(jax.tree.map(computed_once, _Face(R, T, A, own)))
    return faces


def _carried_together(seen: Packet, front: Ambient) -> list[Array | float]:
    """2 Im(r) Im(Y) / Re(Y), by which R + T + sum(A) exceeds 1 in an absorbing first medium.

    Its Y are N cos(theta) and cos(theta) / N, whose ratios hold at a cosine of 0.
    """
    if front.k is None:
        return [0.0, 0.0]
    ratio = front.k * reciprocal_or_zero(front.n)
    return [2.0 * pair(r)[1] * y for r, y in zip(seen.r, (ratio, -ratio), strict=True)]


def _crossing(face: _Face) -> Array:
    """What leaves the medium that the light comes from: T and what the films absorb."""
    return face.T + jnp.sum(face.absorption, axis=0)


def _absorbed(face: _Face) -> Array:
    """1 - R - T, without the subtraction: what the films absorb and the medium itself loses."""
    return jnp.sum(face.absorption, axis=0) + face.own


def _lost(face: _Face) -> Array:
    """1 - R, without the subtraction."""
    return face.T + _absorbed(face)


def _one_polarization(
    fronts: list[_Face],
    backs: list[_Face],
    passages: list[tuple[Array, Array]],
    together: Array | float,
) -> tuple[Array, Array, list[Array]]:
    """R, T and the absorptions of films and incoherent layers in turn; passages are P and 1 - P,
    together is the power that incident and reflected wave carry together."""
    R, lost = fronts[-1].R, _lost(fronts[-1])
    going_on: list[tuple[Array, Array, Array]] = []
    returned = jnp.zeros_like(R)  # the part of R from behind the packet at hand
    for front, back, (P, gone) in reversed(list(zip(fronts[:-1], backs, passages, strict=True))):
        # 1 - R' P^2 R, without cancellation for mirrors that face each other. Where a film guides a
        # mode evanescent light meets an R' far above 1, and its 1 - R' would cancel in turn.
        mirrors = _lost(back) + back.R * (gone * (1.0 + P) + P * P * lost)
        reflections = jnp.where(back.R > 2.0, 1.0 - back.R * P * P * R, mirrors)
        summed = jnp.where((gone < 0.0) & (reflections <= 0.0), jnp.nan, front.T)
        down = computed_once(summed * reciprocal_or_zero(reflections))
        going_on.insert(0, (down, R, returned))
        lost = _absorbed(front) + down * (
            gone * (1.0 + P * R) + P * lost + P * P * R * _absorbed(back)
        )
        returned = down * back.T * P * P * R
        R, lost, returned = map(computed_once, (front.R + returned, lost, returned))
    # In total reflection r turns fast and R stays: formed from that of r, its derivative was off by
    # 1,130 eps of R; from what is absorbed and transmitted, by 1.
    given = together - lost
    R = jnp.where(R > 0.5, lax.stop_gradient(R - given) + given, R)
    light, absorptions = jnp.ones_like(R), []
    for i, (P, gone) in enumerate(passages):
        down, R_next, returned = going_on[i]
        down = light * down
        up = down * P * P * R_next
        films = light[None] * fronts[i].absorption + up[None] * backs[i].absorption[::-1]
        entered, light = light * fronts[i].T, down * P
        layer = down * gone * (1.0 + P * R_next) + up * backs[i].own + light * fronts[i + 1].own
        # Evanescent light meets an R far above 1 at a film that guides a mode, and what it loses in
        # the layer and at its end cancel: A was 80 eps off. Where at most half of what enters the
        # layer leaves it, the difference of both is exact.
        left = light * _crossing(fronts[i + 1]) + up * _crossing(backs[i])
        layer = jnp.where(left < 0.5 * entered, entered - (left - light * returned), layer)
        absorptions += [films, layer[None]]
    absorptions.append(light[None] * fronts[-1].absorption)
    return R, light * fronts[-1].T, absorptions


def mixed(
    front: Ambient,
    n: Array,
    k: Array | None,
    x: DoubleWord,
    coherent: tuple[bool, ...],
    shape: tuple[int, ...],
    e: Extraordinary | None = None,
) -> tuple[list[Array], list[Array], list[Array]]:
    """R, T and the absorption of every layer, each for s and p."""
    edges = [0, *(i + 1 for i, with_phase in enumerate(coherent) if not with_phase)]
    edges.append(n.shape[0] - 1)
    fronts, backs, passages, together = [], [], [], []
    # Of all media from the first one: formed from Q^2 of an incoherent layer, Q_0^2 next to grazing
    # incidence had derivatives that cancel (6e5 eps in those of T).
    q2 = normal_squared(medium(n, k, n[0], None if k is None else k[0]), at(None, front))
    ambients = [front]
    for i in edges[1:-1]:
        q2_i = at(i, q2)
        k_i = None if k is None else k[i]
        q_i = jax.tree.map(computed_once, outgoing_root(*q2_i))
        ambients.append(Ambient(n[i], k_i, q_i, q2_i, front.transverse2))
    for p, (first, last) in enumerate(itertools.pairwise(edges)):
        n_here, k_here = n[first : last + 1], None if k is None else k[first : last + 1]
        x_here = (x[0][first : last - 1], x[1][first : last - 1])
        q2_here = at(slice(first, last + 1), q2)
        q2_behind, e_here = at(slice(1, None), q2_here), at(slice(first, last + 1), e)
        seen = packet(ambients[p], n_here, k_here, x_here, shape, None, q2_behind, e_here)
        if p == 0:
            together = _carried_together(seen, front)
        fronts.append(_faces(seen, ambients[p], inside=p > 0))
        if p + 1 < len(ambients):
            turned = None if k_here is None else k_here[::-1]
            x_turned = (x_here[0][::-1], x_here[1][::-1])
            q2_turned = at(slice(-2, None, -1), q2_here)
            n_turned, e_turned = n_here[::-1], at(slice(None, None, -1), e_here)
            seen = packet(
                ambients[p + 1], n_turned, turned, x_turned, shape, None, q2_turned, e_turned
            )
            backs.append(_faces(seen, ambients[p + 1], inside=True))
            passages.append(_passage(ambients[p + 1], (x[0][last - 1], x[1][last - 1])))
    out = [
        _one_polarization([f[i] for f in fronts], [b[i] for b in backs], passages, together[i])
        for i in range(2)
    ]
    absorptions = [
        jnp.concatenate([jnp.broadcast_to(a, (a.shape[0], *shape)) for a in parts])
        for _, _, parts in out
    ]
    return [R for R, _, _ in out], [T for _, T, _ in out], absorptions


def _passage(inside: Ambient, x: DoubleWord) -> tuple[Array, Array]:
    """P of an incoherent layer, and 1 - P."""
    depth = 4.0 * jnp.pi * x[0] * pair(inside.q)[1]
    # |f|^2 has more digits than exp(-depth), but in its derivative that of the phase cancels, by
    # 2e5 eps in a window of 1 cm: the derivative is that of the exponential.
    exact = squared_modulus(wave(*inside.q2, x, squared_modulus(inside.q)).passage)
    exact = jnp.where(depth < 0.0, jnp.exp(-depth), jnp.minimum(exact, 1.0))
    P = lax.stop_gradient(exact) * jnp.exp(lax.stop_gradient(depth) - depth)
    return P, -jnp.expm1(-depth)
