"""The way from each unit to degrees of incidence, micrometres and fractions."""

from __future__ import annotations

import numpy as np

# h c / e in eV um, exact since the SI of 2019: 6.62607015e-34 * 299792458 / 1.602176634e-19 * 1e6
_EV_UM = 1.2398419843320026
_C = 299.792458  # um THz
_RECIPROCAL = {
    "eV": _EV_UM, "meV": _EV_UM * 1e3, "keV": _EV_UM / 1e3, "cm-1": 1e4, "1/um": 1.0, "THz": _C,
    "GHz": _C * 1e3, "Hz": _C * 1e12, "rad/s": 2.0 * np.pi * _C * 1e12, "rad/fs": 2e-3 * np.pi * _C,
}  # fmt: skip
_UM = {"um": 1.0, "nm": 1e-3, "angstrom": 1e-4, "mm": 1e3}

# what a number in the unit is
FORM_OF = {
    "nm": "wavelength", "um": "wavelength", "angstrom": "wavelength", "eV": "energy",
    "cm-1": "wavenumber", "THz": "frequency", "mm": "wavelength", "keV": "energy",
    "meV": "energy", "1/um": "wavenumber", "GHz": "frequency", "Hz": "frequency",
    "rad/s": "angular frequency", "rad/fs": "angular frequency", "1/angstrom": "q", "1/nm": "q",
}  # fmt: skip
WAVELENGTH_UNITS = tuple(unit for unit, form in FORM_OF.items() if form != "q")
ANGLE_UNITS = ("deg", "rad", "grazing-deg", "1/angstrom", "1/nm")
Q_UNITS = ("1/angstrom", "1/nm")


def wavelength_um(number: np.ndarray, unit: str) -> np.ndarray:
    """Return vacuum wavelengths in micrometres for numbers in one of ``WAVELENGTH_UNITS``.

    A decimal prefix is a division by a power of ten, so 658 nm becomes the float 0.658 itself.
    """
    with np.errstate(all="ignore"):
        return scaled(number, _UM[unit]) if unit in _UM else _RECIPROCAL[unit] / number


def incidence_deg(number: np.ndarray, unit: str, wavelength: np.ndarray) -> np.ndarray:
    """Return angles of incidence in degrees for numbers in one of ``ANGLE_UNITS``.

    wavelength: micrometres in the medium that the light comes from; used for Q alone, where
        cos(angle) = Q lambda / (4 pi) and a Q beyond 4 pi / lambda gives NaN.
    """
    with np.errstate(all="ignore"):
        if unit in Q_UNITS:
            per_um = {"1/angstrom": 1e4, "1/nm": 1e3}[unit]
            cosine = number * per_um * wavelength / (4.0 * np.pi)
            return np.where(number < 0.0, np.nan, np.degrees(np.arccos(cosine)))
        if unit == "grazing-deg":
            return 90.0 - number
        return np.degrees(number) if unit == "rad" else number


def span_of(numbers: np.ndarray, unit: str = "") -> str:
    """Return "low to high" of the finite numbers, or the one that they all are, for messages."""
    finite = numbers[np.isfinite(numbers)]
    ends = (finite.min(), finite.max()) if len(finite) else ()
    text = " to ".join(dict.fromkeys(f"{end:.6g}" for end in ends))
    return f"{text or 'nothing'} {unit}".rstrip()


def scaled(number: np.ndarray, scale: float) -> np.ndarray:
    """Return ``number * scale``, as one correctly rounded division where 1 / scale is whole.

    57 % is then the float 0.57, which 57 * 0.01 is not.
    """
    inverse = 1.0 / scale
    if abs(inverse) > 1.0 and abs(inverse - round(inverse)) < 1e-9 * abs(inverse):
        return number / round(inverse)
    return number * scale
