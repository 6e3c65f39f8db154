"""What one search leaves for another one of the same data."""

import numpy as np
import pytest

from fitting import Measurement, Sample, fit, simulate
from fitting.fits import fit_checked
from fitting.problem.lanes import LANES
from fitting.problem.problem import FitOptions, Kept
from fitting.samples.parameters import Settings
from fitting.searching import search
from fitting.searching.search import grown_starts
from fitting.searching.starts import start_at
from fitting.searching.starts import starts as start_points
from fitting.wavelengths import problem_of

SAMPLE = "air | {} 50..800 nm | 1.53"
TRUTH = {"eps_inf": 2.0, "strength_ev2_1": 40.0, "resonance_ev_1": 6.0, "width_ev_1": 0.5,
         "strength_ev2_2": 0.6, "resonance_ev_2": 2.2, "width_ev_2": 0.3,
         "thickness_nm": 310.0}  # fmt: skip
WAVES = np.linspace(0.42, 0.8, 45)


@pytest.fixture
def counted(monkeypatch):
    """The number of starts of every search."""
    counts, solved = [], search.solved

    def watched(few, start):
        counts.append(start.shape[1])
        return solved(few, start)

    monkeypatch.setattr(search, "solved", watched)
    return counts


def measurement(noise):
    shown = simulate(SAMPLE.format("lorentz:2"), TRUTH, 0.0, WAVES, "R")
    shown = shown + noise * np.random.default_rng(5).standard_normal(len(WAVES))
    return Measurement.from_columns(0.0, WAVES, R=shown, sigma=1e-4)


@pytest.mark.study
def test_a_fit_with_other_weights_begins_from_the_minima_of_the_first(counted):
    m = measurement(1e-3)
    found = fit(m, SAMPLE.format("lorentz:2"), errors="floor", intervals="quadratic")
    first, *others = counted
    assert others and max(others) < first / 3
    sigma = np.hypot(1e-4, found.errors.added)
    again = Measurement.from_columns(0.0, WAVES, R=m.value, sigma=sigma)
    alone = fit(again, SAMPLE.format("lorentz:2"), errors="scaled", intervals="quadratic")
    for name in found.names:
        ours, theirs = found.parameters[name], alone.parameters[name]
        assert abs(ours.value - theirs.value) < 1e-2 * theirs.sigma


@pytest.mark.study
def test_a_parameter_of_the_instrument_is_added_at_the_minima_without_it(counted):
    m, kept = measurement(1e-3), Kept({}, {})
    which = Sample.parse(SAMPLE.format("lorentz:2"))
    without = fit_checked([m], which, Settings(), FitOptions("scaled", "quadratic", kept=kept))
    asked = FitOptions("scaled", "quadratic", kept=kept, near="", kept_as="scale", thorough=False)
    found = fit_checked([m], which, Settings(free=("scale",)), asked)
    assert counted[1] < counted[0] / 3
    assert found.chi2 <= without.chi2


def test_a_parameter_of_the_instrument_begins_where_it_was_fixed():
    which, settings = Sample.parse(SAMPLE.format("lorentz:2")), Settings(free=("scale",))
    job = problem_of([measurement(1e-3)], which, settings, FitOptions(near="without"))
    free = [name for name in job.u.spec.moving if name != "scale_0"]
    known = {name: np.arange(8.0) for name in free}
    near = search._near(job, Kept({}, {"without": known}))
    assert near is not None
    row = job.u.spec.moving.index("scale_0")
    np.testing.assert_array_equal(near[row], 0.0)  # log 1


def test_a_search_that_was_made_is_not_repeated(counted):
    m, which = measurement(1e-3), Sample.parse(SAMPLE.format("lorentz:1"))
    asked = FitOptions("scaled", "quadratic", kept=Kept({}, {}), thorough=False)
    first = fit_checked([m], which, Settings(), asked)
    thorough = fit_checked([m], which, Settings(), asked._replace(thorough=True))
    fit_checked([m], which, Settings(), asked._replace(thorough=True, intervals="profile"))
    assert len(counted) == 1
    assert thorough.chi2 <= first.chi2 * (1.0 + 1e-9)


def test_of_a_candidate_that_is_only_compared_fewer_further_starts_are_followed(monkeypatch):
    followed, counts = search.followed, []

    def counted(fit, start, noise, best):
        counts[-1].append(start.shape[1])
        return followed(fit, start, noise, best)

    monkeypatch.setattr(search, "followed", counted)
    m, which = measurement(1e-3), Sample.parse(SAMPLE.format("lorentz:1"))
    for thorough in (False, True):
        counts.append([])
        fit_checked([m], which, Settings(), FitOptions("scaled", "quadratic", thorough=thorough))
    assert max(counts[0]) == LANES < max(counts[1])


def test_proposals_are_made_once_of_each_minimum(monkeypatch):
    """From the same minimum the same starts would lead to the same ends."""
    parents = []

    def recorded(fit, of):
        parents.append(of.new)
        return []

    monkeypatch.setattr(search, "PROPOSALS", (recorded, *search.PROPOSALS))
    m, which = measurement(1e-3), Sample.parse(SAMPLE.format("lorentz:1"))
    fit_checked([m], which, Settings(), FitOptions("scaled", "quadratic"))
    assert len(parents) > 1 and parents[0].shape[1] > 0
    every = np.concatenate(parents, 1)
    assert np.unique(every, axis=1).shape == every.shape


def test_a_term_is_added_to_the_minima_of_the_model_with_a_term_less(monkeypatch):
    m = measurement(0.0)
    job = problem_of([m], Sample.parse(SAMPLE.format("lorentz:2")), Settings(), FitOptions())
    names = list(job.u.spec.moving)
    one = {f"film.{name}": value for name, value in TRUTH.items() if not name.endswith("_2")}
    job.fewer = np.repeat(start_at(job.u.moving, one)[:, None], 8, 1)
    monkeypatch.setattr(job, "held", None)  # nothing is grown
    grown = grown_starts(job, start_points(job.u.moving, 4 * LANES, 0), 1.0)
    assert grown.shape == (len(names), 2 * LANES)
    for name in one:
        row = names.index(name)
        np.testing.assert_array_equal(grown[row], job.fewer[row, 0])
    # the first pool has the line that is missing
    placed = np.exp(grown[names.index("film.resonance_ev_2"), :LANES])
    assert np.abs(placed - TRUTH["resonance_ev_2"]).min() < 0.1
    strength = grown[names.index("film.strength_ev2_2"), :LANES]
    assert strength[np.argmin(np.abs(placed - 2.2))] > job.limits[0][names.index(
        "film.strength_ev2_2")] + 5.0  # fmt: skip
