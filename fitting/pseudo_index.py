"""What eta and k of psi and Delta are, if nothing is known of the surface: the pseudo-index.

    <n> + i <k> = sin(theta) sqrt(1 + tan^2(theta) [(1 - rho) / (1 + rho)]^2)

is what psi and Delta at one angle say of one bare, smooth boundary (R. M. A. Azzam and N. M.
Bashara, Ellipsometry and Polarized Light, 1977, section 4.2). Of a surface with a film it is a
number that belongs to no material, and may even ask for a k below 0.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fitting.diagnostics import Warning
from fitting.measurement import Measurement
from fitting.observe import NCS
from fitting.quantities import are_powers
from fitting.result import AT_LOWER, Fit
from fitting.sample import Sample

# A bare crystal's N, C, S are met within .003 (an ellipsometer's own errors), with the wrong sign
# of Delta within .009, and those of 100 nm of hafnia on silica within .2: measured on real files.
MISSED = 0.006
# At one angle there are as many data as unknowns, which should be met: of chi2 at the one bound
# where they are not (k = 0) this is exceeded by chance in one of a thousand.
MISSED_CHI2 = 10.8


def is_pseudo(sample: Sample, measurement: Measurement) -> bool:
    """Return whether an index found from this measurement is a pseudo-index."""
    ellipsometry = not are_powers(measurement.quantity).all()
    return sample.bare and sample.by_wavelength and ellipsometry


def misses(fit: Fit) -> bool:
    """Return whether psi and Delta of one wavelength are no bare boundary's."""
    few = fit.dof == 0 and fit.chi2 > MISSED_CHI2  # chi2 is NaN without stated errors
    return fit.rms_of.get(NCS, 0.0) > MISSED or few


def notes_on(fits: Sequence[Fit], sample: Sample, measurement: Measurement) -> tuple[Warning, ...]:
    """Return what must be said of pseudo-indices, of one fit a wavelength; nothing of others."""
    if not is_pseudo(sample, measurement):
        return ()
    missed = np.array([f.rms_of.get(NCS, 0.0) for f in fits])
    wavelengths = np.array([float(f.wavelength_um) for f in fits])
    off = np.array([misses(f) for f in fits])
    # At its lower end with a misfit k would go on below 0.
    stuck = np.array([f.parameters["k"].status == AT_LOWER for f in fits]) & off
    off &= ~stuck
    out = [Warning("pseudo_index")]
    for hit, cause in ((stuck, "k_negative"), (off, "film")):
        if hit.any():
            at = wavelengths[hit]
            out.append(Warning("pseudo_index_misfit", {}, {
                "cause": cause, "count": int(hit.sum()), "of": len(hit),
                "range_um": (float(at.min()), float(at.max())),
                "misfit": float(missed[hit].max()),
            }))  # fmt: skip
    return tuple(out)
