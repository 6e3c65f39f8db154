"""From the points at which the starts of a fit ended to the `Fit` that is returned."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from fitting.outcomes.curvature import by_curvature
from fitting.outcomes.findings import Found, Subject, findings
from fitting.problem.evaluation import Evaluated
from fitting.problem.lanes import STAGE, Ends, best_of, joined
from fitting.problem.problem import Problem
from fitting.problem.unknowns import Unknowns
from fitting.residuals.error_model import misses_without_freedom
from fitting.results import result_parts as status
from fitting.results.diagnostics import Finding
from fitting.results.result import FitData
from fitting.results.result_parts import Alternative, ErrorModel, Estimate
from fitting.samples.parameters import value_and_slope
from fitting.searching.last_steps import refined
from fitting.searching.minima import SAME_CHI2, Around, Minimum, minima, scatter_of
from fitting.searching.without_fringes import FRINGES, fringes_of, without_fringes
from fitting.uncertainty.covariance import End
from fitting.uncertainty.intervals import PROFILE, QUADRATIC, Intervals, intervals
from fitting.uncertainty.likelihood import criteria
from fitting.uncertainty.spline_errors import errors_of_curves, with_errors_of_curves

# So many of the other minima have intervals by profile, the rest quadratic ones.
_OTHERS = 3


def parameters_at(u: Unknowns, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return parameters and their slopes dx/dy at y, each (..., p)."""
    both = [value_and_slope(w.parameter.coordinate, y[..., i]) for i, w in enumerate(u.moving)]
    x, slope = (np.stack(part, -1) for part in zip(*both, strict=True))
    return x, slope


_STATUS = {"low": status.AT_LOWER, "high": status.AT_UPPER}


def _estimates(u: Unknowns, end: End, known: Intervals) -> dict[str, Estimate]:
    """Return the free parameters at one minimum, by name."""
    x, _ = parameters_at(u, end.y)
    with np.errstate(invalid="ignore"):
        sigmas = np.sqrt(np.diagonal(_covariance(u, end)))
    out = {}
    for i in np.flatnonzero(u.free):
        inside = u.spec.moving[i]
        name, at = u.labels[inside], end.known.at_bound[i]
        unseen = status.UNDETERMINED if end.known.unseen_of[i] else status.FITTED
        out[name] = Estimate(
            name=name, unit=u.units[inside], value=float(x[i]), sigma=float(sigmas[i]),
            interval=known.ends[i], interval_kind=known.kind[i],
            upper_limit=float(known.limits[i]), status=_STATUS.get(at, unseen),
        )  # fmt: skip
    return out


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


def _covariance(u: Unknowns, end: End) -> np.ndarray:
    """Return the covariance (p, p) of the parameters, NaN where there is no error."""
    _, slope = parameters_at(u, end.y)
    with np.errstate(invalid="ignore"):
        out = end.known.covariance * np.outer(slope, slope)
    unseen = end.known.unseen_of
    out[~np.isfinite(out) | unseen | unseen[:, None]] = np.nan
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
    # If the scatter is that of many fits, t is close to that of the normal distribution; without a
    # degree of freedom stated errors are used as they are.
    taken = fit.dof == 0 and fit.seen.stated
    estimated = fit.asked.scaled and fit.pooled is None and not taken
    some, rest = every[: 1 + _OTHERS], every[1 + _OTHERS :]
    return [
        *intervals(fit, some, noise, wanted=wanted, estimated=estimated, enough=enough),
        *intervals(fit, rest, noise, wanted=QUADRATIC, estimated=estimated),
    ]


def _rounding(fit: Problem, noise: float) -> float:
    """Return the size below which differences of the cost are rounding."""
    return 1e-27 * fit.squares / noise**2


def fit_of(fit: Problem, ends: Ends, noise: float, of: Subject) -> FitData:
    """Return the result of a fit from the points (p, L) at which its starts ended."""
    u = fit.u
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
        curved = _intervals(fit, [end], noise, PROFILE)[0]
        if (seen := by_curvature(fit, end, curved, noise)) is not None:
            end, every[0], ranges[0] = seen, seen, curved
    rises = np.array([e.cost - end.cost for e in every[1:]])
    rises = rises / scatter if scatter > 0.0 else 0.0 * rises
    others = tuple(
        Alternative(parameters=_estimates(u, e, i), delta_chi2=rise, reached=m.reached)
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
    s, taken = end.slopes, _errors_taken(fit)
    of_x = _covariance(u, end)[np.ix_(u.free, u.free)]
    estimates = _estimates(u, end, ranges)
    why, chi2 = Finding("not_converged", np.True_, {}), float(s.residual @ s.residual)
    tested = not (f.failed or end.known.unseen.size or u.spec.priors)
    tested &= seen.stated or of.sample is not None
    of_plain = s.plain @ s.plain, len(s.plain)
    if tested and misses_without_freedom(chi2, *of_plain, fit.dof, seen.stated):
        f, values = f._replace(failed=True), {"n_data": fit.n_data, "rms": _rms(s.plain)}
        why = Finding("misses_without_freedom", np.True_, values)
    if f.failed:
        of_x = np.full_like(of_x, np.nan)
        estimates = {n: e.without_error() for n, e in estimates.items()}
        found: tuple[Finding, ...] = (why,)
    else:
        with np.errstate(invalid="ignore"):
            size = np.sqrt(np.diagonal(of_x))
            found = findings(fit, of, f, estimates, of_x / np.outer(size, size), taken)
    chi2 = chi2 if seen.stated else np.nan
    bic, aicc = criteria(u.spec.loss, s.residual, fit.n_data, len(estimates), fit.asked.scaled)
    evaluator = None
    if of.sample is not None:
        evaluator = Evaluated(of.sample, u, seen, fit.targets, end.y, errors, np.atleast_1d(known),
                              inside=(ranges.inside, ranges.t))  # fmt: skip
    with np.errstate(invalid="ignore"):
        factor = float(np.sqrt(end.known.variance))
    return FitData(
        sample=of.sample, covariance=of_x,
        parameters=estimates | fixed_and_tied(u, end.y, estimates),
        wavelength_um=known if len(known) > 1 else float(known[0]),
        chi2=chi2, chi2_reduced=chi2 / fit.dof if fit.dof else np.nan, dof=fit.dof,
        n_data=fit.n_data, rms=_rms(s.plain), cost=end.cost, noise=noise,
        rms_of={str(kind): _rms(s.plain[s.kind == kind]) for kind in dict.fromkeys(s.kind)},
        status=status.NOT_CONVERGED if f.failed else
        status.UNDETERMINED if end.known.unseen.size else status.CONVERGED,
        errors=ErrorModel(taken, factor, 0.0, seen.stated), evaluations=evaluations,
        starts=fit.starts, reached=f.reached, loss=u.spec.loss, bic=bic, aicc=aicc, findings=found,
        others=f.others, measurement=m, curve=None if m is None else seen.curve,
        curve_names=seen.curve_names, evaluator=evaluator,
    )  # fmt: skip


def _rms(residual: np.ndarray) -> float:
    return float(np.sqrt(np.mean(residual**2)))


def _errors_taken(fit: Problem) -> str:
    """Return how the fit used the errors of the data."""
    if fit.asked.errors == "stated":
        return "stated"
    # Without a degree of freedom only the stated errors are available.
    alone = "scaled" if fit.dof else "stated"
    return alone if fit.seen.stated else "equal"
