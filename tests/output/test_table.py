"""What people read of a fit: its table, its one line, its cell in a notebook."""

import math

import numpy as np
import pytest
from scipy.optimize import least_squares

from fitting import fit, fit_many
from fitting.data.measurement import Measurement, concatenate
from fitting.measured_file import read_csv
from fitting.output.page import fit_page
from tests.truth.simulated import GOLD, simulated, textbook


@pytest.fixture(scope="module")
def gold():
    return fit(read_csv(GOLD), errors="scaled")


@pytest.fixture(scope="module")
def spectrum():
    """Three wavelengths: a metal, lossless glass, and one angle of normal incidence."""
    metal = simulated(0.5, 2.2, 1e-3, wavelength_um=0.5)
    glass = simulated(1.5, 0.0, 1e-3, wavelength_um=0.6)
    normal = Measurement.from_columns(0.0, 0.7, sigma=1e-3, R=0.3, source="simulated")
    return fit(concatenate(metal, glass, normal))


def one_line(text):
    return " ".join(str(text).split())


def test_the_gold_table_holds_what_an_independent_fit_finds(gold):
    m = gold.measurement
    found = least_squares(
        lambda p: (textbook(m.angle_deg, m.quantity, *p) - m.value) / m.sigma,
        [0.5, 2.0],
        xtol=1e-14,
    )
    chi2 = (found.fun**2).sum()
    sigma = np.sqrt(np.diag(np.linalg.inv(found.jac.T @ found.jac)) * chi2 / (len(m) - 2))
    text = str(gold)
    for name, value, error in zip(("eta", "k"), found.x, sigma, strict=True):
        row = next(line.split() for line in text.splitlines() if line.split()[:1] == [name])
        # Both stop within a hundredth of a standard error; the table rounds to a twentieth.
        assert float(row[1]) == pytest.approx(value, abs=0.06 * error)
        assert row[2] == "+-"
        assert float(row[3]) == pytest.approx(error, rel=0.06)
        interval = gold.parameters[name].interval
        assert float(row[4]) == pytest.approx(interval[0], abs=0.06 * error)
        assert float(row[6]) == pytest.approx(interval[1], abs=0.06 * error)
        assert " ".join(row[7:]) == "(profile likelihood)"
    assert f"chi2/dof     {chi2 / (len(m) - 2):.1f}" in text
    for part in ("16 R_s and 15 R_p", "eta and k +0.969", "rms", "converged", "warning"):
        assert part in text
    assert "95 % interval" in text and "29 degrees of freedom" in text
    assert max(map(len, text.splitlines())) <= 80


def test_equal_weights_have_no_chi2_in_the_table(gold):
    text = str(fit(gold.measurement, errors="equal"))
    assert "chi2" not in text
    assert "scatter" in text


def test_what_the_data_do_not_determine_gets_no_error(spectrum):
    m = spectrum.measurement
    text = str(fit(m.where(m.wavelength_um == 0.7)))
    assert "+-" not in text.replace("value +- std. error", "")
    assert "one of many that fit equally well" in text
    assert "circle" in text


def test_glass_gets_an_upper_limit_of_k(spectrum):
    m = spectrum.measurement
    result = fit(m.where(m.wavelength_um == 0.6))
    limit = result.parameters["k"].upper_limit
    assert math.isfinite(limit)
    row = next(r for r in str(result).splitlines() if r.split()[:1] == ["k"])
    assert f"(< {limit:#.2g})" in row
    assert "95 % upper limit" in row


def test_a_spectrum_has_one_line_a_wavelength(spectrum):
    lines = str(spectrum).splitlines()
    rows = [line.split() for line in lines if line.split()[:1] in (["0.5"], ["0.6"], ["0.7"])]
    assert [row[0] for row in rows] == ["0.5", "0.6", "0.7"]
    assert "+-" in rows[0]
    assert rows[2][1].startswith("(")  # in brackets: one of many
    assert "undetermined" in rows[2]
    counts = next(line for line in lines if "3 wavelengths" in line)
    assert "1 undetermined" in counts
    told = [line for line in lines if line.strip().startswith("warning ")]
    assert any("circle" in text or "not determined" in text for text in told)
    # Each row names the warnings that are told below.
    marks = [row[next(i for i, x in enumerate(row) if x.endswith("ed")) + 1 :] for row in rows]
    assert {mark for row in marks for mark in row} == {line.split()[1] for line in told}


def test_warnings_of_one_kind_are_told_once():
    m = concatenate(
        *(Measurement.from_columns(0.0, w, R=r) for w, r in ((0.4, 0.2), (0.5, 0.3), (0.6, 0.4)))
    )
    found = fit(m)
    text = one_line(found)
    assert text.count("circle") == 1
    # The column "warnings" of the table refers to this number.
    assert "warning 1 " in text and "Warning 1: " in fit_page(found, b"")
    assert "(at 0.4 um; with other numbers at 2 more wavelengths)" in text


def test_what_to_do_where_an_index_is_not_determined():
    mirror = Measurement.from_columns(0.0, [0.4, 0.5, 0.6], R=[0.9, 0.91, 0.92])
    text = one_line(fit(mirror))
    assert "what to do measure s and p at several angles" in text and "sample 'auto'" in text
    one = Measurement.from_columns(0.0, 0.5, R=[0.9])
    text = one_line(fit(one))
    assert "what to do measure s and p" in text and "sample 'auto'" not in text
    assert "what to do" not in str(fit(simulated(1.5, 0.0, 1e-3)))


def test_the_repr_is_one_line(gold, spectrum):
    assert repr(gold) == (
        "<Fit: gold_532nm.csv, eta 0.344 +- 0.022, k 1.820 +- 0.087, converged, "
        f"{len(gold.warnings)} warning{'s' * (len(gold.warnings) > 1)}>"
    )
    assert repr(spectrum) == "<Fit: simulated, 2 converged, 1 undetermined, 2 with warnings>"


def test_a_batch_without_data_is_told_curve_by_curve():
    angles = np.array([30.0, 50.0, 65.0, 75.0, 82.0])
    of = {q: textbook(angles, np.full(5, q), 0.5, 2.2) for q in ("R_s", "R_p")}
    noise = 1e-3 * np.random.default_rng(1).normal(size=(2, 3, 5))
    found = fit_many(angles, R_s=of["R_s"] + noise[0], R_p=of["R_p"] + noise[1])
    lines = str(found).splitlines()
    assert lines[0] == "3 curves"
    rows = [line.split() for line in lines if line.split()[:1] in (["0"], ["1"], ["2"])]
    assert [row[1] for row in rows] == [f"{found.eta[i]:.{len(r[1]) - 2}f}" for i, r in
                                        enumerate(rows)]  # fmt: skip
    assert "3 curves: 3 converged" in one_line(found)
    assert repr(found) == "<Fit: 3 curves, 3 converged>"


@pytest.mark.study
def test_a_batch_of_very_many_curves_is_told_by_its_ends():
    angles = np.array([30.0, 50.0, 65.0, 75.0, 82.0])
    of = {q: textbook(angles, np.full(5, q), 0.5, 2.2) for q in ("R_s", "R_p")}
    noise = 1e-3 * np.random.default_rng(1).normal(size=(2, 1000, 5))
    found = fit_many(angles, R_s=of["R_s"] + noise[0], R_p=of["R_p"] + noise[1])
    lines = str(found).splitlines()
    assert len(lines) < 80
    assert sum(line.strip() == "..." for line in lines) == 1
    assert any(line.split()[:1] == ["999"] for line in lines)


def test_a_file_name_cannot_write_to_the_terminal():
    m = Measurement.from_columns(
        [40.0, 60.0, 70.0, 80.0], source="a\x1b[31m.csv", R_s=[0.80, 0.86, 0.90, 0.95]
    )
    found = fit(m)
    for text in (str(found), repr(found), found._repr_html_()):
        assert "\x1b" not in text
        assert "a\\x1b[31m.csv" in text


def test_the_cell_of_a_notebook_holds_what_the_table_does(gold, spectrum):
    text = gold._repr_html_()
    for part in ("gold_532nm.csv", "0.344 +- 0.022", "profile likelihood", "reduced chi2",
                 "Parameters", "class=fresnel-fit"):  # fmt: skip
        assert part in text
    # Its style holds for the cell alone.
    style = text.partition("<style>")[2].partition("</style>")[0]
    assert all(
        line.startswith(".fresnel-fit ") for line in style.strip().splitlines() if line.strip()
    )
    text = spectrum._repr_html_()
    assert "Index over wavelength" in text and "1 undetermined" in text
