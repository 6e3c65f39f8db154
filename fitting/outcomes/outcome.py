"""From the points at which the starts of a fit ended to the `Fit` that is returned."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import jax
import numpy as np

from fitting.data.quantities import POWERS
from fitting.optics.spec import Spec
from fitting.outcomes.curvature import by_curvature
from fitting.outcomes.doubtful_index import of_a_solid
from fitting.outcomes.findings import Found, Subject, findings, findings_of_all
from fitting.problem.evaluation import Evaluated
from fitting.problem.lanes import LANES, STAGE, Ends, best_of, joined
from fitting.problem.problem import Problem
from fitting.problem.unknowns import Unknowns
from fitting.process.progress import tell
from fitting.residuals.error_model import misses_without_freedom
from fitting.residuals.noise import noise_of_misfits
from fitting.results import result_parts as status
from fitting.results.diagnostics import ranked
from fitting.results.result import FitData
from fitting.results.result_parts import Alternative, ErrorModel, Estimate
from fitting.samples.parameters import value_and_slope
from fitting.samples.sample import Sample
from fitting.searching.last_steps import refined
from fitting.searching.minima import SAME_CHI2, Around, Minimum, minima, scatter_of
from fitting.searching.without_fringes import FRINGES, fringes_of, without_fringes
from fitting.uncertainty.covariance import End, Uncertainty
from fitting.uncertainty.intervals import (
    QUADRATIC,
    Intervals,
    Minima,
    intervals,
    total_reflection,
)
from fitting.uncertainty.likelihood import criteria, reduced_chi2
from fitting.uncertainty.limits import ROUNDING, student_quantile
from fitting.uncertainty.profile import Lanes
from fitting.uncertainty.spline_errors import errors_of_curves, with_errors_of_curves

# So many of the other minima have intervals by profile, the rest quadratic ones.
OTHERS = 3
# A fit is not converged where a place was met whose chi2 is lower by more than that: its minimum,
# which was not reached, lies a standard error away.
_LOWER = 1.0


def parameters_at(u: Unknowns, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return parameters and their slopes dx/dy at y, each (..., p)."""
    both = [value_and_slope(w.parameter.coordinate, y[..., i]) for i, w in enumerate(u.moving)]
    x, slope = (np.stack(part, -1) for part in zip(*both, strict=True))
    return x, slope


class Shaped:
    """The values of some of N fits in the batch shape, NaN or ``fill`` for the others."""

    def __init__(self, shape: tuple[int, ...], count: int, which: np.ndarray):
        self.shape, self.count, self.which = shape, count, which

    def __call__(self, values: np.ndarray, fill: Any = np.nan) -> Any:
        values = np.asarray(values)
        kind = object if values.dtype == object else np.result_type(values, type(fill))
        whole = np.full((self.count, *values.shape[1:]), fill, kind)
        whole[self.which] = values
        whole = whole.reshape(self.shape + values.shape[1:])
        return whole.item() if whole.ndim == 0 else whole


_ONE = Shaped((), 1, np.zeros(1, int))


def estimates(
    u: Unknowns, y: np.ndarray, known: Uncertainty, ends: np.ndarray, kinds: Any,
    limits: np.ndarray, failed: np.ndarray, put: Shaped,
) -> tuple[dict[str, Estimate], np.ndarray]:  # fmt: skip
    """Return the free parameters at n minima by name, and their covariance (n, P, P).

    y: (n, p). ends, kinds, limits: 95 % intervals (n, p, 2), how they were found, and upper limits.
    failed: (n,), of which fits the values mean nothing.
    """
    x, slope = parameters_at(u, y)
    unseen = known.unseen_of | failed[:, None]
    with np.errstate(invalid="ignore"):
        covariance = known.covariance * (slope[:, :, None] * slope[:, None, :])
        # What is compatible with 0 has a limit, and no standard error, which would not be one.
        none = unseen | np.isfinite(limits)
        blank = ~np.isfinite(covariance) | none[:, :, None] | none[:, None, :]
        covariance = np.where(blank, np.nan, covariance)
        sigma = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    ends, limits = (
        np.where(failed.reshape(-1, *[1] * (a.ndim - 1)), np.nan, a) for a in (ends, limits)
    )
    kinds = np.where(np.isnan(ends).any(-1), status.NONE, kinds)
    states = np.select(
        [unseen, known.at_bound == "low", known.at_bound == "high"],
        [status.UNDETERMINED, status.AT_LOWER, status.AT_UPPER], status.FITTED,
    )  # fmt: skip
    out = {}
    for i in np.flatnonzero(u.free):
        inside = u.spec.moving[i]
        name = u.labels[inside]
        out[name] = Estimate(
            name=name, unit=u.units[inside], value=put(x[:, i]), sigma=put(sigma[:, i]),
            interval=put(ends[:, i]), interval_kind=put(kinds[:, i], status.NONE),
            upper_limit=put(limits[:, i]), status=put(states[:, i], status.UNDETERMINED),
        )  # fmt: skip
    return out, covariance[:, u.free][:, :, u.free]


def _as_batch(known: Uncertainty) -> Uncertainty:
    """Return what is known of one minimum as that of a batch of one."""
    return Uncertainty(*(np.asarray(a)[None] for a in known))


def _estimates(
    u: Unknowns, end: End, known: Intervals, failed: bool = False
) -> tuple[dict[str, Estimate], np.ndarray]:
    """Return the free parameters at one minimum by name, and their covariance (P, P)."""
    found, covariance = estimates(
        u, end.y[None], _as_batch(end.known), known.ends[None], known.kind[None],
        known.limits[None], np.array([failed]), _ONE,
    )  # fmt: skip
    return found, covariance[0]


def too_few(u: Unknowns, sample: Sample | None, n_data: Any) -> Any:
    """Return which fits of an index that is free at every wavelength have too few data.

    With k at 0, the end of its range, a single datum would seem to determine eta.
    """
    return (n_data < u.free.sum()) & (sample is not None and sample.by_wavelength)


def all_unseen(known: Uncertainty, where: Any = True) -> Uncertainty:
    """Return the same with no error of any parameter, of the minima (...) where that is so."""
    return known._replace(unseen_of=known.unseen_of | np.asarray(where)[..., None])


def combinations_unseen(u: Unknowns, known: Uncertainty, put: Shaped) -> Iterator[tuple[Any, Any]]:
    """Yield which of n fits have a first combination that is not seen, a second, ..., and names."""
    count = known.hidden.sum(1)
    for turn in range(count.max(initial=0)):
        names = np.empty(len(count), object)
        for i in np.flatnonzero(count > turn):
            direction = np.abs(known.directions[i][:, known.hidden[i]][:, turn])
            parts = direction > 0.1 * direction.max()
            names[i] = tuple(
                u.labels[n] for n, part in zip(u.spec.moving, parts, strict=True) if part
            )
        yield put(count > turn, False), put(names)


def fixed_and_tied(u: Unknowns, y: np.ndarray, free: dict[str, Estimate]) -> dict[str, Estimate]:
    """Return the parameters that were fixed or tied, by name. y: (p,), of one fit."""
    x, _ = parameters_at(u, y)
    values = {n: float(v) for n, v in zip(u.spec.moving, x, strict=True)}
    values |= {n: float(v) for n, v in zip(u.spec.held, u.held, strict=True)}
    every, out = {}, {}
    for inside, value in values.items():
        name = u.labels.get(inside, "")
        every[inside] = free.get(name) or Estimate(
            name=name, unit=u.units.get(inside, ""), value=value, sigma=0.0,
            interval=np.array([value, value]), interval_kind=status.NONE, status=status.FIXED,
        )  # fmt: skip
        if name and name not in free:
            out[name] = every[inside]
    for inside, factor, of in u.spec.tied:
        name, e = u.labels[inside], every[of]
        out[name] = replace(
            e, name=name, unit=u.units[inside], value=factor * e.value,
            sigma=abs(factor) * e.sigma, interval=np.sort(factor * e.interval),
            upper_limit=np.nan, status=status.TIED,
        )  # fmt: skip
    return out


def _minima(
    fit: Problem, ends: Ends, look: Callable[[int], End], noise: float, scatter: float, most: float
) -> list[Minimum]:
    """Return the minima that fit nearly as well as the best one, the one to be shown first.

    look: returns where a lane ended. At normal incidence N and eta_i^2 / N have the same
    reflectance; of two that fit equally well within one unit of chi2 the one above eta_i is shown.
    """
    rounding = _rounding(fit, noise)
    unit = np.sqrt(scatter + rounding) + 1e-150

    def around(lane: int) -> Around:
        end = look(lane)
        edge = 4.0 * unit * end.known.edge
        rows = end.slopes.jacobian / (unit * noise)
        return Around(np.where(np.isfinite(edge), edge, np.inf), rows)

    found = minima(ends, scatter, most, rounding, around)
    if len(found) > 1 and isinstance(fit.u.spec, Spec):
        # Noise decides which of them is the lowest: what can be a material is shown first.
        solid = next((m for m in found if of_a_solid(fit, ends.y[:, m.lane])), found[0])
        found.sort(key=lambda m: m is not solid)
    free = [i for i, name in enumerate(fit.u.spec.moving) if name.endswith(".eta")]
    eta_i = float(np.mean(fit.targets.eta_i))
    if len(found) < 2 or len(free) != 1:  # of the surface, or of a plate
        return found
    eta = ends.y[free[0]]
    least = ends.cost[found[0].lane]
    usual = [
        m for m in found
        if eta[m.lane] >= eta_i and ends.cost[m.lane] <= least + scatter + rounding
    ]  # fmt: skip
    return sorted(found, key=lambda m: m is not usual[0]) if usual else found


def _intervals(
    fit: Problem, every: Sequence[End], noise: float, wanted: str, enough: float = -np.inf
) -> list[Intervals]:
    """Return the intervals at the minimum that is shown and at the others.

    enough: a cost that ends the search for them, if a place below it is met.
    """
    # Without a degree of freedom stated errors are used as they are.
    taken = fit.dof == 0 and fit.seen.stated
    t = student_quantile(max(fit.dof, 1) if fit.asked.scaled and not taken else 0)
    count = len(every)
    y, critical = np.stack([e.y for e in every]), np.nan
    if isinstance(fit.u.spec, Spec):
        angle = np.radians(fit.seen.points.angle_deg.max())
        critical = float(np.mean(fit.targets.eta_i) * np.sin(angle))
    m = Minima(
        np.zeros(count, int), y, np.array([e.cost for e in every]),
        Uncertainty(*(np.stack(a) for a in zip(*(e.known for e in every), strict=True))),
        np.full(count, t), np.full(count, ROUNDING * fit.squares / noise**2),
        np.where(np.arange(count) <= OTHERS, wanted, QUADRATIC),
        total_reflection(fit.u, y, critical),
    )  # fmt: skip
    at = Lanes(lambda y, row, _, steps: fit.pinned(y, row, noise, steps), LANES)
    found = intervals(fit.u, fit.limits, m, at, enough)
    return [jax.tree.map(lambda a, i=i: a[i], found) for i in range(count)]


def _rounding(fit: Problem, noise: float) -> float:
    """Return the size below which differences of the cost are rounding."""
    return 1e-27 * fit.squares / noise**2


def fit_of(fit: Problem, ends: Ends, noise: float, of: Subject) -> FitData:
    """Return the result of a fit from the points (p, L) at which its starts ended."""
    u = fit.u
    tell(done=0, stage="errors and intervals")
    best = best_of(ends)
    lane = int(np.argmin(ends.cost)) if best is None else best
    end = refined(fit, ends.y[:, lane], noise)
    failed = best is None or not end.finite
    scatter, most = scatter_of(fit, end.cost, noise)
    looked_at = {lane: end}

    # Without a degree of freedom lanes rest within 1e-4 of the cost. What `choose` only compares
    # needs no last steps of dozens of other minima.
    fell = ends.cost[lane] - end.cost > max(SAME_CHI2 * scatter, 1e-3 * end.cost)
    fell &= fit.asked.thorough

    def look(lane: int) -> End:
        if lane not in looked_at:
            looked_at[lane] = refined(fit, ends.y[:, lane], noise, fell)
        return looked_at[lane]

    found = [] if failed else _minima(fit, ends, look, noise, scatter, most)
    if fell and found:
        # In a curved valley lanes stop at many places. These are one minimum if the last steps of
        # each lead to the same.
        lanes = [m.lane for m in found]
        steps = [look(m) for m in lanes]
        ends = ends.moved(lanes, np.stack([e.y for e in steps], 1), [e.cost for e in steps])
        found = _minima(fit, ends, look, noise, scatter, most)
    if found and found[0].lane != lane:
        lane = found[0].lane
        end = refined(fit, ends.y[:, lane], noise)
    enough = SAME_CHI2 * scatter + _rounding(fit, noise)
    told = of.films and not failed and fit.asked.thorough
    plain = without_fringes(fit, end.y, noise) if told else None
    if plain is not None and plain.ends.done.all() and plain.ends.cost[0] < end.cost - enough:
        return fit_of(fit, joined([ends, plain.ends]), noise, of)
    if plain is not None and plain.cost - end.cost > plain.by_chance * scatter:
        plain = None
    fringeless = None
    if plain is not None:
        ends = joined([ends, plain.ends])
        found = _minima(fit, ends, look, noise, scatter, most)
        if plain.ends.cost[0] - end.cost > most:
            found.append(Minimum(len(ends.cost) - 1, 1))
        # Less than a fringe with the index of the lowest minimum; with a higher one of its own it
        # may have the same fringes.
        if fringes_of(fit, plain.ends.y[:, 0]) < max(FRINGES, 0.5 * fringes_of(fit, end.y)):
            # The lowest without them is shown, the others follow by their chi2.
            first = next((m for m in found if fringes_of(fit, look(m.lane).y) < FRINGES), found[0])
            found.sort(key=lambda m: m is not first)
            lane, lowest = first.lane, end
            end = refined(fit, ends.y[:, lane], noise)
            rise = (max(plain.cost, end.cost) - lowest.cost) / scatter
            fringeless = plain.told(fit, end.y, lowest.y, rise)
    every = [end] + [look(m.lane) for m in found[1:]]
    if too_few(u, of.sample, fit.n_data):
        every = [e._replace(known=all_unseen(e.known)) for e in every]
        end = every[0]
    wanted = QUADRATIC if failed else fit.asked.intervals
    # The minimum that is shown need not be the lowest one.
    below = min(e.cost for e in every) - enough
    lower = 0.0
    for until in (below, -np.inf):
        ranges = _intervals(fit, every, noise, wanted, until)
        least, place = min((r.lowest for r in ranges), key=lambda met: met[0])
        if failed or not least < below:
            break
        # The search for the ends of the intervals met a lower place. If no minimum is next to it,
        # the search goes on to its end.
        more = fit.held(place[:, None], noise, STAGE)
        if more.done.all() and more.cost[0] < below:
            return fit_of(fit, joined([ends, more]), noise, of)
        lower = (end.cost - min(least, more.cost[0])) / scatter
    if end.known.unseen.size and wanted != QUADRATIC:
        end = every[0] = by_curvature(fit, end, ranges[0], noise) or end
    rises = np.array([e.cost - end.cost for e in every[1:]])
    rises = rises / scatter if scatter > 0.0 else 0.0 * rises
    others = tuple(
        Alternative(parameters=_estimates(u, e, i)[0], delta_chi2=rise, reached=m.reached)
        for e, i, m, rise in zip(every[1:], ranges[1:], found[1:], rises.tolist(), strict=True)
    )
    return _assembled(
        fit, of, noise, int(ends.evaluations[lane]),
        Found(
            end=end, known=ranges[0], others=others, reached=found[0].reached if found else 0,
            lower=lower, failed=failed, fringeless=fringeless,
        ),
    )  # fmt: skip


def _assembled(fit: Problem, of: Subject, noise: float, evaluations: int, f: Found) -> FitData:
    """Return the result of a fit whose best minimum is known."""
    u, seen, m = fit.u, fit.seen, of.measurement
    known = np.array([np.nan]) if m is None else np.unique(m.wavelength_um)
    known = known[np.isfinite(known)] if np.isfinite(known).any() else known
    # With one datum at each wavelength only the bounds of a spline's amplitudes keep the index
    # finite: errors without these bounds are a hundred times too large.
    two = of.sample is not None and fit.n_data >= 2 * len(known)
    errors = errors_of_curves(fit, f.end, noise) if two else f.end.known.covariance
    end, ranges = with_errors_of_curves(u, f.end, f.known, errors)
    f = f._replace(end=end, known=ranges)
    s, stated = end.slopes, seen.stated
    square = float(s.residual @ s.residual)
    tested = not (f.failed or end.known.unseen.size or u.spec.priors)
    tested &= stated or of.sample is not None
    of_plain = s.plain @ s.plain, len(s.plain)
    missed = tested and bool(misses_without_freedom(square, *of_plain, fit.dof, stated))
    failed = f.failed or missed
    unseen = bool(end.known.unseen.size)
    few = bool(too_few(u, of.sample, fit.n_data)) and not (failed or unseen)
    # Of one datum without an error nothing is known, not even whether the sample is the right one.
    alone = fit.n_data == 1 and not stated and not (of.sample and of.sample.by_wavelength)
    shown, of_x = _estimates(u, end, ranges, failed)
    chi2 = square if stated else np.nan
    bic, aicc = criteria(u.spec.loss, s.residual, fit.n_data, len(shown), fit.asked.scaled)
    evaluator = None if of.sample is None else Evaluated(
        of.sample, u, seen, fit.targets, end.y, errors, np.atleast_1d(known),
        inside=(ranges.inside, ranges.t))  # fmt: skip
    kinds = {kind: int((s.kind == kind).sum()) for kind in dict.fromkeys(s.kind.tolist())}
    with np.errstate(invalid="ignore"):
        factor = float(np.sqrt(end.known.variance))
    found = FitData(
        sample=of.sample, covariance=of_x, parameters=shown | fixed_and_tied(u, end.y, shown),
        wavelength_um=known if len(known) > 1 else float(known[0]),
        chi2=chi2, chi2_reduced=chi2 / fit.dof if fit.dof else np.nan, dof=fit.dof,
        n_data=fit.n_data, rms=_rms(s.plain), cost=end.cost, noise=noise,
        rms_of={kind: _rms(s.plain[s.kind == kind]) for kind in kinds}, n_of=kinds,
        status=status.NOT_CONVERGED if failed else
        status.UNDETERMINED if unseen or few else status.CONVERGED,
        errors=ErrorModel(_errors_taken(fit), factor, 0.0, stated), evaluations=evaluations,
        starts=fit.starts, reached=f.reached, loss=u.spec.loss, bic=bic, aicc=aicc,
        others=f.others, measurement=m, curve=None if m is None else seen.curve,
        curve_names=seen.curve_names, evaluator=evaluator,
    )  # fmt: skip
    # The caller's own residuals are in units of their errors, too.
    known_size = stated or not seen.curve_names
    reduced = reduced_chi2(u.spec.loss, s.residual, fit.dof) if known_size else np.nan
    combinations = combinations_unseen(u, _as_batch(end.known), _ONE)
    told = findings_of_all(
        found, reduced, missed, combinations, _noise_of_misfit(fit, f.end, known)
    )
    if f.fringeless is not None:  # few starts end there, where chi2 is not the lowest
        told = [one for one in told if one.code != "few_starts_agree"]
    told += [] if failed else findings(fit, of, f, shown, found.correlation)
    if f.lower > _LOWER:
        found = replace(found, status=status.NOT_CONVERGED)
    elif alone and found.status == status.CONVERGED:
        found = replace(found, status=status.UNDETERMINED)
    return replace(found, findings=ranked(told))


def _noise_of_misfit(fit: Problem, end: End, known: np.ndarray) -> float:
    """Return the noise of powers over the angle at one wavelength, if the fit misses them by more.

    Of curves that share their unknowns `pattern` tells what is no noise.
    """
    seen, s = fit.seen, end.slopes
    if len(known) > 1 or not seen.channels or not set(seen.channels) <= set(POWERS):
        return np.nan
    weight, value = (np.stack([a[:, 0] for a in each]) for each in (seen.weights, seen.values))
    slopes = np.zeros((1, *weight.shape, len(end.y)))
    slopes[0, weight > 0.0] = s.jacobian
    off = (s.seen - value)[None]
    return float(noise_of_misfits(
        seen.points.angle_deg[None, :, 0], value[None], off, weight[None], lambda _: slopes
    )[0])  # fmt: skip


def _rms(residual: np.ndarray) -> float:
    return float(np.sqrt(np.mean(residual**2)))


def _errors_taken(fit: Problem) -> str:
    """Return how the fit used the errors of the data."""
    if fit.asked.errors == "stated":
        return "stated"
    # Without a degree of freedom only the stated errors are available.
    alone = "scaled" if fit.dof else "stated"
    return alone if fit.seen.stated else "equal"
