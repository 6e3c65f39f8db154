"""Where a fit of a film begins beside what it has found: other orders, and exchanged roles."""

import numpy as np
import pytest

from fitting import Measurement, Sample, simulate
from fitting.problem.lanes import best_of, joined
from fitting.problem.observations import observations
from fitting.problem.problem import FitOptions, Problem
from fitting.problem.programs import targets_of
from fitting.problem.unknowns import spectrum_of, unknowns
from fitting.samples.parameters import Settings, from_parameter, value_and_slope
from fitting.searching.film_starts import (
    _index_of,
    coordinate,
    film_index,
    film_starts,
    films_of,
    scaled_index,
    thickness_um,
)
from fitting.searching.last_steps import down_the_valley
from fitting.searching.proposals import as_free_electrons
from fitting.searching.search import with_all_orders
from fitting.searching.starts import start_at, starts

WAVES = np.linspace(0.4, 0.8, 16)


def job(model):
    m = Measurement.from_columns(0.0, WAVES, R=np.full(16, 0.3))
    return problem_of(m, Sample.parse(f"air | {model} 50..2000 nm | Si"), "equal")


def problem_of(m, sample, errors):
    seen = observations([m], errors)
    u = unknowns(sample, spectrum_of([m], sample), Settings(), seen, "squares")
    return Problem(u, seen, targets_of(u, seen, np.float64(1.0)), Settings(), FitOptions(errors))


def index(fit, y):
    eta, _ = _index_of(y[:, None], fit.u.held, WAVES[:, None], 1.0, spec=fit.u.spec, medium=0)
    return np.asarray(eta)[:, 0]


def test_the_index_of_a_film_in_every_lane():
    fit = job("cauchy:2")
    y = starts(fit.u.moving, 70, 3)  # more than run side by side
    row = {name: i for i, name in enumerate(fit.u.spec.moving)}
    A, B = (
        value_and_slope(fit.u.moving[i].parameter.coordinate, y[i])[0]
        for i in (row["film.A"], row["film.B"])
    )
    eta, k = film_index(fit, films_of(fit.u.spec, fit.u.moving)[0], y)
    np.testing.assert_allclose(eta, A + B / WAVES[:, None] ** 2, rtol=1e-13)
    assert eta.shape == k.shape and not k.any()


@pytest.mark.parametrize("model, values", [
    ("constant", {"eta": 1.8, "k": 0.01}), ("cauchy:3", {"A": 1.6, "B": 0.01, "C": 1e-4}),
    ("drude-lorentz:1", {"eps_inf": 2.0, "plasma_ev": 1.0, "width_ev": 0.1,
                         "strength_ev2_1": 8.0, "resonance_ev_1": 6.0, "width_ev_1": 0.3}),
    ("tauc-lorentz:1", {"eps_inf": 2.0, "amplitude_ev_1": 40.0, "resonance_ev_1": 6.0,
                        "width_ev_1": 1.0, "gap_ev": 3.5}),
])  # fmt: skip
def test_other_orders_keep_the_optical_thickness(model, values):
    """The index of the film is scaled as a whole, whatever its model calls its parameters."""
    fit = job(model)
    film = films_of(fit.u.spec, fit.u.moving)[0]
    y = start_at(fit.u.moving, {f"film.{n}": v for n, v in values.items()})
    np.testing.assert_allclose(
        index(fit, scaled_index(fit, film, y[:, None], 1.1)[:, 0]), 1.1 * index(fit, y), rtol=1e-3
    )


def test_an_oscillator_below_the_spectrum_becomes_free_electrons():
    fit = job("drude-lorentz:1")
    names, moving = list(fit.u.spec.moving), fit.u.moving
    own = {"eps_inf": 4.0, "plasma_ev": 0.3, "width_ev": 30.0, "strength_ev2_1": 4.0,
           "resonance_ev_1": 0.2, "width_ev_1": 0.1}  # fmt: skip
    y = start_at(moving, {})
    for name, v in own.items():
        i = names.index(f"film.{name}")
        y[i] = from_parameter(moving[i].parameter.coordinate, v)
    new = as_free_electrons(fit, y[:, None], start_at(moving, {})[:, None])[:, 0]
    assert not np.allclose(new, y)
    weak = names.index("film.strength_ev2_1")
    assert new[weak] < y[weak]
    np.testing.assert_allclose(index(fit, new), index(fit, y), rtol=0.03)


@pytest.mark.study
def test_a_lane_on_its_way_counts_as_much_as_one_at_rest():
    """After two evaluations near the truth a lane is not done, and yet below another minimum."""
    film = {"A": 1.9, "B": 0.02, "thickness_nm": 800.0}
    sample = "air | cauchy:2 50..2000 nm | Si"
    R = simulate("air | cauchy:2 800 nm | Si", film, 0.0, WAVES, "R")
    fit = problem_of(
        Measurement.from_columns(0.0, WAVES, R=R + 1e-4, sigma=1e-3), Sample.parse(sample), "stated"
    )
    places = [{"A": 1.88, "thickness_nm": 805.0}, {"A": 1.5, "thickness_nm": 700.0}]
    ends = []
    for place, steps in zip(places, (2, 200), strict=True):
        y = start_at(fit.u.moving, {f"film.{n}": v for n, v in (film | place).items()})
        ends.append(fit.held(y[:, None], 1.0, steps))
    ends = joined(ends)
    assert ends.done.tolist() == [False, True]
    assert 10.0 < ends.cost[0] < 0.1 * ends.cost[1]
    found = down_the_valley(fit, ends, 1.0)
    assert found.cost[best_of(found)] < 0.2


def test_every_order_that_fits_as_well_is_found_from_one_of_them():
    """Noise of 8 % leaves several orders of a film of 3 um; the others are far above them."""
    waves, fringe = np.linspace(0.6, 0.7, 128), 0.16
    film = {"A": 1.9, "B": 0.02, "thickness_nm": 3000.0}
    T = simulate("air | cauchy:2 3000 nm | BK7", film, 0.0, waves, "T")
    T = T + 0.08 * np.random.default_rng(1).standard_normal(128)
    m = Measurement.from_columns(0.0, waves, T=T, sigma=0.08)
    fit = problem_of(m, Sample.parse("air | cauchy:2 1..5 um | BK7"), "stated")
    row = films_of(fit.u.spec, fit.u.moving)[0]
    y = start_at(fit.u.moving, {f"film.{n}": v for n, v in film.items()})[:, None]
    found = with_all_orders(fit, fit.held(y, 1.0, 60), 1.0)
    # Every order by itself, its thickness between bounds of its own.
    centre = np.arange(1.1, 4.9, fringe / 2)
    start = np.repeat(y, len(centre), 1)
    low, high = (np.repeat(a[:, None], len(centre), 1) for a in fit.limits)
    start[row.row], low[row.row], high[row.row] = (
        coordinate(fit, row, centre + d) for d in (0.0, -fringe / 2, fringe / 2)
    )
    each = fit.held(start, 1.0, 200, (low, high))
    least = min(found.cost.min(), each.cost.min())
    at = thickness_um(fit, row, each.y)
    inside = (np.abs(at - centre) < 0.45 * fringe) & (each.cost < least + 5.0)
    near = [np.abs(thickness_um(fit, row, found.y) - x) < 0.3 * fringe for x in at[inside]]
    assert len(set(np.round(at[inside], 2))) >= 3
    for cost, those in zip(each.cost[inside], near, strict=True):
        assert found.cost[those].min() < cost + 0.1
    assert found.cost.min() < least + 0.01


def test_a_film_without_a_fringe_beside_one_that_has_them_has_no_starts_of_its_own():
    m = Measurement.from_columns(0.0, WAVES, R=np.full(16, 0.3))

    def of(oxide, film="50..2000"):
        sample = Sample.parse(f"air | cauchy:2 {film} nm | SiO2 {oxide} | Si")
        fit = problem_of(m, sample, "equal")
        return film_starts(fit, starts(fit.u.moving, 64, 0)).shape[1]

    alone = of("10 nm held")
    assert of("1..50 nm") == alone > 0
    # with fringes of both: those of each, and the phases of each divided among them
    assert of("50..2000 nm") == 4 * alone
    # where none has a fringe the one that has most of one
    assert of("1..5 nm", "1..20") == alone
