"""A search with some of the wavelengths, or thin averages, ends where one with all does."""

import numpy as np
import pytest

from fitting import Measurement, Sample, fit, fits, simulate
from fitting.problem.lanes import Ends, best_of
from fitting.problem.problem import FitOptions
from fitting.samples.parameters import Settings
from fitting.searching.fewer_rows import FOLLOWED, followed_with_all
from fitting.searching.film_starts import films_of, thickness_um
from fitting.searching.starts import start_at
from fitting.wavelengths import problem_of
from tests.estimates import codes

SAMPLE = "air | cauchy:2 50..1200 nm | 1.53"
TRUTH = {"A": 2.29, "B": 0.0158, "thickness_nm": 620.0}


def measurement(count: int, noise: float) -> Measurement:
    waves = np.linspace(0.42, 0.8, count)
    shown = simulate("air | cauchy:2 100 nm | 1.53", TRUTH, 0.0, waves, "R")
    shown = shown + noise * np.random.default_rng(3).standard_normal(count)
    return Measurement.from_columns(np.zeros(count), waves, R=shown)


@pytest.mark.parametrize("noise", [2e-3, pytest.param(0.0, marks=pytest.mark.study)])
def test_the_minimum_of_all_data(noise, monkeypatch):
    m = measurement(491, noise)
    fewer = fits.with_fewer_rows
    rows = []

    def watched(*args):
        few = fewer(*args)
        assert few is not args[0]
        rows.append(few.n_data)
        return few

    monkeypatch.setattr(fits, "with_fewer_rows", watched)
    found = fit(m, SAMPLE, intervals="quadratic")
    assert rows == [123]
    monkeypatch.setattr(fits, "with_fewer_rows", lambda fit, *_: fit)
    every = fit(m, SAMPLE, intervals="quadratic")
    assert (found.status, found.n_data, codes(found)) == ("converged", 491, codes(every))
    assert found.cost <= every.cost * (1.0 + 1e-9) + 1e-20
    for name, truth in TRUTH.items():
        ours, theirs = found.parameters[name], every.parameters[name]
        assert abs(ours.value - theirs.value) <= 1e-3 * theirs.sigma + 1e-9 * truth
        assert ours.sigma == pytest.approx(theirs.sigma, rel=1e-4, abs=1e-9)
        assert abs(ours.value - truth) < 4.0 * ours.sigma + 1e-6 * truth


@pytest.mark.study
def test_the_minimum_of_whole_averages(monkeypatch):
    waves, sample = np.linspace(0.5, 0.8, 30), "air | cauchy:2 1400..1600 nm | 1.53"
    truth, beam = {**TRUTH, "thickness_nm": 1500.0}, {"divergence": 1.5}
    shown = simulate(sample, truth | beam, 60.0, waves, "R")
    noise = 2e-3 * np.random.default_rng(3).standard_normal(30)
    m = Measurement.from_columns(60.0, waves, R=shown + noise)
    places, fewer = [], fits.with_fewer_rows

    def watched(*args):
        few = fewer(*args)
        places.append((args[0].u.spec.places[1], few.u.spec.places[1]))
        return few

    monkeypatch.setattr(fits, "with_fewer_rows", watched)
    found = fit(m, sample, fixed=beam, starts=4, intervals="quadratic")
    assert places == [(17, 5)]
    monkeypatch.setattr(fits, "with_fewer_rows", lambda fit, *_: fit)
    every = fit(m, sample, fixed=beam, starts=4, intervals="quadratic")
    for name in TRUTH:
        ours, theirs = found.parameters[name], every.parameters[name]
        assert abs(ours.value - theirs.value) <= 1e-3 * theirs.sigma
        assert ours.sigma == pytest.approx(theirs.sigma, rel=1e-4)


def part_of(m: Measurement, sample: str) -> Measurement:
    """The wavelengths and angles that the search takes."""
    which = Sample.parse(sample)
    job = problem_of([m], which, Settings(), FitOptions())
    points = fits.with_fewer_rows(job, which, [m]).seen
    rows = points.measured
    return Measurement.from_columns(
        points.points.angle_deg[rows, 0],
        points.points.wavelength_um[rows, 0],
        R=np.ones(rows.sum()),
    )


@pytest.mark.parametrize(("high_nm", "kept"), [(100, 123), (2000, 123), (2600, 164), (5000, 491)])
def test_no_more_is_left_out_than_the_fringes_allow(high_nm, kept):
    m = measurement(491, 0.0)
    assert len(part_of(m, f"air | cauchy:2 50..{high_nm} nm | 1.53")) == kept
    few = measurement(239, 0.0)
    assert len(part_of(few, f"air | cauchy:2 50..{high_nm} nm | 1.53")) == 239


def test_each_wavelength_is_seen_at_some_of_many_angles():
    angle, waves = (
        a.ravel() for a in np.meshgrid([50.0, 60.0, 70.0, 75.0], np.linspace(0.4, 1, 80))
    )
    shown = simulate("air | cauchy:2 100 nm | 1.53", TRUTH, angle, waves, "R")
    m = Measurement.from_columns(angle, waves, R=shown)
    part = part_of(m, SAMPLE)
    assert len(part) == 160
    assert len(np.unique(part.wavelength_um)) == 80
    for each in (50.0, 60.0, 70.0, 75.0):
        assert (part.angle_deg == each).sum() == 40
    few = m.where(m.wavelength_um < 0.42)  # hardly any wavelengths: all of it
    assert len(part_of(few, SAMPLE)) == len(few)


def test_a_long_spectrum_of_a_surface_is_thinned():
    waves = np.linspace(0.4, 20.0, 3000)
    m = Measurement.from_columns(0.0, waves, R=np.full(3000, 0.2))
    assert len(part_of(m, "lorentz:1")) == 500
    # the fringes of a film of known thickness stay
    assert len(part_of(m, "air | lorentz:1 100 nm held | 1.5")) == 3000


def test_the_lowest_for_all_data_is_followed_however_low_others_are_for_some():
    """A narrow line between the wavelengths of a thinned search lowers its chi2 alone."""
    m, sample = measurement(491, 2e-3), Sample.parse(SAMPLE)
    job = problem_of([m], sample, Settings(), FitOptions())
    job.lanes = FOLLOWED
    names = [f"film.{name}" for name in TRUTH]
    wrong = [dict(TRUTH, thickness_nm=d) for d in np.linspace(700.0, 1100.0, 40)]
    places = [dict(zip(names, each.values(), strict=True)) for each in [*wrong, TRUTH]]
    y = np.stack([start_at(job.u.moving, place) for place in places], 1)
    count = np.ones(41, int)
    ends = Ends(y, np.append(np.linspace(1.0, 2.0, 40), 1e3), count == 1, count)
    found = followed_with_all(job, ends)
    best = best_of(found)
    assert best is not None
    assert thickness_um(job, films_of(job.u.spec, job.u.moving)[0], found.y)[best] == (
        pytest.approx(0.62, rel=1e-2)
    )
    rest = np.isfinite(found.cost)
    assert rest.sum() == FOLLOWED and rest[best]
    for lane in np.flatnonzero(rest):  # every cost is one of all data
        at = found.y[:, lane]
        assert found.cost[lane] == pytest.approx(job.cost(job.slopes(at), at, 1.0), rel=1e-9)


def test_ends_of_one_cost_are_followed_as_one():
    m, sample = measurement(491, 2e-3), Sample.parse(SAMPLE)
    job = problem_of([m], sample, Settings(), FitOptions())
    job.lanes = FOLLOWED
    y = start_at(job.u.moving, {f"film.{name}": value for name, value in TRUTH.items()})
    count = np.ones(3, int)
    ends = Ends(np.repeat(y[:, None], 3, 1), np.array([1.0, 1.0 + 1e-6, 2.0]), count > 0, count)
    found = followed_with_all(job, ends)
    assert found.done.all() and found.cost[0] == found.cost[1] == pytest.approx(found.cost[2])
