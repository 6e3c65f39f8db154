"""The Fresnel equations as textbooks print them, by NumPy's complex numbers in float64.

Good to 1e-12 but where these forms cancel: next to the critical angle, at grazing incidence and
near an index match `oracle` has the digits.
"""

from __future__ import annotations

import numpy as np


def reflectances(cos_i, index, eta_i=1.0) -> dict[str, np.ndarray]:
    """Return R_s, R_p and R of light from a medium of index eta_i; arguments broadcast.

    index: eta + i k of the medium behind.
    """
    index = index / eta_i
    # The root with Im >= 0: the wave decays away from the boundary.
    q = np.sqrt(index**2 - (1.0 - cos_i**2) + 0j)
    q = np.where(np.imag(q) < 0.0, -q, q)
    R_s = np.abs((cos_i - q) / (cos_i + q)) ** 2
    R_p = np.abs((index**2 * cos_i - q) / (index**2 * cos_i + q)) ** 2
    return {"R_s": R_s, "R_p": R_p, "R": 0.5 * (R_s + R_p)}
