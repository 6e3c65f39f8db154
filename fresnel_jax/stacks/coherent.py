"""Coherent films between two half-spaces: amplitudes and powers for s and p polarization.

Media 0 ... L + 1 of index N_j, of which 0 and L + 1 are half-spaces; K = N_0 sin(theta) is the same
in all. With Q_j^2 = N_j^2 - K^2 and g = 1 for s, g = N_j^2 / N_0^2 for p, a layer maps the
tangential fields (U, W) at its far side to those at its near side, C and sigma as in `_stack_wave`:

    U' = C U + sigma g W,        W' = C W + (Q^2 sigma / g) U.

What is reflected is M = Q_0 U - W over Q_0 U + W. Formed by that subtraction, M would lose its
digits wherever little is reflected (X-rays, index match, thick weak absorbers), so it is carried
along, in a form that subtracts nothing that agrees:

    M' = E M + sigma h ((Q / g) U + W),
                                  h_s = -(N^2 - N_0^2) / (Q + Q_0),
                                  h_p = (N^2 - N_0^2)(g Q_0^2 - K^2) / (N_0^2 (Q + g Q_0)).

It starts at the far half-space with U = 1, W = Q / g, M = h / g. The fields are divided by a power
of two in every layer, so that a mirror of a thousand layers overflows as little as one layer.

Source of the matrices: M. Born and E. Wolf, Principles of Optics, 7th ed., sec. 1.6.2. For the
roughness of a boundary: L. Nevot and P. Croce 1980, doi:10.1051/rphysap:01980001503076100.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array

from .._numerics.arithmetic import reciprocal_or_zero
from .._numerics.complex import (
    Complex,
    Pair,
    choose,
    inverse,
    minus,
    pair,
    plus,
    scaled,
    square,
    squared_modulus,
    times,
)
from .._numerics.double_word import (
    DoubleWord,
    difference_of_squares,
    negative,
    product_squared,
    total,
    twice_product,
)
from .wave import Wave, root


class Ambient(NamedTuple):
    """The half-space that the light comes from."""

    n: Array
    k: Array | None
    q: Complex  # N_0 cos(theta)
    q2: tuple[DoubleWord, DoubleWord | None]  # its square
    transverse2: Complex  # K^2


class Medium(NamedTuple):
    """What a layer or half-space of index N is beside the ambient of index N_0."""

    contrast: tuple[DoubleWord, DoubleWord | None]  # N^2 - N_0^2
    n2: Complex  # N^2
    g: Complex  # N^2 / N_0^2
    per_g: Complex  # N_0^2 / N^2
    q2: Any = None  # Q^2, if it is not to be formed from the contrast and Q_0^2


ONE: Any = (1.0, None)  # g of s
ZERO: Any = (0.0, 0.0)


class Fields(NamedTuple):
    """U, W, M and the product of all f, each for s and p, in units of a power of two."""

    u: tuple[Pair, Pair]
    w: tuple[Pair, Pair]
    m: tuple[Pair, Pair]
    f: tuple[Pair, Pair]


def at(i: Any, tree: Any) -> Any:
    """The entries i of the leading axis of every array of a tree; None: a new leading axis."""
    return jax.tree.map(lambda z: z[i], tree)


def ambient(c: Array, n: Array, k: Array | None) -> Ambient:
    s2 = (1.0 - c) * (1.0 + c)
    nc = product_squared(n, c)
    if k is None:
        return Ambient(n, None, (n * c, None), (nc, None), (n * n * s2, None))
    kc = product_squared(k, c)
    cross = twice_product(n * c, k * c)
    n2 = square((n, k))
    return Ambient(n, k, (n * c, k * c), (total(nc, negative(kc)), cross), scaled(s2, n2))


def medium(n: Array, k: Array | None, n0: Array, k0: Array | None) -> Medium:
    """Media on the leading axis beside the ambient, whose index has no such axis."""
    re, im = difference_of_squares(n, n0[None]), None
    if k is not None:
        k_front = jnp.zeros_like(k) if k0 is None else k0[None]
        re = total(re, negative(difference_of_squares(k, k_front)))
        im = twice_product(n, k)
        if k0 is not None:
            im = total(im, negative(at(None, twice_product(n0, k0))))
    n2, n02 = square((n, k)), square((n0, k0))
    return Medium(
        (re, im), n2, times(n2, at(None, inverse(n02))), times(at(None, n02), inverse(n2))
    )


def normal_squared(here: Medium, front: Ambient) -> tuple[DoubleWord, DoubleWord | None]:
    """Q^2 of a medium, (N^2 - N_0^2) + Q_0^2: exact for matched media, and at grazing incidence."""
    if here.q2 is not None:
        return here.q2
    (d_re, d_im), (a_re, a_im) = here.contrast, front.q2
    if d_im is None or a_im is None:
        im = d_im if a_im is None else a_im
    else:
        im = total(d_im, a_im)
    return total(d_re, a_re), im


def mismatches(here: Medium, front: Ambient, q: Pair) -> tuple[Pair, Pair]:
    """h_s = Q_0 - Q and h_p = g Q_0 - Q, without the subtraction.

    But behind an absorbing medium Im Q >= 0 may be the wave that runs backward. Where the two have
    opposite signs, subtracting loses nothing, and the sums below would cancel: next to Brewster's
    angle R_p was 1,355 eps off.
    """
    contrast = (here.contrast[0][0], None if here.contrast[1] is None else here.contrast[1][0])
    n02 = square((front.n, front.k))
    y = minus(times(here.g, square(front.q)), front.transverse2)

    def quotients(q_s: Pair, q_p: Pair) -> tuple[Pair, Pair]:
        h_s = times(scaled(-1.0, contrast), inverse(plus(q_s, front.q)))
        below = plus(times(n02, q_p), times(here.n2, front.q))
        return h_s, times(times(contrast, y), inverse(below))

    if front.k is None:
        return quotients(q, q)
    firsts = pair(front.q), times(here.g, front.q)
    backward = [z[0] * q[0] + z[1] * q[1] < 0.0 for z in firsts]
    # The sign of Q is turned where the quotient is not taken: its derivative must be finite, too.
    h = quotients(*(choose(z, scaled(-1.0, q), q) for z in backward))
    h_s, h_p = (choose(b, minus(z, q), x) for b, z, x in zip(backward, firsts, h, strict=True))
    return h_s, h_p


@jax.custom_jvp
def mismatches_of_layer(near: Array, here: Medium, front: Ambient, q: Pair) -> tuple[Pair, Pair]:
    """`mismatches`; near the layer's critical angle with the derivatives of Q_0 - Q and g Q_0 - Q,
    in which that of Q is left out as in `wave`."""
    return mismatches(here, front, q)


@mismatches_of_layer.defjvp
def _mismatches_of_layer_jvp(primals, tangents):
    near, here, front, q = primals
    _, d_here, d_front, dq = tangents
    h, far = jax.jvp(mismatches, (here, front, q), (d_here, d_front, dq))
    gained = plus(times(d_here.g, front.q), times(here.g, d_front.q))
    close = minus(d_front.q, dq), minus(gained, dq)
    return h, (choose(near, close[0], far[0]), choose(near, close[1], far[1]))


@jax.custom_jvp
def _deviation(near, u, w, m, q_over_g, wave_e, step, u_new, w_new, q0):
    """M' of one layer; near the layer's critical angle its derivative is that of Q_0 U' - W'."""
    return plus(times(wave_e, m), times(step, plus(times(q_over_g, u), w)))


@_deviation.defjvp
def _deviation_jvp(primals, tangents):
    near, u, w, m, q_over_g, wave_e, step, u_new, _, q0 = primals
    _, du, dw, dm, dq_over_g, dwave_e, dstep, du_new, dw_new, dq0 = tangents
    down = plus(times(q_over_g, u), w)
    d_down = plus(plus(times(dq_over_g, u), times(q_over_g, du)), dw)
    far = plus(
        plus(times(dwave_e, m), times(wave_e, dm)), plus(times(dstep, down), times(step, d_down))
    )
    close = minus(plus(times(q0, du_new), times(dq0, u_new)), dw_new)
    return plus(times(wave_e, m), times(step, down)), choose(near, close, far)


def _power_of_two_below(x: Array) -> Array:
    """1 / 2^e with 2^e <= x < 2^(e + 1), by the bits of the float; x > 0."""
    bits, field = (jnp.int64, 0x7FF) if x.dtype == jnp.float64 else (jnp.int32, 0xFF)
    shift = 52 if bits == jnp.int64 else 23
    exponent = lax.bitcast_convert_type(lax.stop_gradient(x), bits) & bits(field << shift)
    exponent = jnp.clip(exponent, bits(1 << shift), bits((field - 2) << shift))
    return lax.bitcast_convert_type(bits((field - 1) << shift) - exponent, x.dtype)


def rescaled(fields: Fields) -> tuple[Fields, tuple[Array, Array]]:
    """The fields divided by a power of two near their size, and one over it, for s and p.

    Only of fields that stand in memory, as the carry of a loop does: XLA computes a scale once for
    every array that needs it, and rounding differently next to a power of two it gave different
    scales, hence fields wrong by a factor of 2.
    """
    scales = tuple(
        _power_of_two_below(
            jnp.maximum(
                jnp.maximum(jnp.abs(u[0]), jnp.abs(u[1])), jnp.maximum(jnp.abs(w[0]), jnp.abs(w[1]))
            )
        )
        for u, w in zip(fields.u, fields.w, strict=True)
    )
    s, p = scales
    return Fields(*((scaled(s, z_s), scaled(p, z_p)) for z_s, z_p in fields)), (s, p)


def crossed(u: Pair, w: Pair, layer: Wave, g: Complex, per_g: Complex) -> tuple[Pair, Pair]:
    """The fields (U, W) at the other side of a layer; g and 1 / g are 1 for s."""
    over_q, q_sine = times(g, layer.sine_over_q), times(per_g, layer.q_sine)
    return plus(times(layer.cosine, u), times(over_q, w)), plus(
        times(layer.cosine, w), times(q_sine, u)
    )


def through_layer(
    fields: Fields, here: Medium, layer: Wave, front: Ambient, h: tuple[Pair, Pair]
) -> Fields:
    """The fields at the near side of a layer from those at its far side."""
    q0 = pair(front.q)
    out = []
    for p, (g, per_g) in enumerate(((ONE, ONE), (here.g, here.per_g))):
        u, w, m, f = (z[p] for z in fields)
        u_new, w_new = crossed(u, w, layer, g, per_g)
        m_new = _deviation(
            layer.near_critical,
            u,
            w,
            m,
            times(per_g, layer.q),
            layer.round_trip,
            times(layer.sine_over_q, h[p]),
            u_new,
            w_new,
            q0,
        )
        out.append((u_new, w_new, m_new, times(f, layer.passage)))
    return Fields(*zip(*out, strict=True))


@jax.custom_jvp
def decaying_root(re: DoubleWord, im: DoubleWord | None) -> Pair:
    """Q with Im Q >= 0, as in `wave`; derivative 0 at Q = 0."""
    (a, _), (b, _) = root(re, im)
    return a, b


@decaying_root.defjvp
def _decaying_root_jvp(primals, tangents):
    q = decaying_root(*primals)
    (d_re, _), d_im = tangents
    return q, scaled(0.5, times(inverse(q), (d_re, None if d_im is None else d_im[0])))


def outgoing_root(re: DoubleWord, im: DoubleWord | None) -> Pair:
    """Q of the wave that leaves through a half-space: Re Q + Im Q >= 0."""
    a, b = decaying_root(re, im)
    backward = a + b < 0.0
    return jnp.where(backward, -a, a), jnp.where(backward, -b, b)


def far_fields(here: Medium, front: Ambient, q: Pair) -> Fields:
    """The fields of the wave that leaves through the far half-space, with its Q."""
    h_s, h_p = mismatches(here, front, q)
    one = (jnp.ones_like(q[0]), jnp.zeros_like(q[0]))
    return Fields(
        u=(one, one),
        w=(q, times(here.per_g, q)),
        m=(h_s, times(here.per_g, h_p)),
        f=(one, one),
    )


def normal_flux(q: Complex, n2: Complex) -> tuple[Array, Array]:
    """Re Q and Re(Q / N^2): power along the normal of a wave of unit E_s, or unit H_p."""
    p = q[0] * n2[0]
    if q[1] is not None and n2[1] is not None:
        p = p + q[1] * n2[1]
    return q[0], p * reciprocal_or_zero(squared_modulus(n2))
