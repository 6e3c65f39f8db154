"""What reflectances of a bare surface leave open, told to fits by any model, loss and instrument.

Whether powers over the angle determine eta and k is a matter of the data, not of the model that is
fitted to them: R_s of a metal fits any index on a circle, of which a lossless index of 130 is one.
What wavelengths tell of each other through a dispersion model is that of the model alone.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fitting.bare_surface.reflectances import CHANNELS
from fitting.bare_surface.surface_fit import fit_bare_surface
from fitting.outcomes.batched import stacked
from fitting.results.diagnostics import Finding, ranked
from fitting.results.result import FitData
from fitting.results.result_parts import CONVERGED, NOT_CONVERGED, QUADRATIC, UNDETERMINED, Estimate
from fitting.samples.dispersion import Model

OPEN = ("perfect_mirror", "circle", "same_at_45_degrees", "combination")
# What is told of one index and its errors alone.
_OF_ONE_INDEX = (
    "compatible_with_zero", "not_quadratic", "poorly_determined", "correlated", "other_minima",
)  # fmt: skip
_OF_MODEL = "by_the_model_alone"
# Of solids that transmit light tellurium has the highest index, 6.3 (S. Caldwell and H. Y. Fan,
# Physical Review 114, 664 (1959)).
_MOST_LOSSLESS = 7.0
_CONSTANT = Model("constant", 1)


def with_verdicts(found: FitData, errors: str) -> FitData:
    """Return a fit, undetermined where its data fit many indices of a bare surface equally well.

    Each wavelength is asked alone, and one index for all of them as one curve. errors: as in `fit`.
    """
    sample, m = found.sample, found.measurement
    assert sample is not None and m is not None
    powers = set(m.quantity.tolist()) <= set(CHANNELS)
    if not (powers and sample.bare and np.isfinite(sample.eta_i)):
        return found
    if found.shape:
        return stacked([with_verdicts(f, errors) for f in found], m)
    if found.status != CONVERGED:
        return found
    one_index = sample.by_wavelength or sample.media[1].index == _CONSTANT
    if one_index:
        m = replace(m, wavelength_um=np.full(len(m), np.nan))
    alone = fit_bare_surface(m, sample, errors, QUADRATIC)
    if np.isin(alone.status, (CONVERGED, NOT_CONVERGED)).any():
        return found
    eta, k = np.ravel(found.eta), np.ravel(found.k)
    if not one_index and k.any():
        codes = {f.code for f in found.findings}
        told = () if _OF_MODEL in codes else (Finding(_OF_MODEL, np.True_, {}),)
        return replace(found, findings=ranked((*told, *found.findings)))
    if not one_index and eta.max() < _MOST_LOSSLESS:
        return found
    if one_index:
        alone = fit_bare_surface(m, sample, errors, "auto")  # with the ranges
    elif alone.shape:
        alone = alone[int(np.argmax(eta))]

    def marked(name: str, e: Estimate) -> Estimate:
        if not e.free:
            return e
        if not one_index or name not in alone.parameters:
            return e.without_error()
        return replace(alone.parameters[name], value=e.value, status=UNDETERMINED)

    told = [f for f in alone.findings if f.code in OPEN]
    kept = [f for f in found.findings if f.code not in _OF_ONE_INDEX]
    return replace(
        found, status=UNDETERMINED, covariance=np.full_like(found.covariance, np.nan),
        parameters={n: marked(n, e) for n, e in found.parameters.items()},
        findings=ranked((*told, *kept)), others=(),
    )  # fmt: skip
