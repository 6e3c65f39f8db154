"""What the reader refuses: file, line, column, what came, what was wanted, the option."""

from pathlib import Path

import pytest

from fitting.data.measurement import MeasurementError
from fitting.measured_file import read_csv
from tests.truth.reading import (
    ANGLES,
    DELTA,
    ERRORS,
    NANOMETRES,
    PSI,
    R_P,
    R_S,
    read,
    refusal,
    rows,
)

REFUSALS = {
    "percent without a sign": (
        "angle_deg,R_s\n10,92.4\n20,93\n",
        "gold.csv, line 2, column R_s: reflectance 92.4 is outside [0, 1]. "
        "If the column is in percent, say --scale 0.01.",
    ),
    "percent said, fractions held": (
        "angle,R (%)\n10,.5\n20,.6\n",
        ("percent", "0.5 to 0.6", "--scale"),
    ),
    "rad said, degrees held": (
        "angle_rad,R\n10,.5\n20,.6\n",
        ("rad", "10 to 20", "--angle-unit deg"),
    ),
    "degrees said, rad held": (
        "angle_deg,R\n.1,.5\n.7,.6\n1.2,.7\n",
        ("degrees", "0.1 to 1.2", "rad"),
    ),
    "angle of no unit": ("angle,R\n.1,.5\n.7,.6\n1.2,.7\n", ("no unit", "--angle-unit")),
    "psi said rad": ("aoi,psi (rad)\n60,24.6\n65,20\n", ("rad", "20 to 24.6", "--psi-unit deg")),
    "psi too large": ("aoi,psi,delta\n60,24.6,180\n65,91,170\n", ("line 3", "psi 91", "[0, 90]")),
    "delta too large": ("aoi,psi,delta\n60,24.6,180\n65,20,370\n", ("line 3", "delta 370")),
    "delta a copy of psi": (
        "aoi,psi,delta\n60,24.6,24.6\n65,20,20\n",
        ("column delta", "equals that of psi"),
    ),
    "negative": ("angle,R_s\n10,.1\n20,-0.2\n", ("line 3", "-0.2", "[0, 1]", "A-B")),
    "negative angle": ("angle,R_s\n-10,.1\n20,.2\n", ("line 2", "column angle", "-10", "[0, 90]")),
    "angle above 90": ("angle,R_s\n10,.1\n120,.2\n", ("line 3", "120")),
    "zero standard error": (
        "angle,R_s,std\n10,.1,.1\n20,.2,0\n",
        ("line 3", "column std", "--missing 0"),
    ),
    "gap in the standard errors": ("angle,R_s,std\n10,.1,.1\n20,.2,\n", ("line 3", "column std")),
    "gap in the first cell": (
        "angle;R_s\n10;.1\n;.2\n30;.2\n",
        ("line 3", "column angle", "missing"),
    ),
    "percent and no sign": (
        "angle,Rs (%),Rp\n10,10,.2\n20,30,.3\n",
        ("column Rp", "Rs (%)", "--scale"),
    ),
    "settings in braces": (
        "{ Units, Wavelength Units } SI Microns\n{ Use: }\n0.3 0.1 0.2\n0.4 0.2 0.3\n",
        ("line 3", "3 columns have no names", "0.3 to 0.4"),
    ),
    "analyser": ("analyzer (deg),counts\n0,10\n5,20\n", ("no angle of incidence", "raw signal")),
    "gap in the angles": ("angle,R_s\n10,.1\n,.2\n30,.2\n", ("line 3", "column angle")),
    "relative errors": ("angle,R_s,err (%)\n10,.1,5\n20,.2,5\n", ("err (%)", "relative")),
    "errors in percent or fractions": (
        "angle_deg,R_s (%),sigma_R_s\n10,6,0.001\n20,7,0.002\n",
        ("column sigma_R_s", "0.001 to 0.002", "no unit", "--scale 0.01", "--columns"),
    ),
    "amplitude or reflectance": (
        "angle_deg,rs,rp\n10,.1,.2\n20,.2,.3\n",
        ("line 1, column rs", "amplitude r_s", "reflectance R_s", "--columns angle=1,R_s=2"),
    ),
    "amplitude or reflectance, p": (
        "angle_deg,r_p\n10,.1\n20,.2\n",
        ("column r_p", "amplitude r_p", "--columns angle=1,R_p=2"),
    ),
    "s alone": ("angle_deg,s\n10,.1\n20,.2\n", ("no column is named", "--columns angle=1,R=2")),
    "TE of what": (
        "# Transmission, run 3\nangle_deg,TE,TM\n10,.1,.2\n20,.2,.3\n",
        ("no column is named", "--columns angle=1"),
    ),
    "errors of one of two": ("angle,Rs,Rp,err\n10,.1,.1,.01\n", ("'err'", "sigma_R_s=4")),
    "code 0 and 1": ("angle,pol,R\n10,0,.2\n10,1,.1\n", ("0, 1", "--polarization 0=s,1=p")),
    "unknown word": ("angle,pol,R\n10,left,.2\n10,s,.1\n", ("'left'", "--polarization left=s")),
    "two values": ("angle,R,reflectance\n10,.2,.3\n", ("'R'", "'reflectance'", "--columns")),
    "two angles": ("angle,theta,R\n10,.2,.3\n", ("'angle'", "'theta'", "--columns angle=1")),
    "value and column say s and p": (
        "angle,pol,Rs\n10,p,.2\n11,p,.3\n",
        ("pol", "'Rs'", "--columns"),
    ),
    "no names": ("10,.2\n20,.3\n", ("have no names", "1: 10 to 20", "--columns angle=1,R=2")),
    "names that say nothing": ("x,y\n10,.2\n20,.3\n", ("line 1", "'x'", "--columns")),
    "constants": ("wavelength_um,n,k\n.5,.9,1.8\n.6,.2,3\n", ("line 1", "optical constant")),
    "modulated light": (
        "wavelength_nm,Is,Ic\n500,.4,-.5\n600,.4,-.3\n",
        ("line 1", "no column is named", "'Is'"),
    ),
    "another power in words": (
        "# Transmittance of glass\nangle_deg,R\n10,.1\n20,.2\n",
        ("the name says R", "states the measured quantity differently", "--columns"),
    ),
    "absorbance in words": (
        "# absorbance of glass\nangle_deg,T\n10,.1\n20,.2\n",
        ("the name says T", "states the measured quantity differently"),
    ),
    "counts": ("angle,intensity\n10,300\n20,400\n", ("raw signal", "direct beam", "--divide-by")),
    "arbitrary units": ("angle,R (a.u.)\n10,300\n20,400\n", ("arbitrary", "--scale")),
    "mount": ("mount angle,R_s\n10,.1\n20,.2\n", ("no column is an angle of incidence", "mount")),
    "millimetres": ("motor (mm),R_s\n10,.1\n20,.2\n", ("no column is an angle", "motor")),
    "one column": ("angle\n10\n20\n", ("no row with two numbers",)),
    "header only": ("angle,R_s\n", ("no row with two numbers or more was found in 1 line.",)),
    "header only, no line end": ("angle,R_s", ("in 1 line.",)),
    "header and text": ("angle,R_s\r\nnone\r\n", ("in 2 lines.",)),
    "samples of one point": ("\tV\n\t2.8\n\t2.9\n", ("one column", "angle_deg,R_s,sigma_R_s")),
    "comma twice": (
        "angle,Rs\n29,6667,0,75\n34,6667,0,77\n",
        ("4 columns have no names", "--columns angle=1", "semicolons"),
    ),
    "both decimal marks": ("angle;Rs\n29,5;0,75\n34.5;0.77\n", ("line 2", "line 3", "decimal")),
    "thousands": ("wavelength (nm);T (K)\n1,200;1,000\n1,300;1,000\n", ("thousands", "--decimal")),
    "not a number": ("angle,Rs\n10,.1\n20,bad\n", ("line 3", "column Rs", "'bad'", "number")),
    "percent signs here and there": ("angle,Rs\n10,4%\n20,.05\n", ("line 3", "column Rs", "%")),
    "wavelength of no unit": ("wavelength,R\n.4,.1\n.5,.1\n", ("no unit", "--wavelength-unit")),
    "lambda in eV": ("lambda (eV),R\n1.4,.1\n2,.1\n", ("wavelength", "eV", "--wavelength-unit eV")),
    "nm said, um held": (
        "wavelength (nm),R\n.4,.1\n.5,.1\n",
        ("nm", "0.4 to 0.5", "--wavelength-unit"),
    ),
    "um said, nm held": ("wavelength (um),R\n400,.1\n500,.1\n", ("um", "400 to 500")),
    "two axes that disagree": (
        "wavelength (nm),energy (eV),R\n400,2,.1\n500,2.48,.1\n",
        ("line 1", "'wavelength (nm)'", "'energy (eV)'", "--columns wavelength=1"),
    ),
    "Q without wavelength": (
        "# wavelength 4.76\nQ (1/nm),R\n.1,.1\n.2,.1\n",
        ("line 1", "--wavelength-um"),
    ),
    "psi without angle": (
        "energy (eV),psi,delta\n1,20,180\n",
        ("no column is an angle", "--angle-deg"),
    ),
    "s and p without angle": ("wavelength (nm),Rs,Rp\n500,.1,.2\n", ("--angle-deg",)),
    "polarized without angle": ("wavelength (nm),pol,R\n500,s,.1\n", ("--angle-deg",)),
    "negative Q": ("# wavelength: 0.5 nm\nQ (1/nm),R\n-.1,.1\n.2,.1\n", ("line 3", "0 and 4 pi")),
    "two errors of one": ("aoi,R,err,std\n10,.1,.1,.1\n", ("'std'", "--columns")),
    "gap in the polarization": ("aoi,pol,R\n10,s,.1\n20,,.2\n", ("line 3", "missing")),
    "gap in the wavelength": ("wavelength_um,R\n.5,.1\n,.2\n", ("line 3", "missing")),
    "comment behind the numbers": ("angle,R_s\n10,.1\n20,.2 # a\n", ("line 3", "'.2 # a'")),
    "second table": ("angle,R_s\n10,.1\nrun two\n20,.2\n", ("line 3", "--lines")),
    "zones": (
        "AOI\tDelta\tPsi\tZone\n50\t169\t31\t4\n50\t.2\t.2\t5\n",
        ("line 3", "'5' says that this row is a mean", "--lines"),
    ),
    "rows of means": ("angle,R_s,kind\n10,.1,mean\n10,.01,std\n", ("line 2", "--lines")),
    "s or sigma": ("aoi,R,sR\n10,.1,.01\n", ("column sR", "standard error", "--columns")),
    "all gaps": ("angle,R_s,R_p\n10,,\n20,nan,\n", ("angle_deg,R_s",)),
    "empty": ("", ("no row", "in 0 lines.")),
    "json": ('{"angle": [1, 2]}', ("JSON",)),
    "workbook": (b"PK\x03\x04\x14\x00", ("workbook", "CSV")),
    "laser of no unit": (
        "instrument,goniometer,\nlaser,532,\nangle_deg,R_s,R_p\n10,.1,.2\n20,.1,.2\n",
        ("line 2", "--wavelength-um"),
    ),
    "nanometres by their range": ("wavelength,R\n400,.1\n500,.1\n", ("--wavelength-unit nm",)),
    "rows that end in a delimiter": (
        "angle,Rs,Rp\n10,.1,.2,\n20,.1,.2,\n",
        ("3 columns have no names", "no line above them has 4", "--columns angle=1"),
    ),
    "one column of errors for two values": (
        "angle,R_s,R_p,Error\n30,.1,.2,.01\n40,.2,.1,.01\n",
        ("--columns angle=1,R_s=2,R_p=3,sigma_R_s=4,sigma_R_p=4",),
    ),
    "three digits behind a comma, and no unit": (
        "nm;R\n400;10,125\n500;11,250\n",
        ("line 2", "--decimal ,"),
    ),
    "numbers of samples or angles behind R": (
        "nm,R_45,R_60\n500,.1,.2\n600,.1,.2\n",
        ("'R_45'", "if its number is an angle, write R(45 deg)", "--columns"),
    ),
    "a number behind R, over the angle": ("angle,R_45\n3,.1\n4,.2\n", ("R(45 deg)", "--columns")),
    "utf-32": ("angle,R\n10,.1\n20,.2\n".encode("utf-32"), ("zero bytes", "--encoding")),
    "zero bytes": (b"angle,R\n1,2\x00\x01\x00\x00\x00\x02\n", ("zero bytes", "--encoding")),
}


@pytest.mark.parametrize("kind", REFUSALS)
def test_what_has_two_readings_is_refused_with_what_to_do(tmp_path: Path, kind: str) -> None:
    content, wanted = REFUSALS[kind]
    text = refusal(tmp_path, content)
    for part in (wanted,) if isinstance(wanted, str) else wanted:
        assert part in text
    assert len(text) < 900 and "\n" not in text


def test_the_name_of_the_file_counts_as_evidence_and_as_doubt(tmp_path: Path) -> None:
    text = "angle,R\n" + rows(ANGLES, R_S)
    for name in ("gold_s.csv", "Polarisation0.csv", "p.csv", "gold_TM.csv", "x_p-pol.csv"):
        assert "--polarization" in refusal(tmp_path, text, name)
        assert set(read(tmp_path, text, name, polarization="p").quantity) == {"R_p"}
    assert set(read(tmp_path, text, "au_532nm_sp_run.csv").quantity) == {"R"}
    said = "# polarization: p\n" + text
    assert "--polarization" in refusal(tmp_path, said, "gold_TE.csv")
    spectrum = "wavelength_nm,R\n" + rows(NANOMETRES, R_S)
    assert "--angle-deg 45" in refusal(tmp_path, spectrum, "gold_45deg.csv")
    assert len(read(tmp_path, spectrum, "gold_45deg.csv", angle_deg=45)) == 5
    turned = "wavelength_nm,mount angle,R\n" + rows(NANOMETRES, ANGLES, R_S)
    assert "mount angle" in refusal(tmp_path, turned)
    hint = "wavelength_nm,psi,delta\n" + rows(NANOMETRES, PSI, DELTA)
    assert "--angle-deg 60" in refusal(tmp_path, hint, "hafnia_60deg.csv")


def test_files_that_cannot_be_opened(tmp_path: Path) -> None:
    for path in (tmp_path / "none.csv", tmp_path, "a\0b.csv"):
        with pytest.raises(MeasurementError, match="cannot be opened"):
            read_csv(path)


def test_one_broken_cell_is_refused_with_its_line_wherever_it_stands(tmp_path: Path) -> None:
    lines = rows(ANGLES, R_S, ERRORS, R_P).splitlines()
    for row in range(len(lines)):
        for column in range(4):
            for junk in ("1o", "0.5.1", "0,5", "--5", "0x1p-2", "inf", "1_0", "\u0661"):
                broken = [line.split(",") for line in lines]
                broken[row][column] = junk
                text = "angle_deg,R_s,sigma_R_s,R_p\n" + "\n".join(map(",".join, broken)) + "\n"
                assert f"line {row + 2}" in refusal(tmp_path, text), (row, column, junk)


@pytest.mark.parametrize("change", ["extra cell", "cell lost", "delimiter changed"])
def test_a_row_of_the_wrong_length_is_never_dropped(tmp_path: Path, change: str) -> None:
    lines = rows(ANGLES, R_S, R_P).splitlines()
    for row in range(len(lines)):
        changed = list(lines)
        cells = changed[row].split(",")
        if change == "extra cell":
            changed[row] += ",5"
        elif change == "cell lost":
            changed[row] = cells[0]
        else:
            changed[row] = ";".join(cells)
        text = "angle_deg,R_s,R_p\n" + "\n".join(changed) + "\n"
        assert f"line {row + 2}" in refusal(tmp_path, text)


def test_a_row_that_may_be_cut_short_at_the_end_of_the_file(tmp_path: Path) -> None:
    text = "angle_deg,R_s,R_p\n10,.1,.1\n20,.1,.1\n30,.2"
    assert "cut short" in refusal(tmp_path, text)
    assert "line 4: 2 cells came where 3 were wanted" in refusal(tmp_path, text + "\n")
    assert len(read(tmp_path, text + ",")) == 5  # an empty cell is a gap
