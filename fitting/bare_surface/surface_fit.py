"""One bare surface as a `Fit`: of a measurement, a wavelength each, or of arrays of any batch."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from fitting.bare_surface import thresholds as limit
from fitting.bare_surface.answer import Answer, answer, start_points
from fitting.bare_surface.arrange import Arranged, of_arrays, of_measurement
from fitting.bare_surface.batch import fitted_curves
from fitting.bare_surface.common_error import Taken, with_common_error
from fitting.bare_surface.curves import SurfaceCurves
from fitting.bare_surface.misfit import ENOUGH, order_of_residuals
from fitting.diagnostics import Finding
from fitting.measurement import Measurement
from fitting.observations import missing_errors
from fitting.result import (
    AT_LOWER,
    CONVERGED,
    FITTED,
    NONE,
    UNDETERMINED,
    Alternative,
    ErrorModel,
    Estimate,
    Fit,
)
from fitting.sample import Sample
from fitting.search import ERRORS
from fitting.sentences import SENTENCES
from fitting.uncertainty.intervals import check_intervals
from fitting.widening import widened


def _shaped(values: Any, a: Arranged) -> Any:
    """Return (N, ...) in the batch's shape; of one curve as a Python scalar where it is one."""
    array = np.asarray(values)
    array = array.reshape(a.shape + array.shape[1:])
    return array.item() if array.ndim == 0 else array


def _estimates(a: Arranged, f: Answer) -> dict[str, Estimate]:
    known, v = f.known, f.values
    clear = f.status == CONVERGED
    open_ = np.where(clear, FITTED, UNDETERMINED)
    of_k = np.where(v["at_zero"], AT_LOWER, open_)
    kind = _shaped(known.kind, a)
    return {
        "eta": Estimate(
            name="eta", value=_shaped(v["eta"], a), sigma=_shaped(v["sigma_eta"], a),
            interval=_shaped(known.eta, a), interval_kind=kind, status=_shaped(open_, a),
            upper_limit=_shaped(np.full_like(v["eta"], np.nan), a),
        ),
        "k": Estimate(
            name="k", value=_shaped(v["k"], a), sigma=_shaped(v["sigma_k"], a),
            interval=_shaped(known.k, a), interval_kind=kind, status=_shaped(of_k, a),
            upper_limit=_shaped(v["limit"], a),
        ),
    }  # fmt: skip


def _alternatives(a: Arranged, f: Answer) -> tuple[Alternative, ...]:
    """Return the second solution, NaN in curves that have none; no more than one is looked for."""
    if not f.second.any():
        return ()

    def estimate(name: str) -> Estimate:
        value = np.where(f.second, getattr(f.other, name), np.nan)
        nothing = np.full_like(value, np.nan)
        return Estimate(
            name=name, value=_shaped(value, a), sigma=_shaped(nothing, a),
            interval=_shaped(np.stack([nothing, nothing], -1), a),
            interval_kind=_shaped(np.full(value.shape, NONE), a),
            status=_shaped(np.full(value.shape, FITTED), a), upper_limit=_shaped(nothing, a),
        )  # fmt: skip

    excess = np.where(f.second, f.excess, np.nan)
    return (
        Alternative(
            parameters={name: estimate(name) for name in ("eta", "k")},
            delta_chi2=_shaped(excess, a), reached=_shaped(np.full_like(excess, np.nan), a),
        ),
    )  # fmt: skip


def _trade(information: np.ndarray) -> float:
    """Return by how much k^2 changes for one of eta along what the data see least; NaN: nothing."""
    _, vectors = np.linalg.eigh(np.nan_to_num(information))
    along_eta, along_u = vectors[:, 0]
    return along_u / along_eta if along_eta else np.nan


def _of_floor(f: Answer, taken: Taken) -> dict[str, np.ndarray]:
    """Return where a common error was taken, and where that changes more than the errors tell."""
    used = np.isfinite(taken.gain)
    with np.errstate(all="ignore"):
        apart = [
            np.abs(f.values[name] - taken.by_factor[:, i]) > f.values[f"sigma_{name}"]
            for i, name in enumerate(("eta", "k"))
        ]
    return {"errors_floor": used, "errors_differ": used & np.logical_or(*apart)}


def _findings(a: Arranged, f: Answer, taken: Taken, errors: str) -> tuple[Finding, ...]:
    v, s = f.values, f.solved
    with np.errstate(all="ignore"):
        chi2_reduced = np.where(f.dof > 0, v["chi2"] / f.dof, np.nan)
        share, rms = v["sigma_eta"] / v["eta"], np.sqrt(s.plain / s.count)
        correlation = v["covariance"][:, 0, 1] / (v["sigma_eta"] * v["sigma_k"])
    of_chi2 = {
        "chi2_reduced": chi2_reduced, "factor": np.sqrt(chi2_reduced),
        "errors": "stated" if errors == "stated" else "scaled",
    }  # fmt: skip
    at_k = {"eta": v["eta"], "k": v["k"], "eta_i": a.data.eta_i}
    slopes = np.full(len(v["eta"]), np.nan)
    for i in np.flatnonzero(f.codes["combination"]):
        slopes[i] = _trade(v["information"][i])
    values: dict[str, dict[str, Any]] = {
        "not_converged": {"evaluations": s.evaluations.astype(int)},
        "perfect_mirror": {"least_reflectance": v["least_reflectance"]},
        "no_reflection": {"eta_i": a.data.eta_i},
        "circle": at_k, "same_at_45_degrees": at_k, "combination": {**at_k, "slope": slopes},
        "does_not_describe": {"rms": rms, "sample": "one bare surface"},
        "compatible_with_zero": {
            "parameter": "k", "limit": v["limit"], "even": v["eta"] >= a.data.eta_i,
        },
        "poorly_determined": {"parameters": ("eta",), "shares": share[:, None]},
        "correlated": {
            "first": ("eta",), "second": ("k",), "correlation": correlation[:, None]
        },
        "chi2_large": of_chi2, "chi2_small": of_chi2,
        "flat_curve": {"below_deg": limit.FLAT_BELOW_DEG},
        "no_degrees_of_freedom": {
            "n_data": s.count.astype(int), "unknowns": 2, "stated": np.isfinite(v["sigma_eta"]),
        },
        "other_minima": {
            "count": 1, "delta_chi2": f.excess, "parameters": ("eta", "k"),
            "values": np.stack([f.other.eta, f.other.k], -1),
        },
    }  # fmt: skip
    codes = f.codes | _of_floor(f, taken)
    floored = np.stack([v["eta"], v["k"]], -1)
    values["errors_floor"] = {
        "chi2_reduced": chi2_reduced, "floor": taken.floor, "gain": taken.gain
    }  # fmt: skip
    values["errors_differ"] = {
        "parameters": ("eta", "k"), "floor": floored, "factor": taken.by_factor
    }  # fmt: skip
    return tuple(
        Finding(
            code,
            np.reshape(codes[code], a.shape),
            {
                name: _shaped(v, a) if isinstance(v, np.ndarray) else v
                for name, v in values.get(code, {}).items()
            },
        )
        for code in SENTENCES
        if code in codes and codes[code].any()
    )


def _fit(a: Arranged, f: Answer, taken: Taken, sample: Sample, errors: str) -> Fit:
    """Return what the engine found as a `Fit` of the batch's shape."""
    s, v = f.solved, f.values
    believed = "stated" if errors == "stated" else "scaled" if a.stated else "equal"
    believed = np.where(np.isfinite(taken.gain), "floor", believed)
    with np.errstate(all="ignore"):
        chi2_reduced = np.where(f.dof > 0, v["chi2"] / f.dof, np.nan)
        rms = np.sqrt(s.plain / s.count)
        informed = np.isfinite(v["information"]).all((1, 2))
    estimates = _estimates(a, f)
    return Fit(
        sample=sample, parameters=estimates, covariance=_shaped(v["covariance"], a),
        wavelength_um=_shaped(a.wavelength_um, a), chi2=_shaped(v["chi2"], a),
        chi2_reduced=_shaped(chi2_reduced, a), dof=_shaped(f.dof.astype(int), a),
        n_data=_shaped(s.count.astype(int), a), rms=_shaped(rms, a), status=_shaped(f.status, a),
        errors=ErrorModel(
            _shaped(believed, a),
            _shaped(np.where(believed == "stated", 1.0, v["factor"]), a),
            _shaped(np.zeros(len(rms)), a), a.stated, _shaped(np.ones(len(rms)), a),
        ),
        evaluations=_shaped(s.evaluations.astype(int), a), cost=_shaped(s.cost, a),
        findings=_findings(a, f, taken, errors), others=_alternatives(a, f),
        evaluator=SurfaceCurves(
            eta=v["eta"], k=v["k"], sigma_eta=v["sigma_eta"], sigma_k=v["sigma_k"],
            information=np.where(informed[:, None, None], v["information"], np.nan),
            at_zero=v["at_zero"], eta_i=a.data.eta_i, wavelength_um=a.wavelength_um,
            shape=a.shape, measurement=None,
        ),
    )  # fmt: skip


def fit_bare_surface(
    measurement: Measurement,
    sample: Sample,
    errors: str,
    intervals: str,
    start: Mapping[str, Any] | None = None,
) -> Fit:
    """Return eta and k of one bare surface from R_s, R_p and R, each wavelength by itself.

    Arguments as in `fitting.fit`; batch shape () for one wavelength, else (W,) in rising order.
    """
    a = of_measurement(measurement, sample.eta_i, errors)
    begin = start_points(start, a)
    f = answer(a, errors == "stated", begin, intervals)
    f, taken = with_common_error(a, f, errors, begin, intervals)
    found = _fit(a, f, taken, sample, errors)
    quantities = tuple(dict.fromkeys(measurement.quantity.tolist()))
    evaluator = found.evaluator
    assert isinstance(evaluator, SurfaceCurves)
    found = replace(
        found, measurement=measurement, notes=missing_errors([measurement], errors),
        curve=np.array([quantities.index(q) for q in measurement.quantity.tolist()]),
        curve_names=quantities, evaluator=evaluator._replace(measurement=measurement),
        rms_of=_rms_of(a, f, measurement),
    )  # fmt: skip
    if np.max(found.n_data) < ENOUGH:
        return found
    channel, curve, place = a.rows
    fitted = fitted_curves(a.data, f.solved)[channel, curve, place]
    weighed = _with_floor(found, measurement)
    found = with_order_of_residuals(found, weighed, fitted, a.stated)
    return widened(found) if errors == "auto" else found


def _with_floor(found: Fit, m: Measurement) -> Measurement:
    """Return the measurement with the errors that were taken."""
    floor = np.atleast_1d(found.errors.floor)
    if not floor.any():
        return m
    _, which = np.unique(m.wavelength_um, return_inverse=True)
    return replace(m, sigma=np.hypot(m.sigma, floor[which]))


def fit_many(
    angles_deg: Any,
    *,
    R_s: Any = None,
    R_p: Any = None,
    R: Any = None,
    sigma: Any = None,
    sample: str | Sample = "free",
    errors: str = "auto",
    intervals: str = "quadratic",
    start: Mapping[str, Any] | None = None,
) -> Fit:
    """Return eta + i k of many curves at once; the same answers, errors and warnings as one by one.

    But for one warning: whether residuals are noise is asked by `fit` alone.

    Args:
        angles_deg: (M,) degrees of incidence from the normal, 0 to 90, or (..., M) one set a curve.
        R_s, R_p, R: (..., M) reflectances as fractions (R unpolarized); NaN is a gap. One at least.
        sigma: None, or standard errors above 0 that broadcast to the data: one for all channels, or
            a mapping from channel to errors. NaN leaves the datum out.
        sample: one bare surface whose index is free: "free", or "1.515 | free" from inside glass.
        errors, start, intervals: as in `fit`, but intervals (and so the limit of k) are quadratic
            if nothing is said: one by profile takes 20 times as long as the fit itself.

    Returns: `Fit` of the batch shape (...), in float64; scalars for a single curve (M,).
        Speed: about 250,000 curves a second on two cores (60 angles, R_s and R_p, shared angles).

    Raises:
        ValueError: for values out of range, shapes that do not fit, or no data at all.
    """
    which = Sample.parse(sample)
    if not (which.bare and which.by_wavelength and np.isfinite(which.eta_i)):
        raise ValueError(
            f"fit_many is for one bare surface whose index is free; the sample {str(which)!r} came."
            " Fit others one by one with fit."
        )
    check_intervals(intervals)
    if errors not in ERRORS:
        raise ValueError(f"errors is {errors!r}; one of {', '.join(ERRORS)} was wanted.")
    arrays = {"R_s": R_s, "R_p": R_p, "R": R}
    a = of_arrays(angles_deg, arrays, sigma if errors != "equal" else None, which.eta_i)
    if errors in ("stated", "floor") and not a.stated:
        raise ValueError(
            f'errors="{errors}" was asked for, but there are no stated errors to take.'
        )
    begin = start_points(start, a)
    f = answer(a, errors == "stated", begin, intervals)
    f, taken = with_common_error(a, f, errors, begin, intervals)
    return _fit(a, f, taken, which, errors)


def _rms_of(a: Arranged, f: Answer, m: Measurement) -> dict[str, Any]:
    """Return the root mean square of the residuals by quantity; of a single one nothing anew."""
    with np.errstate(all="ignore"):
        rms = np.sqrt(f.solved.plain / f.solved.count)
    names = dict.fromkeys(m.quantity.tolist())
    return {next(iter(names)): _shaped(rms, a)} if len(names) == 1 else {}


def with_order_of_residuals(found: Fit, m: Measurement, fitted: np.ndarray, stated: bool) -> Fit:
    """Return the fit with the finding on residuals that are no noise, where there are such."""
    at, values = order_of_residuals(found, m, fitted, stated)
    if not at.any():
        return found
    shaped = {name: v.reshape(found.shape) for name, v in values.items()}
    new = Finding("residuals_in_order", at.reshape(found.shape), {"along": "angle", **shaped})
    order = list(SENTENCES)
    both = sorted([*found.findings, new], key=lambda f: order.index(f.code))
    return replace(found, findings=tuple(both))
