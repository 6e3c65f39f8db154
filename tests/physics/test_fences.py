"""Every fence against the compiler is needed still: the defect that it is for is there without it.

A test that fails here is good news, and says what can go. Seen on 2026-11-29 on a CPU with jaxlib
0.8.0, 0.9.2, 0.10.1, 0.11.0, 0.11.1, 0.11.2, 0.12.0 and 0.12.0.1.
"""

import re
from fractions import Fraction
from pathlib import Path

import jax
import jax.numpy as jnp
import jaxlib.version
import numpy as np
import pytest
from jax import lax

from fresnel_jax._numerics import double_word
from fresnel_jax._numerics.fences import computed_once, fenced, opaque

PYPROJECT = (Path(__file__).resolve().parents[2] / "pyproject.toml").read_text(encoding="utf-8")
POINTS = jax.ShapeDtypeStruct((100_000,), np.float64)


def numbers(version):
    return tuple(map(int, version.split(".")))


JAXLIB = numbers(jaxlib.version.__version__)
OLDEST = numbers(re.search(r'"jax>=([\d.]+)', PYPROJECT)[1])  # that is supported


def compiled(function, *shapes):
    return jax.jit(function).lower(*shapes).compile().as_text()


@pytest.mark.parametrize("fence", [computed_once, fenced])
def test_a_fence_changes_nothing_but_the_program(fence):
    x = np.array([1.0, 1e-300, np.inf, -0.1, np.nan])
    np.testing.assert_array_equal(fence(x), x)
    assert fence(np.float32(0.1)).dtype == np.float32
    assert jax.grad(lambda y: jnp.sum(fence(y) ** 2))(3.0) == 6.0


def test_what_several_loops_read_is_computed_in_each():
    """Without `computed_once` each of three results forms its own cosine.

    If the first number is 1, delete `computed_once` and all its calls. The barrier does the same
    from 0.11.1 on; if the last line fails, let `computed_once` be the barrier, without a division.
    """

    def cosines(fence):
        def results(x):
            cosine = fence(jnp.cos(x))
            return cosine + 1.0, cosine * x, cosine - x

        return compiled(results, POINTS).count(" cosine(")

    assert cosines(lambda x: x) == 3
    assert cosines(computed_once) == 1
    assert cosines(lax.optimization_barrier) == (1 if JAXLIB >= (0, 11, 1) else 3)
    assert OLDEST < (0, 11, 1)


def test_constants_are_merged_although_they_round():
    """Without `opaque` (x + 1) - 1 is x for a constant 1: the rounding of x + 1 is gone.

    From 0.12 on it is not, and `opaque` does nothing. If the last line fails, delete it.
    """

    def rounded_to_one(fence):
        def result(x):
            one = fence(jnp.ones_like(x))
            return (x + one) - fence(jnp.ones_like(x))

        return jax.jit(result)(jnp.full(4, 1e-17))[0]

    assert rounded_to_one(lambda x: x) == (1e-17 if JAXLIB < (0, 12) else 0.0)
    assert rounded_to_one(opaque) == 0.0
    assert OLDEST < (0, 12)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_product_is_not_rounded_where_it_is_added(dtype, monkeypatch):
    """Without `rounded` the square of a double word is off by half an eps, not by eps^2.

    On processors with a fused multiply-add. If the first number is small, delete `rounded`.
    """
    x, y = np.random.default_rng(0).uniform(0.5, 2.0, (2, 100)).astype(dtype)

    def error():
        """The largest relative one, in eps."""
        high, low = jax.jit(lambda x, y: double_word.product_squared(x, y))(x, y)
        points = zip(*(map(Fraction, map(float, z)) for z in (high, low, x, y)), strict=True)
        largest = max(abs((a + b) / (p * q) ** 2 - 1) for a, b, p, q in points)
        return float(largest / Fraction(float(np.finfo(dtype).eps)))

    fenced_error = error()
    monkeypatch.setattr(double_word, "rounded", lambda x: x)
    assert error() > 0.1
    assert fenced_error < 4.0 * np.finfo(dtype).eps


def test_what_a_sum_adds_is_handed_to_another_library():
    """Without `fenced` YNNPACK takes the arithmetic in front of a reduction, and not only that.

    Since 0.10.2. If the first line fails with a newer one, delete `fenced` and all its calls; what
    it is worth is measured by `python -m benchmarks.speed.losses`.
    """

    def handed_over(fence):
        text = compiled(lambda x, w: jnp.sum(fence(w * jnp.cos(x) ** 2)), POINTS, POINTS)
        parts = re.findall(r"kind=kCustom, calls=%?([\w.-]+),.*__ynn_fusion", text)
        bodies = [
            re.search(rf"^%?{re.escape(part)} .*?^}}", text, re.M | re.S)[0] for part in parts
        ]
        return sum(body.count(" multiply(") for body in bodies)

    assert (handed_over(lambda x: x) > 0) == (JAXLIB >= (0, 10, 2))
    assert handed_over(fenced) == 0
