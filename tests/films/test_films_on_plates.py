"""Films on thick plates, fitted: what is found, and what is refused."""

import numpy as np
import pytest

from fitting import Measurement, fit, simulate


def test_a_film_on_a_plate_is_found_by_psi_and_delta():
    wave, angle = np.tile(np.linspace(0.4, 0.9, 30), 2), np.repeat([55.0, 65.0], 30)
    sample = "air | constant 110 nm | 1.5 1 mm thick | air"
    truth = {"film.eta": 2.05, "film.k": 0.003, "film.thickness_nm": 118.0}
    rng = np.random.default_rng(8)
    error = {"psi": 0.02, "delta": 0.1}
    seen = {
        q: simulate(sample, truth, angle, wave, q) + error[q] * rng.standard_normal(60)
        for q in ("psi", "delta")
    }
    m = Measurement.from_columns(angle, wave, **seen, sigma=error)
    found = fit(m, sample, free="film.k", starts=8, intervals="quadratic")
    for name, value in truth.items():
        e = found.parameters[name]
        assert abs(e.value - value) < 4.0 * e.sigma
    assert 60 < found.chi2 < 180  # 117 degrees of freedom, 4 standard deviations


def test_a_plate_that_was_not_called_thick_is_refused():
    waves = np.linspace(0.4, 0.8, 401)
    m = Measurement.from_columns(0.0, waves, T=np.full(401, 0.9))
    with pytest.raises(ValueError, match="Write 'BK7 1 mm thick'"):
        fit(m, "air | cauchy:2 50..500 nm | BK7 1 mm | air")
    # Fringes of a wafer that are resolved, at a step of .00005/um.
    waves = 1.0 / np.linspace(0.2, 0.21, 200)
    T = simulate("air | 3.42 400 um | air", {"thickness_nm": 4e5}, 0.0, waves, "T")
    m = Measurement.from_columns(0.0, waves, T=T, sigma=1e-3)
    found = fit(m, "air | 3.42 399.9..400.1 um | air")
    assert found.parameters["thickness_nm"].value == pytest.approx(4e5, rel=1e-6)
