"""What one header name says of its column: role, quantity and unit, or nothing understood."""

from __future__ import annotations

import re
from functools import lru_cache
from typing import NamedTuple

from fitting.reader.units import FORM_OF, Q_UNITS
from fitting.reader.vocabulary import (
    CONCEPT,
    LONGEST,
    UNITS_BEHIND_WORDS,
    cased,
    light_of,
    spelled,
    unit_of,
)


def _of(*concepts: str) -> frozenset[str]:
    return frozenset(word for word, concept in CONCEPT.items() if concept in concepts)


def _set(words: str) -> frozenset[str]:
    return frozenset(words.split())


_REFLECTANCE, _TRANSMITTANCE = _of("R") - {"r"}, _of("T") - {"t"}
_BACK, _ERROR, _RAW, _CONSTANT = _of("back"), _of("error"), _of("raw"), _of("constant")
_RELATIVE, _FILL, _POLARIZATION = _of("relative"), _of("filler"), _of("polarization")
_ERROR_REST = _set("standard deviation dev bar bars of 1 abs absolute ecart type")
_ANGLE = _of("incidence", "angle")
_AXES = (  # kind and form; one of these words is there, and beside it these
    ("polarization", "", _POLARIZATION | _set("state mode"), _FILL),
    ("polarizer", "", _of("polarizer") | _POLARIZATION, _ANGLE),
    ("angle", "q", _of("transfer"), _set("z")),
    ("angle", "2theta", _of("doubled"), _ANGLE),
    ("angle", "grazing", _of("grazing"), _ANGLE),
    ("angle", "incidence", _ANGLE, _set("inc i in out reflection deg external d di de of")),
    ("wavelength", "wavelength", _of("wavelength"), _set("d di de")),
    ("wavelength", "energy", _of("energy"), _set("")),
    ("wavelength", "wavenumber", _of("wavenumber"), _set("")),
    ("wavelength", "frequency", _of("frequency"), _set("")),
)
# letters that are such a quantity beside its unit
_SYMBOLS = {
    "wavelength": _set(""), "energy": _set("e"), "wavenumber": _set("k nu"),
    "frequency": _set("f nu"), "q": _set("z"),
}  # fmt: skip
_NOT_INCIDENCE = _of("no incidence") - _set("phase temperature celsius")
# names glued of a quantity and its polarisation; T in capitals only (tp, ts are times as well)
_GLUED = re.compile(
    "(?:([Rr])(?:efl)?|(T)|([Rr]eflectance|[Tt]ransmittance))"
    "(s|p|S|P|te|tm|TE|TM|ss|pp|perp|par|spol|ppol|unpol|mean|avg|front|back)"
)
_SUFFIX = re.compile(r"(?<=[\w)\]])(?:[\s_.]+|\s*[/,]\s*|\s+in\s+)([^\s_]+)$")
# the field's names of amplitudes; as a power, percent or capitals say so
_AMPLITUDE = re.compile(
    r"r[\s_.-]?(?:(s|te|perp|spol|ss)|(p|tm|par|parallel|ppol|pp))", re.IGNORECASE
)
# R(45 deg), Rs@60, "angle 60" once it is spelled out: the angle of a column in a wide table
_AT = re.compile(
    r"[(\[_\s]\s*(?:(?:at|aoi|theta)\s*=?\s*)?(?:([0-9]+(?:\.[0-9]+)?)\s*_?deg(?:rees?)?"
    r"|angle ([0-9]+(?:\.[0-9]+)?))\s*[)\]]?(?=$|[\s_(\[])",
    re.IGNORECASE,
)
# what may stand between words and means nothing; a prime, a root, a ratio does mean something
_AXIS_UNITS = ("nm", "um", "angstrom", "eV", "cm-1", "THz", *Q_UNITS)
_NO_SIGNS = re.compile(r"[\w\s.,:;()\[\]{}\-]*")


class Role(NamedTuple):
    """What a column is: angle, wavelength, polarization, polarizer, value, sigma, unclear or "".

    quantity: for value and sigma, a name of QUANTITIES; for sigma also "_s" and "_p", or "" where
        the name does not say of what.
    form: of an angle incidence, grazing, 2theta or q; of a wavelength the word that names it
        (wavelength, energy, wavenumber, frequency).
    unit: a key of :mod:`fitting.reader.vocabulary`, "" where the name gives none.
    at: for value and sigma, the angle of incidence in degrees that the name gives, else None.
    why: for kind "", why the column cannot be used, if known; for unclear, both readings.
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
    suffix = unit_of(match[1]) if match else None
    # one letter is a unit of length behind a wavelength alone
    if (
        match
        and suffix in UNITS_BEHIND_WORDS
        and (
            len(match[1]) > 1
            or match[1] == "%"
            or set(_tokens(rest[: match.start()])) <= _of("wavelength")
        )
    ):
        rest, unit = rest[: match.start()], suffix or ""
    return rest, unit


def _tokens(rest: str) -> list[str]:
    """Return the words of a name, with R and T kept as capitals and glued names taken apart."""
    tokens = []
    for word in re.findall(r"[^\W_]+", rest):
        for part in [word] if _GLUED.fullmatch(word) else cased(word):
            glued = _GLUED.fullmatch(part)
            if glued:
                tokens += ["T" if part[0] in "Tt" else "R", glued[4].lower()]
            else:
                tokens.append(part if part in ("R", "T") else part.lower())
    return tokens


def _optical(tokens: list[str], unit: str, error: bool) -> Role | None:
    """Return the role of a value or of its standard error, or None where a word is left over."""
    quantity, side, light = "", "", ""
    for token in tokens:
        if token == "R" or token in _REFLECTANCE:
            new = "R"
        elif token == "T" or token in _TRANSMITTANCE:
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
        elif token in _FILL | _POLARIZATION:
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
    words = {token.lower() for token in tokens}
    for kind, form, needed, others in _AXES:
        if words & needed and words <= needed | others | _FILL:
            return Role(kind, form=form, unit=unit)
    form = FORM_OF.get(unit, "") if unit != "mm" else ""
    if form and words <= _SYMBOLS[form] | _FILL:
        return Role("angle" if form == "q" else "wavelength", form=form, unit=unit)
    return None


@lru_cache(maxsize=4096)
def role_of(name: str, unit: str = "") -> Role:
    """Return what the header ``name`` says, with ``unit`` from a row of units where it gives none.

    Every word and every sign must be known: neither "R of sample 2" nor "R'" is taken for a
    reflectance. kind "" means that the column is not understood.
    """
    if len(name) > LONGEST:
        return Role("", why="its name is too long")
    text = spelled(name).strip().strip("$").replace("\\", "").replace("$", "").strip()
    if len(text) > 1 and text[0] == text[-1] and text[0] in "'\"":
        text = text[1:-1]
    text = re.sub(r"\|\||(?<=[Rr_\s])//|//$", " par ", text)
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
        return Role("", unit=unit)
    if not tokens and unit not in _AXIS_UNITS:
        return Role("", unit=unit)
    if lower & _NOT_INCIDENCE:
        return Role("", unit=unit, why="it is no angle of incidence")
    error = bool(lower & _ERROR)
    optical = [token for token in tokens if token.lower() not in _ERROR]
    if error:
        optical = [token for token in optical if token.lower() not in _ERROR_REST]
    elif len(tokens) > 1 and tokens[0] in ("d", "delta"):
        head = _optical(tokens[1:], unit, error=True)
        if head and head.quantity:
            return head  # dR, delta R
        if _axis(tokens[1:], unit):
            return Role("", why="it is the uncertainty or resolution of an axis")
    axis = _axis(optical, unit) if optical or not error else None
    if axis:
        return Role("", why="it is the uncertainty or resolution of an axis") if error else axis
    if lower & _RAW:
        return Role("", unit=unit, why="it is a raw signal, not a ratio to the direct beam")
    if found := _optical(optical, unit, error):
        return found
    if lower & {"psi", "delta"} and lower & {"tan", "cos", "sin"}:
        return Role("", why="psi and delta themselves are wanted, in degrees")
    if lower and lower <= _CONSTANT:
        return Role("", unit=unit, why="it is an optical constant, not a measured power")
    if match := _AT.search(text):
        bare = role_of(text[: match.start()] + " " + text[match.end() :], unit.replace("deg", ""))
        if bare.kind in ("value", "sigma") and bare.quantity and bare.at is None:
            return bare._replace(at=float(match[1] or match[2]))
    return Role("", unit=unit)
