"""How many wavelengths and angles the averages over a slit and a beam take.

Gauss-Hermite quadrature with 11 wavelengths or 7 angles is enough for curves that are smooth over
the beam: while the phase of the films has a standard deviation below SMOOTH radians in it, R is
right to 1e-5. Faster fringes, and the kinks at a critical angle and at grazing incidence, need
equal steps. (With 11 wavelengths R is off by .03 and Delta by 3 degrees for a film of 6 um and a
slit of 20 nm; with 7 angles R is off by .03 at a critical angle.)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fitting.optics.instrument import BEAM, FARTHEST, SLIT
from fitting.optics.spec import Points, Spec
from fitting.samples.parameters import Unknown, start_range, value_and_slope

SMOOTH = 0.5
_EVEN, _KINK = (17, 33, 65, 129, 257), 129
# The widest slit, as a part of the wavelength.
_WIDEST = 0.25
_NAMES = {"bandwidth": ("a bandwidth", "wide"), "wavelength_offset": ("an offset", "large")}


def _enough(phase: float, few: int, what: str) -> int:
    """Return how many places fringes need whose phase has this standard deviation (rad)."""
    if not phase >= SMOOTH:
        return few
    for count in _EVEN:
        # A sum in equal steps is right to 1e-4 while the frequency of the curve is 4.3 below that
        # of the steps; 3 is the third harmonic of the fringes. (R within 1e-4 of brute force.)
        if 2.0 * FARTHEST / (count - 1) * (3.0 * phase + 4.3) < 2.0 * np.pi:
            return count
    # Within the full width at half maximum.
    fringes = phase * np.sqrt(8.0 * np.log(2.0)) / (2.0 * np.pi)
    raise ValueError(
        f"{what} averages over some {fringes:.0f} fringes of the films, of which nothing is "
        "left: write 'thick' after the thickness of a layer whose reflections do not interfere."
    )


def _check_slit(
    bandwidth_nm: float, wavelength_um: Any, what: str = "a bandwidth", wide: str = "wide"
) -> None:
    """Raise ValueError for a slit too wide for the shortest of some wavelengths, or an offset."""
    shortest = 1e3 * float(np.min(wavelength_um))
    if bandwidth_nm > _WIDEST * shortest:
        raise ValueError(
            f"{what} of {bandwidth_nm:g} nm is too {wide} for the wavelength {shortest:g} nm: a "
            f"quarter of it, {_WIDEST * shortest:.3g} nm, or less was wanted. Give the full width "
            "at half maximum, or the offset, in nm, or leave the shortest wavelengths out."
        )


def within_slit(unknown: Unknown, points: Points) -> Unknown:
    """Return the unknown; a bandwidth or an offset is limited to what its wavelengths allow."""
    if unknown.parameter.name not in _NAMES:
        return unknown
    least = max(unknown.low, -unknown.high, 0.0)
    _check_slit(least, points.wavelength_um, *_NAMES[unknown.parameter.name])
    widest = 1e3 * _WIDEST * float(np.min(points.wavelength_um))
    return unknown._replace(low=max(unknown.low, -widest), high=min(unknown.high, widest))


def largest(moving: Sequence[Unknown]) -> dict[str, float]:
    """Return the largest value at which a search begins, by the name of the parameter."""
    return {
        u.parameter.name: start_range(u)[1] if u.free else u.low for u in moving
    }  # fmt: skip


def values_at(spec: Spec, held: np.ndarray, y: np.ndarray) -> dict[str, float]:
    """Return every parameter, by its internal name, at unknowns y (p,) and constants (h,)."""
    pairs = zip(spec.moving, spec.coordinates, y, strict=True)
    values = {name: float(value_and_slope(kind, x)[0]) for name, kind, x in pairs}
    values |= dict(zip(spec.held, held.tolist(), strict=True))
    return values | {name: factor * values[of] for name, factor, of in spec.tied}


def with_places(spec: Spec, size: Mapping[str, float], points: Points, outside: float) -> Spec:
    """Return the description of the program with the numbers of places that its averages need.

    size: name -> value of all parameters, or the largest that they may have. outside: index of the
    first medium. Raises ValueError where a slit is too wide for the films or the wavelengths.
    """
    bandwidth, divergence = size.get("bandwidth", 0.0), size.get("divergence", 0.0)
    if not (bandwidth or divergence):
        return spec
    _check_slit(bandwidth, points.wavelength_um)
    films_um = 1e-3 * sum(d for name, d in size.items() if name.endswith(".thickness_nm"))
    shortest = float(np.min(points.wavelength_um))
    # Twice through films of index 2; for a larger index the margin of the third harmonic is enough.
    turns = 4.0 * np.pi * films_um / shortest
    wide_um, spread = 1e-3 * bandwidth / np.sqrt(8.0 * np.log(2.0)), np.radians(divergence)
    slit = _enough(2.0 * turns * wide_um / shortest, SLIT, "the slit (bandwidth)")
    beam = _enough(0.5 * outside**2 * turns * spread, BEAM, "the beam (divergence)")
    grazing = float(np.max(points.angle_deg)) + FARTHEST * divergence > 90.0
    if divergence and (grazing or outside > 1.0 + 1e-3):
        beam = max(beam, _KINK)
    return spec._replace(places=(slit, beam))
