"""Other minima of a model fit: their errors, and which one is shown."""

from types import SimpleNamespace

import numpy as np
import pytest

from fitting import Measurement, fit, simulate
from fitting.outcomes import of_fit
from fitting.problem.lanes import STAGE
from fitting.problem.problem import Problem
from fitting.uncertainty import profile
from fresnel_jax.dispersion import HC_EV_UM
from tests.estimates import codes, intervals, sigmas, values
from tests.truth.profiles import constant, measured, residuals


def test_second_solutions_have_errors_of_their_own():
    """R_p at two angles fits two materials; the other's errors by differences of the textbook's R
    there."""
    m = measured(constant, (1.7, 0.3), [60.0, 75.0], [0.6, 0.6, 0.6], 1e-3, 2, ("R_p",))
    found = fit(m, "constant", errors="stated")
    other = found.alternatives[0].parameters
    at, of = np.array([other[n].value for n in found.names]), residuals(m, constant)
    slopes = [(of(at + h) - of(at - h)) / 2e-6 for h in 1e-6 * np.eye(2)]
    covariance = np.linalg.inv(np.array(slopes) @ np.array(slopes).T)
    sigmas = [other[n].sigma for n in found.names]
    np.testing.assert_allclose(sigmas, np.sqrt(np.diag(covariance)), rtol=1e-4)
    assert {e.interval_kind for e in other.values()} <= {"quadratic", "profile"}
    for estimate in other.values():
        low, high = estimate.interval
        assert low < estimate.value < high
    text = " ".join(str(found).split()).partition("also fits")[2].partition("chi2")[0]
    assert text.count("+-") + text.count(" to ") == 2  # each with its error or its interval


ONE_LINE = {"eps_inf": 2.0, "strength_ev2_1": 6.0, "resonance_ev_1": 2.3, "width_ev_1": 0.5}


def hidden_line():
    """Return a spectrum of one oscillator, of whose fit two starts end in a wrong minimum."""
    angle, wavelength = (
        a.ravel() for a in np.meshgrid([45.0, 65.0, 75.0], np.linspace(0.4, 0.9, 14))
    )
    random = np.random.default_rng(2)
    columns = {
        q: simulate("lorentz", ONE_LINE, angle, wavelength, q) + 1e-3 * random.standard_normal(42)
        for q in ("R_s", "R_p")
    }
    return Measurement.from_columns(angle, wavelength, sigma=1e-3, **columns)


def test_a_lower_minimum_on_the_way_is_taken():
    """Two starts end in a wrong minimum; on the way to the ends of its intervals is the best."""
    found = fit(hidden_line(), "lorentz", starts=2, seed=4)  # that they do, the next test sees
    assert found.chi2_reduced < 1.5
    true = [ONE_LINE[name] for name in found.names]
    assert (np.abs(values(found) - true) < 4.5 * sigmas(found)).all()


def test_intervals_are_completed_where_the_lower_place_is_no_minimum(monkeypatch):
    """The search for them stops there, and goes on if the solver does not come to rest."""
    held, of_minima = Problem.held, of_fit.ranges_of

    def restless(self, start, noise, steps, *others, **more):
        ends = held(self, start, noise, steps, *others, **more)
        # of a place that was met, not of the starts
        return ends._replace(done=ends.done & ((steps != STAGE) | (start.shape[1] > 1)))

    monkeypatch.setattr(Problem, "held", restless)
    found = fit(hidden_line(), "lorentz", starts=2, seed=4)
    assert found.chi2_reduced > 1e3 and codes(found)[0] == "better_minimum_met"
    assert found.status == "not converged"
    monkeypatch.setattr(of_fit, "ranges_of", lambda *args: of_minima(*args[:7]))
    whole = fit(hidden_line(), "lorentz", starts=2, seed=4)
    np.testing.assert_array_equal(intervals(found), intervals(whole))


@pytest.mark.parametrize("enough, rounds", [(4.5, 1), (3.5, 7)])
def test_the_search_for_intervals_ends_where_a_lower_minimum_is_met(enough, rounds, monkeypatch):
    """The intervals of the higher one are not needed."""
    base = profile.Base(0, np.zeros(2), 5.0, np.eye(2), -np.ones(2), np.ones(2), 1.0, [], [])
    visited = []

    def met_a_lower_one(at, searches):
        visited.append(searches)
        base.lower.append((4.0, base.y))

    monkeypatch.setattr(profile, "visit", met_a_lower_one)
    search = profile.Search(base, 0, 1.0, [0.1])
    profile.follow(SimpleNamespace(count=64), [search], 7, enough)  # type: ignore
    assert len(visited) == rounds


def test_the_shown_minimum_need_not_be_the_lowest_one():
    """Near index match both n and 1 / n fit; n > 1 is shown, though 1 / n is .55 of chi2 lower.

    Scipy's minima of chi2 over n, with k = 0, are 4.50926 and 3.95625.
    """
    R = [0.0380, 0.0289, 0.0236, 0.0226, 0.0394, 0.0498]
    m = Measurement.from_columns(np.arange(40.0, 46.0), R_s=R, sigma=0.01)
    found = fit(m, "constant", fixed={"k": 0.0})
    assert found.parameters["eta"].value > 1.0
    (other,) = found.alternatives
    assert other.parameters["eta"].value < 1.0
    assert other.delta_chi2 == pytest.approx(3.95625 - 4.50926, abs=1e-4)
    assert "0.55" in str(found)


@pytest.mark.study
def test_no_line_is_narrower_than_the_distance_of_two_data():
    """It would take up the noise of one of them: .0015 eV in place of a step of .020 eV."""
    random, wave = np.random.default_rng(2), np.linspace(0.4, 0.8, 40)
    noisy = 0.04 + 1e-3 * random.standard_normal(40)
    m = Measurement.from_columns(0.0, wave, R=noisy, sigma={"R": 1e-3})
    found = fit(m, "lorentz", intervals="quadratic")
    step = np.diff(HC_EV_UM / wave[::-1]).min()
    for solution in (found, *found.alternatives):
        assert solution.parameters["width_ev_1"].value >= step * (1.0 - 1e-6)
