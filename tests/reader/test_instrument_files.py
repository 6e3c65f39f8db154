"""Files as the programs of instruments export them, with numbers that no instrument measured."""

import math
from pathlib import Path

import numpy as np
import pytest

from tests.truth.reading import read, refusal

PERKIN_ELMER = """PE UV       SUBTECH     SPECTRUM    ASCII       PEDS        4.00
   -1
plate.Sample.asc
26/01/02
12:00:00.00
26/01/02
12:10:00.00
A. Person
{described}
2
1050L0000000
1.27
0.00
#HDR
-1
-1
#GR
{x}
{y}
1.000000
0.000000
500.000000
-10.000000
{n}
8
91.250000
90.125000
#DATA
500.000000\t91.250000
490.000000\t91.000000
480.000000\t90.125000
"""


def perkin_elmer(**other: object) -> str:
    given = {"x": "nm", "y": "%T", "n": 3, "described": "a made-up plate"}
    return PERKIN_ELMER.format(**(given | other))


def test_perkin_elmer(tmp_path: Path) -> None:
    m = read(tmp_path, perkin_elmer(), "a.asc", angle_deg=0)
    assert m.value.tolist() == [0.9125, 0.91, 0.90125] and set(m.quantity) == {"T"}
    assert m.wavelength_um.tolist() == [0.5, 0.49, 0.48]
    assert "a Perkin-Elmer file: 3 points" in m.understood
    m = read(tmp_path, perkin_elmer(y="%R", described="angle of incidence: 8 deg"), "a.asc")
    assert set(m.quantity) == {"R"} and set(m.angle_deg) == {8.0} and "line 9" in m.understood
    m = read(tmp_path, perkin_elmer(x="CM-1").replace("PE UV", "PE IR"), "a.asc", angle_deg=0)
    assert m.wavelength_um[:2].tolist() == [20.0, 1e4 / 490]


@pytest.mark.parametrize(
    ("said", "line", "why"),
    [
        ({"y": "A"}, 19, "10^-A"),
        ({"y": ""}, 19, "REFLECTANCE or TRANSMITTANCE"),
        ({"x": "SEC"}, 18, "NANOMETERS"),
        ({"n": 4}, 24, "has 3 rows"),
    ],
)
def test_perkin_elmer_refused(tmp_path: Path, said: dict[str, object], line: int, why: str) -> None:
    text = refusal(tmp_path, perkin_elmer(**said), "a.asc", angle_deg=0)
    assert f"line {line}:" in text and why in text, text


def test_perkin_elmer_without_its_marks(tmp_path: Path) -> None:
    assert "#GR" in refusal(tmp_path, perkin_elmer().replace("#DATA", "#END"), "a.asc")
    bad = perkin_elmer().replace("480.000000\t90.125000", "480.000000\t190.125000")
    assert "line 31" in refusal(tmp_path, bad, "a.asc", angle_deg=0)


SPECTRARAY = """; WAVELENGTH 60.20000 60.20000 70.20000 70.20000
400.12500 24.50000 170.25000 10.50000 188.00000 
410.25000 23.50000 171.50000 10.25000 350.75000 
"""  # noqa: W291


def test_spectraray(tmp_path: Path) -> None:
    for text in (SPECTRARAY, SPECTRARAY.replace(".", ",")):
        m = read(tmp_path, text, "film.txt", wavelength_unit="nm")
        psi, delta = (m.where(m.quantity == name) for name in ("psi", "delta"))
        assert psi.value.tolist() == [24.5, 23.5, 10.5, 10.25]
        assert delta.value.tolist() == [170.25, 171.5, 188.0, 350.75]
        assert psi.angle_deg.tolist() == delta.angle_deg.tolist() == [60.2, 60.2, 70.2, 70.2]
        assert psi.wavelength_um.tolist() == [0.400125, 0.41025] * 2
        assert "a SpectraRay file" in m.understood
    assert "--wavelength-unit" in refusal(tmp_path, SPECTRARAY, "film.txt")
    odd = SPECTRARAY.replace("60.20000 60.2", "60.20000 65.2")
    assert "line 1:" in refusal(tmp_path, odd, "film.txt", wavelength_unit="nm")
    short = SPECTRARAY.replace(" 350.75000", "")
    assert "line 3" in refusal(tmp_path, short, "film.txt", wavelength_unit="nm")


PSI, DELTA = (26.5, 15.75, 8.25), (158.5, -173.25, 20.0)


def film_sense() -> str:
    ncs = [
        (math.cos(2 * p), math.sin(2 * p) * math.cos(d), math.sin(2 * p) * math.sin(d))
        for p, d in np.radians(list(zip(PSI, DELTA, strict=True)))
    ]
    return (
        "Film_Sense_Data\n3\t1\t-65.125\t-0.001\t0.002\t19.5\n"
        + "".join(f"{w}\t14.3\t3.4\t2.5\t1.2\t1.4\t0.1\n" for w in ("450.10", "525.63", "650.00"))
        + "".join(f"{n:.5f}\t{c:.5f}\t{s:.5f}\t0.99845\t16.5\n" for n, c, s in ncs)
        + "1\nFit_Diff\t0.0046\nModel: (not saved), Date: 2026-01-02, Temp: 29.8\n"
    )


def test_film_sense(tmp_path: Path) -> None:
    text = film_sense()
    m = read(tmp_path, text, "film.txt")
    psi, delta = (m.where(m.quantity == name) for name in ("psi", "delta"))
    assert psi.value == pytest.approx(PSI, abs=1e-3)  # five decimals of N, C and S
    assert delta.value == pytest.approx(DELTA, abs=3e-3)  # where sin 2 psi is 0.28
    assert psi.wavelength_um.tolist() == [0.4501, 0.52563, 0.65] and set(m.angle_deg) == {65.125}
    assert "a Film Sense file" in m.understood
    lines = text.splitlines()
    damaged = lines[5].replace("0.", "0.9", 1)
    assert "line 6:" in refusal(tmp_path, text.replace(lines[5], damaged), "film.txt")
    assert "line 7:" in refusal(tmp_path, text.replace(lines[6], "0.1\tx"), "film.txt")
    assert "line 2:" in refusal(tmp_path, text.replace("3\t1\t", "3\t2\t"), "film.txt")
    dynamic = text.replace("Sense_Data", "Sense_Dyn_Data")
    assert "over time" in refusal(tmp_path, dynamic, "film.txt")
