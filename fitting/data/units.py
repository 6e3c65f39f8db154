"""The way from each unit to degrees of incidence, micrometres and fractions."""

from __future__ import annotations

import numpy as np

# h c / e in eV um, exact since the SI of 2019: 6.62607015e-34 * 299792458 / 1.602176634e-19 * 1e6
_EV_UM = 1.2398419843320026
_C = 299.792458  # um THz
# What a number in the unit is, and the wavelength in um at which the number is 1: of wavelengths
# multiplied by the number, of all others divided by it. Of Q, what makes it 1/um.
_UNITS = {
    "nm": ("wavelength", 1e-3), "um": ("wavelength", 1.0), "angstrom": ("wavelength", 1e-4),
    "eV": ("energy", _EV_UM), "cm-1": ("wavenumber", 1e4), "THz": ("frequency", _C),
    "mm": ("wavelength", 1e3), "keV": ("energy", _EV_UM / 1e3), "meV": ("energy", _EV_UM * 1e3),
    "1/um": ("wavenumber", 1.0), "GHz": ("frequency", _C * 1e3), "Hz": ("frequency", _C * 1e12),
    "rad/s": ("angular frequency", 2.0 * np.pi * _C * 1e12),
    "rad/fs": ("angular frequency", 2e-3 * np.pi * _C),
    "1/angstrom": ("q", 1e4), "1/nm": ("q", 1e3),
}  # fmt: skip
FORM_OF = {unit: form for unit, (form, _) in _UNITS.items()}
WAVELENGTH_UNITS = tuple(unit for unit, form in FORM_OF.items() if form != "q")
Q_UNITS = ("1/angstrom", "1/nm")
ANGLE_UNITS = ("deg", "rad", "grazing-deg", *Q_UNITS)


def wavelength_um(number: np.ndarray, unit: str) -> np.ndarray:
    """Return vacuum wavelengths in micrometres for numbers in one of ``WAVELENGTH_UNITS``.

    A decimal prefix is a division by a power of ten, so 658 nm becomes the float 0.658 itself.
    """
    form, factor = _UNITS[unit]
    with np.errstate(all="ignore"):
        return scaled(number, factor) if form == "wavelength" else factor / number


def is_doubtful(number: np.ndarray, unit: str) -> bool:
    """Return whether no spectrometer counts its wavelengths so: um that may be nm, or nm um."""
    low, high = np.nanmin(number, initial=np.inf), np.nanmax(number, initial=0.0)
    return bool((unit == "nm" and high < 5.0) or (unit == "um" and np.inf > low >= 100.0))


def incidence_deg(number: np.ndarray, unit: str, wavelength: np.ndarray) -> np.ndarray:
    """Return angles of incidence in degrees for numbers in one of ``ANGLE_UNITS``.

    wavelength: micrometres in the medium that the light comes from; used for Q alone, where
        cos(angle) = Q lambda / (4 pi) and a Q beyond 4 pi / lambda gives NaN.
    """
    with np.errstate(all="ignore"):
        if unit in Q_UNITS:
            cosine = number * _UNITS[unit][1] * wavelength / (4.0 * np.pi)
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
