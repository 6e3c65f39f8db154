"""What all Fresnel formulas of one smooth boundary share, each computed without cancellation.

Light in a medium of real index m meets, at an angle whose cosine is c, a medium of complex index
N = n + ik. With s^2 = 1 - c^2, and everything in absolute indices (dividing one index by the other
first would lose the digits of their difference):

    Q = sqrt(N^2 - m^2 s^2) = a + ib     normal wavevector in the second medium, over k_0
    S = m c + Q                          r_s = -(N^2 - m^2) / S^2
    X = m c Q + m^2 s^2                  r_p = (N^2 - m^2) Y m^2 / (S X)^2
    Y = c^2 N^2 - m^2 s^2                zero at Brewster's angle

S and X only add positive parts. What cancels is Re Q^2 near the critical angle, Re Y near
Brewster's, and n - m near index match, which floating-point subtraction gets right by itself.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from .._numerics.arithmetic import (
    complex_sqrt,
    fast_two_sum,
    modulus,
    real_sqrt,
    sum_exactly,
    two_product,
    two_square,
)
from .._numerics.complex import Complex
from .._numerics.fences import computed_once, opaque


class Boundary(NamedTuple):
    mc: Array
    difference: Array  # n - m
    total: Array  # n + m
    q: tuple[Array, Array]
    rho: Array  # |Q|^2
    y: Complex
    s: tuple[Array, Array]
    x: tuple[Array, Array]
    ms_squared: Array  # m^2 s^2


def boundary(c: Array, n: Array, k: Array | None, m: Array | None) -> Boundary:
    """The shared quantities, for 0 <= c <= 1, n > 0, k >= 0 (None: 0), m > 0 (None: 1)."""
    re_q2, re_y = lossless_sums(c, n, m)
    re_q2, re_y = computed_once(re_q2), computed_once(re_y)
    if k is None:
        q, rho = real_sqrt(re_q2), jnp.abs(re_q2)
        y = (re_y, None)
    else:
        # k^2 needs no care: where n^2 - m^2 s^2 cancels against it, Im Q^2 = 2nk is larger
        square = re_q2 - k * k, 2.0 * n * k
        q, rho = complex_sqrt(*square), modulus(*square)
        ck = c * k
        y = (re_y - ck * ck, 2.0 * (c * n) * ck)
    one_or_m = 1.0 if m is None else m
    mc = c * one_or_m
    ms_squared = (1.0 - c) * (1.0 + c) * (one_or_m * one_or_m)
    a, b = q
    return Boundary(
        mc=mc,
        difference=n - one_or_m,
        total=n + one_or_m,
        q=q,
        rho=rho,
        y=y,
        s=(mc + a, b),
        x=(mc * a + ms_squared, mc * b),
        ms_squared=ms_squared,
    )


@jax.custom_jvp
def within_one(c: Array) -> Array:
    """min(|c|, 1): a cosine whose sign does not count.

    A dot product of unit vectors exceeds 1 by an eps or two. It means normal incidence, and gets
    the value and the derivative of |c| = 1: a derivative of 0 would stop a search that meets it.
    Differentiated from above at c = 0.
    """
    return jnp.minimum(jnp.abs(c), 1.0)


@within_one.defjvp
def _within_one_jvp(primals, tangents):
    c, sign = unsigned(primals[0])
    return c, sign * tangents[0]


def unsigned(c: Array) -> tuple[Array, Array]:
    """`within_one`, and the sign that its derivative has."""
    return within_one(c), jnp.where(c < 0.0, -1.0, 1.0).astype(c.dtype)


@jax.custom_jvp
def lossless_sums(c: Array, n: Array, m: Array | None) -> tuple[Array, Array]:
    """Re Q^2 = n^2 - m^2 s^2 and Re Y = c^2 n^2 - m^2 s^2 for k = 0, to their last digit.

    Doubled precision (error eps^2, `doubled_re_q2`) is not enough where their relative error
    counts: among 1e5 cosines around the critical one some leave 1e-5 eps of the terms, and T_s,
    proportional to the root of Re Q^2, then lost 5 digits. What lies below is kept as well here: T
    and every derivative need that, R alone does not.
    """
    c, n, m = opaque(c), opaque(n), None if m is None else opaque(m)
    mc2, mc2_lows, mc2_lowest = _square_of_product(c, m)
    cn2, cn2_lows, cn2_lowest = _square_of_product(c, n)
    n2, n2_low = two_square(n)
    if m is None:
        minus_ms2, lost = fast_two_sum(opaque(-jnp.ones_like(c)), mc2)
        ms2_lows = [*mc2_lows, lost]
    else:
        m2, m2_low = two_square(m)
        minus_ms2, lost = fast_two_sum(-m2, mc2)
        ms2_lows = [-m2_low, *mc2_lows, lost]

    def minus_ms2_plus(high, lows, lowest):
        # The errors of n^2 and m^2 come first: at n = m they cancel, and c^2 may be smaller still.
        low, lost = sum_exactly([*lows, *ms2_lows])
        # This sum is exact where it cancels (Sterbenz), so its rounding error need not be kept.
        return ((minus_ms2 + high) + low) + (lost + mc2_lowest + lowest)

    return minus_ms2_plus(n2, [n2_low], 0.0), minus_ms2_plus(cn2, cn2_lows, cn2_lowest)


@lossless_sums.defjvp
def _lossless_sums_jvp(primals, tangents):
    (c, n, m), (dc, dn, dm) = primals, tangents
    if m is None:
        d_ms2 = -2.0 * c * dc
    else:
        d_ms2 = 2.0 * m * ((1.0 - c) * (1.0 + c) * dm - m * c * dc)
    d_re_q2 = 2.0 * n * dn - d_ms2
    d_re_y = 2.0 * c * n * (n * dc + c * dn) - d_ms2
    return lossless_sums(c, n, m), (d_re_q2, d_re_y)


def _square_of_product(x: Array, y: Array | None) -> tuple[Array, list[Array], Array | float]:
    """(x y)^2 (y None: 1) as its rounded value, rounding errors, and what is smaller still."""
    if y is None:
        square, error = two_square(x)
        return square, [error], 0.0
    xy, xy_error = two_product(x, y)
    square, error = two_square(xy)
    cross, cross_error = two_product(2.0 * xy, xy_error)
    return square, [error, cross], cross_error + xy_error * xy_error


def doubled_re_q2(c: Array, n: Array, m: Array | None) -> Array:
    """Re Q^2 = n^2 - m^2 s^2 for k = 0, within a few eps^2 of n^2, where R alone is wanted.

    Near normal incidence m^2 s^2 is m^2 (1 - c)(1 + c), as small as the n^2 beside it: from
    m^2 - (m c)^2 the error would be eps^2 m^2, of which R had 27 eps in float32 at the critical
    angle of n = m / 100. At grazing incidence it is m^2 - (m c)^2, whose second term may be small.
    """
    c, n, m = opaque(c), opaque(n), None if m is None else opaque(m)
    one = opaque(jnp.ones_like(c))
    near_normal = c > 0.5
    sum_, sum_low = fast_two_sum(one, c)
    u, v = jnp.where(near_normal, c - one, c), jnp.where(near_normal, sum_, c)
    product, product_low = two_product(u, v)  # -s^2, or c^2
    product_low = product_low + jnp.where(near_normal, u * sum_low, 0.0)
    m2, m2_low = one, jnp.zeros_like(c)
    if m is not None:
        m2, m2_low = two_square(m)
        scaled, low = two_product(m2, product)
        product, product_low = scaled, low + (m2 * product_low + m2_low * product)
    n2, n2_low = two_square(n)
    minus_ms2, lost = fast_two_sum(jnp.where(near_normal, 0.0, -m2), product)
    low = (n2_low - jnp.where(near_normal, 0.0, m2_low)) + product_low + lost
    return (minus_ms2 + n2) + low
