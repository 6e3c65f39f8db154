"""Entries of the accuracy search: boundaries, slabs, stacks, polarization and directions."""

import gmpy2
import jax.numpy as jnp
import numpy as np

from fresnel_jax import (
    fresnel_complex,
    fresnel_conductor,
    fresnel_dielectric,
    layers,
    polarization,
    reflect,
    refract,
)

from .exact_fresnel import Exact
from .search_functions import Function


def decades(random, size, low, high):
    return 10.0 ** random.uniform(low, high, size)


def boundary(random, size, eps):
    """cos, eta, k, eta_i with a third beside the critical angle, index match or grazing."""
    m = np.where(random.random(size) < 0.5, 1.0, random.uniform(1.0, 4.0, size))
    n = np.choose(
        random.integers(0, 3, size),
        [
            random.uniform(0.05, 6.0, size),
            decades(random, size, -2, 2),
            m * (1 + decades(random, size, -16, -1)),
        ],
    )
    k = np.where(random.random(size) < 0.5, decades(random, size, -12, 2), n)
    critical = np.sqrt(np.abs(1 - (n / m) ** 2)) * (1 + eps * random.integers(-16, 17, size))
    c = np.choose(
        random.integers(0, 4, size),
        [
            random.uniform(0, 1, size),
            decades(random, size, -9, 0),
            critical,
            1 - decades(random, size, -16, 0),
        ],
    )
    return c, n, k, m


COS, INDEX, LOSS, MEDIUM = (1e-9, 1.0), (1e-2, 1e2), (1e-12, 1e2), (0.25, 4.0)
BOUNDARY = (COS, INDEX, LOSS, MEDIUM)


def _exact(c, n, k, m):
    exact = Exact.__new__(Exact)
    s2 = 1 - c * c
    exact.c, exact.m, exact.N = c, m, gmpy2.mpc(n, k)
    exact.Q = gmpy2.sqrt(gmpy2.mpc(exact.N * exact.N - m * m * s2))
    if exact.Q.imag < 0:
        exact.Q = -exact.Q
    N, Q = exact.N, exact.Q
    s, p = m * c + Q, N * N * c + m * Q
    if Q == 0 or s == 0 or p == 0:
        return None
    exact.r_s, exact.r_p = (m * c - Q) / s, (N * N * c - m * Q) / p
    exact.t_s, exact.t_p = 2 * m * c / s, 2 * m * c * N / p
    return exact


def _reflectance(c, n, k, m):
    exact = _exact(c, n, k, m)
    if exact is None or (k == 0 and gmpy2.is_zero(exact.Q)):
        return None
    R = (gmpy2.norm(exact.r_s) + gmpy2.norm(exact.r_p)) / 2
    return [(R, None)]


def _dielectric(c, n):
    return (
        _reflectance(c, n, gmpy2.mpfr(0), gmpy2.mpfr(1))
        if c > 0
        else _reflectance(-c, gmpy2.mpfr(1), gmpy2.mpfr(0), n)
    )


def _either_side(random, size, eps):
    c, n, _, _ = boundary(random, size, eps)
    critical = np.sqrt(np.abs((1 - 1 / n) * (1 + 1 / n)))
    c = np.where(random.random(size) < 0.3, critical * (1 + decades(random, size, -16, -1)), c)
    return c * random.choice([-1.0, 1.0], size), n


def _slab(c, n, k, m, d, w):
    exact = _exact(c, n, k, m)
    if exact is None:
        return None
    A = gmpy2.exp(-4 * gmpy2.const_pi() * d / w * exact.Q.imag)
    values = []
    for R in (gmpy2.norm(exact.r_s), gmpy2.norm(exact.r_p)):
        T = (1 - R) ** 2 * A / (1 - (R * A) ** 2)
        reflected = R + R * A * T
        values.append([(reflected, None), (T, T * (1 - gmpy2.log(A) / 6) if A else T)])
    return [values[0][0], values[1][0], values[0][1], values[1][1]]


def _stack(c, n0, n1, k1, n2, k2, n3, k3, d1, d2, w):
    """Abeles' characteristic matrices, as textbooks print them."""
    N = [gmpy2.mpc(n0), gmpy2.mpc(n1, k1), gmpy2.mpc(n2, k2), gmpy2.mpc(n3, k3)]
    with gmpy2.context(gmpy2.get_context(), precision=2500):
        Q = []
        for z in N:
            q = gmpy2.sqrt(z * z - n0 * n0 * (1 - c * c))
            Q.append(-q if q.imag < 0 or (q.imag == 0 and q.real < 0) else q)
        Q[0] = gmpy2.mpc(n0 * c)
        found = []
        for Y in (Q, [q / (z * z) for q, z in zip(Q, N, strict=True)]):
            U, V = gmpy2.mpc(1), Y[3]
            for y, q, d in ((Y[2], Q[2], d2), (Y[1], Q[1], d1)):
                delta = 2 * gmpy2.const_pi() * q * d / w
                U, V = (
                    gmpy2.cos(delta) * U - gmpy2.mpc(0, 1) * gmpy2.sin(delta) / y * V,
                    gmpy2.cos(delta) * V - gmpy2.mpc(0, 1) * y * gmpy2.sin(delta) * U,
                )
            r, t = (Y[0] * U - V) / (Y[0] * U + V), 2 * Y[0] / (Y[0] * U + V)
            found.append((gmpy2.norm(r), gmpy2.norm(t) * Y[3].real / Y[0].real, r))
        (R_s, T_s, r_s), (R_p, T_p, r_p) = found
        # an R below .01 counts as a tenth of its root, as docs/stacks.md states
        return [
            *((R, max(R, gmpy2.sqrt(R) / 10)) for R in (R_s, R_p)),
            (T_s, None),
            (T_p, None),
            (r_s, gmpy2.mpfr(1)),
            (r_p, gmpy2.mpfr(1)),
        ]


def _our_stack(c, n0, n1, k1, n2, k2, n3, k3, d1, d2, w):
    index = [n0 + 0j, n1 + 1j * k1, n2 + 1j * k2, n3 + 1j * k3]
    out = layers.stack(c, jnp.stack(index), jnp.stack([d1, d2]), w)
    return out.R_s, out.R_p, out.T_s, out.T_p, out.r_s, out.r_p


def _layers(random, size, eps):
    media = [
        np.choose(
            random.integers(0, 2, size),
            [random.uniform(1, 4, size), decades(random, size, -1, 0.7)],
        )
        for _ in range(3)
    ]
    losses = [decades(random, size, -9, 0.7) for _ in range(3)]
    c = np.choose(
        random.integers(0, 3, size),
        [random.uniform(0, 1, size), decades(random, size, -6, 0), np.ones(size)],
    )
    return (
        c,
        random.uniform(1, 2, size),
        media[0],
        losses[0],
        media[1],
        losses[1],
        media[2],
        losses[2],
        decades(random, size, -4, 0.3),
        decades(random, size, -4, 0.3),
        random.uniform(0.3, 2, size),
    )


_FILM_INDEX, _FILM_LOSS, _FILM = (0.1, 5.0), (1e-9, 5.0), (1e-4, 2.0)


def _mueller(c, n, k, m):
    exact = _exact(c, n, k, m)
    if exact is None:
        return None
    R_s, R_p = gmpy2.norm(exact.r_s), gmpy2.norm(exact.r_p)
    w = exact.r_s * exact.r_p.conjugate()
    R, zero = (R_s + R_p) / 2, gmpy2.mpfr(0)
    D = (R_s - R_p) / 2
    rows = (
        R,
        D,
        zero,
        zero,
        D,
        R,
        zero,
        zero,
        zero,
        zero,
        w.real,
        -w.imag,
        zero,
        zero,
        w.imag,
        w.real,
    )
    return [(x, R) for x in rows]


def _root_scale(elements):
    """Near index match the elements r_s conj(r_p) have derivatives that cancel: eps of sqrt(R)."""
    return elements and [(x, gmpy2.sqrt(R)) for x, R in elements]


def _depth(w, c, n, k, m):
    exact = _exact(c, n, k, m)
    return None if exact is None else [(w / (4 * gmpy2.const_pi() * exact.Q.imag), None)]


def _psi_delta(c, n, k, m):
    exact = _exact(c, n, k, m)
    if exact is None or exact.r_s == 0 or exact.r_p == 0:
        return None
    rho = exact.r_p / exact.r_s
    delta = gmpy2.const_pi() - gmpy2.phase(-rho)  # smooth at normal incidence
    return [(gmpy2.atan(abs(rho)), None), (delta, None)]


def directions(*columns):
    """Columns (polar angle's cosine, azimuth) twice -> six components, the second one first's."""
    out = []
    for z, azimuth in (columns[:2], columns[2:4]):
        s = np.sqrt((1 - z) * (1 + z))
        out += [s * np.cos(azimuth), s * np.sin(azimuth), z]
    return [*out, *columns[4:]]


def two_directions(random, size, eps):
    z = [
        np.choose(
            random.integers(0, 3, size),
            [
                random.uniform(-1, 1, size),
                decades(random, size, -6, 0),
                1 - decades(random, size, -14, 0),
            ],
        )
        for _ in range(2)
    ]
    turn = [random.uniform(0, 2 * np.pi, size) for _ in range(2)]
    return z[0], turn[0], z[1], turn[1]


TWO_DIRECTIONS = ((-1.0, 1.0), (0.0, 6.3), (-1.0, 1.0), (0.0, 6.3))
_ONE = gmpy2.mpfr(1)


def _dot(a, b):
    return sum(x * y for x, y in zip(a, b, strict=True))


def _reflect(*v):
    w, n = v[:3], v[3:6]
    cosine = _dot(w, n)
    return [(2 * cosine * b - a, _ONE) for a, b in zip(w, n, strict=True)]


def _refract(*v):
    """Snell's law in unit vectors; where the ray is within 1e-3 of the critical angle, or the
    rounded vectors' side is open, the error is that of the cosine and the point is left out."""
    w, n, eta = v[:3], v[3:6], v[6]
    w, n = ([x / gmpy2.sqrt(_dot(u, u)) for x in u] for u in (w, n))
    cosine = _dot(w, n)
    ratio = 1 / eta if cosine >= 0 else eta
    cos2 = 1 - ratio * ratio * (1 - cosine * cosine)
    if cos2 < 0 or abs(cosine) < 1e-15:
        return None
    cos_t = gmpy2.sqrt(cos2)
    sign = 1 if cosine >= 0 else -1
    # what a rounding of the cosine does to the refracted ray
    scale = 1 + ratio + ratio * ratio * abs(cosine) / cos_t if cos_t else None
    if scale is None:
        return None
    return [(ratio * (cosine * b - a) - sign * cos_t * b, scale) for a, b in zip(w, n, strict=True)]


OPTICS = {
    "fresnel_dielectric": Function(
        _either_side, ((-1.0, 1.0), INDEX), lambda c, n: (fresnel_dielectric(c, n),),
        _dielectric, 8.0, 100.0,
    ),
    "fresnel_conductor": Function(
        lambda *a: boundary(*a)[:3], BOUNDARY[:3], lambda c, n, k: (fresnel_conductor(c, n, k),),
        lambda c, n, k: _reflectance(c, n, k, _ONE), 8.0, 100.0,
    ),
    "fresnel_complex": Function(
        lambda *a: boundary(*a)[:3], BOUNDARY[:3],
        lambda c, n, k: (fresnel_complex(c, n + 1j * k),),
        lambda c, n, k: _reflectance(c, n, k, _ONE), 8.0, 100.0,
    ),
    "slab": Function(
        lambda r, s, e: (*boundary(r, s, e), decades(r, s, -4, 3), decades(r, s, -1, 1)),
        (*BOUNDARY, (1e-4, 1e3), (0.1, 10.0)),
        lambda c, n, k, m, d, w: tuple(layers.slab(c, n, k, d, w, m)), _slab, 24.0, 100.0,
        amplified=True,
    ),
    "stack of two layers": Function(
        _layers, ((1e-6, 1.0), (1.0, 2.0), _FILM_INDEX, _FILM_LOSS, _FILM_INDEX, _FILM_LOSS,
                  _FILM_INDEX, _FILM_LOSS, _FILM, _FILM, (0.3, 2.0)),
        _our_stack, _stack, 64.0, 64.0, conditioned=True,
    ),
    "mueller_reflection": Function(
        boundary, BOUNDARY, lambda *a: tuple(polarization.mueller_reflection(*a).ravel()),
        _mueller, 24.0,
    ),
    "gradient of mueller_reflection": Function(
        boundary, BOUNDARY, lambda *a: tuple(polarization.mueller_reflection(*a).ravel()),
        lambda *a: _root_scale(_mueller(*a)), 24.0, 100.0, shared=True,
    ),
    "penetration_depth": Function(
        lambda r, s, e: (decades(r, s, -1, 1), *boundary(r, s, e)), ((0.1, 10.0), *BOUNDARY),
        lambda *a: (polarization.penetration_depth(*a),), _depth, 12.0, 50.0,
    ),
    "psi_delta": Function(
        boundary, BOUNDARY, lambda *a: tuple(polarization.psi_delta(*a)), _psi_delta, 12.0, 50.0,
    ),
    "reflect": Function(
        two_directions, TWO_DIRECTIONS,
        lambda *v: tuple(reflect(jnp.stack(v[:3]), jnp.stack(v[3:]))), _reflect, 6.0, 12.0,
        directions,
    ),
    "refract, tilted normals": Function(
        lambda r, s, e: (*two_directions(r, s, e), decades(r, s, -1, 1)),
        (*TWO_DIRECTIONS, (0.1, 10.0)),
        lambda *v: tuple(refract(jnp.stack(v[:3]), jnp.stack(v[3:6]), v[6]).direction),
        _refract, 8.0, 24.0, directions, (0, 1, 2, 3, 4, 5),
    ),
}  # fmt: skip
