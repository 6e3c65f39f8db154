"""Power that a layer of a stack absorbs, as the integral of its field and not as a difference.

With the fields U and W of `_stack_coherent` at the far side of a layer and zeta = k_0 times the
distance from there,

    d Re(W conj(U)) / d zeta = Im(Q^2 / g) |U|^2 + Im(g) |W|^2        (for p, W in units of N_0^2)

whose integral needs those of |cos(Q zeta)|^2, |sin(Q zeta) / Q|^2 and conj(cos) sin / Q. All are in
units of |f|^-2, so that none grows. In closed form they cancel for thin layers, and at the layer's
critical angle; there, series take their place, which are polynomials in the real and the imaginary
part of delta^2 and therefore also have their derivatives.

Source: M. Born and E. Wolf, Principles of Optics, 7th ed., sec. 1.6; the integrals are our own.
"""

import math
from typing import Any

import jax.numpy as jnp
from jaxtyping import Array

from ._arithmetic import Complex, conjugate_times, one_if_zero, squared_modulus, times
from ._double_word import DoubleWord
from ._stack_wave import Pair, Wave

_TERMS = 10


def _thin(kappa: Array, z: Pair) -> tuple[Array, Array, Pair]:
    """The three integrals as series in z = delta^2, for |z| <= 1 / 4."""
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
    return 0.5 * kappa * cosine2, 0.5 * kappa * kappa2 * sine2, cross


def _thick(kappa: Array, layer: Wave) -> tuple[Array, Array, Pair]:
    """The three integrals in units of |f|^-2, in closed form."""
    a, b = layer.q
    lossless, evanescent = b == 0.0, a == 0.0
    per_a, per_b = (jnp.where(z == 0.0, 0.0, 0.5 / one_if_zero(z)) for z in (a, b))
    lost, lost_twice = (-jnp.expm1(-x * kappa * b) for x in (2.0, 4.0))
    hyperbolic = jnp.where(lossless, kappa, 0.5 * lost_twice * per_b)
    intensity = squared_modulus(layer.passage)
    circular = jnp.where(evanescent, kappa * intensity, layer.round_trip[1] * per_a)
    per_q2 = 1.0 / one_if_zero(a * a + b * b)
    cross = times((b * per_q2, a * per_q2), (-layer.sine2 * per_a, -0.25 * lost * lost * per_b))
    return 0.5 * (hyperbolic + circular), 0.5 * (hyperbolic - circular) * per_q2, cross


def _integrals(kappa: Array, q2: Pair, layer: Wave) -> tuple[Array, Array, Pair]:
    z = (kappa * kappa * q2[0], kappa * kappa * q2[1])
    thin = 16.0 * (z[0] * z[0] + z[1] * z[1]) < 1.0
    series = _thin(kappa, (jnp.where(thin, z[0], 0.0), jnp.where(thin, z[1], 0.0)))
    closed = _thick(kappa, layer)
    intensity = squared_modulus(layer.passage)
    cosine2, sine2, cross_re, cross_im = (
        jnp.where(thin, intensity * s, c)
        for s, c in zip((*series[:2], *series[2]), (*closed[:2], *closed[2]), strict=True)
    )
    return cosine2, sine2, (cross_re, cross_im)


def _field_squared(field: Pair, slope: Pair, integrals: Any) -> Array:
    """The integral of |field cos - i slope sin / Q|^2."""
    cosine2, sine2, cross = integrals
    return (
        cosine2 * squared_modulus(field)
        + sine2 * squared_modulus(slope)
        + 2.0 * times(conjugate_times(field, slope), cross)[0]
    )


def absorbed(
    fields: tuple[tuple[Pair, Pair], tuple[Pair, Pair]],
    layer: Wave,
    re: DoubleWord,
    im: DoubleWord | None,
    x: Array,
    media: tuple[Complex, Complex, Complex, Complex, Complex],
) -> tuple[Array, Array]:
    """Re(W conj(U)) at the near side of the layer less that at its far side, for s and p.

    fields are (U, W) for s and p at the far side; re + i im is Q^2, x thickness / wavelength,
    media are N^2, g, 1 / g, N_0^2 and K^2. For p, W is in units of N_0^2.
    """
    n2, g, per_g, n02, transverse2 = media
    zero = jnp.zeros_like(layer.q[0])
    if im is None:
        return zero, zero
    q2 = (re[0], im[0])
    kappa = (2.0 * jnp.pi) * x
    integrals = _integrals(kappa, q2, layer)
    (u_s, w_s), (u_p, w_p) = fields
    loss_s = im[0] * _field_squared(u_s, w_s, integrals)
    # Im(Q^2 / N^2) = -Im(K^2 / N^2)
    tangential = -conjugate_times(
        (n2[0], zero if n2[1] is None else n2[1]),
        (transverse2[0], zero if transverse2[1] is None else transverse2[1]),
    )[1] / squared_modulus(n2)
    normal = (0.0 if n2[1] is None else n2[1]) / squared_modulus(n02)
    loss_p = tangential * _field_squared(u_p, times(g, w_p), integrals)
    loss_p = loss_p + normal * _field_squared(w_p, times(times(per_g, q2), u_p), integrals)
    return loss_s, loss_p
