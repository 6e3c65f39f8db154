"""What a file says around its table is heard or refused; files of known truth are read right."""

from pathlib import Path

import pytest

from benchmarks.studies.fuzz_meaning import run
from tests.truth.reading import read, refusal

SCAN = "angle,R\n10,.1\n45,.2\n80,.5\n"
SPECTRUM = "wavelength_nm,R\n500,.1\n600,.2\n700,.3\n"
ELLIPSE = "angle,psi,delta\n50,20,100\n60,25,95\n70,30,90\n"

HEARD = {
    "# Angle of incidence: 60\n" + SPECTRUM: ("angle_deg", 60.0, "line 1"),
    "# AOI = 45\n" + SPECTRUM: ("angle_deg", 45.0, "line 1"),
    "# Einfallswinkel: 60\u00b0\n" + SPECTRUM: ("angle_deg", 60.0, "line 1"),
    "# angle d'incidence : 60 \u00b0\n" + SPECTRUM: ("angle_deg", 60.0, "line 1"),
    "# \u5165\u5c04\u89d2: 60\u00b0\n" + SPECTRUM: ("angle_deg", 60.0, "line 1"),
    SPECTRUM + "\n# AOI: 60\n": ("angle_deg", 60.0, "line 6"),
    "incidence;45\nnm;%R\n500;10\n600;11\n": ("angle_deg", 45.0, "line 1"),
    "# p-polarized\n" + SCAN: ("quantity", "R_p", "line 1"),
    "# \u504f\u632f: s\n" + SCAN: ("quantity", "R_s", "line 1"),
    "# R in percent\nangle,R\n10,10\n45,10\n": ("value", 0.1, "line 1"),
    "# wavelength in um\nwavelength,R\n500,.1\n600,.2\n": None,
    "# %\nangle,R\n10,10\n45,10\n": ("value", 0.1, "line 1"),
    "angle,R in %\n10,10\n45,10\n": ("value", 0.1, "percent"),
    "wavelength_A,R\n5000,.1\n5000,.2\n": ("wavelength_um", 0.5, "0.5 um"),
    "wavelength_nm,Rs@60\n500,.1\n600,.2\n": ("angle_deg", 60.0, "60 degrees by the column name"),
    "angle,R_||\n10,.1\n45,.2\n": ("quantity", "R_p", "R_p"),
    "angle,R//\n10,.1\n45,.2\n": ("quantity", "R_p", "R_p"),
    "angle,R\u2016\n10,.1\n45,.2\n": ("quantity", "R_p", "R_p"),
    "angle_rad,R\n1.5708,.5\n1.571,.5\n": ("angle_deg", 90.0, "rad"),
    "nm;%R\n500;10\n600;10\n": ("value", 0.1, "percent"),
    "angle;R\n10,000;0,250\n45,000;0,250\n": ("value", 0.25, "fraction"),
    "nm;R (%)\n400;10,125\n500;10,125\n": ("value", 0.10125, "percent"),
    "Winkel (Grad);R_s (%)\n30,500;10,125\n45,250;10,125\n": ("value", 0.10125, "percent"),
}


for said, angle in {
    "Einfallswinkel 60 Grad": 60.0, "angle d'incidence : 60": 60.0, "AOI60": 60.0,
    "\u00e2ngulo de incid\u00eancia: 60 graus": 60.0, "invalshoek 60 graden": 60.0,
    "угол падения 60 градусов": 60.0,
    "\u5165\u5c04\u89d260\u5ea6": 60.0, "infallsvinkel 60": 60.0, "AOI 1.5 rad": 85.94366926962348,
    "incidence normale": 0.0, "senkrechter Einfall": 0.0, "near-normal incidence": 0.0,
}.items():  # fmt: skip
    HEARD[f"# {said}\n" + SPECTRUM] = ("angle_deg", angle, "line 1")
for said in (
    "HeNe laser 632.8 nm", "He-Ne laser 632.8 nm", "HeNe-Laser (632,8 nm)", "laser: HeNe 632.8 nm",
    "red laser pointer 632.8 nm", "diode laser: 632.8 nm", "Kommentar: HeNe 632,8 nm",
    "helium-neon laser 632.8 nm", "Lichtquelle: Helium-Neon-Laser 632,8 nm",
    "Laserwellenl\u00e4nge 632,8 nm",
):  # fmt: skip
    HEARD[f"# {said}\n" + SCAN] = ("wavelength_um", 632.8 / 1e3, "line 1")
for said, light in {
    "polarizzazione parallela": "R_p", "p wave": "R_p", "\u504f\u5149: p": "R_p", "TE mode": "R_s",
    "polarisation perpendiculaire": "R_s", "lumi\u00e8re polaris\u00e9e p": "R_p",
}.items():  # fmt: skip
    HEARD[f"# {said}\n" + SCAN] = ("quantity", light, "line 1")


EUROPEAN = "angle;R\n10;0,1\n45;0,2\n80;0,5\n"
for said, um in {
    "HeNe 632,8 nm": 632.8 / 1e3, "laser 632.800 nm": 632.8 / 1e3, "laser 1,064 um": 1.064,
    "laser 13,500 nm": 0.0135,
}.items():  # fmt: skip
    HEARD[f"# {said}\n" + EUROPEAN] = ("wavelength_um", um, "line 1")


@pytest.mark.parametrize("text", [text for text, heard in HEARD.items() if heard])
def test_what_a_line_says_is_used_and_that_is_said(tmp_path: Path, text: str) -> None:
    name, value, where = HEARD[text]
    m = read(tmp_path, text)
    assert set(getattr(m, name).tolist()) == {value}
    assert where in m.understood


REFUSED = {
    "# a 532 nm laser on a bench\n" + SCAN: ("line 1", "--wavelength-um"),
    "# laser 1,064 nm\n" + SCAN: ("line 1", "--wavelength-um"),
    "# laser 1.064 nm\n" + EUROPEAN: ("line 1", "--wavelength-um"),
    "wavelength_nm,R@60,R\n500,.1,.2\n600,.2,.2\n": ("gives an angle", "--angle-deg"),
    "angle,R,R_s,R_p\n10,.2,.1,.3\n45,.2,.1,.3\n": ("their mean", "--columns"),
    "grazing angle (mrad),R\n10,.2\n45,.2\n": (
        "grazing angles in mrad",
        "--angle-unit grazing-deg",
    ),
    "grazing angle (rad),R\n.1,.2\n.4,.2\n": ("grazing angles in rad", "--angle-unit grazing-deg"),
    "theta (mrad),R\n10,.2\n45,.2\n": ("angles in mrad", "--angle-unit deg or rad"),
    "2theta (deg),R\n10,.2\n45,.2\n": ("no column is an angle", "2theta (deg)"),
    "aoi,polarization angle,R\n9,10,.2\n9,45,.2\n": ("polarization angle", "angle-from-p"),
    "# AOI = 45\n# AOI = 50\n" + SPECTRUM: ("line 1", "line 2", "--angle-deg"),
    "# measured at 45 deg\n" + SPECTRUM: ("line 1", "--angle-deg"),
    "# AOI: 85\n" + SCAN: ("line 1", "10 to 80", "--angle-deg"),
    "# polarization: vertical\n" + SCAN: ("line 1", "--polarization"),
    "# polarization: s\n# TM\n" + SCAN: ("line 1", "line 2", "--polarization"),
    "# p-polarised\nangle,R_s\n10,.1\n20,.2\n": ("line 1", "R_s", "--polarization"),
    "# angles are grazing\n" + SCAN: ("line 1", "--angle-unit"),
    "# angle measured from the surface\n" + SCAN: ("line 1", "--angle-unit"),
    "# angles in radians\nangle_deg,R\n10,.1\n20,.2\n": ("deg", "line 1", "--angle-unit"),
    "# wavelength in um\nwavelength_nm,R\n500,.1\n600,.2\n": ("nm", "line 1", "--wavelength-unit"),
    "# R in per mille\n" + SCAN: ("line 1", "--scale"),
    "# R in percent\nangle,R (-)\n10,.1\n20,.2\n": ("line 1", "--scale"),
    "# Transmission\n" + SCAN: ("Transmission", "--columns"),
    "angle,R\n10,.1\n45,.2\n# AOI: 60\n80,.5\n": ("line 4", "--lines"),
    "angle,R_s\n10,.1\n45,.2\n# angle,T_s\n80,.5\n": ("line 4", "--lines"),
    "angle,R_s\n10,.1\n45,.2 # p-pol\n80,.5\n": ("line 3", "a number was wanted"),
    "angle,R\n.1,.1\n.5,.2\n1.571,.5\n": ("no unit", "--angle-unit"),
    "angle,R\n.1,.1\n.5,.2\n1.6,.5\n": ("no unit", "--angle-unit"),
    "angle,R,dR/R\n10,.1,.01\n45,.2,.02\n": ("relative error", "--columns"),
    "angle,R,rel. error\n10,.1,.01\n45,.2,.02\n": ("relative error", "--columns"),
    "angle,R (\u2030)\n10,.1\n45,.2\n": ("permille", "--scale"),
    "angle,R_s,R_p\n10,.1,.2\n45,.2\n80,.3,.4\n": ("line 3", "--lines"),
    "angle,R (%),err (%)\n10,10,1\n45,-1,1\n80,12,1\n": ("line 3", "--missing=-1"),
    "angle,psi,delta\n50,20,100\n60,0,0\n70,30,90\n": ("line 3", "--missing 0"),
    "angle,psi,delta\n50,.2,100\n60,.3,90\n70,.4,80\n": ("column psi", "--psi-unit"),
    "angle,psi,delta\n50,20,1.5\n60,25,1.6\n70,30,1.7\n": ("column delta", "--psi-unit"),
    "# samples 45 and 60\nnm,R_45,R_60\n500,.1,.2\n600,.1,.2\n": ("R_45", "--columns"),
    "# angles of incidence: 45, 60\nnm,R_45\n500,.1\n600,.2\n": ("R(45 deg)", "--columns"),
    "# AOI = 30\nnm,R_45,R_60\n500,.1,.2\n600,.1,.2\n": ("R_45", "--columns"),
    "# psi and delta in radians\nangle,psi (deg),delta\n50,20,100\n60,25,95\n": ("--psi-unit",),
}


for said in (
    "Einfallswinkel sechzig Grad", "angle of incidence: sixty degrees", "sixty degrees incidence",
    "k\u0105t padania 60", "\u00fahel dopadu 60", "Messwinkel 60", "Lichteinfallswinkel: 60\u00b0",
    "oblique incidence", "Brewster angle", "gemessen unter 60 Grad", "medido a 60 grados",
    "60\u00b0", "incident power 5 mW", "60 graden", "sixty deg", "grazing incidence: 20 deg",
    "streifender Einfall 20 Grad", "incidenza radente 20 gradi",
):  # fmt: skip
    REFUSED[f"# {said}\n" + SPECTRUM] = ("line 1", "--angle-deg")
for said in (
    "2theta scan", "Winkel zur Oberfl\u00e4che", "angle measured from the sample plane",
    "complement of incidence", "Winkel im Bogenma\u00df ca.", "angle from the surface",
):  # fmt: skip
    REFUSED[f"# {said}\n" + SCAN] = ("line 1", "--angle-unit")
for said in (
    "polaryzacja p", "nat\u00fcrliches Licht", "E perpendicular", "depolarized",
    "horizontally polarised", "s and p polarization", "polarizer at 90 deg",
):  # fmt: skip
    REFUSED[f"# {said}\n" + SCAN] = ("line 1", "--polarization")
for said in (
    "45/45 geometry", "geometry: 45/45", "d/8 geometry", "8\u00b0/d", "Messgeometrie 45:0",
    "\u03c6 = 60", "phi = 60", "\u03b1 = 60", "k\u0105t 60", "goniometer at 45 deg",
    "0/45", "45:0", "R (d/8)", "8\u00b0/d", "8/d", "mount angle 45 deg", "tilt 5 deg",
    "Brewster", "schr\u00e4ger Einfall",
):  # fmt: skip
    REFUSED[f"# {said}\n" + SPECTRUM] = ("line 1", "--angle-deg")
for said in (
    "Messwinkel 20", "Winkeloffset 1.5\u00b0", "angle offset 1.5 deg", "measured at 60 deg",
    "misalignment 0.5 deg", "AOI: 44", "AOI 44 at 532 nm", "phi = 30",
    "stage angle 60 deg",
):  # fmt: skip
    REFUSED[f"# {said}\n" + SCAN] = ("column angle", "line 1", "--columns", "--angle-deg")
for said in (
    "normalized to reference", "normalised to an Al mirror", "relative to gold mirror",
    "relative reflectance", "normiert auf Spiegel", "normalis\u00e9 \u00e0 la r\u00e9f\u00e9rence",
    "R x100", "R \u00d7 100", "R*1000", "R in units of 0.01", "all values times 100",
    "scale factor 100", "R multiplied by 100", "Faktor 10", "\u5f52\u4e00\u5316", "R (a.u.)",
    "arbitrary units", "R in dB", "log scale",
):  # fmt: skip
    REFUSED[f"# {said}\n" + SCAN] = ("--scale",)
for header in ("phi", "\u03c6", "phi (deg)", "\u03b1 / deg"):
    REFUSED[f"{header},R\n10,.1\n45,.2\n"] = ("no column is an angle", header, "--columns angle=")
    REFUSED[f"wavelength_nm,{header},R\n500,10,.1\n600,45,.2\n"] = (header, "--angle-deg")
REFUSED["# 2theta\n" + SCAN] = ("line 1", "--angle-unit")
for said in ("vertical", "E horizontal", "vertikal"):
    REFUSED[f"# {said}\n" + SCAN] = ("line 1", "--polarization")
for said in (
    "wavelength five hundred nm", "E = 2.33 eV", "2.33 eV", "gap 1.1 eV", "hv = 2.33", "8.05 keV",
):  # fmt: skip
    REFUSED[f"# {said}\n" + SCAN] = ("line 1", "--wavelength-um")


@pytest.mark.parametrize("text", REFUSED)
def test_what_is_not_understood_or_contradicts_is_refused(tmp_path: Path, text: str) -> None:
    said = refusal(tmp_path, text)
    for part in REFUSED[text]:
        assert part in said, said


NAMES = {
    ("grazing_incidence.csv", SCAN): "--angle-unit",
    ("2theta_scan.csv", SCAN): "--angle-unit",
    ("gold_theta60.csv", SPECTRUM): "--angle-deg 60",
    ("gold_phi_60.csv", SPECTRUM): "--angle-deg 60",
    ("gold_60deg.csv", SCAN): "--columns",
    ("normal_incidence.csv", SCAN): "--columns",
    ("gold_45deg_tilt.csv", SPECTRUM): "--angle-deg 45",
    ("gold_percent.csv", SCAN): "--scale 0.01",
    ("gold_normalized.csv", SCAN): "--scale",
    ("polarizer_45.csv", SCAN): "--polarization",
    ("gold_senkrecht.csv", SCAN): "--polarization",
    ("gold_vertical.csv", SCAN): "--polarization",
}


@pytest.mark.parametrize(("name", "text"), NAMES)
def test_what_the_name_of_the_file_says_is_heard(tmp_path: Path, name: str, text: str) -> None:
    assert NAMES[name, text] in refusal(tmp_path, text, name)


@pytest.mark.parametrize(
    "name",
    [
        "'R'",
        "$R$",
        "R x100",
        "R (0/45)",
        "R'",
        "R\u2032",
        "\u221aR",
        "sqrt(R)",
        "1-R",
        "-R",
        "R^2",
        "R/R0",
        "Rs/Rp",
        "R_d",
    ]
    + ["R \u4e0d", "R*", "R+T", "R\u0302"],
)
def test_a_word_or_sign_that_is_not_known_is_not_dropped_from_a_header(
    tmp_path: Path, name: str
) -> None:
    assert "no column is named" in refusal(tmp_path, f"angle,{name}\n10,.1\n45,.2\n")


def test_lines_about_something_else_are_no_statements(tmp_path: Path) -> None:
    for text in (
        "laser power 5 mW", "chopper frequency 1 kHz", "pulse energy: 5 uJ", "25 \u00b0C",
        "analyzer 45 deg", "humidity 45 %", "film of 120 nm", "sample rotated by 90 deg",
        "integration time: 20 ms", "detector angle 30 deg", "date: 2024-03-11", "class 2 laser",
        "angle step 5 deg", "geometry: reflection", "position 12", "error of R: relative",
        "sample 10 x 100 mm", "sheet 1/2", "page 3/10", "objective 50x",
        "mean of the 20 readings multiplied by the mean of 20 others", "scale bar 10 um",
    ):  # fmt: skip
        for table in (SCAN, SPECTRUM):
            assert (
                read(tmp_path, f"# {text}\n" + table).understood == read(tmp_path, table).understood
            )


def test_an_option_overrules_what_a_line_says(tmp_path: Path) -> None:
    two = "# AOI = 45\n# AOI = 50\n# polarization: vertical\n" + SPECTRUM
    m = read(tmp_path, two, angle_deg=30, polarization="p")
    assert set(m.angle_deg.tolist()) == {30.0} and set(m.quantity.tolist()) == {"R_p"}
    grazing = "# angles are grazing\n" + SCAN
    assert read(tmp_path, grazing, angle_unit="grazing-deg").angle_deg.tolist() == [80, 45, 10]


def test_several_angles_in_one_wide_table(tmp_path: Path) -> None:
    text = "wavelength_nm,Rs(45 deg) [%],Rp(45 deg) [%],Rs(60\u00b0) [%],Rp(60\u00b0) [%]\n"
    text += "500,10,5,20,3\n600,11,6,21,4\n"
    m = read(tmp_path, text)
    assert m.angle_deg.tolist() == [45.0] * 4 + [60.0] * 4
    assert m.quantity.tolist() == ["R_s"] * 2 + ["R_p"] * 2 + ["R_s"] * 2 + ["R_p"] * 2
    assert m.value.tolist() == [0.1, 0.11, 0.05, 0.06, 0.2, 0.21, 0.03, 0.04]
    one = read(tmp_path, text, columns="wavelength=1,R_s=4")
    assert one.angle_deg.tolist() == [60.0, 60.0]


@pytest.mark.parametrize("head", ["R_{}", "Rs {}", "psi_{}", "R{} [%]"])
def test_numbers_behind_names_are_no_angles(tmp_path: Path, head: str) -> None:
    text = f"nm,{head.format(45)},{head.format(62.5)}\n500,9,8\n600,9,8\n"
    assert "R(45 deg)" in refusal(tmp_path, text, angle_unit="deg", scale=0.01)
    m = read(tmp_path, text, columns="wavelength=1,R=2", angle_deg=30, scale=0.01)
    assert m.angle_deg.tolist() == [30.0, 30.0]
    m = read(tmp_path, "angle,R_45\n3,.1\n4,.2\n", columns="angle=1,R=2")
    assert m.angle_deg.tolist() == [3.0, 4.0]
    # alpha may be any angle, but in degrees it is none of 1/nm
    m = read(tmp_path, "alpha / deg,R\n30,.1\n40,.2\n", columns="angle=1,R=2")
    assert m.angle_deg.tolist() == [30.0, 40.0]


def test_one_column_of_errors_may_belong_to_several_values(tmp_path: Path) -> None:
    columns = "angle=1,R_s=2,R_p=3,sigma_R_s=4,sigma_R_p=4"
    m = read(tmp_path, "angle,R_s,R_p,Error\n30,.1,.2,.01\n40,.2,.1,.02\n", columns=columns)
    assert m.sigma.tolist() == [0.01, 0.02, 0.01, 0.02]


def test_the_square_of_a_reflectance_is_not_at_two_degrees(tmp_path: Path) -> None:
    text = "# angles in degrees\nnm,R,R\u00b2\n500,.1,.01\n600,.2,.04\n"
    m = read(tmp_path, text, ignore="R\u00b2")
    assert (m.value.tolist(), m.angle_deg.tolist()) == ([0.1, 0.2], [0.0, 0.0])


def test_a_column_in_units_of_q_is_no_wavelength(tmp_path: Path) -> None:
    text = "Qz (1/angstrom),R\n.002,.9\n.003,.8\n"
    assert "--wavelength-unit" in refusal(tmp_path, text, columns="wavelength=1,R=2")


def test_a_name_and_a_line_that_say_the_same_agree(tmp_path: Path) -> None:
    m = read(tmp_path, "# AOI: 60 deg\n" + SPECTRUM, "gold_60deg.csv")
    assert set(m.angle_deg.tolist()) == {60.0}
    assert "--angle-deg" in refusal(tmp_path, "# AOI: 60 deg\n" + SPECTRUM, "gold_50deg.csv")
    assert len(read(tmp_path, "# AOI: 60 deg\n" + ELLIPSE)) == 6  # one of the angles


@pytest.mark.parametrize("seed", [0, *(pytest.param(n, marks=pytest.mark.study) for n in (1, 2))])
def test_files_of_known_truth_are_read_right_or_refused(tmp_path: Path, seed: int) -> None:
    ends, wrong = run(700, seed, tmp_path)
    assert not wrong, "\n".join(wrong[:5])
    assert ends["read"] > 200 and ends["refused"] > 100
