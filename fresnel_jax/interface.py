"""One smooth boundary between two media: amplitudes and powers."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax.custom_derivatives import SymbolicZero
from jaxtyping import Array, ArrayLike

from ._arithmetic import reciprocal_or_zero, squared_modulus, times
from ._boundary import Boundary, boundary


class Powers(NamedTuple):
    R_s: Array
    R_p: Array
    T_s: Array
    T_p: Array

    @property
    def R(self):
        return 0.5 * (self.R_s + self.R_p)

    @property
    def T(self):
        return 0.5 * (self.T_s + self.T_p)


def _powers_from(q: Boundary, k, m):
    m2 = 1.0 if m is None else m * m
    per_s2 = reciprocal_or_zero(squared_modulus(q.s))
    per_x2 = m2 * reciprocal_or_zero(squared_modulus(q.x))
    # |N - m|^2 |N + m|^2 / |S|^4
    near, far = q.difference, q.total
    if k is None or near.dtype != jnp.float32:
        R_s = (squared_modulus((near, k)) * per_s2) * (squared_modulus((far, k)) * per_s2)
    else:
        tiny = jnp.maximum(jnp.abs(near), k) < 2.0**-40
        lift = jnp.where(tiny, 2.0**60, 1.0).astype(near.dtype)
        per_s2_lifted = per_s2 * jnp.where(tiny, 2.0**-60, 1.0).astype(near.dtype)
        R_s = (squared_modulus((near * lift, k * lift)) * per_s2_lifted) * (
            squared_modulus((far, k)) * per_s2_lifted)
    x2 = squared_modulus(q.x)
    x2 = jnp.where(x2 == 0.0, 1.0, x2)
    y_hat = (m2 * q.y[0] / x2, None if k is None else q.y[1] * per_x2)
    R_p = R_s * squared_modulus(y_hat)
    a, b = q.q
    T_s = 4.0 * q.mc * a * per_s2
    T_p = T_s * ((a * a + b * b + q.ms_squared) * per_x2)
    contrast = near != 0.0
    if k is not None:
        contrast = contrast | (k != 0.0)
    reflected_totally = (a == 0.0) & contrast
    R_s = jnp.where(reflected_totally, 1.0, jnp.minimum(R_s, 1.0))
    R_p = jnp.where(reflected_totally, 1.0, jnp.minimum(R_p, 1.0))
    return R_s, R_p, jnp.minimum(T_s, 1.0), jnp.minimum(T_p, 1.0)


@jax.custom_jvp
def _powers(c, n, k, m):
    return _powers_from(boundary(c, n, k, m, True), k, m)


@jax.custom_jvp
def _reflectances(c, n, k, m):
    return _powers_from(boundary(c, n, k, m, False), k, m)[:2]


BARRIER = False
def _powers_jvp(primals, tangents):
    c, n, k, m = primals
    q = boundary(c, n, k, m)
    if BARRIER:
        bar = lambda t: jax.tree.map(jax.lax.optimization_barrier, t)
        mc = c if m is None else c * m
        qq = bar(q.q); yy = bar(q.y[0]); ms2 = bar(q.ms_squared)
        q = q._replace(q=qq, y=(yy, q.y[1]), ms_squared=ms2, s=(mc + qq[0], qq[1]), x=(mc*qq[0]+ms2, mc*qq[1]))
    out = _powers_from(q, k, m)
    R_s = out[0]
    per_s2 = reciprocal_or_zero(squared_modulus(q.s))
    per_x2 = (1.0 if m is None else m * m) * reciprocal_or_zero(squared_modulus(q.x))
    per_q2 = reciprocal_or_zero(squared_modulus(q.q))
    a, b = q.q
    n2_minus_m2 = q.difference * q.total
    s2 = (1.0 - c) * (1.0 + c)
    y_re, y_im = q.y
    x2 = squared_modulus(q.x)
    x2 = jnp.where(x2 == 0.0, 1.0, x2)
    m2 = 1.0 if m is None else m * m
    y_hat = (m2 * q.y[0] / x2, None if k is None else q.y[1] * per_x2)
    if k is None:
        conj_q = (a * per_q2, None)
        core = (n * n2_minus_m2 * per_s2, None)
        conj_y = y_hat
        z = (y_hat[0] + s2 * n2_minus_m2 * per_x2, None)
        eps = (n * n * per_x2, None)
    else:
        conj_q = (a * per_q2, -b * per_q2)
        n2_plus_m2 = n * n + (1.0 if m is None else m * m)
        k2 = k * k
        core = (n * (n2_minus_m2 + k2) * per_s2, -k * (n2_plus_m2 + k2) * per_s2)
        conj_y = (y_hat[0], -y_hat[1])
        z = (y_hat[0] + s2 * (n2_minus_m2 - k2) * per_x2, y_hat[1] + s2 * (2.0 * n * k) * per_x2)
        eps = ((n * n - k2) * per_x2, 2.0 * n * k * per_x2)
    f = 4.0 * q.mc * per_s2
    g_s = times(times((f * core[0], None if k is None else f * core[1]), conj_q), (1.0, None))
    g_p = times(g_s, times(z, conj_y))
    m1 = 1.0 if m is None else m
    per_c = 4.0 * m1 * R_s
    d_c = (-per_c * conj_q[0], per_c * times(eps, times(conj_q, conj_y))[0])
    d = []
    for dc_, g in zip(d_c, (g_s, g_p)):
        dn_ = g[0]
        dk_ = None if k is None else -g[1]
        dm_ = None if m is None else -(n * dn_ + (0.0 if k is None else k * dk_)) / m
        d.append(_contract((dc_, dn_, dk_, dm_), tangents))
    d_s, d_p = d
    return out, (d_s, d_p, -d_s, -d_p)


def _reflectances_jvp(p, t):
    o, d = _powers_jvp(p, t)
    return o[:2], d[:2]


def _contract(partials, tangents):
    terms = [p * t for p, t in zip(partials, tangents, strict=True) if t is not None and not isinstance(t, SymbolicZero)]
    return sum(terms[1:], terms[0])


_powers.defjvp(_powers_jvp, symbolic_zeros=True)
_reflectances.defjvp(_reflectances_jvp, symbolic_zeros=True)


def _arguments(cos_theta_i, eta, k, eta_i):
    k = None if isinstance(k, int | float) and k == 0 else k
    eta_i = None if isinstance(eta_i, int | float) and eta_i == 1 else eta_i
    return cos_theta_i, eta, k, eta_i


def _floats(*args):
    dtype = jnp.result_type(*[a for a in args if a is not None], 1.0)
    return tuple(None if a is None else jnp.asarray(a, dtype) for a in args)


@jax.jit
def _jit_powers(*args):
    c, n, k, m = _floats(*args)
    return Powers(*_powers(jnp.abs(c), n, k, m))


@jax.jit
def _jit_reflectance(*args):
    c, n, k, m = _floats(*args)
    s, p = _reflectances(jnp.abs(c), n, k, m)
    return 0.5 * (s + p)


def powers(cos_theta_i, eta, k=0.0, eta_i=1.0):
    return _jit_powers(*_arguments(cos_theta_i, eta, k, eta_i))


def reflectance(cos_theta_i, eta, k=0.0, eta_i=1.0):
    return _jit_reflectance(*_arguments(cos_theta_i, eta, k, eta_i))
