"""A sample whose index is free at every wavelength: W fits of one kind, run as one batch.

It takes R, T, psi and Delta of an interface, a plate or films of known thickness.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple, cast

import numpy as np

from fitting.data.measurement import Measurement
from fitting.optics.instrument import INSTRUMENT
from fitting.outcomes.findings import on_rows, stacked_findings
from fitting.outcomes.of_batch import fit_of_batch
from fitting.outcomes.surface_verdicts import OPEN
from fitting.problem.curve_lanes import Curves, shown_at
from fitting.problem.evaluation import EachFit, Evaluated, at_data
from fitting.problem.lanes import LANES
from fitting.problem.observations import observations
from fitting.problem.problem import FitOptions, Problem
from fitting.problem.programs import targets_of
from fitting.problem.unknowns import index_outside, spectrum_of, unknowns
from fitting.process.progress import tell
from fitting.results.diagnostics import Finding, ranked
from fitting.results.result import FitData
from fitting.results.result_parts import CONVERGED, NOT_CONVERGED
from fitting.samples.parameters import Settings
from fitting.samples.sample import Sample
from fitting.searching.batch_search import BatchSearch
from fitting.searching.starts import starts as start_points
from fitting.searching.starts import with_given_start
from fitting.searching.surface_mesh import of_bare_surface, search_surface

# A wavelength is tried from the solutions at so many wavelengths on either side.
_BESIDE = 8
# Degrees of freedom from which on the noise is estimated from a wavelength's own scatter.
_ENOUGH = 5


class Wavelengths(NamedTuple):
    """The fit of every wavelength, in rising order, not yet solved.

    job: that of all data, as a pattern. curves: the data, a wavelength each. wavelength_um: (W,).
    slot, which: where each row of the pattern is among theirs, (M,).
    """

    job: Problem
    curves: Curves
    wavelength_um: np.ndarray
    slot: np.ndarray
    which: np.ndarray


def check_wavelengths(measurement: Measurement, settings: Settings) -> None:
    """Raise ValueError for unknown wavelengths, and parameters that wavelengths share."""
    wave = measurement.wavelength_um
    if np.isnan(wave).any() and not np.isnan(wave).all():
        raise ValueError(
            f"{measurement.source}: the wavelength of {int(np.isnan(wave).sum())} of {len(wave)} "
            "data is not known; give it, or leave these data out."
        )
    fitted = {*settings.free, *settings.bounds, *settings.priors}
    shared = [n for n in fitted if n.partition("[")[0] in INSTRUMENT or "thickness" in n]
    if shared:
        raise ValueError(
            f"{sorted(shared)[0]} has one value for all wavelengths, and cannot be fitted together "
            "with an index that is free at each of them. Fix it, or give the index a dispersion "
            "model."
        )


def problem_of(
    measurements: Sequence[Measurement], sample: Sample, settings: Settings, asked: FitOptions
) -> Problem:
    """Return the fit of a sample to measurements, not yet solved."""
    seen = observations(measurements, asked.errors)
    u = unknowns(sample, spectrum_of(measurements, sample), settings, seen, asked.loss)
    outside = index_outside(sample, seen.points.wavelength_um)
    return Problem(u, seen, targets_of(u, seen, outside), settings, asked)


def each_wavelength(
    measurement: Measurement, sample: Sample, settings: Settings, asked: FitOptions
) -> Wavelengths:
    """Return the fit of every wavelength."""
    job = problem_of([measurement], sample, settings, asked)
    seen, points = job.seen, job.seen.points
    wavelengths, which, count = np.unique(
        points.wavelength_um[seen.measured, 0], return_inverse=True, return_counts=True
    )  # fmt: skip
    order, first = np.argsort(which, kind="stable"), np.cumsum(count) - count
    slot = np.empty(len(which), int)
    slot[order] = np.arange(len(which)) - first[which[order]]
    # Rows that a wavelength lacks are copies of its first one, without data.
    size = 1 << int(count.max() - 1).bit_length()
    at = np.repeat(order[first][None], size, 0)
    at[slot, which] = np.arange(len(which))
    names = ["angle_deg", "wavelength_um", "s_share"]
    names += ["folded"] * (points.folded is not None)
    own = {n: getattr(points, n)[at, 0] for n in names}
    own["held"] = np.repeat(job.u.held[:, None], len(count), 1)
    if np.ndim(job.targets.eta_i):
        own["eta_i"] = job.targets.eta_i[at, 0]
    values, sigma = dict[str, np.ndarray](), dict[str, np.ndarray]()
    quantities = tuple(dict.fromkeys(seen.quantity.tolist()))
    for q in quantities:
        here = seen.quantity == q
        place = which[seen.row[here]], slot[seen.row[here]]
        for table, data in ((values, measurement.value), (sigma, measurement.sigma)):
            table[q] = np.full((len(count), size), np.nan)
            table[q][place] = data[here]
    base = job.targets._replace(points=points._replace(
        file=np.zeros(size, points.file.dtype), angle_deg=np.zeros((size, 1)), distinct_um=None,
        place=None,
    ))  # fmt: skip
    pattern = seen._replace(
        points=base.points, row=np.tile(np.arange(size), len(quantities)),
        quantity=np.repeat(quantities, size),
    )  # fmt: skip
    curves = Curves(pattern, base, values, sigma if seen.stated else None, own)
    return Wavelengths(job, curves, wavelengths, slot, which)


def _beside(count: int) -> np.ndarray:
    """Return the wavelengths beside each of ``count``, (K, count); -1 for none.

    Near an end of the spectrum more are from the other side.
    """
    each = np.arange(count)
    first = np.clip(each - _BESIDE, 0, max(count - 1 - 2 * _BESIDE, 0))
    beside = first + np.arange(2 * _BESIDE + 1)[:, None]
    return np.where((beside == each) | (beside >= count), -1, beside)


def fit_wavelengths(
    measurement: Measurement, sample: Sample, settings: Settings, asked: FitOptions,
    near: FitData | None = None, by_noise: bool = True,
) -> FitData:  # fmt: skip
    """Return the fit of every wavelength by itself, batch shape (W,) in rising order.

    If a wavelength has fewer than five degrees of freedom, scaled errors use the scatter of all
    wavelengths. near: the fit of a sample that hardly differs, of which the same minima are wanted,
    as they have moved. by_noise: whether the noise that a robust loss and priors need is found for
    each wavelength; else it is that of the stated errors.
    """
    waves = each_wavelength(measurement, sample, settings, asked)
    u, every = waves.job.u, np.arange(waves.curves.count)
    by_noise = by_noise and waves.job.by_noise
    search = BatchSearch(waves.job, waves.curves, by_noise=by_noise)
    tell(total=2 * len(every), done=0)  # each is solved, and then gets its errors
    if near is not None:
        search.run(np.stack([e.y for e in near.evaluator.each], 1), every)  # type: ignore
    else:
        mesh = of_bare_surface(search) and asked.starts is None
        if mesh:
            search_surface(search)
        starts = start_points(u.moving, 0 if mesh else asked.starts or LANES, asked.seed)
        starts = with_given_start(starts, u.moving, u.labels, asked.start)
        search.run(np.tile(starts, len(every)), np.repeat(every, starts.shape[1]))
        if not mesh:
            search.from_neighbours(_beside(len(every)), search.dof > 0)
    search.settle()
    tell("errors", done=len(every))
    pooled = None
    if not by_noise and search.dof.sum() and search.dof.min() < _ENOUGH:
        # Two or three data for two unknowns give no estimate of the noise, or a far too small one.
        pooled = float(search.best.cost[search.best.done].sum() / search.dof.sum())
    found = fit_of_batch(search, (len(every),), sample, pooled)
    tell(done=len(every))
    return _with_rows(waves, found, measurement)


def _with_rows(waves: Wavelengths, found: FitData, measurement: Measurement) -> FitData:
    """Return the fits with their measurement, and what is told of its rows."""
    seen, u, m = waves.job.seen, waves.job.u, measurement
    each = cast(EachFit, found.evaluator).each
    y, every = np.stack([e.y for e in each], 1), np.arange(len(each))
    shown = shown_at(u.spec, waves.curves, y, every)
    fitted = at_data(seen, shown[waves.which, :, waves.slot].T)
    told, own = list[list[Finding]](), list[Evaluated]()
    for i, wavelength in enumerate(waves.wavelength_um):
        rows, state = m.at_wavelength(wavelength), found.status[i]
        part = m.where(rows)
        own.append(each[i]._replace(measured_um=np.atleast_1d(wavelength), rows=part))
        shown_part = fitted[rows], seen.curve[rows], seen.stated
        on = on_rows(u, part, *shown_part, state == CONVERGED)
        known = {f.code for f in found.findings if f.at[i]}
        told.append([] if state == NOT_CONVERGED or known & {*OPEN} else list(on))
    names = [*dict.fromkeys(m.quantity.tolist())]
    curve = np.array([names.index(q) for q in m.quantity.tolist()])
    return replace(
        found, measurement=m, curve=curve, curve_names=tuple(names),
        findings=ranked((*found.findings, *stacked_findings(told))),
        wavelength_um=waves.wavelength_um,
        evaluator=EachFit(tuple(own), found.shape, waves.wavelength_um, m),
    )  # fmt: skip
