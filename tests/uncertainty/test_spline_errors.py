"""The bands of a free-form index, and how many splines it has."""

import numpy as np
import pytest
from scipy.interpolate import BSpline

from fitting import Measurement, Sample, fit
from fitting.samples.dispersion import every_second_left_out, knots_over, usual_terms
from tests.truth import random_edges


def spline(knots, amplitudes, x):
    """The same by scipy, with further knots so that its range is all of these."""
    knots = np.array(knots)
    out = np.arange(1.0, 4.0)
    padded = np.concatenate([knots[0] - out[::-1], knots, knots[-1] + out])
    return BSpline(padded, np.pad(amplitudes, 3), 3)(x)


@pytest.mark.parametrize("terms", [5, 9, 24, 25, 48])
def test_splines_on_half_of_the_knots_are_sums_of_all(terms):
    knots = knots_over(terms, 1.2, 5.5)
    sums = every_second_left_out(terms, knots)
    fewer = sums.shape[1]
    assert fewer <= 0.5 * terms + 2
    left_out = terms - fewer
    even = np.array(knots[: terms - min(4, terms // 4) + 4])
    kept = np.delete(np.array(knots), np.arange(len(even) - 2, 0, -2)[:left_out])
    amplitudes = np.random.default_rng(terms).random(fewer)
    x = np.linspace(knots[0], knots[-1], 400)
    np.testing.assert_allclose(
        spline(knots, sums @ amplitudes, x), spline(kept, amplitudes, x), atol=1e-14
    )


def test_so_few_splines_that_none_can_be_left_out():
    np.testing.assert_array_equal(every_second_left_out(2, knots_over(2, 1.2, 5.5)), np.eye(2))


def test_a_spline_for_each_wavelength_where_the_text_has_no_number():
    waves = np.repeat(np.linspace(0.3, 0.9, 31), 2)
    m = Measurement.from_columns(np.tile([60.0, 70.0], 31), waves, R=np.full(62, 0.3))
    found = Sample.parse("air | kk-spline 80 nm | 1.5").with_splines(m.wavelength_um)
    assert str(found) == "air | kk-spline:31 80 nm | 1.5"
    said = Sample.parse("air | kk-spline:12 80 nm | 1.5")
    assert said.with_splines(m.wavelength_um) == said
    # one datum at each wavelength, few wavelengths, many
    assert [usual_terms(*x) for x in [(40, 40), (10, 40), (500, 1000)]] == [24, 24, 48]


@pytest.mark.study
def test_the_bands_hold_the_index_beside_an_absorption_edge():
    """Of k within .1 eV above the gap 4 % lay in the 95 % bands of 24 splines."""
    random = np.random.default_rng(20261123)
    beside = []
    for _ in range(12):
        truth = random_edges.truth_of(random)
        found = random_edges.fitted(truth, random_edges.measured(truth, random), "kk-spline")
        assert str(found.sample) == "kk-spline:40"
        above, off, sigma = random_edges.off_of(found, truth)
        # 0 counts as known nowhere
        assert (sigma > 0.0).all()
        beside.append(np.abs(off[:, (above > -0.1) & (above < 0.25)]) < 1.96)
    assert np.concatenate(beside, 1).mean() > 0.9


def film(count):
    """Return the film of that number of a random stream, and what was measured."""
    random = np.random.default_rng(31337)
    for _ in range(count):
        truth = random_edges.truth_of(random, film=True)
        m = random_edges.measured(truth, random)
    return truth, m


@pytest.mark.study
def test_the_interval_of_the_thickness_of_a_free_form_film_holds_the_truth():
    """It is 2.6 standard errors off with the errors that amplitudes above 0 give."""
    truth, m = film(42)
    found = random_edges.fitted(truth, m, "kk-spline")
    thickness = found.parameters["thickness_nm"]
    assert thickness.interval[0] < truth.thickness_nm < thickness.interval[1]
    assert 0.1 < thickness.sigma < 0.3


@pytest.mark.study
def test_the_thickness_of_a_free_form_film_has_the_error_of_the_curves():
    truth, m = film(1)
    m = m.where(np.isin(m.wavelength_um, np.unique(m.wavelength_um)[::3]))
    found = fit(m, truth.sample.format("kk-spline:6"), errors="stated", intervals="quadratic",
                starts=4, start={"thickness_nm": truth.thickness_nm})  # fmt: skip
    thickness = found.parameters["thickness_nm"]
    curves = found.evaluator
    which = curves.unknowns.spec.moving.index("film.thickness_nm")
    np.testing.assert_allclose(thickness.sigma, np.sqrt(curves.covariance[which, which]))
    plain = thickness.value + 1.96 * thickness.sigma * np.array([-1.0, 1.0])
    np.testing.assert_allclose(thickness.interval, plain, rtol=1e-4)
