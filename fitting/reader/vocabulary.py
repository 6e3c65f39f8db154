"""The words of measured files: every name of an angle, a polarization, a unit, a quantity, an axis.

One list, ``vocabulary.ini``, for headers, comments, metadata and file names. `words_of` brings text
to the form of its words.
"""

from __future__ import annotations

import configparser
import re
import unicodedata
from pathlib import Path

from fitting.data.quantities import POWER_LETTERS, POWERS, QUANTITIES
from fitting.data.units import FORM_OF

LONGEST = 200  # letters of a column's name; what is longer is a text


_FILE = configparser.ConfigParser(delimiters=("=",), interpolation=None)
_FILE.optionxform = str  # type: ignore[assignment, method-assign]
_FILE.read(Path(__file__).with_name("vocabulary.ini"), encoding="utf-8")
# for concept, unit, root and signs what each word is
_WORDS = {
    kind: {word: name for name, words in _FILE[kind].items() for word in words.split()}
    for kind in _FILE.sections()
}
CONCEPT, UNITS = _WORDS["concept"], {unit.lower(): unit for unit in FORM_OF} | _WORDS["unit"]
# what an unknown word speaks of if it holds one of these: compounds, scripts that part no words
ROOTS = {w: c for w, c in CONCEPT.items() if not w.isascii() and len(w) > 1} | _WORDS["root"]
LETTERS = frozenset("spu")
ALONE = tuple(name for name in QUANTITIES if name not in POWERS)  # have no s and p of their own
# absorbance, log10(1 / T), and absorption, which may mean it, can be no column of values
OTHER_POWER = "absorbance"
# letters that mean their power in a sentence too: as a small letter they are no word
SPOKEN = tuple(letter for letter in POWER_LETTERS if letter.lower() not in CONCEPT)

_TRANSLATION = str.maketrans(
    _WORDS["sign"] | {sign: f" {word} " for sign, word in _WORDS["sign for a word"].items()}
)


def plain(text: str) -> str:
    """Return ``text`` with Greek letters as words, typographic signs as ASCII ones, no accents.

    What stands for nothing here (other scripts, primes, roots) stays, so that it can be refused.
    """
    if text.isascii():
        return text
    text = text.replace("\u00b0C", " celsius ").translate(_TRANSLATION)
    signs = []
    for sign in unicodedata.normalize("NFC", text):
        parts = unicodedata.normalize("NFKD", sign)
        bare = "".join(part for part in parts if not unicodedata.combining(part))
        signs.append(bare if sign.isalpha() and bare.isascii() else sign)
    return "".join(signs)


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


# words that are a unit wherever they stand, and those that are one behind a name
STRONG_UNITS = frozenset(
    ["deg", "rad", "mrad", "nm", "um", "angstrom", "eV", "keV", "THz", "percent", "permille"]
)
UNITS_BEHIND_WORDS = STRONG_UNITS.union(FORM_OF)


def cased(word: str) -> list[str]:
    """Return a word taken apart where small letters end and capitals begin: angleOfIncidence."""
    if word.isupper() or not (word.isascii() and word.isalpha()):
        return [word]
    return re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", word) or [word]
