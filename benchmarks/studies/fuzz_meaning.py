"""Files of known truth in spellings drawn at random: each is read right, or refused.

Where `fuzz_reader` damages bytes, this draws meanings: what the columns are, in which unit and
language, and where the angle, the polarization, the wavelength and the unit are said: in a header,
a comment, a setting, below or between the numbers, in the file name, or by no word at all. The
words are those of ``spellings.txt``, not the reader's. A file that is read, but not as
it was meant, is a defect; a refusal is not.

``python -m benchmarks.studies.fuzz_meaning [COUNT [SEED]]`` runs as many as wanted.
"""

from __future__ import annotations

import math
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np

from fitting.data.errors import for_command
from fitting.data.measurement import MeasurementError
from fitting.measured_file import read_csv
from fitting.samples.material_files import index_in_table
from tests.truth.drawn_files import SPELLINGS, Case, Draw, numbers_of_texts, texts_of


def beside(draw: Draw) -> None:
    """Draw a column that tells rows apart, which nobody may leave out, or one that does not."""
    count, kind = len(draw.columns[0]), draw.rng.random()
    if kind < 0.15:
        name, _, cells = draw.one(SPELLINGS["APART"]).rpartition("=")
        both = cells.split("|")
        where = draw.rng.integers(2, size=count)
        where[:2] = (0, 1)
        draw.column(name, [both[i] for i in where])
        draw.meant = False
    elif kind < 0.25:
        name, _, cell = draw.one(SPELLINGS["CONSTANT"]).rpartition("=")
        draw.column(name, [cell] * count)
    elif kind < 0.3:
        draw.column(draw.one(["#", "no.", "index", "i", ""]), [*map(str, range(1, count + 1))])


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
    beside(draw)
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
    beside(draw)
    return draw.finished(rows)


def ellipsometry(draw: Draw) -> Case:
    """Draw psi and Delta, each in degrees or radians, labelled or not, over angle or wavelength."""
    spectral = draw.often(0.3)
    waves = draw.wavelengths() if spectral else []
    angles = [60.0] * len(waves) if spectral else draw.scan_angles()
    waves = waves or [math.nan] * len(angles)
    draw.options |= {"angle_deg": 60.0} if spectral else {}
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
        places = zip(angles, waves, values, strict=True)
        rows += [(a, w, quantity, v, math.nan) for a, w, v in places]
    beside(draw)
    return draw.finished(rows)


def material(draw: Draw) -> Case:
    """Draw a table of n, and k or not, over a wavelength or the like; errors and others beside."""
    waves = draw.wavelengths()
    rows = []
    for quantity in ("n", "k")[: 1 + draw.often(0.7)]:
        if draw.often(0.15):
            draw.column(draw.one(SPELLINGS["NK_OTHER"]), texts_of(draw.rng.random(len(waves)), 4))
            draw.meant = False
        texts = texts_of(1.5 * draw.rng.random(len(waves)) + 0.1, 4)
        draw.column(draw.one(SPELLINGS[quantity.upper()]), texts)
        values = numbers_of_texts(texts)
        rows += [(0.0, w, quantity, v, math.nan) for w, v in zip(waves, values, strict=True)]
        if draw.often(0.3):
            texts = texts_of(0.01 * draw.rng.random(len(waves)) + 0.001, 5)
            draw.column(draw.one(SPELLINGS["NK_ERRORS"]), texts)
    if draw.often(0.1):
        draw.column(draw.one(SPELLINGS["NK_OTHER"]), texts_of(draw.rng.random(len(waves)), 4))
        draw.meant = False
    beside(draw)
    return draw.finished(rows)


Row = tuple[float, float, str, float, float]


def measured(case: Case, path: Path) -> list[Row]:
    """Return the data that are read, as `Case` has them."""
    m = read_csv(path, **case.options)
    columns = (m.angle_deg, m.wavelength_um, m.quantity, m.value, m.sigma)
    return [tuple(row) for row in zip(*(c.tolist() for c in columns), strict=True)]


def of_material(case: Case, path: Path) -> list[Row]:
    """Return the n and k that are read, as `Case` has them."""
    parts = index_in_table(path).items()
    return [(0.0, w, name, x, math.nan) for name, part in parts for w, x in zip(*part, strict=True)]


def difference(case: Case, rows: list[Row]) -> str:
    """Return how what was read differs from what was meant; "" where it does not."""
    if case.rows is None:
        return "read, though it is not clear what it means, or a column may not be left out"
    spectral = len({row[1] for row in case.rows if not math.isnan(row[1])}) > 1
    rows, wanted = (
        sorted(of, key=lambda row: (row[2], row[0], row[1] if row[1] == row[1] else 0))
        for of in (rows, case.rows)
    )
    if len(rows) != len(wanted):
        return f"{len(rows)} data, not {len(wanted)}"
    for read, meant in zip(rows, wanted, strict=True):
        for name, a, b in zip(("angle", "wavelength", "", "value", "sigma"), read, meant,
                              strict=True):  # fmt: skip
            if isinstance(b, str):
                if a != b:
                    return f"{a}, not {b}"
            elif math.isnan(a) and (math.isnan(b) or (name == "wavelength" and not spectral)):
                continue  # a line that names the wavelength may not be understood
            elif not math.isclose(a, b, rel_tol=1e-6, abs_tol=1e-7):
                return f"{name} {a:.9g}, not {b:.9g}"
    return ""


KINDS = ((scan, measured), (spectrum, measured), (ellipsometry, measured), (material, of_material))


def run(count: int, seed: int, folder: Path) -> tuple[Counter[str], list[str]]:
    """Read ``count`` files; return how they ended, and those that were read wrong."""
    ends: Counter[str] = Counter()
    wrong = []
    for number in range(count):
        rng = np.random.default_rng([seed, number])
        drawn, read = KINDS[rng.choice(4, p=(0.3, 0.35, 0.1, 0.25))]
        case = drawn(Draw(rng))
        path = folder / case.name
        path.write_text(case.text, encoding="utf-8")
        try:
            found = difference(case, read(case, path))
        except MeasurementError as refusal:
            ends["refused"] += 1
            ends["refused though clear"] += case.rows is not None
            text = for_command(refusal)
            assert case.name in text and ("--" in text or drawn is material), (text, case)
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
