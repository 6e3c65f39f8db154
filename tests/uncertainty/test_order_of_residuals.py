"""Order in the residuals: runs, patterns pooled over wavelengths, and errors that grow with it."""

import math

import numpy as np
import pytest

from fitting import Measurement, fit, simulate
from fitting.residuals.pattern import pattern
from tests.truth.simulated import textbook

pytestmark = pytest.mark.slow

ANGLES = np.linspace(20.0, 80.0, 30)


def test_runs_are_seen_where_a_few_large_residuals_hide_the_correlation():
    """26 of 29 neighbours of one sign (8e-6 by chance), and a product sum below its limit."""
    signs = np.concatenate([np.ones(8), -np.ones(14), np.ones(8)])
    size = np.full(30, 0.1)
    size[[7, 8, 21, 22]] = 3.0  # the large ones stand where the sign changes
    m = Measurement.from_columns(ANGLES, R_s=0.5 + 1e-3 * signs * size)
    found = pattern(m, np.full(30, 0.5), np.zeros(30, int))
    assert found is not None and found.along == "angle"
    assert found.alike == 27 and found.pairs == 29
    assert found.correlation < found.chance  # the older test alone saw nothing


def order(found):
    """The lag-1 correlation of residuals that are in order."""
    (told,) = [w for w in found.warnings if w.code == "residuals_in_order"]
    return told.values["correlation"]


def test_residuals_in_order_never_earn_smaller_errors():
    """chi2/dof .07 with a correlation of .8 scaled the errors down by 4."""
    drift = 1e-3 * np.sin(ANGLES / 8.0)
    R = textbook(ANGLES, np.full(30, "R_s"), 1.6, 0.8) + drift
    m = Measurement.from_columns(ANGLES, R_s=R, sigma=4e-3)
    found = fit(m, intervals="quadratic")
    stated = fit(m, errors="stated", intervals="quadratic")
    assert found.chi2_reduced < 0.2 and order(found) > 0.5
    rho = order(found)
    factor = math.sqrt((1.0 + rho) / (1.0 - rho))
    assert found.parameters["eta"].sigma == pytest.approx(
        factor * stated.parameters["eta"].sigma, rel=1e-6
    )
    assert "not scaled down" in " ".join(w.text for w in found.warnings)
    wide, narrow = (np.ptp(f.parameters["eta"].interval) for f in (found, stated))
    assert wide > 1.5 * narrow


def test_a_smooth_systematic_error_is_covered_more_often():
    """Of repeats with a random smooth error of .02 the 95 % interval of eta held 51 %."""
    rng = np.random.default_rng(8)
    clean = np.stack([textbook(ANGLES, np.full(30, q), 1.8, 1.0) for q in ("R_s", "R_p")])
    curves = []
    for _ in range(60):
        phase = rng.uniform(0.0, 2.0 * np.pi, (2, 1))
        error = 0.02 * np.sin(ANGLES / 15.0 + phase) + 1e-3 * rng.standard_normal((2, 30))
        curves.append(clean + error)
    R_s, R_p = np.moveaxis(curves, 1, 0).reshape(2, -1)
    # Each repeat is a wavelength: of single fits the causes would be looked for.
    wave = np.repeat(np.linspace(0.4, 0.8, 60), 30)
    found = fit(Measurement.from_columns(np.tile(ANGLES, 60), wave, R_s=R_s, R_p=R_p))
    rho = np.array([order(one) for one in found])
    low, high = found.parameters["eta"].interval.T
    narrow = (high - low) / np.sqrt((1.0 + rho) / (1.0 - rho))
    held = np.sum((low <= 1.8) & (high >= 1.8))
    held_before = np.sum(np.abs(found.eta - 1.8) <= 0.5 * narrow)
    assert held > held_before + 6
    assert held > 45


def test_of_two_scans_in_one_table_that_contradict_each_other():
    """A gain of 5 % between them; each by itself is the curve of glass."""
    random = np.random.default_rng(5)
    angle = np.tile(np.linspace(20.0, 80.0, 14), 2)
    gain = np.repeat([1.0, 1.05], 14)
    both = {
        name: gain * simulate("1.5", {}, angle, quantity=name) + 0.001 * random.standard_normal(28)
        for name in ("R_s", "R_p")
    }
    found = fit(Measurement.from_columns(angle, **both))
    assert "residuals_in_order" in [w.code for w in found.warnings]


def test_independent_repeats_are_no_pattern():
    angle = np.tile(np.linspace(20.0, 80.0, 14), 3)
    exact = {name: simulate("1.5", {}, angle, quantity=name) for name in ("R_s", "R_p")}
    fitted, told = np.concatenate([*exact.values()]), 0
    for seed in range(200):
        noise = 0.001 * np.random.default_rng(seed).standard_normal((2, 42))
        data = {name: R + e for (name, R), e in zip(exact.items(), noise, strict=True)}
        m = Measurement.from_columns(angle, **data)
        told += pattern(m, fitted, np.zeros(84, int)) is not None
    assert told <= 4
