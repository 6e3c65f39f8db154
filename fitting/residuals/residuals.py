"""The residuals of a fit, unweighted and weighted."""

from __future__ import annotations

import numpy as np

from fitting.data.measurement import Measurement
from fitting.data.quantities import DELTAS


def residuals(measurement: Measurement, fitted: np.ndarray) -> np.ndarray:
    """Return value - fitted of every datum; for Delta in -180 to 180, so that 359 - 1 is -2."""
    off = measurement.value - fitted
    return np.where(measurement.quantity == "delta", (off + 180.0) % 360.0 - 180.0, off)


def weighted_residuals(
    measurement: Measurement, fitted: np.ndarray, stated: bool = True
) -> np.ndarray:
    """Return the residuals in one unit, (N,): standard errors, where all are known and ``stated``.

    Otherwise R and T are unchanged, psi and Delta are arcs on the sphere of N, C, S: 2 dpsi and
    sin(2 psi) dDelta, in radians, with the fitted psi.
    """
    m, off = measurement, residuals(measurement, fitted)
    if stated and np.isfinite(m.sigma).all():
        return off / m.sigma
    return off * arcs(m, fitted)


def arcs(measurement: Measurement, fitted: np.ndarray) -> np.ndarray:
    """Return the factors, (N,), that bring residuals or errors to one unit.

    They are 1 for R and T; for psi and Delta in degrees they give arcs on the sphere of N, C, S.
    """
    m = measurement
    psi, delta = m.quantity == "psi", np.isin(m.quantity, DELTAS)
    out = np.ones(len(m))
    if not (psi.any() or delta.any()):
        return out
    wavelength = np.where(np.isfinite(m.wavelength_um), m.wavelength_um, -1.0)
    points = np.stack([m.angle_deg, wavelength])
    _, where = np.unique(points, axis=1, return_inverse=True)
    where = np.reshape(where, -1)
    psi_at = np.zeros(where.max() + 1)
    psi_at[where[psi]] = fitted[psi]
    out = np.where(psi, np.radians(2.0), out)
    return np.where(delta, np.radians(np.sin(np.radians(2.0 * psi_at[where]))), out)
