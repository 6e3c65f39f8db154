"""What all Fresnel formulas of one smooth boundary share, each computed without cancellation.

Light in a medium of real index m meets, at an angle whose cosine is c, a medium of complex index
N = n + ik. With s^2 = 1 - c^2, and everything in absolute indices (dividing one index by the other
first would lose the digits of their difference):

    Q = sqrt(N^2 - m^2 s^2) = a + ib     normal wavevector in the second medium
    S = m c + Q                          r_s = -(N^2 - m^2) / S^2
    X = m c Q + m^2 s^2                  r_p = (N^2 - m^2) Y m^2 / (S X)^2
    Y = c^2 N^2 - m^2 s^2                zero at Brewster's angle

S and X only add positive parts. What cancels is Re Q^2 near the critical angle, Re Y near
Brewster's, and n - m near index match; the first two are summed exactly here.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from ._arithmetic import complex_sqrt, real_sqrt, sum_exactly, two_product, two_square, two_sum


class Boundary(NamedTuple):
    """Complex numbers are pairs (re, im); an imaginary part of None is exactly zero."""

    mc: Array  # m c
    difference: Array  # n - m
    total: Array  # n + m
    q: tuple[Array, Array]  # Q = a + ib
    y: tuple[Array, Array | None]
    s: tuple[Array, Array]
    x: tuple[Array, Array]
    ms_squared: Array  # m^2 s^2


@jax.custom_jvp
def _lossless_sums(c: Array, n: Array, m: Array | None) -> tuple[Array, Array, Array]:
    """Re Q^2 and Re Y for k = 0, and m^2 s^2, each right to its last digits.

    Re Q^2 = n^2 - m^2 s^2 vanishes at the critical angle, where T_s is proportional to its root,
    and Re Y = c^2 n^2 - m^2 s^2 at Brewster's angle, where every derivative of R_p is proportional
    to it: both need a *relative* accuracy there. Among 1e5 cosines around the critical one some
    leave 1e-5 eps of the terms, and sums in doubled precision (error eps^2) lost 5 digits of T_s.
    Hence every product is kept exactly and every rounding error of the sums is added back.
    k^2 is subtracted later without care: where it matters, Im Q^2 = 2nk is larger.
    """
    cn, cn_low = two_product(c, n)
    cn2, cn2_low = two_square(cn)
    cn_cross, cn_cross_low = two_product(2.0 * cn, cn_low)
    n2, n2_low = two_square(n)
    if m is None:
        mc2, mc2_low = two_square(c)
        minus_ms2, minus_ms2_low = two_sum(mc2, -1.0)
        ms2_low, ms2_lowest = two_sum(mc2_low, minus_ms2_low)
    else:
        mc, mc_low = two_product(c, m)
        mc2, mc2_low = two_square(mc)
        mc_cross, mc_cross_low = two_product(2.0 * mc, mc_low)
        m2, m2_low = two_square(m)
        minus_ms2, minus_ms2_low = two_sum(mc2, -m2)
        ms2_low, ms2_lowest = sum_exactly([mc2_low, -m2_low, mc_cross, minus_ms2_low])
        ms2_lowest = ms2_lowest + (mc_cross_low + mc_low * mc_low)

    def minus_ms2_plus(high, lows, lowest):
        leading, leading_low = two_sum(minus_ms2, high)
        low, lost = sum_exactly([ms2_low, leading_low, *lows])
        leading, leading_low = two_sum(leading, low)
        return leading + (leading_low + (ms2_lowest + lost + lowest))

    re_q2 = minus_ms2_plus(n2, [n2_low], 0.0)
    re_y = minus_ms2_plus(cn2, [cn2_low, cn_cross], cn_cross_low + cn_low * cn_low)
    return re_q2, re_y, -(minus_ms2 + (ms2_low + ms2_lowest))


@_lossless_sums.defjvp
def _lossless_sums_jvp(primals, tangents):
    (c, n, m), (dc, dn, dm) = primals, tangents
    re_q2, re_y, ms2 = _lossless_sums(c, n, m)
    if m is None:
        d_ms2 = -2.0 * c * dc
    else:
        d_ms2 = 2.0 * (1.0 - c) * (1.0 + c) * m * dm - 2.0 * m * m * c * dc
    d_q2 = 2.0 * n * dn - d_ms2
    d_y = 2.0 * c * n * (n * dc + c * dn) - d_ms2
    return (re_q2, re_y, ms2), (d_q2, d_y, d_ms2)


def boundary(c: Array, n: Array, k: Array | None, m: Array | None) -> Boundary:
    """The shared quantities, for 0 <= c <= 1, n > 0, k >= 0 (None: 0), m > 0 (None: 1)."""
    re_q2, re_y, ms2 = _lossless_sums(c, n, m)
    if k is None:
        a, b = real_sqrt(re_q2)
        y = (re_y, None)
    else:
        im_q2 = 2.0 * n * k
        a, b = complex_sqrt(re_q2 - k * k, im_q2)
        y = (re_y - (c * k) * (c * k), im_q2 * c * c)
    mc = c if m is None else m * c
    m = 1.0 if m is None else m
    return Boundary(mc, n - m, n + m, (a, b), y, (mc + a, b), (mc * a + ms2, mc * b), ms2)
