"""Entries of the accuracy search: reflected and refracted directions."""

import gmpy2
import jax.numpy as jnp
import numpy as np

from fresnel_jax import reflect, refract

from .search_functions import Function, decades


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


DIRECTIONS = {
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
