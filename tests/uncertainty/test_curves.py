"""The fitted curve and its band, against the textbook and against repeated simulation."""

from dataclasses import replace

import numpy as np
import pytest

from fitting import fit, fit_many
from fitting.data.measurement import Measurement, concatenate
from tests.estimates import at_zero
from tests.truth.simulated import simulated, textbook

ANGLES = np.linspace(10.0, 80.0, 16)
GRID = np.linspace(0.0, 90.0, 37)


def noisy(eta, k, noise, count=None, seed=0, quantities=("R_s", "R_p")):
    rng = np.random.default_rng(seed)
    shape = ANGLES.shape if count is None else (count, len(ANGLES))
    return {
        q: textbook(ANGLES, np.full(len(ANGLES), q), eta, k) + noise * rng.standard_normal(shape)
        for q in quantities
    }


@pytest.mark.parametrize("quantity", ["R_s", "R_p", "R"])
def test_the_curve_is_the_reflectance_of_the_fitted_index(quantity):
    found = fit_many(ANGLES, **noisy(0.5, 2.2, 1e-3))
    value, _ = found.predict(GRID, quantity)
    want = textbook(GRID, np.full(len(GRID), quantity), found.eta, found.k)
    np.testing.assert_allclose(value, want, atol=1e-15)


@pytest.mark.study
@pytest.mark.parametrize(("eta", "k"), [(1.5, 0.0), (0.5, 2.2), (3.0, 0.5)])
def test_the_band_is_the_scatter_of_fitted_curves(eta, k):
    found = fit_many(ANGLES, **noisy(eta, k, 1e-3, count=1500), sigma=1e-3, errors="stated")
    value, sigma = found.predict(GRID[:-1], "R_p")
    assert value.shape == sigma.shape == (1500, len(GRID) - 1)
    scatter = value.std(axis=0)
    if k == 0.0:
        # Half of them lie at k = 0, and the band of the others does not know of that bound.
        zero = at_zero(found)
        for part in (zero, ~zero):
            assert (np.median(sigma[part], axis=0) > 0.7 * scatter).all()
            assert (np.median(sigma[part], axis=0) < 2.0 * scatter + 1e-7).all()
        return
    # 1500 repeats tell a standard deviation to 2 %.
    np.testing.assert_allclose(np.median(sigma, axis=0), scatter, rtol=0.1, atol=1e-7)


def test_the_band_exists_where_the_index_does_not():
    """Normal incidence: eta and k are one circle, yet R at 0 degrees is known as measured."""
    found = fit_many([0.0], R=[0.3], sigma=0.01, errors="stated")
    assert found.status == "undetermined"
    value, sigma = found.predict(np.array([0.0, 30.0]), "R")
    assert value[0] == pytest.approx(0.3, abs=1e-9)
    assert sigma[0] == pytest.approx(0.01, rel=1e-6)


def test_no_noise_known_no_band():
    found = fit_many([70.0], R_s=[0.5], R_p=[0.1])
    assert np.isnan(found.predict(GRID, "R_s")[1]).all()
    some = np.stack([np.full(16, np.nan), np.full(16, 0.3)])
    value, sigma = fit_many(ANGLES, R=some).predict(GRID)
    assert value.shape == (2, 37)
    assert np.isnan(value[0]).all()
    assert np.isnan(sigma[0]).all()


def test_fitted_values_go_with_the_rows_of_the_measurement():
    m = concatenate(
        simulated(0.5, 2.2, 1e-3, wavelength_um=0.6, seed=1),
        simulated(1.5, 0.0, 1e-3, wavelength_um=0.4, seed=2, angles=(20.0, 50.0, 77.0)),
    )
    found = fit(m)
    value, sigma = found.predict()
    assert len(value) == len(m)
    for i, wave in enumerate((0.4, 0.6)):
        rows = m.wavelength_um == wave
        want = textbook(m.angle_deg, m.quantity, found.eta[i], found.k[i])
        np.testing.assert_allclose(value[rows], want[rows], atol=1e-14)
        rms = np.sqrt(np.mean((value[rows] - m.value[rows]) ** 2))
        assert rms == pytest.approx(found.rms[i], rel=1e-6)
    assert (sigma > 0.0).all()
    # At rows of one's own, and a refusal at a wavelength that was not fitted.
    again, _ = found.predict(m.where(m.wavelength_um == 0.4))
    np.testing.assert_array_equal(again, value[m.wavelength_um == 0.4])
    with pytest.raises(ValueError, match=r"are not known at 0\.5 um"):
        found.predict(replace(m, wavelength_um=np.full(len(m), 0.5)))


def test_fitted_values_see_the_polarizer():
    s, p = (textbook(ANGLES, np.full(16, q), 0.5, 2.2) for q in ("R_s", "R_p"))
    third = np.radians(30.0)
    mixed = p * np.cos(third) ** 2 + s * np.sin(third) ** 2
    m = Measurement.from_columns(ANGLES, R=mixed, polarizer_deg=30.0)
    np.testing.assert_allclose(fit(m).predict().value, mixed, atol=1e-12)


def test_what_cannot_be_drawn_is_refused():
    found = fit_many(ANGLES, **noisy(0.5, 2.2, 1e-3))
    with pytest.raises(ValueError, match="there is no quantity 'R_q'; one of R_s, R_p, R"):
        found.predict(GRID, "R_q")
    with pytest.raises(ValueError, match="one axis"):
        found.predict(GRID[None], "R")
