"""dR/dcos beside the pseudo-Brewster angle, where it passes through 0: no formula can do better."""

import gmpy2
import jax
import numpy as np
import pytest

from fresnel_jax import reflectance
from tests.truth.exact_fresnel import CONTEXT, unpolarized

EPS = float(np.finfo(float).eps)
slope = jax.jit(jax.vmap(jax.grad(reflectance)))


def true_slope(point):
    c, *rest = point
    h = c * gmpy2.mpfr(2) ** -200
    above, below = (unpolarized(x, *rest) for x in (c + h, c - h))
    return (above - below) / (2 * h)


@pytest.mark.parametrize("modulus", [5.0, 24.0, 54.0, 540.0, 1e5])
def test_the_error_is_that_of_an_eps_in_the_arguments(modulus):
    """In eps of itself the derivative is off without bound: it is 0 at this angle."""
    random, count = np.random.default_rng(20261122), 120
    phase = np.where(
        random.random(count) < 0.5,
        10.0 ** random.uniform(-8, 0, count),
        random.uniform(0, np.pi / 2, count),
    )
    size = modulus * np.exp(random.uniform(-0.3, 0.3, count))
    n, k, one = size * np.cos(phase), size * np.sin(phase), np.ones(count)
    low, high = np.full(count, 0.01 / modulus), np.full(count, min(10.0 / modulus, 1.0))
    for _ in range(60):
        middle = np.sqrt(low * high)
        falls = np.asarray(slope(middle, n, k, one)) < 0.0
        low, high = np.where(falls, middle, low), np.where(falls, high, middle)
    aside = np.where(random.random(count) < 0.3, 0.0, 10.0 ** random.uniform(-16, -2, count))
    c = np.minimum(np.sqrt(low * high) * (1.0 + aside), 1.0)
    ours = np.asarray(slope(c, n, k, one))
    with gmpy2.context(CONTEXT):
        for i, numbers in enumerate(zip(c, n, k, one, strict=True)):
            point = [gmpy2.mpfr(float(x)) for x in numbers]
            true, effect, step = true_slope(point), 0, gmpy2.mpfr(2) ** -80
            for j, x in enumerate(point):
                moved = [*point[:j], x * (1 + step), *point[j + 1 :]]
                effect += abs(true_slope(moved) - true) / step
            # found in 1,500 points: 1.6 times
            assert abs(float(ours[i]) - true) <= 4.0 * EPS * effect, numbers
