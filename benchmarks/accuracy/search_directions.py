"""Entries of the accuracy search: reflected and refracted directions."""

import gmpy2
import jax.numpy as jnp
import numpy as np

from benchmarks.accuracy.search_functions import Function, decades
from fresnel_jax import reflect, refract
from fresnel_jax.directions import (
    brewster_angle_deg,
    critical_angle_deg,
    local_frame,
    snells_window,
    to_local,
    to_world,
)


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


def _frame(*n):
    """Duff's basis, as printed."""
    x, y, z = n
    sign = -1 if z < 0 else 1
    a = -1 / (sign + z)
    b = x * y * a
    return (1 + sign * x * x * a, sign * b, -sign * x), (b, sign + y * y * a, -y), n


def _in_frame(*v):
    """The components of v in the frame of n, and the vector whose components there are v."""
    frame = _frame(*v[3:6])
    local = [_dot(v[:3], axis) for axis in frame]
    world = [_dot(v[:3], [axis[i] for axis in frame]) for i in range(3)]
    return [(x, _ONE) for axis in frame for x in axis] + [(x, _ONE) for x in (*local, *world)]


def _our_frame(*v):
    v, frame = jnp.stack(v[:3]), local_frame(jnp.stack(v[3:6]))
    return *(x for axis in frame for x in axis), *to_local(v, frame), *to_world(v, frame)


def _angles(eta):
    small = min(eta, 1 / eta)
    degree = 180 / gmpy2.const_pi()
    if eta == 1:
        return None  # the derivatives are infinite
    return [
        (gmpy2.asin(small) * degree, None),
        (gmpy2.atan(eta) * degree, None),
        (1 - gmpy2.sqrt(1 - small * small), None),
    ]


def _indices(random, size, eps):
    beside = 1 + random.choice([-1.0, 1.0], size) * decades(random, size, -16, -1)
    return (np.where(random.random(size) < 0.5, beside, decades(random, size, -2, 2)),)


DIRECTIONS = {
    "critical and Brewster's angle, Snell's window": Function(
        _indices, ((1e-2, 1e2),),
        lambda eta: (critical_angle_deg(eta), brewster_angle_deg(eta), snells_window(eta)),
        _angles, 4.0, 16.0,
    ),
    "local_frame, to_local, to_world": Function(
        two_directions, TWO_DIRECTIONS, _our_frame, _in_frame, 6.0, 16.0, directions,
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
