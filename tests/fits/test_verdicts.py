"""What a bare surface leaves open is told by every entrance: `fit` by any model, and `choose`."""

import numpy as np
import pytest

from fitting import Measurement, choose, fit, fit_many
from fresnel_jax import powers

# The metals of which a lossless index of 54 to 338 was "converged": eta and k, angles, sigma.
METALS = {
    "silver": (0.14, 4.1, np.linspace(15, 65, 11), "R", 0.005),
    "copper": (0.25, 3.5, np.linspace(15, 65, 11), "R_s", 0.005),
    "silver by R_s": (0.17, 4.7, np.linspace(15, 80, 14), "R_s", 0.002),
}


def measured(eta, k, angle, quantity, sigma, wavelength=0.6328):
    """Return simulated reflectances of a surface at angles (M,) and wavelengths, with noise."""
    wavelength, angle = np.meshgrid(wavelength, angle, indexing="ij")
    p = powers(np.cos(np.radians(angle)), eta, k)
    exact = np.asarray(p.R_s if quantity == "R_s" else 0.5 * (p.R_s + p.R_p))
    noisy = exact + sigma * np.random.default_rng(1).standard_normal(exact.shape)
    values = {quantity: np.clip(noisy, 0.0, 1.0).ravel()}
    return Measurement.from_columns(angle.ravel(), wavelength.ravel(), sigma=sigma, **values)


@pytest.mark.parametrize(
    "metal", [pytest.param(m, marks=[pytest.mark.study] * (m == "copper")) for m in METALS]
)
def test_a_metal_on_its_circle_is_undetermined_by_every_entrance(metal):
    m = measured(*METALS[metal])
    entrances = (fit(m), fit(m, "constant"), fit(m, loss="huber"), choose(m).fit)
    for found in entrances:
        assert found.status == "undetermined"
        assert found.warnings[0].code == "circle"
        assert np.isnan(found.parameters["eta"].sigma)
    # The range of eta is that of the whole circle, by each of them.
    ends = [found.parameters["eta"].interval for found in entrances]
    assert all(low < 1.0 and high > 50.0 for low, high in ends)


def test_glass_is_determined_by_every_entrance():
    m = measured(1.5, 0.0, np.linspace(15, 80, 14), "R_s", 0.002)
    for found in (fit(m), fit(m, "constant"), choose(m).fit):
        assert found.status == "converged"
        assert abs(found.eta - 1.5) < 0.01


def test_a_lossless_dispersion_of_a_metal_is_undetermined():
    m = measured(0.14, 4.1, np.linspace(15, 65, 11), "R", 0.005, np.linspace(0.45, 0.75, 6))
    found = fit(m, "cauchy:2")
    assert found.status == "undetermined"
    assert found.warnings[0].code == "circle"
    assert np.isnan(found.parameters["A"].sigma)
    # Of many curves each is asked by itself; glass beside it is determined.
    glass = measured(1.5, 0.0, np.linspace(15, 65, 11), "R", 0.005, np.linspace(0.45, 0.75, 6))
    many = fit_many(
        m.angle_deg, m.wavelength_um, R=np.stack([m.value, glass.value]), sigma=0.005,
        sample="cauchy:2",
    )  # fmt: skip
    assert many.status.tolist() == ["undetermined", "converged"]
    assert many.warnings[0][0].code == "circle" and "circle" not in str(many.warnings[1])
    assert np.isnan(many.parameters["A"].sigma).tolist() == [True, False]


def test_absorption_that_only_the_model_tells():
    m = measured(0.14, 4.1, np.linspace(15, 65, 11), "R", 0.005, np.linspace(0.45, 0.75, 6))
    found = fit(m, "drude")
    assert "by_the_model_alone" in {w.code for w in found.warnings}
    many = fit_many(m.angle_deg, m.wavelength_um, R=m.value[None], sigma=0.005, sample="drude")
    assert "by_the_model_alone" in {w.code for w in many.warnings[0]}


def test_an_index_that_the_user_knows_is_believed():
    m = measured(0.14, 4.1, np.linspace(15, 65, 11), "R", 0.005)
    found = fit(m, "constant", fixed={"eta": 0.14})
    assert found.status == "converged"
    assert abs(found.k - 4.1) < 1.0


def test_no_choice_takes_a_surface_for_a_detector_that_is_wrong_by_far():
    m = measured(0.25, 3.5, np.linspace(15, 65, 11), "R", 0.005)
    assert "scale" not in choose(m).fit.parameters
