"""Reflected and transmitted power between lossless media, for unpolarized light.

A BSDF needs R and T but not their s and p parts, and R next to Brewster's angle does not vanish:
without the exact sums that R_p needs there, the pair costs half of `interface.powers`.
"""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from .._numerics.arithmetic import reciprocal_or_zero
from .._numerics.fences import computed_once
from .boundary import doubled_re_q2, lossless_sums, within_one
from .powers import powers_kernel


class Shares(NamedTuple):
    """Fractions of the incident power; they add to 1 in a few eps."""

    R: Array
    T: Array


@functools.partial(jax.custom_jvp, nondiff_argnums=(3,))
def shares(cosine: Array, eta_t: Array, eta_i: Array, exactly: bool) -> Shares:
    """R and T at abs(cosine), from eta_i into eta_t; derivatives as `powers`.

    With C = m c, sigma = m^2 s^2 and Q of `boundary`: R_s = ((n - m)(n + m) / |C + Q|^2)^2,
    R_p / R_s = |C Q - sigma|^2 / |C Q + sigma|^2, T_s = 4 C Re Q / |C + Q|^2 and, since
    Q^2 + sigma = n^2, T_p / T_s = (m n)^2 / (C Q + sigma)^2. The means of s and p are sums of
    positive terms; T, which is no difference 1 - R, vanishes with Re Q in total reflection.

    Both within 12 eps; without `exactly`, T of light that goes to the less dense side only within
    12 eps of R + T, at two thirds of the cost.
    """
    c, m, n = within_one(cosine), eta_i, eta_t
    re_q2 = lossless_sums(c, n, m)[0] if exactly else doubled_re_q2(c, n, m)
    re_q2 = computed_once(re_q2)
    rho = jnp.abs(re_q2)
    a = jnp.where(re_q2 < 0.0, 0.0, jnp.sqrt(rho))
    C, sigma = m * c, (1.0 - c) * (1.0 + c) * (m * m)
    twice_Ca = 2.0 * (C * a)
    per_s2 = reciprocal_or_zero((C * C + rho) + twice_Ca)
    u = (C * C) * rho + sigma * sigma
    per_x2 = 1.0 / (u + sigma * twice_Ca)
    r_s = ((n - m) * per_s2) * (n + m)
    half_T_s, mn = twice_Ca * per_s2, m * n
    # At cos = 0 matched media have C + Q = 0, and total reflection is exactly 1. NaN is neither.
    matched = (n == m) & (re_q2 == re_q2)
    R = jnp.where(matched, 0.0, jnp.where(a == 0.0, 1.0, (r_s * r_s) * (u * per_x2)))
    return Shares(R, jnp.where(matched, 1.0, half_T_s + half_T_s * (mn * mn * per_x2)))


@shares.defjvp
def _shares_jvp(exactly, primals, tangents):
    def powers(cosine, eta_t, eta_i):
        return powers_kernel(cosine, eta_t, None, eta_i)

    _, (d_R_s, d_R_p, d_T_s, d_T_p) = jax.jvp(powers, primals, tangents)
    return shares(*primals, exactly), Shares(0.5 * (d_R_s + d_R_p), 0.5 * (d_T_s + d_T_p))
