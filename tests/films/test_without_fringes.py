"""Fringes that are no larger than those of noise determine no thickness."""

from dataclasses import replace

import numpy as np
import pytest

from fitting import Measurement, fit, simulate
from fitting.searching.without_fringes import gain_by_chance

pytestmark = pytest.mark.slow

STUDY = pytest.mark.study
SAMPLE = "air | cauchy:2 5..4000 nm | BK7"
WAVELENGTHS = 1.0 / np.linspace(1.0 / 0.9, 1.0 / 0.45, 96)


@pytest.mark.parametrize("data", [64, 300])
def test_what_noise_gains_by_chance(data):
    """Against the largest gain of chi2 by any frequency in white noise, by Fourier transform."""
    random, draws, above = np.random.default_rng(data), 40_000, 0
    count = data / 2
    for _ in range(draws // 2000):
        noise = random.standard_normal((2000, data))
        # of the two parameters of a wave of any frequency, on a grid eight times as fine as theirs
        gain = 2.0 / data * np.abs(np.fft.rfft(noise, 8 * data)[:, 8:-8]) ** 2
        above += int((gain.max(1) > gain_by_chance(count)).sum())
    assert 0.0004 * draws < above < 0.0015 * draws


def _measured(thickness, seed, noise=1e-3):
    truth = {"A": 1.62, "B": 0.01, "thickness_nm": thickness}
    clean = simulate(f"air | cauchy:2 {thickness} nm | BK7", truth, 0.0, WAVELENGTHS, "R")
    noisy = clean + noise * np.random.default_rng(seed).standard_normal(len(clean))
    return Measurement.from_columns(0.0, WAVELENGTHS, sigma=noise, R=noisy)


def test_the_best_thickness_may_be_that_of_noise():
    """In this draw chi2 is 7 lower at 2.3 um. The film without fringes is shown, and holds 9 nm."""
    found = fit(_measured(9.0, 4), SAMPLE)
    told = [w for w in found.warnings if w.code == "fringes_in_noise"]
    low, high = found.parameters["thickness_nm"].interval
    assert low <= 9.0 <= high < 200.0
    assert len(told) == 1
    v = told[0].values
    assert 6.0 < v["delta_chi2"] < v["by_chance"]
    shown = found.parameters["thickness_nm"].value
    assert v["shown"] and v["without"] == pytest.approx(shown, rel=1e-12)
    assert "thickness_nm is not determined" in told[0].text
    lowest = found.alternatives[0]
    assert lowest.parameters["thickness_nm"].interval[0] > 2000.0
    assert lowest.delta_chi2 == pytest.approx(-v["delta_chi2"], rel=1e-6)
    assert v["fringed"] == pytest.approx(lowest.parameters["thickness_nm"].value, rel=1e-3)


@pytest.mark.study
def test_the_same_holds_where_a_common_error_is_added():
    """The fit with other weights begins from the minima of the first, and looks beside them too."""
    m = _measured(9.0, 4)
    small = replace(m, sigma=0.3 * m.sigma)
    found = fit(small, SAMPLE, errors="floor", intervals="quadratic")
    assert found.errors.taken == "floor"
    told = [w for w in found.warnings if w.code == "fringes_in_noise"]
    assert len(told) == 1 and found.parameters["thickness_nm"].value < 200.0
    assert found.alternatives[0].parameters["thickness_nm"].value > 2000.0


@pytest.mark.study
@pytest.mark.parametrize("seed", [1, *(pytest.param(s, marks=STUDY) for s in (3, 6))])
def test_no_other_solution_has_a_lower_chi2_than_the_first_of_the_others(seed):
    rises = [a.delta_chi2 for a in fit(_measured(20.0, seed), SAMPLE).alternatives]
    assert rises == sorted(rises)


@pytest.mark.parametrize("seed", [0, *(pytest.param(s, marks=STUDY) for s in (2, 5))])
def test_a_film_without_fringes_is_among_the_solutions(seed):
    assert _holds(fit(_measured(9.0, seed), SAMPLE), 9.0)


def _holds(found, thickness):
    ends = [f.parameters["thickness_nm"].interval for f in (found, *found.alternatives)]
    return any(low <= thickness <= high for low, high in ends)


def test_weak_fringes_are_fringes():
    """Some times the noise are enough, and the thickness is then the true one."""
    found = fit(_measured(3000.0, 6), SAMPLE)
    assert "fringes_in_noise" not in {w.code for w in found.warnings}
    low, high = found.parameters["thickness_nm"].interval
    assert low - 2.0 < 3000.0 < high + 2.0


@pytest.mark.study
def test_a_range_that_excludes_films_without_fringes():
    found = fit(_measured(9.0, 4), "air | cauchy:2 4000..20000 nm | BK7")
    assert "fringes_in_noise" not in {w.code for w in found.warnings}


def _oxide():
    """300 nm of silica on silicon: R from .09 to .44, with errors of .002."""
    wave = np.linspace(0.4, 0.9, 60)
    clean = simulate("air | SiO2 300 nm | Si", {}, 0.0, wave, "R")
    noisy = clean + 2e-3 * np.random.default_rng(1).standard_normal(len(wave))
    return Measurement.from_columns(0.0, wave, R=noisy)


@pytest.mark.study
def test_a_thinner_film_of_higher_index_has_the_same_fringes():
    """162 nm of index 2.65 are less than a fringe with the index 1.46 only, not with their own."""
    found = fit(_oxide(), "air | cauchy 50..1000 nm | Si")
    codes = {w.code for w in found.warnings}
    assert "fringes_in_noise" not in codes
    assert "other_minima" in codes
    assert _holds(found, 300.0)


def test_no_more_starts_reach_a_minimum_than_there_are():
    """Also where all starts do, and those that were tried beside the minimum."""
    found = fit(_oxide(), "air | 1.45 100..500 nm | Si")
    assert 0 < found.reached <= found.starts
