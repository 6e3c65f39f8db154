"""What eta and k of psi and Delta are, if nothing is known of the surface: the pseudo-index.

    <n> + i <k> = sin(theta) sqrt(1 + tan^2(theta) [(1 - rho) / (1 + rho)]^2)

is what psi and Delta at one angle say of one bare, smooth boundary (R. M. A. Azzam and N. M.
Bashara, Ellipsometry and Polarized Light, 1977, section 4.2). Of a surface with a film it is a
number that belongs to no material, and may even ask for a k below 0.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fitting.measurement import Measurement
from fitting.model.result import ModelFit
from fitting.observe import INTERFACE, NCS

# A bare crystal's N, C, S are met within .003 (an ellipsometer's own errors), with the wrong sign
# of Delta within .009, and those of 100 nm of hafnia on silica within .2: measured on real files.
MISSED = 0.006
# At one angle there are as many data as unknowns, which should be met: of chi2 at the one bound
# where they are not (k = 0) this is exceeded by chance in one of a thousand.
MISSED_CHI2 = 10.8


def is_pseudo(structure: str, measurement: Measurement) -> bool:
    """Return whether an index found from this measurement is a pseudo-index."""
    return structure == INTERFACE and bool(np.isin(measurement.quantity, ("psi", "delta")).any())


def _where(hit: np.ndarray, wavelengths: np.ndarray) -> str:
    if len(wavelengths) == 1:
        return ""
    if hit.all():
        return f"at all {len(hit)} wavelengths "
    low, high = wavelengths[hit].min(), wavelengths[hit].max()
    between = f"{low:.4g} um" if low == high else f"{low:.4g} to {high:.4g} um"
    return f"at {int(hit.sum())} of {len(hit)} wavelengths ({between}) "


def misses(fit: ModelFit) -> bool:
    """Return whether psi and Delta are no bare boundary's."""
    few = fit.dof == 0 and fit.chi2 > MISSED_CHI2  # chi2 is NaN without stated errors
    return fit.rms_of.get(NCS, 0.0) > MISSED or few


def notes_on(
    fits: Sequence[ModelFit], wavelengths: np.ndarray, measurement: Measurement
) -> tuple[str, ...]:
    """Return what must be said of pseudo-indices; nothing of other fits."""
    if not is_pseudo(fits[0].structure, measurement):
        return ()
    missed = np.array([f.rms_of.get(NCS, 0.0) for f in fits])
    off = np.array([misses(f) for f in fits])
    # At its lower end with a misfit k would go on below 0.
    stuck = np.array([f.at_bound[f.names.index("k")] == "low" for f in fits]) & off
    off &= ~stuck
    out = [
        "eta and k are the pseudo-index <n>, <k>: that of one bare, smooth boundary, which is "
        "assumed. A film, an oxide or roughness changes it unseen (2 nm on a clear crystal look "
        "like a k of .03); then it is the index of no material."
    ]
    for hit, text in (
        (
            stuck,
            "psi and Delta ask for a k below 0, which no bare medium has: k is held at 0. There is "
            "a film, or Delta has the other sign",
        ),
        (off, "no bare boundary has these psi and Delta together: there is a film, or roughness"),
    ):
        if hit.any():
            worst = (
                "; the misfit (rms of cos 2psi, sin 2psi cos Delta and sin 2psi sin Delta) is up "
                f"to {missed[hit].max():.2g}."
            )
            out.append(_where(hit, wavelengths) + text + worst)
    return tuple(out)
