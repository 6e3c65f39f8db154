"""The pseudo-index: eta and k from psi and Delta if nothing is known of the surface.

    <n> + i <k> = sin(theta) sqrt(1 + tan^2(theta) [(1 - rho) / (1 + rho)]^2)

is the index of one bare, smooth boundary with this psi and Delta at one angle (R. M. A. Azzam and
N. M. Bashara, Ellipsometry and Polarized Light, 1977, section 4.2). For a surface with a film it is
not the index of a material, and may even need a k below 0.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fitting.measurements.measurement import Measurement
from fitting.measurements.quantities import are_powers
from fitting.optics.observe import NCS
from fitting.results.diagnostics import Warning
from fitting.results.result import AT_LOWER, Fit
from fitting.samples.sample import Sample

# N, C, S of a bare crystal are fitted within .003 (the errors of an ellipsometer), with the wrong
# sign of Delta within .009, and those of 100 nm of hafnia on silica within .2, in measured files.
MISSED = 0.006
# At one angle there are as many data as unknowns, so that the fit is exact, except at the bound
# k = 0: by chance chi2 exceeds this there in one of a thousand.
MISSED_CHI2 = 10.8


def is_pseudo(sample: Sample, measurement: Measurement) -> bool:
    """Return whether an index found from this measurement is a pseudo-index."""
    ellipsometry = not are_powers(measurement.quantity).all()
    return sample.bare and sample.by_wavelength and ellipsometry


def misses(fit: Fit) -> bool:
    """Return whether no bare boundary has psi and Delta of this wavelength."""
    few = fit.dof == 0 and fit.chi2 > MISSED_CHI2  # chi2 is NaN without stated errors
    return fit.rms_of.get(NCS, 0.0) > MISSED or few


def notes_on(fits: Sequence[Fit], sample: Sample, measurement: Measurement) -> tuple[Warning, ...]:
    """Return the notes on pseudo-indices, with one fit for each wavelength; none for others."""
    if not is_pseudo(sample, measurement):
        return ()
    missed = np.array([f.rms_of.get(NCS, 0.0) for f in fits])
    wavelengths = np.array([float(f.wavelength_um) for f in fits])
    off = np.array([misses(f) for f in fits])
    # With a misfit, k at its lower end would continue below 0.
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
