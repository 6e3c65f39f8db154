"""A sample whose index is free at every wavelength: many small fits as lanes of one program.

R, T, psi and Delta of an interface or a plate; eta and k of a bare surface from powers alone have a
method of their own (`bare_surface`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from fitting.diagnostics import Finding, Warning
from fitting.evaluation import EachWavelength
from fitting.instrument import INSTRUMENT
from fitting.measurement import Measurement
from fitting.observations import missing_errors, observations
from fitting.outcome import Subject, fit_of
from fitting.parameters import Settings
from fitting.problem import Targets, targets_of
from fitting.progress import listening, tell
from fitting.pseudo_index import notes_on
from fitting.result import CONVERGED, NONE, UNDETERMINED, Alternative, ErrorModel, Estimate, Fit
from fitting.sample import Sample
from fitting.search import Asked, Solving
from fitting.starts import LANES, Ends, run
from fitting.starts import starts as start_points
from fitting.uncertainty.intervals import QUADRATIC
from fitting.unknowns import index_outside, spectrum_of, unknowns

# Wavelengths that are solved side by side, each with LANES starts.
_TOGETHER = 16
# Degrees of freedom from which on a wavelength's own scatter tells its noise.
_ENOUGH = 5


class One(NamedTuple):
    """One wavelength before it is solved."""

    fit: Solving
    start: np.ndarray
    measurement: Measurement
    place: int

    @property
    def kind(self) -> tuple[Any, ...]:
        """What wavelengths must share to be lanes of one program."""
        return self.fit.u.spec, self.fit.seen.points.angle_deg.shape[0]


def _lanes(several: list[One], count: int) -> Targets:
    """Return the targets of wavelengths side by side, each for ``count`` lanes."""
    targets = [one.fit.targets for one in several]

    def beside(pick: Any) -> Any:
        return np.repeat(np.concatenate([pick(t) for t in targets], -1), count, -1)

    first = targets[0]
    points = first.points._replace(
        angle_deg=beside(lambda t: t.points.angle_deg),
        wavelength_um=beside(lambda t: t.points.wavelength_um),
        s_share=beside(lambda t: t.points.s_share),
    )
    channels = range(len(first.values))
    return first._replace(
        points=points,
        values=tuple(beside(lambda t, i=i: t.values[i]) for i in channels),
        weights=tuple(beside(lambda t, i=i: t.weights[i]) for i in channels),
        ncs=beside(lambda t: t.ncs),
        ncs_weights=beside(lambda t: t.ncs_weights),
        eta_i=beside(lambda t: t.eta_i) if np.ndim(first.eta_i) else first.eta_i,
    )


def _chunks(ones: list[One], together: int) -> Iterator[list[One]]:
    kinds: dict[tuple[Any, ...], list[One]] = {}
    for one in ones:
        kinds.setdefault(one.kind, []).append(one)
    for alike in kinds.values():
        for first in range(0, len(alike), together):
            yield alike[first : first + together]


def _scatter(pairs: list[tuple[One, Ends]]) -> float | None:
    """Return the mean square of the residuals of all wavelengths, None where each has enough.

    Two or three values for two unknowns say nothing of their noise, or that it is 0.
    """
    dof = sum(one.fit.dof for one, _ in pairs)
    if dof == 0 or min(one.fit.dof for one, _ in pairs) >= _ENOUGH:
        return None
    cost = sum(min((c for c in ends.cost[ends.done]), default=0.0) for _, ends in pairs)
    return float(cost) / dof


def _levelled(ends: Ends) -> Ends:
    """Return the ends with costs next to each other where they are next to the least one.

    Where k ended at 0 with a misfit, and no degree of freedom tells how large it may be, the solver
    stopped within 1e-4 of the cost (measured), and 1 of 64 starts seemed to end in the best.
    """
    least = np.min(ends.cost[ends.done], initial=np.inf)
    near = (ends.cost > least) & (ends.cost <= 1.0002 * least)
    return ends._replace(cost=np.where(near, np.nextafter(least, np.inf), ends.cost))


def too_few(free: int, found: Fit) -> Fit:
    """Return ``found``, undetermined where there are fewer data than unknowns.

    With k at 0, the end of its range, a single datum seems to determine eta.
    """
    if found.n_data >= free or found.status != CONVERGED:
        return found
    nothing = np.full(2, np.nan)
    parameters = {
        n: replace(e, sigma=np.nan, upper_limit=np.nan, interval=nothing, interval_kind=NONE,
                   status=UNDETERMINED) if e.free else e
        for n, e in found.parameters.items()
    }  # fmt: skip
    return replace(
        found, status=UNDETERMINED, parameters=parameters,
        findings=(Finding("one_value", np.True_, {}), *found.findings),
        covariance=np.full_like(found.covariance, np.nan),
    )  # fmt: skip


def check_wavelengths(measurement: Measurement, settings: Settings) -> None:
    """Raise ValueError for unknown wavelengths, and parameters that wavelengths share."""
    wave = measurement.wavelength_um
    if np.isnan(wave).any() and not np.isnan(wave).all():
        raise ValueError(
            f"{measurement.source}: the wavelength of {int(np.isnan(wave).sum())} of {len(wave)} "
            "data is not known; give it."
        )
    fitted = {*settings.free, *settings.bounds, *settings.priors}
    shared = [n for n in fitted if n.partition("[")[0] in INSTRUMENT or "thickness" in n]
    if shared:
        raise ValueError(
            f"{sorted(shared)[0]} is shared by all wavelengths, and an index that is free at every "
            "wavelength leaves nothing to tell it; fix it, or give the index a dispersion model."
        )


def jobs(measurement: Measurement, sample: Sample, settings: Settings, asked: Asked) -> list[One]:
    """Return the fit of every wavelength, not yet solved, in rising order."""
    wavelengths, which = np.unique(measurement.wavelength_um, return_inverse=True)
    ones = []
    for place in range(len(wavelengths)):
        part = measurement.where(which == place)
        seen = observations([part], asked.errors)
        u = unknowns(sample, spectrum_of([part], sample), settings, seen, asked.loss)
        outside = index_outside(sample, seen.points.wavelength_um)
        job = Solving(u, seen, targets_of(u, seen, outside), settings, asked)
        job.starts = LANES
        ones.append(One(job, start_points(u.moving, LANES, asked.seed), part, place))
    return ones


def fit_wavelengths(
    measurement: Measurement, sample: Sample, settings: Settings, asked: Asked
) -> Fit:
    """Return the fit of every wavelength by itself, batch shape (W,) in rising order.

    psi and Delta of a bare surface give the pseudo-index, see `pseudo_index`. With fewer than five
    data to spare at some wavelength, the scatter behind scaled errors is that of all.
    """
    several = len(np.unique(measurement.wavelength_um)) > 1
    if several and asked.intervals == "auto" and not sample.eta_i > 1.0:
        # By profile an interval takes some .1 s; in total reflection a quadratic limit of k can be
        # 12 times too small.
        asked = asked._replace(intervals=QUADRATIC)
    ones = jobs(measurement, sample, settings, asked)
    pairs = solved_each(ones)
    pooled = _scatter(pairs) if several else None
    fits = []
    for one, ends in pairs:
        one.fit.pooled = pooled
        ends = _levelled(ends) if one.fit.dof == 0 else ends
        tell("errors")
        found = fit_of(one.fit, ends, 1.0, Subject(sample, (one.measurement,)))
        fits.append(too_few(int(one.fit.u.free.sum()), found))
    notes = (*missing_errors([measurement], asked.errors), *notes_on(fits, sample, measurement))
    return stacked(fits, measurement, notes) if several else replace(fits[0], notes=notes)


def solved_each(ones: list[One], count: int = LANES) -> list[tuple[One, Ends]]:
    """Return every wavelength with the ends of its first ``count`` starts."""
    solved: list[Ends | None] = [None] * len(ones)
    tell(total=2 * len(ones), done=0)  # each is solved, and then looked at closely
    together = _TOGETHER * LANES // count
    for chunk in _chunks(ones, together):
        # Filled up with the last one, so that one program serves.
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
    return [(one, ends) for one, ends in zip(ones, solved, strict=True) if ends is not None]


_EACH = (
    "covariance", "wavelength_um", "chi2", "chi2_reduced", "dof", "n_data", "rms", "status",
    "evaluations", "reached", "noise", "cost", "bic", "aicc",
)  # fmt: skip


def _stack(values: Sequence[Any]) -> np.ndarray:
    return np.stack([np.asarray(v) for v in values])


def _estimate(each: Sequence[Estimate]) -> Estimate:
    first = each[0]
    if not first.free:
        return first
    names = ("value", "sigma", "interval", "interval_kind", "upper_limit", "status")
    return replace(first, **{n: _stack([getattr(e, n) for e in each]) for n in names})


def _alternatives(fits: Sequence[Fit]) -> tuple[Alternative, ...]:
    """Return the alternatives of all fits, the first of each, the second of each, ..."""
    out = []
    for i in range(max(len(f.others) for f in fits)):
        some = next(f.others[i] for f in fits if len(f.others) > i)
        nothing = {
            n: replace(e, value=np.nan, sigma=np.nan, interval=np.full(2, np.nan),
                       interval_kind=NONE, upper_limit=np.nan)
            for n, e in some.parameters.items()
        }  # fmt: skip
        none = Alternative(parameters=nothing, delta_chi2=np.nan)
        each = [f.others[i] if len(f.others) > i else none for f in fits]
        parameters = {n: _estimate([a.parameters[n] for a in each]) for n in nothing}
        out.append(Alternative(
            parameters=parameters, delta_chi2=_stack([a.delta_chi2 for a in each]),
            reached=_stack([a.reached for a in each]),
        ))  # fmt: skip
    return tuple(out)


def _findings(fits: Sequence[Fit]) -> tuple[Finding, ...]:
    """Return the findings of all fits, one for each code, the gravest first."""
    from fitting.sentences import SENTENCES

    out = []
    for code in SENTENCES:
        # A code may come more than once (a limit for each of two parameters).
        each = [[x for x in f.findings if x.code == code] for f in fits]
        for i in range(max(map(len, each))):
            at = np.array([len(own) > i for own in each])
            names = {name for own in each if len(own) > i for name in own[i].values}
            values: dict[str, Any] = {}
            for name in sorted(names):
                column = np.empty(len(fits), dtype=object)
                for j, own in enumerate(each):
                    column[j] = own[i].values.get(name) if len(own) > i else None
                values[name] = column
            out.append(Finding(code, at, values))
    return tuple(out)


def stacked_fits(fits: Sequence[Fit]) -> Fit:
    """Return fits of one kind, without a measurement, as one of batch shape (S,)."""
    first = fits[0]
    return replace(
        first,
        **{n: _stack([getattr(f, n) for f in fits]) for n in _EACH},
        parameters={n: _estimate([f.parameters[n] for f in fits]) for n in first.parameters},
        errors=ErrorModel(
            taken=_stack([f.errors.taken for f in fits]),
            factor=_stack([f.errors.factor for f in fits]),
            floor=_stack([f.errors.floor for f in fits]), stated=first.errors.stated,
            widened=_stack([f.errors.widened for f in fits]),
        ),
        findings=_findings(fits), others=_alternatives(fits),
    )  # fmt: skip


def stacked(fits: Sequence[Fit], measurement: Measurement, notes: tuple[Warning, ...]) -> Fit:
    """Return the fits of single wavelengths as one of batch shape (W,)."""
    quantities = tuple(dict.fromkeys(measurement.quantity.tolist()))
    kinds = dict.fromkeys(kind for f in fits for kind in f.rms_of)
    wavelengths = _stack([f.wavelength_um for f in fits])
    return replace(
        stacked_fits(fits),
        rms_of={k: _stack([f.rms_of.get(k, np.nan) for f in fits]) for k in kinds},
        notes=notes, measurement=measurement,
        curve=np.array([quantities.index(q) for q in measurement.quantity.tolist()]),
        curve_names=quantities,
        evaluator=EachWavelength(
            tuple(f.evaluator for f in fits),  # type: ignore
            wavelengths, measurement,
        ),
    )  # fmt: skip
