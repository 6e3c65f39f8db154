"""A coating whose R is least at its own index: data change with the square of an error."""

import numpy as np
import pytest

from fitting import Measurement, fit, simulate

WAVE = np.linspace(0.45, 0.65, 60)
COATING = simulate("air | 1.387 110 nm | 1.93", {}, 0.0, WAVE, "R")


def _measured(seed):
    noise = 2e-4 * np.random.default_rng(seed).standard_normal(len(WAVE))
    return Measurement.from_columns(0.0, WAVE, R=COATING + noise, sigma=2e-4)


@pytest.mark.parametrize(
    "seed", [1, 2, *(pytest.param(s, marks=pytest.mark.study) for s in (3, 4, 5))]
)
def test_the_index_of_an_antireflection_coating_is_determined(seed):
    """R = ((eta^2 - 1.93) / (eta^2 + 1.93))^2 at the minimum: with .01 in eta it is 5e-5."""
    found = fit(_measured(seed), "air | constant 50..300 nm | 1.93", fixed={"k": 0.0})
    codes = {w.code for w in found.warnings}
    eta, thickness = (found.parameters[n] for n in ("eta", "thickness_nm"))
    assert found.status == "converged"
    assert "not_seen" not in codes
    assert ("no_slope" in codes) == np.isnan(eta.sigma)
    ends = [f.parameters["eta"].interval for f in (found, *found.alternatives)]
    assert any(low < 1.387 < high for low, high in ends)
    assert 0.01 < np.ptp(eta.interval) < 0.04
    assert 1.0 < np.ptp(thickness.interval) < 4.0


def test_a_coating_at_its_best_index_has_an_interval_and_no_standard_error():
    found = fit(_measured(1), "air | constant 50..300 nm | 1.93", fixed={"k": 0.0})
    assert np.isnan(found.parameters["eta"].sigma)
    (told,) = (w for w in found.warnings if w.code == "no_slope")
    assert told.text.startswith("eta and thickness_nm have no standard error")
    assert "1.38" in str(found)


@pytest.mark.study
def test_a_valley_of_equal_chi2_stays_undetermined():
    """At one wavelength and angle R is that of many pairs of an index and a thickness."""
    m = Measurement.from_columns(0.0, 0.5, R=[0.01, 0.0101, 0.0099], sigma=1e-4)
    found = fit(m, "air | constant 50..90 nm | 1.93", fixed={"k": 0.0})
    assert found.status == "undetermined"
    assert "not_seen" in {w.code for w in found.warnings}
