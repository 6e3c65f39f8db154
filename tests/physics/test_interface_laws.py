"""Physical laws, golden tables and exact values of the interface."""

from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fresnel_jax import (
    amplitudes,
    fresnel_complex,
    fresnel_conductor,
    fresnel_dielectric,
    powers,
    reflectance,
)
from tests.truth import adversarial

TABLES = Path(__file__).parents[1] / "truth" / "reference"
EPS = np.finfo(np.float64).eps
DTYPES = pytest.mark.parametrize("dtype", [np.float64, np.float32])


def random_boundaries(seed=3, size=2000):
    random = np.random.default_rng(seed)
    c, n, k, m = (random.uniform(low, 1, size) for low in (0.01, 0.1, 0.0, 0.25))
    return c, 4 * n, 4 * k, 4 * m


def golden(name):
    return np.genfromtxt(TABLES / name, delimiter=",", names=True, dtype=None, encoding="utf-8")


def assert_close(ours, table, relative, absolute=0.0):
    np.testing.assert_allclose(np.asarray(ours), table, rtol=relative, atol=absolute)


def test_golden_dielectric():
    table = golden("golden_dielectric.csv")
    # Decimal inputs can lie on the critical angle itself (0.8 and 0.6), which no floats do.
    table = table[(table["tir"] == 1) | (table["cos_t_abs"] > 1e-6)]
    c, eta = np.where(table["side"] > 0, 1, -1) * table["cos_i"], table["eta"]
    # The table's decimal eta - 1 = 2.9e-4 differs from the float's by 8e-13 of itself.
    assert_close(fresnel_dielectric(c, eta), table["R"], 4e-12)
    inside = table["side"] < 0
    n, m = np.where(inside, 1.0, eta), np.where(inside, eta, 1.0)
    result = powers(c, n, 0.0, m)
    assert_close(result.R_s, table["Rs"], 4e-12)
    assert_close(result.R_p, table["Rp"], 4e-11, 1e-30)  # also next to Brewster's angle
    assert_close(result.T, table["T"], 4e-11, 1e-40)  # the table has 1e-41 for 0
    r = amplitudes(c, n, 0.0, m)
    for ours, name in ((r.r_s, "rs"), (r.r_p, "rp")):
        # the table has the other sign convention, eta - ik
        assert_close(np.conj(ours), table[f"{name}_re"] + 1j * table[f"{name}_im"], 4e-12, 1e-15)
    gradient = jax.vmap(jax.grad(fresnel_dielectric, argnums=(0, 1)))(c, eta)
    sign = np.where(inside, -1.0, 1.0)  # the table differentiates with respect to abs(cos)
    assert_close(gradient[0] * sign, table["dR_dcos"], 1e-9, 1e-15)
    assert_close(gradient[1], table["dR_deta"], 1e-9, 1e-15)


def test_golden_conductor():
    table = golden("golden_conductor.csv")
    arguments = table["cos_i"], table["eta"], table["k"]
    result = powers(*arguments)
    for ours, name in ((result.R, "R"), (result.R_s, "Rs"), (result.R_p, "Rp")):
        assert_close(ours, table[name], 1e-14)
    assert_close(result.T, table["one_minus_R"], 1e-14)
    assert_close(fresnel_conductor(*arguments), table["R"], 1e-14)
    assert_close(fresnel_complex(arguments[0], arguments[1] + 1j * arguments[2]), table["R"], 1e-14)
    r = amplitudes(*arguments)
    for ours, name in ((r.r_s, "rs"), (r.r_p, "rp")):
        # the table has the other sign convention, eta - ik
        assert_close(np.conj(ours), table[f"{name}_re"] + 1j * table[f"{name}_im"], 1e-14, 1e-15)
    gradient = jax.vmap(jax.grad(reflectance, argnums=(0, 1, 2)))(*arguments)
    for ours, name in zip(gradient, ("dR_dcos", "dR_deta", "dR_dk"), strict=True):
        assert_close(ours, table[name], 1e-12, 1e-15)


def test_reflected_and_transmitted_power_add_up():
    result = powers(*random_boundaries())
    for R, T in ((result.R_s, result.T_s), (result.R_p, result.T_p)):
        assert_close(R + T, 1.0, 12 * EPS)


def test_p_is_the_square_of_s_at_45_degrees():
    _, n, k, m = random_boundaries()
    result = powers(np.sqrt(0.5), n, k, m)
    # sqrt(0.5) misses the cosine of 45 degrees by eps/2
    assert_close(result.R_p, result.R_s**2, 60 * EPS, EPS**2)


def test_reversibility():
    """R from one side at theta_i is R from the other at theta_t."""
    c, n, _, m = random_boundaries()
    sine = m / n * np.sqrt((1 - c) * (1 + c))
    c, n, m, sine = (x[sine < 0.99] for x in (c, n, m, sine))
    cos_t = np.sqrt((1 - sine) * (1 + sine))
    there, back = powers(c, n, 0.0, m), powers(cos_t, m, 0.0, n)
    for one, other in zip(there, back, strict=True):
        # an eps in the sine moves cos_t = 0.14 by 50 eps, and R and T by some 20 times as much
        assert_close(one, other, 1000 * EPS, 1000 * EPS)


def test_conductor_without_absorption_is_a_dielectric():
    c, n, _, _ = random_boundaries()
    assert_close(fresnel_conductor(c, n, jnp.zeros_like(n)), fresnel_dielectric(c, n), 24 * EPS)


def test_swapped_indices_are_the_reciprocal_index():
    c, n, _, _ = random_boundaries()
    n = 2.0 ** np.round(np.log2(n))  # whose reciprocal is exact
    for one, other in zip(powers(c, 1.0, 0.0, n), powers(c, 1.0 / n), strict=True):
        assert_close(one, other, 24 * EPS)


def test_only_the_ratio_of_indices_counts():
    c, n, k, m = random_boundaries()
    for one, other in zip(powers(c, n, k, m), powers(c, 8 * n, 8 * k, 8 * m), strict=True):
        assert_close(one, other, 24 * EPS)


def test_amplitudes_and_powers_agree():
    c, n, k, m = random_boundaries()
    r, power = amplitudes(c, n, k, m), powers(c, n, k, m)
    assert_close(np.abs(r.r_s) ** 2, power.R_s, 40 * EPS)
    assert_close(np.abs(r.r_p) ** 2, power.R_p, 40 * EPS)
    assert_close(amplitudes(c, n + 1j * k, eta_i=m).r_p, r.r_p, 4 * EPS)
    at_normal = amplitudes(1.0, n, k, m)
    assert_close(at_normal.r_p, -at_normal.r_s, 12 * EPS)


@DTYPES
def test_total_reflection_is_exact(dtype):
    c = jnp.linspace(0, 0.7, 200, dtype=dtype)
    result = powers(c, dtype(1.0), dtype(0.0), dtype(1.5))
    for R, T in ((result.R_s, result.T_s), (result.R_p, result.T_p)):
        assert np.all(np.asarray(R) == 1.0) and np.all(np.asarray(T) == 0.0)
    assert np.all(np.asarray(fresnel_dielectric(-c[1:], dtype(1.5))) == 1.0)


@DTYPES
def test_matched_media_reflect_exactly_nothing(dtype):
    c = jnp.asarray([0.0, 1e-30, 1e-12, 1e-4, 0.3, 1.0], dtype)
    for n in (1.0, 1.2345, 3.9):
        result = powers(c, dtype(n), dtype(0.0), dtype(n))
        for R, T in ((result.R_s, result.T_s), (result.R_p, result.T_p)):
            assert np.all(np.asarray(R) == 0.0)
            assert_close(T, 1.0, 4 * np.finfo(dtype).eps)
    assert np.all(np.asarray(fresnel_dielectric(c, dtype(1.0))) == 0.0)


@DTYPES
def test_powers_never_leave_the_unit_interval(dtype):
    for points in adversarial.hard_sets(dtype).values():
        for power in powers(*points):
            assert np.all((np.asarray(power) >= 0.0) & (np.asarray(power) <= 1.0))


@pytest.mark.study
@pytest.mark.parametrize("function", [reflectance, lambda *a: powers(*a).R], ids=["R", "powers"])
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_total_reflection_has_no_derivative_at_grazing_either(dtype, function):
    """R is 1 around: every derivative is 0. The square of the cosine is below float32's range."""
    random = np.random.default_rng(20261121)
    c = (10.0 ** random.uniform(-24, -1, 2000)).astype(dtype)
    n = random.uniform(0.3, 0.9, 2000).astype(dtype)
    gradients = jax.jit(jax.vmap(jax.grad(lambda c, n: function(c, n), argnums=(0, 1))))(c, n)
    for gradient in gradients:
        np.testing.assert_array_equal(gradient, np.zeros_like(c))
    hessian = jax.hessian(lambda x: function(x[0], x[1]))(jnp.array([0.3, 0.7], dtype))
    np.testing.assert_array_equal(hessian, np.zeros((2, 2), dtype))
