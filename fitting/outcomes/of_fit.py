"""From the points at which the starts of a single fit ended to its result."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import jax
import numpy as np

from fitting.data.quantities import POWERS
from fitting.optics.spec import Spec
from fitting.outcomes.findings import Subject, findings, stacked_findings
from fitting.outcomes.outcome import (
    EXACT,
    Shaped,
    Solutions,
    first_of,
    ranges_of,
    result_of,
    too_few,
    without_errors,
)
from fitting.outcomes.surface_verdicts import Verdicts, marked, verdicts_of_fit
from fitting.problem.evaluation import Evaluated
from fitting.problem.lanes import LANES, STAGE, Ends, best_of, joined
from fitting.problem.problem import Problem
from fitting.process.progress import tell
from fitting.residuals.noise import noise_of_misfits
from fitting.results import result_parts as status
from fitting.results.diagnostics import ranked
from fitting.results.result import FitData
from fitting.results.result_parts import PROFILE
from fitting.searching.last_steps import refined
from fitting.searching.minima import SAME_CHI2, Around, Minimum, minima, scatter_of
from fitting.searching.without_fringes import FRINGES, fringes_of, without_fringes
from fitting.uncertainty.covariance import End
from fitting.uncertainty.intervals import QUADRATIC, Intervals
from fitting.uncertainty.likelihood import criteria, reduced_chi2
from fitting.uncertainty.limits import ROUNDING, student_quantiles
from fitting.uncertainty.profile import Lanes
from fitting.uncertainty.spline_errors import errors_of_curves, with_errors_of_curves

# A fit is not converged where a place was met whose chi2 is lower by more than that: its minimum,
# which was not reached, lies a standard error away.
_LOWER = 1.0


class Ended(NamedTuple):
    """One fit, where its starts ended (p, L), and the noise for which they were weighted."""

    fit: Problem
    ends: Ends
    noise: float
    of: Subject


class Found(NamedTuple):
    """What is known of one fit: its minima, that to be shown first, with their intervals.

    end: the first of them. lower: by how much chi2 is lower at a fit near it whose own minimum was
    not reached; 0 if there is none. fringeless: the values of the warning if its fringes are no
    larger than those of noise. numbers: what `result_of` takes. verdicts: on its index, if asked.
    """

    minima: list[Solutions]
    ranges: list[Intervals]
    end: End
    lower: float
    fringeless: dict[str, Any] | None
    numbers: dict[str, Any]
    evaluator: Evaluated | None
    verdicts: Verdicts | None


def _minima(
    fit: Problem, ends: Ends, look: Callable[[int], End], noise: float, scatter: float, most: float
) -> list[Minimum]:
    """Return the minima that fit nearly as well as the best one, the one to be shown first.

    look: returns where a lane ended.
    """
    rounding = _rounding(fit, noise)
    unit = np.sqrt(scatter + rounding) + 1e-150
    exact = ends.cost[ends.done & (ends.cost <= SAME_CHI2 * scatter) & (fit.dof == 0)]

    def around(lane: int) -> Around:
        end = look(lane)
        level = 2.0 * EXACT * np.sqrt(exact.max(initial=0.0)) + np.sqrt(rounding)
        edge = (level if len(exact) else 4.0 * unit) * end.known.edge
        rows = end.slopes.jacobian / (unit * noise)
        return Around(np.where(np.isfinite(edge), edge, np.inf), rows)

    found = minima(ends, scatter, most, rounding, around)
    if len(found) < 2 or not isinstance(fit.u.spec, Spec):
        return found
    lanes, outside = [m.lane for m in found], np.mean(fit.targets.eta_i)
    first = first_of(fit, outside, ends.y.T[lanes, None], ends.cost[lanes, None], scatter, rounding)
    return [found.pop(first[0]), *found]


def _rounding(fit: Problem, noise: float) -> float:
    """Return the size below which differences of the cost are rounding."""
    return ROUNDING * fit.squares / noise**2


def _solution(e: Ended, end: End, reached: int, number: int, kinds: Iterable[str]) -> Solutions:
    """Return a minimum of one of many fits, the residuals by kind."""
    fit, noise, s = e.fit, e.noise, end.slopes
    of = [s.plain[s.kind == c] for c in kinds]
    plain, counts = np.array([float(r @ r) for r in of]), np.array([len(r) for r in of])
    whole: Any = (
        number, end.y, end.known, end.cost, fit.squares / noise**2, plain, counts, reached
    )  # fmt: skip
    return Solutions(*jax.tree.map(lambda a: np.asarray(a)[None], whole))


def _found(e: Ended, number: int, kinds: Iterable[str]) -> Found:
    """Return what is known of one of many fits."""
    fit, ends, noise, of = e
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
        ends = ends._replace(y=ends.y.copy(), cost=ends.cost.copy())
        for m in found:
            ends.y[:, m.lane], ends.cost[m.lane] = look(m.lane).y, look(m.lane).cost
        found = _minima(fit, ends, look, noise, scatter, most)
    if found and found[0].lane != lane:
        lane = found[0].lane
        end = refined(fit, ends.y[:, lane], noise)
    enough = SAME_CHI2 * scatter + _rounding(fit, noise)
    told = of.films and not failed and fit.asked.thorough
    plain = without_fringes(fit, end.y, noise) if told else None
    if plain is not None and plain.ends.done.all() and plain.ends.cost[0] < end.cost - enough:
        return _found(e._replace(ends=joined([ends, plain.ends])), number, kinds)
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
    every = [end, *(look(m.lane) for m in found[1:])]
    reached = [m.reached for m in found] or [0]
    solutions = [
        _solution(e, each, r, number, kinds) for each, r in zip(every, reached, strict=True)
    ]
    if too_few(u, of.sample, fit.n_data):
        solutions = [without_errors(m, True) for m in solutions]
    scaled, dof = fit.asked.scaled, np.array([fit.dof])
    t, critical = student_quantiles(dof * scaled), np.array([np.nan])
    if isinstance(u.spec, Spec):
        angle = np.radians(fit.seen.points.angle_deg.max())
        critical[:] = np.mean(fit.targets.eta_i) * np.sin(angle)
    wanted = QUADRATIC if failed else fit.asked.intervals
    at = Lanes(lambda y, row, _, steps: fit.pinned(y, row, noise, steps), LANES)
    # The minimum that is shown need not be the lowest one.
    below = min(each.cost for each in every) - enough
    lower, ranges = 0.0, list[Intervals]()
    for until in (below, -np.inf):
        ranges = ranges_of(u, fit.limits, solutions, t, wanted, critical, at, until)
        least, place = min(((r.lowest[0][0], r.lowest[1][0]) for r in ranges), key=lambda r: r[0])
        if failed or not least < below:
            break
        # The search for the ends of the intervals met a lower place. If no minimum is next to it,
        # the search goes on to its end.
        more = fit.held(place[:, None], noise, STAGE)
        if more.done.all() and more.cost[0] < below:
            return _found(e._replace(ends=joined([ends, more])), number, kinds)
        lower = (end.cost - min(least, more.cost[0])) / scatter
    if end.known.unseen.size and wanted != QUADRATIC:
        solutions[0] = _by_curvature(fit, solutions[0], ranges[0], noise)

    # With one datum at each wavelength only the bounds of a spline's amplitudes keep the index
    # finite: errors without these bounds are a hundred times too large.
    first, waves, s = solutions[0], _wavelengths(of), end.slopes
    end = end._replace(known=jax.tree.map(lambda a: a[0], first.known))
    two = of.sample is not None and fit.n_data >= 2 * len(waves)
    errors = errors_of_curves(fit, end, noise) if two else end.known.covariance
    covariance, ranges[0] = with_errors_of_curves(u, end, ranges[0], errors)
    solutions[0] = first._replace(known=first.known._replace(covariance=covariance[None]))
    verdicts, y = verdicts_of_fit(fit, end, noise)
    evaluator = None
    if of.sample is not None:
        inside = ranges[0].inside[0], float(t[0])
        evaluator = Evaluated(of.sample, u, fit.seen, fit.targets, y, errors, waves, inside)
    # The caller's own residuals are in units of their errors, too.
    sized = fit.seen.stated or not fit.seen.curve_names
    bic, aicc = criteria(u.spec.loss, s.residual, fit.n_data, int(u.free.sum()), scaled)
    numbers = {
        "scatter": scatter, "failed": failed, "dof": fit.dof, "n_data": fit.n_data,
        "starts": fit.starts, "evaluations": ends.evaluations[lane], "noise": noise,
        "chi2": float(s.residual @ s.residual), "bic": bic, "aicc": aicc,
        "reduced": reduced_chi2(u.spec.loss, s.residual, fit.dof) if sized else np.nan,
        "missed_noise": _noise_of_misfit(fit, end, waves),
    }  # fmt: skip
    return Found(solutions, ranges, end, lower, fringeless, numbers, evaluator, verdicts)


def _wavelengths(of: Subject) -> np.ndarray:
    known = (
        np.array([np.nan]) if of.measurement is None else np.unique(of.measurement.wavelength_um)
    )
    return known[np.isfinite(known)] if np.isfinite(known).any() else known


def fits_of(every: Sequence[Ended], shape: tuple[int, ...] = ()) -> FitData:
    """Return the result of a fit, (), or of fits of own residuals, each searched by itself."""
    one, count = every[0], len(every)
    sample, seen, put = one.of.sample, one.fit.seen, Shaped(shape, count, np.arange(count))
    kinds = dict.fromkeys(c for e in every for c in e.fit.u.spec.channels or ("residuals",))
    found = [_found(e, i, kinds) for i, e in enumerate(every)]

    def joined_up(parts: Sequence[Any]) -> Any:
        return jax.tree.map(lambda *a: np.concatenate(a), *parts)

    turns = range(max(len(f.minima) for f in found))
    minima, ranges = (
        [joined_up([p[i] for p in parts if len(p) > i]) for i in turns]
        for parts in ([f.minima for f in found], [f.ranges for f in found])
    )
    numbers = {n: np.array([f.numbers[n] for f in found]) for n in found[0].numbers}
    numbers |= {n: put(numbers[n]) for n in ("noise", "bic", "aicc")}
    m = one.of.measurement
    result = result_of(
        one.fit, sample, put, minima, ranges, known_um=_wavelengths(one.of), **numbers,
        evaluator=found[0].evaluator, measurement=m, curve=None if m is None else seen.curve,
        curve_names=seen.curve_names, kinds=tuple(kinds),
    )  # fmt: skip
    fringeless = put(np.array([f.fringeless is not None for f in found]))
    told = [  # few starts end where chi2 is not the lowest
        replace(f, at=f.at & np.logical_not(fringeless)) if f.code == "few_starts_agree" else f
        for f in result.findings
    ]  # fmt: skip
    each = [result[i] for i in range(count)] if shape else [result]
    more = [
        findings(e.fit, e.of, f.end, f.lower, f.fringeless, r)
        if r.status != status.NOT_CONVERGED else []
        for e, f, r in zip(every, found, each, strict=True)
    ]  # fmt: skip
    told += stacked_findings(more) if shape else more[0]
    # Of one datum without an error nothing is known, not even whether the sample is the right one.
    alone = numbers["n_data"] == 1
    alone &= not (seen.stated or (sample is not None and sample.by_wavelength))
    lower = np.array([f.lower > _LOWER for f in found])
    converged = np.equal(result.status, status.CONVERGED)
    state = np.select(
        [put(lower, False), np.logical_and(put(alone, False), converged)],
        [status.NOT_CONVERGED, status.UNDETERMINED], result.status,
    )[()]  # fmt: skip
    findings_ = ranked(f for f in told if np.any(f.at))
    result = replace(result, status=state if shape else state.item(), findings=findings_)
    return result if found[0].verdicts is None else marked(result, found[0].verdicts, put)


# Half way to the end of an interval chi2 rises by 1/4 of its rise there if it is a square, by 1/16
# if it is a fourth power; along a valley of equal chi2, which may be closed, by nothing.
_RISES = 0.02


def _by_curvature(fit: Problem, m: Solutions, found: Intervals, noise: float) -> Solutions:
    """Return a minimum without unseen parameters if these have intervals by profile.

    The reflectance of an antireflection coating is least at the best index, and changes with the
    square of what is off. Noise that asks for less than that ends there in half of all
    measurements: the derivative is 0, as where the data say nothing, but the profile likelihood has
    ends. Such parameters have no standard errors.
    """
    unseen = np.flatnonzero(m.known.unseen_of[0])
    ends, inside = found.ends[0, unseen], found.inside[0]
    low, high = np.array([(w.low, w.high) for w in fit.u.moving])[unseen].T
    lanes = [2 * int(j) + side for j in unseen for side in (0, 1)]
    if (found.kind[0, unseen] != PROFILE).any() or np.isnan(inside[lanes]).any():
        return m
    if not ((low < ends[:, 0]) & (ends[:, 1] < high)).all():
        return m
    half = 0.5 * (m.y + inside[lanes]).T
    rise = fit.pinned(half, np.repeat(unseen, 2), noise, STAGE).cost - m.cost
    if not (rise > _RISES * found.t**2 * m.known.rise).all():
        return m
    covariance: Any = m.known.covariance.copy()
    covariance[:, unseen] = covariance[:, :, unseen] = np.nan
    return m._replace(known=m.known._replace(
        covariance=covariance, hidden=np.zeros_like(m.known.hidden),
        unseen_of=np.zeros_like(m.known.unseen_of),
    ))  # fmt: skip


def _noise_of_misfit(fit: Problem, end: End, known_um: np.ndarray) -> float:
    """Return the noise of powers over the angle at one wavelength, if the fit misses them by more.

    Of curves that share their unknowns `pattern` tells what is no noise.
    """
    seen, s = fit.seen, end.slopes
    if len(known_um) > 1 or not seen.channels or not set(seen.channels) <= set(POWERS):
        return np.nan
    weight, value = (np.stack([a[:, 0] for a in each]) for each in (seen.weights, seen.values))
    slopes = np.zeros((1, *weight.shape, len(end.y)))
    slopes[0, weight > 0.0] = s.jacobian
    off = (s.seen - value)[None]
    return float(noise_of_misfits(
        seen.points.angle_deg[None, :, 0], value[None], off, weight[None], lambda _: slopes
    )[0])  # fmt: skip
