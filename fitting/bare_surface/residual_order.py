"""Autocorrelation of the residuals of one bare surface, and misfits larger than the noise."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fitting.measurements.measurement import Measurement
from fitting.residuals.misfit import misfit
from fitting.residuals.pattern import pattern

# With fewer data `pattern` never finds autocorrelation.
ENOUGH = 11


class Order(NamedTuple):
    """For each wavelength, (N,) each.

    correlation: lag-1 correlation of the residuals if they are autocorrelated, else NaN. chance:
    its limit for independent noise. noise: the scatter of neighbouring data if the fit misses the
    data by more than that, else NaN.
    """

    correlation: np.ndarray
    chance: np.ndarray
    noise: np.ndarray


def order_of_residuals(m: Measurement, fitted: np.ndarray, stated: bool) -> Order:
    """Return the test of the residuals of every wavelength, each by itself.

    m: the data; fitted: the curve at each, NaN without a fit. stated: whether the fit used stated
    errors.
    """
    _, which = np.unique(m.wavelength_um, return_inverse=True)
    many = np.bincount(which)
    nan = np.full(len(many), np.nan)
    correlation, chance, noise = nan.copy(), nan.copy(), nan.copy()
    each = np.split(np.argsort(which, kind="stable"), np.cumsum(many)[:-1])
    for i, rows in enumerate(each):
        part, at = m.where(rows), fitted[rows]
        if not np.isfinite(at).all():
            continue
        noise[i] = _noise_of_a_misfit(part, at)
        if many[i] < ENOUGH:
            continue
        found = pattern(part, at, np.zeros(len(rows), int), stated)
        if found is not None:
            correlation[i], chance[i] = found.correlation, found.chance
    return Order(correlation, chance, noise)


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
