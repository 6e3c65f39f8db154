"""Whether what the fit of one index leaves of a curve is noise."""

from __future__ import annotations

import numpy as np

from fitting.index import identifiability as flag
from fitting.index.result import NO_DATA, NOT_CONVERGED, FitResult
from fitting.measurement import Measurement
from fitting.pattern import pattern


def _reflectance(m: Measurement, eta: np.ndarray, k: np.ndarray, eta_i: float) -> np.ndarray:
    """Return the reflectance at every datum, from amplitudes as printed in textbooks.

    In NumPy: good to 1e-15, where 1e-7 is asked for, and the first fit of the command would wait .2
    s more for a compiled program (half of what the fit itself takes).
    """
    cos = np.cos(np.radians(m.angle_deg))
    index = (eta + 1j * k) / eta_i
    inside = np.sqrt(index**2 - (1.0 - cos**2))
    R_s = np.abs((cos - inside) / (cos + inside)) ** 2
    R_p = np.abs((index**2 * cos - inside) / (index**2 * cos + inside)) ** 2
    polarizer = np.where(np.isfinite(m.polarizer_deg), m.polarizer_deg, 45.0)
    share = np.select(
        [m.quantity == "R_s", m.quantity == "R_p"],
        [1.0, 0.0],
        np.sin(np.radians(polarizer)) ** 2,
    )
    return R_p + share * (R_s - R_p)


def with_order_of_residuals(result: FitResult, m: Measurement, stated: bool) -> FitResult:
    """Return the result with NOT_NOISE and the correlation where residuals have a pattern.

    result: of `fit`, m: what was fitted; each wavelength is looked at by itself. stated: whether
    the fit weighed by stated errors.
    """
    _, which = np.unique(m.wavelength_um, return_inverse=True)
    flags, correlation = np.atleast_1d(result.flags), np.atleast_1d(result.residual_correlation)
    flags, correlation = flags.copy(), correlation.copy()
    eta, k = (np.atleast_1d(a)[which] for a in (result.eta, result.k))
    status = np.atleast_1d(result.status)
    with np.errstate(all="ignore"):  # no index, no boundary, grazing incidence
        fitted = _reflectance(m, eta, k, result.eta_i)
    many = np.bincount(which)
    each = np.split(np.argsort(which, kind="stable"), np.cumsum(many)[:-1])
    for i in np.flatnonzero((many > 10) & ~np.isin(status, (NO_DATA, NOT_CONVERGED))):
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
