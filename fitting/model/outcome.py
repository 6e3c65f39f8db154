"""From where the starts of a model fit ended to the `ModelFit` that a caller sees."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from fitting.measurement import Measurement, concatenate
from fitting.model import result as status
from fitting.model.curves import Evaluated
from fitting.model.findings import Findings, sentences
from fitting.model.multistart import Ends, Minimum, minima
from fitting.model.parameters import PLAIN, SQUARE, value_and_slope
from fitting.model.result import ModelFit
from fitting.model.solve import Fit, best_of
from fitting.model.uncertainty import Slopes, Uncertainty
from fitting.model.unknowns import Unknowns

# What data are trusted to where neither errors nor scatter tell.
ASSUMED_SIGMA = 1e-3
_EPS = float(np.finfo(float).eps)


def _parameters_at(u: Unknowns, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return parameters and their slopes dx/dy, (p,) each."""
    both = [value_and_slope(w.parameter.coordinate, y[i : i + 1]) for i, w in enumerate(u.moving)]
    return np.concatenate([b[0] for b in both]), np.concatenate([b[1] for b in both])


def _upper_limits(u: Unknowns, y: np.ndarray, found: Uncertainty) -> np.ndarray:
    """Return 95 % upper limits of what may not be below 0 and is compatible with it, else NaN.

    A square (k where the data depend on k^2) is compatible with 0 within three standard errors of
    the square; another parameter whose range begins at 0, if it ended there.
    """
    out = np.full(len(y), np.nan)
    for i, w in enumerate(u.moving):
        sigma = found.edge[i] * np.sqrt(found.variance)
        if not w.free or w.low != 0.0 or w.prior is not None or not np.isfinite(sigma):
            continue
        if w.parameter.coordinate == SQUARE and y[i] < 3.0 * sigma:
            out[i] = np.sqrt(max(y[i], 0.0) + 1.645 * sigma)
        elif w.parameter.coordinate == PLAIN and found.at_bound[i] == "low":
            out[i] = 1.645 * sigma
    return out


def _criteria(s: Slopes, cost: float, n: int, unknowns: int, scaled: bool) -> tuple[float, float]:
    """Return BIC and AICc."""
    chi2 = float(s.residual @ s.residual)
    count = unknowns
    if scaled:
        # One noise for all, itself unknown; a perfect fit counts as one at the rounding of data.
        least = n * _EPS**2
        minus_two_log = n * np.log(max(chi2, least) / n)
        count += 1
    else:
        minus_two_log = chi2
    room = n - count - 1
    aicc = minus_two_log + 2.0 * count * n / room if room > 0 else np.inf
    return float(minus_two_log + unknowns * np.log(n)), float(aicc)


def _others(
    fit: Fit, ends: Ends, found: list[Minimum], scatter: float
) -> tuple[dict[str, Any], ...]:
    least = ends.cost[found[0].lane]
    out = []
    for minimum in found[1:]:
        x, _ = _parameters_at(fit.u, ends.y[:, minimum.lane])
        names = [fit.u.labels[n] for n in fit.u.spec.moving]
        values = {n: float(v) for n, v, f in zip(names, x, fit.u.free, strict=True) if f}
        rise = (ends.cost[minimum.lane] - least) / scatter if scatter > 0.0 else 0.0
        out.append({"values": values, "delta_chi2": float(rise), "reached": minimum.reached})
    return tuple(out)


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


class _End(NamedTuple):
    """One minimum looked at closely."""

    y: np.ndarray
    slopes: Slopes
    known: Uncertainty
    cost: float
    finite: bool


def _look_at(fit: Fit, y: np.ndarray, noise: float, scaled: bool) -> _End:
    y, s = fit.polished(y, noise, scaled)
    finite = all(bool(np.isfinite(a).all()) for a in (y, s.residual, s.jacobian))
    if not finite:
        s = s._replace(jacobian=np.zeros_like(s.jacobian), residual=np.zeros_like(s.residual))
    return _End(y, s, fit.known(s, y, noise, scaled), fit.cost(s, y, noise), finite)


def _scatter(fit: Fit, cost: float, noise: float, scaled: bool) -> float:
    """Return what a difference of the cost is measured in."""
    if fit.pooled is not None and scaled:
        return fit.pooled
    few = fit.dof < 3
    scatter = cost / fit.dof if fit.dof else 0.0
    if not scaled or (few and fit.seen.stated) or noise != 1.0:
        return max(scatter, 1.0)
    return max(scatter, ASSUMED_SIGMA**2) if few else scatter


def _minima(fit: Fit, ends: Ends, end: _End, noise: float, scatter: float) -> list[Minimum]:
    """Return the minima that fit as well as the best one, the one to be shown first.

    At normal incidence an index and its inverse reflect alike; of two that fit alike within one
    unit of chi2 the one that is above 1 is shown.
    """
    rounding = 1e-27 * fit.squares / noise**2
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
        if eta[m.lane] >= 1.0 and ends.cost[m.lane] <= least + scatter + rounding
    ]  # fmt: skip
    return sorted(found, key=lambda m: m is not usual[0]) if usual else found


def model_fit_of(
    fit: Fit, ends: Ends, noise: float, how: dict[str, Any], measurements: Sequence[Measurement]
) -> ModelFit:
    """Return the result of a fit from the ends (p, L) of its starts.

    how: "scaled" (whether errors are multiplied by the scatter), "eta_i", "notes" and
    the number of "starts".
    """
    u, seen, scaled = fit.u, fit.seen, how["scaled"]
    best = best_of(ends)
    lane = int(np.argmin(ends.cost)) if best is None else best
    end = _look_at(fit, ends.y[:, lane], noise, scaled)
    failed = best is None or not end.finite
    scatter = _scatter(fit, end.cost, noise, scaled)
    found = [] if failed else _minima(fit, ends, end, noise, scatter)
    if found and found[0].lane != lane:
        lane = found[0].lane
        end = _look_at(fit, ends.y[:, lane], noise, scaled)
    y, s, known, cost, _ = end
    reached = found[0].reached if found else 0
    others = _others(fit, ends, found, scatter) if len(found) > 1 else ()
    x, slope = _parameters_at(u, y)
    free = u.free
    with np.errstate(invalid="ignore"):
        covariance = _blank(known.covariance, known.unseen_of)
        of_x = covariance * np.outer(slope, slope)
        of_x[~np.isfinite(of_x)] = np.nan
        if failed:
            of_x[:] = np.nan
        sigmas = np.sqrt(np.diagonal(of_x))
        correlation = of_x / np.outer(sigmas, sigmas)
    rms, rms_of = _rms(s)
    chi2 = float(s.residual @ s.residual)
    reduced = chi2 / fit.dof if seen.stated and fit.dof else np.nan
    labels = [u.labels[n] for n in u.spec.moving]
    names = tuple(n for n, f in zip(labels, free, strict=True) if f)
    limits = _upper_limits(u, y, known)
    sub = np.ix_(free, free)
    ends_at = tuple(b for b, f in zip(known.at_bound, free, strict=True) if f)
    unseen = known.unseen[free]
    wavelength = np.concatenate([m.wavelength_um for m in measurements])
    if failed:
        texts = ("the fit did not converge from any start; its values mean nothing.",)
    else:
        texts = sentences(Findings(
            names, x[free], sigmas[free], correlation[sub], ends_at, limits[free], unseen, reduced,
            fit.dof, scaled, rms, how["starts"], reached, len(others), u.spec.structure,
            u.spec.model.absorbs, _one_power_a_wavelength(measurements), len(np.unique(wavelength)),
        ))  # fmt: skip
    bic, aicc = _criteria(s, cost, fit.n_data, int(free.sum()), scaled)
    fixed = {n: float(v) for n, v, f in zip(labels, x, free, strict=True) if not f}
    fixed |= {u.labels[n]: float(v) for n, v in zip(u.spec.held, u.held, strict=True)}
    undetermined = bool(unseen.size)
    return ModelFit(
        model=str(u.spec.model), structure=u.spec.structure, loss=u.spec.loss, eta_i=how["eta_i"],
        names=names, units=tuple(w.parameter.unit for w in u.moving if w.free),
        values=x[free], sigmas=sigmas[free], covariance=of_x[sub], correlation=correlation[sub],
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
