"""Fits that contradict their stated errors: repeated with a further error if that is likelier."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from fitting.data.measurement import Measurement, concatenate
from fitting.data.quantities import are_powers
from fitting.residuals.error_model import (
    GAIN,
    ROUNDS,
    SETTLED,
    added_kinds,
    beyond_chance,
    likeliest_added,
    one_factor,
    sizes,
    worth_a_fit,
)
from fitting.residuals.residuals import arcs, weighted_residuals
from fitting.results.diagnostics import Finding, ranked
from fitting.results.result import FitData
from fitting.uncertainty.intervals import QUADRATIC

Run = Callable[[Sequence[Measurement], str], FitData]


def _with_added(
    several: Sequence[Measurement], joined: Measurement, fitted: np.ndarray, further: np.ndarray
) -> list[Measurement]:
    """Return the measurements with further errors, in units of R and of arcs, added in squares."""
    # Where Delta has no effect (psi of 0) its error has none.
    sigma = np.hypot(joined.sigma, further / np.maximum(arcs(joined, fitted), 1e-6))
    parts = np.split(sigma, np.cumsum([len(m) for m in several])[:-1])
    return [replace(m, sigma=part) for m, part in zip(several, parts, strict=True)]


class _Taken(NamedTuple):
    """A further error: its kind, its likeliest value, and the measurements with it."""

    kind: str
    s: float
    gain: float
    several: list[Measurement]


def _taken(
    run: Run, several: Sequence[Measurement], found: FitData, errors: str, kind: str
) -> _Taken | None:
    """Return the further error of a kind if the fit is to have it. run, found: see below."""
    joined, least = concatenate(*several), np.nan
    gain, s, weighed = -np.inf, 0.0, [*several]
    for left in reversed(range(ROUNDS)):
        fitted, before = found.fitted, (gain, s)
        off = weighted_residuals(joined, fitted, stated=False)
        sigma = joined.sigma * arcs(joined, fitted)
        size = sizes(kind, fitted, are_powers(joined.quantity))
        added = likeliest_added(off, sigma, size)
        if left == ROUNDS - 1:
            least = float(one_factor(off, sigma))
            if not worth_a_fit(errors, off, sigma, added):
                return None
        s, gain = float(added.s), 0.5 * (least - float(added.minus_two_log))
        # Each round gains less than the one before.
        if errors == "auto" and gain + (gain - before[0]) < GAIN:
            return None
        weighed = _with_added(several, joined, fitted, s * size)
        if not left or abs(s - before[1]) <= SETTLED * s:
            break
        found = run(weighed, QUADRATIC)
    if s == 0.0 or (errors == "auto" and gain < GAIN):
        return None
    return _Taken(kind, s, gain, weighed)


def with_added_error(
    run: Run, several: Sequence[Measurement], found: FitData, errors: str, intervals: str
) -> FitData:
    """Return the fit with a further error if it is asked for, or likelier than one factor.

    run: fits measurements again, with this kind of intervals. found: the fit with the stated errors
    times one factor. chi2 stays that of the stated errors.
    """
    kinds = added_kinds(errors)
    if not kinds or not found.errors.stated or found.loss != "squares":
        return found
    dof = int(np.sum(found.dof))
    if dof == 0:
        return found
    far, _ = beyond_chance(float(np.nansum(found.chi2)) / dof, dof)  # of all data together
    if errors == "auto" and not far:
        return found
    each = [_taken(run, several, found, errors, kind) for kind in kinds]
    most = max((t for t in each if t is not None), key=lambda t: t.gain, default=None)
    if most is None:
        return found
    best = run(most.several, intervals)
    return _told(found, best, concatenate(*several), most)


def _told(found: FitData, best: FitData, joined: Measurement, added: _Taken) -> FitData:
    """Return the fit with a further error, with the findings on it."""
    fitted = best.fitted
    square = (weighted_residuals(joined, fitted) ** 2).astype(float)
    if best.shape:
        _, which = np.unique(joined.wavelength_um, return_inverse=True)
        chi2 = np.bincount(which, square, minlength=best.shape[0])
    else:
        chi2 = float(square.sum())
    with np.errstate(all="ignore"):
        reduced = np.where(np.asarray(best.dof) > 0, chi2 / np.asarray(best.dof), np.nan)
    told = Finding(f"errors_{added.kind}", np.ones(best.shape, bool), {
        "chi2_reduced": float(np.nansum(chi2) / np.sum(best.dof)), "added": added.s,
        "gain": added.gain,
    })  # fmt: skip
    every = ranked([*best.findings, told, *_apart(found, best)])

    def each(value: Any) -> Any:
        return np.full(best.shape, value) if best.shape else value

    return replace(
        best, chi2=chi2, chi2_reduced=reduced if best.shape else float(reduced), measurement=joined,
        findings=every,
        errors=best.errors._replace(taken=each(added.kind), added=each(added.s)),
    )  # fmt: skip


def _apart(found: FitData, best: FitData) -> list[Finding]:
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
        "parameters": tuple(names), "added": tuple(best.parameters[n].value for n in names),
        "factor": tuple(found.parameters[n].value for n in names),
    }  # fmt: skip
    return [Finding("errors_differ", np.True_, values)]
