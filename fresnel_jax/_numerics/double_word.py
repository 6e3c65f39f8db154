"""Numbers of twice the working digits, as unevaluated sums of two floats: (high, low).

A phase of 1e6 turns, rounded, is wrong by 1e6 eps of a turn. These keep what rounding loses, with
relative errors of a few eps^2 (M. Joldes, J.-M. Muller and V. Popescu 2017, Tight and rigorous
error bounds for basic building blocks of double-word arithmetic, doi:10.1145/3121432). Their
derivatives are those of the rounded values; `low` is a constant for all of them.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array

from . import arithmetic
from .arithmetic import fast_two_sum, one_if_zero, two_sum
from .fences import opaque, rounded

DoubleWord = tuple[Array, Array]


def two_product(x: Array, y: Array) -> DoubleWord:
    """The rounded product of two floats and its exact error."""
    value, error = arithmetic.two_product(x, y)
    return rounded(value), error


def two_square(x: Array) -> DoubleWord:
    """The rounded square of a float and its exact error."""
    value, error = arithmetic.two_square(x)
    return rounded(value), error


def add(x: DoubleWord, y: DoubleWord) -> DoubleWord:
    total, error = two_sum(x[0], y[0])
    return fast_two_sum(total, error + (x[1] + y[1]))


def multiply(x: DoubleWord, y: DoubleWord) -> DoubleWord:
    product, error = two_product(x[0], y[0])
    return fast_two_sum(product, error + (x[0] * y[1] + x[1] * y[0]))


def square(x: DoubleWord) -> DoubleWord:
    value, error = two_square(x[0])
    return fast_two_sum(value, error + 2.0 * (x[0] * x[1]))


def negative(x: DoubleWord) -> DoubleWord:
    return -x[0], -x[1]


def _derivative_of(rounded: Callable[..., Array]):
    """The decorator of a function whose derivative is that of its rounded value."""

    def decorate(function):
        function = jax.custom_jvp(function)

        @function.defjvp
        def jvp(primals, tangents):
            high, low = function(*primals)
            _, d_high = jax.jvp(rounded, primals, tangents)
            return (high, low), (jnp.broadcast_to(d_high, high.shape), jnp.zeros_like(low))

        return function

    return decorate


@_derivative_of(lambda x, y: x[0] + y[0])
def total(x: DoubleWord, y: DoubleWord) -> DoubleWord:
    """x + y."""
    return add(x, y)


@_derivative_of(lambda m, c: (m * c) * (m * c))
def product_squared(m: Array, c: Array) -> DoubleWord:
    """(m c)^2 of two floats."""
    return square(two_product(opaque(m), opaque(c)))


@_derivative_of(lambda x, y: x * x - y * y)
def difference_of_squares(x: Array, y: Array) -> DoubleWord:
    """x^2 - y^2 of two floats, to twice their digits also where they nearly agree."""
    x, y = opaque(x), opaque(y)
    return multiply(two_sum(x, -y), two_sum(x, y))


@_derivative_of(lambda x, y: 2.0 * (x * y))
def twice_product(x: Array, y: Array) -> DoubleWord:
    """2 x y of two floats."""
    return two_product(2.0 * opaque(x), opaque(y))


@_derivative_of(lambda x, y: x / y)
def ratio(x: Array, y: Array) -> DoubleWord:
    """x / y of two floats."""
    x, y = opaque(x), opaque(y)
    quotient = x / y
    product, error = two_product(quotient, y)
    return fast_two_sum(quotient, ((x - product) - error) / y)


def root_of_real(q2: DoubleWord) -> tuple[DoubleWord, DoubleWord]:
    """Real and imaginary part >= 0 of the root of a real number, one of them 0."""
    magnitude = jnp.abs(q2[0])
    root = jnp.sqrt(magnitude)
    root2, error = two_square(root)
    low = jnp.where(q2[0] < 0.0, -q2[1], q2[1])
    rest = 0.5 * (((magnitude - root2) - error) + low) / one_if_zero(root)
    zero = jnp.zeros_like(root)
    right = q2[0] >= 0.0
    return (
        (jnp.where(right, root, zero), jnp.where(right, rest, zero)),
        (jnp.where(right, zero, root), jnp.where(right, zero, rest)),
    )


def root_correction(re: DoubleWord, im: DoubleWord, a: Array, b: Array, per_q2: Array):
    """What a + ib lacks to the root of re + i im; per_q2 is 1 / (a^2 + b^2)."""
    a2, a2_low = two_square(a)
    b2, b2_low = two_square(b)
    first, lost_first = two_sum(re[0], -a2)
    second, lost_second = two_sum(first, b2)
    rest_re = second + ((lost_first + lost_second) + ((re[1] - a2_low) + b2_low))
    twice_ab, twice_ab_low = two_product(2.0 * a, b)
    rest_im = (im[0] - twice_ab) + (im[1] - twice_ab_low)
    half = 0.5 * per_q2
    return half * (rest_re * a + rest_im * b), half * (rest_im * a - rest_re * b)
