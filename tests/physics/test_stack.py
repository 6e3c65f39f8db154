"""Stacks: limits that other functions of the library know, laws, calls."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fresnel_jax import amplitudes, powers
from fresnel_jax.bsdf import FresnelStack
from fresnel_jax.layers import slab, stack
from tests.physics.stacks import stack_of_many

COSINES = np.linspace(0.05, 1.0, 20)


def three_layers(c, index, thickness, wavelength):
    """`stack` of three layers at cosines, by the program of all such stacks."""
    index, thickness = (np.stack([x + 0.0 * c for x in z]) for z in (index, thickness))
    return stack_of_many(c, index.astype(complex), thickness, np.float64(wavelength) + 0.0 * c)


def _eps(dtype):
    return float(np.finfo(dtype).eps)


@pytest.mark.study
@pytest.mark.parametrize("dtype", [pytest.param(np.float32, marks=pytest.mark.study), np.float64])
@pytest.mark.parametrize("layers", [0, 3])
def test_layers_of_no_thickness_are_one_boundary(dtype, layers):
    c = COSINES.astype(dtype)
    inner = np.array([2.1 + 0.3j, 1.3, 0.2 + 3j])[:layers]
    index = np.array([1.2, *inner, 0.4 + 2.5j]).astype(np.result_type(dtype, np.complex64))
    got = stack(c, index, thickness_um=np.zeros(layers, dtype), wavelength_um=dtype(0.5))
    n, k, m = (dtype(x) for x in (index[-1].real, index[-1].imag, index[0].real))
    for values, wanted in ((got[:4], powers(c, n, k, m)), (got[4:8], amplitudes(c, n, k, m))):
        for value, exact in zip(values, wanted, strict=True):
            assert value.dtype == exact.dtype
            assert np.all(np.abs(value - exact) <= 40 * _eps(dtype) * np.abs(exact))


def test_a_quarter_wave_film_of_the_geometric_mean_reflects_nothing():
    n = np.sqrt(1.5)
    film = [0.6 / (4 * n), 0.0, 0.0]
    got = three_layers(np.ones(1), [1.0, n, n, n, 1.5], film, 0.6)
    assert got.R < 1e-31 and abs(got.T - 1.0) < 1e-15


@pytest.mark.study
def test_a_case_that_tmm_publishes():
    """The values of a Mathematica program in the tests of the package tmm 0.2.0 (S. J. Byrnes)."""
    got = stack(
        np.cos(0.1), [1.0, 2 + 4j, 3 + 0.3j, 1 + 0.1j], thickness_um=[2.0, 3.0], wavelength_um=100.0
    )
    published = {
        "R_s": 0.37273208839139516, "R_p": 0.37016110373044969,
        "T_s": 0.22604491247079261, "T_p": 0.22824374314132009,
        "r_s": -0.60331226568845775 - 0.093522181653632019j,
        "t_s": 0.44429533471192989 + 0.16921936169383078j,
    }  # fmt: skip
    for name, value in published.items():
        assert abs(getattr(got, name) - value) < 1e-14


def test_a_case_that_prysm_publishes():
    """Coated fused silica in its tests (B. Dube), to the digits that are given there."""
    w = 0.587725
    index = [1.0, 1.3698, 2.1588, 1.629 + 0.0034836j, 1.458461]
    coated = three_layers(np.ones(1), index, [w / 4, w / 2, w / 4], w)
    assert abs(coated.R_s - 0.0026) < 5e-4


def test_compiled_mapped_and_looped_calls_agree():
    index = jnp.array([1.0, 1.46 + 0.01j, 3.9 + 0.02j])
    thickness = jnp.array([0.7])
    wavelength = jnp.linspace(0.4, 0.7, 7)

    def one(c, w):
        return stack(c, index, thickness_um=thickness, wavelength_um=w)

    cosines = jnp.asarray(COSINES)[:, None]
    whole = stack(
        cosines,
        index[:, None, None],
        thickness_um=thickness[:, None, None],
        wavelength_um=wavelength,
    )
    for i, c in enumerate(COSINES[:3]):
        for a, b in zip(whole, one(c, wavelength[1]), strict=True):
            np.testing.assert_allclose(np.asarray(a)[..., i, 1], b, rtol=1e-12)
    mapped = jax.jit(jax.vmap(one, (None, 0)))(COSINES[2], wavelength)
    for a, b in zip(mapped[:8], whole[:8], strict=True):
        np.testing.assert_allclose(a, b[2], rtol=1e-12)
    np.testing.assert_allclose(mapped.A.T, whole.A[:, 2], rtol=1e-12)


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
        c, index, thickness, wavelength = arguments
        stack(c, index, thickness_um=thickness, wavelength_um=wavelength)


@pytest.mark.study
def test_a_layer_that_is_not_coherent_is_the_slab():
    for k in (0.0, 1e-6, 1e-2):
        got = stack(
            COSINES,
            [1.2, 1.5 + 1j * k, 1.2],
            thickness_um=[100.0],
            wavelength_um=0.5,
            coherent=False,
        )
        for value, exact in zip(
            got[:4],
            slab(COSINES, 1.5, k, thickness_um=100.0, wavelength_um=0.5, eta_i=1.2),
            strict=True,
        ):
            np.testing.assert_allclose(value, exact, rtol=1e-13)
        np.testing.assert_allclose(got.R + got.T + got.A[0], 1.0, rtol=1e-14)


def test_transmittance_is_the_same_from_both_sides():
    index = np.array([1.3, 2.1 + 0.2j, 0.3 + 3j, 1.7, 1.6])
    thickness = np.array([0.1, 0.02, 0.4])
    there = three_layers(COSINES, index, thickness, 0.6)
    cosine = np.sqrt(1.0 - (1.3 / 1.6) ** 2 * (1.0 - COSINES**2))
    back = three_layers(cosine, index[::-1], thickness[::-1], 0.6)
    for a, b in zip(there[2:4], back[2:4], strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-12)


@pytest.mark.study
@pytest.mark.parametrize("dtype", [pytest.param(np.float32, marks=pytest.mark.study), np.float64])
def test_total_reflection_without_absorption_is_exactly_one(dtype):
    """R_p was 101 eps off (cosine .0027); a little absorption takes of it what it did."""
    index = np.array([3.80, 4.70, 0.118, 1.5], dtype)
    thickness = np.array([0.3, 0.4], dtype)

    def reflected(k):
        media = index + 1j * k * np.array([0.0, 1.0, 0.0, 0.0], dtype)
        return stack(dtype(0.0027), media, thickness_um=thickness, wavelength_um=dtype(0.5)).R_p

    value, slope = jax.jit(jax.value_and_grad(reflected))(dtype(0.0))
    assert value == 1.0 and value.dtype == dtype
    # the loss of the next larger k, from another program path: A = -dR
    small = dtype(1e-4)
    lost = stack(
        dtype(0.0027),
        index + 1j * small * np.array([0, 1, 0, 0], dtype),
        thickness_um=thickness,
        wavelength_um=dtype(0.5),
    ).A_p.sum()
    assert slope == pytest.approx(-float(lost) / float(small), rel=2e-3)


def test_films_are_a_fresnel_term():
    model = FresnelStack([1.0, 1.46, 3.9 + 0.02j], [0.1], 0.55)
    np.testing.assert_array_equal(
        model(0.7), stack(0.7, [1.0, 1.46, 3.9 + 0.02j], thickness_um=[0.1], wavelength_um=0.55).R
    )
    fast = FresnelStack([1.0, 1.46, 3.9 + 0.02j], [0.1], 0.55, exact=False)
    np.testing.assert_allclose(fast(0.7), model(0.7), rtol=1e-13)
    with pytest.raises(ValueError, match="the imaginary part of index is -0.02"):
        FresnelStack([1.0, 1.46, 3.9 - 0.02j], [0.1], 0.55)
    with pytest.raises(ValueError, match="its leading axis counts the media"):
        FresnelStack(1.5, [0.1], 0.55)


def test_coherent_must_be_static():
    with pytest.raises(ValueError, match="one of them for each of the 1 layers"):
        stack(1.0, [1.0, 1.4, 1.5], thickness_um=[0.1], wavelength_um=0.5, coherent=(True, False))


@pytest.mark.study
def test_gradients_of_arguments_that_broadcast():
    wavelength, c = jnp.linspace(0.4, 0.7, 3), jnp.asarray(COSINES[:4])[:, None]

    def total(n, thickness):
        return jnp.sum(
            stack(
                c, n[:, None, None], thickness_um=thickness[:, None, None], wavelength_um=wavelength
            ).R
        )

    # one program for values and gradient: each takes ten seconds to compile
    both = jax.jit(jax.value_and_grad(total, (0, 1)))
    given = jnp.array([1.0, 1.46, 2.3, 3.9]), jnp.array([0.1, 0.2])
    gradient = both(*given)[1]
    for argument, size in enumerate((4, 2)):
        for i in range(size):
            step = [0.0, 0.0]
            step[argument] = 1e-6 * (jnp.arange(size) == i)
            above, below = (
                both(*(x + sign * y for x, y in zip(given, step, strict=True)))[0]
                for sign in (1, -1)
            )
            np.testing.assert_allclose(gradient[argument][i], (above - below) / 2e-6, rtol=1e-7)


@pytest.mark.study
def test_derivatives_of_a_rough_film_of_small_wavevector():
    """Nevot and Croce's factor knows Q, which the matrices of so thin a film do without: a part of
    the derivative, a hundredth of it, was missing there. And what the boundary behind so thin a
    film changes was counted twice in what the film absorbs: 1e-3 of the derivatives of A."""

    def powers_of(n):
        index = [1.76, n + 1e-7j, 2.37]
        out = stack(
            0.9, index, thickness_um=[0.058], wavelength_um=0.5, roughness_um=[0.0046, 0.0012]
        )
        return jnp.stack([*out[:4], *out.A_s, *out.A_p])

    both = jax.jit(lambda n: jax.jvp(powers_of, (n,), (1.0,)))
    above, below = both(0.86 + 1e-5)[0], both(0.86 - 1e-5)[0]
    np.testing.assert_allclose(both(0.86)[1], (above - below) / 2e-5, rtol=1e-8)


def test_a_rough_film_behind_a_medium_that_hardly_absorbs():
    """As behind a clear one: with a k of 1e-14 in front, T was .34 instead of .93."""

    def powers_behind(k):
        out = stack(
            0.8, [1.6 + 1j * k, 1.3, 1.5 + 1e-3j],
            thickness_um=[0.2], wavelength_um=0.55, roughness_um=[0.03, 0.02],
        )  # fmt: skip
        return jnp.stack([*out[:4], *out.A_s, *out.A_p])

    np.testing.assert_allclose(powers_behind(1e-14), powers_behind(0.0), rtol=1e-11, atol=1e-13)


def test_a_trace_of_absorption_in_front_changes_little():
    """With the root of Im Q >= 0 behind an absorbing medium R_s would be 12.6, 1 / .0793."""
    cosine = np.array([0.9, 0.5, 0.9, 0.5])  # refraction, total reflection
    first = 1.5 + 1e-6j * np.array([0.0, 0.0, 1.0, 1.0])
    found = three_layers(cosine, [first, 1.7, 1.7, 1.7, 1.0], [0.1, 0.0, 0.0], 0.5)
    for power in found[:4]:
        np.testing.assert_allclose(power[2:], power[:2], atol=2e-5)
    assert 0.05 < found.R_s[2] < 0.5 and found.R_s[1] == pytest.approx(1.0)
