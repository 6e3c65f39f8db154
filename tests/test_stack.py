"""Stacks: limits that other functions of the library know, laws, calls."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fresnel_jax import amplitudes, powers
from fresnel_jax.layers import stack

DTYPES = [np.float32, np.float64]
COSINES = np.linspace(0.05, 1.0, 20)


def _eps(dtype):
    return float(np.finfo(dtype).eps)


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("layers", [0, 1, 3])
def test_layers_of_no_thickness_are_one_boundary(dtype, layers):
    c = COSINES.astype(dtype)
    inner = np.array([2.1 + 0.3j, 1.3, 0.2 + 3j])[:layers]
    index = np.array([1.2, *inner, 0.4 + 2.5j]).astype(np.result_type(dtype, np.complex64))
    got = stack(c, index, np.zeros(layers, dtype), dtype(0.5))
    n, k, m = (dtype(x) for x in (index[-1].real, index[-1].imag, index[0].real))
    for values, wanted in ((got[:4], powers(c, n, k, m)), (got[4:8], amplitudes(c, n, k, m))):
        for value, exact in zip(values, wanted, strict=True):
            assert value.dtype == exact.dtype
            assert np.all(np.abs(value - exact) <= 40 * _eps(dtype) * np.abs(exact))


def test_a_quarter_wave_film_of_the_geometric_mean_reflects_nothing():
    n = np.sqrt(1.5)
    got = stack(1.0, [1.0, n, 1.5], [0.6 / (4 * n)], 0.6)
    assert got.R < 1e-31 and abs(got.T - 1.0) < 1e-15


def test_compiled_mapped_and_looped_calls_agree():
    index = jnp.array([1.0, 1.46 + 0.01j, 2.3, 3.9 + 0.02j])
    thickness = jnp.array([0.1, 1.7])
    wavelength = jnp.linspace(0.4, 0.7, 7)

    def one(c, w):
        return stack(c, index, thickness, w)

    whole = stack(jnp.asarray(COSINES)[:, None], index[:, None, None], thickness, wavelength[1])
    for i, c in enumerate(COSINES[:3]):
        for a, b in zip(whole, one(c, wavelength[1]), strict=True):
            np.testing.assert_allclose(np.ravel(a)[i], b, rtol=1e-13)
    mapped = jax.jit(jax.vmap(one, (None, 0)))(0.3, wavelength)
    for a, b in zip(
        mapped, stack(0.3, index[:, None], thickness[:, None], wavelength), strict=True
    ):
        np.testing.assert_allclose(a, b, rtol=1e-13)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((1.0, [1.0, 1.5], [0.1], 0.5), "L layers lie between L . 2 media"),
        ((1.0, 1.5, [0.1], 0.5), "leading axis"),
        ((1j, [1.0, 1.4, 1.5], [0.1], 0.5), "cos_theta_i is complex"),
        ((np.ones(3), np.ones((3, 2)), [0.1], 0.5), "do not broadcast"),
        ((1.0, [1.0, np.ones(2), np.ones(3)], [0.1], 0.5), "entries of index"),
    ],
)
def test_wrong_arguments_are_named(arguments, words):
    with pytest.raises(ValueError, match=words):
        stack(*arguments)
