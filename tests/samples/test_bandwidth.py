"""A spectrometer's slit and the offset of its wavelengths: what they do, how fits find them."""

import numpy as np
import pytest

from fitting import Measurement, fit, fit_many, simulate

pytestmark = pytest.mark.slow

FILM = "air | cauchy:2 8000 nm | Si"
TRUTH = {"A": 1.46, "B": 0.0035, "thickness_nm": 8000.0}
NM = np.linspace(600.0, 640.0, 64)


def test_curves_are_means_over_the_slit():
    """By brute force: intensities, and psi and Delta as the mixture of light that they are of.

    A slit of 6 nm takes the fringes of this film, 15 nm wide, down to a third of their contrast.
    Averages promise 1e-4 of R (docs/films.md), and .01 degrees are a tenth of an ellipsometer's.
    """
    x = np.linspace(-6.0, 6.0, 601)
    weight = np.exp(-0.5 * x * x)
    weight /= weight.sum()
    nm = NM[::16]
    grid = (nm[:, None] + x * 6.0 / np.sqrt(8.0 * np.log(2.0))) / 1e3

    def seen(um, values):
        names = np.repeat(["R_s", "R_p", "psi", "delta"], um.size)
        return simulate(FILM, values, 60.0, np.tile(um.ravel(), 4), names).reshape(4, *um.shape)

    R_s, R_p, psi, delta = seen(grid, TRUTH)
    wide = seen(nm / 1e3, TRUTH | {"bandwidth": 6.0})
    np.testing.assert_allclose(wide[0], R_s @ weight, atol=1e-4)
    np.testing.assert_allclose(wide[1], R_p @ weight, atol=1e-4)
    psi, delta = np.radians(psi), np.radians(delta)
    each = np.cos(2 * psi), np.sin(2 * psi) * np.cos(delta), np.sin(2 * psi) * np.sin(delta)
    N, C, S = (((R_s + R_p) * part) @ weight for part in each)
    expected = 0.5 * np.degrees(np.arctan2(np.hypot(C, S), N))
    np.testing.assert_allclose(wide[2], expected, atol=0.01)
    away = wide[3] - np.degrees(np.arctan2(S, C))
    np.testing.assert_allclose((away + 180.0) % 360.0 - 180.0, 0.0, atol=0.01)


def _average(sample, parameters, angle, um, quantity, slit_nm=0.0, beam_deg=0.0):
    """The mean over a slit and a beam by brute force, of powers: 2001 places in each."""
    x = np.linspace(-8.0, 8.0, 2001)
    weight = np.exp(-0.5 * x * x)
    weight /= weight.sum()
    waves = um + 1e-3 * x * slit_nm / np.sqrt(8.0 * np.log(2.0))
    angles = angle + x * beam_deg
    angles = np.where(angles > 90.0, 180.0 - angles, np.abs(angles))
    return simulate(sample, parameters, angles, waves, quantity) @ weight


@pytest.mark.study
def test_a_slit_over_many_fringes_is_averaged():
    """Eleven wavelengths were off by .03 of R for 6 um and 20 nm; averages promise 1e-4."""
    truth = {"A": 1.9, "B": 0.004, "thickness_nm": 6000.0}
    for um, angle, quantity in ((0.685, 81.0, "R_s"), (0.563, 4.0, "R_p"), (0.7, 60.0, "R_s")):
        seen = simulate(FILM, truth | {"bandwidth": 19.0}, angle, um, quantity)
        expected = _average(FILM, truth, angle, um, quantity, slit_nm=19.0)
        np.testing.assert_allclose(seen, expected, atol=1e-4)


def test_a_beam_over_a_critical_angle_and_at_grazing_incidence_is_averaged():
    """Seven angles were off by .03 of R at a critical angle, .001 at grazing incidence.

    Averages promise 1e-4 of R, but across a critical angle, where its slope is infinite (4.8e-4).
    """
    for sample, angle in (("1.8 | 1.45", 53.4), ("1.8 | 1.45", 54.2), ("air | 1.52", 88.0)):
        seen = simulate(sample, {"divergence": 0.8}, angle, 0.5, "R_p")
        expected = _average(sample, {}, angle, 0.5, "R_p", beam_deg=0.8)
        np.testing.assert_allclose(seen, expected, atol=7e-4 if angle < 60.0 else 1e-4)


@pytest.mark.study
def test_the_first_medium_too_is_seen_at_all_wavelengths_of_the_slit():
    for sample in ("water | 3.9+0.02i", "water | 2.1 60 nm held | 3.9+0.02i"):
        seen = simulate(sample, {"bandwidth": 20.0}, 70.0, 0.4, "R_s")
        expected = _average(sample, {}, 70.0, 0.4, "R_s", slit_nm=20.0)
        np.testing.assert_allclose(seen, expected, atol=1e-9)


def test_slits_too_wide_are_refused():
    with pytest.raises(ValueError, match="60 nm is too wide for the wavelength 200 nm: .* 50 nm"):
        simulate("1.5", {"bandwidth": 60.0}, 10.0, 0.2)
    with pytest.raises(ValueError, match="fringes of the films.*'thick'"):
        simulate("air | 1.5 1 mm held | Si", {"bandwidth": 5.0}, 10.0, 0.6)
    m = Measurement.from_columns(np.linspace(0.0, 80.0, 9), 0.2, R=0.05 * np.ones(9), sigma=1e-3)
    with pytest.raises(ValueError, match="too wide for the wavelength 200 nm"):
        fit(m, "constant", bounds={"bandwidth": (60.0, 80.0)})
    found = fit(m, "constant", fixed={"bandwidth": 40.0, "k": 0.0}, intervals="quadratic")
    with pytest.raises(ValueError, match="too wide for the wavelength 150 nm"):
        found.predict(10.0, "R", 0.15)


@pytest.mark.study
def test_a_fit_finds_the_slit():
    R = simulate(FILM, TRUTH | {"bandwidth": 4.0}, 0.0, NM / 1e3, "R")
    R = R + 1e-3 * np.random.default_rng(1).standard_normal(len(R))
    m = Measurement.from_columns(0.0, NM / 1e3, R=R, sigma=1e-3)
    sample, held = "air | cauchy:2 7000..9000 nm | Si", {"B": 0.0035}
    found = fit(m, sample, free="bandwidth", fixed=held, errors="stated", intervals="quadratic")
    for name, value in (("bandwidth", 4.0), ("thickness_nm", 8000.0), ("A", 1.46)):
        e = found.parameters[name]
        assert abs(e.value - value) < 4.0 * e.sigma, name
    assert found.parameters["bandwidth"].sigma < 0.2
    known = fit(m, sample, fixed=held | {"bandwidth": 4.0}, errors="stated", intervals="quadratic")
    narrow = fit(m, sample, fixed=held, errors="stated", intervals="quadratic")
    assert known.chi2_reduced < 1.5 < 20.0 < narrow.chi2_reduced


def test_an_offset_is_added_to_every_wavelength():
    """Also to those of the first medium, of the film's phase and of each place in the slit."""
    sample, um = "water | cauchy:2 300 nm | Si", np.repeat([0.45, 0.6], 3)
    truth = {"A": 1.9, "B": 0.02, "thickness_nm": 300.0, "bandwidth": 4.0}
    quantities = ["R_s", "psi", "delta"] * 2
    seen = simulate(sample, truth | {"wavelength_offset": 1.5}, 60.0, um, quantities)
    expected = simulate(sample, truth, 60.0, um + 1.5e-3, quantities)
    np.testing.assert_allclose(seen, expected, rtol=1e-12)
    with pytest.raises(ValueError, match="offset of 40 nm is too large for the wavelength 120 nm"):
        simulate("1.5", {"wavelength_offset": 40.0}, 0.0, 0.12)


def test_fits_find_the_offset_of_the_wavelengths():
    um, noise = np.linspace(0.45, 0.6, 16), np.random.default_rng(4).standard_normal((3, 16))
    true, name = np.array([-1.0, 0.5, 1.5]), "wavelength_offset"
    R = [simulate("gold", {name: x}, 0.0, um) for x in true] + 1e-3 * noise
    asked = {"sample": "gold", "errors": "stated"}
    many = fit_many(0.0, um, R=R, sigma=1e-3, free=name, **asked).parameters[name]
    assert (np.abs(many.value - true) < 4.0 * many.sigma).all() and many.unit == "nm"
    m = Measurement.from_columns(0.0, um, R=R[2], sigma=1e-3)
    found = fit(m, priors={name: (0.0, 0.05)}, **asked)
    # Two independent values of one number: their mean, weighted by the squares of the errors.
    data, prior = many.sigma[2] ** -2, 0.05**-2
    np.testing.assert_allclose(
        found.parameters[name].value, many.value[2] * data / (data + prior), rtol=0.03
    )
    assert "by_the_model_alone" not in {w.code for w in found.warnings}  # gold's index is known
