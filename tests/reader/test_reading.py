"""The reader: every kind of file to the last bit; units and layouts as their definitions say."""

import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from fitting.data.measurement import Measurement, MeasurementError, concatenate
from tests.truth.reading import ANGLES, ERRORS, NANOMETRES, PERCENT, R_P, R_S, read, refusal, rows
from tests.truth.varieties import VARIETIES


def same(one: Measurement, other: Measurement) -> bool:
    names = ("angle_deg", "wavelength_um", "quantity", "value", "sigma", "polarizer_deg")
    return all(
        np.array_equal(getattr(one, n), getattr(other, n), equal_nan=n != "quantity") for n in names
    )


@pytest.mark.parametrize("kind", VARIETIES)
def test_numbers_are_those_of_the_text_to_the_last_bit(tmp_path: Path, kind: str) -> None:
    variety = VARIETIES[kind]
    m = read(tmp_path, variety.content, variety.name, **variety.options)
    assert sorted(set(m.quantity.tolist())) == sorted(variety.expected)
    assert len(m) == sum(map(len, variety.expected.values()))
    for quantity, texts in variety.expected.items():
        chosen = m.where(m.quantity == quantity)
        assert chosen.value.tolist() == [float(text) for text in texts]
        assert chosen.angle_deg.tolist() == [float(text) for text in variety.angles]
    assert m.understood.startswith("read ") and m.source == variety.name


def _quoted(text: str) -> str:
    last = text.rstrip().splitlines()[-1]
    mark = next((mark for mark in ";\t" if mark in last), "," if "." in last else None)
    lines = [
        mark.join(f'"{cell.strip()}"' for cell in line.split(mark))
        if mark and mark in line and '"' not in line and not line.startswith(("#", "%", "!", ";"))
        else line
        for line in text.split("\n")
    ]
    return "\n".join(lines)


REWRITINGS = {
    "crlf": lambda text: text.replace("\r\n", "\n").replace("\n", "\r\n").encode(),
    "utf-16": lambda text: text.encode("utf-16"),
    "utf-8 mark": lambda text: text.encode("utf-8-sig"),
    "blank lines below": lambda text: (text.rstrip("\n") + "\n\n  \n\n").encode(),
    "blanks at the ends": lambda text: text.replace("\n", "   \n").encode(),
    "quotes": lambda text: _quoted(text).encode(),
}


@pytest.mark.parametrize("rewriting", REWRITINGS)
def test_a_harmless_rewriting_changes_no_bit(tmp_path: Path, rewriting: str) -> None:
    for kind, variety in VARIETIES.items():
        if kind.startswith(("utf", "cr only", "latin", "woollam")):
            continue
        text = variety.content.decode("utf-8-sig")
        plain = read(tmp_path, variety.content, variety.name, **variety.options)
        again = read(tmp_path, REWRITINGS[rewriting](text), variety.name, **variety.options)
        assert same(plain, again), kind


def test_percent_is_one_correctly_rounded_division(tmp_path: Path) -> None:
    text = rows(ANGLES, PERCENT, R_P)
    wanted = [float(p) / 100.0 for p in PERCENT]
    for header in ("R_s (%)", "%R_s", "R_s [percent]", "R_s / %", "R_s_percent"):
        m = read(tmp_path, f"angle_deg,{header},n\n{text}", ignore="n")
        assert m.value.tolist() == wanted and "percent" in m.understood
    m = read(tmp_path, f"angle_deg,R_s,n\n{text}", scale="0.01", ignore=[3])
    assert m.value.tolist() == wanted
    signs = rows(ANGLES, tuple(p + "%" for p in PERCENT))
    assert read(tmp_path, "angle_deg,R_s\n" + signs).value.tolist() == wanted
    assert 57 * 0.01 != 0.57  # why it is a division
    assert read(tmp_path, "angle_deg,R_s\n10,57\n", scale=0.01).value.tolist() == [0.57]


def test_standard_errors_follow_their_values(tmp_path: Path) -> None:
    fraction = read(tmp_path, "angle_deg,R_s,sigma_R_s\n" + rows(ANGLES, R_S, ERRORS))
    assert fraction.sigma.tolist() == [float(e) for e in ERRORS]
    percent = read(tmp_path, "angle_deg,R_s (%),sigma_R_s (%)\n" + rows(ANGLES, PERCENT, ERRORS))
    assert percent.sigma.tolist() == [float(e) / 100.0 for e in ERRORS]
    each = read(tmp_path, "angle,Rs,err,Rp,err\n" + rows(ANGLES, R_S, ERRORS, R_P, R_S))
    assert each.sigma.tolist() == [float(e) for e in ERRORS + R_S]
    given = read(tmp_path, "angle_deg,R_s\n" + rows(ANGLES, R_S), sigma="0.01")
    assert given.sigma.tolist() == [0.01] * 5
    half = "angle_deg,R_s,sigma_R_s,R_p,sigma_R_p\n10,.1,.02,.1,\n20,.2,,.2,\n"
    assert read(tmp_path, half, sigma=0.01).sigma.tolist() == [0.02, 0.01, 0.01, 0.01]
    whole = read(tmp_path, half.replace(".2,,.2", ".2,.03,.2"))
    np.testing.assert_array_equal(whole.sigma, [0.02, 0.03, np.nan, np.nan])
    sides = read(tmp_path, "aoi,R_s,R_p,err_s,err_p\n10,.1,.2,.01,.02\n")
    assert sides.sigma.tolist() == [0.01, 0.02]
    both = read(tmp_path, "aoi,R_s,err (%)\n10,20,1\n20,30,2\n", scale=0.01)
    assert both.sigma.tolist() == [0.01, 0.02]
    other = read(tmp_path, "aoi,R_s,err (%)\n10,1,.25\n20,1.5,.5\n", scale=0.5)
    assert other.sigma.tolist() == [0.125, 0.25]
    psi = read(
        tmp_path,
        "aoi,psi (rad),sigma psi (rad)\n" + rows(("50", "60"), ("0.5", "1"), ("0.01",) * 2),
    )
    assert psi.sigma == pytest.approx([math.degrees(0.01)] * 2, rel=1e-15)


def test_errors_without_a_unit_beside_percent_are_settled_by_the_option(tmp_path: Path) -> None:
    text = "angle_deg,R_s (%),sigma_R_s\n10,60,0.3\n20,61,0.3\n"
    assert "--scale 0.01" in refusal(tmp_path, text)
    assert read(tmp_path, text, scale=0.01).sigma.tolist() == [0.003, 0.003]
    # a unit of their own, in the header or on the numbers, settles it too
    assert read(tmp_path, text.replace("sigma_R_s", "sigma_R_s (%)")).sigma.max() == 0.003


C = 299792458.0  # m/s, SI
H_OVER_E = 6.62607015e-34 / 1.602176634e-19  # V s, SI


@pytest.mark.parametrize(
    ("name", "micrometres"),
    [
        ("wavelength (nm)", lambda x: x / 1e3),
        ("wavelength_um", lambda x: x),
        ("wavelength (\u00c5)", lambda x: x / 1e4),
        ("photon energy (eV)", lambda x: H_OVER_E * C / x * 1e6),
        ("wavenumber (cm\u207b\u00b9)", lambda x: 1e4 / x),
        ("frequency (THz)", lambda x: C / (x * 1e12) * 1e6),
    ],
)
def test_spectral_axes_become_micrometres(tmp_path: Path, name: str, micrometres) -> None:
    numbers = {
        "wavelength_um": ("0.405", "0.5", "1.064"),
        "photon energy (eV)": ("1.1", "2", "3.5"),
    }
    texts = numbers.get(name, ("405", "632.8", "1064"))
    m = read(tmp_path, f"{name},R\n" + rows(texts, R_S[:3]))
    assert m.wavelength_um == pytest.approx([micrometres(float(t)) for t in texts], rel=4e-16)
    assert m.angle_deg.tolist() == [0.0] * 3 and "normal incidence assumed" in m.understood


@pytest.mark.parametrize(
    ("name", "option", "number", "degrees"),
    [
        ("angle_rad", None, "1.2", math.degrees(1.2)),
        ("x", "grazing-deg", "30", 60.0),
        ("Qz (1/nm)", None, "0.01", math.degrees(math.acos(0.01 * 500 / (4 * math.pi)))),
        ("Q (1/\u00c5)", None, "0.001", math.degrees(math.acos(0.001 * 5000 / (4 * math.pi)))),
    ],
)
def test_angles_become_degrees_of_incidence(
    tmp_path: Path, name: str, option: str | None, number: str, degrees: float
) -> None:
    options: dict[str, object] = {"wavelength_um": 0.5} if "Q" in name else {}
    if option:
        options |= {"angle_unit": option, "columns": "angle=1,R_s=2"}
    m = read(tmp_path, f"{name},R_s\n{number},0.5\n{number},0.6\n", **options)
    assert m.angle_deg == pytest.approx([degrees] * 2, rel=1e-14)


def test_units_that_only_look_wrong(tmp_path: Path) -> None:
    x_ray = "grazing angle (deg),wavelength (nm),R\n0.2,0.154,.9\n0.4,0.154,.1\n0.6,0.154,.01\n"
    assert "--wavelength-unit nm" in refusal(tmp_path, x_ray)
    assert read(tmp_path, x_ray, wavelength_unit="nm").angle_deg.tolist() == [89.8, 89.6, 89.4]
    signs = read(tmp_path, "angle,R_s\n0.5\u00b0,.1\n1.0\u00b0,.1\n")
    assert signs.angle_deg.tolist() == [0.5, 1.0]
    by_number = read(
        tmp_path, "x (1/nm),R\n0.01,.1\n0.02,.1\n", columns="angle=1,R=2", wavelength_um=0.1
    )
    assert by_number.angle_deg[1] == pytest.approx(math.degrees(math.acos(2 / (4 * math.pi))))
    assert set(read(tmp_path, "wavelength_um,R\n.5,.1\n.6,.1\n", "gold_s.csv").quantity) == {"R"}


def test_psi_and_delta_in_radians(tmp_path: Path) -> None:
    text = "aoi_deg,psi_rad,delta_rad\n60,.5,3.1\n65,.2,-3\n"
    wanted = [math.degrees(x) for x in (0.5, 0.2, 3.1, -3.0)]
    assert read(tmp_path, text).value == pytest.approx(wanted, rel=1e-15)
    plain = text.replace("_rad", "")
    assert "--psi-unit" in refusal(tmp_path, plain)
    assert read(tmp_path, plain, psi_unit="rad").value == pytest.approx(wanted, rel=1e-15)


def test_gaps_and_different_angles_for_s_and_p(tmp_path: Path) -> None:
    text = (
        "angle_deg,Rs,Rs_std,Rp,Rp_std\n77,0.9,0.006,0.7,0.004\n80,0.91,0.003,,\n81,,,0.78,0.003\n"
    )
    m = read(tmp_path, text + "82,NaN,0.1,n/a,-\n")
    assert m.quantity.tolist() == ["R_s", "R_s", "R_p", "R_p"]
    assert m.angle_deg.tolist() == [77.0, 80.0, 77.0, 81.0]
    assert m.sigma.tolist() == [0.006, 0.003, 0.004, 0.003] and "4 gaps" in m.understood


def test_wavelength_and_angle_side_by_side(tmp_path: Path) -> None:
    m = read(tmp_path, "lambda (nm),AOI,R_s,T_s\n" + rows(NANOMETRES, ANGLES, R_S, ("0.1",) * 5))
    assert m.quantity.tolist() == ["R_s"] * 5 + ["T_s"] * 5
    assert m.wavelength_um.tolist() == [float(n) / 1e3 for n in NANOMETRES] * 2
    assert m.angle_deg.tolist() == [float(a) for a in ANGLES] * 2


def test_front_and_back_of_a_slab(tmp_path: Path) -> None:
    m = read(tmp_path, "wavelength_um,T,R_front,R_back\n0.5,.9,.08,.081\n0.6,.9,.08,.082\n")
    assert m.quantity.tolist() == ["T", "T", "R", "R", "R_back", "R_back"]


def test_a_polarizer_between_s_and_p(tmp_path: Path) -> None:
    text = "polarizer (deg),angle,R\n0,45,.1\n30,45,.15\n45,45,.2\n90,45,.3\n150,45,.15\n"
    text_of_refusal = refusal(tmp_path, text)
    assert "angle-from-p" in text_of_refusal and "plane of incidence" in text_of_refusal
    m = read(tmp_path, text, polarization="angle-from-p")
    assert m.quantity.tolist() == ["R_p", "R", "R", "R_s", "R"]
    np.testing.assert_array_equal(m.polarizer_deg, [np.nan, 30.0, np.nan, np.nan, 30.0])
    turned = read(tmp_path, text, polarization="angle-from-s")
    assert turned.quantity.tolist() == ["R_s", "R", "R", "R_p", "R"]
    assert turned.polarizer_deg[[1, 4]].tolist() == [60.0, 60.0]


def test_rows_that_were_commented_out_are_counted(tmp_path: Path) -> None:
    m = read(tmp_path, "angle,R_s\n10,.1\n#20,.2\n# a remark\n# 30,.3\n40,.4\n")
    assert m.angle_deg.tolist() == [10.0, 40.0] and "2 commented-out rows" in m.understood


def test_records_of_another_kind_are_left_out_and_counted(tmp_path: Path) -> None:
    variety = VARIETIES["woollam"]
    m = read(tmp_path, variety.content)
    assert m.wavelength_um[:5].tolist() == [float(n) / 1e3 for n in NANOMETRES]
    assert m.sigma.tolist() == [0.014] * 5 + [0.0318] * 5
    assert "5 rows dPolE left out" in m.understood


def test_records_that_may_be_data_are_refused(tmp_path: Path) -> None:
    content = VARIETIES["woollam"].content.replace(b"dPolE", b"uR")
    with pytest.raises(MeasurementError, match="rows that begin with uR .* ignore=.uR"):
        read(tmp_path, content)
    assert "5 rows uR left out" in read(tmp_path, content, ignore="uR").understood


def test_codes_are_compared_as_numbers(tmp_path: Path) -> None:
    text = "aoi,pol,R\n10,1.0,.1\n10,10,.2\n"
    m = read(tmp_path, text, polarization={"1": "s", 10: "p"})
    assert m.quantity.tolist() == ["R_s", "R_p"]
    assert "line 3" in refusal(tmp_path, text, polarization="1=s,0=p")


def test_remarks_above_the_numbers_give_wavelength_and_angle(tmp_path: Path) -> None:
    text = "# wavelength: 532 nm\n# angle of incidence: 45 deg\nR_s,R_p\n.3,.09\n"
    m = read(tmp_path, text)
    assert m.wavelength_um.tolist() == [0.532] * 2 and m.angle_deg.tolist() == [45.0] * 2
    assert "line 1" in m.understood and "line 2" in m.understood
    m = read(tmp_path, text, wavelength_um=0.6, angle_deg="50")
    assert m.wavelength_um.tolist() == [0.6] * 2 and m.angle_deg.tolist() == [50.0] * 2
    assert "--angle-deg" in refusal(tmp_path, text.replace("45 deg", "45 deg or 50 deg"))
    two = "# laser: 633 nm\n" + text
    said = refusal(tmp_path, two)
    assert "line 1" in said and "line 2" in said and "--wavelength-um" in said
    assert read(tmp_path, two, wavelength_um=0.633).wavelength_um.tolist() == [0.633] * 2


def test_two_files_of_one_polarization_each_are_joined(tmp_path: Path) -> None:
    s = read(tmp_path, "angle,R\n" + rows(ANGLES, R_S), "s-pol.csv", polarization="s")
    p = read(tmp_path, "angle,R\n" + rows(ANGLES, R_P), "p-pol.csv", polarization="p")
    both = concatenate(s, p)
    assert both.quantity.tolist() == ["R_s"] * 5 + ["R_p"] * 5
    assert both.value.tolist() == [float(x) for x in R_S + R_P]
    assert both.source == "s-pol.csv, p-pol.csv"
    with pytest.raises(MeasurementError):
        concatenate()


def test_zeros_that_stand_for_nothing_measured(tmp_path: Path) -> None:
    text = "angle_deg,R_s\n10,.1\n20,0\n30,.12\n"
    assert "--missing 0" in refusal(tmp_path, text) and "line 3" in refusal(tmp_path, text)
    assert read(tmp_path, text.replace(",0\n", ",0.00e+00\n"), missing="0").value.tolist() == [
        0.1,
        0.12,
    ]
    assert read(tmp_path, text, missing=0).angle_deg.tolist() == [10.0, 30.0]
    assert read(tmp_path, text, missing="none").value.tolist() == [0.1, 0.0, 0.12]
    brewster = "angle_deg,R_p\n10,.04\n50,.002\n56,0\n60,.003\n"
    assert len(read(tmp_path, brewster)) == 4


def test_reading_needs_no_jax() -> None:
    code = "import sys, fitting.measured_file; sys.exit('jax' in sys.modules)"
    root = Path(__file__).resolve().parents[2]
    assert subprocess.run([sys.executable, "-c", code], cwd=root, check=False).returncode == 0
