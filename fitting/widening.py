"""Errors of a fit whose residuals are in order, so that fewer of the data are independent."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from fitting.diagnostics import Finding
from fitting.error_model import widening
from fitting.result import Estimate, Fit


def _estimate(e: Estimate, factor: Any) -> Estimate:
    """Return an estimate with every distance from its value multiplied."""
    if not e.free:
        return e
    value, ends = np.asarray(e.value)[..., None], np.asarray(e.interval)
    with np.errstate(invalid="ignore"):
        wide = value + np.asarray(factor)[..., None] * (ends - value)
        # What cannot be negative ends at 0.
        wide = np.where((ends >= 0.0) & (wide < 0.0), 0.0, wide)
    sigma, limit = np.multiply(e.sigma, factor), np.multiply(e.upper_limit, factor)
    if np.ndim(sigma) == 0:
        sigma, limit = float(sigma), float(limit)
    return replace(e, sigma=sigma, interval=wide, upper_limit=limit)


def _finding(f: Finding, factor: Any) -> Finding:
    if f.code == "residuals_in_order":
        return Finding(f.code, f.at, {**f.values, "widened": factor})
    if f.code == "chi2_small":
        # Of a batch with others that are not in order the sentence stays what it was.
        kept = np.all(np.asarray(factor) > 1.0)
        return Finding(f.code, f.at, {**f.values, "errors": "kept"}) if kept else f
    if f.code == "compatible_with_zero":
        return Finding(f.code, f.at, {**f.values, "limit": np.multiply(f.values["limit"], factor)})
    return f


def widened(fit: Fit) -> Fit:
    """Return the fit with errors times sqrt((1 + rho) / (1 - rho)) where residuals are in order.

    rho is the lag-1 correlation of the residuals. Standard errors, intervals, limits, covariance
    and the band of the curve grow; values do not change.
    """
    found = [f for f in fit.findings if f.code == "residuals_in_order"]
    if not found:
        return fit
    one = found[0]
    rho = np.where(one.at, one.values["correlation"], np.nan).astype(float)
    # What is in order was not scaled below what was stated.
    scale = np.where(np.asarray(fit.errors.stated), np.fmin(fit.errors.factor, 1.0), 1.0)
    factor: Any = widening(rho) / np.where(np.isfinite(rho), scale, 1.0)
    factor = factor if fit.shape else float(factor)
    square = np.asarray(factor)[..., None, None] ** 2
    return replace(
        fit,
        parameters={n: _estimate(e, factor) for n, e in fit.parameters.items()},
        others=tuple(
            replace(a, parameters={n: _estimate(e, factor) for n, e in a.parameters.items()})
            for a in fit.others
        ),
        covariance=fit.covariance * square,
        errors=fit.errors._replace(widened=factor),
        findings=tuple(_finding(f, factor) for f in fit.findings),
        evaluator=None if fit.evaluator is None else fit.evaluator.widened(np.ravel(factor)),
    )
