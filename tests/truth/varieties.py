"""Small written-out files, one for each way in which measured files were seen to differ.

The numbers are texts; a test compares what was read with ``float`` of them.
"""

from __future__ import annotations

from tests.truth.reading import (
    ANGLES,
    ERRORS,
    PERCENT,
    R_P,
    R_S,
    Variety,
    comma,
    rows,
)
from tests.truth.varieties_ellipsometry import ELLIPSOMETRY

BODY = rows(ANGLES, R_S, R_P)
BOTH = {"R_s": R_S, "R_p": R_P}
ONE = {"R_s": R_S}
_long = "".join(rows(ANGLES, (word,) * 5, cells) for word, cells in (("s", R_S), ("p", R_P)))


def _words(s: str, p: str) -> bytes:
    return ("aoi_deg,pol,R\n" + _long.replace(",s,", f",{s},").replace(",p,", f",{p},")).encode()


VARIETIES = ELLIPSOMETRY | {
    "own format": Variety(
        (
            "# Gold film, 532 nm. Source: a laboratory; licence: "
            "MIT\n#\nangle_deg,R_s,sigma_R_s,R_p\n" + rows(ANGLES, R_S, ERRORS, R_P)
        ).encode(),
        BOTH,
    ),
    "comma and blank": Variety(
        b"angle, Rs, Rp\n" + rows(ANGLES, R_S, R_P, mark=", ").encode(), BOTH
    ),
    "tab": Variety(b"angle\tR_s\tR_p\n" + rows(ANGLES, R_S, R_P, mark="\t").encode(), BOTH),
    "blanks": Variety(b"  angle   Rs  Rp\n" + rows(ANGLES, R_S, R_P, mark="   ").encode(), BOTH),
    "blank tab blank": Variety(
        b"angle\tRs\tRp\n" + rows(ANGLES, R_S, R_P, mark=" \t ").encode(), BOTH
    ),
    "semicolon": Variety(b"angle;Rs;Rp\n" + rows(ANGLES, R_S, R_P, mark=";").encode(), BOTH),
    "pipes": Variety(
        b"| angle | Rs | Rp |\n|---|---|---|\n"
        + "".join(
            f"| {a} | {s} | {p} |\n" for a, s, p in zip(ANGLES, R_S, R_P, strict=True)
        ).encode(),
        BOTH,
    ),
    "pipes in the header only": Variety(
        b"|AOI (degree)|R_s (-)|R_p (-)|\r\n"
        + rows(ANGLES, R_S, R_P, mark="\t", end="\r\n").encode(),
        BOTH,
    ),
    "spreadsheet sep line": Variety(
        b"sep=;\nangle;Rs;Rp\n" + rows(ANGLES, R_S, R_P, mark=";").encode(), BOTH
    ),
    "decimal comma, semicolon": Variety(
        b"Winkel;Rs;Rp\n" + rows(comma(ANGLES), comma(R_S), comma(R_P), mark=";").encode(), BOTH
    ),
    "decimal comma, tab": Variety(
        b"Winkel\tRs\tRp\n" + rows(comma(ANGLES), comma(R_S), comma(R_P), mark="\t").encode(), BOTH
    ),
    "decimal comma, blanks": Variety(
        b"Winkel Rs Rp\n" + rows(comma(ANGLES), comma(R_S), comma(R_P), mark=" ").encode(), BOTH
    ),
    "decimal comma in every cell, blanks": Variety(
        b"Winkel Rs\n10,5 0,25\n20,5 0,5\n", {"R_s": ("0.25", "0.5")}, angles=("10.5", "20.5")
    ),
    "units row that matters": Variety(
        b"AOI,Rs\nrad,%\n" + rows(("1.0", "0.5"), ("25", "50")).encode(),
        {"R_s": ("0.25", "0.5")},
        angles=("57.29577951308232", "28.64788975654116"),
    ),
    "names that are numbers": Variety(
        b"angle,405,532\n" + BODY.encode(),
        BOTH,
        {"columns": {"angle": "angle", "R_s": "405", "R_p": 3}, "lines": "2-"},
    ),
    "second block, named alone": Variety(
        b"angle,R_s,R_p\n1,.1,.1\n2,.2,.2\n\nangle,R_s,x\n" + BODY.encode(),
        ONE,
        {"lines": "6-", "ignore": "x"},
    ),
    "decimal comma in quotes": Variety(
        b"angle,Rs,Rp\n"
        + "".join(
            f'"{a}","{s}","{p}"\n'
            for a, s, p in zip(comma(ANGLES), comma(R_S), comma(R_P), strict=True)
        ).encode(),
        BOTH,
    ),
    "crlf": Variety(b"angle,Rs,Rp\r\n" + BODY.replace("\n", "\r\n").encode(), BOTH),
    "cr only": Variety(b"angle,Rs,Rp\r" + BODY.replace("\n", "\r").encode(), BOTH),
    "no last line end": Variety(b"angle,Rs,Rp\n" + BODY.rstrip().encode(), BOTH),
    "utf-8 mark": Variety(b"\xef\xbb\xbfangle,Rs,Rp\n" + BODY.encode(), BOTH),
    "utf-16 with mark": Variety(("angle,Rs,Rp\n" + BODY).encode("utf-16"), BOTH),
    "utf-16-le": Variety(
        ("angle,Rs,Rp\n" + BODY).encode("utf-16-le"), BOTH, {"encoding": "utf-16-le"}
    ),
    "utf-16-be": Variety(
        ("angle,Rs,Rp\n" + BODY).encode("utf-16-be"), BOTH, {"encoding": "utf-16-be"}
    ),
    "utf-32": Variety(("angle,Rs,Rp\n" + BODY).encode("utf-32"), BOTH, {"encoding": "utf-32"}),
    "latin-1 degree": Variety(("Einfallswinkel / \u00b0,Rs,Rp\n" + BODY).encode("latin-1"), BOTH),
    "greek": Variety(("\u03b8 [\u00b0],R\u22a5,R\u2225\n" + BODY).encode(), BOTH),
    "quoted header with a comma": Variety(
        b'"Angle, deg","R_s, -","R_p, -"\n' + BODY.encode(), BOTH
    ),
    "units row": Variety(b"AOI,Rs,Rp\ndeg,-,-\n" + BODY.encode(), BOTH),
    "settings above": Variety(
        b"Time1=177ms:Objective=100x (6/18/2025 5:37:33 PM)\nReflectance\n100x\nAvg1: 10.000000\n\n"
        b"angle (deg),R s (-),R p (-)\n" + BODY.encode(),
        BOTH,
    ),
    "settings in braces": Variety(
        b"{ Units } SI Microns\n{ Thickness } 3.048\n{ Acceptance: # }\n"
        + rows(ANGLES, R_S, R_P, mark="    ").encode(),
        BOTH,
        {"columns": "angle=1,R_s=2,R_p=3"},
    ),
    "numbers in the settings right above": Variety(
        b"run 5 of 12 lamps today\n" + rows(ANGLES, R_S, R_P, mark=" ").encode(),
        BOTH,
        {"columns": "angle=1,R_s=2,R_p=3"},
    ),
    "date right above": Variety(
        b"2023-05-30 12:30:01\n" + rows(ANGLES, R_S, R_P, mark=" ").encode(),
        BOTH,
        {"columns": "angle=1,R_s=2,R_p=3"},
    ),
    "utf-8 mark, encoding said": Variety(
        b"\xef\xbb\xbfx,Rs,Rp\n" + BODY.encode(),
        BOTH,
        {"encoding": "utf-8", "columns": "angle=x,R_s=Rs,R_p=Rp"},
    ),
    "column without numbers": Variety(
        b"angle,Rs,reflectance s,Rp\n" + rows(ANGLES, R_S, ("",) * 5, R_P).encode(), BOTH
    ),
    "settings with a cell of their own": Variety(
        b"instrument,goniometer,\nlaser,532,\nangle_deg,R_s,R_p\n" + BODY.encode(),
        BOTH,
        {"wavelength_um": 0.532},
    ),
    "columns keyword": Variety(
        b'#RRF 1 1\n#title "run 4"\n#columns AOI Rs Rp\n'
        + rows(ANGLES, R_S, R_P, mark=" ").encode(),
        BOTH,
    ),
    "comments in the middle": Variety(
        b"angle,Rs,Rp\n"
        + BODY.replace("61.25", "#42 0.54\n# 43,0.5,0.6\n% note\n61.25", 1).encode(),
        BOTH,
    ),
    "comment marks ; and !": Variety(
        b"; WAVELENGTH 70.06 70.06\n! run\nangle,Rs,Rp\n" + BODY.encode(),
        BOTH,
        {"wavelength_um": 0.532},
    ),
    "text below": Variety(
        b"angle,Rs,Rp\n" + BODY.encode() + b"\nEnd of data\nmeasured by A. B.\n", BOTH
    ),
    "header repeated": Variety(
        b"angle,Rs,Rp\n" + BODY.replace("61.25", "angle,Rs,Rp\n61.25", 1).encode(), BOTH
    ),
    "trailing delimiter": Variety(b"angle,Rs,Rp,\n" + BODY.replace("\n", ",\n").encode(), BOTH),
    "trailing delimiter, rows only": Variety(
        b"angle,Rs,Rp\n" + BODY.replace("\n", ",\n").encode(),
        BOTH,
        {"columns": "angle=1,R_s=2,R_p=3", "angle_unit": "deg"},
    ),
    "no header": Variety(BODY.encode(), BOTH, {"columns": {"angle": 1, "R_s": 2, "R_p": 3}}),
    "columns by name": Variety(
        b"x,first run,second run\n" + BODY.encode(),
        BOTH,
        {"columns": {"angle": "x", "R_s": "first run", "R_p": "Second Run"}},
    ),
    "fortran exponents": Variety(
        b"angle Rs\n"
        + rows(
            ANGLES, tuple(f"{float(r):.15e}".replace("e-", "D-0") for r in R_S), mark=" "
        ).encode(),
        {"R_s": tuple(f"{float(r):.15e}" for r in R_S)},
    ),
    "three-digit exponents": Variety(
        b"angle Rs\n"
        + rows(
            ANGLES, tuple(f"{float(r):.6e}".replace("e-0", "e-00") for r in R_S), mark=" "
        ).encode(),
        {"R_s": tuple(f"{float(r):.6e}" for r in R_S)},
    ),
    "grazing": Variety(
        b"grazing angle (deg),Rs\n" + rows(("60", "40", "25.5", "1", "0.5"), R_S).encode(),
        ONE,
        angles=("30", "50", "64.5", "89", "89.5"),
    ),
    "unused columns": Variety(
        b"angle_deg,signal_V,R_s,n_samples,T (K)\n"
        + rows(ANGLES, PERCENT, R_S, ("20",) * 5, ("293.15",) * 5).encode(),
        ONE,
    ),
    "s with one error": Variety(b"aoi_deg,R_s,err\n" + rows(ANGLES, R_S, ERRORS).encode(), ONE),
    "long, words": Variety(b"aoi_deg,polarization,R\n" + _long.encode(), BOTH),
    "long, TE and TM": Variety(_words("TE", "TM"), BOTH),
    "long, s-pol": Variety(_words("s-pol", "p-polarized"), BOTH),
    "long, German": Variety(_words("senkrecht", "parallel"), BOTH),
    "long, codes": Variety(_words("0", "1"), BOTH, {"polarization": "0=s,1=p"}),
    "long, polarizer from p": Variety(_words("90", "0"), BOTH, {"polarization": "angle-from-p"}),
    "long, polarizer from s": Variety(_words("180", "-90"), BOTH, {"polarization": "angle-from-s"}),
    "polarization by option": Variety(
        b"angle,R\n" + rows(ANGLES, R_S).encode(), ONE, {"polarization": "s"}
    ),
    "polarization by a remark": Variety(
        b"# polarization: TM\nangle,R\n" + rows(ANGLES, R_P).encode(), {"R_p": R_P}
    ),
    "polarization in the file name, and said": Variety(
        b"angle,R\n" + rows(ANGLES, R_S).encode(),
        ONE,
        {"polarization": "s"},
        name="gold_532nm_s-pol.csv",
    ),
    "unpolarized": Variety(b"angle,R\n" + rows(ANGLES, R_S).encode(), {"R": R_S}),
    "falling, unsorted and repeated": Variety(
        b"angle,Rs\n" + rows(("85", "60", "60", "5", "10"), R_S).encode(),
        ONE,
        angles=("85", "60", "60", "5", "10"),
    ),
    "mean beside s and p": Variety(
        b"angle,Rs,Rp,Ravg\n"
        + rows(
            ANGLES,
            R_S,
            R_P,
            tuple(f"{(float(s) + float(p)) / 2:.6f}" for s, p in zip(R_S, R_P, strict=True)),
        ).encode(),
        BOTH,
        {"columns": "angle=1,R_s=2,R_p=3"},
    ),
    "orso": Variety(
        b"# # ORSO reflectivity data file | 1.0 standard | YAML encoding\n# data_source:\n"
        b"# # aoi (deg)    R ()    sR\n" + rows(ANGLES, R_S, ERRORS, mark=" ").encode(),
        {"R": R_S},
    ),
    "two blocks, one read": Variety(
        b"angle,Rs,Rp\n" + BODY.encode() + b"wavelength,n,k\n0.5,1,2\n0.6,1.1,2.2\n",
        BOTH,
        {"lines": "1-6"},
    ),
    "missing word": Variety(
        b"angle,Rs\n" + rows(ANGLES, R_S).encode() + b"85,-9999\n86,bad\n",
        ONE,
        {"missing": "-9999,bad"},
    ),
    "no trust in percent": Variety(
        b"angle,Rs (%)\n" + rows(ANGLES, R_S).encode(), ONE, {"scale": 1}
    ),
}
