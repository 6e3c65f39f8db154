"""How far the scatter may be off the stated errors by chance."""

from __future__ import annotations

import numpy as np

CHI2_LARGE, CHI2_SMALL = 128, 256


def chi2_flags(chi2_reduced: np.ndarray, dof: np.ndarray) -> np.ndarray:
    """Return CHI2_LARGE or CHI2_SMALL where chi2 / dof is off 1 by 5 of its errors and by half."""
    with np.errstate(all="ignore"):
        error = np.sqrt(2.0 / dof)
        large = (chi2_reduced > 1.0 + 5.0 * error) & (chi2_reduced > 1.5)
        # The law is skew: 5 errors below 1 lies below 0 for fewer than 50 degrees of freedom.
        small = (chi2_reduced < 1.0 / (1.0 + 5.0 * error)) & (chi2_reduced < 1.0 / 1.5)
    return np.where(large, CHI2_LARGE, 0) | np.where(small, CHI2_SMALL, 0)
