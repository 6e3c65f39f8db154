"""Exact sums and products, roots and quotients that state their derivative where it is infinite,
and the sine and cosine of a fraction of a turn.

The error-free transformations write a sum or a product of two floating-point numbers as the rounded
result plus its exact rounding error. They hold for every IEEE format with round-to-nearest, also
after XLA has fused the loop (test_arithmetic.py compares them with rational arithmetic under
jit), because XLA does not reassociate floating-point sums; but see `fences.opaque`.
"""

import math

import jax
import jax.numpy as jnp
from jaxtyping import Array


# A complex number in real arithmetic: (re, im), where im None means exactly real.
def two_sum(x: Array, y: Array) -> tuple[Array, Array]:
    """The rounded sum of x and y, and its exact error (Knuth, TAOCP vol. 2, sec. 4.2.2)."""
    total = x + y
    y_seen = total - x
    return total, (x - (total - y_seen)) + (y - y_seen)


def fast_two_sum(x: Array | float, y: Array) -> tuple[Array, Array]:
    """`two_sum` for abs(x) >= abs(y), at half its cost (Dekker 1971)."""
    total = x + y
    return total, y - (total - x)


def _split(x: Array) -> tuple[Array, Array]:
    """x as an exact sum of two numbers of half its digits (Dekker 1971, doi:10.1007/BF01397083)."""
    factor = 2.0 ** ((jnp.finfo(x.dtype).nmant + 2) // 2) + 1.0
    scaled = factor * x
    high = scaled - (scaled - x)
    return high, x - high


def two_product(x: Array, y: Array) -> tuple[Array, Array]:
    """The rounded product of x and y, and its exact error (Dekker 1971)."""
    product = x * y
    x_high, x_low = _split(x)
    y_high, y_low = _split(y)
    error = ((x_high * y_high - product) + x_high * y_low + x_low * y_high) + x_low * y_low
    return product, error


def two_square(x: Array) -> tuple[Array, Array]:
    """The rounded square of x, and its exact error: `two_product(x, x)` with one split."""
    square = x * x
    high, low = _split(x)
    return square, ((high * high - square) + 2.0 * (high * low)) + low * low


def sum_exactly(terms: list[Array]) -> tuple[Array, Array]:
    """The sum of the terms as an unevaluated pair with about twice the working digits.

    Every rounding error of the running sum is kept and added at the end (Ogita, Rump and Oishi
    2005, doi:10.1137/030601818, Sum2).
    """
    total = terms[0]
    error = jnp.zeros_like(total)
    for term in terms[1:]:
        total, lost = two_sum(total, term)
        error = error + lost
    return total, error


def one_if_zero(x: Array) -> Array:
    """x, and 1 where x is 0: a divisor for what is 0 there itself."""
    return jnp.where(x == 0.0, 1.0, x)


def reciprocal_or_zero(x: Array) -> Array:
    """1 / x, and 0 (with derivative 0) where x is 0."""
    zero = x == 0.0
    return jnp.where(zero, 0.0, 1.0 / jnp.where(zero, 1.0, x))


@jax.custom_jvp
def positive_sqrt(x: Array) -> Array:
    """The root of x, and 0 where x is negative; the derivative is 0 there, and at 0."""
    return jnp.sqrt(jnp.where(x < 0.0, 0.0, x))


@positive_sqrt.defjvp
def _positive_sqrt_jvp(primals, tangents):
    root = positive_sqrt(*primals)
    return root, 0.5 * reciprocal_or_zero(root) * tangents[0]


@jax.custom_jvp
def real_sqrt(x: Array) -> tuple[Array, Array]:
    """The root a + ib of a real number: (sqrt(x), 0), or (0, sqrt(-x)) for x < 0.

    At x = 0 the derivative is infinite; 0 is returned.
    """
    root = jnp.sqrt(jnp.abs(x))
    # Neither comparison holds for NaN, which must not become an exact 0: that is a perfect mirror.
    return jnp.where(x < 0.0, 0.0, root), jnp.where(x > 0.0, 0.0, root)


@real_sqrt.defjvp
def _real_sqrt_jvp(primals, tangents):
    (x,), (dx,) = primals, tangents
    a, b = real_sqrt(x)
    return (a, b), (0.5 * reciprocal_or_zero(a) * dx, -0.5 * reciprocal_or_zero(b) * dx)


def _scales(re: Array, im: Array) -> tuple[Array | float, Array | float]:
    """A factor for re and im that keeps their squares from underflow, and that of the root back."""
    if re.dtype != jnp.float32:
        return 1.0, 1.0
    # Squares of numbers below 1e-19 underflow in float32. A power of two lifts both parts when
    # they are below 2^-40, which covers moduli from 1e-37 to 1e19.
    tiny = jnp.maximum(jnp.abs(re), im) < 2.0**-40
    scale = jnp.where(tiny, 2.0**60, 1.0).astype(re.dtype)
    return scale, jnp.where(tiny, 2.0**-30, 1.0).astype(re.dtype)


def _modulus(re: Array, half_im: Array) -> Array:
    return jnp.sqrt(re * re + 4.0 * (half_im * half_im))


def _larger_part_squared(re: Array, half_im: Array) -> Array:
    return 0.5 * (_modulus(re, half_im) + jnp.abs(re))


@jax.custom_jvp
def modulus(re: Array, im: Array) -> Array:
    """|re + i im|, from the root that `complex_sqrt` takes as well; 0 with derivative 0 at 0."""
    scale, unscale = _scales(re, im)
    return _modulus(re * scale, 0.5 * (im * scale)) * unscale * unscale


@modulus.defjvp
def _modulus_jvp(primals, tangents):
    (re, im), (d_re, d_im) = primals, tangents
    size = modulus(re, im)
    per = reciprocal_or_zero(size)
    return size, (re * per) * d_re + (im * per) * d_im


@jax.custom_jvp
def complex_sqrt(re: Array, im: Array) -> tuple[Array, Array]:
    """The root a + ib of re + i im with a >= 0, for im >= 0 (then b >= 0 too).

    Neither part cancels: the larger one is the root of a sum of positive numbers, the smaller one a
    quotient. At re = im = 0 the derivative is infinite; 0 is returned.
    """
    scale, unscale = _scales(re, im)
    re, half_im = re * scale, 0.5 * (im * scale)
    large = jnp.sqrt(_larger_part_squared(re, half_im))
    small = half_im * reciprocal_or_zero(large) * unscale
    large = large * unscale
    return jnp.where(re >= 0.0, large, small), jnp.where(re >= 0.0, small, large)


@complex_sqrt.defjvp
def _complex_sqrt_jvp(primals, tangents):
    (re, im), (d_re, d_im) = primals, tangents
    a, b = complex_sqrt(re, im)
    # d sqrt(z) = dz / (2 sqrt(z)), with 1 / sqrt(z) = (a - ib) / |z|
    half = 0.5 * reciprocal_or_zero(a * a + b * b)
    a_half, b_half = a * half, b * half
    return (a, b), (a_half * d_re + b_half * d_im, a_half * d_im - b_half * d_re)


@jax.custom_jvp
def shared_sqrt(re: Array, im: Array) -> tuple[Array, Array]:
    """`complex_sqrt` for a root that several results need.

    The larger part is a quotient, which is never computed again for each of them (`fences`),
    with the sign of re, which says all that they need to know of re.
    """
    scale, unscale = _scales(re, im)
    scaled = re * scale
    larger2 = _larger_part_squared(scaled, 0.5 * (im * scale))
    signed = jnp.where(re >= 0.0, larger2, -larger2) * unscale / one_if_zero(jnp.sqrt(larger2))
    large = jnp.abs(signed)
    small = 0.5 * im / one_if_zero(large)
    right = signed >= 0.0
    return jnp.where(right, large, small), jnp.where(right, small, large)


@shared_sqrt.defjvp
def _shared_sqrt_jvp(primals, tangents):
    return jax.jvp(complex_sqrt, primals, tangents)


def _taylor(first: int, terms: int) -> tuple[float, ...]:
    """Of sine (first 1) over its argument or of cosine (first 0), in squares of the argument."""
    return tuple((-1.0) ** i / math.factorial(2 * i + first) for i in range(terms))


def sine_cosine(turns: Array) -> tuple[Array, Array]:
    """Sine and cosine of 2 pi turns, for turns from -1/2 to 1/2, to .8 eps.

    Taylor's series around the nearest quarter of a turn, which is subtracted exactly: a half-wave
    film keeps the digits of its sine. jnp.sin and jnp.cos, whose argument is rounded before, have
    3.5 eps and are not vectorized: they took an eighth of the time of a layer, and two thirds of
    that of a visible normal (22 ms for a million in float32, this 0.6).
    """
    quarters = jnp.round(4.0 * turns)
    angle = (2.0 * jnp.pi) * (turns - 0.25 * quarters)
    terms = 9 if turns.dtype == jnp.float64 else 5
    near_sine, near_cosine = jnp.zeros_like(angle), jnp.zeros_like(angle)
    square = angle * angle
    for s, c in zip(_taylor(1, terms)[::-1], _taylor(0, terms + 1)[:0:-1], strict=True):
        near_sine, near_cosine = near_sine * square + s, near_cosine * square + c
    near_sine, near_cosine = angle * near_sine, 1.0 + square * near_cosine
    odd, behind = jnp.abs(quarters) == 1.0, jnp.abs(quarters) == 2.0
    sine = jnp.where(odd, quarters * near_cosine, near_sine)
    cosine = jnp.where(odd, -quarters * near_sine, near_cosine)
    return jnp.where(behind, -sine, sine), jnp.where(behind, -cosine, cosine)
