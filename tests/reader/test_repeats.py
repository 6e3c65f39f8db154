"""Tables that hold their rows twice."""

import numpy as np
import pytest

from fitting import Measurement, read_csv

ANGLES = np.linspace(20.0, 80.0, 14)
R_s, R_p = 0.1 + 0.3 * np.random.default_rng(0).random((2, 14))


def _same(a, b):
    for name in ("angle_deg", "wavelength_um", "quantity", "value", "sigma", "polarizer_deg"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))


@pytest.mark.parametrize("repeat", [np.repeat, np.tile])
def test_copies_of_rows_are_left_out(repeat):
    angle, s, p = (repeat(a, 3) for a in (ANGLES, R_s, R_p))
    m = Measurement.from_columns(angle, R_s=s, R_p=p)
    _same(m, Measurement.from_columns(ANGLES, R_s=R_s, R_p=R_p))
    assert m.understood.endswith("56 exact copies of rows left out")


def test_a_file_that_holds_its_table_twice(tmp_path):
    rows = "".join(f"{a},{s},{p}\n" for a, s, p in zip(ANGLES, R_s, R_p, strict=True))
    once, twice = tmp_path / "once.csv", tmp_path / "twice.csv"
    once.write_text("angle,R_s,R_p\n" + rows)
    twice.write_text("angle,R_s,R_p\n" + rows + rows)
    _same(read_csv(once), read_csv(twice))
    assert "28 exact copies of rows left out" in read_csv(twice).understood


def test_repeats_that_scatter_are_all_kept():
    """Though most values, which are printed with three digits, are the same."""
    angle = np.tile(ANGLES, 3)
    R = np.tile(np.round(R_s, 3), 3)
    R[20] += 0.001
    m = Measurement.from_columns(angle, R_s=R)
    assert len(m) == 42
    assert "copies" not in m.understood
    other = Measurement.from_columns(angle, R_s=np.tile(R_s, 3), sigma=np.arange(1, 43) / 1e3)
    assert len(other) == 42
