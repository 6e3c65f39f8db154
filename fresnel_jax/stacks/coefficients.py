"""What a change in one layer of a stack does to the amplitudes: two integrals over that layer.

The formulas are those of `_stack_derivative`. In a layer the integrals are closed forms of
the waves S = Z u + w and D = Z u - w with Z = Q / g (and likewise of Z b + a and Z b - a). They
cancel where a layer is thin against a wavelength, or at its critical angle; there the entries of
its matrix and a series take their place, both even in Q. Nothing grows with the thickness.
"""

import math
from typing import Any, NamedTuple

import jax
from jaxtyping import Array

from .._numerics.complex import Complex, Pair, choose, inverse, minus, plus, scaled, times, times_i
from .._numerics.fences import computed_once
from .absorption import is_thin
from .coherent import ZERO
from .wave import Wave, polynomial, sine_derivative_series

# (1 - sin(2 z) / (2 z)) / (2 z^2) is the sum of these times z^(2 m).
_SERIES = tuple((-1.0) ** m * 2.0 * 4.0**m / math.factorial(2 * m + 3) for m in range(9))

# cos(x) is the sum of these times x^(2 m).
_COSINE = tuple((-1.0) ** m / math.factorial(2 * m) for m in range(9))


class Layers(NamedTuple):
    """What the coefficients of both amplitudes need of every layer, for s or p."""

    wave: Wave
    g: Complex
    per_g: Complex
    z: Pair  # Q / g
    per_twice_q2: Pair
    kappa: Array  # k_0 thickness
    thin: Array
    near_q2: Pair  # Q^2 where thin
    delta2: Pair  # (kappa Q)^2 where thin
    u: Pair
    w: Pair
    down: Pair  # Z u - w
    up: Pair  # Z u + w


class Change(NamedTuple):
    """For Q^2, g and k_0 thickness of every layer: what an amplitude gains for a unit of each."""

    q2: Complex
    g: Any  # None: it stays as it is
    depth: Complex


class Light(NamedTuple):
    """At some depth: the functional (a, b), the product of all f in front, and D of the boundaries
    in front."""

    a: Pair
    b: Pair
    f: Pair
    det: Any  # None: all boundaries are smooth


def gained(change: Change, moved: Change) -> Pair:
    """The coefficients times how much each quantity is moved, for every layer."""
    # Real and imaginary part, and every column of a Jacobian, read them in loops of their own.
    change = jax.tree.map(computed_once, change)
    terms = plus(times(change.q2, moved.q2), times(change.depth, moved.depth))
    return terms if moved.g is None else plus(terms, times(change.g, moved.g))


def layers_of(
    wave: Wave, q2: Pair, g: Complex, per_g: Complex, kappa: Array, u: Pair, down: Pair
) -> Layers:
    """q2 is Q^2 itself: the derivative of wave.q is left out next to the critical angle."""
    thin = is_thin(kappa, q2)
    near = choose(thin, q2, ZERO)
    z = times(per_g, wave.q)
    w = minus(times(z, u), down)
    twice = scaled(0.5, inverse(q2))
    return Layers(
        wave,
        g,
        per_g,
        z,
        twice,
        kappa,
        thin,
        near,
        scaled(kappa * kappa, near),
        u,
        w,
        down,
        plus(times(z, u), w),
    )


def of_r(layer: Layers, per: Pair, series: bool = True) -> Change:
    """Of r; per is Q_0 / B^2 in the units of the fields of the layer.

    series: whether the layer may be thin, or at its critical angle, anywhere.
    """
    sigma, round_trip, kappa = layer.wave.sine_over_q, layer.wave.round_trip, layer.kappa
    cosine = layer.wave.cosine
    waves2 = plus(times(layer.up, layer.up), times(round_trip, times(layer.down, layer.down)))
    waves2, gain = times(sigma, waves2), times(layer.g, per)
    beat = times_i(times(round_trip, times(layer.up, layer.down)))
    wide = times(layer.per_twice_q2, minus(scaled(2.0 * kappa, beat), waves2))
    if not series:
        return Change(times(gain, wide), times(per, waves2), scaled(2.0, times(gain, beat)))

    # Even in Q for derivatives of these derivatives; elsewhere D alone knows how little comes back.
    near = layer.wave.near_critical
    u2, w2, u_w = (times(*z) for z in ((layer.u,) * 2, (layer.w,) * 2, (layer.u, layer.w)))
    beta = times(layer.per_g, layer.near_q2)
    z2_u2 = times(times(layer.per_g, beta), u2)
    thin_waves2 = plus(times(cosine, plus(z2_u2, w2)), scaled(2.0, times(sigma, times(beta, u_w))))
    waves2 = choose(near, scaled(2.0, times(sigma, thin_waves2)), waves2)
    beat = choose(near, times_i(times(round_trip, minus(z2_u2, w2))), beat)

    gw = times(layer.g, layer.w)
    both = times_i(times(sigma, cosine))
    cosine2 = scaled(0.5, plus(scaled(kappa, round_trip), both))
    sine2 = scaled(kappa**3, times(round_trip, polynomial(_SERIES, layer.delta2)))
    thin = minus(times(cosine2, times(layer.u, layer.u)), times(sine2, times(gw, gw)))
    thin = plus(thin, times_i(times(times(sigma, sigma), times(layer.u, gw))))
    thin = scaled(2.0, times_i(times(times(layer.per_g, layer.per_g), thin)))
    return Change(
        q2=times(gain, choose(layer.thin, thin, wide)),
        g=times(per, waves2),
        depth=scaled(2.0, times(gain, beat)),
    )


def of_through(layer: Layers, a: Pair, b: Pair, per: Pair, series: bool = True) -> Change:
    """Of log(F / B); (a, b) is at the front of the layer, per is 1 / B in its units.

    series as in `of_r`.
    """
    sigma, kappa, wave = layer.wave.sine_over_q, layer.kappa, layer.wave
    zb, gain = times(layer.z, b), scaled(0.5, times_i(times(layer.g, per)))
    up, down = plus(zb, a), minus(zb, a)
    along = plus(times(up, layer.up), times(wave.round_trip, times(down, layer.down)))
    across = times_i(times(sigma, plus(times(up, layer.down), times(down, layer.up))))
    wide = times(layer.per_twice_q2, plus(scaled(kappa, along), across))
    if not series:
        of_g = scaled(-1.0, times(times(gain, layer.per_g), across))
        return Change(times(gain, wide), of_g, times(gain, along))

    cosine2 = plus(scaled(kappa, wave.cosine), times_i(sigma))
    # f is C / cos(delta): it need not be kept.
    passage = times(wave.cosine, inverse(polynomial(_COSINE, layer.delta2)))
    sine2 = scaled(kappa**3, times(passage, sine_derivative_series(layer.delta2)))
    crossing = plus(times(b, layer.w), times(a, layer.u))
    beta = times(layer.per_g, layer.near_q2)
    z2_bu, aw = times(times(layer.per_g, beta), times(b, layer.u)), times(a, layer.w)
    thin_along = plus(times(wave.cosine, plus(z2_bu, aw)), times(sigma, times(beta, crossing)))
    along = choose(wave.near_critical, scaled(2.0, thin_along), along)
    thin_across = scaled(2.0, times_i(times(sigma, minus(z2_bu, aw))))
    across = choose(wave.near_critical, thin_across, across)
    thin = plus(
        times(layer.per_g, times(cosine2, times(b, layer.u))),
        scaled(kappa, times(sigma, crossing)),
    )
    thin = plus(times(layer.per_g, thin), times(sine2, times(a, layer.w)))
    return Change(
        q2=times(gain, choose(layer.thin, thin, wide)),
        g=scaled(-1.0, times(times(gain, layer.per_g), across)),
        depth=times(gain, along),
    )
