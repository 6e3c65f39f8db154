"""What a dispersion model shows at points of one's own: simulated measurements."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import jax
import numpy as np

from fitting.dispersion import Model, Spectrum, parse_model
from fitting.observations import padded
from fitting.observe import INTERFACE, NCS, NUISANCES, PER_CURVE, SLAB, Points, Spec
from fitting.parameters import plain_name
from fitting.problem import shown


def predict(
    model: str | Model,
    parameters: Mapping[str, float],
    angle_deg: Any,
    wavelength_um: Any,
    quantity: Any,
    *,
    structure: str = INTERFACE,
    eta_i: float = 1.0,
) -> np.ndarray:
    """Return what a model shows at points, (N,): powers as fractions, psi and Delta in degrees.

    parameters: name -> value of every parameter of the model (those that are held by themselves
    and nuisances, by their bare names, may be left out). angle_deg, wavelength_um, quantity
    broadcast to one axis of points. Raises ValueError for a name too many or too few.
    """
    which = parse_model(model)
    at = np.atleast_1d(np.asarray(angle_deg, float)), np.asarray(wavelength_um, float)
    angle, wavelength, quantities = np.broadcast_arrays(*at, np.asarray(quantity))
    given = {plain_name(n): float(v) for n, v in parameters.items()}
    low, high = float(wavelength.min()), float(wavelength.max())
    spectrum = Spectrum(low, high, eta_i)
    all_of = {p.name: p.held for p in which.parameters(spectrum)}
    if structure == SLAB:
        all_of["thickness_um"] = None
    for name in given:
        if name not in all_of and name not in NUISANCES:
            raise ValueError(f"{which} has no parameter {name!r}; it has {', '.join(all_of)}.")
    missing = [n for n, held in all_of.items() if held is None and n not in given]
    if missing:
        raise ValueError(f"{which} needs a value of {', '.join(missing)}.")
    values = {n: v for n, v in all_of.items() if v is not None} | given
    held = {f"{n}_0" if n in PER_CURVE else n: v for n, v in values.items()}
    names = [("NCS" if q in ("psi", "delta") else str(q)) for q in quantities]
    channels = tuple(dict.fromkeys([n for n in names if n != NCS])) + (
        (NCS,) if NCS in names else ()
    )
    spec = Spec(which, structure, channels, (), (), tuple(held), ((0,),) * len(channels))
    count = len(angle)
    total = padded(count)
    rows = [np.pad(a, (0, total - count), mode="edge")[:, None] for a in (angle, wavelength)]
    points = Points(rows[0], rows[1], np.full((total, 1), 0.5), np.zeros(total, np.int32))
    with jax.enable_x64(True):
        found = np.asarray(
            shown(points, np.array(list(held.values())), np.float64(eta_i), spec=spec)
        )[:, :count]
    out = np.empty(count)
    for i, (n, q) in enumerate(zip(names, quantities, strict=True)):
        if n == NCS:
            N, C, S = found[-3:, i]
            psi, delta = 0.5 * np.arctan2(np.hypot(C, S), N), np.arctan2(S, C) % (2.0 * np.pi)
            out[i] = np.degrees(psi if q == "psi" else delta)
        else:
            out[i] = found[channels.index(n), i]
    return out
