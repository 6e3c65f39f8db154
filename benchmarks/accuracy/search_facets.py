"""Entries of the accuracy search: half vectors, visible normals, and a rough dielectric.

`bsdf.adjoint` is `evaluate` with its directions exchanged, and a sample of a rough surface is a
visible normal, a reflection or refraction by it, and `evaluate` there: they have no entries.
"""

import gmpy2
import jax.numpy as jnp
import numpy as np

from benchmarks.accuracy.search_boundary import unpolarized
from benchmarks.accuracy.search_bsdf import D, G, stretched
from benchmarks.accuracy.search_directions import TWO_DIRECTIONS, directions, two_directions
from benchmarks.accuracy.search_functions import Function, decades
from fresnel_jax import bsdf
from fresnel_jax.microfacet import TrowbridgeReitz, half_vector, half_vector_jacobian

_ONE, _ZERO = gmpy2.mpfr(1), gmpy2.mpfr(0)
_ALPHAS, _ETA = ((1e-3, 1.0), (1e-3, 1.0)), (0.25, 4.0)


def _dot(a, b):
    return sum(x * y for x, y in zip(a, b, strict=True))


def _unit(v):
    length = gmpy2.sqrt(_dot(v, v))
    return [x / length for x in v]


def _half(o, i, eta):
    """The normal and the indices on both sides, or None where there is none."""
    eta_o, eta_i = ((eta if w[2] < 0 else _ONE) for w in (o, i))
    if o[2] * i[2] > 0:
        eta_o = eta_i = _ONE
    m = [eta_o * a + eta_i * b for a, b in zip(o, i, strict=True)]
    if _dot(m, m) < gmpy2.mpfr(2) ** -60 or o[2] * i[2] == 0:
        return None
    m = _unit(m)
    return [-x for x in m] if m[2] < 0 else m, eta_o, eta_i


def _normal(*v):
    found = _half(v[:3], v[3:6], v[6])
    return None if found is None else [(x, _ONE) for x in found[0]]


def _jacobian(*v):
    o, i = v[:3], v[3:6]
    found = _half(o, i, v[6])
    if found is None:
        return None
    m, eta_o, eta_i = found
    c_i = abs(_dot(i, m))
    if o[2] * i[2] > 0:
        return [(1 / (4 * c_i), None)]
    if _dot(o, m) * _dot(i, m) >= 0:
        return None  # both on one side of the facet: no ray is refracted so
    return [(eta_i**2 * c_i / (eta_o * _dot(o, m) + eta_i * _dot(i, m)) ** 2, None)]


def _visible(*v):
    """G1(w) D(m) (w . m) / |z| of w on the upper side."""
    w, m, a, b = v[:3], v[3:6], v[6], v[7]
    cosine = _dot(w, m)
    if w[2] <= 0 or m[2] <= 0 or cosine <= 0:
        return None
    return [(2 * D(*m, a, b)[0][0] * cosine / (w[2] + stretched(w, a, b)), None)]


def _sampled(*v):
    """The half vector of w and a point of the cap z > -w_z, stretched (Dupuy and Benyoub 2023)."""
    w, a, b, u1, u2 = v[:3], *v[3:7]
    x, y, z = _unit([a * w[0], b * w[1], w[2]])
    height = (1 - u2) * (1 + z) - z
    radius, turn = gmpy2.sqrt(1 - height * height), 2 * gmpy2.const_pi() * u1
    cap = [radius * gmpy2.cos(turn), radius * gmpy2.sin(turn), height]
    half = [p + q for p, q in zip(cap, (x, y, z), strict=True)]
    stretched_half = [a * half[0], b * half[1], half[2]]
    return [(p, _ONE) for p in _unit(stretched_half)]


def _dielectric(*v):
    """f and density as PBRT's 4th edition prints them (sec. 9.7), at the half vector."""
    o, i, (a, b, eta) = v[:3], v[3:6], v[6:9]
    found = _half(o, i, eta)
    if found is None:
        return None
    m, eta_o, eta_i = found
    c_o, c_i = _dot(o, m), _dot(i, m)
    if c_o * o[2] <= 0 or c_i * i[2] <= 0:
        return None
    n, here = (_ONE, eta) if o[2] < 0 else (eta, _ONE)
    cos2 = 1 - (here / n) ** 2 * (1 - c_o * c_o)
    if cos2 <= 0 and o[2] * i[2] < 0:
        return None  # rounding left the pair beyond the critical angle of its facet
    R = _ONE
    if cos2 > 0:
        fresnel = unpolarized(abs(c_o), n, _ZERO, here)
        if fresnel is None:
            return None
        R = fresnel[0][0]
    facets, seen = D(*m, a, b)[0][0], 2 * abs(o[2]) / (abs(o[2]) + stretched(o, a, b))
    visible = seen * facets * abs(c_o) / abs(o[2])
    value = facets * G(*o, *i, a, b)[0][0] / abs(o[2] * i[2])
    if o[2] * i[2] > 0:
        return [(R * value / 4, None), (R * visible / (4 * abs(c_o)), None)]
    per = abs(c_i) / (c_i + c_o * eta_o / eta_i) ** 2
    spread = (eta_o / eta_i) ** 2
    return [((1 - R) * value * abs(c_o) * per * spread, None), ((1 - R) * visible * per, None)]


def _surface(v):
    return jnp.stack(v[:3]), jnp.stack(v[3:6]), TrowbridgeReitz(v[6], v[7])


def _our_dielectric(*v):
    o, i, facets = _surface(v)
    model = bsdf.Dielectric(v[8], facets)
    return model.evaluate(o, i), model.density(o, i)


def _roughness(random, size):
    return decades(random, size, -3, 0), decades(random, size, -3, 0)


def _eta(random, size):
    return decades(random, size, -0.6, 0.6)


def _ray(z, azimuth, *others):
    s = np.sqrt((1 - z) * (1 + z))
    return s * np.cos(azimuth), s * np.sin(azimuth), z, *others


FACETS = {
    "half_vector": Function(
        lambda r, s, e: (*two_directions(r, s, e), _eta(r, s)), (*TWO_DIRECTIONS, _ETA),
        lambda *v: tuple(half_vector(jnp.stack(v[:3]), jnp.stack(v[3:6]), v[6])), _normal,
        8.0, 24.0, directions, conditioned=True,
    ),
    "half_vector_jacobian": Function(
        lambda r, s, e: (*two_directions(r, s, e), _eta(r, s)), (*TWO_DIRECTIONS, _ETA),
        lambda *v: (half_vector_jacobian(jnp.stack(v[:3]), jnp.stack(v[3:6]), v[6]),), _jacobian,
        24.0, 50.0, directions, (0, 1, 2, 3, 4, 5), conditioned=True,
    ),
    "TrowbridgeReitz.D_visible": Function(
        lambda r, s, e: (*two_directions(r, s, e), *_roughness(r, s)),
        (*TWO_DIRECTIONS, *_ALPHAS),
        lambda *v: (_surface(v)[2].D_visible(*_surface(v)[:2]),), _visible, 12.0, 50.0,
        directions, conditioned=True,
    ),
    "TrowbridgeReitz.sample_visible": Function(
        lambda r, s, e: (
            *two_directions(r, s, e)[:2], *_roughness(r, s), r.random(s), 1 - r.random(s)
        ),
        ((1e-6, 1.0), (0.0, 6.3), *_ALPHAS, (1e-6, 1.0), (1e-6, 1 - 1e-6)),
        lambda *v: tuple(TrowbridgeReitz(v[3], v[4]).sample_visible(
            jnp.stack(v[:3]), jnp.stack(v[5:7]))),
        _sampled, 12.0, 100.0, _ray, conditioned=True,
    ),
    "Dielectric.evaluate, density": Function(
        lambda r, s, e: (*two_directions(r, s, e), *_roughness(r, s), _eta(r, s)),
        (*TWO_DIRECTIONS, *_ALPHAS, _ETA), _our_dielectric, _dielectric, 24.0, 100.0,
        # By roughness and index: |H| is taken from Snell's law, for unit vectors alone.
        directions, (0, 1, 2, 3, 4, 5), conditioned=True,
    ),
}  # fmt: skip
