"""An index that is free at every wavelength: of films, and of one thickness for all of them."""

import numpy as np
import pytest

from fitting import Measurement, fit, simulate
from fitting.free_films import _error, _others, _Profile, check_free_film
from fitting.samples.parameters import Settings
from fitting.samples.sample import Sample
from tests.truth.random_free_films import simulated

pytestmark = pytest.mark.slow

STUDY = pytest.mark.study


def test_the_error_of_a_thickness_is_that_of_its_own_valley():
    """A second valley, at 180 nm and 2 of chi2 higher, had made a standard error of 36 nm of 1."""
    thickness = np.linspace(100.0, 200.0, 201)
    cost = np.minimum((thickness - 130.0) ** 2, (thickness - 180.0) ** 2 + 2.0)
    p = _Profile(thickness, cost, 1.0, 0, np.zeros((2, 201, 1)))
    assert _error(p) == pytest.approx(1.0)
    assert _others(p) == ((180.0, 2.0),)


def transparent(seed):
    """psi and Delta of 150 nm on silicon at three angles, as anyone would measure them."""
    random = np.random.default_rng(seed)
    wave, angle = (a.ravel() for a in np.meshgrid(np.linspace(0.4, 0.9, 30), [55.0, 65.0, 75.0]))
    sigma, truth = {"psi": 0.05, "delta": 0.1}, {"A": 2.0, "B": 0.01, "thickness_nm": 150.0}
    noise = {q: sigma[q] * random.standard_normal(len(wave)) for q in sigma}
    clean = {q: simulate("air | cauchy:2 150 nm | Si", truth, angle, wave, q) for q in sigma}
    return Measurement.from_columns(
        angle, wave, sigma=sigma, **{q: clean[q] + noise[q] for q in sigma}
    )


@pytest.mark.study
@pytest.mark.parametrize("seed", [0, *(pytest.param(s, marks=STUDY) for s in (2, 6, 7))])
def test_a_transparent_film_is_not_found_too_thick(seed):
    """With k >= 0 at every wavelength these intervals began above 150 nm."""
    found = fit(transparent(seed), "air | free 100..250 nm | Si")
    low, high = found.parameters["thickness_nm"].interval
    assert low < 150.0 < high and high - low < 1.0
    assert (found.k >= 0.0).all()


@pytest.mark.study
@pytest.mark.parametrize("seed", [4, pytest.param(9, marks=STUDY)])
def test_a_film_that_noise_makes_too_thin_is_still_described_with_k_above_zero(seed):
    """Such a thickness, by 1.6 standard errors, had a chi2 of 211 for 120 and a warning of it."""
    found = fit(transparent(seed), "air | free 100..250 nm | Si")
    thickness = found.parameters["thickness_nm"]
    assert thickness.interval[0] < 150.0 < thickness.interval[1]
    assert abs(thickness.value - 150.0) < 1.96 * thickness.sigma
    assert not any(f.code == "chi2_large" for f in found.findings)
    assert found.chi2.sum() < found.dof.sum() + 3.0 * np.sqrt(2.0 * found.dof.sum())
    assert (found.k >= 0.0).all()


@pytest.mark.parametrize("sample, settings, message", [
    # The thickness had become that of the scan, beside eta and k of the fixed one.
    ("free 100..250 nm", {"fixed": {"thickness_nm": 150.0}}, "says what is known"),
    ("free 100..250 nm", {"bounds": {"film.thickness_nm": (140.0, 160.0)}}, "says what is known"),
    ("free 100..250 nm", {"priors": {"thickness_nm": (150.0, 1.0)}}, "says what is known"),
    ("1.5 5 nm held | free 100..250 nm", {"tie": {"film_2.thickness_nm": "film_1.thickness_nm"}},
     "known of film_2.thickness_nm"),
    # Every wavelength had got an offset of its own.
    ("free 100..250 nm", {"free": "angle_offset"}, "one value for all wavelengths"),
    # The prior had outweighed the data, and the loss had been that of squares.
    ("free 100..250 nm", {"priors": {"k": (0.0, 0.1)}, "errors": "equal"}, "a prior needs"),
    ("free 100..250 nm", {"loss": "huber", "errors": "equal"}, "'huber' needs"),
])  # fmt: skip
def test_settings_that_a_shared_thickness_cannot_follow_are_refused(sample, settings, message):
    with pytest.raises(ValueError, match=message):
        fit(transparent(0), f"air | {sample} | Si", **settings)


@pytest.mark.study
@pytest.mark.parametrize("seed", [77002])
def test_the_valley_of_the_true_thickness_is_narrow(seed):
    """The wavelengths are told apart between two steps of the first scan: 268 nm for 259."""
    case = simulated(seed)
    found = fit(case.measurement, case.sample)
    low, high = found.parameters["thickness_nm"].interval
    assert low < case.thickness_nm < high and high - low < 0.05 * case.thickness_nm


def test_a_narrow_minimum_is_found_from_the_wavelength_beside_it():
    """Of 36 wavelengths of a film on silver 15 had ended with chi2 of hundreds and thousands."""
    random = np.random.default_rng(0)
    wave, angle = (a.ravel() for a in np.meshgrid(np.linspace(0.4, 0.9, 36), [55.0, 65.0, 75.0]))
    truth, sigma = {"A": 1.814, "B": 7e-4}, {"psi": 0.028, "delta": 0.056}
    clean = {
        q: simulate("air | cauchy:2 261.744 nm held | Ag", truth, angle, wave, q) for q in sigma
    }
    seen = {q: clean[q] + sigma[q] * random.standard_normal(len(wave)) for q in sigma}
    m = Measurement.from_columns(angle, wave, sigma=sigma, **seen)
    found = fit(m, "air | free 261.744 nm held | Ag", errors="stated")
    assert found.chi2.sum() / found.dof.sum() < 1.5
    np.testing.assert_allclose(found.eta, 1.814 + 7e-4 / np.linspace(0.4, 0.9, 36) ** 2, atol=0.01)


def test_what_is_tied_to_an_index_follows_it_at_every_wavelength():
    """The k of the first wavelength had been that of all, in `k` and in each part."""
    found = fit(transparent(0), "air | free 150 nm held | Si", tie={"k": "0.001 * eta"})
    tied, eta = found.parameters["k"], found.parameters["eta"]
    np.testing.assert_allclose(found.k, 0.001 * found.eta)
    np.testing.assert_allclose(tied.sigma, 0.001 * eta.sigma)
    assert tied.status == "tied" and not tied.free
    assert found[7].k == pytest.approx(0.001 * found.eta[7])
    assert f"{1e-3 * found.eta[7]:.8g}" in str(found[7])


def three_wavelengths(sample, truth, columns):
    """Return values of a film at three wavelengths and angles, with noise of these sizes."""
    random = np.random.default_rng(3)
    wave, angle = (a.ravel() for a in np.meshgrid([0.5, 0.6, 0.7], [20.0, 55.0, 70.0]))
    seen = {
        q: simulate(sample, truth, angle, wave, q) + size * random.standard_normal(9)
        for q, size in columns.items()
    }
    return Measurement.from_columns(angle, wave, sigma=columns, **seen)


def test_how_many_data_a_thickness_needs_follows_from_what_is_unknown():
    """Two data at a wavelength had been too few for a film whose k is known."""
    m = transparent(0)
    two, one = (m.where(np.isin(m.angle_deg, a) & (m.quantity == "psi")) for a in ([55, 65], [55]))
    film = Sample.parse("air | free 100..250 nm | Si")
    check_free_film(two, film, 1, Settings(fixed={"k": 0.0}))
    check_free_film(two, film, 1, Settings(tie={"film.k": (0.001, "film.eta")}))
    with pytest.raises(ValueError, match="1 data at each wavelength .* with which eta can be"):
        check_free_film(one, film, 1, Settings(fixed={"k": 0.0}))
    with pytest.raises(ValueError, match="2 data at each wavelength .* eta and k can be"):
        check_free_film(two, film, 1, Settings())
    both = Sample.parse("air | free 100..250 nm | free")
    with pytest.raises(ValueError, match=r"film.eta and film.k and substrate.eta"):
        check_free_film(two, both, 1, Settings())


@pytest.mark.parametrize("settings", [
    {"fixed": {"k": 0.0}}, pytest.param({"tie": {"k": "0 * eta"}}, marks=STUDY),
])  # fmt: skip
def test_the_k_of_a_film_of_unknown_thickness_may_be_known(settings):
    """Three numbers of Cauchy's formula are the three indices: the same fit, and the same error."""
    truth = {"A": 2.0, "B": 0.01}
    m = three_wavelengths("air | cauchy:2 150 nm held | 3.9", truth, {"R_s": 0.001})
    found = fit(m, "air | free 120..180 nm | 3.9", errors="equal", **settings)
    cauchy = fit(m, "air | cauchy:3 120..180 nm | 3.9", errors="equal")
    d, same = (f.parameters["thickness_nm"] for f in (found, cauchy))
    # A k that is fixed at 0 had become free down to -.1.
    assert abs(d.value - same.value) < 0.05 * same.sigma
    assert d.sigma == pytest.approx(same.sigma, rel=0.05)
    np.testing.assert_allclose(found.index().sigma_eta, cauchy.index().sigma_eta, rtol=0.3)
    assert not np.any(found.k) and not np.any(found.index().sigma_k)


@pytest.mark.study
def test_a_film_of_unknown_thickness_below_another_one():
    """Its eta and k have the film in their names."""
    sample, sigma = "air | SiO2 8 nm held | 2.0 150 nm held | Si", {"psi": 0.01, "delta": 0.02}
    m = three_wavelengths(sample, {}, sigma)
    found = fit(m, "air | SiO2 8 nm held | free 100..250 nm | Si", errors="stated")
    d = found.parameters["film_2.thickness_nm"]
    assert abs(d.value - 150.0) < 3.0 * d.sigma
    index = found.index(medium="film_2")
    np.testing.assert_allclose(index.eta, 2.0, atol=0.01)
    np.testing.assert_array_equal(index.sigma_eta, found.parameters["film_2.eta"].sigma)


@pytest.mark.parametrize("count, others", [(2, 1), (5, 4), (20, 16)])
def test_starts_from_other_wavelengths_are_counted_once(count, others):
    """Of two wavelengths each had had eight further starts at its own solution, and eight alike."""
    random, wave = np.random.default_rng(0), np.repeat(np.linspace(0.5, 0.6, count), 3)
    angle, sigma = np.tile([55.0, 65.0, 75.0], count), {"psi": 1e-3, "delta": 1e-3}
    seen = {q: simulate("air | 1.9 150 nm held | Ag", {}, angle, wave, q) for q in sigma}
    # The errors are so small that nothing describes the data.
    seen["psi"] += 0.1 * random.standard_normal(len(wave))
    m = Measurement.from_columns(angle, wave, sigma=sigma, **seen)
    found = fit(m, "air | free 150 nm held | Ag")
    more = found.starts - 64
    assert more.min() >= others and more[0] == others
    assert (found.reached <= found.starts).all()


def test_each_wavelength_tells_its_own_number_of_starts():
    """Those that are tried again have more, and all had told the number of the first."""
    random, wave = np.random.default_rng(0), np.repeat(np.linspace(0.5, 0.6, 6), 3)
    angle, sigma = np.tile([55.0, 65.0, 75.0], 6), {"psi": 0.01, "delta": 0.02}
    sample = "air | free 150 nm held | Ag"
    seen = {
        q: simulate("air | 1.9 150 nm held | Ag", {}, angle, wave, q)
        + size * random.standard_normal(len(wave))
        for q, size in sigma.items()
    }
    seen["psi"][-3:] += [1.0, -1.0, 1.0]
    found = fit(Measurement.from_columns(angle, wave, sigma=sigma, **seen), sample)
    assert found.starts.tolist() == [64 + 5] * 6
    assert f"of {64 + 5} starting points" in str(found[5])


@pytest.mark.study
def test_the_error_that_follows_from_the_thickness_is_that_of_one_minimum():
    """Where another minimum is the lowest at another thickness, a difference of both is no error.

    The standard errors of eta had been .94 and 1.2 at two wavelengths, beside .01.
    """
    case = simulated(78000)
    waves = np.unique(case.measurement.wavelength_um)[::2]
    m = case.measurement.where(np.isin(case.measurement.wavelength_um, waves))
    found = fit(m, "air | free 39.02..243.9 nm | BK7")
    assert (found.parameters["eta"].sigma < 0.05).all()


def test_a_wrong_minimum_that_describes_the_data_is_left_for_a_lower_one():
    """Of six data at the last wavelength: 4.62 had chi2 7.6, and 1.955 has 2.3."""
    case = simulated(78008)
    waves = np.unique(case.measurement.wavelength_um)[::2]
    m = case.measurement.where(np.isin(case.measurement.wavelength_um, waves))
    found = fit(m, "air | free 142.802 nm held | silver")
    assert np.ptp(found.eta) < 0.1


@pytest.mark.study
def test_the_interval_of_the_thickness_is_that_of_a_scatter_of_few_degrees_of_freedom():
    """chi2 of 3 degrees of freedom is a tenth of that in some cases, and so is the variance."""
    waves, values = np.array([0.4, 0.55, 0.7, 0.9]), {"A": 1.8, "B": 0.01, "thickness_nm": 120.0}
    random, sigma = np.random.default_rng(3), {"psi": 0.05, "delta": 0.1, "R": 1e-3}
    angle = np.repeat([65.0, 0.0], 4)
    columns = {}
    for q, error in sigma.items():
        at = 0.0 if q == "R" else 65.0
        seen = simulate("air | cauchy:2 120 nm | Si", values, at, waves, q)
        seen = seen + error * random.standard_normal(4)
        columns[q] = np.where(angle == at, np.tile(seen, 2), np.nan)
    m = Measurement.from_columns(angle, np.tile(waves, 2), sigma=sigma, **columns)
    of_scatter, of_stated = (
        fit(m, "air | free 100..140 nm | Si", errors=e).parameters["thickness_nm"]
        for e in ("scaled", "stated")
    )
    for d, t in ((of_scatter, 3.182), (of_stated, 1.960)):
        np.testing.assert_allclose(d.interval, d.value + t * d.sigma * np.array([-1, 1]), rtol=1e-4)
