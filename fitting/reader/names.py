"""What one header name says of its column: role, quantity and unit, or nothing understood."""

from __future__ import annotations

import re
import unicodedata
from functools import lru_cache
from typing import NamedTuple

from fitting.reader.units import plain, unit_of


def _set(words: str) -> frozenset[str]:
    return frozenset(words.split())


_ANGLE = _set(
    "angle angles aoi theta phi winkel einfallswinkel angolo angulo incidence incident incidenza"
)
_ANGLE_REST = _set("inc i in out reflection deg external")
_WAVELENGTH = _set(
    "wavelength wavelengths lambda wl wvl wave length wellenlange wellenlaenge longueur onde"
)
_ENERGY = _set("energy energies energie photon hv")
_WAVENUMBER = _set("wavenumber wavenumbers wellenzahl")
_FREQUENCY = _set("frequency freq frequenz")
_REFLECTANCE = _set(
    "r refl reflectance reflectances reflectivity reflection reflexion reflektanz reflexionsgrad "
    "riflettanza reflectancia"
)
_TRANSMITTANCE = _set(
    "t trans transmittance transmission transmissivity transmissionsgrad transmittanz trasmittanza"
)
_S = _set("s te perp perpendicular senkrecht spol")
_P = _set("p tm par para parallel ppol")
_UNPOLARIZED = _set("unpolarized unpolarised unpol")
_BACK = _set("back rear")
_ERROR = _set(
    "std sd stdev stddev sigma err error errors unc uncert uncertainty se sem stderr fehler "
    "unsicherheit incertezza"
)
_ERROR_REST = _set("standard deviation dev bar bars of 1 abs absolute")
_FILL = _set(
    "avg average ave mean measured meas value values data experimental exp the light beam of for "
    "at pol polarized polarised polarization polarisation total specular front power col column"
)
_POLARIZATION = _set("polarization polarisation pol polarisierung polarizzazione")
_RAW = _set(
    "signal intensity intensities voltage current counts photocurrent irradiance i reference"
)
_CONSTANT = _set("n k nk eps epsilon e1 e2 index")
_NOT_INCIDENCE = _set(
    "mount motor stage position rotation goniometer detector azimuth analyzer analyser analysator "
    "compensator tilt"
)
# names glued of a quantity and its polarisation; T in capitals only (tp, ts are times as well)
_GLUED = re.compile(
    "(?:([Rr])(?:efl)?|(T)|([Rr]eflectance|[Tt]ransmittance))"
    "(s|p|S|P|te|tm|TE|TM|ss|pp|perp|par|spol|ppol|unpol|mean|avg|front|back)"
)
_SUFFIX = re.compile(
    r"(?<=[\w)\]])(?:[\s_.]+|(?:\s*[/,]\s*)|\s+in\s+)"
    r"(deg|degrees?|rad|radians?|mrad|nm|um|microns?|angstroms?|ev|kev|cm-1|cm\^-1|1/cm|thz|mm"
    r"|percent|pct|%)$",
    re.IGNORECASE,
)
# the field's names of amplitudes; as a power, percent or capitals say so
_AMPLITUDE = re.compile(
    r"r[\s_.-]?(?:(s|te|perp|spol|ss)|(p|tm|par|parallel|ppol|pp))", re.IGNORECASE
)
_AXIS_UNITS = ("nm", "um", "angstrom", "eV", "cm-1", "THz", "1/angstrom", "1/nm")


class Role(NamedTuple):
    """What a column is: angle, wavelength, polarization, polarizer, value, sigma, light, unclear
    or "".

    light: named by a polarisation and nothing else, such as TE: values, if there are no others.

    quantity: for value and sigma, a name of QUANTITIES; for sigma also "_s" and "_p", or "" where
        the name does not say of what.
    form: of an angle incidence, grazing, 2theta or q; of a wavelength the word that names it
        (wavelength, energy, wavenumber, frequency).
    unit: a key of :mod:`fitting.reader.units`, "" where the name gives none.
    why: for kind "", why the column cannot be used, if known; for unclear, both readings.
    """

    kind: str
    quantity: str = ""
    form: str = ""
    unit: str = ""
    why: str = ""


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
        rest, unit = rest[:-1].rstrip("/ _,"), unit or "percent"
    if not unit and (match := _SUFFIX.search(rest)):
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
        elif word.isupper() or not word.isalpha():
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
        elif token in _S | _P | _UNPOLARIZED:
            letter = "s" if token in _S else "p" if token in _P else "u"
            if light not in ("", letter):
                return None
            light = letter
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
    if words & _set("polarizer polariser polarisator"):
        return (
            Role("polarizer", unit=unit)
            if words - _ANGLE <= _set("polarizer polariser polarisator")
            else None
        )
    if (not words and set(tokens) & _POLARIZATION) or (
        words and words <= _set("state mode") | _POLARIZATION
    ):
        return Role("polarization")
    if (unit in ("1/angstrom", "1/nm") and words <= _set("q qz z momentum transfer")) or (
        words and words <= _set("q qz z momentum transfer") and words != {"z"}
    ):
        return Role("angle", form="q", unit=unit)
    double = words & _set("twotheta tth 2th 2theta") or ("theta" in words and words & {"2", "two"})
    if double and words <= _set("2 two twotheta tth 2th 2theta") | _ANGLE:
        return Role("angle", form="2theta", unit=unit)
    if words & _set("grazing glancing") and words <= _ANGLE | _set("grazing glancing"):
        return Role("angle", form="grazing", unit=unit)
    if words & _ANGLE and words <= _ANGLE | _ANGLE_REST:
        return Role("angle", form="incidence", unit=unit)
    if (words and words <= _WAVELENGTH and words != {"length"}) or (
        unit in ("nm", "um", "angstrom") and not words
    ):
        return Role("wavelength", form="wavelength", unit=unit)
    if (words and words <= _ENERGY) or (unit in ("eV", "keV") and words <= {"e"}):
        return Role("wavelength", form="energy", unit=unit)
    if (words and (words <= _WAVENUMBER or words == _set("wave number"))) or (
        unit == "cm-1" and words <= _set("k nu")
    ):
        return Role("wavelength", form="wavenumber", unit=unit)
    if (words and words <= _FREQUENCY) or (unit == "THz" and words <= _set("f nu")):
        return Role("wavelength", form="frequency", unit=unit)
    return None


@lru_cache(maxsize=4096)
def role_of(name: str, unit: str = "") -> Role:
    """Return what the header ``name`` says, with ``unit`` from a row of units where it gives none.

    Every word must be known: "R of sample 2" is not taken for a reflectance. Greek letters, German
    and a few other spellings count. kind "" means that the column is not understood.
    """
    text = unicodedata.normalize("NFKD", plain(name)).encode("ascii", "ignore").decode()
    text = text.strip().strip("'\"$|").replace("\\", "").replace("$", "").strip()
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
    if not tokens and not unit:
        return Role("")
    if not tokens and unit in ("deg", "rad", "percent", "1", "arb"):
        return Role("", unit=unit)
    lower = {token.lower() for token in tokens}
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
    if lower & _set("psi delta") and lower & _set("tan cos sin"):
        return Role("", why="psi and delta themselves are wanted, in degrees")
    if lower and lower <= _CONSTANT:
        return Role("", unit=unit, why="it is an optical constant, not a measured power")
    letters = [
        letter
        for letter, words in (("s", _S), ("p", _P), ("", _UNPOLARIZED))
        if lower & words and lower <= words | _FILL
    ]
    if len(letters) == 1 and not error:
        return Role("light", "R_" + letters[0] if letters[0] else "R", unit=unit)
    return Role("", unit=unit)
