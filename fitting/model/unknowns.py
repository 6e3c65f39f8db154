"""What is unknown in a model fit: parameters of model, structure and instrument as asked for."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fitting.checks import one_number
from fitting.measurement import Measurement
from fitting.model.dispersion import Model, Spectrum
from fitting.model.multistart import Unknown
from fitting.model.observations import Observations
from fitting.model.parameters import LOG, Parameter, Settings
from fitting.model.structures import (
    INTERFACE,
    NCS,
    NUISANCES,
    PER_CURVE,
    SLAB,
    STRUCTURES,
    Spec,
    nuisance_parameter,
    structure_parameters,
)


class Unknowns(NamedTuple):
    """The unknowns in the order of y, the constants, and the names that a person sees.

    moving: one `Unknown` for each of ``spec.moving``; held: values of ``spec.held``. labels: name
    inside -> name outside (``scale_0`` is ``scale[R_s]``, or ``scale`` if there is one curve).
    """

    spec: Spec
    moving: tuple[Unknown, ...]
    held: np.ndarray
    labels: dict[str, str]

    @property
    def free(self) -> np.ndarray:
        """Which of the moving parameters are free, (p,)."""
        return np.array([u.free for u in self.moving], bool)


def check_quantities(measurements: Sequence[Measurement], model: Model, structure: str) -> None:
    """Raise ValueError where the model cannot say what was measured."""
    if structure not in STRUCTURES:
        raise ValueError(f"structure is {structure!r}; one of {', '.join(STRUCTURES)} was wanted.")
    for m in measurements:
        quantities = set(m.quantity.tolist())
        if structure == INTERFACE and "R_back" in quantities:
            raise ValueError(
                f"{m.source}: R_back is light from the other face, which a bare interface does not "
                "have. Fit a slab, with its thickness (--slab MILLIMETRES), or leave the column "
                "out."
            )
        if structure == SLAB and quantities & {"psi", "delta"}:
            raise ValueError(
                f"{m.source}: psi and Delta of a slab with both faces are not fitted, since light "
                "from its back face has no definite phase. Fit R and T, or one bare interface."
            )
        if (structure == SLAB or model.name != "constant") and np.isnan(m.wavelength_um).any():
            what = "a slab absorbs" if structure == SLAB else f"the model {model} varies"
            raise ValueError(
                f"{m.source}: {what} with the wavelength, which is not known here; give it "
                "(--wavelength-um)."
            )


def spectrum_of(measurements: Sequence[Measurement], structure: str, eta_i: float) -> Spectrum:
    """Return what the ranges of starts depend on."""
    wavelength = np.concatenate([m.wavelength_um for m in measurements])
    known = wavelength[np.isfinite(wavelength)]
    low, high = (float(known.min()), float(known.max())) if len(known) else (1.0, 1.0)
    ellipsometry = any(np.isin(m.quantity, ("psi", "delta")).any() for m in measurements)
    return Spectrum(low, high, eta_i, structure == INTERFACE and not ellipsometry)


def _nuisances(settings: Settings, seen: Observations) -> tuple[list[Parameter], dict[str, str]]:
    """Return the nuisances that are mentioned, one for each curve where they are, and labels."""
    bare = {name.partition("[")[0] for name in settings.names}
    powers = [c for c in seen.channels if c != NCS]
    curves = sorted({
        i for c, own in zip(seen.channels, seen.curves, strict=True) if c in powers for i in own
    })  # fmt: skip
    out, labels = [], {}
    for name in NUISANCES:
        if name not in bare:
            continue
        if name in (*PER_CURVE, "leak") and not powers:
            raise ValueError(
                f"{name} acts on powers (R, T), and only psi and Delta were measured; leave it out."
            )
        parameter = nuisance_parameter(name)
        if name not in PER_CURVE:
            out.append(parameter)
            continue
        for i in curves:
            label = name if len(curves) == 1 else f"{name}[{seen.curve_names[i]}]"
            out.append(parameter._replace(name=f"{name}_{i}"))
            labels[f"{name}_{i}"] = label
    return out, labels


def _said(table, label: str):
    """Return what is said about a label, by itself or by its bare name; None for nothing."""
    if label in table:
        return table[label]
    return table.get(label.partition("[")[0])


def _unknown(parameter: Parameter, label: str, settings: Settings) -> tuple[Unknown, bool]:
    """Return the unknown, and whether it is a constant (held and never asked to be free)."""
    value = _said(settings.fixed, label)
    low, high = parameter.low, parameter.high
    bounds, prior = _said(settings.bounds, label), _said(settings.priors, label)
    asked = label in settings.free or label.partition("[")[0] in settings.free
    asked = asked or bounds is not None or prior is not None
    if value is None and parameter.held is not None and not asked:
        value = parameter.held
    if value is not None:
        if not low <= value <= high or (parameter.coordinate == LOG and value <= 0.0):
            raise ValueError(
                f"{label} is held at {value:g}; a value from {low:g} to {high:g} was wanted."
            )
        return Unknown(parameter, value, value), parameter.held is not None
    if bounds is not None:
        # Only where nothing is said the model's own range holds; 0 is an end for what has one.
        floor = 0.0 if low >= 0.0 else -math.inf
        least, most = max(bounds[0], floor), bounds[1]
        least = low if math.isinf(bounds[0]) else least
        most = high if math.isinf(most) else most
        if not least < most:
            raise ValueError(f"the range of {label} is {least:g} to {most:g}: nothing is left.")
        low, high = least, most
    return Unknown(parameter, low, high, prior), False


def unknowns(
    model: Model,
    structure: str,
    spectrum: Spectrum,
    thickness_um: float | None,
    settings: Settings,
    seen: Observations,
    loss: str,
) -> Unknowns:
    """Return the unknowns of a fit, or raise ValueError for a name that it does not have."""
    if structure == SLAB and thickness_um is None:
        said = {**settings.fixed, **settings.priors, **settings.bounds}.get("thickness_um")
        if said is None:
            raise ValueError("a slab needs its thickness: thickness_um=..., or --slab MILLIMETRES.")
        thickness_um = said if isinstance(said, float) else sum(said) / 2.0
        if "thickness_um" in settings.priors:
            thickness_um = settings.priors["thickness_um"][0]
    if structure == SLAB:
        one_number("thickness_um", thickness_um, "the thickness of a slab", 1e-6, 1e9)
    nuisances, labels = _nuisances(settings, seen)
    parameters = [
        *model.parameters(spectrum), *structure_parameters(structure, thickness_um), *nuisances
    ]  # fmt: skip
    labels = {p.name: labels.get(p.name, p.name) for p in parameters}
    known = {label for full in labels.values() for label in (full, full.partition("[")[0])}
    for name in settings.names:
        if name not in known:
            others = sorted(known | set(NUISANCES))
            raise ValueError(
                f"{model} on {'a slab' if structure == SLAB else 'a bare interface'} has no "
                f"parameter {name!r}; it has {', '.join(others)}."
            )
    moving, held = [], []
    for parameter in parameters:
        unknown, constant = _unknown(parameter, labels[parameter.name], settings)
        (held if constant else moving).append(unknown)
    spec = Spec(
        model=model,
        structure=structure,
        channels=seen.channels,
        moving=tuple(u.parameter.name for u in moving),
        coordinates=tuple(u.parameter.coordinate for u in moving),
        held=tuple(u.parameter.name for u in held),
        curves=seen.curves,
        loss=loss,
        priors=any(u.prior is not None for u in moving),
    )
    return Unknowns(spec, tuple(moving), np.array([u.low for u in held]), labels)
