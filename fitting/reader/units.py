"""Spellings of units, and the way from each to degrees of incidence, micrometres and fractions."""

from __future__ import annotations

import re

import numpy as np

# h c / e in eV um, exact since the SI of 2019: 6.62607015e-34 * 299792458 / 1.602176634e-19 * 1e6
_EV_UM = 1.2398419843320026
_THZ_UM = 299.792458  # c in um THz

_SPELLINGS = {
    "deg": "deg degs degree degrees",
    "rad": "rad rads radian radians",
    "mrad": "mrad milliradian milliradians",
    "deg.arcmin": "deg.arcmin degrees.arcminutes",
    "grazing-deg": "grazing-deg",
    "grazing-rad": "grazing-rad",
    "2theta-deg": "2theta-deg 2theta",
    "1/angstrom": "1/angstrom 1/angstroms 1/a a^-1 a-1 angstrom^-1 angstrom-1 inv_angstrom",
    "1/nm": "1/nm nm^-1 nm-1",
    "nm": "nm nanometer nanometers nanometre nanometres nanometro nanometri",
    "um": "um micron microns micrometer micrometers micrometre micrometres mum mkm",
    "angstrom": "angstrom angstroms a ang aa",
    "mm": "mm",
    "eV": "ev electronvolt electronvolts electron_volt",
    "keV": "kev",
    "cm-1": "cm-1 cm^-1 1/cm cm**-1 cm^(-1 kayser wavenumbers",
    "THz": "thz",
    "percent": "% percent per_cent pct prozent %r %t",
    "1": "1 - -- none fraction dimensionless ratio abs 0..1 0-1 [] au/au",
    "arb": "a.u. arb arb. arb.u. arb.units arb._units arbitrary arbitrary_units counts cts cps v mv"
    " volt volts uv ma ua na pa w mw uw db",
}
UNITS = {word: unit for unit, words in _SPELLINGS.items() for word in words.split()}
WAVELENGTH_UNITS = ("nm", "um", "angstrom", "eV", "cm-1", "THz", "mm", "keV")
ANGLE_UNITS = (
    "deg",
    "rad",
    "mrad",
    "deg.arcmin",
    "grazing-deg",
    "grazing-rad",
    "2theta-deg",
    "1/angstrom",
    "1/nm",
)
Q_UNITS = ("1/angstrom", "1/nm")

_GREEK = {
    "\u03bb": "lambda",
    "\u03b8": "theta",
    "\u03d1": "theta",
    "\u03c8": "psi",
    "\u03a8": "psi",
    "\u03c6": "phi",
    "\u03d5": "phi",
    "\u0394": "Delta",
    "\u2206": "Delta",
    "\u03b4": "delta",
    "\u03c3": "sigma",
    "\u00b5": "u",
    "\u03bc": "u",
    "\u03bd": "nu",
    "\u00c5": "angstrom",
    "\u212b": "angstrom",
    "\u00b0": "deg",
    "\u02da": "deg",
    "\u00ba": "deg",
    "\u22a5": " perp ",
    "\u2225": " par ",
    "\u2212": "-",
    "\u2013": "-",
    "\u207b": "-",
    "\u00b9": "1",
    "\u00b2": "2",
    "\u00b1": " error ",
}
_TRANSLATION = str.maketrans(_GREEK)


def plain(text: str) -> str:
    """Return ``text`` with Greek letters as words and typographic signs as ASCII ones."""
    return text if text.isascii() else text.translate(_TRANSLATION)


def unit_of(text: str) -> str | None:
    """Return the unit that ``text`` spells (a key such as nm, deg, percent), or None."""
    word = re.sub(r"\s+", "_", plain(text).strip().strip("[](){}").strip().lower())
    return UNITS.get(word.replace("{", "").replace("}", "").replace("$", ""))


def wavelength_um(number: np.ndarray, unit: str) -> np.ndarray:
    """Return vacuum wavelengths in micrometres for numbers in one of ``WAVELENGTH_UNITS``.

    A decimal prefix is a division by a power of ten, so 658 nm becomes the float 0.658 itself.
    """
    with np.errstate(all="ignore"):
        if unit == "um":
            return number
        if unit in ("nm", "angstrom"):
            return number / {"nm": 1e3, "angstrom": 1e4}[unit]
        if unit == "mm":
            return number * 1e3
        top = {"eV": _EV_UM, "keV": _EV_UM / 1e3, "cm-1": 1e4, "THz": _THZ_UM}[unit]
        return top / number


def incidence_deg(number: np.ndarray, unit: str, wavelength: np.ndarray) -> np.ndarray:
    """Return angles of incidence in degrees for numbers in one of ``ANGLE_UNITS``.

    wavelength: micrometres in the medium that the light comes from; used for Q alone, where
        cos(angle) = Q lambda / (4 pi) and a Q beyond 4 pi / lambda gives NaN.
    """
    with np.errstate(all="ignore"):
        if unit == "deg":
            return number
        if unit == "rad":
            return np.degrees(number)
        if unit == "mrad":
            return np.degrees(number / 1e3)
        if unit == "deg.arcmin":
            whole = np.trunc(number)
            # files give two digits of minutes; rounding takes off what binary fractions add
            return whole + np.round((number - whole) * 100.0, 9) / 60.0
        if unit == "grazing-deg":
            return 90.0 - number
        if unit == "grazing-rad":
            return 90.0 - np.degrees(number)
        if unit == "2theta-deg":
            return 90.0 - number / 2.0
        per_um = {"1/angstrom": 1e4, "1/nm": 1e3}[unit]
        cosine = number * per_um * wavelength / (4.0 * np.pi)
        return np.where(number < 0.0, np.nan, np.degrees(np.arccos(cosine)))


def scaled(number: np.ndarray, scale: float) -> np.ndarray:
    """Return ``number * scale``, as one correctly rounded division where 1 / scale is whole.

    57 % is then the float 0.57, which 57 * 0.01 is not.
    """
    inverse = 1.0 / scale
    if abs(inverse) > 1.0 and abs(inverse - round(inverse)) < 1e-9 * abs(inverse):
        return number / round(inverse)
    return number * scale
