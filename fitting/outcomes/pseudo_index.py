"""The pseudo-index: eta and k from psi and Delta if nothing is known of the surface.

    <n> + i <k> = sin(theta) sqrt(1 + tan^2(theta) [(1 - rho) / (1 + rho)]^2)

is the index of one bare, smooth boundary with this psi and Delta at one angle (R. M. A. Azzam and
N. M. Bashara, Ellipsometry and Polarized Light, 1977, section 4.2). For a surface with a film it is
not the index of a material, and may even need a k below 0.
"""

from __future__ import annotations

import numpy as np

from fitting.data.quantities import ANGLES
from fitting.optics.spec import NCS
from fitting.results.diagnostics import Warning
from fitting.results.result import FitData

# N, C, S of a bare crystal are fitted within .003 (the errors of an ellipsometer), with the wrong
# sign of Delta within .009, and those of 100 nm of hafnia on silica within .2, in measured files.
MISSED = 0.006
# At one angle there are as many data as unknowns, so that the fit is exact, except at the bound
# k = 0: by chance chi2 exceeds this there in one of a thousand.
MISSED_CHI2 = 10.8


def notes_on(found: FitData) -> tuple[Warning, ...]:
    """Return the notes on a pseudo-index, fitted at each wavelength; none on other fits."""
    sample, m = found.sample, found.measurement
    bare = sample is not None and sample.bare and sample.by_wavelength
    if not bare or m is None or not np.isin(m.quantity, ANGLES).any():
        return ()
    wavelengths, chi2, dof = map(np.atleast_1d, (found.wavelength_um, found.chi2, found.dof))
    missed = np.nan_to_num(np.atleast_1d(found.rms_of.get(NCS, 0.0)))
    # No bare boundary has psi and Delta there. chi2 is NaN without stated errors.
    off = (missed > MISSED) | ((dof == 0) & (chi2 > MISSED_CHI2))
    # With a misfit, k at its lower end would continue below 0.
    stuck = (np.asarray(found.k) == 0.0) & off
    out = [Warning("pseudo_index")]
    for hit, cause in ((stuck, "k_negative"), (off & ~stuck, "film")):
        if hit.any():
            at = wavelengths[hit]
            out.append(Warning("pseudo_index_misfit", {}, {
                "cause": cause, "count": int(hit.sum()), "of": len(hit),
                "range_um": (float(at.min()), float(at.max())),
                "misfit": float(missed[hit].max()),
            }))  # fmt: skip
    return tuple(out)
