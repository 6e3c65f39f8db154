"""Complex amplitudes of one boundary with their derivatives in closed form.

With the quantities of `boundary`, N = n + ik and D = N^2 - m^2:

    r_s = -D / S^2                 t_s = 2 m c / S
    r_p = D Y m^2 / (S X)^2        t_p = 2 m c N m / (S X)

    dr_s = -N t_s / (Q S) dN - 2 m r_s / Q dc
    dr_p = N t_s m^2 Z / (Q S X^2) dN - 2 m^3 N^2 r_s / (Q X^2) dc,    Z = Y + s^2 D

r is homogeneous of degree 0 in (N, m), t_s = 1 + r_s and t_p = (1 + r_p) m / N, which gives the
other derivatives. At the critical angle itself (Q = 0) they are infinite; 0 is returned.
"""

import jax
import jax.numpy as jnp
from jax import lax

from .._numerics.complex import inverse, plus, scaled, squared_modulus, times
from .boundary import Boundary, boundary, unsigned, within_one


@jax.custom_jvp
def amplitudes_kernel(c, n, k, m):
    """r_s, r_p, t_s, t_p as complex arrays, for real c (sign ignored), n, k, m of one dtype."""
    return _amplitudes(boundary(within_one(c), n, k, m), n, k, m)


def _contrast(q: Boundary, k):
    return times((q.difference, k), (q.total, k))


def _amplitudes(q: Boundary, n, k, m):
    per_s, per_x = inverse(q.s), inverse(q.x)
    m2 = (m * m, None)
    minus_r_s = times(times(_contrast(q, k), per_s), per_s)
    r_p = times(minus_r_s, times(times(times(q.y, m2), per_x), per_x))
    t_s = times((2.0 * q.mc, None), per_s)
    t_p = times(t_s, times((n * m, k * m), per_x))
    # S = 0 only where nothing is left to reflect: matched media at cos = 0.
    matched = squared_modulus(q.s) == 0.0
    r_s, r_p, t_s, t_p = (lax.complex(*z) for z in (minus_r_s, r_p, t_s, t_p))
    return -r_s, r_p, jnp.where(matched, 1.0, t_s), jnp.where(matched, 1.0, t_p)


@amplitudes_kernel.defjvp
def _amplitudes_jvp(primals, tangents):
    (c, sign), n, k, m = unsigned(primals[0]), *primals[1:]
    dc, dn, dk, dm = tangents
    q = boundary(c, n, k, m)
    r_s, r_p, t_s, t_p = _amplitudes(q, n, k, m)
    per_s, per_x = inverse(q.s), inverse(q.x)
    per_q = inverse(q.q)
    z = plus(q.y, scaled((1.0 - c) * (1.0 + c), _contrast(q, k)))
    m_over_x = times((m, None), per_x)
    index = (n, k)

    # By t_s and r_s: Q S^2 alone would leave float32's range, for matched media at cos = 1e-12
    of_r_s, of_t_s = ((lax.real(z), lax.imag(z)) for z in (r_s, t_s))
    s_dn = times(times(index, times(of_t_s, per_q)), scaled(-1.0, per_s))
    s_dc = times(times((-2.0 * m, None), of_r_s), per_q)
    # m^2 Z / X^2 and m^2 N^2 / X^2 are formed first: N^2 X^-2 alone would leave float32's range
    p_dn = times(s_dn, times(times(z, m_over_x), m_over_x))
    p_dc = times(s_dc, times(times(index, m_over_x), times(index, m_over_x)))

    d_index = lax.complex(dn, dk)
    index = lax.complex(*index)
    s_dn, s_dc, p_dn, p_dc = (lax.complex(*d) for d in (s_dn, s_dc, p_dn, p_dc))
    dm, m, dc = (x.astype(index.dtype) for x in (dm / m, m, sign * dc))
    d_relative = d_index - index * dm
    dr_s = s_dn * d_relative + s_dc * dc
    dr_p = -p_dn * d_relative + p_dc * dc
    dt_p = (m / index) * dr_p - t_p * (d_relative / index)
    return (r_s, r_p, t_s, t_p), (dr_s, dr_p, dr_s, dt_p)
