"""A sample whose index is free at every wavelength: small fits, many in one run of a program.

It takes R, T, psi and Delta of an interface or a plate. (eta and k of a bare surface from powers
alone are fitted by `bare_surface`.)
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import jax
import numpy as np

from fitting.data.measurement import Measurement
from fitting.optics.instrument import INSTRUMENT
from fitting.outcomes.batched import stacked
from fitting.outcomes.findings import Subject
from fitting.outcomes.outcome import fit_of
from fitting.problem.lanes import LANES, Ends, joined, run
from fitting.problem.observations import observations
from fitting.problem.problem import FitOptions, Problem
from fitting.problem.programs import Targets, targets_of
from fitting.problem.unknowns import index_outside, spectrum_of, unknowns
from fitting.process.progress import listening, tell
from fitting.residuals.error_model import beyond_chance
from fitting.results.diagnostics import Finding
from fitting.results.result import FitData
from fitting.results.result_parts import CONVERGED, UNDETERMINED
from fitting.samples.parameters import Settings
from fitting.samples.sample import Sample
from fitting.searching.starts import starts as start_points
from fitting.uncertainty.intervals import QUADRATIC

# Number of wavelengths that one run of a program solves, each from LANES starts.
_TOGETHER = 16
# A wavelength is tried again from the solutions at so many wavelengths on either side; if it is not
# described, as long as this helps, at most so many times.
_BESIDE, _ROUNDS = 8, 12
# Degrees of freedom from which on the noise is estimated from a wavelength's own scatter.
_ENOUGH = 5


class One(NamedTuple):
    """One wavelength before it is solved."""

    fit: Problem
    start: np.ndarray
    measurement: Measurement
    place: int

    @property
    def kind(self) -> tuple[Any, ...]:
        """What wavelengths must have in common to be lanes of one program."""
        return self.fit.u.spec, self.fit.seen.points.angle_deg.shape[0]


def _lanes(several: list[One], count: int) -> Targets:
    """Return the targets of wavelengths side by side, each for ``count`` lanes."""
    targets = [one.fit.targets for one in several]
    first = targets[0]

    def beside(*each: Any) -> Any:
        return np.repeat(np.concatenate(each, -1), count, -1)

    points, values, weights, ncs, ncs_weights, held = jax.tree.map(beside, *(
        (t.points[:3], t.values, t.weights, t.ncs, t.ncs_weights, t.held[:, None]) for t in targets
    ))  # fmt: skip
    eta_i = beside(*(t.eta_i for t in targets)) if np.ndim(first.eta_i) else first.eta_i
    return first._replace(
        points=first.points._replace(
            angle_deg=points[0], wavelength_um=points[1], s_share=points[2]
        ),
        values=values, weights=weights, ncs=ncs, ncs_weights=ncs_weights, eta_i=eta_i, held=held,
    )  # fmt: skip


def _chunks(ones: list[One], together: int) -> Iterator[list[One]]:
    kinds: dict[tuple[Any, ...], list[One]] = {}
    for one in ones:
        kinds.setdefault(one.kind, []).append(one)
    for alike in kinds.values():
        for first in range(0, len(alike), together):
            yield alike[first : first + together]


def _scatter(pairs: list[tuple[One, Ends]]) -> float | None:
    """Return the mean square of the residuals of all wavelengths, None where each has enough.

    Two or three data for two unknowns give no estimate of the noise, or a far too small one.
    """
    dof = sum(one.fit.dof for one, _ in pairs)
    if dof == 0 or min(one.fit.dof for one, _ in pairs) >= _ENOUGH:
        return None
    cost = sum(min((c for c in ends.cost[ends.done]), default=0.0) for _, ends in pairs)
    return float(cost) / dof


def _levelled(ends: Ends) -> Ends:
    """Return the ends with equal costs where these are close to the lowest one.

    If k ends at 0 with a misfit, and there is no degree of freedom, the solver stops within 1e-4 of
    the cost (measured); without this, 1 of 64 starts would seem to end in the best minimum.
    """
    least = np.min(ends.cost[ends.done], initial=np.inf)
    near = (ends.cost > least) & (ends.cost <= 1.0002 * least)
    return ends._replace(cost=np.where(near, np.nextafter(least, np.inf), ends.cost))


def _too_few(found: FitData) -> FitData:
    """Return ``found``, undetermined where there are fewer data than unknowns.

    Otherwise a single datum would seem to determine eta where k is at 0, the end of its range.
    """
    if found.n_data >= len(found.names) or found.status != CONVERGED:
        return found
    return replace(
        found, status=UNDETERMINED, covariance=np.full_like(found.covariance, np.nan),
        parameters={n: e.without_error() if e.free else e for n, e in found.parameters.items()},
        findings=(Finding("one_value", np.True_, {}), *found.findings),
    )  # fmt: skip


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


def jobs(
    measurement: Measurement, sample: Sample, settings: Settings, asked: FitOptions
) -> list[One]:
    """Return the fit of every wavelength, not yet solved, in rising order."""
    wavelengths, which = np.unique(measurement.wavelength_um, return_inverse=True)
    ones = []
    for place in range(len(wavelengths)):
        part = measurement.where(which == place)
        job = problem_of([part], sample, settings, asked)
        job.starts = LANES
        ones.append(One(job, start_points(job.u.moving, LANES, asked.seed), part, place))
    return ones


def fit_wavelengths(
    measurement: Measurement, sample: Sample, settings: Settings, asked: FitOptions,
    near: FitData | None = None,
) -> FitData:  # fmt: skip
    """Return the fit of every wavelength by itself, batch shape (W,) in rising order.

    If a wavelength has fewer than five degrees of freedom, scaled errors use the scatter of all
    wavelengths. near: the fit of a sample that hardly differs, of which the same minima are wanted,
    as they have moved.
    """
    several = len(np.unique(measurement.wavelength_um)) > 1
    if several and asked.intervals == "auto" and not sample.eta_i > 1.0:
        # A profile interval takes about .1 s. It is used in total reflection only, where the
        # quadratic limit of k can be 12 times too small.
        asked = asked._replace(intervals=QUADRATIC)
    ones = jobs(measurement, sample, settings, asked)
    tell(total=2 * len(ones), done=0)  # each is solved, and then gets its errors
    if near is None:
        pairs = from_neighbours(solved_each(ones))
    else:
        own = [e.y[:, None] for e in near.evaluator.each]  # type: ignore
        pairs = solved_each([
            one._replace(start=np.repeat(y, LANES, 1)) for one, y in zip(ones, own, strict=True)
        ])  # fmt: skip
    pooled = _scatter(pairs) if several else None
    fits = []
    for one, ends in pairs:
        one.fit.pooled = pooled
        ends = _levelled(ends) if one.fit.dof == 0 else ends
        tell("errors")
        fits.append(_too_few(fit_of(one.fit, ends, 1.0, Subject(sample, one.measurement))))
    return stacked(fits, measurement) if several else fits[0]


def solved_each(ones: list[One], count: int = LANES) -> list[tuple[One, Ends]]:
    """Return every wavelength with the ends of its first ``count`` starts."""
    solved: dict[int, Ends] = {}
    together = _TOGETHER * LANES // count
    for chunk in _chunks(ones, together):
        # Filled up with copies of the last one, so that all groups use one program.
        full = chunk + [chunk[-1]] * (together - len(chunk))
        groups = np.repeat(np.arange(together), count)
        with listening(None):  # wavelengths are counted here, not rounds
            ends = run(
                chunk[0].fit.u.spec,
                _lanes(full, count),
                np.concatenate([one.start[:, :count] for one in full], 1),
                full[0].fit.limits,
                np.repeat([max(one.fit.dof, 1.0) for one in full], count),
                np.repeat([one.fit.squares for one in full], count),
                groups,
            )
        for i, one in enumerate(chunk):
            own = slice(i * count, (i + 1) * count)
            solved[one.place] = Ends(*(a[..., own] for a in ends))
        tell(done=len(chunk))
    return [(one, solved[one.place]) for one in ones]


def from_neighbours(pairs: list[tuple[One, Ends]]) -> list[tuple[One, Ends]]:
    """Return the wavelengths, each tried from the solutions beside it, and some of them again.

    An index changes little from one wavelength to the next, and a narrow minimum that few starts
    find at one of them is wide at another. With a few degrees of freedom a wrong one may describe
    the data, so that all are tried once, and then those that are not described.
    """
    pairs = list(pairs)
    spare = np.array([one.fit.dof > 0 for one, _ in pairs])
    for turn in range(_ROUNDS if len(pairs) > 1 else 0):
        worth = np.flatnonzero(_misfits(pairs) | (spare & (turn == 0))).tolist()
        if not worth:
            break
        again = [_beside(pairs, i) for i in worth]
        tell(total=len(again) + len(pairs), done=0)
        better = False
        own = min(2 * _BESIDE, len(pairs) - 1)  # the further lanes are copies
        for i, (one, ends) in zip(worth, solved_each(again, 2 * _BESIDE), strict=True):
            before = pairs[i][1].cost.min()
            one.fit.starts += own
            pairs[i] = one, joined([pairs[i][1], Ends(*(a[..., :own] for a in ends))])
            better |= bool(pairs[i][1].cost.min() < (1.0 - 1e-3) * before)
        if not better:
            break
    return pairs


def _misfits(pairs: list[tuple[One, Ends]]) -> np.ndarray:
    """Return whether the lowest end of each wavelength is above the noise, (W,) bool.

    Without stated errors: whether it is far above those of the others. Without a degree of freedom:
    whether it is more than rounding.
    """
    cost = np.array([ends.cost.min() for _, ends in pairs])
    dof = np.array([one.fit.dof for one, _ in pairs])
    reduced = cost / np.maximum(dof, 1)
    if pairs[0][0].fit.seen.stated:
        misfit, _ = beyond_chance(reduced, dof)
    else:
        misfit = reduced > 4.0 * np.median(reduced)
    return np.where(dof > 0, misfit, cost > 1e-6 * np.array([o.fit.squares for o, _ in pairs]))


def _beside(pairs: list[tuple[One, Ends]], which: int) -> One:
    """Return a wavelength with the lowest ends of those beside it as its starts, each once.

    Its own would count as reached again. Near an end of the spectrum more are from the other side.
    Of a few wavelengths the last one is repeated, so that all take one program.
    """
    first = max(min(which - _BESIDE, len(pairs) - 1 - 2 * _BESIDE), 0)
    others = [i for i in range(first, first + 2 * _BESIDE + 1) if i != which and i < len(pairs)]
    ends = [pairs[i][1] for i in others]
    start = np.stack([e.y[:, np.argmin(e.cost)] for e in ends], 1)
    start = np.pad(start, ((0, 0), (0, 2 * _BESIDE - len(others))), "edge")
    return pairs[which][0]._replace(start=start)
