"""Whether what the fit of one index leaves of a curve is noise."""

from __future__ import annotations

import numpy as np

from fitting.bare_surface import identifiability as flag
from fitting.bare_surface.index_result import NO_DATA, NOT_CONVERGED, FitResult
from fitting.measurement import Measurement
from fitting.pattern import pattern

# With fewer data `pattern` never finds one.
ENOUGH = 11


def with_order_of_residuals(
    result: FitResult, m: Measurement, fitted: np.ndarray, stated: bool
) -> FitResult:
    """Return the result with NOT_NOISE and the correlation where residuals have a pattern.

    result: of `fit`, m: what was fitted, fitted: the curve there; each wavelength is looked at by
    itself. stated: whether the fit weighed by stated errors.
    """
    _, which = np.unique(m.wavelength_um, return_inverse=True)
    flags, correlation = np.atleast_1d(result.flags), np.atleast_1d(result.residual_correlation)
    flags, correlation = flags.copy(), correlation.copy()
    status = np.atleast_1d(result.status)
    many = np.bincount(which)
    each = np.split(np.argsort(which, kind="stable"), np.cumsum(many)[:-1])
    for i in np.flatnonzero((many >= ENOUGH) & ~np.isin(status, (NO_DATA, NOT_CONVERGED))):
        rows = each[i]
        found = pattern(m.where(rows), fitted[rows], np.zeros(len(rows), int), stated)
        if found is not None:
            flags[i] |= flag.NOT_NOISE
            correlation[i] = found.correlation
    shape = result.shape
    changed = result._replace(
        flags=flags.reshape(shape), residual_correlation=correlation.reshape(shape)
    )
    return changed if shape else changed.plain()
