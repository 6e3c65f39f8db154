"""What the lines above the numbers and the name of the file say about the whole measurement."""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np

from fitting.errors import MeasurementError
from fitting.reader.units import plain, unit_of, wavelength_um

_NUMBER = r"([0-9]+(?:[.,][0-9]+)?)"
_WAVELENGTH = re.compile(
    r"(?:wavelength|lambda|laser)(?:_([a-z]+))?\s*(?:[:=,]|\bis\b|\s)\s*"
    rf"{_NUMBER}[\s,;]*([a-z]*)\W*",
    re.IGNORECASE,
)
_ANGLE = re.compile(
    r"(?:angle of incidence|angle_of_incidence|incidence angle|incidence_angle|incidence|aoi|angle)"
    rf"(?:_(deg))?\s*(?:[:=,]|\bis\b|\s)\s*{_NUMBER}[\s,;]*([a-z]*)\W*",
    re.IGNORECASE,
)
_LIGHT = re.compile(
    r"polari[sz]ation\s*[:=,\s]\s*([a-z]+)(?:[ -]?polari[sz]ed|[ -]?pol)?\W*", re.IGNORECASE
)
_WORDS = {
    "s": "s",
    "te": "s",
    "p": "p",
    "tm": "p",
    "unpolarized": "u",
    "unpolarised": "u",
    "none": "u",
}
_NAME_LIGHT = {"spol": "s", "ppol": "p", "TE": "s", "TM": "p", "Rs": "s", "Rp": "p", "unpol": "u"}


class Said(NamedTuple):
    """A number that a line of the preamble gives."""

    value: float
    line: int


def _one(found: list[Said]) -> Said | None:
    """Return the one thing said; None where nothing is, or lines contradict one another."""
    return found[0] if len({said.value for said in found}) == 1 else None


def wavelength_said(preamble: list[tuple[int, str]]) -> Said | None:
    """Return the wavelength in micrometres that a line such as ``wavelength: 532 nm`` gives."""
    found = []
    for line, text in preamble:
        match = _WAVELENGTH.fullmatch(plain(text).strip())
        unit = unit_of((match[1] or match[3]) if match else "")
        if match and unit in ("nm", "um", "angstrom"):
            number = wavelength_um(np.array(float(match[2].replace(",", "."))), unit)
            if number > 0.0:
                found.append(Said(float(number), line))
    return _one(found)


def angle_said(preamble: list[tuple[int, str]]) -> Said | None:
    """Return the angle in degrees that a line such as ``angle of incidence: 45 deg`` gives."""
    found = []
    for line, text in preamble:
        match = _ANGLE.fullmatch(plain(text).strip())
        if match and unit_of(match[1] or match[3]) == "deg":
            found.append(Said(float(match[2].replace(",", ".")), line))
    return _one(found)


def angle_in_name(stem: str) -> str:
    """Return the number in a file name such as ``hafnia_60deg``, for a hint; "" where none is."""
    match = re.search(r"(?<![0-9.])([0-9]{1,2}(?:\.[0-9]+)?) ?deg", stem)
    return match[1] if match else ""


def light_said(source: str, stem: str, preamble: list[tuple[int, str]]) -> tuple[str, str]:
    """Return "s", "p" or "u" and the place that says so, or two empty strings.

    A line ``polarization: s`` counts, and the words TE, TM, Rs, Rp, spol, p-pol in the file name.
    Raises MeasurementError where they contradict one another, or the name may mean it or not.
    """
    said = {}
    for line, text in preamble:
        match = _LIGHT.fullmatch(plain(text).strip())
        if match and match[1].lower() in _WORDS:
            said[_WORDS[match[1].lower()]] = f"line {line}"
    words = re.findall(
        r"[A-Za-z]+",
        re.sub(
            r"(?i)(?<![a-z])([sp])[ _-]?pol(?:ari[sz]ed)?(?![a-z])",
            lambda m: m[1].lower() + "pol",
            stem,
        ),
    )
    for word in words:
        if word in _NAME_LIGHT:
            said[_NAME_LIGHT[word]] = "the file name"
    if len(said) > 1:
        facts = " and ".join(f"{where} says {light}" for light, where in said.items())
        raise MeasurementError(
            f"{source}: {facts}-polarised. Say --polarization s, p or unpolarized."
        )
    code = re.search(r"(?i)pol(?:ari[sz]ation)?[ ._-]?([0-9]+)(?![0-9])", stem)
    letter = [word for word in words if word in ("s", "p", "S", "P")]
    if not said and (code or len(set(letter)) == 1):
        what = f"polarisation {code[1]}" if code else f"the letter {letter[0]!r}"
        raise MeasurementError(
            f"{source}: the file name has {what}, the column says no polarisation. Say "
            "--polarization s, p or unpolarized."
        )
    return next(iter(said.items()), ("", ""))
