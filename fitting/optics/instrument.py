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
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array

from fitting.samples.parameters import LOG, SQUARE, Parameter
from fresnel_jax.performance import computed_once

PER_CURVE = ("scale", "background")
INSTRUMENT = (*PER_CURVE, "angle_offset", "wavelength_offset", "leak", "divergence", "bandwidth")

# Number of wavelengths in a slit and of angles in a beam, unless more are needed (`averages`). Up
# to this number they are those of Gauss-Hermite quadrature, beyond it equal steps to FARTHEST
# standard deviations.
SLIT, BEAM = 11, 7
FARTHEST = 5.2


def instrument_parameter(name: str) -> Parameter:
    """Return the range and the neutral value of an instrument parameter, by its bare name."""
    return {
        "scale": Parameter("scale", "", (0.85, 1.1), 1e-3, 1e3, LOG, held=1.0),
        "background": Parameter("background", "", (0.0, 0.0), -0.5, 0.5, held=0.0),
        "angle_offset": Parameter("angle_offset", "deg", (-1.0, 1.0), -20.0, 20.0, held=0.0),
        "wavelength_offset": Parameter(
            "wavelength_offset", "nm", (-2.0, 2.0), -50.0, 50.0, held=0.0
        ),
        "leak": Parameter("leak", "", (0.0, 0.05), 0.0, 0.5, held=0.0),
        # A symmetric beam changes a curve in proportion to the square of its width.
        "divergence": Parameter("divergence", "deg", (0.1, 2.0), 0.0, 20.0, SQUARE, held=0.0),
        "bandwidth": Parameter("bandwidth", "nm", (0.5, 10.0), 0.0, 100.0, SQUARE, held=0.0),
    }[name]


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
