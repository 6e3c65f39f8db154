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

import functools
import jax
import jax.numpy as jnp
from jaxtyping import Array

from ._arithmetic import complex_sqrt, real_sqrt, sum_exactly, fast_two_sum, two_product, two_square


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


def _square(x: Array, y: Array | None, exactly: bool) -> tuple[Array, list[Array], Array | float]:
    """(x y)^2 = high + sum(lows) + lowest: rounded, first order errors, second order errors."""
    if y is None:
        high, low = two_square(x)
        return high, [low], 0.0
    xy, xy_low = two_product(x, y)
    high, low = two_square(xy)
    if not exactly:
        return high, [low, 2.0 * (xy * xy_low)], 0.0
    cross, cross_low = two_product(2.0 * xy, xy_low)
    return high, [low, cross], cross_low + xy_low * xy_low


def _sum_once(terms):
    return sum(terms[1:], terms[0]), 0.0


@functools.partial(jax.custom_jvp, nondiff_argnums=(3,))
def _lossless_sums(c: Array, n: Array, m: Array | None, exactly: bool) -> tuple[Array, Array]:
    mc2, mc2_lows, mc2_lowest = _square(c, m, exactly)
    cn2, cn2_lows, cn2_lowest = _square(c, n, exactly)
    n2, n2_low = two_square(n)
    if m is None:
        minus_ms2, lost = fast_two_sum(-1.0, mc2)
        ms2_lows = [*mc2_lows, lost]
    else:
        m2, m2_low = two_square(m)
        minus_ms2, lost = fast_two_sum(-m2, mc2)
        ms2_lows = [*mc2_lows, lost, -m2_low]

    def minus_ms2_plus(high, lows, lowest):
        low, lost = (sum_exactly if exactly else _sum_once)([*ms2_lows, *lows])
        return ((minus_ms2 + high) + low) + (lost + mc2_lowest + lowest)

    return minus_ms2_plus(n2, [n2_low], 0.0), minus_ms2_plus(cn2, cn2_lows, cn2_lowest)


@_lossless_sums.defjvp
def _lossless_sums_jvp(relative, primals, tangents):
    (c, n, m), (dc, dn, dm) = primals, tangents
    re_q2, re_y = _lossless_sums(c, n, m, relative)
    if m is None:
        d_ms2 = -2.0 * c * dc
    else:
        d_ms2 = 2.0 * (1.0 - c) * (1.0 + c) * m * dm - 2.0 * m * m * c * dc
    d_q2 = 2.0 * n * dn - d_ms2
    d_y = 2.0 * c * n * (n * dc + c * dn) - d_ms2
    return (re_q2, re_y), (d_q2, d_y)


def boundary(c: Array, n: Array, k: Array | None, m: Array | None, relative=True) -> Boundary:
    """The shared quantities, for 0 <= c <= 1, n > 0, k >= 0 (None: 0), m > 0 (None: 1)."""
    re_q2, re_y = _lossless_sums(c, n, m, relative)
    if relative:
        one = jnp.where(n == n, 1.0, 2.0)
        re_q2, re_y = re_q2 / one, re_y / one
    if k is None:
        a, b = real_sqrt(re_q2)
        y = (re_y, None)
    else:
        im_q2 = 2.0 * n * k
        a, b = complex_sqrt(re_q2 - k * k, im_q2)
        y = (re_y - (c * k) * (c * k), im_q2 * c * c)
    mc = c if m is None else m * c
    ms2 = (1.0 - c) * (1.0 + c) * (1.0 if m is None else m*m)
    m = 1.0 if m is None else m
    return Boundary(mc, n - m, n + m, (a, b), y, (mc + a, b), (mc * a + ms2, mc * b), ms2)
