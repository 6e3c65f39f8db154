"""The words of measured files: every name of an angle, a polarization, a unit, a quantity, an axis.

One list, ``vocabulary.ini``, for headers, comments, metadata and file names. `words_of` brings text
to the form of its words.
"""

from __future__ import annotations

import configparser
import re
import unicodedata
from pathlib import Path
from typing import NamedTuple

from fitting.data.quantities import POWER_LETTERS, POWERS, QUANTITIES
from fitting.data.units import FORM_OF

LONGEST = 200  # letters of a column's name; what is longer is a text


def _lists() -> dict[str, dict[str, str]]:
    """Return for concept, unit and root what each word of the vocabulary is."""
    parser = configparser.ConfigParser(delimiters=("=",), interpolation=None)
    parser.optionxform = str  # type: ignore[assignment, method-assign]
    parser.read(Path(__file__).with_name("vocabulary.ini"), encoding="utf-8")
    return {
        kind: {word: name for name, words in parser[kind].items() for word in words.split()}
        for kind in parser.sections()
    }


_WORDS = _lists()
CONCEPT, UNITS = _WORDS["concept"], {unit.lower(): unit for unit in FORM_OF} | _WORDS["unit"]
# what an unknown word speaks of if it holds one of these: compounds, scripts that part no words
_ROOTS = {w: c for w, c in CONCEPT.items() if not w.isascii() and len(w) > 1} | _WORDS["root"]
LETTERS = frozenset("spu")
ALONE = tuple(name for name in QUANTITIES if name not in POWERS)  # have no s and p of their own
# absorbance, log10(1 / T), and absorption, which may mean it, can be no column of values
OTHER_POWER = "absorbance"
QUANTITY_CONCEPTS = (*POWER_LETTERS, OTHER_POWER, *ALONE)
# letters that mean their power in a sentence too: as a small letter they are no word
SPOKEN = tuple(letter for letter in POWER_LETTERS if letter.lower() not in CONCEPT)
AXIS_CONCEPTS = ("wavelength", "energy", "wavenumber", "frequency")

_TRANSLATION = str.maketrans(
    _WORDS["sign"] | {sign: f" {word} " for sign, word in _WORDS["sign for a word"].items()}
)


def _letter(sign: str) -> str:
    """Return a letter without its accent; any other sign as it is."""
    if sign.isascii() or not sign.isalpha():
        return sign
    bare = "".join(c for c in unicodedata.normalize("NFKD", sign) if not unicodedata.combining(c))
    return bare if bare.isascii() else sign


def plain(text: str) -> str:
    """Return ``text`` with Greek letters as words, typographic signs as ASCII ones, no accents.

    What stands for nothing here (other scripts, primes, roots) stays, so that it can be refused.
    """
    if text.isascii():
        return text
    text = unicodedata.normalize(
        "NFC", text.replace("\u00b0C", " celsius ").translate(_TRANSLATION)
    )
    return "".join(map(_letter, text))


# 0/45, d/8, 45:0: the angles of the light and of the detector
_GEOMETRY = re.compile(r"(?i)(?<![\w/.:-])(di?|0|8|45)\s?(?:deg)?[/:](di?|0|8|45)(?![\w/.:-])")
# R x100, R*1000, R in units of 0.01; not the sides of a sample, 10 x 100 mm
_TIMES = re.compile(
    r"(?i)(?:(?<![\w.])(?<![0-9]\s)x\s?|(?<![0-9.])(?<![0-9]\s)\*\s?)(?=10+(?![\w.]))"
    r"|(?<![^\W_])units?\s+of\s+(?=[0-9.])"
)


def spelled(text: str) -> str:
    """Return ``plain`` text with names of several parts as one word: 2 theta, wave length."""
    text = re.sub(r"(?i)\b[dl]'(?=\w)", "", plain(text))  # angle d'incidence
    text = re.sub(r"@\s*(?=[0-9])", " angle ", text)  # R@60
    text = text.replace("+/-", " error ")
    text = re.sub(r"(?i)(?<![^\W_])he-?ne(?![^\W_])", "laser", text)
    text = re.sub(r"(?i)(?<![^\W_])(?:2|two)[\s_-]*theta", "twotheta", text)
    text = re.sub(r"(?i)(?<![^\W_])relative\s+to(?![^\W_])", "normalized", text)
    text = _GEOMETRY.sub(r" geometry \1 \2 ", text)
    text = _TIMES.sub(" times ", text)
    return re.sub(r"(?i)(?<![^\W_])wave[\s_-]+(?=length|number)", "wave", text)


def light_of(word: str) -> str:
    """Return "s", "p" or "u" of a word for one polarization, "" of any other."""
    concept = CONCEPT.get(word, "")
    return concept if concept in LETTERS else ""


def unit_of(text: str) -> str | None:
    """Return the unit that ``text`` spells (a key such as nm, deg, percent), or None."""
    if len(text) > 40:
        return None
    word = re.sub(r"\s+", "_", plain(text).strip().strip("[](){}").strip().lower())
    return UNITS.get(word)


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


_WORD = re.compile(
    r"(?P<number>(?<![^\W_])(?<!\.)(?:(?<=[\s=:(])[-+])?(?:[0-9]+(?:[.,][0-9]+)?|[.,][0-9]+)(?:[eE][-+]?[0-9]+)?)"
    r"|(?P<word>[A-Za-z]+|[^\W_0-9A-Za-z]+)|(?P<sign>[%\u2030])|(?P<digits>[0-9]+)"
)
_UNIT_WORD = re.compile(
    r"(?i)(?:1/(?:nm|cm|angstroms?|a)\b|(?:nm|cm|angstrom|a)\^?-1\b|\ba\.u\.|\bdB\b)"
)
# words that are a unit wherever they stand, and those that are one behind a name
_STRONG_UNITS = frozenset(
    ["deg", "rad", "mrad", "nm", "um", "angstrom", "eV", "keV", "THz", "percent", "permille"]
)
UNITS_BEHIND_WORDS = _STRONG_UNITS.union(FORM_OF)
_NUMBERED = ("incidence", "angle", "grazing", "some angle", "wavelength", "laser")


def cased(word: str) -> list[str]:
    """Return a word taken apart where small letters end and capitals begin: angleOfIncidence."""
    if word.isupper() or not (word.isascii() and word.isalpha()):
        return [word]
    return re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", word) or [word]


def words_of(text: str) -> Words:
    """Return what a comment, a setting or a file name says, word by word."""
    text = spelled(text)
    said = Words(set(), [], {unit_of(match) or "" for match in _UNIT_WORD.findall(text)}, False, [])
    unknown, end, last = False, -9, ""
    text = _UNIT_WORD.sub(" ", text)
    for match in _WORD.finditer(text):
        whole, kind = match[0], match.lastgroup
        # AOI60, lambda532; but not "sample2"
        if kind == "number" or (kind == "digits" and last in _NUMBERED):
            said.numbers.append((float(whole.replace(",", ".")), ""))
            end = match.end()
            continue
        unit = UNITS.get(whole.lower(), "")
        behind = end > 0 and not text[end : match.start()].strip(" _\t:,;=([{")
        if unit in _STRONG_UNITS or (behind and unit == "angstrom"):
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
                said.concepts.update(c for root, c in _ROOTS.items() if root in word.lower())
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
