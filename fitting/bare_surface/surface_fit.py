"""The `Fit` of one bare surface: of a measurement, wavelength by wavelength, or of arrays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import jax
import numpy as np

from fitting.bare_surface.added_error import with_added_error
from fitting.bare_surface.answer import Answer, answer, start_points
from fitting.bare_surface.arrange import Arranged, of_arrays, of_measurement
from fitting.bare_surface.curves import SurfaceCurves, fitted_curves, noise_of_misfits
from fitting.bare_surface.other_solutions import Others
from fitting.bare_surface.region_intervals import Intervals
from fitting.bare_surface.surface_findings import findings, shaped, with_order
from fitting.data.measurement import Measurement
from fitting.problem.observations import missing_errors
from fitting.residuals.error_model import NEED_STATED, sizes
from fitting.results.result import FitData
from fitting.results.result_parts import (
    AT_LOWER,
    CONVERGED,
    FITTED,
    NO_DATA,
    NOT_CONVERGED,
    UNDETERMINED,
    Alternative,
    ErrorModel,
    Estimate,
)
from fitting.samples.sample import Sample
from fitting.uncertainty.widening import widened


def _estimates(
    a: Arranged, v: Mapping[str, np.ndarray], known: Intervals, clear: np.ndarray
) -> dict[str, Estimate]:
    """Return eta and k from values and intervals of N curves. clear: (N,), what is determined."""
    open_ = np.where(clear, FITTED, UNDETERMINED)
    status = {"eta": open_, "k": np.where(v["at_zero"], AT_LOWER, open_)}
    limit = {"eta": np.full_like(v["eta"], np.nan), "k": v["limit"]}
    interval = {"eta": known.eta, "k": known.k}
    kind = shaped(known.kind, a)
    return {
        n: Estimate(
            name=n, value=shaped(v[n], a), sigma=shaped(v[f"sigma_{n}"], a),
            interval=shaped(interval[n], a), interval_kind=kind, status=shaped(status[n], a),
            upper_limit=shaped(limit[n], a),
        )
        for n in ("eta", "k")
    }  # fmt: skip


def _alternatives(a: Arranged, others: Others) -> tuple[Alternative, ...]:
    """Return the other solutions, NaN in curves that have none."""
    found = []
    for rank in np.flatnonzero(others.there.any(0)):
        one: Others = jax.tree.map(lambda values, rank=rank: values[:, rank], others)
        found.append(Alternative(
            parameters=_estimates(a, one.values, one.known, one.there),
            delta_chi2=shaped(one.excess, a), reached=shaped(np.full_like(one.excess, np.nan), a),
        ))  # fmt: skip
    return tuple(found)


def _fit(
    a: Arranged, sample: Sample, errors: str, intervals: str, start: Mapping[str, Any] | None
) -> tuple[FitData, Answer]:
    """Return what the engine finds as a `Fit` of the batch's shape, and as it found it."""
    begin = start_points(start, a)
    f = answer(a, errors == "stated", begin, intervals)
    f, taken = with_added_error(a, f, errors, begin, intervals)
    s, v = f.solved, f.values
    believed = np.full(len(f.dof), "scaled" if a.stated else "equal", "<U8")
    factor = v["factor"]
    if a.stated:
        # Without a degree of freedom only the stated errors are available.
        as_stated = (f.dof == 0) | (errors == "stated")
        believed = np.where(taken.kind != "", taken.kind, believed)
        believed[as_stated] = "stated"
        factor = np.where(as_stated, 1.0, factor)
    with np.errstate(all="ignore"):
        chi2_reduced = np.where(f.dof > 0, v["chi2"] / f.dof, np.nan)
        rms = np.sqrt(s.plain / s.count)
    estimates = _estimates(a, v, f.known, f.status == CONVERGED)
    found = FitData(
        sample=sample, parameters=estimates, covariance=shaped(v["covariance"], a),
        wavelength_um=shaped(a.wavelength_um, a), chi2=shaped(v["chi2"], a),
        chi2_reduced=shaped(chi2_reduced, a), dof=shaped(f.dof.astype(int), a),
        n_data=shaped(s.count.astype(int), a), rms=shaped(rms, a), status=shaped(f.status, a),
        errors=ErrorModel(
            taken=shaped(believed, a), factor=shaped(factor, a), added=shaped(taken.s, a),
            stated=a.stated, widened=shaped(np.ones(len(rms)), a),
        ),
        evaluations=shaped(s.evaluations.astype(int), a), cost=shaped(s.cost, a),
        findings=findings(a, f, taken, errors),
        others=_alternatives(a, f.others),
        evaluator=SurfaceCurves(
            eta=v["eta"], k=v["k"], sigma_eta=v["sigma_eta"], sigma_k=v["sigma_k"],
            information=v["information"], at_zero=v["at_zero"], eta_i=a.data.eta_i,
            wavelength_um=a.wavelength_um, shape=a.shape, measurement=None,
        ),
    )  # fmt: skip
    return found, f


def fit_bare_surface(
    measurement: Measurement,
    sample: Sample,
    errors: str,
    intervals: str,
    start: Mapping[str, Any] | None = None,
) -> FitData:
    """Return eta and k of one bare surface from R_s, R_p and R, each wavelength by itself.

    Arguments as in `fitting.fit`; batch shape () for one wavelength, else (W,) in rising order.
    """
    a = of_measurement(measurement, sample.eta_i, errors)
    found, f = _fit(a, sample, errors, intervals, start)
    quantities = tuple(dict.fromkeys(measurement.quantity.tolist()))
    evaluator = found.evaluator
    assert isinstance(evaluator, SurfaceCurves)
    found = replace(
        found, measurement=measurement, notes=missing_errors([measurement], errors),
        curve=np.array([quantities.index(q) for q in measurement.quantity.tolist()]),
        curve_names=quantities, evaluator=evaluator._replace(measurement=measurement),
        rms_of={quantities[0]: found.rms} if len(quantities) == 1 else {},
    )  # fmt: skip
    channel, curve, place = a.rows
    fitted = fitted_curves(a.data, f.solved)[channel, curve, place]
    known = ~np.isin(f.status, (NO_DATA, NOT_CONVERGED))
    fitted = np.where(known[curve], fitted, np.nan)
    # With the errors that were taken.
    kind, s = (np.atleast_1d(of)[curve] for of in (found.errors.taken, found.errors.added))
    further = np.where(known[curve], s * sizes(kind, fitted), 0.0)
    weighed = replace(measurement, sigma=np.hypot(measurement.sigma, further))
    missed = np.where(known, noise_of_misfits(a.data, a.angle_deg, f.solved), np.nan)
    found = with_order(found, weighed, curve, fitted, missed, a.stated)
    return widened(found) if errors == "auto" else found


def fit_surfaces(
    angles_deg: Any, arrays: Mapping[str, Any], sigma: Any, sample: Sample, errors: str,
    intervals: str, start: Mapping[str, Any] | None,
) -> FitData:  # fmt: skip
    """Return eta and k of bare surfaces from arrays of R_s, R_p and R, (..., M); see `fit_many`."""
    a = of_arrays(angles_deg, arrays, sigma if errors != "equal" else None, sample.eta_i)
    if errors in NEED_STATED and not a.stated:
        raise ValueError(
            f'errors "{errors}" need a standard error for every datum; give sigma, or take '
            'errors "scaled" or "equal".'
        )
    return _fit(a, sample, errors, intervals, start)[0]
