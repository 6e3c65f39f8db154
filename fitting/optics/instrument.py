"""The imperfections of the instrument between the sample and the data.

Each of these is a parameter; those that a fit does not name have no effect:

    scale        factor of each curve (one quantity of one file)
    background   added to each curve after the scale
    angle_offset degrees added to every angle of incidence
    wavelength_offset nm added to every wavelength: the light's is longer than the one stated
    leak         share of the other polarization in the light behind a polarizer
    divergence   standard deviation of the angles of incidence within the beam, degrees (Gaussian)
    bandwidth    full width at half maximum of the wavelengths at each datum, nm (Gaussian)

Scale, background and leak are for powers only.

Averages over a slit and a beam: Gauss-Hermite quadrature with 11 wavelengths or 7 angles is enough
for curves that are smooth over the beam: while the phase of the films has a standard deviation
below SMOOTH radians in it, R is right to 1e-5. Faster fringes, and the kinks at a critical angle
and at grazing incidence, need equal steps. (With 11 wavelengths R is off by .03 and Delta by 3
degrees for a film of 6 um and a slit of 20 nm; with 7 angles R is off by .03 at a critical angle.)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array

from fitting.optics.spec import BEAM, SLIT, Points, Spec
from fitting.samples.parameters import LOG, SQUARE, Parameter, Unknown, start_range
from fresnel_jax.performance import computed_once

# Up to SLIT places are those of Gauss-Hermite quadrature, more are equal steps to FARTHEST standard
# deviations; as many as films need, and at a kink.
SMOOTH, FARTHEST = 0.5, 5.2
_EVEN, _KINK = (17, 33, 65, 129, 257), 129
# The widest slit, as a part of the wavelength.
_WIDEST = 0.25
_NAMES = {"bandwidth": ("a bandwidth", "wide"), "wavelength_offset": ("an offset", "large")}
# Their ranges, and the values at which they have no effect.
INSTRUMENT = {
    p.name: p
    for p in (
        Parameter("scale", "", (0.85, 1.1), 1e-3, 1e3, LOG, held=1.0),
        Parameter("background", "", (0.0, 0.0), -0.5, 0.5, held=0.0),
        Parameter("angle_offset", "deg", (-1.0, 1.0), -20.0, 20.0, held=0.0),
        Parameter("wavelength_offset", "nm", (-2.0, 2.0), -50.0, 50.0, held=0.0),
        Parameter("leak", "", (0.0, 0.05), 0.0, 0.5, held=0.0),
        # A symmetric beam changes a curve in proportion to the square of its width.
        Parameter("divergence", "deg", (0.1, 2.0), 0.0, 20.0, SQUARE, held=0.0),
        Parameter("bandwidth", "nm", (0.5, 10.0), 0.0, 100.0, SQUARE, held=0.0),
    )
}
PER_CURVE = "scale", "background"


def _places(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return distances from the middle of a beam in standard deviations, and weights of sum 1."""
    if count <= SLIT:
        x, weights = np.polynomial.hermite_e.hermegauss(count)
    else:
        x = np.linspace(-FARTHEST, FARTHEST, count)
        weights = np.exp(-0.5 * x * x)
    return x, weights / weights.sum()


def cosines(v: Mapping[str, Array], angle_deg: Any, places: int = BEAM) -> tuple[Array, Any]:
    """Return cosines (Q, M, L), one or several to a beam, and the weights (Q, 1, 1)."""
    angle = jnp.asarray(angle_deg)[None]
    if "angle_offset" in v:
        angle = angle + v["angle_offset"]
    weights = jnp.ones((1, 1, 1))
    if "divergence" in v:
        x, share = _places(places)
        angle = angle + jnp.asarray(x)[:, None, None] * v["divergence"]
        weights = jnp.asarray(share)[:, None, None]
    # Beyond 90 degrees or below 0 the plane of incidence is the same: cos and |cos| are right.
    return computed_once(jnp.abs(jnp.cos(jnp.radians(angle)))), weights


def slit(v: Mapping[str, Array], places: int = SLIT) -> tuple[Array, Array]:
    """Return shifts of the wavelength (B, L) in micrometres within the slit, and weights (B,)."""
    x, shares = _places(places)
    sigma_um = 1e-3 * v["bandwidth"] / np.sqrt(8.0 * np.log(2.0))
    return jnp.asarray(x)[:, None] * sigma_um, jnp.asarray(shares)


def detected(
    v: Mapping[str, Array],
    channel: str,
    ideal: Mapping[str, Array],
    s_share: Any,
    curves: tuple[tuple[int, ...], Any],
) -> Array:
    """Return the signal of the detector in a power channel, from the s and p powers of the sample.

    curves: for every file the number in ``scale_0``, ``background_0``; and the file of each row.
    """
    letter, _, light = channel.partition("_")
    s, p = ideal[f"{letter}_s"], ideal[f"{letter}_p"]
    share: Any = {"s": 1.0, "p": 0.0}.get(light, s_share)
    if "leak" in v:
        share = share + (1.0 - 2.0 * share) * v["leak"]
    value = p + share * (s - p)
    of_file, file = curves
    for name in PER_CURVE:
        if f"{name}_{of_file[0]}" not in v:
            continue
        each = jnp.stack([v[f"{name}_{i}"] for i in of_file])
        term = each[0] if len(of_file) == 1 else each[file]
        value = value * term if name == "scale" else value + term
    return value


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
    return {u.parameter.name: start_range(u)[1] if u.free else u.low for u in moving}


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
