"""A k that only the form of the model separates from eta is told; a known k is none."""

import numpy as np
import pytest

from fitting import Measurement, fit, simulate

pytestmark = pytest.mark.slow

WAVELENGTHS = np.linspace(0.4, 0.9, 32)
TRUTH = {"A": 1.9, "B": 0.01, "thickness_nm": 300.0}


def told(sample, reflectance, **settings):
    m = Measurement.from_columns(0.0, WAVELENGTHS, sigma=1e-3, R=reflectance)
    found = fit(m, sample, **settings)
    return "by_the_model_alone" in {w.code for w in found.warnings}


@pytest.fixture(scope="module")
def reflectance():
    clean = simulate("air | cauchy:2 300 nm | 1.52", TRUTH, 0.0, WAVELENGTHS)
    return clean + 1e-3 * np.random.default_rng(0).standard_normal(len(clean))


@pytest.mark.parametrize("sample, expected", [
    ("air | cauchy:2 100..600 nm | 1.52", False),
    ("air | cauchy:2 100..600 nm | 1.52+0.01i", False),
    ("air | 1.5 1..20 nm | cauchy:2 100..600 nm | 1.52", False),
    ("air | cauchy-urbach:2 100..600 nm | 1.52", True),
])  # fmt: skip
def test_one_reflectance_at_each_wavelength(sample, expected, reflectance):
    assert told(sample, reflectance) is expected


@pytest.mark.parametrize("fixed, expected", [
    ({"k_edge": 0.0, "urbach_ev": 0.3}, False),
    ({"k_edge": 0.01}, True),
])  # fmt: skip
def test_an_urbach_tail_that_is_fixed_is_known(fixed, expected, reflectance):
    """A and B are of eta alone, and had made its k that of the model."""
    assert told("air | cauchy-urbach:2 100..600 nm | 1.52", reflectance, fixed=fixed) is expected


def test_a_birefringence_is_of_eta(reflectance):
    film = "uniaxial(constant, birefringence 0.01) 250..350 nm"
    assert not told(f"air | {film} | 1.52", reflectance, fixed={"k": 0.0}, starts=2)
