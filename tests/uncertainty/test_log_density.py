"""`log_density`: what a sampler is given, compared with the textbook form in NumPy."""

import jax
import numpy as np
import pytest

from fitting import Measurement, log_density
from tests.truth.textbook import reflectances

ANGLE = np.array([20.0, 50.0, 70.0, 80.0])
TRUE = {"eta": 1.8, "k": 0.6, "scale": 0.97}


def powers(eta, k):
    return reflectances(np.cos(np.radians(ANGLE)), eta + 1j * k, 1.0)


def measurement(sigma: float | None = 0.01):
    R = TRUE["scale"] * powers(TRUE["eta"], TRUE["k"])["R_s"]
    return Measurement.from_columns(ANGLE, R_s=R, sigma=sigma)


def expected(values):
    """The log density of `measurement` with a prior of the scale of 1 with an error of 0.02."""
    off = values["scale"] * powers(values["eta"], values["k"])["R_s"] - measurement().value
    return -0.5 * np.sum((off / 0.01) ** 2) - 0.5 * ((values["scale"] - 1.0) / 0.02) ** 2


@pytest.fixture(scope="module")
def density():
    return log_density(measurement(), "free", priors={"scale": (1.0, 0.02)})


@pytest.fixture(autouse=True)
def float64():
    with jax.enable_x64(True):
        yield


def compiled(density):
    return jax.jit(jax.vmap(jax.value_and_grad(density)))


def test_it_is_half_the_squares_of_residuals_and_priors(density):
    assert set(density.bounds) == {"eta", "k", "scale"}
    at = {"eta": np.array([1.8, 1.7, 2.1]), "k": np.array([0.6, 0.8, 0.1]), "scale": np.ones(3)}
    value, slope = compiled(density)(at)
    each = [dict(zip(at, row, strict=True)) for row in zip(*at.values(), strict=True)]
    np.testing.assert_allclose(value, [expected(v) for v in each], rtol=1e-11)
    for i, v in enumerate(each):
        for name, x in v.items():
            h = 1e-6
            true = (expected(v | {name: x + h}) - expected(v | {name: x - h})) / (2.0 * h)
            assert slope[name][i] == pytest.approx(true, rel=1e-6, abs=1e-4)


def test_beyond_a_bound_it_is_minus_infinity_and_its_gradient_is_finite(density):
    at = {"eta": np.array([1.8, 1.8, 2000.0]), "k": np.array([0.6, -0.1, 0.6]), "scale": np.ones(3)}
    value, slope = compiled(density)(at)
    assert list(np.isneginf(value)) == [False, True, True]
    assert all(np.isfinite(x).all() for x in slope.values())


def test_what_is_fixed_or_tied_is_no_parameter():
    tied = log_density(
        measurement(), tie={"k": "0.5 * eta"}, fixed={"scale": 0.97}, priors={"eta": (1.6, 0.1)}
    )
    assert set(tied.bounds) == {"eta"}
    off = 0.97 * powers(1.7, 0.85)["R_s"] - measurement().value
    true = -0.5 * np.sum((off / 0.01) ** 2) - 0.5
    assert jax.jit(tied)({"eta": 1.7}) == pytest.approx(true, rel=1e-11)


def test_what_it_refuses(density):
    with pytest.raises(ValueError, match="4 of 4 data have no standard error"):
        log_density(measurement(None))
    spectrum = Measurement.from_columns(60.0, np.array([0.5, 0.6]), R=0.3, sigma=0.01)
    with pytest.raises(ValueError, match="one wavelength"):
        log_density(spectrum)
    with pytest.raises(ValueError, match="leave one free"):
        log_density(spectrum, "Si")
    with pytest.raises(ValueError, match="values of eta came; those of eta, k, scale"):
        density({"eta": 1.5})
    with jax.enable_x64(False), pytest.raises(ValueError, match="jax_enable_x64"):
        density(TRUE)


def test_the_gradient_at_a_bound_is_that_inside():
    """Half of it came, as of min and max where both arguments are equal."""
    there = log_density(measurement(), "free", bounds={"eta": (1.7, 3.0)}, fixed={"k": 0.6})
    at, beside = (float(jax.grad(there)({"eta": eta})["eta"]) for eta in (1.7, 1.7 + 1e-9))
    assert at == pytest.approx(beside, rel=1e-6)
