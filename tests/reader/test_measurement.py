"""The Measurement: arrays and files meet the same checks, noise about 0 and 1 is let through."""

from pathlib import Path

import numpy as np
import pytest

from fitting.data.measurement import QUANTITIES, Measurement, MeasurementError
from fitting.measured_file import read_csv
from tests.truth.reading import read, refusal


def test_noise_beyond_0_and_1_needs_a_standard_error(tmp_path: Path) -> None:
    inside = "angle_deg,R_s,sigma_R_s\n80,1.019,0.005\n85,-0.01,0.004\n86,.9,.01\n"
    m = read(tmp_path, inside)
    assert m.value.tolist() == [1.019, -0.01, 0.9]
    assert "2 values lie outside [0, 1] by no more than the noise" in m.understood
    for row in ("80,1.021,0.005", "80,-.021,.005", "80,1.3,.2", "80,0.5,30"):
        assert "line 2" in refusal(tmp_path, f"angle_deg,R_s,sigma_R_s\n{row}\n85,.5,.01\n")
    bare = "angle_deg,R_s\n80,1.01\n85,.9\n"
    assert "--sigma" in refusal(tmp_path, bare)
    assert len(read(tmp_path, bare, sigma=0.01)) == 2


def test_arrays_meet_the_same_checks() -> None:
    m = Measurement.from_columns(
        [10, 20, 30], 0.6, R_s=[0.1, 0.2, np.nan], R_p=0.3, sigma={"R_s": 0.01}, source="lab"
    )
    assert m.quantity.tolist() == ["R_s", "R_s", "R_p", "R_p", "R_p"]
    assert m.angle_deg.tolist() == [10, 20, 10, 20, 30] and set(m.wavelength_um) == {0.6}
    np.testing.assert_array_equal(m.sigma, [0.01, 0.01, np.nan, np.nan, np.nan])
    assert len(m) == 5 and m.source == "lab" and m.value.dtype == np.float64
    for name in QUANTITIES:
        assert len(Measurement.from_columns(45.0, **{name: 0.5})) == 1


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({"angle_deg": [10, 95], "R_s": [0.1, 0.2]}, r"angle of R_s\[1\]: .*95"),
        (
            {"angle_deg": [10, 20], "R_s": [0.1, 1.2]},
            r"R_s\[1\]: reflectance 1.2 .*for percent give scale=0.01",
        ),
        ({"angle_deg": [10, 20], "R_s": [0.1, -0.2]}, r"R_s\[1\]: reflectance -0.2"),
        ({"angle_deg": [10, 20], "T_p": [0.1, np.inf]}, r"T_p\[1\]: inf"),
        ({"angle_deg": [10, 20], "R_s": [0.1, 0.2], "sigma": 0}, r"sigma of R_s\[0\]"),
        (
            {"angle_deg": [10, 20], "R_s": [0.1, 0.2], "wavelength_um": -1},
            r"wavelength of R_s\[0\]",
        ),
        ({"angle_deg": [10, np.nan], "R_s": [0.1, 0.2]}, r"angle of R_s\[1\]: .*nan"),
        (
            {"angle_deg": 10, "wavelength_um": [0.5, np.nan], "R_s": [0.1, 0.2]},
            r"wavelength of R_s\[1\]: the wavelength is missing",
        ),
        ({"angle_deg": [10, 20], "R_s": [0.1, 0.2, 0.3]}, "one length"),
        ({"angle_deg": [[10, 20]], "R_s": 0.1}, "one length"),
        ({"angle_deg": ["a", "b"], "R_s": 0.1}, "must be numbers"),
        ({"angle_deg": [10, 20], "Rs": 0.1}, "no quantity Rs"),
        ({"angle_deg": 10, "R": 0.1, "wavelength_nm": 500}, "wavelengths are wavelength_um"),
        (
            {"angle_deg": 10, "R": 0.1, "wavelength_um": [400, 800]},
            '400 to 800 um came; these may be nm. Say wavelength_unit="nm", or ',
        ),
        ({"angle_deg": 10, "R": 0.3, "sigma": 2.0}, "is above 1; .* sigma=0.002 for 0.2 %"),
        ({"angle_deg": 10, "R": 0.1, "sigma_R": 0.01}, "standard errors are sigma"),
        ({"angle_deg": [10, 20]}, "no values"),
        ({"angle_deg": [10, 20], "R_s": np.nan}, "no measured value"),
        (
            {"angle_deg": [10, 20], "R_s": 0.1, "sigma": {"R_p": 0.1}},
            "sigma has standard errors of R_p",
        ),
        ({"angle_deg": 10, "psi": 20, "polarizer_deg": 45}, "polarizer angle of 45"),
        ({"angle_deg": 10, "R_s": 0.1, "polarizer_deg": 45}, "polarizer angle of 45"),
        ({"angle_deg": 10, "psi": 100}, r"psi 100 degrees is outside \[0, 90\].$"),
        ({"angle_deg": 10, "R": 10, "scale": 0.0}, "scale is 0; a factor above 0"),
        ({"angle_deg": 10, "R": 10, "scale": np.nan}, "scale is nan; a factor above 0"),
    ],
)
def test_arrays_that_cannot_be_meant(arguments: dict[str, object], text: str) -> None:
    with pytest.raises(MeasurementError, match=text):
        Measurement.from_columns(**arguments)


def test_a_measurement_is_shown_on_one_line() -> None:
    """All of its numbers had been, 600 lines of them."""
    m = Measurement.from_columns(np.linspace(0, 80, 500), 0.6, R_s=np.full(500, 0.3), source="lab")
    assert repr(m).startswith("Measurement(lab: took 500 values of R_s")
    assert "\n" not in repr(m) and len(repr(m)) < 200


def test_a_measurement_cannot_be_written_to() -> None:
    given = np.array([10.0, 20.0])
    m = Measurement.from_columns(given, R_s=[0.1, 0.2])
    with pytest.raises(ValueError, match="read-only"):
        m.value[0] = 0.5
    with pytest.raises(AttributeError):
        m.source = "other"  # type: ignore[misc]
    given[0] = 50.0
    assert m.angle_deg[0] == 10.0
    with pytest.raises(ValueError, match="read-only"):
        m.where(m.quantity == "R_s").angle_deg[0] = 5.0


def test_the_far_infrared_has_its_unit() -> None:
    waves = [150.0, 1000.0]
    far = Measurement.from_columns(10, waves, R=0.1, wavelength_unit="um")
    assert far.wavelength_um.tolist() == waves
    assert Measurement.from_columns(10, [5.0, 150.0], R=0.1).wavelength_um.tolist() == [5.0, 150.0]


def test_the_wavelengths_of_a_table_are_in_one_unit() -> None:
    """Micrometres were taken for nanometres where a column of these was there too."""
    table = {"angle_deg": [10, 20], "wavelength_nm": [400.0, 500.0], "R": [0.1, 0.2]}
    assert read_csv(table).wavelength_um.tolist() == [0.4, 0.5]
    with pytest.raises(MeasurementError, match="gives wavelengths, and wavelength_um=0.6 came"):
        read_csv(table, wavelength_um=0.6)
    with pytest.raises(MeasurementError, match="'wavelength_nm' and .* 'wavelength_um' both"):
        read_csv({**table, "wavelength_um": [0.4, 0.5]})
    with pytest.raises(MeasurementError, match="table with named columns was wanted"):
        read_csv([0.1])  # type: ignore[arg-type]
