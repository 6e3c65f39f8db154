"""Measured files drawn at random, with what each means: columns, units, languages, sentences."""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np


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

    rows is None where the file holds no number that could be meant as R, T, psi or Delta, or
    columns that a reader may not leave out. Of a material the quantities are n and k.
    """

    name: str
    text: str
    options: dict[str, object]
    rows: list[tuple[float, float, str, float, float]] | None


_WORDS = {"s": ("s", "S", "TE", "senkrecht"), "p": ("p", "P", "TM", "parallel")}


def texts_of(numbers: np.ndarray, digits: int) -> list[str]:
    return [f"{number:.{digits}f}" for number in numbers]


def numbers_of_texts(texts: list[str]) -> list[float]:
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
            texts = texts_of(degrees, 2)
            name = self.unit(name, "deg|\u00b0|degree|degrees|Grad") if self.often(0.6) else name
            if self.often(0.1):
                self.say(self.one(["angles in degrees", "all angles are in deg"]))
            self.column(name, texts)
            return numbers_of_texts(texts)
        if meaning < 0.7:
            if self.often(0.2):
                degrees[-1] = 90.0
            texts = texts_of(np.radians(degrees), int(self.rng.integers(1, 6)))
            how = self.rng.random()
            if how < 0.4:
                name = self.unit(name, "rad|radian|radians")
            elif how < 0.8:
                self.say(self.one(["angles in radians", "angle in rad", "unit of angle: rad"]))
            self.column(name, texts)
            return [min(math.degrees(x), 90.0) for x in numbers_of_texts(texts)]
        if meaning < 0.9:
            texts = texts_of(90.0 - degrees, 2)
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
            return [90.0 - x for x in numbers_of_texts(texts)]
        texts = texts_of(180.0 - 2.0 * degrees, 2)
        self.column(
            self.one(["2theta", "2theta (deg)", "2\u03b8", "two theta [deg]", "tth"]), texts
        )
        return [90.0 - x / 2.0 for x in numbers_of_texts(texts)]

    def wavelengths(self) -> list[float]:
        """Draw the column of wavelengths; return micrometres."""
        um = np.linspace(self.rng.uniform(0.3, 0.5), self.rng.uniform(0.6, 1.5), 7)
        if self.often(0.3):
            name, _, rule = self.one(SPELLINGS["AXES"]).rpartition("=")
            factor, over = float(rule[:-1]), rule[-1] == "/"
            texts = [f"{factor / x if over else factor * x:.10g}" for x in um]
            self.column(name, texts)
            return [factor / x if over else x / factor for x in numbers_of_texts(texts)]
        kind = int(self.rng.integers(6))
        name = self.one(SPELLINGS["WAVE"])
        if kind <= 2:
            factor, digits, units = (
                (1e3, 1, "nm"),
                (1.0, 4, "um|\u00b5m|micron|\u03bcm"),
                (1e4, 0, "A|\u00c5|angstrom"),
            )[kind]
            texts = texts_of(um * factor, digits)
            where = self.rng.random()
            if where < 0.6:
                name = self.unit(name, units)
            elif where < 0.8:
                self.say(f"wavelength in {units.split('|')[0]}")
            elif where < 0.9:
                name = units.split("|")[0]
            self.column(name, texts)
            return [x / factor for x in numbers_of_texts(texts)]
        if kind == 3:
            texts = texts_of(1.2398419843320026 / um, 4)
            self.column(self.one(["E (eV)", "photon energy [eV]", "eV", "lambda (eV)"]), texts)
            return [1.2398419843320026 / x for x in numbers_of_texts(texts)]
        if kind == 4:
            texts = texts_of(1e4 / um, 1)
            self.column(self.one(["wavenumber (cm-1)", "cm-1", "Wellenzahl / cm^-1"]), texts)
            return [1e4 / x for x in numbers_of_texts(texts)]
        texts = texts_of(um * 1e3, 1)
        self.column(self.one(["nm", "lambda [nm]", "Wavelength, nm"]), texts)
        return [x / 1e3 for x in numbers_of_texts(texts)]

    def powers(self, names: list[str], count: int, percent: bool, said: bool) -> list[float]:
        """Draw one column of powers; return fractions, or nothing where it is none."""
        curve = 0.1 + 0.7 * np.abs(np.sin(self.rng.uniform(0.2, 1.3) + np.arange(count) / 9.0))
        texts = texts_of(curve * (100.0 if percent else 1.0), 3 if percent else 5)
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
        if unmeant:  # no datum, and none that may be left out
            self.meant = False
            return []
        return [x / 100.0 if percent else x for x in numbers_of_texts(texts)]

    def sigmas(self, values: list[float], percent: bool) -> list[float]:
        """Draw a column of standard errors, absolute or relative, or none; return absolute ones."""
        kind = self.rng.random()
        if kind < 0.6 or not values:
            return [math.nan] * len(values)
        if kind < 0.9:
            size = (100.0 if percent else 1.0) * self.rng.uniform(0.001, 0.01)
            texts = texts_of(size * self.rng.uniform(0.5, 1.5, len(values)), 5)
            self.column(
                self.one(SPELLINGS["SIGMAS"]) + (" (%)" if percent and self.often(0.7) else ""),
                texts,
            )
            return [x / 100.0 if percent else x for x in numbers_of_texts(texts)]
        texts = texts_of(self.rng.uniform(0.5, 3.0, len(values)), 3)
        name = self.one(SPELLINGS["RELATIVE"])
        if "%" not in name:
            texts = texts_of(np.array(numbers_of_texts(texts)) / 100.0, 5)
        self.column(name, texts)
        part = 0.01 if "%" in name else 1.0
        return [part * x * v for x, v in zip(numbers_of_texts(texts), values, strict=True)]

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
