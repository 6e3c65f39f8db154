"""A million points: blocks give what the plain call gives, and keep no more than a block."""

import subprocess
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fresnel_jax import powers, reflectance
from fresnel_jax.performance import in_blocks, keep_memory

COSINES = jnp.linspace(0.01, 1.0, 1000)


def squares(eta, cosines, data):
    return (reflectance(cosines, eta, 0.4) - data) ** 2


@pytest.mark.parametrize("number", [1000, 997, 7])  # equal blocks, a prime, less than a block
def test_values_are_those_of_the_plain_call(number):
    cosines = COSINES[:number]
    plain = powers(cosines, 1.5, 0.1)
    found = jax.jit(lambda c: in_blocks(lambda x: powers(x, 1.5, 0.1), c, points=64))(cosines)
    assert type(found) is type(plain)
    for of_blocks, of_all in zip(found, plain, strict=True):
        np.testing.assert_allclose(of_blocks, of_all, rtol=1e-14)


@pytest.mark.study
@pytest.mark.parametrize("number", [1000, 997])
@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_sums_and_their_derivatives_are_those_of_the_plain_call(number, dtype):
    cosines = COSINES[:number].astype(dtype)
    data, eta = 0.9 * cosines, jnp.asarray(1.7, dtype)

    def each(eta, cosines, data):  # quickly compiled, and not linear in anything
        return (jnp.cos(eta * cosines) - data) ** 2

    def plain(eta, data):
        return each(eta, cosines, data).sum()

    def blocks(eta, data):
        return in_blocks(lambda c, d: each(eta, c, d), cosines, data, points=64, total=True)

    rtol = 300 * np.finfo(dtype).eps
    for of in (
        lambda loss: loss,
        lambda loss: jax.grad(loss),
        lambda loss: jax.grad(loss, argnums=1),
        lambda loss: lambda *x: jax.jvp(loss, x, x)[1],
        lambda loss: lambda x, data: jax.vmap(lambda y: loss(y, data))(jnp.stack([x, 2.0 * x])),
        lambda loss: jax.grad(jax.grad(loss)),
    ):
        found, wanted = (jax.jit(of(jax.jit(loss)))(eta, data) for loss in (blocks, plain))
        assert found.dtype == dtype
        largest = float(jnp.abs(wanted).max())
        np.testing.assert_allclose(found, wanted, rtol=rtol, atol=rtol * largest)


def test_a_gradient_keeps_no_more_than_a_block():
    number = 2**20
    array = jax.ShapeDtypeStruct((number,), np.float64)

    def memory(loss):
        program = jax.jit(jax.grad(loss)).lower(1.7, array, array).compile()
        return program.memory_analysis().temp_size_in_bytes / (8 * number)  # in arrays

    def of_blocks(eta, *arrays):
        return in_blocks(lambda *x: squares(eta, *x), *arrays, points=2**14, total=True)

    assert memory(lambda *x: squares(*x).sum()) > 1.0
    assert memory(of_blocks) < 0.2


def test_what_is_no_row_of_points_is_refused():
    with pytest.raises(ValueError, match=r"of one N were wanted, came: \(2,\), \(3,\)"):
        in_blocks(jnp.add, jnp.ones(2), jnp.ones(3))
    with pytest.raises(ValueError, match="came: none"):
        in_blocks(jnp.add)
    with pytest.raises(ValueError, match=r"came: \(\)"):
        in_blocks(jnp.sqrt, 1.0)
    with pytest.raises(ValueError, match="points: 0 came"):
        in_blocks(jnp.sqrt, jnp.ones(2), points=0)


def test_memory_is_kept_when_asked_for_in_time():
    """In a process of its own: most calls of a large program meet no fresh memory."""
    if not sys.platform.startswith("linux"):
        assert not keep_memory()
        return
    program = """
import resource, statistics
import jax, jax.numpy as jnp
from fresnel_jax import powers
from fresnel_jax.performance import keep_memory
kept = keep_memory() if {asked} else None
x = jnp.linspace(0.01, 1.0, 3_000_000)
f = jax.jit(powers)
faults = []
for _ in range(21):
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    jax.block_until_ready(f(x, 1.5, 0.1))
    faults.append(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
print(kept, round(statistics.median(faults)), keep_memory())
"""
    faults = {}
    for asked in (True, False):
        done = subprocess.run(
            [sys.executable, "-c", program.format(asked=asked)],
            capture_output=True, text=True, check=True,
        )  # fmt: skip
        kept, count, late = done.stdout.split()
        faults[asked] = int(count)
        assert kept == ("True" if asked else "None")
        assert late == "False"  # jax has begun
    assert faults[False] > 3000  # one array of 12 MB
    assert faults[True] < 0.3 * faults[False]
