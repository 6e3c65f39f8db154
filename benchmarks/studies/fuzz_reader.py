"""Damaged files for the reader: each must end in a Measurement or in a MeasurementError.

``python -m benchmarks.studies.fuzz_reader [COUNT [SEED]]`` runs as many as wanted; the tests
run 6,000.
"""

from __future__ import annotations

import sys
import tempfile
import time
import warnings
from collections import Counter
from pathlib import Path

import numpy as np

from fitting.data.checks import EXCURSION, EXCURSION_SIGMAS, NOISE_EXCURSION
from fitting.data.measurement import Measurement, MeasurementError
from fitting.measured_file import read_csv
from tests.truth.varieties import VARIETIES

_JUNK = (
    b"\x00",
    b"\xff",
    b'"',
    b"'",
    b",",
    b";",
    b"\t",
    b"|",
    b"#",
    b"%",
    b"\r",
    b"\n",
    b"\r\n",
    b" ",
    b"-",
    b"nan",
    b"inf",
    b"-inf",
    b"1e999",
    b"-1e-999",
    b"1e",
    b"0",
    b"-1",
    b"1,234",
    b"1.2.3",
    b"0x1p3",
    b"1_0",
    b"\xc2\xb5",
    b"\xe2\x88\x92",
    b"\xef\xbb\xbf",
    b"\xc2\xb0",
    b"(",
    b"]",
    b"{",
    b"sep=;\n",
    b"e",
    b"s",
    b"TE",
    b"999999999999999999999999",
    b"\xd9\xa3",
    b"\xe2\x85\xa7",
    b"=",
    b"//",
    b"VASEmethod[]\nnm\n",
    b"zone",
)
_OPTIONS = (
    {},
    {},
    {},
    {},
    {"scale": 0.01},
    {"scale": "1e300"},
    {"angle_unit": "rad"},
    {"angle_unit": "1/angstrom"},
    {"wavelength_um": 0.5},
    {"wavelength_um": 5e-4, "angle_unit": "1/nm"},
    {"wavelength_unit": "eV"},
    {"wavelength_unit": "cm-1"},
    {"polarization": "s"},
    {"polarization": "0=s,1=p"},
    {"psi_unit": "rad"},
    {"polarization": "angle-from-s"},
    {"columns": "angle=1,R=2"},
    {"columns": "wavelength=1,T=2,sigma_T=3"},
    {"columns": "wavelength=1,psi=3,delta=4", "angle_deg": 60},
    {"delimiter": "blank"},
    {"delimiter": ";"},
    {"decimal": ","},
    {"missing": "0"},
    {"missing": "none"},
    {"ignore": "3,Zone"},
    {"lines": "3-9"},
    {"lines": "-4"},
    {"encoding": "latin-1"},
    {"encoding": "utf-16"},
    {"sigma": 0.1},
    {"angle_deg": "45"},
    {"columns": "x=1"},
    {"lines": "9"},
    {"delimiter": "comma", "decimal": ","},
    {"angle_unit": "grazing-deg"},
    {"columns": "R=1"},
    {"columns": "angle=2,polarization=1,R=3"},
    {"columns": "polarizer=1,R=2", "angle_deg": 3, "polarization": "angle-from-p"},
    {"encoding": "rot13"},
    {"encoding": "zip"},
    {"scale": "x"},
)


def corpus(folder: Path | None) -> list[bytes]:
    """Return the files to be damaged: the written-out varieties, and the real ones if here."""
    files = [variety.content for variety in VARIETIES.values()]
    if folder is not None and folder.is_dir():
        paths = sorted(
            p for p in folder.rglob("*") if p.is_file() and p.parent.name not in ("nk", "LICENSES")
        )
        files += [
            path.read_bytes() for path in paths if "run.20" not in path.name or "29.40" in path.name
        ]
    return files


def damaged(rng: np.random.Generator, files: list[bytes]) -> bytes:
    """Return one of the files, cut to a window of lines and changed in one to four places."""
    data = files[rng.integers(len(files))]
    lines = data.splitlines(keepends=True)
    if len(lines) > 40:  # a long file is damaged in a part of it: its head, and a window of rows
        start = int(rng.integers(len(lines) - 20))
        lines = lines[: int(rng.integers(30))] + lines[start : start + int(rng.integers(2, 25))]
        data = b"".join(lines)
    for _ in range(int(rng.integers(1, 5))):
        at = int(rng.integers(len(data) + 1))
        kind = int(rng.integers(13))
        if kind == 0:
            data = data[:at] + _JUNK[rng.integers(len(_JUNK))] + data[at:]
        elif kind == 1:
            data = data[:at] + data[at + int(rng.integers(1, 9)) :]
        elif kind == 2:
            data = data[:at] + bytes([int(rng.integers(256))]) + data[at + 1 :]
        elif kind == 3:
            data = data[:at] if rng.random() < 0.5 else data[at:]
        elif kind in (4, 5, 6):
            lines = data.splitlines(keepends=True) or [b""]
            i, j = (int(rng.integers(len(lines))) for _ in range(2))
            if kind == 4:
                lines[i], lines[j] = lines[j], lines[i]
            elif kind == 5:
                lines.insert(i, lines[j])
            else:
                del lines[i]
            data = b"".join(lines)
        elif kind == 7:
            marks = [b",", b";", b"\t", b" ", b"|", b".", b"\n", b"\r\n", b"\r", b"-", b"0"]
            one, other = (marks[rng.integers(len(marks))] for _ in range(2))
            data = data.replace(one, other)
        elif kind == 8:
            names = ["utf-16", "utf-16-le", "utf-16-be", "utf-32", "utf-8-sig", "cp037"]
            data = data.decode("latin-1").encode(names[rng.integers(6)], "replace")
        elif kind == 9:
            cells = data.split(b",")
            cells[rng.integers(len(cells))] = _JUNK[rng.integers(len(_JUNK))]
            data = b",".join(cells)
        elif kind == 10:
            other = files[rng.integers(len(files))][:400].splitlines(keepends=True)
            data = b"".join(other[: int(rng.integers(1, 4))]) + data
        elif kind == 11:
            words = [
                b"(rad)",
                b"(%)",
                b"(eV)",
                b"nm",
                b"deg",
                b"R_s",
                b"psi",
                b"delta",
                b"T",
                b"pol",
                b"sigma",
                b"Q",
            ]
            old, new = (words[rng.integers(len(words))] for _ in range(2))
            data = data.replace(old, new)
        else:
            data = data + data[: int(rng.integers(400))]
    return data


def refuse_nonsense(measurement: Measurement) -> None:
    """Raise AssertionError unless every number is one that a Measurement may hold."""
    m, power = measurement, ~np.isin(measurement.quantity, ("psi", "delta"))
    stated = np.minimum(EXCURSION_SIGMAS * m.sigma, EXCURSION)
    slack = np.where(np.isnan(m.sigma), NOISE_EXCURSION, np.fmax(stated, 1e-12))
    assert len(m) > 0 and m.understood
    assert np.all((m.angle_deg >= 0) & (m.angle_deg <= 90))
    assert (
        np.all(np.isfinite(m.value))
        and not np.any(m.sigma <= 0)
        and not np.any(m.wavelength_um <= 0)
    )
    assert not np.any(np.isinf(m.sigma)) and not np.any(np.isinf(m.wavelength_um))
    assert np.all((m.value >= -slack) & (m.value <= 1 + slack) | ~power)
    assert np.all((m.value >= 0) & (m.value <= 90) | (m.quantity != "psi"))
    assert np.all(np.abs(m.value) <= 360) and np.all((np.abs(m.value) <= 1.25) | ~power)


def run(count: int, seed: int, files: list[bytes], folder: Path) -> Counter[str]:
    """Read ``count`` damaged files and return how many ended in which way."""
    rng = np.random.default_rng(seed)
    names = ("gold.csv", "gold_s.csv", "Polarisation0.csv", "x_p-pol_61.25deg.txt")
    ends: Counter[str] = Counter()
    for number in range(count):
        data = damaged(rng, files)
        options = _OPTIONS[rng.integers(len(_OPTIONS))]
        path = folder / names[rng.integers(len(names))]
        path.write_bytes(data)
        try:
            refuse_nonsense(read_csv(path, **options))
            ends["measurement"] += 1
        except MeasurementError as refusal:
            text = str(refusal)
            assert path.name in text and len(text) > 30, text
            ends["refusal"] += 1
        except Exception as error:
            error.add_note(f"damaged file {number} of seed {seed}, options {options}: {data!r}")
            raise
    return ends


if __name__ == "__main__":
    warnings.simplefilter("error")
    how_many = int(sys.argv[1]) if len(sys.argv) > 1 else 20_000
    first_seed = int(sys.argv[2]) if len(sys.argv) > 2 else 0
    shared = Path(__file__).resolve().parents[3] / "shared" / "data"
    began = time.perf_counter()
    with tempfile.TemporaryDirectory() as scratch:
        print(dict(run(how_many, first_seed, corpus(shared), Path(scratch))))
    print(f"{time.perf_counter() - began:.1f} s")
