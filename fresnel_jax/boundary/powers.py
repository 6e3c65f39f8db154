"""Power reflectance and transmittance of one boundary with their derivatives in closed form.

With the quantities of `boundary` and N = n + ik:

    R_s = |N - m|^2 |N + m|^2 / |S|^4        T_s = 4 m c a / |S|^2
    R_p = |N - m|^2 |N + m|^2 |Y|^2 / |P|^4  T_p = 4 m c a (|Q|^2 + m^2 s^2) / |P|^2

with P = c N^2 + m Q = S X / m. Both moduli are sums of positive terms, without the root's second
rounding:

    |S|^2 = m^2 c^2 + |Q|^2 + 2 m c a
    |P|^2 = c^2 |N|^4 + m^2 |Q|^2 + 2 m c a (m^2 s^2 + |Q|^2)

Where less than half is transmitted R is 1 - T, with half of the error and never above 1. (Products of
the rounded S and X instead had errors of R_p up to 14 eps; these have 8.)

    dR_s = 4 Re(G dN) - 4 m R_s Re(1/Q) dc,            G = m c conj(N^2 - m^2) N / (Q |S|^4)
    dR_p = 4 Re(G K dN) + 4 m R_s Re(N^2 L / Q) dc,    K = m^4 Z conj(Y) / |X|^4, Z = Y + s^2 (N^2 - m^2)
                                                       L = m^4 conj(Y) / |X|^4

R is homogeneous of degree 0 in (n, k, m), which gives the derivative with respect to m, and
dT = -dR. The derivatives share all roots with the values and are finite wherever the truth is. At
the critical angle itself (Q = 0) they are infinite; 0 is returned.

The textbook derivative of r_p has 2 Q^2 - N^2 for Z, which cancels near index match at 45 degrees:
it cost 2e3 eps of the gradient there.
"""  # noqa: E501

import jax
import jax.numpy as jnp
from jax.custom_derivatives import SymbolicZero

from .._numerics.arithmetic import one_if_zero, reciprocal_or_zero
from .._numerics.complex import Complex, squared_modulus, times
from .._numerics.fences import fenced
from .boundary import Boundary, boundary, unsigned, within_one

# Every function here takes n, k, m as boundary does: k None is exactly 0, m None exactly 1, so
# that the usual lossless or vacuum-side case pays for no more than it needs. The kernels ignore
# the sign of c.


@jax.custom_jvp
def powers_kernel(c, n, k, m):
    """R_s, R_p, T_s, T_p."""
    q = boundary(within_one(c), n, k, m)
    return _values(q, within_one(c), n, k, m)


def _values(q: Boundary, c, n, k, m):
    m2 = 1.0 if m is None else m * m
    a, _ = q.q
    rho = q.rho
    mca = q.mc * a
    modulus = n * n if k is None else n * n + k * k
    c_modulus = c * modulus
    at_s = (q.mc * q.mc + rho) + 2.0 * mca  # |S|^2
    sigma_rho = q.ms_squared + rho
    at_p = (c_modulus * c_modulus + m2 * rho) + 2.0 * (mca * sigma_rho)  # |P|^2
    per_s2, per_p2 = reciprocal_or_zero(at_s), reciprocal_or_zero(at_p)
    # Matched media let everything through, also at cos = 0, where S = 0; with a NaN they do not.
    nothing = (q.difference == 0.0) & (at_s == at_s)
    nothing = nothing if k is None else nothing & (k == 0.0)
    # Divisions, not products with the reciprocals: the CPU compiler never repeats a division, and
    # makes 6 loops of these lines instead of 8. The quotient is cut at 1, not its numerator: on a
    # GPU the float32 quotient of two equal numbers may be 1 + eps.
    T_s = jnp.where(nothing, 1.0, jnp.minimum(4.0 * mca / one_if_zero(at_s), 1.0))
    T_p = jnp.where(nothing, 1.0, jnp.minimum(4.0 * mca * sigma_rho / one_if_zero(at_p), 1.0))
    R_s = contrast_over_s2(q.difference, q.total, k, per_s2)
    R_p = contrast_over_s2(q.difference, q.total, k, per_p2) * squared_modulus(q.y)
    R_s, R_p = (jnp.where(T < 0.5, 1.0 - T, R) for R, T in ((R_s, T_s), (R_p, T_p)))
    return R_s, R_p, T_s, T_p


def contrast_over_s2(difference, total, k, per_s2):
    """R_s = |N - m|^2 |N + m|^2 / |S|^4, from n - m, n + m, k and 1 / |S|^2."""
    near, far = (difference, k), (total, k)
    if k is None or per_s2.dtype != jnp.float32:
        return (squared_modulus(near) * per_s2) * (squared_modulus(far) * per_s2)
    # In float32 the square of k = 1e-30 at n = m underflows. R = 2.5e-13 at cos = 1e-12 needs it.
    tiny = jnp.maximum(jnp.abs(difference), k) < 2.0**-40
    lift = jnp.where(tiny, 2.0**60, 1.0).astype(per_s2.dtype)
    lowered = per_s2 * jnp.where(tiny, 2.0**-60, 1.0).astype(per_s2.dtype)
    near = (difference * lift, k * lift)
    return (squared_modulus(near) * lowered) * (squared_modulus(far) * lowered)


def _scaled_y(q: Boundary, k, m2) -> Complex:
    """m^2 Y / |X|^2. A division, not a product: the CPU compiler never repeats a division."""
    x2 = one_if_zero(squared_modulus(q.x))
    y_re, y_im = q.y
    return m2 * y_re / x2, None if k is None else m2 * y_im / x2


def _partials(q: Boundary, R_s, c, sign, n, k, m):
    """The derivatives of R_s and of R_p with respect to (c, n, k, m)."""
    m1 = 1.0 if m is None else m
    m2 = m1 * m1
    a, b = q.q
    per_s2 = reciprocal_or_zero(squared_modulus(q.s))
    per_x2 = m2 * reciprocal_or_zero(squared_modulus(q.x))
    per_q2 = reciprocal_or_zero(squared_modulus(q.q))
    s_squared = (1.0 - c) * (1.0 + c)
    n2_minus_m2 = q.difference * q.total
    y = _scaled_y(q, k, m2)
    if k is None:
        per_q = (a * per_q2, None)
        core = (n * n2_minus_m2 * per_s2, None)
        z = (y[0] + s_squared * n2_minus_m2 * per_x2, None)
        conj_y = y
        eps = (n * n * per_x2, None)
    else:
        k2, n2k = k * k, 2.0 * n * k
        per_q = (a * per_q2, -b * per_q2)
        # conj(N^2 - m^2) N, written so that n^2 - m^2 keeps its digits near index match
        core = (n * (n2_minus_m2 + k2) * per_s2, -k * (n * n + m2 + k2) * per_s2)
        z = (
            y[0] + s_squared * (n2_minus_m2 - k2) * per_x2,
            y[1] + s_squared * n2k * per_x2,
        )
        conj_y = (y[0], -y[1])
        eps = ((n * n - k2) * per_x2, n2k * per_x2)
    g_s = times((4.0 * q.mc * per_s2, None), times(core, per_q))
    g_p = times(g_s, times(z, conj_y))
    dc_factor = 4.0 * m1 * R_s * sign
    dc_s = -dc_factor * per_q[0]
    dc_p = dc_factor * times(eps, times(per_q, conj_y))[0]
    return tuple((dc, *_index_partials(g, n, k, m)) for dc, g in ((dc_s, g_s), (dc_p, g_p)))


def _index_partials(g, n, k, m):
    dn = g[0]
    dk = None if k is None else -g[1]
    if m is None:
        return dn, dk, None
    return dn, dk, -(n * dn + (0.0 if k is None else k * dk)) / m


def _along(partials, tangents):
    """The derivative along the tangents; what is not differentiated costs nothing."""
    terms = [
        fenced(partial) * tangent
        for partial, tangent in zip(partials, tangents, strict=True)
        if not (tangent is None or isinstance(tangent, SymbolicZero))
    ]
    return sum(terms[1:], terms[0])


def _powers_jvp(primals, tangents):
    (c, sign), n, k, m = unsigned(primals[0]), *primals[1:]
    q = boundary(c, n, k, m)
    values = _values(q, c, n, k, m)
    partials = _partials(q, values[0], c, sign, n, k, m)
    dR_s, dR_p = (_along(p, tangents) for p in partials)
    return values, (dR_s, dR_p, -dR_s, -dR_p)


powers_kernel.defjvp(_powers_jvp, symbolic_zeros=True)


@jax.custom_jvp
def plain_powers_kernel(c, n, k, m):
    """R_s, R_p, T_s, T_p by real numbers, without exact sums, in half of the time with slopes.

    With everything relative to m, Q = a + ib, rho = |Q|^2 and s^2 = 1 - c^2,

        R_s = |c - Q|^2 / (A + B)                A = c^2 + rho           B = 2 c a
        R_p = R_s |c Q - s^2|^2 / (C + D)        C = c^2 rho + s^4       D = s^2 B

    which XLA makes one loop of. All is right to some eps of 1 except beside the critical angle,
    where Q has the error of a root of eps; the critical angle itself is that of c to an eps, since
    Re Q^2 = (n - s)(n + s) - k^2.
    """
    return _plain(within_one(c), n, k, m)[0]


def _plain(c, n, k, m):
    """Return the powers, and what their derivatives need: c, n, k relative to m, and others."""
    n, k = (x if m is None else x * (1.0 / m) for x in (n, jnp.zeros_like(n) if k is None else k))
    s2 = (1.0 - c) * (1.0 + c)
    s = jnp.sqrt(s2)
    square = (n - s) * (n + s) - k * k, 2.0 * n * k
    rho = jnp.sqrt(square[0] * square[0] + square[1] * square[1])
    large = jnp.sqrt(0.5 * (rho + jnp.abs(square[0])))
    small = n * k / one_if_zero(large)
    a, b = (jnp.where(square[0] >= 0.0, x, y) for x, y in ((large, small), (small, large)))
    A, B, C = c * c + rho, 2.0 * c * a, c * c * rho + s2 * s2
    D = s2 * B
    per_s, per_x = reciprocal_or_zero(A + B), reciprocal_or_zero(C + D)
    R_s = squared_modulus((c - a, b)) * per_s
    share = jnp.where(s2 == 0.0, 1.0, squared_modulus((c * a - s2, c * b)) * per_x)
    T_s, T_p = 2.0 * B * per_s, 2.0 * (A * D + B * C) * per_s * per_x
    nothing = A + B == 0.0  # of matched media at cos = 0, which let everything through
    values = R_s, R_s * share, jnp.where(nothing, 1.0, T_s), jnp.where(nothing, 1.0, T_p)
    return values, (n, k, s2, square, rho, (a, b), (A, B, C, D), per_s, per_x, share)


def _plain_jvp(primals, tangents):
    (c, sign), (n, k, m) = unsigned(primals[0]), primals[1:]
    values, (n, k, s2, square, rho, (a, b), (A, B, C, D), per_s, per_x, share) = _plain(c, n, k, m)
    dc, dn, dk, dm = (None if isinstance(t, SymbolicZero) else t for t in tangents)
    dc = None if dc is None else sign * dc
    # d(Q^2) = 2 N dN + 2 c dc, and so dQ = (N dN + c dc) / Q
    z = [jnp.zeros_like(rho), jnp.zeros_like(rho)]
    per_m = 1.0 if m is None else 1.0 / m
    for factor, dx in (((n, k), dn), ((-k, n), dk), ((square[0] + s2, square[1]), dm)):
        if dx is not None:
            along = dx * (-per_m if dx is dm else per_m)
            z = [u + f * along for u, f in zip(z, factor, strict=True)]
    if dc is not None:
        z[0] = z[0] + c * dc
    per_q2 = reciprocal_or_zero(rho)
    da = (a * z[0] + b * z[1]) * per_q2
    drho = 2.0 * (square[0] * z[0] + square[1] * z[1]) * per_q2
    dA, dB, dC = drho, 2.0 * c * da, c * c * drho
    dD = s2 * dB
    if dc is not None:
        dA, dB = dA + 2.0 * c * dc, dB + 2.0 * a * dc
        dC, dD = dC + 2.0 * c * (rho - 2.0 * s2) * dc, s2 * dB - 2.0 * c * B * dc
    d_s = 2.0 * per_s * per_s * (B * dA - A * dB)
    d_p = share * d_s + values[0] * (2.0 * per_x * per_x * (D * dC - C * dD))
    return values, (d_s, d_p, -d_s, -d_p)


plain_powers_kernel.defjvp(_plain_jvp, symbolic_zeros=True)
