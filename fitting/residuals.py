"""What a fit leaves of the data."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from fitting.measurement import Measurement


def residuals(measurement: Measurement, fitted: np.ndarray) -> np.ndarray:
    """Return value - fitted of every datum; of Delta from -180 to 180: 359 and 1 are 2 apart."""
    off = measurement.value - fitted
    return np.where(measurement.quantity == "delta", (off + 180.0) % 360.0 - 180.0, off)


def weighted_residuals(
    measurement: Measurement, fitted: np.ndarray, stated: bool = True
) -> np.ndarray:
    """Return the residuals in one unit, (N,): standard errors, where all are known and ``stated``.

    Otherwise R and T as they are, psi and Delta as arcs of the sphere that N, C, S lie on: 2 dpsi
    and sin(2 psi) dDelta, in radians; psi there is the fitted one.
    """
    m, off = measurement, residuals(measurement, fitted)
    if stated and np.isfinite(m.sigma).all():
        return off / m.sigma
    return off * arcs(m, fitted)


def arcs(measurement: Measurement, fitted: np.ndarray) -> np.ndarray:
    """Return what a residual or an error is multiplied by to be in one unit, (N,).

    1 for R and T; for psi and Delta in degrees the arc of the sphere of N, C, S, see above.
    """
    m = measurement
    psi, delta = m.quantity == "psi", m.quantity == "delta"
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
