"""Small written-out files of psi and Delta, one for each way in which such files differ."""

from __future__ import annotations

from tests.truth.reading import ANGLES, DELTA, NANOMETRES, PSI, Variety, rows

ELLIPSOMETRY = {
    "typographic minus": Variety(
        (
            "psi,aoi,delta\n"
            + rows(PSI, ANGLES, DELTA).replace("-", "\u2212").replace("0.4e2", "40")
        ).encode(),
        {"psi": PSI, "delta": DELTA},
    ),
    "names and units behind #": Variety(
        b"#AOI\tDelta\tPsi\tZone\n#deg\tdeg\tdeg\t-\n\t\t\t\n"
        + rows(ANGLES, DELTA, PSI, ("4", "2", "4", "2", "4"), mark="\t").encode(),
        {"psi": PSI, "delta": DELTA},
    ),
    "polarization beside psi": Variety(
        b"pol,aoi,psi,delta\n" + rows(("0",) * 5, ANGLES, PSI, DELTA).encode(),
        {"psi": PSI, "delta": DELTA},
    ),
    "psi and delta": Variety(
        b"Angle of Incidence,Psi,Delta\n" + rows(ANGLES, PSI, DELTA).encode(),
        {"psi": PSI, "delta": DELTA},
    ),
    "rad said, degrees held, settled": Variety(
        b"AOI (deg),PSI (rad),DELTA (rad)\n" + rows(ANGLES, PSI, DELTA).encode(),
        {"psi": PSI, "delta": DELTA},
        {"psi_unit": "deg"},
    ),
    "zones": Variety(
        b"#AOI\tDelta\tPsi\tZone\n"
        + rows(ANGLES, DELTA, PSI, ("1", "2", "3", "4", "1"), mark="\t").encode()
        + b"50\t9\t0.2\t5\n50\t160\t30\t0\n",
        {"psi": PSI, "delta": DELTA},
        {"lines": "-6"},
    ),
    "woollam": Variety(
        b"film\nVASEmethod[EllipsometerType=4, AcqTime=30.013]\nOriginal[film.dat]\nnm\n"
        + "".join(
            f"E\t{w}\t{a}\t{p}\t{d}\t0.0140\t0.0318\ndPolE\t{w}\t0.000\t-5.2834\t1.0000\n"
            for w, a, p, d in zip(NANOMETRES, ANGLES, PSI, DELTA, strict=True)
        ).encode(),
        {"psi": PSI, "delta": DELTA},
        name="film.dat",
    ),
}
