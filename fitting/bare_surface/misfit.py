"""Whether the residuals of one index are noise."""

from __future__ import annotations

import numpy as np

from fitting.measurement import Measurement
from fitting.pattern import pattern
from fitting.result import NO_DATA, NOT_CONVERGED, Fit

# With fewer data `pattern` never finds one.
ENOUGH = 11


def order_of_residuals(
    found: Fit, m: Measurement, fitted: np.ndarray, stated: bool
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Return at which wavelengths (W,) residuals have a pattern, its correlation and what chance
    gives.

    m: what was fitted, fitted: the curve there; each wavelength is looked at by itself. stated:
    whether the fit weighed by stated errors.
    """
    _, which = np.unique(m.wavelength_um, return_inverse=True)
    status = np.atleast_1d(found.status)
    at = np.zeros(len(status), bool)
    values = {name: np.full(len(status), np.nan) for name in ("correlation", "chance")}
    many = np.bincount(which)
    each = np.split(np.argsort(which, kind="stable"), np.cumsum(many)[:-1])
    for i in np.flatnonzero((many >= ENOUGH) & ~np.isin(status, (NO_DATA, NOT_CONVERGED))):
        rows = each[i]
        seen = pattern(m.where(rows), fitted[rows], np.zeros(len(rows), int), stated)
        if seen is not None:
            at[i] = True
            values["correlation"][i], values["chance"][i] = seen.correlation, seen.chance
    return at, values
