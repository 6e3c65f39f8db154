"""Powers below 0 and above 1: data within the noise that their curve shows, else an error."""

import numpy as np
import pytest

from fitting.data.measurement import Measurement, MeasurementError
from fresnel_jax import powers
from tests.truth.reading import read

ANGLES = np.linspace(40.0, 75.0, 60)


def noisy(seed, noise, eta=1.5, count=60):
    angles = ANGLES[:: 60 // count]
    R_p = np.asarray(powers(np.cos(np.radians(angles)), eta).R_p)
    return angles, R_p + noise * np.random.default_rng(seed).standard_normal(len(angles))


@pytest.mark.parametrize("noise", [1e-5, 1e-3, 3e-3])
def test_noise_about_zero_is_data(noise, tmp_path):
    """R_p about Brewster's angle: a dark value is as often below 0 as above."""
    met = 0
    for seed in range(40):
        angles, R_p = noisy(seed, noise)
        below = int((R_p < 0.0).sum())
        m = Measurement.from_columns(angles, R_p=R_p)
        assert m.value.tolist() == R_p.tolist()
        lie = "value lies" if below == 1 else "values lie"
        said = f"; {below} {lie} outside [0, 1] by no more than the noise"
        assert (said in m.understood) == (below > 0)
        met += below > 0
    assert met > 10
    rows = "".join(f"{a!r},{r!r}\n" for a, r in zip(angles.tolist(), R_p.tolist(), strict=True))
    read(tmp_path, "angle_deg,R_p\n" + rows)


def test_noise_about_one_is_data():
    angles = np.linspace(45.0, 85.0, 30)
    R = 1.0 + 2e-3 * np.random.default_rng(0).standard_normal(30)
    assert len(Measurement.from_columns(angles, R_s=R)) == 30


@pytest.mark.parametrize("far", [-0.05, -0.015, 1.06])
def test_a_value_far_outside_of_the_noise_is_refused(far):
    for seed in range(40):
        angles, R_p = noisy(seed, 1e-3)
        R_p[30] = far
        with pytest.raises(MeasurementError, match=r"outside \[0, 1\]"):
            Measurement.from_columns(angles, R_p=R_p)


def test_few_values_show_no_noise():
    with pytest.raises(MeasurementError, match="outside"):
        Measurement.from_columns([40.0, 50.0, 60.0], R_p=[0.01, -0.001, 0.02])


def test_percent_is_not_taken_for_noise():
    """Values about 1 percent scatter by tenths: no fractions of that noise are."""
    values = 1.0 + 0.3 * np.random.default_rng(1).standard_normal(60)
    with pytest.raises(MeasurementError, match="percent"):
        Measurement.from_columns(ANGLES, R_p=np.abs(values))


def test_rounding_of_computed_powers_is_data():
    assert len(Measurement.from_columns([0.0, 45.0], R_s=[1.0 + 2.0**-52, 0.5])) == 2
