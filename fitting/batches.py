"""Many curves of one sample, each fitted by itself, all of them as lanes of one program.

A full search takes a second, and a map has 1e5 pixels that differ little. So a few curves are
searched as `fit` does; every curve is followed from the minima found there, or from those of
``near``; one that the model does not describe is tried from its neighbours; and a share is searched
afresh, so that a lower minimum (another fringe order) is found for all, or at least told.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from copy import copy
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from fitting.batch_arrays import arrays_of, pattern_of, start_of, without_refused
from fitting.data.checks import unmasked
from fitting.data.errors import MeasurementError
from fitting.data.measurement import Measurement
from fitting.data.quantities import ANGLES, POWERS
from fitting.fit_result import Fit
from fitting.fits import fit_checked
from fitting.outcomes.of_batch import fit_of_batch
from fitting.outcomes.outcome import parameters_at
from fitting.problem.curve_lanes import Curves, shown_at
from fitting.problem.problem import FitOptions, Kept
from fitting.process.progress import tell
from fitting.residuals.error_model import ADDED, NEED_STATED
from fitting.results.diagnostics import Finding, ranked
from fitting.results.result import FitData
from fitting.results.result_parts import REFUSED
from fitting.samples.parameters import Settings, check_search, from_parameter, settings_of
from fitting.samples.sample import Sample
from fitting.samples.sample_checks import check_fit
from fitting.searching.batch_search import BatchSearch
from fitting.searching.minima import SAME_CHI2
from fitting.searching.surface_mesh import of_bare_surface, search_surface
from fitting.uncertainty.intervals import QUADRATIC, check_choices
from fitting.uncertainty.stated_errors import Fits, Weighed, with_error_model
from fitting.wavelengths import problem_of

# Rounds of searches afresh; each begins where the one before found a lower minimum.
_SEARCHES = 6
# So many of the other minima of a curve are followed in all curves.
_OTHERS = 3


class _Batch(NamedTuple):
    """The search of N curves, their angles and wavelengths, and what `fit` needs of one of them."""

    search: BatchSearch
    columns: tuple[np.ndarray, np.ndarray]
    settings: Settings
    sample: Sample

    def alone(self, i: int) -> FitData:
        """Return the fit of one curve, searched from all starts."""
        angle, wavelength = self.columns
        angle = angle[i] if angle.ndim == 2 else angle
        curves: Any = self.search.curves
        values: dict[str, Any] = {q: v[i] for q, v in curves.values.items()}
        sigma = None if curves.sigma is None else {q: s[i] for q, s in curves.sigma.items()}
        m = Measurement.from_columns(angle, wavelength, sigma=sigma, **values)
        asked = self.search.job.asked._replace(kept=Kept({}, {}), intervals=QUADRATIC)
        if asked.scaled:  # its values count here, not its errors
            asked = asked._replace(errors="scaled" if sigma else "equal")
        return fit_checked([m], self.sample, self.settings, asked)

    def places(self, fit: FitData) -> np.ndarray:
        """Return where a fit of one curve and its alternatives are, (p, K)."""
        sets = [fit.parameters, *({**fit.parameters, **a.parameters} for a in fit.others[:_OTHERS])]
        return np.stack([self.y_of({n: e.value for n, e in s.items()}) for s in sets], 1)

    def y_of(self, values: Mapping[str, Any]) -> np.ndarray:
        """Return parameters by name in the solver's coordinates, (p, ...)."""
        u = self.search.job.u
        rows = [
            from_parameter(w.parameter.coordinate, np.clip(
                values.get(u.labels.get(w.parameter.name, ""), w.low), w.low, w.high
            ))
            for w in u.moving
        ]  # fmt: skip
        return np.stack(np.broadcast_arrays(*rows))


def _neighbours(shape: tuple[int, ...]) -> np.ndarray:
    """Return the numbers of the neighbours of each place of a grid, (2 axes, N); -1 for none."""
    grid = np.pad(np.arange(int(np.prod(shape))).reshape(shape), 1, constant_values=-1)
    inner = (slice(1, -1),) * len(shape)
    steps = [np.roll(grid, step, axis)[inner] for axis in range(len(shape)) for step in (1, -1)]
    return np.array(steps, int).reshape(len(steps), int(np.prod(shape)))


def fit_many(
    angles_deg: Any,
    wavelength_um: Any = None,
    *,
    R_s: Any = None, R_p: Any = None, R: Any = None, R_back: Any = None,
    T_s: Any = None, T_p: Any = None, T: Any = None,
    psi: Any = None, delta: Any = None, delta_folded: Any = None,
    N: Any = None, C: Any = None, S: Any = None,
    sigma: Any = None,
    sample: str | Sample = "free",
    free: str | Iterable[str] = (),
    fixed: Mapping[str, float] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    priors: Mapping[str, tuple[float, float]] | None = None,
    tie: Mapping[str, str] | None = None,
    loss: str = "squares",
    errors: str = "auto",
    intervals: str = "quadratic",
    starts: int | None = None,
    start: Mapping[str, Any] | None = None,
    near: Fit | None = None,
    check: int = 8,
    seed: int = 0,
) -> Fit:  # fmt: skip
    """Return the fits of many curves of one sample, each by itself, in one call.

    Values, errors and warnings are those of `fit` for each curve at the same minimum, to a
    thousandth of a standard error, except that residuals are not tested for autocorrelation,
    for which `fit` widens the errors; of a misfit that is little larger than the noise
    (`does_not_describe`) 94 in 100 are told, and its cause is named by `fit` of that curve; and
    films that noise or thinness leaves open are not looked for. A bare surface whose index is
    free starts each curve from a mesh of indices. Of other samples (films, plates, dispersion
    models, psi and Delta) a few curves are searched as `fit` does, all begin from the minima
    found there and from those of their neighbours, and the worst of them and some by chance are
    searched afresh.

    Args:
        angles_deg: (M,) degrees of incidence from the normal, 0 to 90; or (..., M), angles of its
            own for each curve.
        wavelength_um: micrometres, a number or (M,); None of a bare surface with one index.
        R_s, ..., S: (..., M) values as `fit` takes them, powers as fractions, psi, delta and
            delta_folded (Delta from 0 to 180) in degrees, N, C, S from -1 to 1; at least one. Each
            of the M points has an angle and a wavelength. NaN marks a missing value.
        sigma: None, or standard errors above 0 that broadcast to the data: the same for all
            quantities, or a mapping from these names to errors. NaN leaves the datum out.
        sample: as for `fit`. An index that is free at every wavelength takes one wavelength.
        free, fixed, bounds, priors, tie, loss: as for `fit`, the same for all curves. The noise
            that a robust loss and priors need is found for each curve.
        errors: as for `fit`, of each curve by itself; of psi and Delta "auto" is "scaled", and
            there is no "floor" and "relative".
        intervals: as for `fit`, but "quadratic" by default, since profile likelihood takes 1 ms of
            processor time more for each curve of a bare surface ("auto" half of that).
        starts: of a bare surface the number of random starts of each curve instead of the mesh; of
            other samples that of the few curves that are searched as `fit` does.
        start: name -> value, or array of the batch shape, of every fitted parameter, from which all
            curves begin; of several starts each, with an axis for these in front.
        near: a `Fit` of one such curve, or of a batch of this shape, from which curves begin.
        check: how many curves are searched afresh in a round; 0 with ``start`` or ``near``: none.
        seed: of the choice of these.

    Returns:
        `Fit` of the batch shape (...), in float64; scalars for a single curve (M,). A curve
        with values that are none of a measurement (out of range, or all 0 as of a dead pixel) has
        the status "refused", and its warning the reason. Of 30 curves and more that are missed
        in the same way all are misfits, even if chance hides it in each.
        It takes about .05 ms for a bare surface (60 angles, R_s and R_p, two cores), .04 ms for a
        film (60 wavelengths, from a neighbour's minimum), and 20 ms for a call.

    Raises:
        ValueError: for shapes that do not fit, no data at all, or if no curve is left.
    """
    which = Sample.parse(sample)
    check_choices(loss, errors, intervals)
    check_search(starts, start, seed)
    if not isinstance(check, int | np.integer) or check < 0:
        raise ValueError(f"check is {check!r}; a number of curves, 0 or more, was wanted.")
    settings = settings_of(free, fixed, bounds, priors, tie)
    every = {"R_s": R_s, "R_p": R_p, "R": R, "R_back": R_back, "T_s": T_s, "T_p": T_p, "T": T,
             "psi": psi, "delta": delta, "delta_folded": delta_folded,
             "N": N, "C": C, "S": S}  # fmt: skip
    given = {name: unmasked(value) for name, value in every.items() if value is not None}
    if not given:
        raise ValueError(f"no values came; one or more of {', '.join(every)} were wanted.")
    if errors == "equal":
        sigma = None
    given, sigma, reasons = without_refused(given, sigma)
    if which.open:
        raise ValueError(
            f"the sample {str(which)!r} leaves its dispersion model open (auto): use choose for "
            "one curve, and fit_many with the model that it takes."
        )
    if which.by_wavelength and not (wavelength_um is None or np.size(wavelength_um) == 1):
        raise ValueError(
            f"the sample {str(which)!r} has an index that is free at every wavelength: give one "
            "wavelength a call, or a dispersion model (cauchy, lorentz)."
        )
    values, sigmas, angle, wavelength, shape = arrays_of(given, sigma, angles_deg, wavelength_um)
    if errors in ADDED and set(values) & set(ANGLES):
        raise ValueError(
            f'errors "{errors}" of psi and Delta are estimated for single curves (fit); of a batch '
            'they are "stated", "scaled" or "equal".'
        )
    if errors in NEED_STATED and sigmas is None:
        raise ValueError(f'errors "{errors}" need a standard error for every datum; give sigma.')
    found = _fit_curves(
        values, sigmas, angle, wavelength, shape, which, settings,
        FitOptions(errors, intervals, loss, seed, starts=starts), start_of(start, near, shape),
        check,
    )  # fmt: skip
    findings = [
        replace(f, values={**f.values, "alone": True}) if f.code == "does_not_describe" else f
        for f in found.findings
    ]
    if reasons is not None:
        at = np.reshape(reasons != "", found.shape)
        findings.append(Finding("refused", at, {"reason": np.reshape(reasons, found.shape)}))
        found = replace(found, status=np.where(at, REFUSED, found.status))
    return Fit.of(replace(found, findings=ranked(findings)))


def _fit_curves(
    curves: Mapping[str, np.ndarray], sigma: Mapping[str, np.ndarray] | None,
    angle_deg: np.ndarray, wavelength_um: np.ndarray, shape: tuple[int, ...], sample: Sample,
    settings: Settings, asked: FitOptions, near: Mapping[str, Any] | None, check: int,
) -> FitData:  # fmt: skip
    """Return the fits of values (N, M) by quantity, of batch shape ``shape``; see `fit_many`.

    near: name -> values (K, N) of parameters, from which all curves begin.
    """
    some = angle_deg if angle_deg.ndim == 1 else np.linspace(10.0, 80.0, angle_deg.shape[1])
    pattern = pattern_of(curves, sigma, some, wavelength_um)
    sample = sample.with_splines(pattern.wavelength_um)
    check_fit([pattern], sample)
    job = problem_of([pattern], sample, settings, asked)
    lanes = Curves(job.seen, job.targets, curves, sigma)
    if angle_deg.ndim == 2:
        rows = job.seen.row[job.seen.quantity == job.seen.quantity[0]]
        own = np.repeat(angle_deg[:, :1].T, len(job.seen.points.angle_deg), 0)
        own[rows] = angle_deg.T
        lanes = replace(lanes, own={"angle_deg": own})
    search = BatchSearch(job, lanes, by_noise=job.by_noise)
    known = np.unique(wavelength_um)
    batch = _Batch(search, (angle_deg, wavelength_um), settings, sample)
    every, beside = np.flatnonzero(search.known), _neighbours(shape)
    if not len(every):
        raise ValueError("no curve has a datum; one was wanted at least.")
    if near is not None:
        free = {job.u.labels[w.parameter.name]: w for w in job.u.moving if w.free}
        lacking = [n for n in free if n not in near]
        if lacking:
            raise ValueError(
                f"start and near have no value of {', '.join(lacking)}; one of every fitted "
                f"parameter ({', '.join(free)}) was wanted."
            )
        for name, w in free.items():
            if not ((w.low <= near[name]) & (near[name] <= w.high)).all():
                raise ValueError(
                    f"the start of {name} holds {near[name].min():g} to {near[name].max():g}; "
                    f"{w.low:g} to {w.high:g} was wanted."
                )
        y = batch.y_of({n: v[:, every] for n, v in near.items()})
        search.run(y.reshape(len(y), -1), np.tile(every, y.shape[1]))
    if of_bare_surface(search):
        if asked.starts is None:
            search_surface(search)
        else:
            search.run_random(asked.starts, asked.seed, every)
        search.settle()
        return _result(search, shape, sample, known)
    if near is not None:
        search.from_neighbours(beside)
    random, searched = np.random.default_rng(asked.seed), set[int]()
    begun, refused = near is not None, None
    for _ in range(_SEARCHES):
        gained = False
        # The first one by itself: where it ends all others begin.
        for i in _to_search(search, random, check if begun else 1, searched):
            searched.add(i)
            tell()
            try:
                found = batch.alone(i)
            except MeasurementError as error:  # beyond [0, 1] by more than the noise of this curve
                refused, gained = error, True
                continue
            cost, noise = search.best.cost[i], np.broadcast_to(search.curves.noise, lanes.count)[i]
            least = SAME_CHI2 * max(cost / max(search.dof[i], 1), 1.0 if sigma else 0.0)
            if not begun or found.cost * found.noise**2 < (cost - least) * noise**2:
                begun = gained = True
                for place in batch.places(found).T:
                    search.run(np.repeat(place[:, None], len(every), 1), every)
                search.from_neighbours(beside)
        if not gained:
            break
    if not begun:
        assert refused is not None
        raise refused
    return _result(search, shape, sample, known)


def _result(
    search: BatchSearch, shape: tuple[int, ...], sample: Sample, known: np.ndarray
) -> FitData:
    """Return the fits of curves whose lanes have ended, with further errors where they need one.

    known: the wavelengths.
    """
    u, curves, seen = search.job.u, search.curves, search.curves.seen
    names = tuple(curves.values)
    if search.job.weighed or not {*names} <= {*POWERS}:
        return fit_of_batch(search, shape, sample, known=known)
    value = np.concatenate([curves.values[q] for q in names], 1)
    rows = np.concatenate([seen.row[seen.quantity == q] for q in names])
    curve = np.repeat(np.arange(len(names)), len(rows) // len(names))
    place = np.array([seen.channels.index(q) for q in names])[curve]
    stated = None
    if curves.sigma is not None:
        stated = np.concatenate([curves.sigma[q] for q in names], 1)
        stated = np.where(np.isfinite(value), stated, np.inf)

    def compared(of: np.ndarray, model: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        off = np.where(np.isfinite(value[of]), value[of] - model, 0.0)
        return off, np.ones_like(off)

    def weighed(search: BatchSearch, new: np.ndarray) -> Weighed:
        def model(of: np.ndarray) -> np.ndarray:
            return shown_at(u.spec, curves, search.best.y[:, of], of)[:, place, rows]

        def result() -> FitData:
            best = fit_of_batch(search, shape, sample, known=known)
            if stated is None or not len(new):
                return best
            chi2 = np.ravel(best.chi2).astype(float)
            chi2[new] = ((compared(new, model(new))[0] / stated[new]) ** 2).sum(1)
            return replace(best, chi2=np.reshape(chi2, shape)[()])

        return Weighed(model, result)

    def again(sigma: np.ndarray, of: np.ndarray) -> Weighed:
        whole = np.full(value.shape, np.nan) if stated is None else stated.copy()
        whole[of] = sigma
        errors = dict(zip(names, np.split(whole, len(names), 1), strict=True))
        there = copy(search)
        there.run_again(replace(curves, sigma=errors), of)
        return weighed(there, of)

    def values() -> dict[str, Any]:
        each = zip(u.spec.moving, parameters_at(u, search.best.y.T)[0].T, strict=True)
        return {u.labels[name]: x.reshape(shape) for name, x in each}

    several = np.arange(curves.count if "angle_deg" in curves.own else 1)
    return with_error_model(Fits(
        value=value, sigma=stated, angle_deg=curves.of_points("angle_deg", several)[:, rows],
        wavelength_um=seen.points.wavelength_um[rows, 0], power=np.ones(len(rows), bool),
        curve=curve, names=names, chi2=search.best.cost, dof=search.dof, values=values,
        compared=compared, first=weighed(search, several[:0]), again=again,
    ), search.job.asked.errors)  # fmt: skip


def _to_search(
    search: BatchSearch, random: np.random.Generator, many: int, searched: set[int]
) -> list[int]:
    """Return which curves to search afresh: the worst described ones, and as many by chance."""
    best = search.best
    free = np.array([i for i in np.flatnonzero(search.known) if i not in searched], int)
    if not len(free) or not many:
        return []
    cost = np.where(best.done, best.cost * search.curves.noise**2, np.inf)
    reduced = cost[free] / np.maximum(search.dof[free], 1)
    worst = free[np.argsort(-reduced, kind="stable")][: many // 2]
    rest = np.setdiff1d(free, worst)
    by_chance = random.permutation(rest)[: many - len(worst)]
    return [*worst.tolist(), *by_chance.tolist()]
