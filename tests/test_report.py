"""What people and scripts read of a fit: the table, JSON and CSV."""

import csv
import io
import json
import math

import numpy as np
import pytest
from scipy.optimize import least_squares
from simulated import GOLD, simulated, textbook

from fitting.index.curves import fitted_values
from fitting.index.fit import fit
from fitting.measurement import Measurement, concatenate, read_csv
from fitting.output import export, report
from fitting.plain_data import plain


@pytest.fixture(scope="module")
def gold():
    measurement = read_csv(GOLD)
    return fit(measurement), measurement


@pytest.fixture(scope="module")
def spectrum():
    """Three wavelengths: a metal, lossless glass, and one angle of normal incidence."""
    metal = simulated(0.5, 2.2, 1e-3, wavelength_um=0.5)
    glass = simulated(1.5, 0.0, 1e-3, wavelength_um=0.6)
    normal = Measurement.from_columns(0.0, 0.7, sigma=1e-3, R=0.3, source="simulated")
    measurement = concatenate(metal, glass, normal)
    return fit(measurement), measurement


@pytest.mark.parametrize(
    ("value", "sigma", "text"),
    [
        (0.34428, 0.02201, "0.344 +- 0.022"),
        (1.8203, 0.0867, "1.820 +- 0.087"),
        (1.5, 0.0996, "1.50 +- 0.10"),  # the error rounds up into the next decade
        (1.5, 0.0994, "1.500 +- 0.099"),
        (12.3, 4.5, "12.3 +- 4.5"),
        (123.4, 45.6, "123 +- 46"),
        (5e-8, 1.2e-8, "(5.0 +- 1.2)e-08"),
        (0.0012, 1e-5, "0.001200 +- 0.000010"),
        (0.999984387, 4.9e-8, "0.999984387 +- 0.000000049"),
        (1.86e-7, 4.7e-7, "(1.9 +- 4.7)e-07"),
        (5e-12, 1.2e-13, "(5.00 +- 0.12)e-12"),
        (1.0, math.nan, "1"),
        (1.2345678, math.nan, "1.23457"),
        (1.5, 1e-16, "1.5 +- 1e-16"),
        (math.nan, math.nan, "-"),
        (12345.0, 678.0, "(1.234 +- 0.068)e+04"),
    ],
)
def test_a_value_is_given_to_the_second_digit_of_its_error(value, sigma, text):
    assert report.with_error(value, sigma) == text


def test_the_gold_table_holds_what_an_independent_fit_finds(gold):
    result, m = gold
    found = least_squares(
        lambda p: (textbook(m.angle_deg, m.quantity, *p) - m.value) / m.sigma,
        [0.5, 2.0],
        xtol=1e-14,
    )
    chi2 = (found.fun**2).sum()
    sigma = np.sqrt(np.diag(np.linalg.inv(found.jac.T @ found.jac)) * chi2 / (len(m) - 2))
    text = report.table(result, m)
    for name, value, error in zip(("eta", "k"), found.x, sigma, strict=True):
        row = next(line.split() for line in text.splitlines() if line.split()[:1] == [name])
        # Both stop within a hundredth of a standard error; the table rounds to a twentieth.
        assert float(row[1]) == pytest.approx(value, abs=0.06 * error)
        assert row[2] == "+-"
        assert float(row[3]) == pytest.approx(error, rel=0.06)
    assert f"chi2/dof     {chi2 / (len(m) - 2):.1f}" in text
    for part in ("16 R_s and 15 R_p", "correlation  0.969", "rms", "converged", "warning"):
        assert part in text
    assert max(map(len, text.splitlines())) <= 80


def test_equal_weights_have_no_chi2_in_the_table(gold):
    text = report.table(fit(gold[1], sigma="equal"), gold[1])
    assert "chi2" not in text
    assert "scatter" in text


def test_what_the_data_do_not_determine_gets_no_error(spectrum):
    m = spectrum[1]
    one = m.where(m.wavelength_um == 0.7)
    text = report.table(fit(one), one)
    assert "+-" not in text
    assert "one of many that fit alike" in text
    assert "circle" in text


def test_glass_gets_an_upper_limit_of_k(spectrum):
    m = spectrum[1].where(spectrum[1].wavelength_um == 0.6)
    result = fit(m)
    assert math.isfinite(result.k_upper_limit)
    row = next(r for r in report.table(result, m).splitlines() if r.split()[:1] == ["k"])
    assert f"(< {result.k_upper_limit:#.2g})" in row
    assert "95 % upper limit" in row


def test_a_spectrum_has_one_line_a_wavelength(spectrum):
    result, m = spectrum
    lines = report.table(result, m).splitlines()
    rows = [line.split() for line in lines if line.split()[:1] in (["0.5"], ["0.6"], ["0.7"])]
    assert [row[0] for row in rows] == ["0.5", "0.6", "0.7"]
    assert "+-" in rows[0]
    assert rows[2][1].startswith("(")  # in brackets: one of many
    assert "undetermined" in rows[2]
    counts = next(line for line in lines if "3 wavelengths" in line)
    assert "1 undetermined" in counts
    notes = [line for line in lines if line.strip().startswith("note ")]
    assert any("circle" in note or "not determined" in note for note in notes)


def test_warnings_of_one_kind_are_told_once():
    m = concatenate(
        *(Measurement.from_columns(0.0, w, R=r) for w, r in ((0.4, 0.2), (0.5, 0.3), (0.6, 0.4)))
    )
    text = " ".join(report.table(fit(m), m).split())
    assert text.count("circle") == 1
    assert "at 0.4 um and, with figures of their own, 2 more" in text


def test_json_has_the_names_and_values_of_the_result(gold):
    result, m = gold
    fields = json.loads(export.json_text(result, m))
    assert fields.pop("source") == "gold_532nm.csv"
    assert fields.pop("understood") == m.understood
    assert fields.keys() == result.to_dict().keys()
    assert fields["eta"] == result.eta  # to the last bit
    assert fields["covariance"] == result.covariance.tolist()
    assert fields["k_upper_limit"] is None  # NaN
    assert fields["status"] == "converged"
    assert isinstance(fields["warnings"], list)


def test_json_of_a_spectrum_holds_lists_and_no_nan(spectrum):
    result, m = spectrum

    def refuse(constant):
        raise AssertionError(f"{constant} is not JSON")

    fields = json.loads(export.json_text(result, m), parse_constant=refuse)
    assert fields["wavelength_um"] == [0.5, 0.6, 0.7]
    assert fields["sigma_eta"][2] is None
    assert len(fields["warnings"]) == 3


def test_plain_data_of_every_kind():
    given = {"a": np.float64("nan"), "b": (np.int64(3), math.inf), "c": np.array([[1.0, np.nan]])}
    assert plain(given) == {"a": None, "b": [3, None], "c": [[1.0, None]]}


def rows_of(text):
    return list(csv.DictReader(line for line in io.StringIO(text) if not line.startswith("#")))


def test_csv_of_the_data_reads_back_to_the_last_bit(gold):
    result, m = gold
    fitted = fitted_values(result, m)
    rows = rows_of(export.data_csv(result, m, *fitted))
    assert {float(r["wavelength_um"]) for r in rows} == {0.532}  # by a comment of the file
    assert "polarizer_deg" not in rows[0]
    assert [float(r["angle_deg"]) for r in rows] == m.angle_deg.tolist()
    assert [r["quantity"] for r in rows] == m.quantity.tolist()
    assert [float(r["sigma"]) for r in rows] == m.sigma.tolist()
    expected = textbook(m.angle_deg, m.quantity, result.eta, result.k)
    # The textbook formula loses a few digits itself.
    np.testing.assert_allclose([float(r["fitted"]) for r in rows], expected, rtol=1e-12)
    residual = [float(r["value"]) - float(r["fitted"]) for r in rows]
    assert [float(r["residual"]) for r in rows] == residual
    assert all(float(r["sigma_fitted"]) > 0.0 for r in rows)


def test_csv_of_a_spectrum(spectrum):
    result, m = spectrum
    data = rows_of(export.data_csv(result, m, *fitted_values(result, m)))
    assert [float(r["wavelength_um"]) for r in data] == m.wavelength_um.tolist()
    index = rows_of(export.index_csv(result, m))
    assert [float(r["wavelength_um"]) for r in index] == [0.5, 0.6, 0.7]
    assert [float(r["eta"]) for r in index] == result.eta.tolist()
    assert index[2]["sigma_eta"] == ""
    assert index[2]["status"] == "undetermined"


def test_csv_keeps_the_polariser():
    m = Measurement.from_columns(
        [40.0, 50.0, 60.0, 70.0], polarizer_deg=30.0, R=[0.9, 0.9, 0.91, 0.93]
    )
    result = fit(m)
    rows = rows_of(export.data_csv(result, m, *fitted_values(result, m)))
    assert {r["polarizer_deg"] for r in rows} == {"30.0"}
    assert {r["sigma"] for r in rows} == {""}


def test_what_to_do_where_an_index_is_not_determined():
    mirror = Measurement.from_columns(0.0, [0.4, 0.5, 0.6], R=[0.9, 0.91, 0.92])
    text = " ".join(report.table(fit(mirror), mirror).split())
    assert "what to do measure s and p at several angles" in text and "--model auto" in text
    one = Measurement.from_columns(0.0, 0.5, R=[0.9])
    text = " ".join(report.table(fit(one), one).split())
    assert "what to do measure s and p" in text and "--model" not in text
    glass = simulated(1.5, 0.0, 1e-3)
    assert "what to do" not in report.table(fit(glass), glass)
