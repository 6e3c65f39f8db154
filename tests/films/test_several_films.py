"""Several films of unknown thickness: their fringes are those of sums of their phases."""

import numpy as np
import pytest

from fitting import Measurement, fit, simulate

WAVELENGTHS = 1.0 / np.linspace(1.0 / 0.9, 1.0 / 0.4, 200)
STUDY = pytest.mark.study


@pytest.mark.parametrize("thicknesses", [
    (480.8, 2861.5), pytest.param((1864.2, 115.5), marks=STUDY),
    pytest.param((601.6, 345.8), marks=STUDY), pytest.param((1583.9, 1602.9), marks=STUDY),
])  # fmt: skip
def test_two_thick_films(thicknesses):
    """Of 30 such samples 3 to 9 had ended with thicknesses exchanged, or one of them lost."""
    first, second = thicknesses
    truth = {"film_1.thickness_nm": first, "film_2.thickness_nm": second}
    clean = simulate(f"air | SiO2 {first} nm | 2.1 {second} nm | Si", truth, 0.0, WAVELENGTHS)
    noisy = clean + 1e-3 * np.random.default_rng(1).standard_normal(len(clean))
    m = Measurement.from_columns(0.0, WAVELENGTHS, R=noisy, sigma=1e-3)
    found = fit(m, "air | SiO2 50..4000 nm | 2.1 50..4000 nm | Si")
    assert found.chi2_reduced < 1.5
    for name, value in truth.items():
        assert abs(found.parameters[name].value - value) < 4.0 * found.parameters[name].sigma


@pytest.mark.study
def test_three_films():
    thicknesses = 271.6, 942.7, 734.3
    truth = {f"film_{i}.thickness_nm": d for i, d in enumerate(thicknesses, 1)}
    films = ("SiO2", "2.1", "1.7")
    sample = " | ".join(f"{n} {d} nm" for n, d in zip(films, thicknesses, strict=True))
    clean = simulate(f"air | {sample} | Si", truth, 0.0, WAVELENGTHS)
    noisy = clean + 1e-3 * np.random.default_rng(1).standard_normal(len(clean))
    m = Measurement.from_columns(0.0, WAVELENGTHS, R=noisy, sigma=1e-3)
    found = fit(m, "air | " + " | ".join(f"{n} 50..4000 nm" for n in films) + " | Si")
    for name, value in truth.items():
        assert abs(found.parameters[name].value - value) < 4.0 * found.parameters[name].sigma
