"""Fits that contradict their stated errors: repeated with a common error if that is likelier."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from fitting.measurements.measurement import Measurement, concatenate
from fitting.residuals.error_model import GAIN, ROUNDS, beyond_chance, likeliest_floor
from fitting.residuals.residuals import arcs, weighted_residuals
from fitting.results.diagnostics import Finding, ranked
from fitting.results.result import Fit
from fitting.uncertainty.intervals import QUADRATIC

Run = Callable[[Sequence[Measurement], str], Fit]


def _with_floor(
    several: Sequence[Measurement], found: Fit, fitted: np.ndarray, s: float
) -> list[Measurement]:
    """Return the measurements with s, in units of R and of arcs, added to all errors in squares."""
    joined = found.measurement
    assert joined is not None
    with np.errstate(divide="ignore"):
        # Where Delta has no effect (psi of 0) its error has none.
        own = s / np.maximum(arcs(joined, fitted), 1e-6)
    sigma = np.hypot(joined.sigma, own)
    parts = np.split(sigma, np.cumsum([len(m) for m in several])[:-1])
    return [replace(m, sigma=part) for m, part in zip(several, parts, strict=True)]


def with_common_error(
    run: Run, several: Sequence[Measurement], found: Fit, errors: str, intervals: str
) -> Fit:
    """Return the fit with a common error if it is asked for, or likelier than one factor.

    run: fits measurements again, with this kind of intervals. found: the fit with the stated errors
    times one factor. chi2 stays that of the stated errors.
    """
    if errors not in ("auto", "floor") or not found.errors.stated or found.loss != "squares":
        return found
    dof = int(np.sum(found.dof))
    if dof == 0:
        return found
    far, _ = beyond_chance(float(np.nansum(found.chi2)) / dof, dof)  # of all data together
    if errors == "auto" and not far:
        return found
    joined, best = concatenate(*several), found
    s, gain = 0.0, np.nan
    for left in reversed(range(ROUNDS)):
        fitted = best.predict().value
        off = weighted_residuals(joined, fitted, stated=False)
        floor = likeliest_floor(off, joined.sigma * arcs(joined, fitted))
        s, gain = float(floor.s), float(floor.gain)
        if s == 0.0 or (errors == "auto" and gain < GAIN):
            return found
        best = run(_with_floor(several, found, fitted, s), QUADRATIC if left else intervals)
    return _told(found, best, joined, (s, gain))


def _told(found: Fit, best: Fit, joined: Measurement, floor: tuple[float, float]) -> Fit:
    """Return the fit with a common error, with the findings on it."""
    fitted = best.predict().value
    square = (weighted_residuals(joined, fitted) ** 2).astype(float)
    if best.shape:
        _, which = np.unique(joined.wavelength_um, return_inverse=True)
        chi2 = np.bincount(which, square, minlength=best.shape[0])
    else:
        chi2 = float(square.sum())
    with np.errstate(all="ignore"):
        reduced = np.where(np.asarray(best.dof) > 0, chi2 / np.asarray(best.dof), np.nan)
    told = Finding("errors_floor", np.ones(best.shape, bool), {
        "chi2_reduced": float(np.nansum(chi2) / np.sum(best.dof)), "floor": floor[0],
        "gain": floor[1],
    })  # fmt: skip
    every = ranked([*best.findings, told, *_apart(found, best)])

    def each(value: Any) -> Any:
        return np.full(best.shape, value) if best.shape else value

    return replace(
        best, chi2=chi2, chi2_reduced=reduced if best.shape else float(reduced), measurement=joined,
        findings=every,
        errors=best.errors._replace(taken=each("floor"), floor=each(floor[0])),
    )  # fmt: skip


def _apart(found: Fit, best: Fit) -> list[Finding]:
    """Return the finding on parameters that differ between the two fits, if any do."""
    if best.shape:
        return []
    names = [
        n for n in best.names
        if n in found.parameters
        and abs(best.parameters[n].value - found.parameters[n].value)
        > np.fmax(best.parameters[n].sigma, found.parameters[n].sigma)
    ]  # fmt: skip
    if not names:
        return []
    values = {
        "parameters": tuple(names), "floor": tuple(best.parameters[n].value for n in names),
        "factor": tuple(found.parameters[n].value for n in names),
    }  # fmt: skip
    return [Finding("errors_differ", np.True_, values)]
