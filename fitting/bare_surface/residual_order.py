"""Autocorrelation of the residuals of one bare surface, and misfits larger than the noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fitting.measurements.measurement import Measurement
from fitting.residuals.noise import misfit
from fitting.residuals.pattern import pattern
from fitting.results.diagnostics import Finding
from fitting.results.result import Fit
from fitting.results.sentences import SENTENCES


def with_order(found: Fit, m: Measurement, fitted: np.ndarray, stated: bool) -> Fit:
    """Return the fit with what the residuals of every wavelength say, each looked at by itself.

    m: the data; fitted: the curve at each, NaN without a fit. stated: whether the fit used stated
    errors.
    """
    _, which = np.unique(m.wavelength_um, return_inverse=True)
    many = np.bincount(which)
    correlation, chance, noise = np.full((3, len(many)), np.nan)
    each = np.split(np.argsort(which, kind="stable"), np.cumsum(many)[:-1])
    for i, rows in enumerate(each):
        part, at = m.where(rows), fitted[rows]
        if not np.isfinite(at).all():
            continue
        noise[i] = _noise_of_a_misfit(part, at)
        order = pattern(part, at, np.zeros(len(rows), int), stated)
        if order is not None:
            correlation[i], chance[i] = order.correlation, order.chance
    shape = found.shape
    new = {
        "residuals_in_order": (correlation, {
            "along": "angle", "correlation": correlation.reshape(shape),
            "chance": chance.reshape(shape),
        }),
        "does_not_describe": (noise, {
            "sample": "one bare surface", "rms": np.reshape(found.rms, shape),
            "noise": noise.reshape(shape),
        }),
    }  # fmt: skip
    findings = [f for f in found.findings if f.code not in new]
    for code, (where, values) in new.items():
        at = np.isfinite(where)
        if at.any():
            findings.append(Finding(code, at.reshape(shape), values))
    rank = list(SENTENCES)
    return replace(found, findings=tuple(sorted(findings, key=lambda f: rank.index(f.code))))


def _noise_of_a_misfit(m: Measurement, fitted: np.ndarray) -> float:
    """Return the noise of the quantity of largest misfit over noise; NaN without a misfit."""
    worst, noise = 0.0, np.nan
    for quantity in sorted(set(m.quantity.tolist())):
        here = m.quantity == quantity
        off = (m.value - fitted)[here]
        found = misfit(m.angle_deg[here], m.value[here], off)
        if found.found[0] and found.rms[0] > worst:
            worst, noise = float(found.rms[0]), float(found.noise[0])
    return noise
