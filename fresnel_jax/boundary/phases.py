"""What the phases of reflection need: -r_s and -r_p / r_s, with derivatives in closed form.

With the quantities of `boundary`, N = n + ik and D = N^2 - m^2:

    f = -r_s       = D / S^2 = (Q - m c) / (Q + m c)
    g = -r_p / r_s = m^2 Y / X^2 = (m c Q - m^2 s^2) / (m c Q + m^2 s^2)

    df = 2 N m c / (Q S^2) dN - 2 m D / (Q S^2) dc
    dg = 2 N m^3 c s^2 / (Q X^2) dN + 2 m^3 (c^2 N^2 / Q + Q) / X^2 dc

The first forms keep the digits of the real parts, which vanish at index match and at Brewster's
angle. The second ones give the imaginary parts as products of numbers that are not negative,

    Im f = 2 m c Im Q / |S|^2,        Im g = 2 m^3 c s^2 Im Q / |X|^2,

so that rounding cannot give them the wrong sign: both phases stay on one branch, from 0 to pi, for
every passive medium. Neither D nor S is left in g: it has a value and a derivative at index match
too, where r_s and r_p vanish. The derivative of log(r_p / r_s) is likewise one product, where that
of log(r_p) minus that of log(r_s) would cancel near normal incidence.
"""

import jax
import jax.numpy as jnp

from .._numerics.arithmetic import reciprocal_or_zero
from .._numerics.complex import inverse, minus, plus, scaled, squared_modulus, times
from .boundary import Boundary, boundary, unsigned, within_one


@jax.custom_jvp
def phases_kernel(c, n, k, m):
    """Re f, Im f, Re g, Im g for real c (sign ignored), n, k, m of one dtype."""
    return _values(boundary(within_one(c), n, k, m), k, m)


def _values(q: Boundary, k, m):
    _, b = q.q
    per_s2 = reciprocal_or_zero(squared_modulus(q.s))
    per_x2 = reciprocal_or_zero(squared_modulus(q.x))
    per_s, m_per_x = inverse(q.s), scaled(m, inverse(q.x))
    contrast = times((q.difference, k), (q.total, k))
    f = times(times(contrast, per_s), per_s)
    g = times(times(q.y, m_per_x), m_per_x)
    f_im = 2.0 * (q.mc * b) * per_s2
    g_im = 2.0 * q.ms_squared * ((q.mc * b) * per_x2)
    return f[0], f_im, g[0], g_im


@phases_kernel.defjvp
def _phases_jvp(primals, tangents):
    (c, sign), n, k, m = unsigned(primals[0]), *primals[1:]
    dc, dn, dk, dm = tangents
    q = boundary(c, n, k, m)
    per_s, m_per_x = inverse(q.s), scaled(m, inverse(q.x))
    per_q = inverse(q.q)
    index = (n, k)
    contrast = times((q.difference, k), (q.total, k))
    c_index = (c * n, c * k)
    slope = plus(times(times(c_index, c_index), per_q), q.q)

    # The small factors come first: 1 / X^2 alone would leave float32's range
    per_qs2 = times(times(per_q, per_s), per_s)
    f_dn = times((2.0 * q.mc, None), times(index, per_qs2))
    f_dc = times((-2.0 * m, None), times(contrast, per_qs2))
    s_squared = (1.0 - c) * (1.0 + c)
    g_dn = times((2.0 * q.mc * s_squared, None), times(times(index, m_per_x), m_per_x))
    g_dn = times(g_dn, per_q)
    g_dc = times((2.0 * m, None), times(times(slope, m_per_x), m_per_x))

    # f and g are homogeneous of degree 0 in (N, m)
    d_index = minus((dn, dk), scaled(dm / m, index))
    df = plus(times(f_dn, d_index), scaled(sign * dc, f_dc))
    dg = plus(times(g_dn, d_index), scaled(sign * dc, g_dc))
    return _values(q, k, m), (*df, *dg)


@jax.custom_jvp
def psi_kernel(c, n, k, m):
    """arctan |g|, for arguments as `phases_kernel` takes them.

    d psi = |g| / (1 + |g|^2) Re(d log g). Near total reflection log g varies in its imaginary part
    alone, and taking the real part of a complex quotient left 2e3 eps of an error. Written out,

        Re(d log g) = 2 m / |Q Y|^2 (a B dc + c s^2 [(u y_1 + v y_2) dn + (u y_2 - v y_1) dk])
        B = y_1 (c^2 Re N^2 + Re Q^2) + c^2 (1 + c^2) (Im N^2)^2 - 2 m^2 s^2 b^2
        N conj(Q) = u + iv = (n a + k b) - i m^2 s^2 n b / (n^2 + b^2),    Y = y_1 + i y_2,

    a, which vanishes there, is a factor, and v is no difference.
    """
    _, _, g_re, g_im = phases_kernel(c, n, k, m)
    return jnp.arctan(jnp.sqrt(g_re * g_re + g_im * g_im))


@psi_kernel.defjvp
def _psi_jvp(primals, tangents):
    (c, sign), n, k, m = unsigned(primals[0]), *primals[1:]
    dc, dn, dk, dm = tangents
    q = boundary(c, n, k, m)
    (a, b), (y_1, y_2) = q.q, q.y
    modulus = jnp.sqrt(squared_modulus(q.y))
    per_y = reciprocal_or_zero(modulus)
    unit = y_1 * per_y, y_2 * per_y
    per_x2 = m * m * reciprocal_or_zero(squared_modulus(q.x))
    g = modulus * per_x2
    # |g| / |Y| = m^2 / |X|^2 is taken first: both vanish at Brewster's angle
    factor = 2.0 * m * per_x2 / (1.0 + g * g) * reciprocal_or_zero(q.rho)
    c2, e_2 = c * c, 2.0 * n * k
    sum_of_squares = c2 * ((n - k) * (n + k)) + (a - b) * (a + b)
    rest = c2 * (1.0 + c2) * (e_2 * e_2) - 2.0 * q.ms_squared * (b * b)
    by_c = a * (unit[0] * sum_of_squares + rest * per_y)
    u, v = n * a + k * b, -q.ms_squared * (n / (n * n + b * b)) * b
    c_s2 = c * ((1.0 - c) * (1.0 + c))
    by_n, by_k = c_s2 * (u * unit[0] + v * unit[1]), c_s2 * (u * unit[1] - v * unit[0])
    relative = dm / m
    along = by_c * sign * dc + by_n * (dn - n * relative) + by_k * (dk - k * relative)
    return psi_kernel(*primals), factor * along
