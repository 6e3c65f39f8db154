"""What the phases of reflection need: -r_s and -r_p / r_s, with derivatives in closed form.

With the quantities of `_boundary`, N = n + ik and D = N^2 - m^2:

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

from ._arithmetic import reciprocal_or_zero, squared_modulus, times
from ._boundary import Boundary, boundary, unsigned, within_one


@jax.custom_jvp
def phases_kernel(c, n, k, m):
    """Re f, Im f, Re g, Im g for real c (sign ignored), n, k, m of one dtype."""
    return _values(boundary(within_one(c), n, k, m), k, m)


def _values(q: Boundary, k, m):
    _, b = q.q
    per_s2 = reciprocal_or_zero(squared_modulus(q.s))
    per_x2 = reciprocal_or_zero(squared_modulus(q.x))
    per_s, m_per_x = _inverses(q, m, per_s2, per_x2)
    contrast = times((q.difference, k), (q.total, k))
    f = times(times(contrast, per_s), per_s)
    g = times(times(q.y, m_per_x), m_per_x)
    f_im = 2.0 * (q.mc * b) * per_s2
    g_im = 2.0 * q.ms_squared * ((q.mc * b) * per_x2)
    return f[0], f_im, g[0], g_im


def _inverses(q: Boundary, m, per_s2, per_x2):
    per_s = (q.s[0] * per_s2, -q.s[1] * per_s2)
    m_per_x = (m * q.x[0] * per_x2, -m * q.x[1] * per_x2)
    return per_s, m_per_x


@phases_kernel.defjvp
def _phases_jvp(primals, tangents):
    (c, sign), n, k, m = unsigned(primals[0]), *primals[1:]
    dc, dn, dk, dm = tangents
    q = boundary(c, n, k, m)
    per_s, m_per_x = _inverses(
        q, m, reciprocal_or_zero(squared_modulus(q.s)), reciprocal_or_zero(squared_modulus(q.x))
    )
    a, b = q.q
    per_q2 = reciprocal_or_zero(squared_modulus(q.q))
    per_q = (a * per_q2, -b * per_q2)
    index = (n, k)
    contrast = times((q.difference, k), (q.total, k))
    c_index = (c * n, c * k)
    c2_index2_per_q = times(times(c_index, c_index), per_q)
    slope = (c2_index2_per_q[0] + a, c2_index2_per_q[1] + b)

    # The small factors come first: 1 / X^2 alone would leave float32's range
    per_qs2 = times(times(per_q, per_s), per_s)
    f_dn = times((2.0 * q.mc, None), times(index, per_qs2))
    f_dc = times((-2.0 * m, None), times(contrast, per_qs2))
    s_squared = (1.0 - c) * (1.0 + c)
    g_dn = times((2.0 * q.mc * s_squared, None), times(times(index, m_per_x), m_per_x))
    g_dn = times(g_dn, per_q)
    g_dc = times((2.0 * m, None), times(times(slope, m_per_x), m_per_x))

    # f and g are homogeneous of degree 0 in (N, m)
    relative = dm / m
    d_index = (dn - n * relative, dk - k * relative)
    dc = sign * dc
    df = [x + y * dc for x, y in zip(times(f_dn, d_index), f_dc, strict=True)]
    dg = [x + y * dc for x, y in zip(times(g_dn, d_index), g_dc, strict=True)]
    return _values(q, k, m), (*df, *dg)
