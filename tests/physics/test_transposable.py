"""A linear function with a written transpose: every kind of derivative, against JAX's own."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fresnel_jax._numerics.transposable import transposable
from fresnel_jax.layers import stack

RNG = np.random.default_rng(5)
MATRIX, VECTOR, TURN = RNG.normal(size=(4, 3)), RNG.normal(size=3), RNG.normal(size=4)


def plain(given, linear):
    """sin of a matrix, times a vector; and a multiple of a number."""
    matrix, on = given
    x, y = linear
    return {"sum": jnp.where(on, jnp.sin(matrix) @ x, 0.0), "y": 3.0 * y}


def back(given, cotangents):
    matrix, on = given
    return jnp.sin(matrix).T @ jnp.where(on, cotangents["sum"], 0.0), 3.0 * cotangents["y"]


def written(given, linear):
    return transposable(plain, back, given, linear)


def loss(function, matrix, x):
    out = function((matrix, jnp.asarray(True)), (x, x[0]))
    return jnp.sum(jnp.asarray(TURN) * out["sum"]) ** 3 + out["y"] ** 2


@pytest.fixture(params=["values", "gradient", "forward", "hessian", "reverse twice", "lanes"])
def derived(request):
    def of(function):
        f = lambda matrix, x: loss(function, matrix, x)  # noqa: E731
        both = (0, 1)
        return {
            "values": f,
            "gradient": jax.grad(f, both),
            "forward": jax.jacfwd(f, both),
            "hessian": jax.hessian(f, both),
            "reverse twice": jax.jacrev(jax.jacrev(f, both), both),
            "lanes": lambda matrix, x: (
                jax.vmap(jax.grad(f, both), (None, 0))(matrix, jnp.stack([x, 2.0 * x])),
                jax.grad(lambda m: jnp.sum(jax.vmap(f, (2, None), 0)(m, x)))(
                    jnp.stack([matrix, 2.0 * matrix], axis=2)
                ),
            ),
        }[request.param]

    return of


@pytest.mark.study
def test_like_a_function_without_a_written_transpose(derived):
    given = jnp.asarray(MATRIX), jnp.asarray(VECTOR)
    expected = jax.jit(derived(plain))(*given)
    for wrap in (lambda f: f, jax.jit):
        found = wrap(derived(written))(*given)
        for a, b in zip(jax.tree.leaves(found), jax.tree.leaves(expected), strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-14, atol=1e-13)


def test_the_written_transpose_is_used():
    wrong = lambda given, ct: (0.0 * given[0][0], ct["y"])  # noqa: E731
    f = lambda x: loss(lambda *z: transposable(plain, wrong, *z), jnp.asarray(MATRIX), x)  # noqa: E731
    x = jnp.asarray(VECTOR)
    np.testing.assert_allclose(jax.grad(f)(x), [6.0 * VECTOR[0], 0.0, 0.0])


@pytest.mark.study
def test_one_thin_film_among_lanes():
    """A lane of a film of nanometres, for which all lanes take the series, changes none of them."""
    c, w = jnp.linspace(0.1, 1.0, 5)[:, None], jnp.linspace(0.4, 0.8, 3)
    index = jnp.asarray([1.0, 1.7 + 0.1j, 2.1, 1.4 + 0.02j, 3.5 + 0.3j])[:, None, None]

    def gradient(thickness):
        def powers(t):
            found = stack(c, index, thickness_um=t, wavelength_um=w)[:4]
            return sum(jnp.sum(z**2) for z in found)

        return jax.grad(powers)(thickness[:, None, None])[:, 0, 0]

    lanes = jnp.asarray([[0.1, 0.2, 0.3], [0.1, 0.001, 0.3], [0.0, 0.2, 0.3]])
    together = jax.jit(jax.vmap(gradient))(lanes)
    for lane, alone in zip(together, map(jax.jit(gradient), lanes), strict=True):
        np.testing.assert_allclose(lane, alone, rtol=0, atol=1e-13 * np.abs(alone).max())


@pytest.mark.study
def test_a_gradient_keeps_few_arrays_of_all_layers():
    """Its coefficients, 20 more of them, are formed where they are used."""
    layers, c, w = 10, jnp.linspace(0.1, 1.0, 50)[:, None], jnp.linspace(0.4, 0.8, 100)
    n, k = jnp.full((layers + 2, 1, 1), 1.5), jnp.full((layers + 2, 1, 1), 0.01)

    def power(n, k, t):
        return sum(jnp.sum(z) for z in stack(c, n + 1j * k, thickness_um=t, wavelength_um=w)[:4])

    given = n, k, jnp.full((layers, 1, 1), 0.1)
    compiled = jax.jit(jax.grad(power, (0, 1, 2))).lower(*given).compile()
    memory = compiled.memory_analysis()
    assert memory is not None
    assert memory.temp_size_in_bytes < 24.0 * (
        8 * layers * 50 * 100
    )  # 52 when the coefficients were kept
