"""One fit of many, predictions where nothing was measured, intervals at bounds."""

import json

import numpy as np
import pytest

from fitting import Measurement, choose, fit, fit_many, simulate

pytestmark = pytest.mark.slow

ANGLES = np.linspace(10.0, 80.0, 8)
WAVES = [0.5, 0.6, 0.7]


@pytest.fixture(scope="module")
def spectrum():
    """A bare surface at three wavelengths, eta and k free at each."""
    angle, wave = np.tile(ANGLES, 3), np.repeat(WAVES, 8)
    noise = 1e-3 * np.random.default_rng(3).standard_normal(24)
    R_s = simulate("1.5+0.1i", {}, angle, wave, "R_s") + noise
    return fit(Measurement.from_columns(angle, wave, R_s=R_s, sigma=1e-3))


def test_one_fit_is_picked_from_either_end(spectrum):
    last = spectrum[-1]
    assert (last.wavelength_um, last.eta) == (0.7, spectrum.eta[2])
    np.testing.assert_array_equal(last.index().eta, [spectrum.eta[2]])
    np.testing.assert_array_equal(last.predict().value, spectrum.predict().value[16:])
    with pytest.raises(IndexError, match="out of range"):
        spectrum[3]
    for strange in (slice(0, 2), [0, 1], 1.0, "eta"):
        with pytest.raises(
            TypeError, match="one whole number for each axis of the batch was wanted"
        ):
            spectrum[strange]


def test_warnings_of_one_curve_say_which_it_is():
    R_s = simulate("1.5", {}, ANGLES, 0.5, "R_s")
    found = fit_many(ANGLES, R_s=np.stack([R_s, np.clip(R_s + 0.2, 0.0, 1.0)]))
    some = [i for i in range(2) if found.warnings[i]]
    assert some
    for i in some:
        assert found[i].warnings == found.warnings[i]
        assert found[i].warnings[0].where == {"curve": (i,)}


def test_nothing_is_predicted_at_wavelengths_that_were_not_measured(spectrum):
    own = Measurement.from_columns([30.0], [0.55], R_s=[0.1])
    for ask in (
        lambda: spectrum.predict([30.0, 30.0], "R", [0.5, 0.55]),
        lambda: spectrum.predict(own),
        lambda: spectrum[1].predict(30.0, "R", 0.55),
    ):
        with pytest.raises(ValueError, match=r"0\.55 um \(measured: 0\.[56]"):
            ask()
    # 500 nm is 0.5 um, whatever the last bit of the conversion.
    near = np.nextafter(0.5, 1.0)
    assert spectrum.predict(30.0, "R", [near]).value == spectrum[0].predict(30.0, "R").value


def test_a_plate_is_predicted_at_angles_at_each_of_its_wavelengths():
    """It was said that its wavelengths are not known."""
    sample, wave = "air | 1.5+0.000001i 1 mm thick | air", np.array(WAVES)
    seen = {q: simulate(sample, {}, 8.0, wave, q) for q in ("R", "T")}
    m = Measurement.from_columns(8.0, wave, sigma=1e-4, **seen)
    found = fit(m, "air | free 1 mm thick | air", intervals="quadratic")
    expected = [simulate(sample, {}, [20.0, 60.0], w, "T") for w in WAVES]
    np.testing.assert_allclose(found.predict([20.0, 60.0], "T").value, expected, rtol=1e-6)


def test_nothing_is_known_of_a_free_index_at_other_wavelengths_than_its_own():
    """One wavelength of psi and Delta: the index of .5 um was given at every other one, too."""
    seen = {q: simulate("1.5+0.1i", {}, ANGLES, 0.5, q) for q in ("psi", "delta")}
    found = fit(Measurement.from_columns(ANGLES, 0.5, sigma=0.1, **seen))
    assert found.predict(30.0, "R", 0.5).value == pytest.approx(
        simulate("1.5+0.1i", {}, 30.0, 0.5, "R")
    )
    with pytest.raises(ValueError, match=r"0\.7 um \(measured: 0\.5 um\)"):
        found.predict(30.0, "R", 0.7)
    np.testing.assert_allclose(found.index([0.5, 0.5]).eta, 1.5)
    with pytest.raises(ValueError, match=r"0\.7 um was not measured"):
        found.index(0.7)


@pytest.mark.study
def test_predictions_for_a_file_have_the_scale_of_that_file():
    sample, truth = "air | cauchy:2 100 nm held | Si", {"A": 1.8, "B": 0.005}
    wave = np.linspace(0.4, 0.8, 20)
    R = simulate(sample, truth, 10.0, wave, "R")
    files = [
        Measurement.from_columns(10.0, wave, R=scale * R, sigma=1e-3, source=name)
        for name, scale in (("a.csv", 0.9), ("b.csv", 1.05))
    ]
    found = fit(files, sample, free="scale", fixed={"A": 1.8}, intervals="quadratic")
    for m in files:
        np.testing.assert_allclose(found.predict(m).value, m.value, rtol=1e-9)
    np.testing.assert_array_equal(found.predict(found.measurement).value, found.predict().value)


def test_a_reference_is_shown_at_one_wavelength_too(spectrum):
    one = spectrum[0]
    with pytest.raises(ValueError, match="unobtainium"):
        one.plot("unobtainium")
    assert "gold: at 0.5 um eta" in one.plot("gold")._supxlabel.get_text()


@pytest.mark.parametrize("error", [0.01, 3.0])
def test_a_free_film_is_one_of_its_wavelengths_with_the_shared_thickness(error):
    """error: of psi and Delta in degrees; with the large one the thickness is not determined."""
    angle, wave = np.tile([60.0, 70.0], 3), np.repeat(WAVES, 2)
    random = np.random.default_rng(5)
    seen = {
        q: simulate("air | 1.8+0.2i 20 nm held | Si", {}, angle, wave, q)
        + error * random.standard_normal(6)
        for q in ("psi", "delta")
    }
    m = Measurement.from_columns(angle, wave, sigma=error, **seen)
    found = fit(m, "air | free 5..50 nm | Si", errors="stated", intervals="quadratic")
    thickness = found.parameters["thickness_nm"]
    assert (found.names, thickness.status) == (("eta", "k"), "shared")
    assert np.isnan(thickness.sigma) == (error == 3.0)
    table = str(found)
    assert "()" not in table
    assert "shared by all wavelengths" in table
    eta = found.parameters["eta"]
    # The errors of the index are the same wherever they are shown.
    np.testing.assert_allclose(np.sqrt(found.covariance[:, 0, 0]), eta.sigma)
    np.testing.assert_array_equal(found.index().sigma_eta, eta.sigma)
    assert (eta.interval[:, 0] >= 0.0).all()
    if error == 0.01:
        assert 5.0 <= thickness.interval[0] < thickness.interval[1] <= 50.0
    for i, one in enumerate(found):
        assert one.parameters["thickness_nm"].value == thickness.value
        np.testing.assert_array_equal(one.index().sigma_eta, eta.sigma[i])
        assert "thickness_nm" in str(one)
        json.dumps(one.to_dict(), allow_nan=False)


@pytest.mark.study
def test_errors_widened_for_residuals_in_order_stay_within_bounds_and_reach_what_is_tied():
    wave = np.linspace(0.4, 0.9, 24)
    wiggle = 2e-3 * np.sin(40.0 * wave)
    R = simulate("air | 1.46 110 nm held | 1.9", {}, 10.0, wave, "R") + wiggle
    m = Measurement.from_columns(10.0, wave, R=R, sigma=1e-3)
    found = fit(
        m, "air | constant 110 nm held | constant", fixed={"film.k": 0.0},
        bounds={"film.eta": (1.455, 1.6)}, tie={"substrate.eta": "1.3 * film.eta"},
    )  # fmt: skip
    assert found.errors.widened > 1.0
    film, substrate = found.parameters["film.eta"], found.parameters["substrate.eta"]
    assert 1.455 <= film.interval[0] < film.interval[1] <= 1.6
    assert substrate.sigma == pytest.approx(1.3 * film.sigma)
    np.testing.assert_allclose(substrate.interval, 1.3 * film.interval)
    # The warnings tell the same intervals and shares as the table.
    told = {w.code: w.values for w in found.warnings}
    np.testing.assert_array_equal(told["not_quadratic"]["intervals"], [film.interval])
    k = found.parameters["substrate.k"]
    assert told["poorly_determined"]["shares"] == pytest.approx([k.sigma / k.value], rel=0.1)


@pytest.mark.study
def test_what_choose_takes_is_what_fit_makes_of_it():
    """With quadratic intervals its errors were those before they are widened, 6 times as small."""
    wave = np.linspace(0.4, 0.9, 40)
    R = simulate("air | 1.7 100 nm held | 1.5", {}, 10.0, wave, "R") + 3e-3 * np.sin(25.0 * wave)
    film = Measurement.from_columns(10.0, wave, R=R, sigma=1e-3)
    samples = [f"air | constant 80..120 nm | {substrate}" for substrate in ("1.5", "SiO2")]
    angle = np.linspace(5.0, 80.0, 30)
    R_s = simulate("1.5", {}, angle, 0.5, "R_s") + 3e-3 * np.sin(0.2 * angle)
    surface = Measurement.from_columns(angle, 0.5, R_s=R_s, sigma=1e-3)
    for m, sample in ((film, samples), (surface, "auto")):
        choice = choose(m, sample, intervals="quadratic")
        key = choice.taken.key
        assert not key.free
        held = {"k": 0.0} if key.without_k else None
        again = fit(m, key.model, fixed=held, intervals="quadratic")
        assert again.errors.widened > 1.0 and again.errors.taken == "scaled"
        # The table once divided by the second factor a number that was without it.
        root = np.sqrt(again.chi2_reduced)
        assert again.errors.factor == pytest.approx(again.errors.widened * root)
        assert f"sqrt(chi2/dof) = {root:.3g}; multiplied by" in " ".join(str(again).split())
        assert choice.fit.errors.widened == pytest.approx(again.errors.widened)
        for name, e in again.parameters.items():
            sigma = choice.fit.parameters[name].sigma
            np.testing.assert_allclose(sigma, e.sigma, rtol=1e-6)
