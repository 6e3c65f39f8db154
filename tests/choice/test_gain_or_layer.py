"""An oxide by R alone may be an error of the calibration, which `choose` says."""

import numpy as np
import pytest

from fitting import Measurement, choose, fit, simulate

WAVES = np.linspace(0.4, 0.9, 60)
SAMPLES = "Si or air | SiO2 1..500 nm | Si"


def _measured(sample, gain, seed):
    noise = 0.002 * np.random.default_rng(seed).standard_normal(len(WAVES))
    R = gain * simulate(sample, {}, 0.0, WAVES) + noise
    return Measurement.from_columns(0.0, R=R, wavelength_um=WAVES, sigma=0.002)


def _codes(choice):
    return [w.code for w in choice.fit.warnings]


@pytest.mark.parametrize("seed", [0, *(pytest.param(s, marks=pytest.mark.study) for s in (1, 2))])
def test_bare_silicon_that_reads_1_percent_low(seed):
    """It looks like 8 nm of oxide, with a standard error of .5 nm."""
    choice = choose(_measured("Si", 0.99, seed), SAMPLES)
    assert "thickness_nm" in choice.fit.parameters
    [told] = [w for w in choice.fit.warnings if w.code == "gain_instead"]
    assert told.values["sample"] == "Si"
    assert told.values["scale"] == pytest.approx(0.99, abs=4 * told.values["sigma"])
    assert "do not tell the further layer from an error of the calibration" in told.text


@pytest.mark.study
def test_of_two_files_the_scale_that_is_farther_off_is_told():
    choice = choose([_measured("Si", 0.985, 1), _measured("Si", 0.99, 2)], SAMPLES)
    [told] = [w for w in choice.fit.warnings if w.code == "gain_instead"]
    assert told.values["scale"] == pytest.approx(0.985, abs=4 * told.values["sigma"])


@pytest.mark.parametrize("nm", [20, 300])
def test_an_oxide_that_no_gain_explains(nm):
    choice = choose(_measured(f"air | SiO2 {nm} nm | Si", 1.0, nm), SAMPLES)
    assert choice.fit.parameters["thickness_nm"].value == pytest.approx(nm, abs=1.0)
    assert "gain_instead" not in _codes(choice)


def test_nothing_is_told_of_the_smallest_sample():
    assert "gain_instead" not in _codes(choose(_measured("Si", 1.0, 7), SAMPLES))


def test_several_samples_are_for_choose():
    with pytest.raises(ValueError, match="is more than one sample: use choose"):
        fit(_measured("Si", 1.0, 0), SAMPLES)


def test_a_fit_is_true():
    assert fit(_measured("Si", 1.0, 0), "air | SiO2 1..500 nm | Si")
