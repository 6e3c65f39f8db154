"""What one header name says of its column: role, quantity and unit, or nothing understood.

First the words of measured files: every name of an angle, a polarization, a unit, a quantity, an
axis. One list, ``vocabulary.ini``, serves headers, comments, metadata and file names.
"""

from __future__ import annotations

import configparser
import re
import unicodedata
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

from fitting.data.quantities import POWER_LETTERS, POWERS, QUANTITIES, TABLE
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
_PHRASES = [(re.compile(f"(?i)(?<![^\\W_])(?:{p})"), word) for word, p in _FILE["phrase"].items()]
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
# R x100, R*1000; not the sides of a sample, 10 x 100 mm
_TIMES = re.compile(
    r"(?i)(?:(?<![\w.])(?<![0-9]\s)x\s?|(?<![0-9.])(?<![0-9]\s)\*\s?)(?=10+(?![\w.]))"
)


def spelled(text: str) -> str:
    """Return ``plain`` text with names of several parts as one word: 2 theta, wave length."""
    text = re.sub(r"(?i)\b[dl]'(?=\w)", "", plain(text))  # angle d'incidence
    text = re.sub(r"@\s*(?=[0-9])", " angle ", text)  # R@60
    text = _GEOMETRY.sub(r" geometry \1 \2 ", text.replace("+/-", " error "))
    text = _TIMES.sub(" times ", text)
    for pattern, word in _PHRASES:
        text = pattern.sub(word, text)
    return text


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


STRONG_UNITS = frozenset(_FILE["units"]["anywhere"].split())
UNITS_BEHIND_WORDS = STRONG_UNITS.union(FORM_OF)  # that are one behind a name


def cased(word: str) -> list[str]:
    """Return a word taken apart where small letters end and capitals begin: angleOfIncidence."""
    if word.isupper() or not (word.isascii() and word.isalpha()):
        return [word]
    return re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", word) or [word]


_INDEX = ("n", "k")
_ASIDE = {"raw", "setting"}  # concepts of columns that a fit has no use for
_MENTIONED = {*QUANTITIES, "error", "relative"}
_KELVIN = {"T", "k", "c", "celsius"}  # of T (K), a temperature
# What an axis may be: of each form one of the concepts, and beside it others; and the letters that
# are such a quantity beside its unit.
_AXES = [
    (form, *({word.strip() for word in words.split(",")} for words in said.split("|")))
    for form, said in _FILE["axis"].items()
]
_KINDS = {"polarization": "polarization", "polarizer": "polarizer"} | dict.fromkeys(
    ("q", "grazing", "incidence"), "angle"
)
_SYMBOLS = {form: {*letters.split()} for form, letters in _FILE["letters of an axis"].items()}
# units that name an axis alone; k (1/um) may be 1 / wavelength or 2 pi / wavelength
_AXIS_UNITS = tuple(unit for unit in FORM_OF if unit not in ("mm", "keV"))
# names glued of a quantity and its polarization; T in capitals only (tp, ts are times as well), and
# no plural (reflectances)
_ANY_LETTER = "|".join(POWER_LETTERS)
_POWER_WORD = "|".join(TABLE[q].axis + "|" + TABLE[q].axis.capitalize() for q in POWER_LETTERS)
_GLUED = re.compile(
    f"(?!(?:{_POWER_WORD})s$)(r|{_ANY_LETTER}|[Rr]efl|{_POWER_WORD})"
    "(s|p|S|P|te|tm|TE|TM|ss|pp|perp|par|spol|ppol|unpol|mean|avg|front|back)"
)
_SUFFIX = re.compile(r"(?<=[\w)\]])(?:[\s_.]+|\s*[/,]\s*|\s+in\s+)([^\s_]+)$")
_BRACKETS = re.compile(r"\(([^()]*(?:\([^()]*\))?[^()]*)\)|\[([^\[\]]*)\]")
# R(45 deg), Rs (AOI 45), Rs@60, "angle 60" once it is spelled out: the angle of a column in a wide
# table; without a unit not 1.05, which may be radians
_AT = re.compile(
    r"[(\[_\s]\s*(?:(?:at|aoi|theta)\s*=?\s*)?(?:([0-9]+(?:\.[0-9]+)?)\s*_?deg(?:rees?)?"
    r"|(?:angle|aoi\s*=?|theta\s*=) ?([0-9]{2}(?:\.[0-9]+)?|[02-9](?!\.)))"
    r"\s*[)\]]?(?=$|[\s_(\[])",
    re.IGNORECASE,
)
# R_45, Rs 60: an angle, or the number of a sample
_NUMBERED = re.compile(r"(?<=[A-Za-z\s_])[0-9]{1,2}(?:\.[0-9]+)?\s*$")
# what may stand between words and means nothing; a prime, a root, a ratio does mean something
_NO_SIGNS = re.compile(r"[\w\s.,:;()\[\]{}\-]*")


class Role(NamedTuple):
    """What a column is: angle, wavelength, polarization, polarizer, value, sigma, index (of a
    material: n, k), aside (of no use to a fit: raw signals, errors of an axis), unclear or "".

    quantity: a name of QUANTITIES, n or k; for sigma also "_s" and "_p", or "" where the name does
        not say of what; for kind "", one that the name mentions.
    form: of an angle incidence, grazing or q; of a wavelength that, energy, wavenumber, frequency.
    unit: a key of `UNITS`, "" where the name gives none.
    at: for value and sigma, the angle of incidence in degrees that the name gives, else None.
    why: why the column is not fitted, if known; for unclear, both readings.
    """

    kind: str
    quantity: str = ""
    form: str = ""
    unit: str = ""
    why: str = ""
    at: float | None = None


def _part_unit(name: str) -> tuple[str, str]:
    """Return the name without its unit, and the unit ("" where none is there)."""
    found = [unit_of(round_ or square) for round_, square in _BRACKETS.findall(name)]
    unit = next(filter(None, found), "")
    rest = _BRACKETS.sub(
        lambda match: " " if unit_of(match[0][1:-1]) else f" {match[0][1:-1]} ", name
    ).strip(" ,:;")
    if rest.startswith("%"):
        rest, unit = rest[1:].strip(), unit or "percent"
    if rest.endswith("%"):
        rest, unit = re.sub(r"(?:\s+in)?[/ _,]*$", "", rest[:-1]), unit or "percent"
    match = None if unit else _SUFFIX.search(rest)
    if match and unit_of(match[1]) in UNITS_BEHIND_WORDS:
        words = {CONCEPT.get(token) for token in _tokens(rest[: match.start()])}
        # one letter is a unit of length behind a wavelength alone
        if len(match[1]) > 1 or words <= {"wavelength", "article"}:
            rest, unit = rest[: match.start()], unit_of(match[1]) or ""
    return rest, unit


def _tokens(rest: str) -> list[str]:
    """Return the words of a name in small letters, but R and T; glued names taken apart."""
    tokens = []
    for word in re.findall(r"[^\W_]+", rest):
        for part in [word] if _GLUED.fullmatch(word) else cased(word):
            if glued := _GLUED.fullmatch(part):
                head, word = glued[1], glued[1].lower()
                tokens += [head if len(head) == 1 else CONCEPT.get(word, word), glued[2].lower()]
            else:
                tokens.append(part if part in POWER_LETTERS else part.lower())
    return tokens


def _optical(tokens: list[str], unit: str, error: bool) -> Role | None:
    """Return the role of a value or of its standard error, or None where a word is left over."""
    quantities, lights, side = set(), set(), ""
    for token in tokens:
        concept = token if token in POWER_LETTERS else CONCEPT.get(token, "")
        if concept in (*QUANTITIES, *_INDEX):
            quantities.add(concept)
        elif concept in LETTERS and token != "u":
            lights.add(concept)
        elif concept == "back":
            side = "_back"
        elif concept not in ("filler", "polarization"):
            return None
    quantity, light = "".join(quantities), "".join(lights)
    if len(quantities) > 1 or len(lights) > 1 or not (quantity or error):
        return None
    name = quantity + side + ("" if light in ("", "u") else "_" + light)
    known = (*QUANTITIES, *_INDEX) if quantity else ("", "_s", "_p")
    if name not in known or (light and quantity in (*ALONE, *_INDEX)):
        return None
    if error or name not in _INDEX:
        return Role("sigma" if error else "value", name, unit=unit)
    why = "it is an optical constant, not a measured power"
    return Role("index", name, unit=unit, why=why) if unit in ("", "1") else None


def _axis(tokens: list[str], unit: str) -> Role | None:
    """Return the role of an angle, wavelength or polarization column, or None."""
    said = {CONCEPT.get(token.lower(), token.lower()) for token in tokens}
    words = said - {"filler", "article", "some angle" if "incidence" in said else ""}
    for form, needed, others in _AXES:
        if words & needed and words <= needed | others:
            return Role(_KINDS.get(form, "wavelength"), form=form, unit=unit)
    form = FORM_OF.get(unit, "") if unit != "mm" else ""
    letters = {token.lower() for token in tokens} - {"the", "of"}
    if form and letters <= _SYMBOLS.get(form, set()) - ({"k"} if unit == "1/um" else set()):
        return Role(_KINDS.get(form, "wavelength"), form=form, unit=unit)
    return None


@lru_cache(maxsize=4096)
def role_of(name: str, unit: str = "") -> Role:
    """Return what the header ``name`` says, with ``unit`` from a row of units where it gives none.

    Every word and every sign must be known: neither "R of sample 2" nor "R'" is taken for a
    reflectance. kind "" means that the column is not understood.
    """
    if len(name) > LONGEST:
        return Role("", why="its name is too long")
    text = re.sub(r"\|\||(?<=[Rr_\s])//|//$", " par ", spelled(name).strip())
    rest, own = _part_unit(text)
    if not own and unit_of(rest) in _AXIS_UNITS and len(rest) > 1:
        rest, own = "", unit_of(rest) or ""  # the unit is all the name there is
    unit = own or unit
    name_of = rest.removeprefix("sigma_")
    if name_of in QUANTITIES:  # as this package writes it, of several words too
        return Role("value" if name_of == rest else "sigma", name_of, unit=unit)
    if re.fullmatch(rf"s(?:{_ANY_LETTER}|Qz?|psi|Psi)", rest):
        why = f"the standard error of {rest[1:]}, or {rest[1:]} of s-polarized light"
        return Role("unclear", "sigma_" + rest[1:], why=why)
    tokens = _tokens(rest)
    if tokens[:1] == ["r"] and len(tokens) == 2 and CONCEPT.get(tokens[1]) in ("s", "p"):
        if unit != "percent":  # by which the field's name of an amplitude is one of a power
            letter = CONCEPT[tokens[1]]
            why = f"the amplitude r_{letter} or the reflectance R_{letter} = |r_{letter}|^2"
            return Role("unclear", "R_" + letter, why=why)
        tokens[0] = "R"
    said = {CONCEPT.get(token.lower(), "") for token in tokens}
    of_error = "error" in said or tokens[:1] in (["d"], ["delta"])
    if (of_error and ("/" in rest or "relative" in said)) or said == {"relative"}:
        return Role("unclear", why="a relative error, where absolute ones are wanted")
    if match := _AT.search(text):
        bare = role_of(text[: match.start()] + " " + text[match.end() :], unit.replace("deg", ""))
        if bare.kind in ("value", "sigma") and bare.quantity and bare.at is None:
            return bare._replace(at=float(match[1] or match[2]))
    signs = not _NO_SIGNS.fullmatch(rest) or rest.startswith("-")
    mentioned = [t for t in tokens if t in POWER_LETTERS] + [c for c in said if c in _MENTIONED]
    unread = Role("", "" if {*tokens} <= _KELVIN else "".join(mentioned[:1]), unit=unit)
    if signs or not (tokens or unit in _AXIS_UNITS):
        return unread
    error, optical = "error" in said, tokens
    if error:
        optical = [t for t in tokens if CONCEPT.get(t.lower()) not in ("error", "of errors")]
    elif tokens[:1] in (["d"], ["delta"]) and (behind := tokens[1:]):  # dR, delta R
        of = _axis(behind, unit) or _optical(behind, unit, error=True)
        if of and (of.quantity or of.form) and of.quantity not in _INDEX:  # birefringence
            error, optical = True, behind
    axis = _axis(optical, unit) if optical or not error else None
    if axis and error:
        return Role("aside", why="it is the uncertainty or resolution of an axis")
    if axis:
        return axis
    if found := _optical(optical, unit, error):
        return found
    why = next((why for concept, why in _FILE["why"].items() if concept in said), "")
    words = {CONCEPT.get(token, UNITS.get(token, token)) for token in map(str.lower, tokens)}
    if words & _ASIDE and words <= _ASIDE | {"error", "of errors", "filler", "arb"}:
        return Role("aside", unit=unit, why=why)
    if (match := _NUMBERED.search(rest)) and role_of(rest[: match.start()].rstrip(" _")).quantity:
        why = "if its number is an angle, write R(45 deg)"
    return unread._replace(why=why)
