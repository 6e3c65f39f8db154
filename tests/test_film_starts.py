"""Where a fit of a film begins beside what it has found: other orders, and exchanged roles."""

import numpy as np
import pytest

from fitting import Measurement, Sample
from fitting.problem.observations import observations
from fitting.problem.problem import targets_of
from fitting.problem.unknowns import spectrum_of, unknowns
from fitting.samples.parameters import Settings, from_parameter
from fitting.searching.film_starts import _eta_of, films_of, scaled_index
from fitting.searching.neighbours import _as_free_electrons
from fitting.searching.search import Asked, Solving
from fitting.searching.starts import start_at

WAVES = np.linspace(0.4, 0.8, 16)


def job(model):
    m = Measurement.from_columns(0.0, WAVES, R=np.full(16, 0.3))
    sample = Sample.parse(f"air | {model} 50..2000 nm | Si")
    seen = observations([m], "equal")
    u = unknowns(sample, spectrum_of([m], sample), Settings(), seen, "squares")
    return Solving(u, seen, targets_of(u, seen, np.float64(1.0)), Settings(), Asked())


def index(fit, y):
    found = _eta_of(y[:, None], fit.u.held, WAVES[:, None], 1.0, spec=fit.u.spec, medium=0)
    return np.asarray(found)[:, 0]


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
    new = _as_free_electrons(fit, y[:, None], start_at(moving, {})[:, None])[:, 0]
    assert not np.allclose(new, y)
    weak = names.index("film.strength_ev2_1")
    assert new[weak] < y[weak]
    np.testing.assert_allclose(index(fit, new), index(fit, y), rtol=0.03)
