"""Quantities without stated errors: each is weighted by the scatter of its own residuals."""

import numpy as np
import pytest

from fitting import Measurement, fit, fit_many, simulate
from fitting.residuals.noise import scatter_of_each

pytestmark = pytest.mark.slow

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
    noise, where = rng.standard_normal((1000, 60)), (m.angle_deg, m.wavelength_um, curve, m.value)
    assert np.isfinite(scatter_of_each(*where, noise)).any(1).sum() < 10
    # What is missed smoothly is no scatter.
    smooth = 3.0 * (m.wavelength_um - 0.6) ** 2 * curve
    (quiet,) = scatter_of_each(*where, 1e-3 * noise[:1] * np.where(curve, 1.0, 10.0) + smooth)
    assert (quiet[curve == 0] > 5.0 * quiet[curve == 1].max()).all()


def test_each_curve_of_a_batch_has_its_own_as_by_itself():
    """Of three films T is noisy; the fourth has one scatter, and equal weights."""
    parts = [film({"R": 5e-4, "T": 0.02}, seed) for seed in range(3)]
    parts.append(film({"R": 5e-4, "T": 5e-4}, 3))
    data = {q: np.stack([m.value[m.quantity == q] for m in parts]) for q in ("R", "T")}
    start = {name.removeprefix("film."): x for name, x in TRUTH.items()}
    found = fit_many(0.0, WAVES, **data, sample=FILM, start=start, check=0)
    assert found.errors.taken.tolist() == ["of each quantity"] * 3 + ["equal"]
    assert not found.errors.stated and np.isnan(found.chi2).all()
    for i in (0, 3):
        one = fit(parts[i], FILM, intervals="quadratic")
        a, b = (f.parameters["thickness_nm"] for f in (one, found[i]))
        assert abs(a.value - b.value) < 0.01 * a.sigma
        assert b.sigma == pytest.approx(a.sigma, rel=0.02)
        noise = [
            [w.values["noise"] for w in each if w.code == "errors_of_each"]
            for each in (one.warnings, found.warnings[i])
        ]
        np.testing.assert_allclose(*noise, rtol=1e-3)
        assert len(noise[0]) == (i == 0)
