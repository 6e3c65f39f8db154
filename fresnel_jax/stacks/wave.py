"""The wave in one layer of a stack: its normal wavevector, phase and attenuation.

With Q = N cos(theta), the normal wavevector over k_0 (Im Q >= 0), kappa = k_0 thickness and
delta = kappa Q, a layer is the matrix [[cos(delta), -i sin(delta) / Q], [-i Q sin(delta),
cos(delta)]] of its tangential fields. Its entries grow as exp(Im delta) and are even in Q. Here all
are multiplied by f = exp(i delta), so that none exceeds 1:

    C = f cos(delta) = (1 + E) / 2,     sigma = -i f sin(delta) / Q = (1 - E) / (2 Q),    E = f^2.

The phase: kappa Q = 2 pi (thickness / wavelength) Q is formed in turns, with thickness / wavelength
and Q to twice the digits, and the whole turns are dropped before sine and cosine.

Derivatives: f cancels from every reflectance, and what is left is analytic in Q^2 although Q is
not. Where Q is small, at the layer's own critical angle, f is therefore held constant: dQ does not
occur in the derivatives of C and sigma with respect to Q^2, which stay finite and exact at Q = 0.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from .._numerics.arithmetic import complex_sqrt, fast_two_sum, reciprocal_or_zero, sine_cosine
from .._numerics.complex import (
    Pair,
    choose,
    conjugate,
    minus_i_times,
    pair,
    plus,
    scaled,
    squared_modulus,
    times,
)
from .._numerics.double_word import DoubleWord, root_correction, root_of_real, two_product
from .._numerics.fences import computed_once


class Wave(NamedTuple):
    q: Pair
    round_trip: Pair  # E
    cosine: Pair  # C
    sine_over_q: Pair  # sigma
    q_sine: Pair  # Q^2 sigma
    passage: Pair  # f
    sine2: Array  # |f|^2 sin^2(Re delta)
    dimmed: Array  # 1 - |E|
    near_critical: Array  # where f is held constant in derivatives


def root(re: DoubleWord, im: DoubleWord | None) -> tuple[DoubleWord, DoubleWord]:
    """The root a + ib with b >= 0 of re + i im, to twice the digits.

    High and low words are computed once each: written anew into every loop that reads them, these
    exact products were half of all operations of a stack.
    """
    if im is None:
        return root_of_real(re)
    a, b = complex_sqrt(re[0], jnp.abs(im[0]))
    a, b = computed_once(jnp.where(im[0] < 0.0, -a, a)), computed_once(b)
    a_low, b_low = root_correction(re, im, a, b, reciprocal_or_zero(a * a + b * b))
    return (a, computed_once(a_low)), (b, computed_once(b_low))


def _turns(x: DoubleWord, q: DoubleWord) -> DoubleWord:
    product, error = two_product(x[0], q[0])
    return product, error + (x[0] * q[1] + x[1] * q[0])


def _fraction(turns: DoubleWord) -> Array:
    """The turns less the nearest whole number."""
    fraction = (turns[0] - jnp.round(turns[0])) + turns[1]
    return fraction - jnp.round(fraction)


def _two_pi(dtype) -> tuple[float, float]:
    high = float(np.asarray(2.0 * np.pi, dtype))
    # 2 pi less its float64 value; in float32 the float64 value has digits enough.
    low = 2.4492935982947064e-16 if dtype == jnp.float64 else 2.0 * 3.141592653589793 - high
    return high, low


def _decay(turns: DoubleWord) -> tuple[Array, Array]:
    """exp(-2 pi turns) for turns >= 0, with a relative error that does not grow; and 2 pi turns."""
    high, low = _two_pi(turns[0].dtype)
    product, error = two_product(turns[0], jnp.full_like(turns[0], high))
    rest = error + (turns[0] * low + turns[1] * high)
    depth, rest = (computed_once(z) for z in fast_two_sum(product, rest))
    return jnp.exp(-depth) * (1.0 - rest), depth


@jax.custom_jvp
def wave(re: DoubleWord, im: DoubleWord | None, x: DoubleWord, ambient2: Array) -> Wave:
    """The wave of Q^2 = re + i im in a layer of x = thickness / wavelength.

    ambient2 is |Q|^2 of the medium before the stack: it decides where `near_critical` starts.
    """
    a, b = root(re, im)
    fraction = computed_once(_fraction(_turns(x, a)))
    sine, cosine = (computed_once(z) for z in sine_cosine(fraction))
    decay, depth = _decay(_turns(x, b))
    (a, _), (b, _), kappa = a, b, (2.0 * jnp.pi) * x[0]
    q2_abs = a * a + b * b
    per_q2 = reciprocal_or_zero(q2_abs)
    intensity = decay * decay
    twice_sine2 = 2.0 * (sine * sine)
    twice_sine_cosine = intensity * (2.0 * (sine * cosine))
    round_trip = (intensity * (1.0 - twice_sine2), twice_sine_cosine)
    # 1 - E as a sum of positive numbers
    dimmed = -jnp.expm1(-2.0 * depth)
    rest = (intensity * twice_sine2 + dimmed, -twice_sine_cosine)
    over_q = times(rest, (0.5 * a * per_q2, -0.5 * b * per_q2))
    critical = q2_abs == 0.0
    sine_over_q = (jnp.where(critical, 0.0, over_q[0]), jnp.where(critical, -kappa, over_q[1]))
    # Some ten loops read these; without a division each would compute them again.
    q, round_trip, sine_over_q, passage = jax.tree.map(
        computed_once, ((a, b), round_trip, sine_over_q, (decay * cosine, decay * sine))
    )
    shapes = [z.shape for z in (a, kappa, ambient2)]
    out = Wave(
        q=q,
        round_trip=round_trip,
        cosine=(0.5 * (1.0 + round_trip[0]), 0.5 * round_trip[1]),
        sine_over_q=sine_over_q,
        q_sine=times(times(q, q), sine_over_q),
        passage=passage,
        sine2=0.5 * (intensity * twice_sine2),
        dimmed=dimmed,
        near_critical=(4.0 * q2_abs < ambient2) & (kappa * kappa * q2_abs < 0.25),
    )
    # One shape: the derivative of q is masked by near_critical, which depends on the thickness too.
    return jax.tree.map(lambda z: jnp.broadcast_to(z, jnp.broadcast_shapes(*shapes)), out)


# (cos(z) - sin(z) / z) / z^2 = sum of these times z^(2k): -2 (k + 1) (-1)^k / (2 k + 3)!
_SERIES = tuple(
    -((-1.0) ** k) * 2.0 * (k + 1) / float(factorial)
    for k, factorial in enumerate((6, 120, 5040, 362880, 39916800, 6227020800, 1307674368000))
)


def polynomial(coefficients: tuple[float, ...], z: Pair) -> Pair:
    """The sum of coefficients[i] z^i."""
    total = (jnp.full_like(z[0], coefficients[-1]), jnp.zeros_like(z[0]))
    for coefficient in coefficients[-2::-1]:
        re, im = times(total, z)
        total = (re + coefficient, im)
    return total


def sine_derivative_series(z: Pair) -> Pair:
    """(cos(x) - sin(x) / x) / x^2 for a small x^2 = z."""
    return polynomial(_SERIES, z)


@wave.defjvp
def _wave_jvp(primals, tangents):
    out = wave(*primals)
    re, im, x, _ = primals
    d_re, d_im, d_x, _ = tangents
    q2 = pair((re[0], None if im is None else im[0]))
    dq2 = pair((d_re[0], None if im is None else d_im[0]))
    kappa, d_kappa = (2.0 * jnp.pi) * x[0], (2.0 * jnp.pi) * d_x[0]
    near, (a, b) = out.near_critical, out.q
    zero = jnp.zeros_like(a)

    per_q2 = jnp.where(near, 0.0, reciprocal_or_zero(a * a + b * b))
    per_q = scaled(per_q2, conjugate(out.q))
    dq = times(scaled(0.5, per_q), dq2)
    d_delta = plus(scaled(d_kappa, out.q), scaled(kappa, dq))
    d_log_f = choose(near, (zero, zero), (-d_delta[1], d_delta[0]))
    d_passage = times(d_log_f, out.passage)
    d_round_trip = scaled(2.0, times(d_log_f, out.round_trip))

    half_kappa = 0.5 * kappa
    d_delta_q = plus(scaled(d_kappa, q2), scaled(half_kappa, dq2))  # Q d(delta)
    d_cosine_near = minus_i_times(times(out.sine_over_q, d_delta_q))
    z = scaled(kappa * kappa, q2)
    outside = jnp.where(near, 1.0, 0.0)
    series = sine_derivative_series(scaled(outside, z))
    slope = scaled(half_kappa * (kappa * kappa) * outside, times(series, out.passage))
    d_sine_near = minus_i_times(plus(scaled(d_kappa, out.cosine), times(slope, dq2)))
    d_sine_far = scaled(
        -1.0,
        times(
            per_q,
            plus(scaled(0.5, d_round_trip), times(out.sine_over_q, dq)),
        ),
    )
    d_sine = choose(near, d_sine_near, d_sine_far)
    tangent = Wave(
        q=dq,
        round_trip=d_round_trip,
        cosine=choose(near, d_cosine_near, scaled(0.5, d_round_trip)),
        sine_over_q=d_sine,
        q_sine=plus(times(out.sine_over_q, dq2), times(q2, d_sine)),
        passage=d_passage,
        sine2=jnp.where(near, 0.0, out.round_trip[1] * d_delta[0] - 2.0 * out.sine2 * d_delta[1]),
        dimmed=-2.0 * (d_log_f[0] * squared_modulus(out.passage)),
        near_critical=jnp.zeros(near.shape, jax.dtypes.float0),
    )
    return out, tangent


class Kept(NamedTuple):
    """What is kept of a wave; the rest of it follows."""

    q: Pair  # in the shape of Q^2
    round_trip: Pair
    sine_over_q: Pair
    near_critical: Array


@jax.custom_jvp
def _followed(kept: Kept, q2: Pair, kappa: Array) -> tuple[Pair, Pair, Pair]:
    """Q, C and Q^2 sigma."""
    e_re, e_im = kept.round_trip
    shape = kept.near_critical.shape
    q = (jnp.broadcast_to(kept.q[0], shape), jnp.broadcast_to(kept.q[1], shape))
    q_sine = times(times(kept.q, kept.q), kept.sine_over_q)
    return q, (0.5 * (1.0 + e_re), 0.5 * e_im), q_sine


@_followed.defjvp
def _followed_jvp(primals, tangents):
    (kept, q2, kappa), (moved, dq2, d_kappa) = primals, tangents
    near, (a, b) = kept.near_critical, kept.q
    zero = jnp.zeros_like(kappa)
    per_2q2 = 0.5 * reciprocal_or_zero(a * a + b * b)
    dq = choose(near, (zero, zero), times((a * per_2q2, -b * per_2q2), dq2))
    d_delta_q = plus(scaled(d_kappa, q2), scaled(0.5 * kappa, dq2))
    d_cosine = choose(
        near,
        minus_i_times(times(kept.sine_over_q, d_delta_q)),
        scaled(0.5, moved.round_trip),
    )
    d_q_sine = plus(times(kept.sine_over_q, dq2), times(q2, moved.sine_over_q))
    return _followed(*primals), (dq, d_cosine, d_q_sine)


def kept(wave: Wave, q: Pair) -> Kept:
    """q is that of the wave, in the shape of Q^2."""
    return Kept(q, wave.round_trip, wave.sine_over_q, wave.near_critical)


def restored(kept: Kept, q2: Pair, kappa: Array) -> Wave:
    """The wave, but for f and for what only absorbed power needs."""
    q, cosine, q_sine = _followed(kept, q2, kappa)
    none: Any = None
    return Wave(
        q=q,
        round_trip=kept.round_trip,
        cosine=cosine,
        sine_over_q=kept.sine_over_q,
        q_sine=q_sine,
        passage=none,
        sine2=none,
        dimmed=none,
        near_critical=kept.near_critical,
    )
