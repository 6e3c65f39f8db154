"""From parameters to what a detector shows: a structure seen through an imperfect instrument.

Structures: one bare interface; a thick slab with both faces (`fresnel_jax.layers`). Nuisances, each
only when asked for:

    scale        factor of each curve (one quantity of one file)
    background   added to each curve after the scale
    angle_offset degrees added to every angle of incidence
    leak         share of the other polarisation in what a polariser lets through
    divergence   standard deviation of the angles of incidence within the beam, degrees (Gaussian)

psi and Delta are compared as N = cos 2psi, C = sin 2psi cos Delta, S = sin 2psi sin Delta, which
have no branches and no place where one of them means nothing; a divergent beam averages the
intensities behind them. Scale, background and leak are for powers only.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from fitting.dispersion import Model
from fitting.parameters import LOG, SQUARE, Parameter, to_parameter
from fresnel_jax import powers
from fresnel_jax.layers import slab
from fresnel_jax.polarization import ellipsometric_ratio

INTERFACE, SLAB = "interface", "slab"
STRUCTURES = (INTERFACE, SLAB)
POWERS = ("R_s", "R_p", "R", "R_back", "T_s", "T_p", "T")
NCS = "NCS"
PER_CURVE = ("scale", "background")
NUISANCES = (*PER_CURVE, "angle_offset", "leak", "divergence")

# Gauss and Hermite's nodes: 7 are exact for a curve that is a polynomial of degree 13 over the
# beam. Weights add up to 1, distances in standard deviations.
_NODES, _WEIGHTS = np.polynomial.hermite_e.hermegauss(7)
_WEIGHTS = _WEIGHTS / _WEIGHTS.sum()


class Points(NamedTuple):
    """Where the data lie, M rows; the last axis is 1, or L where every lane has points of its own.

    angle_deg, wavelength_um, s_share: (M, 1) or (M, L); s_share is the part of s in R and T.
    file: (M,) number of the file of each row.
    distinct_um, place: where wavelengths repeat (angles, repeated rows), each of them once, (U, 1),
        and (M,) which of them belongs to each row; else None. The index is evaluated there: with
        two oscillators a fit at 3 angles takes half, one at 7 angles a third of the time.
    """

    angle_deg: Any
    wavelength_um: Any
    s_share: Any
    file: Any
    distinct_um: Any = None
    place: Any = None


class Spec(NamedTuple):
    """Everything about a fit that a compiled program depends on; hashable.

    channels: those of `POWERS` and `NCS` that are fitted. moving: names of the unknowns, in the
    order of y; coordinates: theirs. held: names of the constants. curves: for each channel the
    curve of every file, the number in ``scale_0``, ``background_0``.
    """

    model: Model
    structure: str
    channels: tuple[str, ...]
    moving: tuple[str, ...]
    coordinates: tuple[str, ...]
    held: tuple[str, ...]
    curves: tuple[tuple[int, ...], ...]
    loss: str = "squares"
    priors: bool = False

    def values(self, y: Array, held: Array) -> dict[str, Array]:
        """Return every parameter, (L,), at the unknowns y (p, L) and constants (h,)."""
        lanes = y.shape[1:]
        out = dict(zip(self.moving, to_parameter(self.coordinates, y), strict=True))
        return out | {
            name: jnp.broadcast_to(value, lanes)
            for name, value in zip(self.held, held, strict=True)
        }


def structure_parameters(structure: str, thickness_um: float | None) -> tuple[Parameter, ...]:
    """Return the parameters that a structure has beside those of its medium."""
    if structure == INTERFACE:
        return ()
    d = float(thickness_um or 0.0)
    return (Parameter("thickness_um", "um", (0.9 * d, 1.1 * d), 0.0, 1e7, held=d),)


def nuisance_parameter(name: str) -> Parameter:
    """Return range and neutral value of a nuisance, by its bare name."""
    return {
        "scale": Parameter("scale", "", (0.85, 1.1), 1e-3, 1e3, LOG, held=1.0),
        "background": Parameter("background", "", (0.0, 0.0), -0.5, 0.5, held=0.0),
        "angle_offset": Parameter("angle_offset", "deg", (-1.0, 1.0), -20.0, 20.0, held=0.0),
        "leak": Parameter("leak", "", (0.0, 0.05), 0.0, 0.5, held=0.0),
        # A symmetric beam changes a curve by the square of its width.
        "divergence": Parameter("divergence", "deg", (0.1, 2.0), 0.0, 20.0, SQUARE, held=0.0),
    }[name]


def _angles(spec: Spec, v: Mapping[str, Array], points: Points) -> tuple[Array, Any]:
    """Return cosines (Q, M, L), one or several to a beam, and the weights (Q, 1, 1)."""
    angle = jnp.asarray(points.angle_deg)[None]
    if "angle_offset" in v:
        angle = angle + v["angle_offset"]
    weights = jnp.ones((1, 1, 1))
    if "divergence" in v:
        angle = angle + jnp.asarray(_NODES)[:, None, None] * v["divergence"]
        weights = jnp.asarray(_WEIGHTS)[:, None, None]
    # Past 90 degrees or below 0 the plane of incidence is the same one: cos and |cos| say so.
    return jnp.abs(jnp.cos(jnp.radians(angle))), weights


def model_index(spec: Spec, v: Mapping[str, Array], wavelength_um: Any) -> tuple[Array, Array]:
    """Return eta and k, (M, L), at wavelengths (M, 1) or (M, L); NaN where eta is not positive.

    A step of the solver to where a formula has no meaning is refused by it, as the cost is NaN.
    """
    wavelength_um = jnp.asarray(wavelength_um)
    shared = wavelength_um.shape[-1] == 1
    at = wavelength_um[:, 0] if shared else wavelength_um
    own = {name: v[name] for name in _model_names(spec)}
    index = jax.vmap(spec.model.index, in_axes=(0, None if shared else -1), out_axes=-1)(own, at)
    return jnp.where(index.eta > 0.0, index.eta, jnp.nan), index.k


def _model_names(spec: Spec) -> list[str]:
    others = {"thickness_um", *NUISANCES}
    names = (*spec.moving, *spec.held)
    return [n for n in names if n not in others and not n.startswith(PER_CURVE)]


def _instrument(
    spec: Spec, v: Mapping[str, Array], ideal: Mapping[str, Array], points: Points
) -> dict[str, Any]:
    """Return the powers as the detector shows them, from those of perfect light."""
    out = {}
    leak = v.get("leak")
    for channel, curve_of_file in zip(spec.channels, spec.curves, strict=True):
        if channel == NCS:
            continue
        kind = channel[0]
        s, p = ideal[f"{kind}_s"], ideal[f"{kind}_p"]
        share: Any = {"s": 1.0, "p": 0.0}.get(channel.partition("_")[2], points.s_share)
        if leak is not None:
            share = share + (1.0 - 2.0 * share) * leak
        value = p + share * (s - p)
        for name in PER_CURVE:
            if f"{name}_{curve_of_file[0]}" not in v:
                continue
            each = jnp.stack([v[f"{name}_{i}"] for i in curve_of_file])
            term = each[0] if len(curve_of_file) == 1 else each[points.file]
            value = value * term if name == "scale" else value + term
        out[channel] = value
    return out


def predicted(spec: Spec, v: Mapping[str, Array], points: Points, eta_i: Any) -> dict[str, Any]:
    """Return what is seen of each channel, (M, L); of `NCS` a list of three.

    v: every parameter, (L,); a nuisance that is left out is neutral.
    """
    repeated = points.place is not None
    eta, k = model_index(spec, v, points.distinct_um if repeated else points.wavelength_um)
    # Without the barrier XLA repeats the model's formula for every angle and output.
    eta, k = jax.lax.optimization_barrier((eta, k))
    if repeated:
        eta, k = eta[points.place], k[points.place]
    c, weights = _angles(spec, v, points)
    if spec.structure == SLAB:
        both = slab(c, eta, k, v["thickness_um"], points.wavelength_um, eta_i)
    else:
        both = powers(c, eta, k, eta_i)

    def mean(x: Array) -> Array:
        return x[0] if x.shape[0] == 1 else (weights * x).sum(0)

    ideal = {name: mean(x) for name, x in zip(both._fields, both, strict=True)}
    out: dict[str, Any] = _instrument(spec, v, ideal, points)
    if NCS in spec.channels:
        rho = ellipsometric_ratio(c, eta, k, eta_i)
        share = 2.0 / (1.0 + rho.real**2 + rho.imag**2)
        parts = (share - 1.0, rho.real * share, -rho.imag * share)
        if c.shape[0] > 1:
            # cos 2psi of a mixture is that of the summed intensities.
            intensity = both.R_s + both.R_p
            parts = [intensity * x for x in parts]
            total = mean(intensity)
            parts = [x / total for x in map(mean, parts)]
        else:
            parts = [mean(x) for x in parts]
        # Not stacked: XLA computes anew what it joins, and a fit of psi and Delta took 4 times as
        # long.
        out[NCS] = parts
    return out
