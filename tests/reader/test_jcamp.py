"""JCAMP-DX: numbers written out are read; packed ones and what contradicts itself are refused."""

from pathlib import Path

import pytest

from tests.truth.reading import read, refusal

HEAD = """##TITLE= a made-up plate
##JCAMP-DX= 4.24 $$ numbers of no instrument
##DATA TYPE= INFRARED SPECTRUM
##XUNITS= {x}
##YUNITS= {y}
##XFACTOR= {xf}
##YFACTOR= {yf}
##FIRSTX= {first}
##LASTX= {last}
##NPOINTS= {n}
##FIRSTY= {firsty}
##XYDATA= (X++(Y..Y))
"""
Y = (9123, 9204, 9204, 9204, 8801, 7345, 6120, 5999, 6501, 7000, 7000, 12)
# 400, 402, ... 422
FORMS = {
    "AFFN": "400 9123 9204 9204 9204 8801\n410 7345 6120 5999 6501 7000 7000\n422 12\n",
    "AFFN with points": "400. 9123. 9204 9204 9204 8801 7.345E+03\n412 6120 5999 6501 7000 7000 12",
    "comments": "400 9123 9204 9204 9204 8801 $$ 1\n$$ 2\n410 7345 6120 5999 6501 7000 7000 12",
}


def file(table: str, **other: object) -> str:
    given = {"x": "1/CM", "y": "TRANSMITTANCE", "xf": 1, "yf": "0.0001"}
    given |= {"first": 400, "last": 422, "n": len(Y), "firsty": "0.9123"}
    return HEAD.format(**(given | other)) + table.rstrip("\n") + "\n##END=\n"


@pytest.mark.parametrize("form", FORMS)
def test_every_form_gives_the_numbers_to_the_last_bit(tmp_path: Path, form: str) -> None:
    m = read(tmp_path, file(FORMS[form]), "plate.jdx", angle_deg=0)
    assert m.value.tolist() == [y / 10000 for y in Y]
    assert m.wavelength_um.tolist() == [1e4 / (400 + 2 * i) for i in range(len(Y))]
    assert set(m.quantity) == {"T"} and "a JCAMP-DX file: 12 points" in m.understood


PACKED = {  # the same ordinates, packed; and the example of the standard
    "PAC": "400+9123+9204+9204+9204+8801\n410+7345+6120+5999+6501+7000+7000+12\n",
    "SQZ": "400I123I204I204I204H801\n410G345F120E999F501G000G000A2\n",
    "SQZ of exponents": "400 E5 1E5 1E5\n",
    "DUP": "400I123I204UH801\n410G345F120E999F501G000TA2\n",
    "DIF": "400I123Q1%%m03\n408H801j456j225j21N02M99\n418G000%o988\n422A2\n",
    "repeated numbers": "400 9123 9204U\n",
}


@pytest.mark.parametrize("form", PACKED)
def test_packed_tables_are_refused_by_name(tmp_path: Path, form: str) -> None:
    text = refusal(tmp_path, file(PACKED[form]), "plate.jdx", angle_deg=0)
    assert "line 13: " in text and "packed (PAC, SQZ, DIF, DUP)" in text and "AFFN" in text


PAIRS = (
    "400, 40; 500,41.5;\n600.5 , 43\n",
    "400 40\n500 41.5\n600.5 43",
    "400,40 500,41.5 600.5,43",
)


def test_units_percent_pairs_and_gaps(tmp_path: Path) -> None:
    points = HEAD.replace("##XYDATA= (X++(Y..Y))", "##XYPOINTS= (XY..XY)")
    said = {"xf": 1, "yf": 1, "first": 400, "last": 600.5, "n": 3, "firsty": 40}
    for y in ("% REFLECTANCE", "PERCENT REFLECTANCE", "%R", "REFLECTANCE (%)"):
        head = points.format(x="NANOMETERS", y=y, **said)
        for table in (
            "400, 40; 500,41.5;\n600.5 , 43\n",
            "400 40\n500 41.5\n600.5 43",
            "400,40 500,41.5 600.5,43",
        ):
            m = read(tmp_path, head + table + "\n##END=\n", "mirror.dx", angle_deg="8")
            assert m.value.tolist() == [0.4, 0.415, 0.43] and set(m.quantity) == {"R"}
            assert m.wavelength_um.tolist() == [0.4, 0.5, 0.6005]
    gap = FORMS["AFFN"].replace("6120", "?")
    m = read(tmp_path, file(gap, x="MICROMETERS", xf="0.01", first=4, last="4.22"), angle_deg=0)
    assert len(m) == 11 and m.wavelength_um[:2].tolist() == [4.0, 4.02]
    peaks = points.replace("XYPOINTS", "PEAK TABLE").format(x="nm", y="%T", **said)
    table = "400,40 500,41.5 600.5,43\n"
    assert read(tmp_path, peaks + table, angle_deg=0).value.tolist() == [0.4, 0.415, 0.43]
    for first, last in (("400,", "399,"), ("600.5", "602")):
        assert "##" in refusal(tmp_path, peaks + table.replace(first, last), angle_deg=0)
    wrong = refusal(tmp_path, peaks + table.replace("43", "forty"), angle_deg=0)
    assert "line 13" in wrong and "pairs x, y" in wrong


WRONG = {
    "a lost point": (FORMS["AFFN"].replace(" 5999", ""), {}, 15, "x = 422"),
    "a lost line": (
        FORMS["AFFN"].replace("410 7345 6120 5999 6501 7000 7000\n", ""),
        {},
        14,
        "x = 422",
    ),
    "too few": (FORMS["AFFN"].replace("422 12\n", ""), {}, 12, "##NPOINTS= says 12"),
    "too many": (FORMS["AFFN"] + "424 5\n", {}, 12, "##NPOINTS= says 12"),
    "wrong first": (FORMS["AFFN"], {"first": 300, "last": 322}, 13, "##FIRSTX="),
    "wrong factor": (FORMS["AFFN"], {"yf": "0.001"}, 11, "YFACTOR"),
    "glued": (FORMS["AFFN"].replace("9123", "9.12.3"), {}, 13, "AFFN"),
    "no ordinate": (FORMS["AFFN"].replace("9123", "x9"), {}, 13, "AFFN"),
    "no abscissa": ("? 1\n", {}, 13, "an abscissa"),
    "no ordinates": ("400\n", {}, 13, "an abscissa"),
    "no count": (FORMS["AFFN"], {"n": "many"}, 10, "NPOINTS"),
    "absorbance": (FORMS["AFFN"], {"y": "ABSORBANCE"}, 5, "10^-A"),
    "reflectance in log": (FORMS["AFFN"], {"y": "LOG(1/R)"}, 5, "REFLECTANCE"),
    "frequency of NMR": (FORMS["AFFN"], {"x": "HZ"}, 4, "NANOMETERS"),
    "a second block": (FORMS["AFFN"] + "##TITLE= other\n", {}, 2, "2 blocks"),
    "another table": (FORMS["AFFN"] + "##XYPOINTS= (XY..XY)\n", {}, 2, "2 blocks"),
    "twice": (FORMS["AFFN"] + "##FIRSTX= 401\n", {}, 16, "second record"),
}


@pytest.mark.parametrize("what", WRONG)
def test_contradictions_are_refused_with_their_line(tmp_path: Path, what: str) -> None:
    table, said, line, why = WRONG[what]
    text = refusal(tmp_path, file(table, **said), "plate.jdx", angle_deg=0)
    assert f"line {line}:" in text and why in text, text


def test_records_that_the_table_needs(tmp_path: Path) -> None:
    whole = file(FORMS["AFFN"])
    for label in ("XUNITS", "YUNITS", "XFACTOR", "YFACTOR", "FIRSTX", "LASTX", "NPOINTS"):
        lines = [line for line in whole.splitlines() if not line.startswith("##" + label)]
        assert f"##{label}=" in refusal(tmp_path, "\n".join(lines), angle_deg=0)
    assert "no ##XYDATA=" in refusal(tmp_path, whole.replace("##XYDATA", "##NTUPLES"), angle_deg=0)
    other = whole.replace("(X++(Y..Y))", "(X++(R..R))")
    assert "line 12: the table has the form (X++(R..R))" in refusal(tmp_path, other, angle_deg=0)


def test_the_reader_goes_on_as_with_any_table(tmp_path: Path) -> None:
    text = file(FORMS["AFFN"])
    assert "12 wavelengths" in read(tmp_path, text, "a.dx", angle_deg=8).understood
    titled = text.replace("a made-up plate", "angle of incidence: 8 deg")
    m = read(tmp_path, titled, "a.dx")
    assert set(m.angle_deg) == {8.0} and "line 1" in m.understood
    assert len(read(tmp_path, text, lines="13-14", angle_deg=0)) == 11
    assert len(read(tmp_path, text, lines="14-", angle_deg=0)) == 7
    raw = file(FORMS["AFFN"], y="ARBITRARY UNITS")
    said = refusal(tmp_path, raw, angle_deg=0)
    assert "line 12" in said and "--columns" in said
    high = file(FORMS["AFFN"], yf="0.01", firsty="91.23")
    assert "line 13" in refusal(tmp_path, high, angle_deg=0)
    percent = read(tmp_path, high, scale=0.01, angle_deg=0)
    assert percent.value.tolist() == [y / 100 / 100 for y in Y]
