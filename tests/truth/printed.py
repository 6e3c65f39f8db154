"""The forms that books and codes print, in JAX, and one of fewest divisions.

Each takes (cos, eta) or (cos, eta, k) with relative indices, and gives R of unpolarized light.
"""

import jax.numpy as jnp
from jax import lax


def pbrt4_dielectric(c, eta):
    """FrDielectric of pbrt-v4, sec. 9.3.5, for light from outside."""
    c = jnp.clip(c, 0.0, 1.0)
    sin2_t = (1.0 - c * c) / (eta * eta)
    cos_t = jnp.sqrt(jnp.maximum(0.0, 1.0 - sin2_t))
    r_parallel = (eta * c - cos_t) / (eta * c + cos_t)
    r_perpendicular = (c - eta * cos_t) / (c + eta * cos_t)
    R = (r_parallel * r_parallel + r_perpendicular * r_perpendicular) / 2.0
    return jnp.where(sin2_t >= 1.0, 1.0, R)


def pbrt4_complex(c, eta, k):
    """FrComplex of pbrt-v4, sec. 9.3.6."""
    c = jnp.clip(c, 0.0, 1.0)
    index = lax.complex(eta, k)
    sin2_t = (1.0 - c * c) / (index * index)
    cos_t = jnp.sqrt(1.0 - sin2_t)
    r_parallel = (index * c - cos_t) / (index * c + cos_t)
    r_perpendicular = (c - index * cos_t) / (c + index * cos_t)
    return (_norm(r_parallel) + _norm(r_perpendicular)) / 2.0


def _norm(z):
    return z.real * z.real + z.imag * z.imag


def pbrt3_conductor(c, eta, k):
    """FrConductor of pbrt-v3, eq. 8.3 with powers averaged instead of squared."""
    c2 = c * c
    sin2 = 1.0 - c2
    eta2, k2 = eta * eta, k * k
    t0 = eta2 - k2 - sin2
    a2_plus_b2 = jnp.sqrt(t0 * t0 + 4.0 * eta2 * k2)
    t1 = a2_plus_b2 + c2
    a = jnp.sqrt(0.5 * (a2_plus_b2 + t0))
    t2 = 2.0 * c * a
    R_s = (t1 - t2) / (t1 + t2)
    t3 = c2 * a2_plus_b2 + sin2 * sin2
    t4 = t2 * sin2
    return 0.5 * (R_s + R_s * (t3 - t4) / (t3 + t4))


def plain_lossless(c, eta):
    """Stable algebra without compensated sums: one square root, one division."""
    c2 = c * c
    contrast = (eta - 1.0) * (eta + 1.0)
    sin2 = (1.0 - c) * (1.0 + c)
    re_q2 = contrast + c2
    q = jnp.sqrt(jnp.maximum(re_q2, 0.0))
    s, cq = c + q, c * q
    x = cq + sin2
    r = contrast / (s * s * x)
    return jnp.where(re_q2 <= 0.0, 1.0, (cq * cq + sin2 * sin2) * (r * r))
