"""Quantities without stated errors: each is weighted by the scatter of its own residuals."""

import numpy as np
import pytest

from fitting import Measurement, fit, simulate
from fitting.residuals.noise import scatter_of_each

WAVES = np.linspace(0.45, 0.85, 41)
FILM = "air | cauchy 1..1000 nm | 1.52"
TRUTH = {"film.A": 1.9, "film.B": 0.012, "film.C": 2e-4, "film.thickness_nm": 202.0}


def film(noise, seed):
    """R and T of a film of 202 nm on glass, with noise of their own, and no stated errors."""
    rng, zero = np.random.default_rng(seed), np.zeros(41)
    values = {
        q: simulate(FILM, TRUTH, zero, WAVES, q) + s * rng.standard_normal(41)
        for q, s in noise.items()
    }
    return Measurement.from_columns(zero, WAVES, **values)


def test_a_noisy_transmittance_does_not_hide_what_a_quiet_reflectance_says():
    # With one scatter for both chi2 is lowest at 879 nm, of an index below 1.
    found = fit(film({"R": 5e-4, "T": 0.02}, 3), FILM)
    assert found.errors.taken == "of each quantity"
    assert not found.errors.stated and np.isnan(found.chi2)
    e = found.parameters["thickness_nm"]
    assert abs(e.value - 202.0) < 3.0 * e.sigma < 0.4
    (said,) = (w for w in found.warnings if w.code == "errors_of_each")
    # 41 data tell a scatter to 15 %.
    assert said.values["noise"] == pytest.approx([5e-4, 0.02], rel=0.5)
    assert "scatter of each quantity" in str(found)


def test_quantities_of_one_scatter_have_equal_weights():
    found = fit(film({"R": 5e-4, "T": 5e-4}, 0), FILM)
    assert found.errors.taken == "equal"
    assert "errors_of_each" not in {w.code for w in found.warnings}


def test_scatters_differ_by_chance_in_less_than_one_of_a_hundred():
    rng, wave = np.random.default_rng(5), np.linspace(0.4, 0.8, 30)
    m = Measurement.from_columns(np.zeros(30), wave, R=0.1 * np.sqrt(wave), T=np.sqrt(wave))
    curve = (m.quantity == "T").astype(int)
    noise = rng.standard_normal((1000, 60))
    assert sum(scatter_of_each(m, curve, row) is not None for row in noise) < 10
    # What is missed smoothly is no scatter.
    smooth = 3.0 * (m.wavelength_um - 0.6) ** 2 * curve
    quiet = scatter_of_each(m, curve, 1e-3 * noise[0] * np.where(curve, 1.0, 10.0) + smooth)
    assert quiet is not None
    assert (quiet[curve == 0] > 5.0 * quiet[curve == 1].max()).all()
