"""What one header name says of its column: role, quantity and unit, or nothing understood."""

from __future__ import annotations

import re
from functools import lru_cache
from typing import NamedTuple

from fitting.reader.units import FORM_OF, Q_UNITS
from fitting.reader.vocabulary import CONCEPT, LONGEST, light_of, plain, unit_of


def _of(*concepts: str) -> frozenset[str]:
    return frozenset(word for word, concept in CONCEPT.items() if concept in concepts)


def _set(words: str) -> frozenset[str]:
    return frozenset(words.split())


_ANGLE = _of("incidence", "angle")
_ANGLE_REST = _set("inc i in out reflection deg external d di de of")
_REFLECTANCE, _TRANSMITTANCE = _of("R"), _of("T")
_BACK, _ERROR, _RAW, _CONSTANT = _of("back"), _of("error"), _of("raw"), _of("constant")
_RELATIVE, _POLARIZER = _of("relative"), _of("polarizer")
_ERROR_REST = _set("standard deviation dev bar bars of 1 abs absolute ecart type")
_POLARIZATION = _of("polarization")
_FILL = _of("filler") | _POLARIZATION
_AXES = {
    "wavelength": _of("wavelength") | _set("wave length d di de"),
    "energy": _of("energy"),
    "wavenumber": _of("wavenumber") | _set("wave number"),
    "frequency": _of("frequency"),
}
_SYMBOLS = {"wavelength": "", "energy": "e", "wavenumber": "k nu", "frequency": "f nu"}
_NOT_INCIDENCE = _of("no incidence") - _set("phase temperature celsius")
# names glued of a quantity and its polarisation; T in capitals only (tp, ts are times as well)
_GLUED = re.compile(
    "(?:([Rr])(?:efl)?|(T)|([Rr]eflectance|[Tt]ransmittance))"
    "(s|p|S|P|te|tm|TE|TM|ss|pp|perp|par|spol|ppol|unpol|mean|avg|front|back)"
)
_SUFFIX = re.compile(
    r"(?<=[\w)\]])(?:[\s_.]+|(?:\s*[/,]\s*)|\s+in\s+)"
    r"(deg|degrees?|rad|radians?|mrad|nm|um|microns?|angstroms?|ev|kev|cm-1|cm\^-1|1/cm|thz|mm"
    r"|percent|pct|%|grad|a)$",
    re.IGNORECASE,
)
# the field's names of amplitudes; as a power, percent or capitals say so
_AMPLITUDE = re.compile(
    r"r[\s_.-]?(?:(s|te|perp|spol|ss)|(p|tm|par|parallel|ppol|pp))", re.IGNORECASE
)
_AXIS_UNITS = ("nm", "um", "angstrom", "eV", "cm-1", "THz", *Q_UNITS)
# R(45 deg), R_45, Rs@60: the angle of a column in a wide table, sure if a sign says so
_AT = re.compile(
    r"\s*[(\[_@\s]\s*(?:at|aoi|theta|angle)?\s*=?\s*([0-9]{1,2}(?:\.[0-9]+)?)\s*_?"
    r"(deg(?:rees?)?)?\s*[)\]]?(?=$|[\s_(\[])",
    re.IGNORECASE,
)
# what may stand between words and means nothing; a prime, a root, a ratio does mean something
_NO_SIGNS = re.compile(r"[\w\s.,:;()\[\]{}\-]*")


class Role(NamedTuple):
    """What a column is: angle, wavelength, polarization, polarizer, value, sigma, unclear or "".

    quantity: for value and sigma, a name of QUANTITIES; for sigma also "_s" and "_p", or "" where
        the name does not say of what.
    form: of an angle incidence, grazing, 2theta or q; of a wavelength the word that names it
        (wavelength, energy, wavenumber, frequency).
    unit: a key of :mod:`fitting.reader.vocabulary`, "" where the name gives none.
    why: for kind "", why the column cannot be used, if known; for unclear, both readings.
    at: for value and sigma, the angle of incidence in degrees that the name gives, else None; for
        kind "" a number that may be one, and form is what the column would be then.
    """

    kind: str
    quantity: str = ""
    form: str = ""
    unit: str = ""
    why: str = ""
    at: float | None = None


def _part_unit(name: str) -> tuple[str, str]:
    """Return the name without its unit, and the unit ("" where none is there)."""
    unit = ""

    def bracket(match: re.Match[str]) -> str:
        nonlocal unit
        inner = match[1] if match[1] is not None else match[2]
        found = unit_of(inner)
        if found or not inner.strip():
            unit = unit or found or ""
            return " "
        return f" {inner} "

    rest = re.sub(r"\(([^()]*(?:\([^()]*\))?[^()]*)\)|\[([^\[\]]*)\]", bracket, name).strip(" ,:;")
    if rest.startswith("%"):
        rest, unit = rest[1:].strip(), unit or "percent"
    if rest.endswith("%"):
        rest, unit = re.sub(r"(?:\s+in)?[/ _,]*$", "", rest[:-1]), unit or "percent"
    match = None if unit else _SUFFIX.search(rest)
    # one letter is a unit of length behind a wavelength alone
    if match and (
        len(match[1]) > 1
        or match[1] == "%"
        or set(_tokens(rest[: match.start()])) <= _AXES["wavelength"]
    ):
        rest, unit = rest[: match.start()], unit_of(match[1]) or ""
    return rest, unit


def _tokens(rest: str) -> list[str]:
    """Return the words of a name, with R and T kept as capitals and glued names taken apart."""
    words = []
    for word in re.findall(r"[^\W_]+", rest):
        match = _GLUED.fullmatch(word)
        if match:
            head = "R" if (match[1] or (match[3] or "")[:1].lower() == "r") else "T"
            tail = match[4].lower()
            words += [head, tail[0] if tail in ("ss", "pp") else tail]
        elif word.isupper() or not (word.isascii() and word.isalpha()):
            words += [word]
        else:
            words += re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+", word) or [word]
    out = []
    for word in words:
        match = _GLUED.fullmatch(word)
        if match and len(words) > 1:
            out += _tokens(word) if word not in ("R", "T") else [word]
        else:
            out.append(word if word in ("R", "T") else word.lower())
    return out


def _optical(tokens: list[str], unit: str, error: bool) -> Role | None:
    """Return the role of a value or of its standard error, or None where a word is left over."""
    quantity, side, light = "", "", ""
    for token in tokens:
        if token == "R" or (token in _REFLECTANCE and token != "r"):
            new = "R"
        elif token == "T" or (token in _TRANSMITTANCE and token != "t"):
            new = "T"
        elif token in ("psi", "delta"):
            new = token
        elif token != "u" and light_of(token):
            if light not in ("", light_of(token)):
                return None
            light = light_of(token)
            continue
        elif token in _BACK:
            side = "_back"
            continue
        elif token in _FILL:
            continue
        else:
            return None
        if quantity not in ("", new):
            return None
        quantity = new
    if quantity in ("R", "T"):
        if side and (light or quantity == "T"):
            return None
        quantity += side or {"s": "_s", "p": "_p"}.get(light, "")
    elif side or (light and (quantity or not error)):
        return None
    elif light:
        quantity = "_" + light  # err_s beside R_s
    if not quantity and not error:
        return None
    return Role("sigma" if error else "value", quantity, unit=unit)


def _axis(tokens: list[str], unit: str) -> Role | None:
    """Return the role of an angle, wavelength or polarisation column, or None."""
    words = {token.lower() for token in tokens} - _FILL
    if words & _POLARIZER:
        return Role("polarizer", unit=unit) if words - _ANGLE <= _POLARIZER else None
    if (not words and set(tokens) & _POLARIZATION) or (
        words and words <= _set("state mode") | _POLARIZATION
    ):
        return Role("polarization")
    if (unit in ("1/angstrom", "1/nm") and words <= _set("q qz z momentum transfer")) or (
        words and words <= _set("q qz z momentum transfer") and words != {"z"}
    ):
        return Role("angle", form="q", unit=unit)
    double = words & _of("doubled") or ("theta" in words and words & {"2", "two"})
    if double and words <= _set("2 two") | _of("doubled") | _ANGLE:
        return Role("angle", form="2theta", unit=unit)
    if words & _of("grazing") and words <= _ANGLE | _of("grazing"):
        return Role("angle", form="grazing", unit=unit)
    if words & _ANGLE and words <= _ANGLE | _ANGLE_REST:
        return Role("angle", form="incidence", unit=unit)
    form = FORM_OF.get(unit, "") if unit != "mm" else ""
    if form and words <= _set(_SYMBOLS[form]):
        return Role("wavelength", form=form, unit=unit)
    for form, names in _AXES.items():
        if words <= names and words & (_of(form) | {"wave"}):
            return Role("wavelength", form=form, unit=unit)
    return None


def _angled(name: str, unit: str) -> Role | None:
    """Return the role of a value at one angle, R(45 deg), or None where the name holds no angle."""
    match = _AT.search(name)
    if match is None:
        return None
    unit = "" if unit == "deg" else unit  # that of the angle
    role = role_of(name[: match.start()] + " " + name[match.end() :], unit)
    if role.kind not in ("value", "sigma") or not role.quantity or role.at is not None:
        return None
    at = float(match[1])
    if match[2] or "@" in match[0]:
        return role._replace(at=at)
    why = f"{match[1]} may be its angle of incidence: say --angle-unit deg"
    return role._replace(kind="", form=role.kind, why=why, at=at)


@lru_cache(maxsize=4096)
def role_of(name: str, unit: str = "") -> Role:
    """Return what the header ``name`` says, with ``unit`` from a row of units where it gives none.

    Every word and every sign must be known: neither "R of sample 2" nor "R'" is taken for a
    reflectance. kind "" means that the column is not understood.
    """
    if len(name) > LONGEST:
        return Role("", why="its name is too long")
    text = plain(name).strip().strip("$").replace("\\", "").replace("$", "").strip()
    if len(text) > 1 and text[0] == text[-1] and text[0] in "'\"":
        text = text[1:-1]
    text = re.sub(r"\|\||(?<=[Rr_\s])//|//$", " par ", text)
    text = re.sub(r"\b[dl]'(?=[a-z])", "", text)  # angle d'incidence
    rest, own = _part_unit(text)
    if not own and unit_of(rest) in _AXIS_UNITS and len(rest) > 1:
        rest, own = "", unit_of(rest) or ""  # the unit is all the name there is
    unit = own or unit
    if re.fullmatch(r"s(?:[RT]|Qz?|psi|Psi)", rest):
        why = f"the standard error of {rest[1:]}, or {rest[1:]} of s-polarised light"
        return Role("unclear", "sigma_" + rest[1:], why=why)
    amplitude = _AMPLITUDE.fullmatch(rest) if rest[:1] == "r" else None
    if amplitude and unit != "percent":
        letter = "s" if amplitude[1] else "p"
        why = f"the amplitude r_{letter} or the reflectance R_{letter} = |r_{letter}|^2"
        return Role("unclear", "R_" + letter, why=why)
    if amplitude:
        rest = "R" + rest[1:]
    tokens = _tokens(rest)
    lower = {token.lower() for token in tokens}
    of_error = lower & _ERROR or tokens[:1] in (["d"], ["delta"])
    if (of_error and ("/" in rest or lower & _RELATIVE)) or (lower and lower <= _RELATIVE):
        return Role("unclear", why="a relative error, where absolute ones are wanted")
    if not _NO_SIGNS.fullmatch(rest) or rest.startswith("-"):
        return _angled(text, unit) or Role("", unit=unit)
    if not tokens and not unit:
        return Role("")
    if not tokens and unit in ("deg", "rad", "percent", "1", "arb", "permille"):
        return Role("", unit=unit)
    if lower & _NOT_INCIDENCE:
        return Role("", unit=unit, why="it is no angle of incidence")
    error = bool(lower & _ERROR)
    optical = [token for token in tokens if token.lower() not in _ERROR]
    if error:
        optical = [token for token in optical if token.lower() not in _ERROR_REST]
    if len(tokens) > 1 and tokens[0] in ("d", "delta") and not error:
        head = _optical(tokens[1:], unit, error=True)
        if head and head.quantity:
            return head  # dR, delta R
        if _axis(tokens[1:], unit):
            return Role("", why="it is the uncertainty or resolution of an axis")
    axis = _axis(optical, unit) if optical or not tokens else None
    if axis and not (error and not optical):
        if error:
            return Role("", why="it is the uncertainty or resolution of an axis")
        return axis
    if lower & _RAW:
        return Role("", unit=unit, why="it is a raw signal, not a ratio to the direct beam")
    found = _optical(optical, unit, error)
    if found:
        return found
    if angled := _angled(text, unit):
        return angled
    if lower & _set("psi delta") and lower & _set("tan cos sin"):
        return Role("", why="psi and delta themselves are wanted, in degrees")
    if lower and lower <= _CONSTANT:
        return Role("", unit=unit, why="it is an optical constant, not a measured power")
    return Role("", unit=unit)
