"""Entries of the accuracy search: named reflectances of a boundary; and the domain."""

import gmpy2
import numpy as np

from benchmarks.accuracy.search_functions import Function, decades
from fresnel_jax import fresnel_complex, fresnel_conductor, fresnel_dielectric
from tests.truth import exact_fresnel


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


_ONE = gmpy2.mpfr(1)


def unpolarized(c, n, k, m):
    R = exact_fresnel.unpolarized(c, n, k, m)
    return None if R is None else [(R, None)]


def _dielectric(c, n):
    return (
        unpolarized(c, n, gmpy2.mpfr(0), gmpy2.mpfr(1))
        if c > 0
        else unpolarized(-c, gmpy2.mpfr(1), gmpy2.mpfr(0), n)
    )


def either_side(random, size, eps):
    c, n, _, _ = boundary(random, size, eps)
    critical = np.sqrt(np.abs((1 - 1 / n) * (1 + 1 / n)))
    c = np.where(random.random(size) < 0.3, critical * (1 + decades(random, size, -16, -1)), c)
    return c * random.choice([-1.0, 1.0], size), n


_DIELECTRIC = Function(
    either_side, ((-1.0, 1.0), INDEX), lambda c, n: (fresnel_dielectric(c, n),), _dielectric, 8.0
)

BOUNDARY_FUNCTIONS = {
    "fresnel_dielectric": _DIELECTRIC,
    # Beside the critical angle from inside, 200 eps of the norm were found, where a relative change
    # of one eps in each does 4e7 to the gradient; `reflectance` has 50 + 100 (eta_i / n)^2.
    "gradient of fresnel_dielectric": _DIELECTRIC._replace(
        bound=None, gradient_bound=100.0, conditioned=True
    ),
    "fresnel_conductor": Function(
        lambda *a: boundary(*a)[:3], BOUNDARY[:3], lambda c, n, k: (fresnel_conductor(c, n, k),),
        lambda c, n, k: unpolarized(c, n, k, _ONE), 8.0, 100.0,
    ),
    "fresnel_complex": Function(
        lambda *a: boundary(*a)[:3], BOUNDARY[:3],
        lambda c, n, k: (fresnel_complex(c, n + 1j * k),),
        lambda c, n, k: unpolarized(c, n, k, _ONE), 8.0, 100.0,
    ),
}  # fmt: skip
