"""The unknowns of a fit: parameters of the sample and of the instrument."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from fitting.data.measurement import Measurement
from fitting.data.quantities import POWERS, are_powers
from fitting.optics.instrument import INSTRUMENT, PER_CURVE, largest, with_places, within_slit
from fitting.optics.spec import Media, Spec
from fitting.problem.observations import Observations
from fitting.process.compiled import fit_settings
from fitting.samples.dispersion import Model, Spectrum, absent, wider
from fitting.samples.known_media import Known, MaterialFile, Mixture, known_medium
from fitting.samples.parameters import LOG, Parameter, Settings, Unknown, check_tie
from fitting.samples.sample import Medium, Sample
from fresnel_jax.dispersion import HC_EV_UM


class Unknowns(NamedTuple):
    """The unknowns in the order of y, the constants, and the names that are shown.

    moving: one `Unknown` for each of ``spec.moving``; held: values of ``spec.held``. labels:
    internal name -> shown name (``scale_0`` is ``scale[R_s]``, or ``scale`` if there is one curve;
    ``substrate.A`` is ``A`` if no other medium has parameters); others are not shown. units: by the
    internal name.
    """

    spec: Spec
    moving: tuple[Unknown, ...]
    held: np.ndarray
    labels: dict[str, str]
    units: dict[str, str]

    @property
    def free(self) -> np.ndarray:
        """Which of the moving parameters are free, (p,)."""
        return np.array([u.free for u in self.moving], bool)

    @property
    def own_names(self) -> list[str]:
        """The names of the unknowns, "" of those that the model does not have."""
        return [name if name in self.labels else "" for name in self.spec.moving]

    @property
    def size(self) -> int:
        """The number p of moving parameters."""
        return len(self.moving)


def terms_of(names: Sequence[str], head: str = "") -> list[list[int]]:
    """Return the indices of the parameters of each numbered term of a medium, or of all."""
    terms: dict[str, list[int]] = {}
    for i, name in enumerate(names):
        place, _, own = name.rpartition(".")
        stem, _, number = own.rpartition("_")
        if name.startswith(head) and number.isdigit() and stem.split("_")[0] in (
            "strength", "resonance", "width", "amplitude"
        ):  # fmt: skip
            terms.setdefault(f"{place}{number}", []).append(i)
    return list(terms.values())


def index_outside(sample: Sample, wavelength_um: Any) -> Any:
    """Return the index of the first medium: a number, or an array over wavelengths."""
    index = sample.media[0].index
    if isinstance(index, complex):
        return np.float64(index.real)
    with fit_settings():  # otherwise the wavelengths and the index would be float32
        return np.asarray(known_medium(index)(np.asarray(wavelength_um)).eta)  # type: ignore


def spectrum_of(measurements: Sequence[Measurement], sample: Sample) -> Spectrum:
    """Return the properties of the data on which the ranges of starts depend."""
    wavelength = np.concatenate([m.wavelength_um for m in measurements])
    known = wavelength[np.isfinite(wavelength)]
    low, high = (float(known.min()), float(known.max())) if len(known) else (1.0, 1.0)
    ellipsometry = not all(are_powers(m.quantity).all() for m in measurements)
    outside = float(np.mean(index_outside(sample, known if len(known) else np.ones(1))))
    step = float(np.diff(np.unique(HC_EV_UM / known)).min(initial=np.inf))
    return Spectrum(low, high, outside, sample.bare and not ellipsometry, step)


def spec_at(spec: Spec, angle_deg: np.ndarray) -> Spec:
    """Return the spec at these angles: if all are 0, what s shows is that of both."""
    names = {*spec.moving, *spec.held, *(name for name, _, _ in spec.tied)}
    tilted = np.any(angle_deg) or {"angle_offset", "divergence"} & names
    normal = spec.only_powers and not tilted
    return spec._replace(media=spec.media._replace(normal=normal))


class _Offered(NamedTuple):
    """A parameter that a fit may have. quiet: shown only if there is a setting for it.

    label: "" for a parameter of the wider model of the program that the model itself does not have.
    """

    parameter: Parameter
    label: str
    quiet: bool = False


def _of_model(
    model: Model, place: str, prefix: str, spectrum: Spectrum, shared: bool
) -> list[_Offered]:
    """Return the parameters of a model; those that it does not have are without effect."""
    own = {p.name: p for p in model.parameters(spectrum)}
    out = []
    for p in (wider(model) if shared else model).parameters(spectrum):
        name = f"{place}.{p.name}"
        if p.name in own:
            out.append(_Offered(own[p.name]._replace(name=name), prefix + p.name))
        elif p.held is None:
            x = absent(p)
            out.append(_Offered(p._replace(name=name, low=x, high=x, held=x), "", True))
        else:
            out.append(_Offered(p._replace(name=name), prefix + p.name, True))
    return out


def _of_medium(
    medium: Medium, place: str, prefix: str, spectrum: Spectrum, shared: bool
) -> list[_Offered]:
    """Return the parameters of a medium: those of its index, and its thickness."""
    out = []
    model = medium.model
    if isinstance(medium.index, complex):
        eta, k = Model("constant", 1).parameters(spectrum)
        for p, value in ((eta, medium.index.real), (k, medium.index.imag)):
            out.append(_Offered(p._replace(name=f"{place}.{p.name}", held=value),
                                f"{place}.{p.name}", True))  # fmt: skip
    elif model is not None:
        of_model = _of_model(model, place, prefix, spectrum, shared)
        film = medium.thickness is not None and medium.thickness.coherent
        if film and isinstance(medium.index, Model) and model.name == "constant" and not shared:
            # A film of one index is clear unless its k is asked for: at a few angles thickness and
            # k take up each other's misfit.
            of_model[1] = of_model[1]._replace(parameter=of_model[1].parameter._replace(held=0.0))
        out += of_model
    if isinstance(medium.index, Mixture):
        for name, share in zip(medium.index.fractions, medium.index.shares, strict=False):
            out.append(_Offered(
                Parameter(f"{place}.{name}", "", (share.low, share.high), share.low, share.high,
                          held=share.start if share.held else None),
                prefix + name, share.held,
            ))  # fmt: skip
    if medium.thickness is not None and medium.thickness.graded:
        out.append(_Offered(Parameter(f"{place}.grade", "", (-0.1, 0.1), -1.0, 1.0),
                            f"{prefix}grade"))  # fmt: skip
    if medium.thickness is not None:
        d = medium.thickness
        name, size = ("thickness_nm", 1e3) if d.coherent else ("thickness_um", 1.0)
        ranged = d.low_um > 0.0
        wide = 0.5 if d.coherent else 0.1
        low, high = (d.low_um, d.high_um) if ranged else (0.0, 1e7)
        start = (low, high) if ranged else ((1.0 - wide) * d.start_um, (1.0 + wide) * d.start_um)
        out.append(_Offered(
            Parameter(
                f"{place}.{name}", d.unit, (start[0] * size, start[1] * size), low * size,
                high * size, held=d.start_um * size if d.held else None,
                decades=start[1] > 10.0 * start[0] > 0.0,
            ),
            prefix + name,
        ))  # fmt: skip
    return out


def media_of(sample: Sample, spectrum: Spectrum | None = None, shared: bool = False) -> Media:
    """Return what a compiled program needs of a sample; shared: as in `Settings`."""
    index: list[Model | Mixture | Known] = []
    for medium in sample.media[1:]:
        if isinstance(medium.index, complex):
            index.append(Model("constant", 1))
        elif isinstance(medium.index, Mixture) or medium.model is None:
            index.append(medium.index)  # type: ignore
        else:
            model = wider(medium.model) if shared else medium.model
            index.append(model.over(spectrum) if spectrum else model)
    layers = [m.thickness for m in sample.layers if m.thickness]
    coherent = tuple(d.coherent for d in layers)
    closed = sample.media[-1].index == sample.media[0].index
    graded = tuple(d.graded for d in layers)
    first = sample.media[0].index
    return Media(
        tuple(index), sample.places[1:], coherent, bool(coherent) and closed, graded,
        outside=first if isinstance(first, str | MaterialFile) else None,
    )  # fmt: skip


def _of_instrument(settings: Settings, seen: Observations) -> list[_Offered]:
    """Return the instrument parameters with a setting; some have one for each curve."""
    bare = {name.partition("[")[0] for name in settings.names}
    powers = [c for c in seen.channels if c in POWERS]
    curves = sorted({
        i for c, own in zip(seen.channels, seen.curves, strict=True) if c in powers for i in own
    })  # fmt: skip
    out = []
    for name in INSTRUMENT:
        if name not in bare:
            continue
        if name in (*PER_CURVE, "leak") and not powers:
            raise ValueError(f"{name} acts on powers (R, T), and none was measured; leave it out.")
        parameter = INSTRUMENT[name]
        if name not in PER_CURVE:
            out.append(_Offered(parameter, name))
            continue
        for i in curves:
            label = name if len(curves) == 1 else f"{name}[{seen.curve_names[i]}]"
            out.append(_Offered(parameter._replace(name=f"{name}_{i}"), label))
    return out


def _names_of(label: str) -> tuple[str, ...]:
    """Return the names that include a label: scale[a.csv R_p], scale[R_p] of all files, scale."""
    bare, bracket, curve = label.partition("[")
    return label, bare + bracket + curve.rpartition(" ")[2], bare


def _said(table, label: str):
    """Return the setting of a label, by the most specific of its names; None if there is none."""
    return next((table[name] for name in _names_of(label) if name in table), None)


# Parameters whose range (of the measured energies, of clear media) is for searches.
_SEARCHED = re.compile(
    r"\.([A-H]|(plasma|width|resonance|strength|amplitude|gap|urbach)_ev2?(_\d+)?)$"
)
_SIGNED = re.compile(r"\.[B-H]$")  # which may be negative where bounds or a value say so


def unknown_of(parameter: Parameter, label: str, settings: Settings) -> tuple[Unknown, bool]:
    """Return the unknown, and whether it is a constant (fixed in all fits of the program)."""
    value = _said(settings.fixed, label)
    low, high = parameter.low, parameter.high
    floor = 0.0 if low >= 0.0 and not _SIGNED.search(parameter.name) else -math.inf
    bounds, prior = _said(settings.bounds, label), _said(settings.priors, label)
    asked = any(name in settings.free for name in _names_of(label))
    asked = asked or bounds is not None or prior is not None
    if value is None and parameter.held is not None and not asked:
        value = parameter.held
    if value is not None:
        if _SEARCHED.search(parameter.name):
            low, high = floor, math.inf
        if not low <= value <= high or (parameter.coordinate == LOG and value <= 0.0):
            raise ValueError(
                f"{label} is fixed at {value:g}; a value from {low:g} to {high:g} was wanted."
            )
        constant = parameter.held is not None and label.partition("[")[0] not in settings.variants
        return Unknown(parameter, value, value), constant
    if bounds is not None:
        # The model's range is used only where no bound is given; a lower end of 0 is kept.
        least, most = max(bounds[0], floor), bounds[1]
        least = low if math.isinf(bounds[0]) else least
        most = high if math.isinf(most) else most
        if not least < most:
            ends = f"{bounds[0]:g} to {bounds[1]:g}"
            side = f"from {floor:g} on" if bounds[1] <= floor else f"from {low:g} to {high:g}"
            raise ValueError(f"the bounds {ends} leave no value of {label}, which lies {side}.")
        low, high = least, most
    return Unknown(parameter, low, high, prior), False


def _by_label(settings: Settings, offered: Sequence[_Offered], sample: Sample) -> Settings:
    """Return the settings with every name as it is shown; ValueError for an unknown name."""
    known = {name for o in offered for name in _names_of(o.label)}
    full = {o.parameter.name: o.label for o in offered if "." in o.parameter.name}
    names = {name: full.get(name, name) for name in settings.names}
    for name, label in names.items():
        if label not in known:
            shown = sorted({o.label for o in offered if not o.quiet} | set(INSTRUMENT))
            raise ValueError(
                f"the sample {str(sample)!r} has no parameter {name!r}; it has {', '.join(shown)}."
            )
    return Settings(
        tuple(names[n] for n in settings.free),
        {names[n]: v for n, v in settings.fixed.items()},
        {names[n]: v for n, v in settings.bounds.items()},
        {names[n]: v for n, v in settings.priors.items()},
        {names[n]: (factor, names[of]) for n, (factor, of) in settings.tie.items()},
        settings.variants, settings.shared,
    )  # fmt: skip


def unknowns(
    sample: Sample, spectrum: Spectrum, settings: Settings, seen: Observations, loss: str
) -> Unknowns:
    """Return the unknowns of a fit, or raise ValueError for a name that it does not have."""
    offered = _of_instrument(settings, seen)
    media = zip(sample.media[1:], sample.places[1:], sample.prefixes[1:], strict=True)
    offered = [
        o for m, p, x in media for o in _of_medium(m, p, x, spectrum, settings.shared)
    ] + offered
    said = _by_label(settings, offered, sample)
    by_label = {o.label: o.parameter for o in offered}
    inside = {label: p.name for label, p in by_label.items()}
    moving, held, tied = [], [], []
    for o in offered:
        if not o.label:
            moving.append(Unknown(o.parameter, o.parameter.low, o.parameter.high))
            continue
        if o.label in said.tie:
            factor, of = said.tie[o.label]
            if of in said.tie:
                raise ValueError(f"{o.label} is tied to {of}, which is tied itself.")
            if of not in inside:
                raise ValueError(
                    f"{o.label} is tied to {of}, which stands for several parameters; name one of "
                    f"them, for example {next(x for x in inside if x.startswith(of))}."
                )
            check_tie(o.label, factor, o.parameter, by_label[of])
            tied.append((o.parameter.name, factor, inside[of]))
            continue
        unknown, constant = unknown_of(o.parameter, o.label, said)
        (held if constant else moving).append(within_slit(unknown, seen.points))
    spec = Spec(
        media=media_of(sample, spectrum, settings.shared),
        channels=seen.channels,
        moving=tuple(u.parameter.name for u in moving),
        coordinates=tuple(u.parameter.coordinate for u in moving),
        held=tuple(u.parameter.name for u in held),
        curves=seen.curves,
        tied=tuple(tied),
        loss=loss,
        priors=any(u.prior is not None for u in moving),
    )
    spec = spec_at(spec, seen.points.angle_deg)
    spec = with_places(spec, largest([*moving, *held]), seen.points, spectrum.eta_i)
    mentioned = {name.partition("[")[0] for name in said.names} | set(said.names)
    labels = {
        o.parameter.name: o.label for o in offered if not o.quiet or o.label in mentioned
    }  # fmt: skip
    units = {o.parameter.name: o.parameter.unit for o in offered}
    return Unknowns(spec, tuple(moving), np.array([u.low for u in held]), labels, units)
