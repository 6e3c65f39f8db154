"""Fringes of which a spectrum has fewer than two points each."""

import numpy as np
import pytest

from fitting import Measurement, fit, simulate

SAMPLE = "air | cauchy:1 100..20000 nm | BK7"
WAVELENGTHS = 1.0 / np.linspace(1.0 / 0.9, 1.0 / 0.4, 25)


@pytest.mark.study
@pytest.mark.parametrize("seed", [4, 17, 52, 69, 118, 133])
def test_every_thickness_with_the_same_fringes_at_the_points_is_told(seed):
    """Of 150 random films, those of which the true thickness was not among the solutions."""
    random = np.random.default_rng(seed)
    thickness = float(np.exp(random.uniform(np.log(300.0), np.log(19000.0))))
    index, noise = random.uniform(1.7, 2.4), 10.0 ** random.uniform(-3.5, -2.0)
    truth = {"A": index, "thickness_nm": thickness}
    clean = simulate(f"air | cauchy:1 {thickness} nm | BK7", truth, 0.0, WAVELENGTHS, "R")
    measured = clean + noise * random.standard_normal(len(clean))
    found = fit(Measurement.from_columns(0.0, WAVELENGTHS, sigma=noise, R=measured), SAMPLE)
    shown = [f.parameters["thickness_nm"] for f in (found, *found.alternatives)]
    assert any(abs(d.value - thickness) < 4.0 * d.sigma for d in shown)
    assert len(shown) > 1
