"""Why a sample does not describe the data: the instrument, a layer unasked, files that differ."""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.special import chdtrc

from fitting.data.measurement import Measurement
from fitting.data.quantities import are_powers
from fitting.data.scatter import LEAST_VALUES, differences
from fitting.optics.instrument import INSTRUMENT
from fitting.outcomes.findings import with_headline
from fitting.problem.observations import labels_of
from fitting.problem.problem import FitOptions
from fitting.residuals.error_model import beyond_chance
from fitting.residuals.residuals import weighted_residuals
from fitting.results.diagnostics import Finding, Warning, ranked
from fitting.results.result import FitData
from fitting.results.result_parts import AT_LOWER, AT_UPPER, CONVERGED, DETERMINED, MISFIT
from fitting.samples.dispersion import Model
from fitting.samples.known_media import BETWEEN, lossless
from fitting.samples.parameters import Settings
from fitting.samples.sample import Sample
from fitting.uncertainty.intervals import QUADRATIC
from fitting.uncertainty.likelihood import MARGIN
from fitting.uncertainty.widening import widened


class _Cause(NamedTuple):
    """What may be wrong: its name, the sample with it, and which parameter it sets free.

    quiet: values of this and of like parameters where they have no effect; they share one program.
    """

    name: str
    sample: Sample
    free: str = ""
    quiet: Mapping[str, float] = {}
    bounds: tuple[float, float] | None = None


# A layer that a surface may have unasked (an oxide, water, roughness): its index, nanometres.
_LAYER, _THIN = "1.46", (0.0, 30.0)


def _of_instrument(m: Measurement, sample: Sample, settings: Settings) -> list[_Cause]:
    """Return what of the instrument may be wrong, and the index of a substrate that is a number."""
    powers, oblique = are_powers(m.quantity), bool((m.angle_deg > 0.0).any())
    split = np.char.find(m.quantity[powers], "_") >= 0
    spectrum, last = len(np.unique(m.wavelength_um)) > 1, sample.media[-1].index
    there = {
        "angle_offset": oblique, "scale": powers.any(), "background": powers.any(),
        "leak": oblique and split.any(), "wavelength_offset": spectrum,
    }  # fmt: skip
    quiet = {n: float(INSTRUMENT[n].held or 0.0) for n, so in there.items() if so}
    bounds = {}
    if sample.films and isinstance(last, complex) and last != sample.media[0].index:
        quiet["substrate.eta"] = last.real
        bounds["substrate.eta"] = 0.9 * last.real, 1.1 * last.real
    mentioned = {name.partition("[")[0] for name in settings.names}
    quiet = {n: x for n, x in quiet.items() if n not in mentioned}
    out = [_Cause(n, sample, n, quiet, bounds.get(n)) for n in quiet]
    if sample.films and spectrum and "bandwidth" not in mentioned:
        # by itself, and only where nothing else will do: it takes eleven wavelengths at each datum
        out.append(_Cause("bandwidth", sample, "bandwidth", {"bandwidth": 0.0}))
    return out


def _of_sample(m: Measurement, sample: Sample, settings: Settings) -> list[_Cause]:
    """Return what a sample may have unasked: a layer, a gradient, a back face."""
    coherent = all(x.thickness and x.thickness.coherent for x in sample.layers)
    named = any(x.index in BETWEEN.values() for x in sample.layers)  # by what is beside them
    if settings.names or not coherent or named or not np.isfinite(m.wavelength_um).all():
        return []
    (first, *films, last), index = map(str, sample.media), sample.media[-1].index
    even = [x for x in sample.layers if isinstance(x.index, Model) and " graded" not in str(x)]
    graded = [f"{films[0]} graded"] if len(even) == len(films) == 1 else []
    layer, thin, what = f"{_LAYER} 10 nm", f"{_LAYER} 0.2..30 nm", f"a layer of index {_LAYER}"
    both = [first, layer, *(graded or films), *[layer] * bool(films), last]
    whole = Sample.parse(" | ".join(both))
    unasked = [(f"{what} on top", [thin, *films], f"{whole.places[1]}.thickness_nm", _THIN)]
    if films:
        below = f"{whole.places[-2]}.thickness_nm"
        unasked.append((f"{what} on the substrate", [*films, thin], below, _THIN))
    if graded:
        slope = f"{whole.places[2]}.grade"
        unasked.append(("a gradient of the index", graded, slope, (-0.5, 0.5)))
    quiet = {name: 0.0 for *_, name, _ in unasked}
    out = []
    for what, text, name, bounds in unasked:
        said = f"{what}, in the sample '{' | '.join([first, *text, last])}'"
        out.append(_Cause(said, whole, name, quiet, bounds))
    clear = not index.absorbs if isinstance(index, Model) else lossless(index)
    if clear and index != sample.media[0].index and are_powers(m.quantity).all():
        text = " | ".join([first, *films, f"{last} 1 mm thick", first])
        out.append(_Cause(f"a back face, in the sample '{text}'", Sample.parse(text)))
    return out


# Of right fits one in twenty has a chi2 for which a cause is looked for, and few find one.
_DOUBTED, _ENDS = 0.05, {AT_LOWER, AT_UPPER}


def explained(
    run: Callable[[Sample, Settings, FitOptions], FitData],
    sample: Sample, settings: Settings, asked: FitOptions, found: FitData,
) -> FitData:  # fmt: skip
    """Return a misfit, and what of the instrument or of the sample describes its data better.

    run: fits the measurements. Each cause is fitted beside all unknowns, and compared by BIC. That
    tells more than chi2 alone: chi2/dof of 1.3 with a cause that lowers it is a misfit, too.
    """
    m = found.measurement
    if found.shape or m is None:
        return found
    doubted = found.errors.stated and found.status == CONVERGED and found.loss == "squares"
    doubted = doubted and beyond_chance(found.chi2_reduced, found.dof, _DOUBTED)[0]
    if found.status != MISFIT and not doubted:
        return found
    errors = "scaled" if found.errors.stated else "equal"
    how = asked._replace(errors=errors, intervals=QUADRATIC, thorough=False, near=asked.kept_as)
    how = how._replace(start=None)  # its names are those of this sample

    def fitted(c: _Cause) -> FitData:
        held = {n: x for n, x in c.quiet.items() if n != c.free}
        freed = settings._replace(
            free=(*settings.free, c.free) if c.free else settings.free,
            fixed={**settings.fixed, **held}, variants=tuple(c.quiet),
            bounds={**settings.bounds, **({c.free: c.bounds} if c.bounds else {})},
        )  # fmt: skip
        return with_headline(widened(run(c.sample, freed, how._replace(kept_as=c.name))))

    causes = _of_instrument(m, sample, settings) + _of_sample(m, sample, settings)
    least, good = fitted(_Cause("", sample)).bic - MARGIN, []
    for c in sorted(causes, key=lambda c: c.free == "bandwidth"):
        if c.free == "bandwidth" and any(f.status == CONVERGED for _, f in good):
            break
        with contextlib.suppress(ValueError):  # some data are not those of such a sample
            f = fitted(c)
            good += [(c, f)] if f.status in DETERMINED and f.bic < least else []
    # What describes the data is named alone; else what comes nearest within its range.
    good = [t for t in good if t[1].status == CONVERGED] or [
        (c, f) for c, f in good
        if not {e.status for n, e in f.parameters.items() if n.partition("[")[0] == c.free} & _ENDS
    ]  # fmt: skip
    good.sort(key=lambda t: t[1].bic)
    said = []
    for c, f in [t for t in good if t[1].bic <= good[0][1].bic + MARGIN]:
        new = {n: f.parameters[n] for n in f.names if n.partition("[")[0] in c.quiet}
        own = [f.parameters[n] for n in f.names if n not in new]
        after = dict(zip(found.names, own, strict=True))
        if c.sample is not sample:  # the sample that is named has other names
            new = {n.rpartition(".")[2]: e for n, e in new.items()}
        each = [
            {n: tuple(map(float, (e.value, e.sigma, *e.interval))) for n, e in of.items()}
            for of in (new, after)
        ]
        said.append((c.name, f.rms, f.status == CONVERGED, *each))
    if not said:
        # What chance gives in one fit of a thousand is told already, or the errors are corrected.
        if found.status == MISFIT or beyond_chance(found.chi2_reduced, found.dof)[0]:
            return found
        chance = float(chdtrc(found.dof, found.dof * found.chi2_reduced))
        values = {"chi2_reduced": float(found.chi2_reduced), "one_in": round(1.0 / chance)}
        told = Finding("chi2_doubtful", np.True_, values)
        return replace(found, findings=ranked([*found.findings, told]))
    told = Finding("explained_by", np.True_, {"explanations": said})
    return replace(found, status=MISFIT, findings=ranked([*found.findings, told]))


def misses_of_files(measurements: Sequence[Measurement], found: FitData) -> tuple[Warning, ...]:
    """Return the note on the residuals of each of several files."""
    if len(measurements) == 1 or found.measurement is None:
        return ()
    off = weighted_residuals(found.measurement, found.fitted, found.errors.stated)
    each = np.split(off, np.cumsum([len(m) for m in measurements])[:-1])
    files = labels_of([m.source for m in measurements])
    pairs = itertools.combinations(zip(files, measurements, strict=True), 2)
    compared = ((one, other, *_difference(a, b)) for (one, a), (other, b) in pairs)
    values = {
        "files": files, "n_data": [len(r) for r in each],
        "rms": [float(np.sqrt(np.mean(r**2))) for r in each], "stated": found.errors.stated,
        # The noise is estimated, too, from differences that share data: as from a third as many.
        "contradictory": [p for p in compared if beyond_chance(p[2] ** 2, p[3] / 3.0)[0]],
    }  # fmt: skip
    return (Warning("residuals_of_files", {}, values),)


def _difference(a: Measurement, b: Measurement) -> tuple[float, int]:
    """Return by how many times their noise two files differ (rms), and at how many common points.

    The noise is that of the stated errors, or the scatter of the differences over the curve.
    """
    columns = "angle_deg", "wavelength_um", "polarizer_deg"
    keys = [
        [*zip(m.quantity.tolist(), *(np.nan_to_num(getattr(m, c), nan=-1.0).tolist()
                                     for c in columns), strict=True)]
        for m in (a, b)
    ]  # fmt: skip
    place = {key: j for j, key in enumerate(keys[1])}
    both = [(i, place[key]) for i, key in enumerate(keys[0]) if key in place]
    i, j = np.array(both, int).reshape(-1, 2).T
    off, noise = b.value[j] - a.value[i], np.hypot(a.sigma[i], b.sigma[j])
    off = np.where(a.quantity[i] == "delta", (off + 180.0) % 360.0 - 180.0, off)
    spectral = len(np.unique(a.wavelength_um[i])) > 1
    axis = (a.wavelength_um if spectral else a.angle_deg)[i]
    for q in np.unique(a.quantity[i]) if np.isnan(noise).any() else ():
        rows = a.quantity[i] == q
        if rows.sum() >= LEAST_VALUES:
            rough = differences(axis[None, rows], off[None, rows], 3)
            noise[rows] = np.sqrt(np.mean(rough**2))
    known = noise > 0.0
    count = int(known.sum())
    return float(np.sqrt(np.mean((off[known] / noise[known]) ** 2))) if count else 0.0, count
