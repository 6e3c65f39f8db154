"""The curves of a sample at given points: those of a fit, or simulated from parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from fitting.data.measurement import Measurement
from fitting.problem.evaluation import at_data
from fitting.problem.observations import observations, points_of
from fitting.problem.slopes import shown_at_y
from fitting.problem.unknowns import index_outside, spectrum_of, unknowns
from fitting.results.result import FitData
from fitting.results.result_parts import Prediction
from fitting.samples.dispersion import SPLINE, without_knots
from fitting.samples.parameters import settings_of
from fitting.samples.sample import Sample
from fitting.samples.sample_checks import check_points


def predict(
    fit: FitData, at: Any = None, quantity: Any = "R", wavelength_um: Any = None
) -> Prediction:
    """Return the prediction of a fit; see `Fit.predict`."""
    sample, evaluator = fit.sample, fit.evaluator
    if sample is None or evaluator is None:
        raise ValueError(
            "this fit is of your own residuals and has no sample; evaluate your model."
        )
    if at is None and fit.measurement is None:
        raise ValueError(
            "this fit keeps no data (fit_many): there are no residuals and no table of them. Give "
            "angles of incidence, predict([30, 60]), or fit a Measurement, which is kept (fit)."
        )
    # Given the fitted data, the evaluator knows the file of each row, which the rows do not name.
    if at is None or at is fit.measurement:
        return evaluator.predict(None)
    waves = np.asarray(fit.wavelength_um)
    if isinstance(at, Measurement):
        points = at
    elif wavelength_um is None and not np.ndim(quantity) and waves.shape == fit.shape:
        # One wavelength of a batch is checked for all, since the fit has checked the others.
        points = points_of(at, quantity, waves.ravel()[0] if waves.size else None)
        check_points(points, sample)
        return evaluator.over_angle(points.angle_deg, str(quantity))
    else:
        if wavelength_um is None and waves.size == 1:
            wavelength_um = float(waves.ravel()[0])
        if wavelength_um is None and fit.shape:
            raise ValueError(
                f"this fit has {waves.size} wavelengths; for several quantities at once give the "
                "wavelength of each (wavelength_um)."
            )
        points = points_of(at, quantity, wavelength_um)
    check_points(points, sample)
    if sample.by_wavelength:
        points = _at_fitted_wavelengths(fit, points)
    return evaluator.predict(points)


# Wavelengths that differ by less are the same: they were converted from other units.
_SAME = 1e-9


def _at_fitted_wavelengths(fit: FitData, points: Measurement) -> Measurement:
    """Return points at the wavelengths of a fit whose index is free at each of them.

    Raises ValueError for other wavelengths, at which the index is unknown.
    """
    known = np.unique(np.ravel(fit.wavelength_um))
    wanted = points.wavelength_um
    if len(known) == 1 and np.ndim(fit.status) == 0:
        wanted = np.where(np.isnan(wanted), known, wanted)
    away = np.abs(wanted[:, None] - known)
    near = known[np.argmin(np.where(np.isnan(away), np.inf, away), axis=1)]
    one = np.size(fit.wavelength_um) == 1
    same = np.isclose(wanted, near, rtol=_SAME, atol=0.0, equal_nan=one)
    if not same.all():
        came = wanted[~same][0]
        some = ", ".join(f"{w:g}" for w in known.tolist())
        if len(known) > 8:
            some = f"{len(known)} from {known[0]:g} to {known[-1]:g}"
        measured = "no wavelength is known" if np.isnan(known).all() else f"measured: {some} um"
        raise ValueError(
            "eta and k were fitted at each measured wavelength by itself and are not known at "
            f"{'an unknown wavelength' if np.isnan(came) else f'{came:g} um'} ({measured}). Give "
            "one of the measured wavelengths, or fit a dispersion model."
        )
    return replace(points, wavelength_um=near)


def _as_written(sample: Sample) -> Sample:
    """Return the sample with each thickness that is one number, the start of a fit, held there."""
    media = []
    for medium in sample.media:
        d = medium.thickness
        if d is not None and np.isinf(d.high_um):
            medium = medium._replace(thickness=d._replace(held=True))
        media.append(medium)
    return Sample(tuple(media))


def simulate(
    sample: str | Sample,
    parameters: Mapping[str, float],
    angle_deg: Any,
    wavelength_um: Any = None,
    quantity: Any = "R",
) -> np.ndarray:
    """Return the values that a sample gives at points, without noise.

    Args:
        sample: a `Sample` or its text, as for `fit`; without `auto`.
        parameters: name -> value of every parameter of the sample that has no value in its text
            ("110 nm" is one, "100..150 nm" is none), and of others that are to differ from it;
            instrument parameters by their bare names, if wanted. "edge_ev" of cauchy-urbach has to
            be given: a fit takes the highest photon energy of its data for it.
        angle_deg: degrees of incidence from the normal, 0 to 90.
        wavelength_um: micrometres; None for a bare surface whose index does not depend on it.
        quantity: R_s, R_p, R, R_back, T_s, T_p, T, psi, delta, delta_folded (Delta or 360 - Delta,
            whichever is below 180), N, C or S. All three broadcast to one axis of N points.

    Returns:
        (N,) float64, powers as fractions, psi and delta in degrees.

    Raises:
        ValueError: for a missing or unknown name of a parameter or quantity, and for angles and
            wavelengths out of range.
    """
    which = _as_written(Sample.parse(sample))
    if which.open:
        raise ValueError(
            f"the sample {str(which)!r} leaves its dispersion model open (auto); name one, for "
            "example cauchy."
        )
    for model in (m.model for m in which.media if m.model is not None):
        if model.name == SPLINE:
            without_knots(model.terms, {})
    points = points_of(angle_deg, quantity, wavelength_um)
    check_points(points, which)
    try:
        settings = settings_of(fixed=dict(parameters))
    except TypeError:
        raise ValueError(
            f"parameters is {parameters!r}; a mapping from names to numbers was wanted, such as "
            "{'A': 1.45}, or {} for none."
        ) from None
    seen = observations([points], "equal", compared=False)
    spectrum = spectrum_of([points], which)
    u = unknowns(which, spectrum, settings, seen, "squares")
    missing = [u.labels[w.parameter.name] for w in u.moving if w.free]
    # Its default follows from the data of a fit; the points asked for must not change the sample.
    missing += [
        u.labels.get(n, n) for n in u.spec.held
        if n.endswith(".edge_ev") and not {n, u.labels.get(n)} & set(settings.names)
    ]  # fmt: skip
    if missing:
        raise ValueError(
            f"the sample {str(which)!r} needs a value of {', '.join(missing)} in parameters."
        )
    names = (*u.spec.moving, *u.spec.held)
    values = np.concatenate([[w.low for w in u.moving], u.held])
    spec = u.spec._replace(moving=(), coordinates=(), held=names)
    outside = index_outside(which, seen.points.wavelength_um)
    return at_data(seen, shown_at_y(spec, seen.points, values, outside, np.zeros(0))[0])
