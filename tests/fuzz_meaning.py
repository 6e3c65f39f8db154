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
from typing import NamedTuple

import numpy as np

from fitting.measurement import Measurement, MeasurementError, read_csv


def _spellings() -> dict[str, list[str]]:
    """Return the lists of ``spellings.txt``: [NAME] and what it is, then a spelling a line."""
    lists: dict[str, list[str]] = {}
    text = (Path(__file__).parent / "spellings.txt").read_text(encoding="utf-8")
    for block in text.strip().split("\n\n"):
        head, *rest = block.split("\n")
        lists[head[1 : head.index("]")]] = rest
    return lists


SPELLINGS = _spellings()


class Case(NamedTuple):
    """A file, and what it means: rows (angle, wavelength or nan, quantity, value, sigma or nan).

    rows is None where the file holds no number that could be meant as R, T, psi or Delta.
    """

    name: str
    text: str
    options: dict[str, object]
    rows: list[tuple[float, float, str, float, float]] | None


_WORDS = {"s": ("s", "S", "TE", "senkrecht"), "p": ("p", "P", "TM", "parallel")}


def _texts(numbers: np.ndarray, digits: int) -> list[str]:
    return [f"{number:.{digits}f}" for number in numbers]


def _numbers(texts: list[str]) -> list[float]:
    return [float(text) for text in texts]


class Draw:
    """One file in the making: header cells, columns of text, lines around them, truth."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng
        self.names: list[str] = []
        self.columns: list[list[str]] = []
        self.above: list[str] = []
        self.below: list[str] = []
        self.between: list[str] = []
        self.stem = str(self.one(["gold", "run7", "sample_12", "Au film", "data"]))
        self.options: dict[str, object] = {}
        self.meant = True

    def one(self, items):
        return items[int(self.rng.integers(len(items)))]

    def often(self, share: float) -> bool:
        return bool(self.rng.random() < share)

    def column(self, name: str, texts: list[str]) -> None:
        self.names.append(name)
        self.columns.append(texts)

    def say(self, text: str) -> None:
        """Put a sentence somewhere around the table, mostly above it."""
        where = self.rng.random()
        (self.above if where < 0.75 else self.below if where < 0.9 else self.between).append(text)

    def unit(self, name: str, units: str) -> str:
        form = self.one(
            ["{n} ({u})", "{n} [{u}]", "{n} / {u}", "{n}_{u}", "{n}, {u}", "{n} in {u}"]
        )
        return form.format(n=name, u=self.one(units.split("|")))

    def scan_angles(self) -> list[float]:
        """Draw the column of angles in one of its meanings; return degrees of incidence."""
        count = int(self.rng.integers(5, 12))
        low, high = sorted(self.rng.uniform(3.0, 88.0, 2))
        degrees = np.linspace(low, high + 1.0, count)
        name, meaning = self.one(SPELLINGS["INCIDENCE"]), self.rng.random()
        if meaning < 0.5:
            texts = _texts(degrees, 2)
            name = self.unit(name, "deg|\u00b0|degree|degrees|Grad") if self.often(0.6) else name
            if self.often(0.1):
                self.say(self.one(["angles in degrees", "all angles are in deg"]))
            self.column(name, texts)
            return _numbers(texts)
        if meaning < 0.7:
            if self.often(0.2):
                degrees[-1] = 90.0
            texts = _texts(np.radians(degrees), int(self.rng.integers(1, 6)))
            how = self.rng.random()
            if how < 0.4:
                name = self.unit(name, "rad|radian|radians")
            elif how < 0.8:
                self.say(self.one(["angles in radians", "angle in rad", "unit of angle: rad"]))
            self.column(name, texts)
            return [min(math.degrees(x), 90.0) for x in _numbers(texts)]
        if meaning < 0.9:
            texts = _texts(90.0 - degrees, 2)
            if self.often(0.5):
                name = self.one(
                    ["grazing angle", "glancing angle", "Streifwinkel", "grazing theta"]
                )
            else:
                self.say(self.one([
                    "grazing angles", "angles are grazing", "grazing incidence geometry",
                    "angle measured from the surface", "theta is the grazing angle",
                ]))  # fmt: skip
            self.column(self.unit(name, "deg|\u00b0") if self.often(0.7) else name, texts)
            return [90.0 - x for x in _numbers(texts)]
        texts = _texts(180.0 - 2.0 * degrees, 2)
        self.column(
            self.one(["2theta", "2theta (deg)", "2\u03b8", "two theta [deg]", "tth"]), texts
        )
        return [90.0 - x / 2.0 for x in _numbers(texts)]

    def wavelengths(self) -> list[float]:
        """Draw the column of wavelengths; return micrometres."""
        um = np.linspace(self.rng.uniform(0.3, 0.5), self.rng.uniform(0.6, 1.5), 7)
        kind = int(self.rng.integers(6))
        name = self.one(SPELLINGS["WAVE"])
        if kind <= 2:
            factor, digits, units = (
                (1e3, 1, "nm"),
                (1.0, 4, "um|\u00b5m|micron|\u03bcm"),
                (1e4, 0, "A|\u00c5|angstrom"),
            )[kind]
            texts = _texts(um * factor, digits)
            where = self.rng.random()
            if where < 0.6:
                name = self.unit(name, units)
            elif where < 0.8:
                self.say(f"wavelength in {units.split('|')[0]}")
            elif where < 0.9:
                name = units.split("|")[0]
            self.column(name, texts)
            return [x / factor for x in _numbers(texts)]
        if kind == 3:
            texts = _texts(1.2398419843320026 / um, 4)
            self.column(self.one(["E (eV)", "photon energy [eV]", "eV", "lambda (eV)"]), texts)
            return [1.2398419843320026 / x for x in _numbers(texts)]
        if kind == 4:
            texts = _texts(1e4 / um, 1)
            self.column(self.one(["wavenumber (cm-1)", "cm-1", "Wellenzahl / cm^-1"]), texts)
            return [1e4 / x for x in _numbers(texts)]
        texts = _texts(um * 1e3, 1)
        self.column(self.one(["nm", "lambda [nm]", "Wavelength, nm"]), texts)
        return [x / 1e3 for x in _numbers(texts)]

    def powers(self, names: list[str], count: int, percent: bool, said: bool) -> list[float]:
        """Draw one column of powers; return fractions, or nothing where it is none."""
        curve = 0.1 + 0.7 * np.abs(np.sin(self.rng.uniform(0.2, 1.3) + np.arange(count) / 9.0))
        texts = _texts(curve * (100.0 if percent else 1.0), 3 if percent else 5)
        name = self.one(names)
        unmeant = self.often(0.06)
        if unmeant:
            name = self.one(SPELLINGS["NO_POWER"])
        if percent and said:
            form = self.one(["{n} (%)", "{n} [%]", "%{n}", "{n} / %", "{n} in %", "{n}_percent"])
            name = form.format(n=name)
        elif not percent and self.often(0.1):
            name += self.one([" (-)", " [1]", " [-]"])
        self.column(name, texts)
        if unmeant:  # no datum
            return []
        return [x / 100.0 if percent else x for x in _numbers(texts)]

    def sigmas(self, values: list[float], percent: bool) -> list[float]:
        """Draw a column of standard errors, absolute or relative, or none; return absolute ones."""
        kind = self.rng.random()
        if kind < 0.6 or not values:
            return [math.nan] * len(values)
        if kind < 0.9:
            size = (100.0 if percent else 1.0) * self.rng.uniform(0.001, 0.01)
            texts = _texts(size * self.rng.uniform(0.5, 1.5, len(values)), 5)
            self.column(
                self.one(SPELLINGS["SIGMAS"]) + (" (%)" if percent and self.often(0.7) else ""),
                texts,
            )
            return [x / 100.0 if percent else x for x in _numbers(texts)]
        texts = _texts(self.rng.uniform(0.5, 3.0, len(values)), 3)
        name = self.one(SPELLINGS["RELATIVE"])
        if "%" not in name:
            texts = _texts(np.array(_numbers(texts)) / 100.0, 5)
        self.column(name, texts)
        part = 0.01 if "%" in name else 1.0
        return [part * x * v for x, v in zip(_numbers(texts), values, strict=True)]

    def angle_of_all(self) -> float:
        """Say, somewhere or nowhere, at which angle a spectrum was measured; return it."""
        if self.often(0.25):
            if self.often(0.2):
                self.say(self.one(["normal incidence", "AOI: 0", "Angle of incidence: 0 deg"]))
            return 0.0
        angle = float(self.rng.integers(10, 85)) + (0.5 if self.often(0.2) else 0.0)
        forms = {
            "a": f"{angle:g}", "g": f"{90.0 - angle:g}", "r": f"{math.radians(angle):.9f}",
        }  # fmt: skip
        how = self.rng.random()
        if how < 0.12:
            form = self.one(
                ["{s}_{a}deg", "{s} {a} deg", "{s}_AOI{a}", "{a}deg_{s}", "{s}-{a}\u00b0"]
            )
            self.stem = form.format(s=self.stem, a=forms["a"])
        elif how < 0.2:
            self.options["angle_deg"] = angle
            if self.often(0.5):
                self.say(self.one(SPELLINGS["ANGLE_SAID"]).format(**forms))
        else:
            self.say(self.one(SPELLINGS["ANGLE_SAID"]).format(**forms))
            if self.often(0.1):  # and once more, of another angle: nobody knows which
                self.say(self.one(SPELLINGS["ANGLE_SAID"][:4]).format(a=f"{angle / 2.0:g}"))
                self.meant = False
        return angle

    def light_of_all(self) -> str:
        """Say, somewhere or nowhere, which light it was; return the tail of the quantity."""
        if self.often(0.3):
            if self.often(0.3):
                self.say(self.one(["unpolarized", "unpolarised light", "polarization: none"]))
            return ""
        letter = self.one(["s", "p"])
        small, large, mode, word = _WORDS[letter]
        forms = {"l": small, "L": large, "t": mode, "w": word}
        how = self.rng.random()
        if how < 0.2:
            form = self.one(
                ["{s}_{l}-pol", "{s}_{t}", "{s} {l}pol", "{s}_{l}", "{l}_{s}", "{s}_R{l}"]
            )
            self.stem = form.format(s=self.stem, **forms)
        elif how < 0.35:
            self.options["polarization"] = letter
        elif how < 0.5:
            self.column(self.one(["pol", "polarization", "Polarisation"]), [])
            self.columns[-1] = [self.one([small, large, mode, word])] * len(self.columns[0])
        else:
            self.say(self.one(SPELLINGS["LIGHT_SAID"]).format(**forms))
        return "_" + letter

    def percent(self) -> tuple[bool, bool]:
        """Return whether powers are in percent, and whether each header says so."""
        if self.often(0.6):
            return False, False
        where = self.rng.random()
        if where < 0.6:
            return True, True
        if where < 0.85:
            self.say(self.one(["R in percent", "values in %", "reflectance in %", "R [%]"]))
        return True, False

    def finished(self, rows: list[tuple[float, float, str, float, float]]) -> Case:
        delimiter = self.one([",", ",", ";", "\t", "|"])
        comma = delimiter in ";\t" and self.often(0.3)
        mark = self.one(["# ", "#", "% ", "! ", ""]) if delimiter != "|" else "# "
        order = self.rng.permutation(len(self.columns)) if self.often(0.3) else None
        indices = range(len(self.columns)) if order is None else order.tolist()
        if order is not None and any(name in SPELLINGS["SIGMAS"] for name in self.names):
            indices = range(len(self.columns))
        for _ in range(int(self.rng.integers(3))):
            self.above.insert(
                int(self.rng.integers(len(self.above) + 1)), self.one(SPELLINGS["HARMLESS"])
            )
        names = [self.names[i] for i in indices]
        quoted = [f'"{name}"' if delimiter in name else name for name in names]
        table = [[self.columns[i][j] for i in indices] for j in range(len(self.columns[0]))]
        lines = [delimiter.join(cells) for cells in table]
        if comma:
            lines = [line.replace(".", ",") for line in lines]
        at = int(self.rng.integers(1, len(lines)))
        lines[at:at] = [f"{self.one(['#', '% '])}{text}" for text in self.between]
        head = [mark + text for text in self.above] + [delimiter.join(quoted)]
        text = "\n".join([*head, *lines, *(f"# {text}" for text in self.below)]) + "\n"
        name = self.stem + self.one([".csv", ".txt", ".dat"])
        return Case(name, text, self.options, rows if self.meant and rows else None)


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
        texts = _texts(np.radians(curve) if radians else curve, 4)
        name = draw.one(names)
        if draw.often(0.6):
            name = draw.unit(name, "rad|radian" if radians else "deg|\u00b0|degrees")
        draw.column(name, texts)
        values = [math.degrees(x) if radians else x for x in _numbers(texts)]
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
            assert case.name in str(refusal) and "--" in str(refusal), (str(refusal), case)
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
