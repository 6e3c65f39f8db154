"""Power that a layer of a stack absorbs, as the integral of its field and not as a difference.

With the fields U and W of `coherent` at the far side of a layer, zeta = k_0 times the
distance from there, and the power Re(W conj(U)) for s and Re(W conj(U) / N_0^2) for p,

    d power / d zeta = t |U|^2 + m |W|^2,

with t = Im(Q^2) and m = 0 for s, t = Im(Q^2 / N^2) and m = Im(N^2) / |N_0^2|^2 for p. In a layer
that is not thin the fields are two waves, S = Z U + W forward and D = Z U - W backward, Z = Q / g,
and the integral in units of |f|^-2, in which nothing grows, is

    ((t + m |Z|^2) (|S|^2 + |E D^2|) H + (t - m |Z|^2) 2 Re(conj(S) D V)) / |2 Z|^2

with H = int exp(-2 Im(Q) zeta) and V = |E| int exp(2 i Re(Q) zeta). Where a layer is thin, or at
its critical angle, the two waves are nearly one; there, series of |cos|^2, |sin / Q|^2 and
conj(cos) sin / Q take their place, which are polynomials in the real and the imaginary part of
delta^2 and therefore also have their derivatives.

Source: M. Born and E. Wolf, Principles of Optics, 7th ed., sec. 1.6; the integrals are our own.
"""

import math
from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array

from .._numerics.arithmetic import one_if_zero, reciprocal_or_zero
from .._numerics.complex import (
    Complex,
    Pair,
    conjugate_times,
    pair,
    plus,
    scaled,
    squared_modulus,
    times,
)
from .wave import Wave

_TERMS = 10


class Weights(NamedTuple):
    """What |U|^2 and |W|^2 lose per unit of zeta."""

    t: Array
    m: Array | None  # None: 0


class Along(NamedTuple):
    """The two waves of a layer along its depth."""

    z: Pair  # Q / g
    intensity: Array  # |E|
    decaying: Array  # H
    beating: Pair  # V


def weights(
    im_q2: Array, n2: Complex, n2_along: Complex, n02: Complex, transverse2: Complex
) -> tuple[Weights, Weights]:
    """Of s and p, from Im(Q^2), N^2 across and along the normal, N_0^2, K^2; no subtraction."""
    n2, n2_along = pair(n2), pair(n2_along)
    # Im(Q^2 / N^2) = -Im(K^2 / N^2)
    tangential = -conjugate_times(n2_along, pair(transverse2))[1] / squared_modulus(n2_along)
    normal = n2[1] / squared_modulus(n02)
    return Weights(im_q2, None), Weights(tangential, normal)


def is_thin(kappa: Array, q2: Pair) -> Array:
    return squared_modulus(scaled(kappa * kappa, q2)) < 0.0625


def _magnetic_series(kappa: Array, z: Pair) -> Array:
    """Re(i cos(delta) conj(sin(delta) / Q)), for z = delta^2 with |z| < .01."""
    quarter_im2 = 0.25 * z[1] * z[1]
    here, before, total = 1.0, 0.0, 0.0
    for m in range(5):
        total = total + 6.0 * 4.0**m / math.factorial(2 * m + 3) * here
        here, before = quarter_im2 * before - z[0] * here, here
    return (kappa * z[1] / 3.0) * total


def power_at_near_side(
    layer: Wave,
    kappa: Array,
    q2: Pair,
    g: Complex,
    per_g: Complex,
    u: Pair,
    w: Pair,
    power: Array,
) -> Array:
    """Re(W conj(U)) at the near side of a layer from that at its far side, in units of |f|^-2.

    In a mode of the films it is small against |U| |W|, whose rounding is what W conj(U) has of it.
    So it is carried: of the product of both sides' fields,

        (|C|^2 + Re B) Re(W conj(U)) + Im B Im(W conj(U)) + a |U|^2 + b |W|^2,
        a = Re(conj(C) Q^2 sigma / g),  b = Re(C conj(sigma g)),  B = |sigma|^2 Q^2 conj(g) / g,

    a, b and Im B vanish with the absorption of the layer and are formed without cancellation. The
    formulas are our own.
    """
    (x, y), (e_re, e_im) = layer.q, layer.round_trip
    q_abs2 = x * x + y * y
    per_q_abs2 = reciprocal_or_zero(q_abs2)
    growth = 0.5 * layer.dimmed * (2.0 - layer.dimmed)  # |f|^2 sinh(2 Im delta)
    of_u = (
        0.5 * (x * growth + y * e_im),
        conjugate_times(layer.cosine, layer.q_sine)[1],
    )
    wide = 0.5 * (x * growth - y * e_im) * per_q_abs2
    kappa2 = kappa * kappa
    series = squared_modulus(layer.passage) * _magnetic_series(kappa, scaled(kappa2, q2))
    of_w = (
        jnp.where(kappa2 * q_abs2 < 0.01, series, wide),
        conjugate_times(layer.sine_over_q, layer.cosine)[1],
    )
    # |C|^2 + Re B = |f|^2 (x^2 cosh(2 Im delta) + y^2 cos(2 Re delta)) / |Q|^2 for g = 1
    carried = (x * x * (1.0 - growth) + y * y * e_re) * per_q_abs2
    carried, beats = jnp.where(q_abs2 == 0.0, 1.0, carried), q2[1]
    sigma2 = squared_modulus(layer.sine_over_q)
    if g[1] is not None:
        # Q^2 (1 - conj(g) / g)
        turned = times(scaled(2.0 * g[1] * squared_modulus(per_g), (g[1], g[0])), q2)
        carried, beats = carried - sigma2 * turned[0], beats - turned[1]
    return (
        carried * power
        + sigma2 * beats * conjugate_times(u, w)[1]
        + times(of_u, per_g)[0] * squared_modulus(u)
        + conjugate_times(g, of_w)[0] * squared_modulus(w)
    )


def along(layer: Wave, z: Pair, kappa: Array) -> Along:
    a, b = layer.q
    intensity, per_a = squared_modulus(layer.passage), 0.5 * reciprocal_or_zero(a)
    decaying = jnp.where(b == 0.0, kappa, -0.5 * jnp.expm1(-2.0 * kappa * b) / one_if_zero(b))
    beat = jnp.where(a == 0.0, kappa * intensity, layer.round_trip[1] * per_a)
    return Along(z, intensity, decaying, (beat, 2.0 * layer.sine2 * per_a))


def of_waves(weight: Weights, z: Pair) -> tuple[Array, Array]:
    """t + m |Z|^2 and t - m |Z|^2."""
    if weight.m is None:
        return weight.t, weight.t
    magnetic = weight.m * squared_modulus(z)
    return weight.t + magnetic, weight.t - magnetic


def absorbed_by_waves(weight: Weights, inside: Along, up: Pair, down: Pair) -> Array:
    """The integral times |2 Z|^2; up and down are S and D."""
    own, crossed = of_waves(weight, inside.z)
    each = squared_modulus(up) + inside.intensity * squared_modulus(down)
    both = 2.0 * times(conjugate_times(up, down), inside.beating)[0]
    return own * (each * inside.decaying) + crossed * both


class Thin(NamedTuple):
    """Q^2, and the integrals of |cos|^2, |sin / Q|^2 and -i conj(cos) sin / Q along the depth."""

    q2: Pair
    cosine2: Array
    sine2: Array
    cross: Pair


def thin_layer(kappa: Array, q2: Pair) -> Thin:
    """Series in z = delta^2 for |z| <= 1 / 4; for others put 0 in place of Q^2.

    The same for s and p. They are most of the operations of second derivatives, which compile
    slowly enough without a copy for each product of fields.
    """
    z = scaled(kappa * kappa, q2)
    re, quarter_im2 = z[0], 0.25 * z[1] * z[1]
    # c = y^(2k) + (-1)^k x^(2k), d = (y^(2k) - (-1)^k x^(2k)) / |z|, with delta = x + iy
    c, c_before = -re, jnp.full_like(re, 2.0)
    d, d_before = jnp.ones_like(re), jnp.zeros_like(re)
    cosine2, sine2, cross_re, cross_im = 2.0, 0.0, 0.0, 0.0
    for k in range(1, _TERMS + 1):
        even, odd = 4.0**k / math.factorial(2 * k), 4.0**k / math.factorial(2 * k + 1)
        cosine2 = cosine2 + odd * c
        sine2 = sine2 + odd * d
        cross_re = cross_re + even * d
        cross_im = cross_im + even * d_before
        c, c_before = quarter_im2 * c_before - re * c, c
        d, d_before = quarter_im2 * d_before - re * d, d
    kappa2 = kappa * kappa
    cross = (0.125 * kappa2 * z[1] * cross_im, -0.25 * kappa2 * cross_re)
    return Thin(q2, 0.5 * kappa * cosine2, 0.5 * kappa * kappa2 * sine2, cross)


def _product_along(first: tuple[Pair, Pair], second: tuple[Pair, Pair], thin: Thin) -> Pair:
    """The integral of conj(F_1) F_2, where F = field cos - i slope sin / Q of (field, slope)."""
    _, cosine2, sine2, cross = thin
    (field_1, slope_1), (field_2, slope_2) = first, second
    squares = plus(
        scaled(cosine2, conjugate_times(field_1, field_2)),
        scaled(sine2, conjugate_times(slope_1, slope_2)),
    )
    mixed = plus(
        times(cross, conjugate_times(field_1, slope_2)),
        conjugate_times(cross, conjugate_times(slope_1, field_2)),
    )
    return plus(squares, mixed)


def product_in_thin(
    weight: Weights,
    thin: Thin,
    g: Complex,
    per_g: Complex,
    first: tuple[Pair, Pair],
    second: tuple[Pair, Pair],
) -> Pair:
    """int t conj(U_1) U_2 + m conj(W_1) W_2 of two fields (U, W), not in units of |f|^-2."""
    (u_1, w_1), (u_2, w_2) = first, second
    electric = ((u_1, times(g, w_1)), (u_2, times(g, w_2)))
    product = scaled(weight.t, _product_along(*electric, thin))
    if weight.m is None:
        return product
    beta = times(per_g, thin.q2)
    magnetic = ((w_1, times(beta, u_1)), (w_2, times(beta, u_2)))
    return plus(product, scaled(weight.m, _product_along(*magnetic, thin)))


def _power_along(field: Pair, slope: Pair, thin: Thin) -> Array:
    """`_product_along` of a field and itself."""
    squares = thin.cosine2 * squared_modulus(field) + thin.sine2 * squared_modulus(slope)
    return squares + 2.0 * times(thin.cross, conjugate_times(field, slope))[0]


def power_in_thin(
    weight: Weights, thin: Thin, g: Complex, per_g: Complex, u: Pair, w: Pair
) -> Array:
    """`product_in_thin` of a field and itself."""
    power = weight.t * _power_along(u, times(g, w), thin)
    if weight.m is None:
        return power
    return power + weight.m * _power_along(w, times(times(per_g, thin.q2), u), thin)


def absorbed(
    weight: Weights,
    layer: Wave,
    kappa: Array,
    is_thin: Array,
    thin: Thin,
    g: Complex,
    per_g: Complex,
    u: Pair,
    w: Pair,
    up: Pair,
    down: Pair,
) -> Array:
    """The power at the near side of the layer less that at its far side, over |f|^-2."""
    z = times(per_g, layer.q)
    inside = along(layer, z, kappa)
    waves = absorbed_by_waves(weight, inside, up, down)
    series = power_in_thin(weight, thin, g, per_g, u, w)
    far = 0.25 * waves * reciprocal_or_zero(squared_modulus(z))
    return jnp.where(is_thin, inside.intensity * series, far)
