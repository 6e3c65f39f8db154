"""Larger errors for a fit with autocorrelated residuals, since fewer data are independent."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from fitting.residuals.error_model import widening
from fitting.results.diagnostics import Finding
from fitting.results.result import TIED, Estimate, Fit


def _estimate(e: Estimate, factor: Any, ends: tuple[float, float]) -> Estimate:
    """Return an estimate with every distance from its value multiplied. ends: of its range."""
    if not e.free and e.status != TIED:
        return e
    value, before = np.asarray(e.value)[..., None], np.asarray(e.interval)
    sigma, limit = np.multiply(e.sigma, factor), np.multiply(e.upper_limit, factor)
    with np.errstate(invalid="ignore"):
        wide = value + np.asarray(factor)[..., None] * (before - value)
        # The interval of a parameter that cannot be negative ends at 0.
        wide = np.where((before >= 0.0) & (wide < 0.0), 0.0, np.clip(wide, *ends))
        # An upper limit is the upper end of the interval.
        limit = np.minimum(limit, ends[1])
        wide[..., 1] = np.where(np.isfinite(limit), limit, wide[..., 1])
    if np.ndim(sigma) == 0:
        sigma, limit = float(sigma), float(limit)
    return replace(e, sigma=sigma, interval=wide, upper_limit=limit)


def _ranges(fit: Fit) -> dict[str, tuple[float, float]]:
    """Return the range of every fitted parameter of a model, by name."""
    of: Any = getattr(fit.evaluator, "each", (fit.evaluator,))[0]
    u = getattr(of, "unknowns", None)
    if u is None:
        return {}
    inside = {w.parameter.name: (w.low, w.high) for w in u.moving}
    for name, times, other in u.spec.tied:
        if other in inside:
            low, high = sorted(times * end for end in inside[other])
            inside[name] = low, high
    return {label: inside[name] for name, label in u.labels.items() if name in inside}


def _finding(f: Finding, factor: Any, parameters: Mapping[str, Estimate]) -> Finding:
    """Return a finding with the errors in it multiplied. parameters: after it."""
    if f.code == "not_quadratic" and np.ndim(factor) == 0:
        each = [(parameters[n].value, parameters[n].interval) for n in f.values["parameters"]]
        pairs = zip(each, f.values["by_sigma"], strict=True)
        wide = [[v + factor * (end - v) for end in ends] for (v, _), ends in pairs]
        own = [ends.tolist() for _, ends in each]
        return Finding(f.code, f.at, {**f.values, "intervals": own, "by_sigma": wide})
    if f.code == "thin_film" and np.ndim(factor) == 0:
        shares = {n: factor * f.values[n] for n in ("share", "held_share")}
        return Finding(f.code, f.at, {**f.values, **shares})
    if f.code == "poorly_determined" and np.ndim(factor) == 0:
        shares = tuple(factor * share for share in f.values["shares"])
        return Finding(f.code, f.at, {**f.values, "shares": shares})
    if f.code == "residuals_in_order":
        return Finding(f.code, f.at, {**f.values, "widened": factor})
    if f.code == "chi2_small":
        # In a batch, fits without autocorrelation keep their sentence.
        kept = np.all(np.asarray(factor) > 1.0)
        return Finding(f.code, f.at, {**f.values, "errors": "kept"}) if kept else f
    if f.code == "compatible_with_zero":
        return Finding(f.code, f.at, {**f.values, "limit": np.multiply(f.values["limit"], factor)})
    return f


def widened(fit: Fit) -> Fit:
    """Return the fit with errors times sqrt((1 + rho) / (1 - rho)) for autocorrelated residuals.

    rho is the lag-1 correlation of the residuals. Standard errors, intervals, limits, covariance
    and the band of the curve grow; values do not change.
    """
    found = [f for f in fit.findings if f.code == "residuals_in_order"]
    if not found:
        return fit
    one = found[0]
    rho = np.where(one.at, one.values["correlation"], np.nan).astype(float)
    # With autocorrelation errors are not scaled below the stated ones.
    scale = np.where(np.asarray(fit.errors.stated), np.fmin(fit.errors.factor, 1.0), 1.0)
    factor: Any = widening(rho) / np.where(np.isfinite(rho), scale, 1.0)
    factor = factor if fit.shape else float(factor)
    ranges, anywhere = _ranges(fit), (-np.inf, np.inf)

    def wide(some: Mapping[str, Estimate]) -> dict[str, Estimate]:
        return {n: _estimate(e, factor, ranges.get(n, anywhere)) for n, e in some.items()}

    parameters = wide(fit.parameters)
    square = np.asarray(factor)[..., None, None] ** 2
    return replace(
        fit,
        parameters=parameters,
        others=tuple(replace(a, parameters=wide(a.parameters)) for a in fit.others),
        covariance=fit.covariance * square,
        errors=fit.errors._replace(widened=factor, factor=fit.errors.factor * factor),
        findings=tuple(_finding(f, factor, parameters) for f in fit.findings),
        evaluator=None if fit.evaluator is None else fit.evaluator.widened(np.ravel(factor)),
    )
