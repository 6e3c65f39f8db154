"""What a sample shows at points of one's own: of a fit, or simulated from parameters."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import jax
import numpy as np

from fitting.evaluation import at_data, points_of
from fitting.measurement import Measurement
from fitting.observations import observations
from fitting.parameters import Settings, check_settings
from fitting.problem import shown
from fitting.sample import Sample
from fitting.sample_checks import check_quantities
from fitting.unknowns import index_outside, spectrum_of, unknowns

if TYPE_CHECKING:
    from fitting.result import Fit, Prediction


def predict(fit: Fit, at: Any, quantity: Any, wavelength_um: Any) -> Prediction:
    """Return what a fit shows; see `Fit.predict`."""
    if fit.evaluator is None:
        raise ValueError("this fit is of your own residuals; evaluate your own model.")
    if at is None or isinstance(at, Measurement):
        if at is None and fit.measurement is None:
            raise ValueError("this fit keeps no data (fit_many); give angles: predict([30, 60]).")
        return fit.evaluator.predict(at)
    waves = np.asarray(fit.wavelength_um)
    if wavelength_um is not None or np.ndim(quantity) or waves.shape != fit.shape:
        return fit.evaluator.predict(points_of(at, quantity, wavelength_um))
    angle = np.atleast_1d(np.asarray(at, float))
    if angle.ndim != 1:
        raise ValueError(f"angles of shape {angle.shape} came; one axis was wanted.")
    return fit.evaluator.over_angle(angle, str(quantity))


def simulate(
    sample: str | Sample,
    parameters: Mapping[str, float],
    angle_deg: Any,
    wavelength_um: Any = None,
    quantity: Any = "R",
) -> np.ndarray:
    """Return what a sample shows at points, without a fit.

    Args:
        sample: text or `Sample`; without `free` media.
        parameters: name -> value of every parameter of the sample that has no value in itself;
            instrument parameters by their bare names, as wanted.
        angle_deg, wavelength_um, quantity: broadcast to one axis of N points; quantities out of
            R_s, R_p, R, R_back, T_s, T_p, T, psi, delta.

    Returns: (N,), powers as fractions, psi and delta in degrees.

    Raises:
        ValueError: for a name too many or too few, or of no quantity.
    """
    which = Sample.parse(sample)
    points = points_of(angle_deg, quantity, wavelength_um)
    check_quantities([points], which)
    settings = check_settings(Settings(fixed=dict(parameters)))
    seen = observations([points], "equal", compared=False)
    spectrum = spectrum_of([points], which)
    u = unknowns(which, spectrum, settings, seen, "squares")
    missing = [u.labels[w.parameter.name] for w in u.moving if w.free]
    if missing:
        raise ValueError(f"{which} needs a value of {', '.join(missing)}.")
    names = (*u.spec.moving, *u.spec.held)
    values = np.concatenate([[w.low for w in u.moving], u.held])
    spec = u.spec._replace(moving=(), coordinates=(), held=names)
    outside = index_outside(which, seen.points.wavelength_um)
    with jax.enable_x64(True):
        found = np.asarray(shown(seen.points, values, outside, spec=spec))
    return at_data(seen, found)
