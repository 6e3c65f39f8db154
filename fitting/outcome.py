"""From where the starts of a model fit ended to the `ModelFit` that a caller sees."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from fitting.evaluation import Evaluated, at_data
from fitting.findings import Findings, sentences
from fitting.measurement import Measurement, concatenate
from fitting.model import result as status
from fitting.model.result import ModelFit
from fitting.parameters import value_and_slope
from fitting.pattern import pattern
from fitting.search import End, Fit, best_of
from fitting.starts import SAME_CHI2, STAGE, Ends, Minimum, minima
from fitting.uncertainty.covariance import Slopes
from fitting.uncertainty.intervals import QUADRATIC, Intervals, intervals
from fitting.uncertainty.likelihood import criteria, reduced_chi2
from fitting.unknowns import Unknowns

# What data are trusted to where neither errors nor scatter tell.
ASSUMED_SIGMA = 1e-3
# So many of the other minima are given intervals by profile, the rest quadratic ones.
_OTHERS = 3


def _parameters_at(u: Unknowns, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return parameters and their slopes dx/dy, (p,) each."""
    both = [value_and_slope(w.parameter.coordinate, y[i : i + 1]) for i, w in enumerate(u.moving)]
    return np.concatenate([b[0] for b in both]), np.concatenate([b[1] for b in both])


def _others(
    u: Unknowns,
    at: Sequence[End],
    known: Sequence[Intervals],
    found: Sequence[Minimum],
    rises: np.ndarray,
) -> tuple[dict[str, Any], ...]:
    """Return the other minima as plain data; all arguments without the best one."""
    names = [u.labels[n] for n in u.spec.moving]
    out = []
    for end, interval, minimum, rise in zip(at, known, found, rises.tolist(), strict=True):
        x, _ = _parameters_at(u, end.y)
        sigmas = np.sqrt(np.diagonal(_covariance(u, end)))

        def named(values: np.ndarray) -> dict[str, Any]:
            rows = zip(names, values.tolist(), u.free, strict=True)
            return {name: value for name, value, free in rows if free}

        out.append({
            "values": named(x), "sigmas": named(sigmas), "intervals": named(interval.ends),
            "interval_kinds": named(np.array(interval.kind)), "delta_chi2": rise,
            "reached": minimum.reached,
        })  # fmt: skip
    return tuple(out)


def _covariance(u: Unknowns, end: End) -> np.ndarray:
    """Return the covariance (p, p) of the parameters, NaN where there is no error."""
    _, slope = _parameters_at(u, end.y)
    with np.errstate(invalid="ignore"):
        out = _blank(end.known.covariance, end.known.unseen_of) * np.outer(slope, slope)
    out[~np.isfinite(out)] = np.nan
    return out


def _blank(covariance: np.ndarray, unseen: np.ndarray) -> np.ndarray:
    out = covariance.copy()
    out[unseen] = np.nan
    out[:, unseen] = np.nan
    return out


def _rms(s: Slopes) -> tuple[float, dict[str, float]]:
    of = {k: float(np.sqrt(np.mean(s.plain[s.kind == k] ** 2))) for k in dict.fromkeys(s.kind)}
    return float(np.sqrt(np.mean(s.plain**2))), {str(k): v for k, v in of.items()}


def _one_power_a_wavelength(measurements: Sequence[Measurement]) -> bool:
    """Whether every wavelength has a single value, and that one of R or T."""
    wavelength = np.concatenate([m.wavelength_um for m in measurements])
    quantity = np.concatenate([m.quantity for m in measurements])
    angle = np.concatenate([m.angle_deg for m in measurements])
    if np.isin(quantity, ("psi", "delta")).any():
        return False
    points = {*zip(wavelength.tolist(), quantity.tolist(), angle.tolist(), strict=True)}
    normal = bool((angle == 0.0).all()) and len(set(quantity.tolist())) == 1
    return normal or len(points) == len(np.unique(wavelength))


def _scatter(fit: Fit, cost: float, noise: float, scaled: bool) -> float:
    """Return what a difference of the cost is measured in."""
    if fit.pooled is not None and scaled:
        return fit.pooled
    few = fit.dof < 3
    scatter = cost / fit.dof if fit.dof else 0.0
    if not scaled or (few and fit.seen.stated) or noise != 1.0:
        return max(scatter, 1.0)
    return max(scatter, ASSUMED_SIGMA**2) if few else scatter


def _minima(
    fit: Fit, ends: Ends, end: End, noise: float, scatter: float, eta_i: float
) -> list[Minimum]:
    """Return the minima that fit as well as the best one, the one to be shown first.

    At normal incidence N and eta_i^2 / N reflect alike; of two that fit alike within one unit of
    chi2 the one that is above eta_i is shown.
    """
    rounding = _rounding(fit, noise)
    edge = end.known.edge * np.sqrt(scatter)
    spread = np.where(np.isfinite(edge), 4.0 * edge, np.inf)
    found = minima(ends, ends.y, scatter, rounding, spread)
    names = fit.u.spec.moving
    if len(found) < 2 or "eta" not in names:
        return found
    eta = ends.y[names.index("eta")]
    least = ends.cost[found[0].lane]
    usual = [
        m for m in found
        if eta[m.lane] >= eta_i and ends.cost[m.lane] <= least + scatter + rounding
    ]  # fmt: skip
    return sorted(found, key=lambda m: m is not usual[0]) if usual else found


def _intervals(
    fit: Fit, every: Sequence[End], noise: float, how: dict[str, Any], failed: bool
) -> list[Intervals]:
    """Return the intervals at the best minimum and at the others."""
    wanted = QUADRATIC if failed else how.get("intervals", QUADRATIC)
    # With the scatter of many fits alike t is next to that of the normal law; without a degree of
    # freedom stated errors are taken at their word.
    taken = fit.dof == 0 and fit.seen.stated
    estimated = how["scaled"] and fit.pooled is None and not taken
    found = intervals(fit, every[: 1 + _OTHERS], noise, wanted=wanted, estimated=estimated)
    rest = every[1 + _OTHERS :]
    found += intervals(fit, rest, noise, wanted=QUADRATIC, estimated=estimated)
    return [i.without() for i in found] if failed else found


def _rounding(fit: Fit, noise: float) -> float:
    """Return the differences of the cost that are rounding."""
    return 1e-27 * fit.squares / noise**2


def model_fit_of(
    fit: Fit, ends: Ends, noise: float, how: dict[str, Any], measurements: Sequence[Measurement]
) -> ModelFit:
    """Return the result of a fit from the ends (p, L) of its starts.

    how: "scaled" (whether errors are multiplied by the scatter), "eta_i", "notes", the number of
    "starts", and the kind of "intervals" that is wanted (quadratic if it is left out).
    """
    u, seen, scaled = fit.u, fit.seen, how["scaled"]
    best = best_of(ends)
    lane = int(np.argmin(ends.cost)) if best is None else best
    end = fit.look_at(ends.y[:, lane], noise, scaled)
    failed = best is None or not end.finite
    scatter = _scatter(fit, end.cost, noise, scaled)
    found = [] if failed else _minima(fit, ends, end, noise, scatter, how["eta_i"])
    if found and found[0].lane != lane:
        lane = found[0].lane
        end = fit.look_at(ends.y[:, lane], noise, scaled)
    every = [end] + [fit.look_at(ends.y[:, m.lane], noise, scaled, False) for m in found[1:]]
    ranges = _intervals(fit, every, noise, how, failed)
    least, place = ranges[0].lowest
    lower = 0.0
    # What is shown need not be the lowest minimum that is known.
    enough = min(end.cost, *(e.cost for e in every)) - SAME_CHI2 * scatter - _rounding(fit, noise)
    if not failed and least < enough:
        # On the way to the ends of the intervals a better minimum came into sight.
        low, high = (a[:, None] for a in fit.limits)
        more = fit.held(place[:, None], low, high, noise, STAGE)
        if more.done.all() and more.cost[0] < enough:
            joined = Ends(*(np.concatenate(both, -1) for both in zip(ends, more, strict=True)))
            return model_fit_of(fit, joined, noise, how, measurements)
        lower = (end.cost - min(least, more.cost[0])) / scatter
    y, s, known, cost, _ = end
    reached = found[0].reached if found else 0
    rises = np.array([ends.cost[m.lane] - ends.cost[lane] for m in found[1:]])
    rises = rises / scatter if scatter > 0.0 else 0.0 * rises
    others = _others(u, every[1:], ranges[1:], found[1:], rises)
    x, _ = _parameters_at(u, y)
    free = u.free
    with np.errstate(invalid="ignore"):
        of_x = np.full((len(x), len(x)), np.nan) if failed else _covariance(u, end)
        sigmas = np.sqrt(np.diagonal(of_x))
        correlation = of_x / np.outer(sigmas, sigmas)
    rms, rms_of = _rms(s)
    chi2 = float(s.residual @ s.residual)
    reduced = chi2 / fit.dof if seen.stated and fit.dof else np.nan
    labels = [u.labels[n] for n in u.spec.moving]
    names = tuple(n for n, f in zip(labels, free, strict=True) if f)
    limits = ranges[0].limits
    sub = np.ix_(free, free)
    ends_at = tuple(b for b, f in zip(known.at_bound, free, strict=True) if f)
    unseen = known.unseen[free]
    kinds = tuple(k for k, f in zip(ranges[0].kind, free, strict=True) if f)
    wavelength = np.concatenate([m.wavelength_um for m in measurements])
    if failed:
        texts = ("the fit did not converge from any start; its values mean nothing.",)
    else:
        size = reduced_chi2(u.spec.loss, s.residual, fit.dof) if seen.stated else np.nan
        texts = sentences(Findings(
            names, x[free], sigmas[free], correlation[sub], ends_at, limits[free], unseen, size,
            fit.dof, scaled, rms, how["starts"], reached, len(others), u.spec.structure,
            u.spec.model.absorbs, _one_power_a_wavelength(measurements), len(np.unique(wavelength)),
            ranges[0].ends[free], ranges[0].quadratic[free], kinds, lower,
            pattern(concatenate(*measurements), at_data(seen, s.seen), seen.curve, seen.stated),
            u.spec.loss != "squares",
        ))  # fmt: skip
    bic, aicc = criteria(u.spec.loss, s.residual, fit.n_data, int(free.sum()), scaled)
    fixed = {n: float(v) for n, v, f in zip(labels, x, free, strict=True) if not f}
    fixed |= {u.labels[n]: float(v) for n, v in zip(u.spec.held, u.held, strict=True)}
    undetermined = bool(unseen.size)
    return ModelFit(
        model=str(u.spec.model), structure=u.spec.structure, loss=u.spec.loss, eta_i=how["eta_i"],
        names=names, units=tuple(w.parameter.unit for w in u.moving if w.free),
        values=x[free], sigmas=sigmas[free], covariance=of_x[sub], correlation=correlation[sub],
        intervals=ranges[0].ends[free], interval_kinds=kinds,
        at_bound=ends_at, upper_limits=limits[free], fixed=fixed,
        chi2=chi2 if seen.stated else np.nan, chi2_reduced=reduced, cost=cost, noise=noise,
        dof=fit.dof, n_data=fit.n_data, rms=rms, rms_of=rms_of, bic=bic, aicc=aicc,
        sigma_kind="scaled" if scaled else "absolute",
        status=status.NOT_CONVERGED if failed else
        status.UNDETERMINED if undetermined else status.CONVERGED,
        warnings=texts, notes=how["notes"], starts=how["starts"], reached=reached, others=others,
        iterations=int(ends.evaluations[lane]), measurement=concatenate(*measurements),
        curve=seen.curve, curve_names=seen.curve_names,
        curves_from=Evaluated(u, seen, fit.targets, y, known.covariance),
    )  # fmt: skip
