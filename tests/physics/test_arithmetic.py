"""The error-free transformations against rational arithmetic, after XLA has compiled them."""

from fractions import Fraction

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fresnel_jax._numerics import arithmetic


def operands(dtype, decades):
    random = np.random.default_rng(1)
    x, y = (random.uniform(1, 2, 2000) * 10.0 ** random.uniform(*decades, 2000) for _ in range(2))
    return x.astype(dtype), (y * random.choice([-1, 1], 2000)).astype(dtype)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize(
    "transformation, exact",
    [
        (arithmetic.two_sum, lambda x, y: x + y),
        (lambda x, y: arithmetic.fast_two_sum(2 * jnp.maximum(x, -x), 0.5 * y), None),
        (arithmetic.two_product, lambda x, y: x * y),
        (lambda x, y: arithmetic.two_square(y), lambda x, y: y * y),
    ],
    ids=["two_sum", "fast_two_sum", "two_product", "two_square"],
)
def test_error_free(transformation, exact, dtype):
    x, y = operands(dtype, (-3, 3) if exact else (0, 0))
    high, low = (np.asarray(z) for z in jax.jit(transformation)(x, y))
    if exact is None:

        def exact(x, y):
            return 2 * abs(x) + y / 2

    for xi, yi, high_i, low_i in zip(x, y, high, low, strict=True):
        true = exact(Fraction(float(xi)), Fraction(float(yi)))
        assert Fraction(float(high_i)) + Fraction(float(low_i)) == true
        assert high_i == dtype(float(true)) or dtype == np.float32


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_sum_exactly_keeps_what_cancels(dtype):
    x, y = operands(dtype, (-6, 6))
    total, error = jax.jit(lambda x, y: arithmetic.sum_exactly([x, y, -x, 0.1 * y, -y]))(x, y)
    tenth = np.asarray(0.1 * jnp.asarray(y))
    sums = zip(total, error, tenth, strict=True)
    for total_i, error_i, true in sums:
        result = Fraction(float(total_i)) + Fraction(float(error_i))
        assert abs(result / Fraction(float(true)) - 1) < 1e-6  # Sum2: eps^2 of the largest term


@pytest.mark.parametrize("dtype, smallest", [(np.float64, -100), (np.float32, -30)])
def test_complex_sqrt(dtype, smallest):
    random = np.random.default_rng(2)
    re = (random.choice([-1, 1], 4000) * 10.0 ** random.uniform(smallest, 16, 4000)).astype(dtype)
    im = (10.0 ** random.uniform(smallest, 16, 4000)).astype(dtype)
    a, b = jax.jit(arithmetic.complex_sqrt)(re, im)
    true = np.sqrt(re.astype(np.clongdouble) + 1j * im.astype(np.longdouble))
    for part, true_part in ((a, true.real), (b, true.imag)):
        relevant = true_part > np.finfo(dtype).tiny / np.finfo(dtype).eps
        error = np.abs(np.asarray(part, np.longdouble) / true_part - 1)[relevant]
        assert np.max(error) < 4 * np.finfo(dtype).eps


def test_roots_at_zero_have_the_stated_derivative():
    zero = jnp.zeros(())
    for root, arguments in (
        (arithmetic.real_sqrt, (zero,)),
        (arithmetic.complex_sqrt, (zero, zero)),
    ):
        _, derivative = jax.jvp(root, arguments, tuple(jnp.ones_like(x) for x in arguments))
        assert derivative == (0.0, 0.0)
