"""Where the next oscillator of a model is looked for: where it explains most of what is left."""

import numpy as np
import pytest

from fitting import Measurement, simulate
from fitting.searching.oscillators import by_eps, likely_lines, oscillator, oscillators
from fitting.searching.starts import start_at
from tests.fits.oscillator_problem import job, measured

STRONG = {"eps_inf": 2.0, "strength_ev2_1": 20.0, "resonance_ev_1": 3.2, "width_ev_1": 0.6}


@pytest.mark.study
@pytest.mark.parametrize("sample, columns, place", [
    ("lorentz:2", ("R_s", "R_p"), "substrate."), ("lorentz:2", ("psi", "delta"), "substrate."),
    ("air | lorentz:2 40 nm | Si", ("R", "psi", "delta"), "film."),
])  # fmt: skip
def test_a_weak_line_changes_the_data_as_two_derivatives_say(sample, columns, place):
    """Against the program's own derivative by the strength of that line."""
    random = np.random.default_rng(3)
    second = {"strength_ev2_2": 1.0, "resonance_ev_2": 2.0, "width_ev_2": 0.2}
    film = {"thickness_nm": 40.0} if place == "film." else {}
    fit = job(sample, measured(sample, STRONG | second | film, columns))
    y = start_at(fit.u.moving, {place + n: v for n, v in (STRONG | film).items()})
    term = oscillators(fit)[1]
    for _ in range(5):
        y[term] = np.log([1e-6, random.uniform(1.0, 5.0), 10.0 ** random.uniform(-2.0, 0.3)])
        known = by_eps(fit, y, term)
        predicted = (known.by_eps * oscillator(known.energy, *np.exp(y[term[1:]]))).real
        given = fit.slopes(y).jacobian[:, term[0]] / 1e-6
        np.testing.assert_allclose(predicted, given, atol=1e-3 * np.abs(given).max())


def test_a_part_of_many_data_is_enough():
    wavelength = 1.239841984 / np.linspace(1.3, 4.1, 3500)
    line = {"strength_ev2_2": 2.0, "resonance_ev_2": 2.2, "width_ev_2": 0.1}
    shown = simulate("lorentz:2", STRONG | line, 0.0, wavelength, "R")
    fit = job("lorentz:2", Measurement.from_columns(0.0, wavelength, R=shown, sigma={"R": 1e-3}))
    weak = {"strength_ev2_2": 1e-9, "resonance_ev_2": 3.9, "width_ev_2": 0.5}
    y = start_at(fit.u.moving, {f"substrate.{n}": v for n, v in (STRONG | weak).items()})
    term = oscillators(fit)[1]
    known = by_eps(fit, y, term)
    assert len(known.energy) == len(known.residual) == len(known.by_rest) == 1167
    assert (known.energy.min(), known.energy.max()) == pytest.approx((1.3, 4.1), abs=0.01)
    found = np.exp(likely_lines(fit, y, term, 1)[term, 0])
    assert found == pytest.approx([2.0, 2.2, 0.1], rel=0.3)


@pytest.mark.parametrize("seed", range(8))
def test_a_line_that_is_missing_is_among_the_first_two(seed):
    random = np.random.default_rng([seed, 26])
    line = {
        "strength_ev2_2": 10.0 ** random.uniform(-1.5, 0.0),
        "resonance_ev_2": random.uniform(1.5, 3.9), "width_ev_2": 10.0 ** random.uniform(-1.0, 0.0),
    }  # fmt: skip
    fit = job("lorentz:2", measured("lorentz:2", STRONG | line, ("psi", "delta")))
    y = start_at(fit.u.moving, {f"substrate.{n}": v for n, v in STRONG.items()})
    term = oscillators(fit)[1]
    y[term[0]] = fit.limits[0][term[0]]
    strength, place, width = np.exp(likely_lines(fit, y, term, 2)[term])
    near = np.abs(place - line["resonance_ev_2"]) < np.maximum(0.5 * line["width_ev_2"], 0.08)
    for found, name in ((strength, "strength_ev2_2"), (width, "width_ev_2")):
        near &= (found > 0.3 * line[name]) & (found < 3.0 * line[name])
    assert near.any()


def test_of_an_end_without_derivatives_nothing_is_made():
    fit = job("lorentz:2", measured("lorentz:1", STRONG, ("psi", "delta")))
    y = start_at(fit.u.moving, {})
    y[0] = np.nan
    found = likely_lines(fit, y, oscillators(fit)[1], 3)
    np.testing.assert_array_equal(found, np.repeat(y[:, None], 3, 1))
