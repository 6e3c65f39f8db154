"""Buffers, data frames, xarray and spreadsheets, which the reader of files takes too."""

from __future__ import annotations

import io
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from fitting import Measurement, MeasurementError, fit, read_csv

FRAME = {"Angle (deg)": [30.0, 45.0, 60.0], "Rs": [0.1, 1 / 3, 0.4], "R_TM": [0.1, 0.05, np.nan]}
TEXT = "Angle (deg),Rs,R_TM\n30,0.1,0.1\n45,0.3333333333333333,0.05\n60,0.4,\n"


def columns(m: Measurement) -> list[Any]:
    return [m.angle_deg.tolist(), m.quantity.tolist(), m.value.tolist()]


def workbook(sheets: dict[str, list[list[Any]]], percent: str = "") -> bytes:
    """Return a spreadsheet; the cells of column B are shown in percent where it says so."""
    openpyxl = pytest.importorskip("openpyxl", reason="the extra 'spreadsheet' is not installed")
    book = openpyxl.Workbook()
    book.remove(book.active)
    for name, rows in sheets.items():
        sheet = book.create_sheet(name)
        for row in rows:
            sheet.append(row)
        for cell in sheet["B"] if percent and rows else ():
            cell.number_format = percent
    out = io.BytesIO()
    book.save(out)
    return out.getvalue()


def rows_of(frame: dict[str, Any]) -> list[list[Any]]:
    numbers: list[list[Any]] = [
        [None if x != x else x for x in row] for row in zip(*frame.values(), strict=True)
    ]
    return [["a wafer"], [], [*frame], *numbers]


@pytest.mark.parametrize("source", [
    io.StringIO(TEXT), io.BytesIO(TEXT.encode("utf-16")), FRAME, pd.DataFrame(FRAME),
    pd.DataFrame(FRAME).set_index("Angle (deg)"), pd.DataFrame(FRAME).astype({"R_TM": "Float64"}),
    xr.Dataset.from_dataframe(pd.DataFrame(FRAME).set_index("Angle (deg)")),
], ids=lambda source: type(source).__name__)  # fmt: skip
def test_everything_is_read_as_the_file_of_it(source: Any, tmp_path: Path) -> None:
    path = tmp_path / "scan.csv"
    path.write_text(TEXT)
    wanted = columns(read_csv(path))
    assert wanted == [[30.0, 45.0, 60.0, 30.0, 45.0], ["R_s"] * 3 + ["R_p"] * 2,
                      [0.1, 1 / 3, 0.4, 0.1, 0.05]]  # fmt: skip
    assert columns(read_csv(source)) == wanted


def test_spreadsheets(tmp_path: Path) -> None:
    path = tmp_path / "scan.xlsx"
    path.write_bytes(workbook({"gold": rows_of(FRAME), "empty": []}))
    m = read_csv(path)
    assert columns(m) == columns(read_csv(FRAME)) and "sheet 'gold'" in m.understood
    both = workbook({"gold": rows_of(FRAME), "glass 60 deg": rows_of({**FRAME, "Rs": [1, 0.5, 2]})})
    with pytest.raises(MeasurementError, match="sheet=\"NAME\" .* 'gold', 'glass 60 deg'"):
        read_csv(io.BytesIO(both))
    with pytest.raises(MeasurementError, match=r"buffer, line 6, column Rs: reflectance 2 is"):
        read_csv(io.BytesIO(both), sheet="Glass 60 deg")
    assert columns(read_csv(io.BytesIO(both), sheet="gold")) == columns(m)
    options: tuple[Any, ...] = (
        {"sheet": "iron"},
        {"sheet": "gold", "encoding": "utf-8"},
        {"delimiter": ";"},
    )
    for bad in options:
        with pytest.raises(MeasurementError):
            read_csv(path, **bad)


def test_a_spreadsheet_in_percent_is_read_as_it_is_shown() -> None:
    rows = [["wavelength (nm)", "R (%)"], [400.0, 0.357], [500.0, 0.25]]
    assert read_csv(io.BytesIO(workbook({"a": rows}, "0.0%"))).value.tolist() == [35.7 / 100, 0.25]


def test_the_name_of_a_sheet_is_heard() -> None:
    """A spectrum of a sheet "60 deg" was one at normal incidence."""
    rows = [["wavelength (nm)", "R"], [400.0, 0.3], [500.0, 0.2]]
    with pytest.raises(MeasurementError, match="angle_deg=60"):
        read_csv(io.BytesIO(workbook({"60 deg": rows})))


def test_units_of_xarray_are_attributes() -> None:
    wavelength = ("wavelength", [400.0, 500.0], {"units": "nm"})
    R = xr.DataArray([10.0, 20.0], dims="wavelength", coords={"wavelength": wavelength}, name="R")
    for percent in (R.assign_attrs(units="percent"), R.to_dataset()):
        scale = None if "units" in percent.attrs else 0.01
        m = read_csv(percent, scale=scale)
        assert m.wavelength_um.tolist() == [0.4, 0.5] and m.value.tolist() == [0.1, 0.2]


def test_without_openpyxl_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    book = workbook({"a": rows_of(FRAME)})
    monkeypatch.setitem(sys.modules, "openpyxl", None)
    with pytest.raises(ImportError, match="pip install openpyxl .*'spreadsheet'"):
        read_csv(io.BytesIO(book))


def test_tables_that_are_none() -> None:
    with pytest.raises(MeasurementError, match="buffer: no row with two numbers"):
        read_csv(io.StringIO(""))
    for bad in ([0.1, 0.2], np.zeros(3), 7):
        with pytest.raises(MeasurementError, match="table with named columns was wanted"):
            read_csv(bad)
    with pytest.raises(MeasurementError, match="one length"):
        read_csv({"angle_deg": [1, 2], "R": [0.1, 0.2, 0.3]})
    with pytest.raises(MeasurementError, match="sheet x is for a spreadsheet"):
        read_csv(FRAME, sheet="x")
    with pytest.raises(MeasurementError, match="encoding is for text"):
        read_csv(FRAME, encoding="utf-8")
    every: tuple[Any, ...] = (pd.DataFrame(FRAME), "gold.csv", FRAME)
    for came in every:
        with pytest.raises(ValueError, match=r"came where a Measurement .*fit\(read_csv\("):
            fit(came)


def test_a_reference_is_a_column_of_the_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = "angle,R_s,sigma_R_s,I0\n30,1.0,0.1,4.0\n45,1.5,0.1,5.0\n60,2.4,0.1,6.0\n"
    m = read_csv(io.StringIO(text), divide_by="I0")
    assert m.value.tolist() == [0.25, 0.3, 2.4 / 6.0]
    assert m.sigma.tolist() == [0.1 / 4.0, 0.1 / 5.0, 0.1 / 6.0]
    assert "divided by column I0" in m.understood and "not used" not in m.understood
    # a file of counts
    counts = text.replace("R_s,sigma_R_s", "I (counts),dI (counts)")
    options: Any = {"columns": "angle=1,R_s=2,sigma_R_s=3", "divide_by": "i0"}
    assert read_csv(io.StringIO(counts), **options).value.tolist() == m.value.tolist()
    with pytest.raises(MeasurementError, match="the value of R_s at 45 degrees is 0"):
        read_csv(io.StringIO(text.replace("5.0", "0")), divide_by="I0")
    with pytest.raises(MeasurementError, match="neither a file nor a column; .* I0"):
        read_csv(io.StringIO(text), divide_by="I1")
    monkeypatch.chdir(tmp_path)
    Path("I0").write_text(text)
    with pytest.raises(MeasurementError, match=r"a column and a file.*\./I0"):
        read_csv(io.StringIO(text), divide_by="I0")
