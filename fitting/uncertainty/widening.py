"""Larger errors: of any estimate, and of a fit with autocorrelated residuals.

Fewer of its data are independent.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from fitting.residuals.error_model import widening
from fitting.results.diagnostics import Finding
from fitting.results.result import FitData
from fitting.results.result_parts import TIED, Estimate


def wider(e: Estimate, factor: Any, ends: tuple[float, float]) -> Estimate:
    """Return an estimate with every distance from its value multiplied. ends: of its range."""
    if not e.free and e.status != TIED:
        return e
    value, before = np.asarray(e.value)[..., None], np.asarray(e.interval)
    sigma, limit = np.multiply(e.sigma, factor), np.multiply(e.upper_limit, factor)
    with np.errstate(invalid="ignore"):
        wide = np.clip(value + np.asarray(factor)[..., None] * (before - value), *ends)
        # An upper limit is the upper end of the interval.
        limit = np.minimum(limit, ends[1])
        wide[..., 1] = np.where(np.isfinite(limit), limit, wide[..., 1])
    if np.ndim(sigma) == 0:
        sigma, limit = float(sigma), float(limit)
    return replace(e, sigma=sigma, interval=wide, upper_limit=limit)


def ranges(fit: FitData) -> dict[str, tuple[float, float]]:
    """Return the range of every fitted parameter, by name."""
    of: Any = getattr(fit.evaluator, "each", (fit.evaluator,))[0]
    u = getattr(of, "unknowns", None)
    if u is None:  # of a bare surface
        return dict.fromkeys(("eta", "k"), (0.0, np.inf))
    inside = {w.parameter.name: (w.low, w.high) for w in u.moving}
    for name, times, other in u.spec.tied:
        if other in inside:
            low, high = sorted(times * end for end in inside[other])
            inside[name] = low, high
    return {label: inside[name] for name, label in u.labels.items() if name in inside}


def _finding(f: Finding, factor: Any, parameters: Mapping[str, Estimate]) -> Finding:
    """Return a finding with the errors in it multiplied. parameters: after it."""
    new: dict[str, Any] = {}
    if f.code == "residuals_in_order":
        new["widened"] = factor
    elif f.code == "compatible_with_zero":
        new["limit"] = np.multiply(f.values["limit"], factor)
    elif f.code == "chi2_small" and np.all(np.asarray(factor) > 1.0):
        # In a batch, fits without autocorrelation keep their sentence.
        new["errors"] = "kept"
    elif np.ndim(factor) == 0:
        if f.code == "not_quadratic":
            own = [parameters[n] for n in f.values["parameters"]]
            pairs = zip(own, f.values["by_sigma"], strict=True)
            new["by_sigma"] = [[e.value + factor * (end - e.value) for end in ends]
                               for e, ends in pairs]  # fmt: skip
            new["intervals"] = [e.interval.tolist() for e in own]
        elif f.code == "thin_film":
            new = {n: factor * f.values[n] for n in ("share", "held_share")}
        elif f.code == "poorly_determined":
            new["shares"] = tuple(factor * share for share in f.values["shares"])
    return replace(f, values={**f.values, **new})


def widened(fit: FitData) -> FitData:
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
    ends, anywhere = ranges(fit), (-np.inf, np.inf)

    def wide(some: Mapping[str, Estimate]) -> dict[str, Estimate]:
        return {n: wider(e, factor, ends.get(n, anywhere)) for n, e in some.items()}

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
