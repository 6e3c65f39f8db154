"""Power reflectance of one boundary for unpolarized light, with its derivatives in closed form.

With the quantities of `boundary`, C = m c, sigma = m^2 s^2 and X = C Q + sigma,

    r_s = (C - Q) / (C + Q),    r_p = r_s (sigma - C Q) / (sigma + C Q),
    R = (R_s + R_p) / 2 = R_s U / |X|^2,    U = |C Q|^2 + sigma^2,    |X|^2 = U + 2 sigma C Re Q.

Only positive terms are added: R does not vanish at Brewster's angle, so that Re Y, half of the
exact sums of `boundary`, is not needed; what the derivatives need of it is cheaper (`_y`).

    dR = 4 C Re(N conj(Q E) dN) / (|S|^4 |X|^2 |Q|^2) + 2 m R_s Re(H) dc,
    E = (N^2 - m^2) U + |N^2 - m^2|^2 sigma m^2 Y / (2 |X|^2)
    H = sigma conj(Q X) ((C^2 + Q^2)(conj(C Q) - sigma) - 4 C Q Re(C Q) - 2 sigma X) / (|Q|^2 |X|^4)

H vanishes with sigma. The mean of the s and p derivatives cancels at normal incidence (it cost 4e6
eps of the gradient for n = 1e-6 in float32), this form of H at grazing incidence and in total
reflection, so each is used where it is good.
"""

import functools

import jax
import jax.numpy as jnp

from .._numerics.arithmetic import (
    complex_sqrt,
    one_if_zero,
    positive_sqrt,
    reciprocal_or_zero,
    shared_sqrt,
    two_product,
)
from .._numerics.complex import (
    Complex,
    conjugate,
    conjugate_times,
    minus,
    plus,
    scaled,
    square,
    squared_modulus,
    times,
)
from .._numerics.fences import opaque
from .boundary import doubled_re_q2, lossless_sums, unsigned, within_one
from .powers import _along, contrast_over_s2


@functools.partial(jax.custom_jvp, nondiff_argnums=(4,))
def unpolarized_kernel(c, n, k, m, compensated=True):
    """R, for c, n, k, m as `boundary` takes them; the sign of c is ignored.

    Without `compensated` Re Q^2 is summed plainly: the error of R is then up to 24 eps m / (c |Q|)
    near the critical angle (at most 40 sqrt(eps) / c; for |N| < m both times (m / |N|)^2) and the
    same elsewhere, at .6 of the cost.
    """
    c = within_one(c)
    re_q2 = doubled_re_q2(c, n, m) if compensated else _re_q2_plain(c, n, m)
    p = _Parts(c, n, k, m, _root(re_q2, n, k, complex_sqrt))
    return _reflected(p, reciprocal_or_zero(p.s2), p.u / one_if_zero(p.x2))


def _re_q2_plain(c, n, m):
    if m is None:
        return (n - 1.0) * (n + 1.0) + c * c
    mc = m * c
    return (n - m) * (n + m) + mc * mc


def _root(re_q2, n, k, sqrt) -> Complex:
    """Q; in lossless total reflection 0, since R is 1 there whatever Q."""
    if k is None:
        return positive_sqrt(re_q2), None
    return sqrt(re_q2 - k * k, (2.0 * n) * k)


class _Parts:
    """What value and derivatives share."""

    def __init__(self, c, n, k, m, q: Complex):
        one_or_m = 1.0 if m is None else m
        self.k, self.m, self.m2 = k, one_or_m, one_or_m * one_or_m
        self.C = C = one_or_m * c
        self.sigma = sigma = (1.0 - c) * (1.0 + c) * self.m2
        self.near, self.far = n - one_or_m, n + one_or_m
        self.q, self.rho = q, squared_modulus(q)
        Ca = C * q[0]
        if k is None:
            S, X = C + q[0], Ca + sigma
            self.s2, self.u, self.x2 = S * S, Ca * Ca + sigma * sigma, X * X
        else:
            twice_Ca = 2.0 * Ca
            self.s2 = (C * C + self.rho) + twice_Ca
            self.u = (C * C) * self.rho + sigma * sigma
            self.x2 = self.u + sigma * twice_Ca


def _y(c, n, k, p: "_Parts", index2: Complex) -> Complex:
    """Y, as exact as the derivatives of R need it.

    R does not vanish at Brewster's angle, but dR is 2 n^2 times as sensitive to Y as R: at
    c = m / n of a large n, Y is a sum that keeps the digits of cn - m. Next to normal incidence
    that sum cancels, and Y = Q^2 - s^2 N^2 is taken, of which Q^2 alone may vanish, known to its
    last digit (the critical angle of a small n). Brewster's angle of n < m / 30 has neither.
    """
    cn, lost = two_product(opaque(c), opaque(n))
    at_large_n = ((cn - p.m) + lost) * (cn + p.m) + p.C * p.C
    near_normal = -((1.0 - c) * (1.0 + c)) * index2[0]
    if k is None:
        return jnp.where(c > 0.75, p.rho + near_normal, at_large_n), None
    b, c2 = p.q[1], c * c
    near_normal = (p.rho - 2.0 * (b * b)) + near_normal
    return jnp.where(c > 0.75, near_normal, at_large_n - c2 * (k * k)), c2 * index2[1]


def _R_s(p: _Parts, per_s2):
    if p.k is None:
        r_s = (p.near * per_s2) * p.far
        return r_s * r_s
    return contrast_over_s2(p.near, p.far, p.k, per_s2)


def _reflected(p: _Parts, per_s2, u_per_x2):
    R = _R_s(p, per_s2) * u_per_x2
    contrast = p.near != 0.0 if p.k is None else (p.near != 0.0) | (p.k != 0.0)
    return jnp.where((p.q[0] == 0.0) & contrast, 1.0, jnp.minimum(R, 1.0))


def _unpolarized_jvp(compensated, primals, tangents):
    (c, sign), n, k, m = unsigned(primals[0]), *primals[1:]
    re_q2 = lossless_sums(c, n, m)[0] if compensated else _re_q2_plain(c, n, m)
    p = _Parts(c, n, k, m, _root(re_q2, n, k, shared_sqrt))
    C, sigma, m2 = p.C, p.sigma, p.m2
    s2_x2 = p.s2 * p.x2
    if k is None:  # in total reflection S = C, whose square may underflow, and nothing is wanted
        s2_x2 = jnp.where(p.q[0] == 0.0, 0.0, s2_x2)
    per_both = reciprocal_or_zero(s2_x2)  # one division for two quotients
    per_s2, per_x2 = per_both * p.x2, per_both * p.s2
    per_q2 = reciprocal_or_zero(p.rho)
    q, n2_minus_m2 = p.q, p.near * p.far
    if k is None:
        N, index2, contrast = (n, None), (n * n, None), (n2_minus_m2, None)
    else:
        k2, n2k = k * k, n * (2.0 * k)
        N, index2, contrast = (n, k), (n * n - k2, n2k), (n2_minus_m2 - k2, n2k)
    y = _y(c, n, k, p, index2)
    steep = squared_modulus(contrast) * ((0.5 * sigma) * (m2 * per_x2))
    # E / |S|^2 before all else: |N Q E| alone would leave float32's range for N = 1e8
    e = scaled(per_s2, plus(scaled(p.u, contrast), scaled(steep, y)))
    g = scaled(per_q2, conjugate_times(conjugate_times(q, N), e))
    dn, dk = scaled(4.0 * C * per_both, g)
    dm = None if m is None else -(n * dn + (0.0 if k is None else k * dk)) / m

    conj_y = scaled(m2 * per_x2, conjugate(y))
    per_q = scaled(per_q2, conjugate(q))
    difference = m2 * times(scaled(per_x2, index2), times(per_q, conj_y))[0] - per_q[0]
    h = times(scaled(per_x2, _turned(p)), per_q)
    h_re = times(h, conjugate(_x_of(p)))[0]
    small_sine = sigma < 0.5 * jnp.minimum(m2, p.rho)
    re_h = jnp.where(small_sine, sigma * per_x2 * h_re, difference)
    dc = sign * (2.0 * p.m) * _R_s(p, per_s2) * re_h
    return _reflected(p, per_s2, p.u * per_x2), _along((dc, dn, dk, dm), tangents)


def _x_of(p: _Parts) -> Complex:
    re, im = scaled(p.C, p.q)
    return re + p.sigma, im


def _turned(p: _Parts) -> Complex:
    """The bracket of H: (C^2 + Q^2)(conj(C Q) - sigma) - 4 C Q Re(C Q) - 2 sigma X."""
    C, sigma = p.C, p.sigma
    z = scaled(C, p.q)
    q_squared, conj_z = square(p.q), conjugate(z)
    h = times((C * C + q_squared[0], q_squared[1]), (conj_z[0] - sigma, conj_z[1]))
    return minus(minus(h, scaled(4.0 * z[0], z)), scaled(2.0 * sigma, _x_of(p)))


unpolarized_kernel.defjvp(_unpolarized_jvp, symbolic_zeros=True)
