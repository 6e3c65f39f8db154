"""Why a sample does not describe the data: the instrument, a layer unasked, files that differ."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from fitting.data.measurement import Measurement
from fitting.data.quantities import are_powers
from fitting.data.scatter import LEAST_VALUES, differences
from fitting.optics.instrument import INSTRUMENT
from fitting.problem.observations import labels_of
from fitting.problem.problem import FitOptions
from fitting.residuals.error_model import beyond_chance
from fitting.residuals.residuals import weighted_residuals
from fitting.results.diagnostics import Finding, Warning, ranked
from fitting.results.result import FitData
from fitting.results.result_parts import CONVERGED, DETERMINED, MISFIT
from fitting.samples.parameters import Settings
from fitting.samples.sample import Sample
from fitting.uncertainty.intervals import QUADRATIC
from fitting.uncertainty.likelihood import MARGIN


def _imperfections(m: Measurement, settings: Settings) -> tuple[str, ...]:
    """Return the parameters of the instrument that might explain a misfit of such data."""
    powers, oblique = are_powers(m.quantity), (m.angle_deg > 0.0).any()
    names = ["angle_offset"] * bool(oblique)
    names += ["scale", "background"] * bool(powers.any())
    split = np.char.find(m.quantity[powers], "_") >= 0
    names += ["leak"] * bool(oblique and split.any())
    names += ["wavelength_offset"] * (len(np.unique(m.wavelength_um)) > 1)
    mentioned = {name.partition("[")[0] for name in settings.names}
    return tuple(n for n in names if n not in mentioned)


# A layer that a surface may have unasked (an oxide, water, roughness), by its index and thickness.
_COVER = "1.46", "0.2..30 nm"


def explained(
    run: Callable[[Sample, Settings, FitOptions], FitData], measurements: Sequence[Measurement],
    sample: Sample, settings: Settings, asked: FitOptions, found: FitData,
) -> FitData:  # fmt: skip
    """Return a misfit, and what of the instrument or which layer describes its data better.

    run: fits the measurements. Each is fitted beside all unknowns, and compared by BIC; those of
    the instrument share one program.
    """
    m = found.measurement
    if found.shape or found.status != MISFIT or m is None:
        return found
    names = _imperfections(m, settings)
    errors = "scaled" if found.errors.stated else "equal"
    how = asked._replace(errors=errors, intervals=QUADRATIC, thorough=False, near=asked.kept_as)
    how = how._replace(start=None)  # its names are those of this sample

    def fitted(name: str, sample: Sample = sample, free: tuple[str, ...] = ()) -> FitData:
        quiet = {n: float(INSTRUMENT[n].held or 0.0) for n in names if n not in free}
        freed = settings._replace(
            free=(*settings.free, *free), fixed={**settings.fixed, **quiet}, variants=tuple(quiet)
        )
        return run(sample, freed, how._replace(kept_as=name))

    own = found.names
    tried = [(name, fitted(name, free=(name,)), own) for name in names]
    if not settings.names and np.isfinite(m.wavelength_um).all():
        first, *rest = map(str, sample.media)
        text = " | ".join([first, " ".join(_COVER), *rest])
        covered = fitted("layer", Sample.parse(text))
        same = tuple(n for n in covered.names if "thickness" not in n or n != covered.names[0])
        tried.append(
            (f"a layer of index {_COVER[0]} on top, in the sample '{text}'", covered, same)
        )
    least = fitted("").bic - MARGIN
    good = [t for t in tried if t[1].status in DETERMINED and t[1].bic < least]
    # What describes the data is named alone; else what comes nearest.
    good = [t for t in good if t[1].status == CONVERGED] or good
    good.sort(key=lambda t: t[1].bic)
    said = []
    for what, f, same in [t for t in good if t[1].bic <= good[0][1].bic + MARGIN]:
        new = {n: e for n, e in f.parameters.items() if e.free and n not in same}
        after = {n: f.parameters[other] for n, other in zip(own, same, strict=True)}
        each = [
            {n: tuple(map(float, (e.value, e.sigma, *e.interval))) for n, e in of.items()}
            for of in (new, after)
        ]
        said.append((what, f.rms, f.status == CONVERGED, *each))
    if not said:
        return found
    told = Finding("explained_by", np.True_, {"explanations": said})
    return replace(found, findings=ranked([*found.findings, told]))


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
