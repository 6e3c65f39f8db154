"""Options that the reader refuses, and what its refusals call them."""

from pathlib import Path

import numpy as np
import pytest

from fitting.command.cli import main
from fitting.data.measurement import MeasurementError
from fitting.measured_file import read_csv
from tests.truth.reading import read, refusal
from tests.truth.varieties import BODY


@pytest.mark.parametrize(
    "options",
    [
        {"columns": "angle=1"},
        {"columns": "angle=9,R=2"},
        {"columns": "angle=1,R=1"},
        {"columns": "place=1,R=2"},
        {"columns": 5},
        {"columns": "angle=1,R=twice"},
        {"angle_unit": "furlong"},
        {"wavelength_unit": "deg"},
        {"psi_unit": "percent"},
        {"polarization": "left"},
        {"polarization": "0=s,1=x"},
        {"polarization": "p"},
        {"polarization": "angle-from-p"},
        {"scale": 0},
        {"scale": "-1"},
        {"scale": "nan"},
        {"sigma": "inf"},
        {"sigma": 0},
        {"angle_deg": 91},
        {"angle_deg": 45},
        {"wavelength_um": 0},
        {"lines": "all"},
        {"lines": "9-3"},
        {"lines": "50-60"},
        {"delimiter": "word"},
        {"delimiter": ",", "decimal": ","},
        {"decimal": "x"},
        {"encoding": "no-such-encoding"},
        {"encoding": "ascii"},
    ],
)
def test_an_option_that_means_nothing_is_refused(
    tmp_path: Path, options: dict[str, object]
) -> None:
    wide = BODY.replace("\n", ",1,1\n")
    text = refusal(tmp_path, "angle_deg,R_s,H\u00f6he,twice,twice\n" + wide, **options)
    assert "--" + next(iter(options)).replace("_", "-") in text or "lines" in options


def test_options_that_contradict_the_file(tmp_path: Path) -> None:
    long = "aoi,pol,R\n10,s,.1\n20,p,.2\n"
    assert "--polarization came too" in refusal(tmp_path, long, polarization="s")
    assert "none of angle" in refusal(tmp_path, long, columns="place=1,R=3")


def test_the_other_decimal_mark_is_no_number(tmp_path: Path) -> None:
    text = refusal(tmp_path, "angle;R_s\n10;0.5\n20;0.6\n", decimal=",")
    assert "line 2" in text and "'0.5'" in text and "','" in text


@pytest.mark.parametrize("name", ["dR/R", "rel. error", "relative error (%)"])
def test_the_advice_for_relative_errors_does_not_take_them_for_absolute_ones(tmp_path, name):
    text = f"angle_deg,R,{name}\n30,.3,.01\n40,.31,.01\n50,.33,.01\n"
    with pytest.raises(MeasurementError, match="relative error") as refusal:
        read(tmp_path, text)
    assert "sigma" not in str(refusal.value) and 'columns="angle=1,R=2" ' in str(refusal.value)
    assert np.isnan(read(tmp_path, text, columns="angle=1,R=2").sigma).all()


def test_an_error_names_arguments_in_python_and_options_on_the_command_line(tmp_path, capsys):
    text = "wavelength_nm,R\n500,20\n600,30\n"
    file = tmp_path / "a.csv"
    file.write_text(text)
    with pytest.raises(MeasurementError, match=r"percent, say scale=0\.01\."):
        read_csv(file)
    assert main([str(file)]) == 2
    assert "percent, say --scale 0.01." in capsys.readouterr().err


@pytest.mark.parametrize("option, argument", {
    "say --scale 0.01.": "say scale=0.01.", "(--angle-deg)": "(angle_deg)",
    "--decimal , if it is": 'decimal="," if it is', "--columns leaves out": "columns leaves out",
    "with --columns angle=..., or": 'with columns="angle=...", or',
    "--psi-unit deg or --psi-unit rad.": 'psi_unit="deg" or psi_unit="rad".',
    "--missing=-99 if": 'missing="-99" if', "--lines A-B; else": 'lines="A-B"; else',
}.items())  # fmt: skip
def test_options_as_arguments(option, argument):
    assert str(MeasurementError(f"a.csv: {option}")) == f"a.csv: {argument}"
