"""What comments, settings and the name of the file say about the whole measurement.

Each of them that names an angle, a polarization, a wavelength or a unit is heard: a line is used
where it says one thing and nothing else; it is overruled by the option for it; else the file is
refused and the option named. The name of the file is never used, only heard. What is not in the
vocabulary is not understood, and no reason to guess.
"""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np

from fitting.data.quantities import POWER_LETTERS
from fitting.data.units import WAVELENGTH_UNITS, incidence_deg, wavelength_um
from fitting.reader.options import Options
from fitting.reader.vocabulary import (
    AXIS_CONCEPTS,
    LETTERS,
    OTHER_POWER,
    QUANTITY_CONCEPTS,
    SPOKEN,
    Words,
    light_of,
    plain,
    spelled,
    words_of,
)

# kind of statement -> what it gives, the option that overrules it, and the fields of that option
OPTION = {
    "angle": ("the angle of incidence", "--angle-deg NUMBER", "angle_deg"),
    "angle unit": ("the unit of the angles", "--angle-unit deg, rad or grazing-deg", "angle_unit"),
    "light": ("the polarization", "--polarization s, p or unpolarized", "light codes polarizer"),
    "wavelength": ("the wavelength", "--wavelength-um NUMBER", "wavelength_um"),
    "wavelength unit": ("the unit of wavelengths", "--wavelength-unit nm, um, ...",
                        "wavelength_unit"),
    "power unit": ("the unit of the powers", "--scale 0.01 for percent, 1 for fractions", "scale"),
    "psi unit": ("the unit of psi and delta", "--psi-unit deg or rad", "psi_unit"),
    "errors": ("errors of another size than one standard deviation", "--columns "
               "angle=1,R=2,sigma_R=3 if they are one standard deviation; else divide them, or "
               "leave them out of --columns", "columns"),
    "quantity": ("the measured quantity", "--columns angle=1,R=2 or the like", "columns"),
}  # fmt: skip
FULL_NAME = "the file name"
_ANGULAR = {"deg", "rad", "mrad"}
_CLAUSE = re.compile(r"[,;|](?=\s|$)|(?<=[a-z])\.\s")  # "incidence;45" is one
# a polarization as a word of the name of a file, as it is written; not "sp", nor "P3HT"
_LETTER = re.compile(rf"(?<![^\W_])([sp]|[SP]|TE|TM|[{''.join(SPOKEN)}][sp])(?![^\W_])")
_EXPANDED = re.compile(
    r"(?i)(?<![\w.,])(?:1[.,]96|[2-9])\s*[-*x]?\s*(?:sigma|s\.?d\.?|std|stdev|standard)(?![^\W_])"
    r"|(?<![^\W_])(?:coverage|confidence|expanded|konfidenz|vertrauens|erweitert)"
)
_NUMBERED = re.compile(r"(?i)(?:angle|theta|winkel)[ _=]*[0-9]")


class Said(NamedTuple):
    """One thing that is said. value: a number (degrees, micrometres), a letter or a unit, or None
    where the words say more than that, or something else; numbers: those of such an angle."""

    kind: str
    value: float | str | None
    where: str
    text: str
    numbers: tuple[float, ...] = ()


Heard = list[tuple[str, float | str | None]]


def _only(words: Words, *concepts: str) -> bool:
    """Return whether a clause says nothing beyond these concepts, and one number at most."""
    known = {"filler", "article", "normal", *concepts}
    return not words.unknown and words.concepts <= known and len(words.numbers) <= 1


def _units_of(words: Words) -> set[str]:
    """Return all units of a clause, behind numbers or alone."""
    return words.units | {unit for _, unit in words.numbers} - {""}


def _angle(words: Words) -> Heard:
    """Return what a clause says of the angle of incidence, or of the unit of angles."""
    said, units = words.concepts, _units_of(words)
    about = said & {"incidence", "grazing", "oblique"} or (
        said & {"angle", "doubled"} and "no incidence" not in said
    )
    other = said & {"no incidence", "polarization", "polarizer", "psi", "delta", "s", "p"}
    perhaps = words.numbers and "some angle" in said
    if not (about or perhaps) and (other or not units & _ANGULAR):
        return []
    clear = about and units <= {"deg", "rad"} and _only(words, "incidence", "angle")
    unit = next(iter(units), "")
    if not words.numbers:
        if not clear:
            return [(kind, None) for kind in ("angle", "angle unit")[: 2 - ("oblique" in said)]]
        none = 0.0 if {"normal", "incidence"} <= said else None
        return [("angle unit", unit)] if unit else [("angle", none)]
    number = words.numbers[0][0]
    # 1.6 is the largest number that can be a right angle in radians
    if not clear or not (unit or number > 1.6 or number == 0.0):
        return [("angle", None)]
    degrees = float(incidence_deg(np.array(number), unit or "deg", np.array(np.nan)))
    return [("angle", degrees if 0.0 <= degrees <= 90.0 else None)]


def _wavelength(words: Words) -> Heard:
    """Return what a clause says of the wavelength of all rows, or of the unit of wavelengths."""
    said, sized = words.concepts, _units_of(words) & {*WAVELENGTH_UNITS}
    named = said & {"laser", *AXIS_CONCEPTS}
    only = named and _only(words, "laser", *AXIS_CONCEPTS)
    bare = not words.units and words.numbers and not words.numbers[0][1]
    photon = {unit for _, unit in words.numbers} & {"eV", "keV"}  # or the gap of the material
    if not ("wavelength" in said or photon or (named and sized) or (only and bare)):
        return []  # a laser's power, a pulse's energy, a chopper's frequency
    unit = next(iter(sized), "")
    if not words.numbers:
        if unit and not only:
            return [("wavelength", None), ("wavelength unit", None)]
        return [("wavelength unit", unit)] if unit else []
    number = words.numbers[0][0]
    clear = only and unit and number > 0.0
    return [("wavelength", float(wavelength_um(np.array(number), unit)) if clear else None)]


def _light(words: Words) -> Heard:
    said = words.concepts
    letters = said & LETTERS or ({"u"} if "none" in said else set())
    named = said & {"polarization", "polarizer"} or ("wave" in said and letters)
    named = named or any(
        word in ("TE", "TM") or word.lower().startswith(("unpol", "spol", "ppol"))
        for word in words.capitals
    )
    # "parallel" alone may be the light's direction or that of its field
    alone = any(len(w) > 2 and light_of(w.lower()) for w in words.capitals)
    if not (named or alone or "direction" in said):
        return []
    clear = named and not words.numbers and len(letters) == 1
    clear = clear and _only(words, "polarization", "wave", "none", *LETTERS)
    return [("light", next(iter(letters)) if clear else None)]


def _units(words: Words) -> Heard:
    """Return what a clause says of the unit of powers, or, without a number, of psi and Delta."""
    said = words.concepts
    if "scaled" in said and not words.unknown and any(not unit for _, unit in words.numbers):
        return [("power unit", None)]
    relative = "relative" in said and said & {*POWER_LETTERS, "raw"} and "error" not in said
    if relative or "normalized" in said:
        return [("power unit", None)]  # to a reference mirror, not to the direct beam
    if words.numbers or not words.units:
        return []
    unit = next(iter(words.units)) if len(words.units) == 1 else ""
    quantities = said & {*QUANTITY_CONCEPTS, "raw"}
    if quantities & {"psi", "delta"} and words.units & {"deg", "rad"}:
        return [("psi unit", unit if unit and _only(words, "psi", "delta", "angle") else None)]
    powers = {"percent", "permille"} | ({"1", "arb"} if quantities else set())
    if words.units & powers:
        clear = unit and unit != "permille" and _only(words, *POWER_LETTERS)
        return [("power unit", unit if clear else None)]
    return []


def _quantity(words: Words) -> Heard:
    """Return the quantities that are written out; as letters they are names of columns."""
    named = words.concepts & {*POWER_LETTERS, OTHER_POWER}
    return [("quantity", q) for q in named if len(q) > 1 or q not in words.capitals]


_HEARERS = (_angle, _wavelength, _light, _units, _quantity)


def statements(line: int, text: str) -> list[Said]:
    """Return what one comment, setting or remark says of the whole measurement."""
    place = f"line {line}", text.strip()[:80]
    said = [Said("errors", None, *place)] * bool(_EXPANDED.search(spelled(text)))
    for clause in [text] if "{" in text else _CLAUSE.split(text):
        words = words_of(clause)
        numbers = tuple(n for n, unit in words.numbers if unit in ("", "deg"))
        numbers = numbers if len(numbers) == 1 else ()  # two may be the range of a scan
        for kind, value in (pair for hear in _HEARERS for pair in hear(words)):
            open_angle = kind == "angle" and value is None
            said.append(Said(kind, value, *place, numbers if open_angle else ()))
    return said


def _statements_of_name(stem: str) -> list[Said]:
    """Return what the name of the file may say, for people to confirm; no option is taken from it.

    A word that is not known is the sample's, and no reason for doubt.
    """
    text = re.sub(r"(?<=[^\W_])-(?=[^\W_])", " ", plain(stem))
    words = words_of(text)._replace(unknown=False)
    said = words.concepts
    named = said & {"incidence", "grazing", "some angle"} or _NUMBERED.search(text)
    degrees = [n for n, unit in words.numbers if unit == "deg" or (named and not unit)]
    degrees += [0.0] * ({"normal", "incidence"} <= said)
    found = []
    if degrees and (named or "no incidence" not in said):
        found.append(Said("angle", None, FULL_NAME, stem[:80], (degrees[0],)))
    heard = {pair for hear in _HEARERS for pair in hear(words._replace(numbers=[]))}
    heard |= {("wavelength", None)} if "wavelength" in said and words.numbers else set()
    if len({letter.lower() for letter in _LETTER.findall(text)}) == 1:
        heard.add(("light", None))
    kinds = {(kind, value if kind == "quantity" else None) for kind, value in heard}
    return found + [Said(*pair, FULL_NAME, stem[:80]) for pair in kinds if pair[0] != "angle"]


def evidence(name: str, preamble: list[tuple[int, str]]) -> list[Said]:
    """Return what the lines beside the numbers and the name of the file, without its end, say."""
    said = [one for line, text in preamble for one in statements(line, text)]
    return said + _statements_of_name(name)


def without(said: list[Said], options: Options) -> list[Said]:
    """Return what is said and no option overrules."""
    given = {name for name, value in options._asdict().items() if value not in (None, "", {})}
    return [one for one in said if not given & set(OPTION[one.kind][2].split())]
