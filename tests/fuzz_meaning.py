"""Files of known truth in spellings drawn at random: each is read right, or refused.

Where `fuzz_reader` damages bytes, this draws meanings: what the columns are, in which unit and
language, and where the angle, the polarization, the wavelength and the unit are said: in a header,
a comment, a setting, below or between the numbers, in the file name, or by no word at all. The
words are those of ``spellings.txt``, not the reader's. A file that is read, but not as
it was meant, is a defect; a refusal is not.

``python tests/fuzz_meaning.py [COUNT [SEED]]`` runs as many as wanted.
"""

from __future__ import annotations

import math
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np
from drawn_files import SPELLINGS, Case, Draw, numbers_of_texts, texts_of

from fitting.measurements.errors import for_command
from fitting.measurements.from_file import read_csv
from fitting.measurements.measurement import Measurement, MeasurementError


def scan(draw: Draw) -> Case:
    """Draw R over angle, of light that is said somewhere, or by the columns' names."""
    angles = draw.scan_angles()
    wave = math.nan
    if draw.often(0.3):
        nm = float(draw.rng.integers(300, 1500))
        forms = {"nm": f"{nm:g}", "um": f"{nm / 1e3:g}", "ev": f"{1239.8419843320026 / nm:.12f}"}
        draw.say(draw.one(SPELLINGS["WAVE_SAID"]).format(**forms))
        wave = nm / 1e3
    percent, said = draw.percent()
    rows = []
    if draw.often(0.5):
        tail = draw.light_of_all()
        curves = [(SPELLINGS["REFLECTANCE"], "R" + tail)]
    else:
        curves = [(SPELLINGS["OF_S"], "R_s"), (SPELLINGS["OF_P"], "R_p")][: 1 + draw.often(0.7)]
    for names, quantity in curves:
        values = draw.powers(names, len(angles), percent, said)
        sigmas = draw.sigmas(values, percent) if len(curves) == 1 else [math.nan] * len(values)
        rows += [(a, wave, quantity, v, s) for a, v, s in zip(angles, values, sigmas, strict=False)]
    return draw.finished(rows)


def spectrum(draw: Draw) -> Case:
    """Draw R over wavelength at an angle that is said somewhere, by the columns, or not at all."""
    waves = draw.wavelengths()
    percent, said = draw.percent()
    rows = []
    if draw.often(0.2):
        tail = draw.one(["_s", "_p", ""])
        head = {"_s": "Rs", "_p": "Rp", "": "R"}[tail]
        form = draw.one(["{h}({a} deg)", "{h}_{a}", "{h}@{a}", "{h} {a}\u00b0", "{h}({a}\u00b0)"])
        for angle in (20.0, 45.0, 70.0)[: int(draw.rng.integers(1, 4))]:
            name = form.format(h=head, a=f"{angle:g}")
            values = draw.powers([name], len(waves), percent, said)
            rows += [
                (angle, w, "R" + tail, v, math.nan) for w, v in zip(waves, values, strict=False)
            ]
        return draw.finished(rows)
    angle = draw.angle_of_all()
    tail = draw.light_of_all() if angle else ""
    values = draw.powers(SPELLINGS["REFLECTANCE"], len(waves), percent, said)
    sigmas = draw.sigmas(values, percent)
    rows = [(angle, w, "R" + tail, v, s) for w, v, s in zip(waves, values, sigmas, strict=False)]
    return draw.finished(rows)


def ellipsometry(draw: Draw) -> Case:
    """Draw psi and Delta over angle, each in degrees or radians, labelled or not."""
    angles = draw.scan_angles()
    rows = []
    for names, quantity, high in (
        (["psi", "Psi", "\u03c8", "PSI"], "psi", 44.0),
        (["delta", "Delta", "\u0394", "DELTA"], "delta", 175.0),
    ):
        curve = high * (0.3 + 0.6 * np.sin(1.0 + np.arange(len(angles)) / 8.0))
        radians = draw.often(0.3)
        texts = texts_of(np.radians(curve) if radians else curve, 4)
        name = draw.one(names)
        if draw.often(0.6):
            name = draw.unit(name, "rad|radian" if radians else "deg|\u00b0|degrees")
        draw.column(name, texts)
        values = [math.degrees(x) if radians else x for x in numbers_of_texts(texts)]
        rows += [(a, math.nan, quantity, v, math.nan) for a, v in zip(angles, values, strict=True)]
    return draw.finished(rows)


def difference(case: Case, m: Measurement) -> str:
    """Return how what was read differs from what was meant; "" where it does not."""
    if case.rows is None:
        return "read, though it is not clear what it means"
    wanted = sorted(case.rows, key=lambda row: (row[2], row[0], row[1] if row[1] == row[1] else 0))
    waves = [w if w == w else 0.0 for w in m.wavelength_um.tolist()]
    columns = (m.angle_deg, m.wavelength_um, m.quantity, m.value, m.sigma)
    rows = [tuple(row) for row in zip(*(c.tolist() for c in columns), strict=True)]
    order = sorted(range(len(rows)), key=lambda i: (rows[i][2], rows[i][0], waves[i]))
    if len(rows) != len(wanted):
        return f"{len(rows)} data, not {len(wanted)}"
    for i, meant in zip(order, wanted, strict=True):
        for name, a, b in zip(("angle", "wavelength", "", "value", "sigma"), rows[i], meant,
                              strict=True):  # fmt: skip
            if isinstance(b, str):
                if a != b:
                    return f"{a}, not {b}"
            elif name in ("wavelength", "sigma") and math.isnan(a):
                continue  # less was understood, and that is said
            elif not math.isclose(a, b, rel_tol=1e-6, abs_tol=1e-7):
                return f"{name} {a:.9g}, not {b:.9g}"
    return ""


def run(count: int, seed: int, folder: Path) -> tuple[Counter[str], list[str]]:
    """Read ``count`` files; return how they ended, and those that were read wrong."""
    ends: Counter[str] = Counter()
    wrong = []
    for number in range(count):
        rng = np.random.default_rng([seed, number])
        kind = rng.random()
        case = (scan if kind < 0.45 else spectrum if kind < 0.85 else ellipsometry)(Draw(rng))
        path = folder / case.name
        path.write_text(case.text, encoding="utf-8")
        try:
            found = difference(case, read_csv(path, **case.options))
        except MeasurementError as refusal:
            ends["refused"] += 1
            ends["refused though clear"] += case.rows is not None
            text = for_command(refusal)
            assert case.name in text and "--" in text, (text, case)
            continue
        finally:
            path.unlink()
        ends["read wrong" if found else "read"] += 1
        if found:
            wrong.append(f"file {number} of seed {seed}, {case.name}: {found}\n{case.text[:600]}")
    return ends, wrong


if __name__ == "__main__":
    how_many = int(sys.argv[1]) if len(sys.argv) > 1 else 20_000
    first_seed = int(sys.argv[2]) if len(sys.argv) > 2 else 0
    began = time.perf_counter()
    with tempfile.TemporaryDirectory() as scratch:
        counted, bad = run(how_many, first_seed, Path(scratch))
    print(dict(counted), f"{time.perf_counter() - began:.1f} s")
    print("\n".join(bad[:20]))
    sys.exit(bool(bad))
