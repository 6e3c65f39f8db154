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
from fitting.reader.names import (
    ALONE,
    CONCEPT,
    LETTERS,
    OTHER_POWER,
    ROOTS,
    SPOKEN,
    STRONG_UNITS,
    UNITS,
    cased,
    light_of,
    plain,
    spelled,
    unit_of,
)
from fitting.reader.options import Options

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
_AXES = {"laser", "wavelength", "energy", "wavenumber", "frequency"}
_CLAUSE = re.compile(r"[,;|](?=\s|$)|(?<=[a-z])\.\s")  # "incidence;45" is one
# a polarization as a word of the name of a file, as it is written; not "sp", nor "P3HT"
_LETTER = re.compile(rf"(?<![^\W_])([sp]|[SP]|TE|TM|[{''.join(SPOKEN)}][sp])(?![^\W_])")
_EXPANDED = re.compile(
    r"(?i)(?<![\w.,])(?:1[.,]96|[2-9])\s*[-*x]?\s*(?:sigma|s\.?d\.?|std|stdev|standard)(?![^\W_])"
    r"|(?<![^\W_])(?:coverage|confidence|expanded|konfidenz|vertrauens|erweitert)"
)
# By the decimal mark of a file, numbers that may have the other mark before thousands: 1,064 nm.
_THOUSANDS = {".": re.compile(r"\d,\d{3}(?!\d)"), ",": re.compile(r"\d\.\d{3}(?!\d)")}
_NUMBERED = re.compile(r"(?i)(?:angle|theta|winkel)[ _=]*[0-9]")
_WORD = re.compile(
    r"(?P<number>(?<![^\W_])(?<!\.)(?:(?<=[\s=:(])[-+])?(?:[0-9]+(?:[.,][0-9]+)?|[.,][0-9]+)(?:[eE][-+]?[0-9]+)?)"
    r"|(?P<word>[A-Za-z]+|[^\W_0-9A-Za-z]+)|(?P<sign>[%\u2030])|(?P<digits>[0-9]+)"
)
_UNIT_WORD = re.compile(
    r"(?i)(?:1/(?:nm|cm|angstroms?|a)\b|(?:nm|cm|angstrom|a)\^?-1\b|\ba\.u\.|\bdB\b)"
)
_NUMBERED_CONCEPTS = ("incidence", "angle", "grazing", "some angle", "wavelength", "laser")


class Words(NamedTuple):
    """What a piece of text says: words in small letters, numbers (as written), units of it.

    concepts: concept of each known word. numbers: (number, unit behind it or "").
    units: units that stand behind no number. unknown: whether any word is not in the vocabulary.
    capitals: words of the text as they are written.
    """

    concepts: set[str]
    numbers: list[tuple[float, str]]
    units: set[str]
    unknown: bool
    capitals: list[str]


def words_of(text: str) -> Words:
    """Return what a comment, a setting or a file name says, word by word."""
    text = spelled(text)
    said = Words(set(), [], {unit_of(match) or "" for match in _UNIT_WORD.findall(text)}, False, [])
    unknown, end, last = False, -9, ""
    text = _UNIT_WORD.sub(" ", text)
    for match in _WORD.finditer(text):
        whole, kind = match[0], match.lastgroup
        # AOI60, lambda532; but not "sample2"
        if kind == "number" or (kind == "digits" and last in _NUMBERED_CONCEPTS):
            said.numbers.append((float(whole.replace(",", ".")), ""))
            end = match.end()
            continue
        unit = UNITS.get(whole.lower(), "")
        behind = end > 0 and not text[end : match.start()].strip(" _\t:,;=([{")
        if unit in STRONG_UNITS or (behind and unit == "angstrom"):
            if behind and not said.numbers[-1][1]:
                said.numbers[-1] = (said.numbers[-1][0], unit)
                end = -9
            elif whole != "a":
                said.units.add(unit)
            said.capitals.append(whole)
            continue
        for word in cased(whole) if kind == "word" else []:
            said.capitals.append(word)
            last = word if word in SPOKEN else CONCEPT.get(word.lower(), "")
            if not last and unit in ("permille", "1", "arb"):
                said.units.add(unit)
            elif not last:
                unknown = True
                said.concepts.update(c for root, c in ROOTS.items() if root in word.lower())
            else:
                said.concepts.add(last)
        unknown = unknown or kind == "digits"
    return said._replace(units=said.units - {""}, unknown=unknown)


def light_of_cell(cell: str) -> str:
    """Return the polarization that a cell says and nothing else: s, TM, p-polarized, senkrecht."""
    words = words_of(cell)
    letters = words.concepts & LETTERS
    known = not words.unknown and words.concepts <= {*letters, "polarization", "wave"}
    return next(iter(letters)) if known and len(letters) == 1 and not words.numbers else ""


class Said(NamedTuple):
    """One thing that is said. value: a number (degrees, micrometres), a letter or a unit, or None
    where the words say more than that, or something else; numbers: those of such an angle."""

    kind: str
    value: float | str | None
    where: str
    text: str
    numbers: tuple[float, ...] = ()


def _heard(words: Words) -> list[tuple[str, float | str | None]]:
    """Return what a clause says of the whole measurement: kinds, each with a value or None."""
    said, numbers = words.concepts, words.numbers
    units = words.units | {unit for _, unit in numbers} - {""}
    unit = next(iter(units), "")
    heard: list[tuple[str, float | str | None]] = []

    def only(*concepts: str) -> bool:
        """Return whether the clause says nothing beyond these concepts, and one number at most."""
        known = {"filler", "article", "normal", *concepts}
        return not words.unknown and said <= known and len(numbers) <= 1

    # the angle of incidence, or the unit of angles
    about = said & {"incidence", "grazing", "oblique"} or (
        said & {"angle", "doubled"} and "no incidence" not in said
    )
    other = said & {"no incidence", "polarization", "polarizer", "psi", "delta", "s", "p"}
    clear = about and units <= {"deg", "rad"} and only("incidence", "angle")
    if about or (numbers and "some angle" in said) or (units & _ANGULAR and not other):
        if numbers:
            number, degrees = numbers[0][0], -1.0
            # 1.6 is the largest number that can be a right angle in radians
            if clear and (unit or number > 1.6 or number == 0.0):
                degrees = float(incidence_deg(np.array(number), unit or "deg", np.array(np.nan)))
            heard.append(("angle", degrees if 0.0 <= degrees <= 90.0 else None))
        elif clear and unit:
            heard.append(("angle unit", unit))
        elif clear:
            heard.append(("angle", 0.0 if {"normal", "incidence"} <= said else None))
        else:
            heard += [(kind, None) for kind in ("angle", "angle unit")[: 2 - ("oblique" in said)]]

    # the wavelength of all rows, or the unit of wavelengths; not a laser's power
    sized, named = units & {*WAVELENGTH_UNITS}, said & _AXES
    clear = named and only(*_AXES)
    photon = {unit for _, unit in numbers} & {"eV", "keV"}  # or the gap of the material
    bare = clear and not words.units and numbers and not numbers[0][1]
    if "wavelength" in said or photon or (named and sized) or bare:
        of = next(iter(sized), "")
        if numbers:
            clear = clear and of and numbers[0][0] > 0.0
            um = float(wavelength_um(np.array(numbers[0][0]), of)) if clear else None
            heard.append(("wavelength", um))
        elif of:
            heard += [("wavelength unit", of)] if clear else [
                ("wavelength", None), ("wavelength unit", None)]  # fmt: skip

    # the polarization; "parallel" alone may be the light's direction or that of its field
    letters = said & LETTERS or ({"u"} if "none" in said else set())
    named = said & {"polarization", "polarizer"} or ("wave" in said and letters)
    named = named or any(
        word in ("TE", "TM") or word.lower().startswith(("unpol", "spol", "ppol"))
        for word in words.capitals
    )
    alone = any(len(w) > 2 and light_of(w.lower()) for w in words.capitals)
    if named or alone or "direction" in said:
        clear = named and not numbers and len(letters) == 1
        clear = clear and only("polarization", "wave", "none", *LETTERS)
        heard.append(("light", next(iter(letters)) if clear else None))

    # the unit of powers, or, without a number, of psi and Delta
    scaled = "scaled" in said and not words.unknown and any(not unit for _, unit in numbers)
    relative = "relative" in said and said & {*POWER_LETTERS, "raw"} and "error" not in said
    quantities = said & {*POWER_LETTERS, OTHER_POWER, *ALONE, "raw"}
    powers = {"percent", "permille"} | ({"1", "arb"} if quantities else set())
    if scaled or relative or "normalized" in said:  # to a reference mirror, not to the direct beam
        heard.append(("power unit", None))
    elif not numbers and quantities & {"psi", "delta"} and units & {"deg", "rad"}:
        clear = len(units) == 1 and only("psi", "delta", "angle")
        heard.append(("psi unit", unit if clear else None))
    elif not numbers and units & powers:
        clear = len(units) == 1 and unit != "permille" and only(*POWER_LETTERS)
        heard.append(("power unit", unit if clear else None))

    # quantities that are written out; as letters they are names of columns
    named = said & {*POWER_LETTERS, OTHER_POWER}
    return heard + [("quantity", q) for q in named if len(q) > 1 or q not in words.capitals]


def statements(line: int, text: str, decimal: str = ".") -> list[Said]:
    """Return what one comment, setting or remark of a file with this decimal mark says of it."""
    place = f"line {line}", text.strip()[:80]
    said = [Said("errors", None, *place)] * bool(_EXPANDED.search(spelled(text)))
    for clause in [text] if "{" in text else _CLAUSE.split(text):
        words = words_of(clause)
        numbers = tuple(n for n, unit in words.numbers if unit in ("", "deg"))
        numbers = numbers if len(numbers) == 1 else ()  # two may be the range of a scan
        for kind, value in _heard(words):
            # above 0.1 um it is none: 632,800 nm would be 632.8 um
            short = kind == "wavelength" and float(value or 1.0) < 0.1
            value = None if short and _THOUSANDS[decimal].search(clause) else value
            open_angle = kind == "angle" and value is None
            said.append(Said(kind, value, *place, numbers if open_angle else ()))
    return said


def evidence(name: str, preamble: list[tuple[int, str]], decimal: str = ".") -> list[Said]:
    """Return what the lines beside the numbers and the name of the file, without its end, say.

    What the name may say is for people to confirm; no option is taken from it. A word in it that is
    not known is the sample's, and no reason for doubt.
    """
    found = [one for line, text in preamble for one in statements(line, text, decimal)]
    text = re.sub(r"(?<=[^\W_])-(?=[^\W_])", " ", plain(name))
    words = words_of(text)._replace(unknown=False)
    said = words.concepts
    named = said & {"incidence", "grazing", "some angle"} or _NUMBERED.search(text)
    degrees = [n for n, unit in words.numbers if unit == "deg" or (named and not unit)]
    degrees += [0.0] * ({"normal", "incidence"} <= said)
    if degrees and (named or "no incidence" not in said):
        found.append(Said("angle", None, FULL_NAME, name[:80], (degrees[0],)))
    heard = {*_heard(words._replace(numbers=[]))}
    heard |= {("wavelength", None)} if "wavelength" in said and words.numbers else set()
    if len({letter.lower() for letter in _LETTER.findall(text)}) == 1:
        heard.add(("light", None))
    kinds = {(kind, value if kind == "quantity" else None) for kind, value in heard}
    return found + [Said(*pair, FULL_NAME, name[:80]) for pair in kinds if pair[0] != "angle"]


def without(said: list[Said], options: Options) -> list[Said]:
    """Return what is said and no option overrules."""
    given = {name for name, value in options._asdict().items() if value not in (None, "", {})}
    return [one for one in said if not given & set(OPTION[one.kind][2].split())]
