"""The warnings of the fits of a bare surface: for all curves at once, and from their residuals."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from fitting.bare_surface.added_error import Taken
from fitting.bare_surface.answer import FLAT_BELOW_DEG, Answer
from fitting.bare_surface.arrange import Arranged
from fitting.data.measurement import Measurement
from fitting.residuals.error_model import ADDED
from fitting.residuals.pattern import pattern
from fitting.results.diagnostics import Finding, ranked
from fitting.results.result import FitData


def shaped(values: Any, a: Arranged) -> Any:
    """Return an array (N, ...) in the shape of the batch; for a single curve a Python scalar."""
    array = np.asarray(values)
    if len(a.shape) != 1:
        array = array.reshape(a.shape + array.shape[1:])
    return array.item() if array.ndim == 0 else array


def _trade(information: np.ndarray) -> float:
    """Return by how much k^2 changes for one of eta along what the data see least; NaN: nothing."""
    _, vectors = np.linalg.eigh(np.nan_to_num(information))
    along_eta, along_u = vectors[:, 0]
    return along_u / along_eta if along_eta else np.nan


def _of_added(f: Answer, taken: Taken) -> dict[str, np.ndarray]:
    """Return which fits took a further error, and whose values it changes beyond their errors."""
    used = taken.kind != ""
    if not used.any():
        return {}
    with np.errstate(all="ignore"):
        apart = [
            np.abs(f.values[name] - taken.by_factor[:, i]) > f.values[f"sigma_{name}"]
            for i, name in enumerate(("eta", "k"))
        ]
    kinds = {f"errors_{kind}": taken.kind == kind for kind in ADDED}
    return {**kinds, "errors_differ": used & np.logical_or(*apart)}


def _of_others(f: Answer) -> dict[str, Any]:
    """Return how many other solutions there are, and the best of them."""
    o = f.others
    first = np.arange(len(o.there)), o.there.argmax(1)
    return {
        "count": o.there.sum(1), "parameters": ("eta", "k"), "delta_chi2": o.excess[first],
        "values": np.stack([o.values["eta"][first], o.values["k"][first]], -1),
    }  # fmt: skip


def _values(a: Arranged, f: Answer, taken: Taken, errors: str, code: str) -> dict[str, Any]:
    """Return the numbers of the finding ``code``, of all curves."""
    v, s = f.values, f.solved
    at_k = {"eta": v["eta"], "k": v["k"], "eta_i": a.data.eta_i}
    with np.errstate(all="ignore"):
        match code:
            case "not_converged":
                return {"evaluations": s.evaluations.astype(int)}
            case "perfect_mirror":
                return {"least_reflectance": v["least_reflectance"]}
            case "no_reflection":
                return {"eta_i": a.data.eta_i}
            case "circle" | "same_at_45_degrees":
                return at_k
            case "combination":
                slopes = np.full(len(v["eta"]), np.nan)
                for i in np.flatnonzero(f.codes[code]):
                    slopes[i] = _trade(v["information"][i])
                return {**at_k, "slope": slopes}
            case "misses_without_freedom":
                return {"n_data": s.count.astype(int), "rms": np.sqrt(s.plain / s.count)}
            case "does_not_describe":
                return {"rms": np.sqrt(s.plain / s.count), "sample": "one bare surface"}
            case "compatible_with_zero":
                even = v["eta"] >= a.data.eta_i
                return {"parameter": "k", "limit": v["limit"], "even": even}
            case "poorly_determined":
                share = v["sigma_eta"] / v["eta"]
                return {"parameters": ("eta",), "shares": share[:, None]}
            case "correlated":
                correlation = v["covariance"][:, 0, 1] / (v["sigma_eta"] * v["sigma_k"])
                pair = {"first": ("eta",), "second": ("k",)}
                return {**pair, "correlation": correlation[:, None]}
            case "chi2_large" | "chi2_small" | "errors_floor" | "errors_relative":
                chi2_reduced = np.where(f.dof > 0, v["chi2"] / f.dof, np.nan)
                if code.startswith("errors_"):
                    return {"chi2_reduced": chi2_reduced, "added": taken.s, "gain": taken.gain}
                believed = "stated" if errors == "stated" else "scaled"
                factor = np.sqrt(chi2_reduced)
                return {"chi2_reduced": chi2_reduced, "factor": factor, "errors": believed}
            case "errors_differ":
                added = np.stack([v["eta"], v["k"]], -1)
                both = {"added": added, "factor": taken.by_factor}
                return {"parameters": ("eta", "k"), **both}
            case "flat_curve":
                return {"below_deg": FLAT_BELOW_DEG}
            case "no_degrees_of_freedom":
                stated = np.isfinite(v["sigma_eta"])
                return {"n_data": s.count.astype(int), "unknowns": 2, "stated": stated}
            case "other_minima":
                return _of_others(f)
    return {}


def findings(a: Arranged, f: Answer, taken: Taken, errors: str) -> tuple[Finding, ...]:
    """Return the warnings of all curves, the most serious first, with the values of each."""
    codes = f.codes | _of_added(f, taken)
    some = np.any(list(codes.values()), axis=1)
    held = [code for code, one in zip(codes, some, strict=True) if one]
    return ranked(
        Finding(
            code,
            np.reshape(codes[code], a.shape),
            {
                name: shaped(value, a) if isinstance(value, np.ndarray) else value
                for name, value in _values(a, f, taken, errors, code).items()
            },
        )
        for code in held
    )


def with_order(
    found: FitData, m: Measurement, which: np.ndarray, fitted: np.ndarray, noise: np.ndarray,
    stated: bool,
) -> FitData:  # fmt: skip
    """Return the fit with what the residuals of every wavelength say, each looked at by itself.

    m: the data. which: the wavelength of each datum, as a number from 0 on. fitted: the curve at
    each, NaN without a fit. noise: of each wavelength that is missed by more than that, else NaN.
    stated: whether the fit used stated errors.
    """
    many = np.bincount(which)
    correlation, chance = np.full((2, len(many)), np.nan)
    each = np.split(np.argsort(which, kind="stable"), np.cumsum(many)[:-1])
    for i, rows in enumerate(each):
        part, at = m.where(rows), fitted[rows]
        if not np.isfinite(at).all():
            continue
        order = pattern(part, at, np.zeros(len(rows), int), stated)
        if order is not None:
            correlation[i], chance[i] = order.correlation, order.chance
    shape = found.shape
    new = {
        "residuals_in_order": (correlation, {
            "along": "angle", "correlation": correlation.reshape(shape),
            "chance": chance.reshape(shape),
        }),
        "does_not_describe": (noise, {
            "sample": "one bare surface", "rms": np.reshape(found.rms, shape),
            "noise": noise.reshape(shape),
        }),
    }  # fmt: skip
    findings = [f for f in found.findings if f.code not in new]
    for code, (where, values) in new.items():
        at = np.isfinite(where)
        if at.any():
            findings.append(Finding(code, at.reshape(shape), values))
    return replace(found, findings=ranked(findings))
