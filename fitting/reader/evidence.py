"""What comments, settings and the name of the file say about the whole measurement.

Each of them that names an angle, a polarization, a wavelength or a unit is heard: it is used where
it says one thing and nothing else; it is overruled by the option for it; else the file is refused
and the option named. What is not in the vocabulary is not understood, and no reason to guess.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from fitting.errors import MeasurementError
from fitting.reader.options import Options
from fitting.reader.units import WAVELENGTH_UNITS, incidence_deg, wavelength_um
from fitting.reader.vocabulary import (
    AXIS_CONCEPTS,
    LETTERS,
    QUANTITY_CONCEPTS,
    Words,
    light_of,
    plain,
    words_of,
)

# kind of statement -> what it gives, and the option that overrules it
OPTION = {
    "angle": ("the angle of incidence", "--angle-deg NUMBER"),
    "angle unit": ("how the angles count", "--angle-unit UNIT (deg, rad, grazing-deg, ...)"),
    "light": ("the polarisation", "--polarization s, p or unpolarized"),
    "wavelength": ("the wavelength", "--wavelength-um NUMBER"),
    "wavelength unit": ("the unit of the wavelength", "--wavelength-unit UNIT (nm, um, ...)"),
    "power unit": ("the unit of R or T", "--scale FACTOR (0.01 for percent, 1 for fractions)"),
    "psi unit": ("the unit of psi and delta", "--psi-unit deg or rad"),
}
FULL_NAME = "the file name"
_LENGTHS = ("nm", "um", "angstrom")
_ANGULAR = {"deg", "rad", "mrad"}
_CLAUSE = re.compile(r"[,;|](?=\s|$)|(?<=[a-z])\.\s")  # "incidence;45" is one


class Said(NamedTuple):
    """One thing that is said. value: a number (degrees, micrometres), a letter or a unit, or None
    where the words say more than that, or something else."""

    kind: str
    value: float | str | None
    where: str
    text: str


_KNOWN = {"filler", "article", "normal"}
Heard = list[tuple[str, float | str | None]]


def _angle(words: Words) -> Heard:
    """Return what a clause says of the angle of incidence, or of how angles count."""
    said = words.concepts
    units = words.units | {unit for _, unit in words.numbers} - {""}
    about = said & {"incidence", "grazing"} or (
        said & {"angle", "doubled"} and "no incidence" not in said
    )
    other = said & {"no incidence", "polarization", "polarizer", "psi", "delta", "s", "p"}
    if not about and (other or not units & _ANGULAR):
        return []
    clear = about and not words.unknown and units <= _ANGULAR
    clear = clear and said <= _KNOWN | {"incidence", "angle", "grazing", "doubled", "surface"}
    unit = next(iter(units & _ANGULAR), "")
    if not words.numbers:
        if not clear:
            return [("angle", None), ("angle unit", None)]
        if said & {"grazing", "doubled"} or ("surface" in said and "normal" not in said):
            known = "grazing" in said and unit in ("deg", "rad")
            return [("angle", None), ("angle unit", "grazing-" + unit if known else None)]
        if unit:
            return [("angle unit", unit)]
        return [("angle", 0.0 if {"normal", "incidence"} <= said else None)]
    number = words.numbers[0][0]
    # 1.6 is the largest number that can be a right angle in radians
    clear = clear and len(words.numbers) == 1 and (unit or number > 1.6 or number == 0.0)
    clear = clear and not said & {"doubled", "surface"}
    unit = unit or "deg"
    if "grazing" in said:
        clear, unit = clear and unit in ("deg", "rad"), "grazing-" + unit
    value = float(incidence_deg(np.array(number), unit, np.array(np.nan))) if clear else np.nan
    return [("angle", value if 0.0 <= value <= 90.0 else None)]


def _wavelength(words: Words) -> Heard:
    said = words.concepts
    sized = ({unit for _, unit in words.numbers} | words.units) & set(WAVELENGTH_UNITS)
    alone = said <= _KNOWN | {"laser"} and not (words.unknown or words.units)  # "laser,532"
    if not (
        "wavelength" in said
        or (said & set(AXIS_CONCEPTS) and sized)
        or ("laser" in said and (sized & set(_LENGTHS) or alone))
    ):
        return []  # a laser's power, a pulse's energy, a chopper's frequency
    clear = not words.unknown and said <= _KNOWN | {"wavelength", "laser", *AXIS_CONCEPTS}
    unit = next(iter(sized), "")
    if not words.numbers:
        if not clear and unit:
            return [("wavelength", None), ("wavelength unit", None)]
        return [("wavelength unit", unit)] if unit else []
    number = words.numbers[0][0]
    if not unit and 190.0 <= number <= 3300.0:
        unit = "nm"  # as in a column
    if not clear or len(words.numbers) != 1 or not unit or number <= 0.0:
        return [("wavelength", None)]
    return [("wavelength", float(wavelength_um(np.array(number), unit)))]


def _light(words: Words) -> Heard:
    said = words.concepts
    letters = said & LETTERS or ({"u"} if "none" in said else set())
    named = said & {"polarization", "polarizer"} or ("wave" in said and letters)
    named = named or any(
        word in ("TE", "TM") or word.lower().startswith(("unpol", "spol", "ppol"))
        for word in words.capitals
    )
    # "parallel" alone may be the light's direction or that of its field
    if not named and not any(len(w) > 2 and light_of(w.lower()) for w in words.capitals):
        return []
    clear = named and not words.unknown and not words.numbers and len(letters) == 1
    clear = clear and said <= _KNOWN | LETTERS | {"polarization", "wave", "none"}
    return [("light", next(iter(letters)) if clear else None)]


def _units(words: Words) -> Heard:
    """Return what a clause without a number says of the unit of powers, or of psi and Delta."""
    if words.numbers or not words.units:
        return []
    clear = not words.unknown and len(words.units) == 1
    unit = next(iter(words.units))
    quantities = words.concepts & {*QUANTITY_CONCEPTS, "raw"}
    if quantities & {"psi", "delta"} and unit in ("deg", "rad"):
        clear = clear and words.concepts <= _KNOWN | {"psi", "delta", "angle"}
        return [("psi unit", unit if clear else None)]
    if unit in ("percent", "permille") or (quantities and unit in ("1", "arb")):
        clear = clear and unit != "permille" and words.concepts <= _KNOWN | {"R", "T"}
        return [("power unit", unit if clear else None)]
    return []


def statements(line: int, text: str) -> list[Said]:
    """Return what one comment, setting or remark says of the whole measurement."""
    found = []
    for clause in [text] if "{" in text else _CLAUSE.split(text):
        words = words_of(clause)
        for hear in (_angle, _wavelength, _light, _units):
            found += [Said(*heard, f"line {line}", text.strip()[:80]) for heard in hear(words)]
    return found


def statements_of_name(stem: str) -> list[Said]:
    """Return what the name of the file says; of an angle, that it does, for people to confirm."""
    text = re.sub(r"(?<=[^\W_])-(?=[^\W_])", " ", plain(stem))
    words = words_of(text)
    found = []
    said = words.concepts
    angles = [number for number, unit in words.numbers if unit == "deg"]
    numbers = [number for number, unit in words.numbers if not unit]
    if (angles and "no incidence" not in said) or (numbers and said & {"incidence", "grazing"}):
        found.append(Said("angle", None, FULL_NAME, str((angles or numbers)[0])))
    modes = {"TE": "s", "Rs": "s", "Ts": "s", "TM": "p", "Rp": "p", "Tp": "p"}
    # written as a word of its own, or before "pol": p-pol, s_polarized; not "sp", nor "P3HT"
    parts = re.findall(r"[^\W_]+", text)
    letters = {modes[part] for part in parts if part in modes}
    letters |= {part[0].lower() for part in parts if part.lower() in ("spol", "ppol")}
    pairs = re.findall(r"(?i)(?<![^\W_])([sp])[ _]?pol(?:ari[sz]ed)?(?![^\W_\d])", text)
    letters |= {letter.lower() for letter in pairs}
    letters |= {"u" for part in parts if part.lower().startswith("unpol")}
    alone = {part.lower() for part in parts if part in ("s", "p", "S", "P")}
    coded = re.search(r"(?i)pol(?:ari[sz]ation)?[ ._-]?[0-9]", text)
    if letters:
        value = next(iter(letters)) if len(letters) == 1 else None
        found.append(Said("light", value, FULL_NAME, stem[:80]))
    elif coded or len(alone) == 1:
        found.append(Said("light", None, FULL_NAME, stem[:80]))
    wave = words.numbers and "wavelength" in said and [n for n in words.numbers if n[1] in _LENGTHS]
    if wave and len(wave) == 1:
        value = float(wavelength_um(np.array(wave[0][0]), wave[0][1]))
        found.append(Said("wavelength", value, FULL_NAME, stem[:80]))
    return found


class Evidence(NamedTuple):
    """All that is said beside the table."""

    source: str
    said: list[Said]
    quantities: set[str]

    def refuse(self, said: Said) -> None:
        """Raise because ``said`` is not understood, or not here."""
        what, option = OPTION[said.kind]
        if said.where == FULL_NAME and said.kind == "angle":
            raise MeasurementError(
                f"{self.source}: The file name says {float(said.text):g}deg: if that is it, say "
                f"--angle-deg {float(said.text):g}."
            )
        raise MeasurementError(
            f"{self.source}: {said.where} ({said.text!r}) may give {what}, and is not understood. "
            f"Say {option}."
        )

    def without(self, options: Options) -> Evidence:
        """Return the evidence that no option overrules."""
        overruled = {
            "angle": options.angle_deg is not None,
            "angle unit": options.angle_unit,
            "light": options.light or options.codes or options.polarizer,
            "wavelength": options.wavelength_um is not None,
            "wavelength unit": options.wavelength_unit,
            "power unit": options.scale is not None,
            "psi unit": options.psi_unit,
        }
        return self._replace(said=[said for said in self.said if not overruled[said.kind]])

    def one(self, kind: str) -> Said | None:
        """Return the one thing that is said of ``kind``, None where nothing is.

        Raises MeasurementError where it is not understood, or two places contradict one another.
        """
        chosen = [said for said in self.said if said.kind == kind]
        clear = [said for said in chosen if said.value is not None]
        for said in chosen:
            if said.value is None:
                if said.where == FULL_NAME and clear and said.text == str(clear[0].value):
                    continue  # gold_60deg.csv, and a line that gives 60 degrees
                self.refuse(said)
            if said.value != clear[0].value:
                what, option = OPTION[kind]
                raise MeasurementError(
                    f"{self.source}: {clear[0].where} ({clear[0].text!r}) and {said.where} "
                    f"({said.text!r}) give {what} differently. Say {option}."
                )
        return clear[0] if clear else None

    def clear(self, kind: str) -> list[Said]:
        """Return the statements of ``kind`` that are understood, to be compared with a column."""
        return [said for said in self.said if said.kind == kind and said.value is not None]

    def refuse_other(self, kind: str, is_other: Callable[[Any], bool], at: str, came: str) -> None:
        """Raise where a statement of ``kind`` says other than the column at ``at`` does."""
        for said in self.clear(kind):
            if is_other(said.value):
                what, option = OPTION[kind]
                raise MeasurementError(
                    f"{at}: {came}, and {said.where} ({said.text!r}) gives {what} differently. Say "
                    f"{option}, or name all columns to be read with --columns."
                )


def evidence(source: str, stem: str, preamble: list[tuple[int, str]]) -> Evidence:
    """Return what the lines beside the numbers and the name of the file say."""
    said = [one for line, text in preamble for one in statements(line, text)]
    texts = [stem.replace("_", " "), *(text for _, text in preamble)]
    concepts = [words_of(text).concepts for text in texts]
    letters = [words_of(text).capitals for text in texts]
    quantities = {
        concept
        for found, capitals in zip(concepts, letters, strict=True)
        for concept in found & {"R", "T", "A"}
        if concept not in capitals  # written out, not as a letter
    }
    return Evidence(source, said + statements_of_name(stem), quantities)
