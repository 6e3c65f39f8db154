"""Resonances of oscillators above the spectrum, along whose valley a fit may rest on its way."""

import numpy as np
import pytest

from fitting.searching.far_oscillators import _other_resonances
from fitting.searching.film_starts import film_index, films_of
from fitting.searching.starts import start_at
from tests.fits.oscillator_problem import ENERGY, job, measured


@pytest.mark.parametrize("seed", range(5))
def test_another_resonance_keeps_eps_and_its_slope_amid_the_spectrum(seed):
    random = np.random.default_rng([seed, 31])
    film = {
        "eps_inf": 20.0, "strength_ev2_1": random.uniform(5.0, 30.0), "width_ev_1": 1e-3,
        "resonance_ev_1": random.uniform(4.8, 9.0), "strength_ev2_2": 1.0, "width_ev_2": 0.2,
        "resonance_ev_2": random.uniform(1.5, 4.0), "thickness_nm": 300.0,
    }  # fmt: skip
    sample = "air | lorentz:2 5..500 nm | Si"
    of = job(sample, measured(sample, film, ("R",)))
    y = start_at(of.u.moving, {f"film.{n}": v for n, v in film.items()})[:, None]
    moved = _other_resonances(of, y)
    resonances = [of.u.spec.moving.index(f"film.resonance_ev_{i}") for i in (1, 2)]
    assert len(set(moved[resonances[0]])) == moved.shape[1] >= 6
    assert (moved[resonances[0]] > np.log(ENERGY.max())).all()
    assert (moved[resonances[1]] == y[resonances[1]]).all()  # it is within the spectrum
    layer = films_of(of.u.spec, of.u.moving)[0]
    (eta, k), (eta_0, k_0) = film_index(of, layer, moved), film_index(of, layer, y)
    eps, eps_0 = (eta + 1j * k) ** 2, (eta_0 + 1j * k_0) ** 2
    amid = len(ENERGY) // 2
    np.testing.assert_allclose(eps[amid], np.repeat(eps_0[amid], moved.shape[1]), atol=2e-3)
    slope, slope_0 = (e[amid + 1] - e[amid - 1] for e in (eps, eps_0))
    np.testing.assert_allclose(slope, np.repeat(slope_0, moved.shape[1]), rtol=2e-2)
    assert (np.abs(eps - eps_0)[-1] > 1e-4).all()  # at the ends the two differ
