"""Fits that contradict their stated errors: repeated with a further error where that is likelier.

One loop serves a single fit, whose data share the further error, and the curves of a batch, each of
which has its own. Without stated errors a fit is repeated with the scatter of each quantity.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from fitting.data.measurement import Measurement, concatenate
from fitting.data.quantities import are_powers
from fitting.residuals.error_model import (
    ADDED,
    FLOOR,
    GAIN,
    OF_EACH,
    ROUNDS,
    SETTLED,
    added_kinds,
    beyond_chance,
    likeliest_added,
    one_factor,
    sizes,
    worth_a_fit,
)
from fitting.residuals.noise import scatter_of_each
from fitting.residuals.residuals import arcs, weighted_residuals
from fitting.results.diagnostics import Finding, ranked, those
from fitting.results.result import FitData
from fitting.uncertainty.intervals import AUTO, QUADRATIC

Run = Callable[[Sequence[Measurement], str], FitData]


class Taken(NamedTuple):
    """The further errors of N fits with n data each.

    kind: (N,), "" where there is none. s, gain: (N,), their likeliest values, and by how much the
    logarithm of the likelihood is higher than with one factor. sigma: (N, n), with them.
    """

    kind: np.ndarray
    s: np.ndarray
    gain: np.ndarray
    sigma: np.ndarray


@np.errstate(all="ignore")
def further_errors(
    errors: str, sigma: np.ndarray, fitted: np.ndarray, far: np.ndarray, power: np.ndarray,
    compared: Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]],
    refitted: Callable[[np.ndarray, np.ndarray], np.ndarray],
) -> Taken:  # fmt: skip
    """Return the further error of each of the fits ``far`` (N,) that is to have one.

    sigma, fitted: (N, n) stated errors, inf where there is no datum, and the model with one factor
    on them. power: (n,), which data are powers. compared: of fits (k,) and their model (k, n):
    residuals, and the factors that bring errors to the unit of these. refitted: of errors (k, n)
    and fits (k,): the model, fitted with them.
    """
    count = len(sigma)
    taken = Taken(
        np.full(count, "", f"<U{max(map(len, ADDED))}"), np.zeros(count), np.full(count, -np.inf),
        sigma.copy(),
    )  # fmt: skip
    for kind in added_kinds(errors):
        live = np.flatnonzero(far)
        model, s, gain = fitted[live], np.zeros(len(live)), taken.gain[live]
        least: Any = 0.0
        for left in reversed(range(ROUNDS)):
            off, unit = compared(live, model)
            own, size = sigma[live] * unit, sizes(kind, model, power)
            added = likeliest_added(off, own, size)
            go = np.ones(len(live), bool)
            if left == ROUNDS - 1:
                least, gain = one_factor(off, own), -np.inf
                go = worth_a_fit(errors, off, own, added)
            new = 0.5 * (least - added.minus_two_log)
            if errors == "auto":  # each round gains less than the one before
                go &= new + (new - gain) >= GAIN
            # Where Delta has no effect (psi of 0) its error has none.
            weighed = np.hypot(sigma[live], added.s[:, None] * size / np.maximum(unit, 1e-6))
            ended = (left == 0) | (np.abs(added.s - s) <= SETTLED * added.s)
            good = go & ended & (added.s > 0.0) & ((errors != "auto") | (new >= GAIN))
            good &= new > taken.gain[live]
            here = live[good]
            taken.kind[here], taken.s[here], taken.gain[here] = kind, added.s[good], new[good]
            taken.sigma[here] = weighed[good]
            go &= ~ended
            live, s, gain, least = live[go], added.s[go], new[go], least[go]
            if not len(live):
                break
            model = refitted(weighed[go], live)
    return taken


def _further(
    kind: str, run: Run, several: Sequence[Measurement], joined: Measurement, fitted: np.ndarray
) -> Taken:
    """Return the further error of a single fit: ``fitted`` (n,), with one factor on the errors."""

    def compared(_: np.ndarray, model: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        off = weighted_residuals(joined, model[0], stated=False)
        return off[None], arcs(joined, model[0])[None]

    return further_errors(
        kind, joined.sigma[None], fitted[None], np.ones(1, bool), are_powers(joined.quantity),
        compared, lambda sigma, _: run(_weighed(several, sigma[0]), QUADRATIC).fitted[None],
    )  # fmt: skip


def _weighed(several: Sequence[Measurement], sigma: np.ndarray) -> list[Measurement]:
    """Return the measurements with other errors, (N,) of all of them joined."""
    ends = np.cumsum([len(m) for m in several])[:-1]
    return [replace(m, sigma=s) for m, s in zip(several, np.split(sigma, ends), strict=True)]


def _with_own_scatter(
    run: Run, several: Sequence[Measurement], found: FitData, intervals: str
) -> FitData:
    """Return the fit in which each R and T without stated errors has the scatter of its own.

    With one scatter for both a noisy T hides what a quiet R says. Information criteria stay those
    of equal weights, by which models are compared.
    """
    joined = concatenate(*several)
    if found.curve is None or not are_powers(joined.quantity).all():
        return found
    if 2 * np.sum(found.dof) < len(joined):  # residuals are far smaller than the noise
        return found
    m, off = joined, (joined.value - found.fitted)[None]
    (sigma,) = scatter_of_each(m.angle_deg, m.wavelength_um, found.curve, m.value, off)
    if np.isnan(sigma).any():
        return found
    best = run(_weighed(several, sigma), intervals)
    # The errors are not stated ones: nothing is said of how far the residuals are from them.
    left = [f for f in best.findings if f.code not in ("chi2_large", "chi2_small")]
    none, every = np.full(best.shape, np.nan)[()], np.ones(best.shape, bool)[()]
    best = replace(
        best, measurement=joined, chi2=none, chi2_reduced=none, bic=found.bic, aicc=found.aicc,
        errors=best.errors._replace(stated=False), findings=tuple(left),
    )  # fmt: skip
    noise = np.array([sigma[found.curve == c][0] for c in range(len(found.curve_names))])
    return of_each(
        best, every, found.curve_names, np.broadcast_to(noise, (*best.shape, len(noise)))
    )


def of_each(best: FitData, at: Any, curves: Sequence[str], noise: np.ndarray) -> FitData:
    """Return fits, and where (S) each quantity has the scatter ``noise``, S + (C,), of its own."""
    values = {
        "curves": tuple(curves),
        "noise": those(noise, np.broadcast_to(at[..., None], noise.shape)),
    }
    taken = np.where(at, OF_EACH, best.errors.taken)[()]
    findings = ranked([*best.findings, Finding("errors_of_each", at, values)])
    return replace(best, errors=best.errors._replace(taken=taken), findings=findings)


def with_added_error(
    run: Run, several: Sequence[Measurement], found: FitData, errors: str, intervals: str
) -> FitData:
    """Return the fit with a further error if it is asked for, or likelier than one factor.

    run: fits measurements again, with this kind of intervals. found: the fit with the stated errors
    times one factor.
    """
    dof = int(np.sum(found.dof))
    if not added_kinds(errors) or found.loss != "squares" or not dof:
        return found
    if not found.errors.stated:
        return _with_own_scatter(run, several, found, intervals) if errors == "auto" else found
    far, _ = beyond_chance(float(np.nansum(found.chi2)) / dof, dof)  # of all data together
    if errors == "auto" and not far:
        return found
    joined = concatenate(*several)
    taken = _further(errors, run, several, joined, found.fitted)
    if not taken.kind[0]:
        return found
    best = run(_weighed(several, taken.sigma[0]), intervals)
    square = weighted_residuals(joined, best.fitted) ** 2
    which = np.unique(joined.wavelength_um, return_inverse=True)[1]
    chi2 = np.bincount(which, square, best.shape[0]) if best.shape else float(square.sum())
    before = {n: e.value for n, e in found.parameters.items()}
    return replace(told(before, best, taken, chi2), measurement=joined)


@np.errstate(all="ignore")
def told(before: Mapping[str, Any], best: FitData, taken: Taken, chi2: Any) -> FitData:
    """Return the ``best`` fit with further errors, and what is told of them.

    before: name -> value of the parameters, fitted with one factor. chi2: with the stated errors.
    """

    def shaped(values: np.ndarray) -> Any:
        if not best.shape:
            return values.item()
        return np.reshape(np.resize(values, np.prod(best.shape)), best.shape)

    kind, s, gain = (shaped(a) for a in taken[:3])
    reduced = np.where(np.asarray(best.dof) > 0, chi2 / np.asarray(best.dof), np.nan)
    reduced = reduced if best.shape else float(reduced)
    values = {"chi2_reduced": reduced, "added": s, "gain": gain}
    new = [Finding(f"errors_{one}", np.equal(kind, one), values) for one in ADDED]
    names = [n for n in best.names if n in before]
    own, sigma = (
        np.stack([np.asarray(getattr(best.parameters[n], part)) for n in names], -1)
        for part in ("value", "sigma")
    )
    other = np.stack([np.asarray(before[n]) for n in names], -1)
    apart = (np.abs(own - other) > sigma) & np.not_equal(kind, "")[..., None]
    differ = {
        "parameters": those(names, apart), "added": those(own, apart),
        "factor": those(other, apart),
    }  # fmt: skip
    new.append(Finding("errors_differ", apart.any(-1), differ))
    errors = best.errors._replace(
        taken=np.where(np.equal(kind, ""), best.errors.taken, kind)[()], added=s
    )
    every = ranked([*best.findings, *(f for f in new if np.any(f.at))])
    return replace(best, chi2=chi2, chi2_reduced=reduced, errors=errors, findings=every)


@np.errstate(all="ignore")
def covering(run: Run, several: Sequence[Measurement], found: FitData) -> FitData:
    """Return a misfit with intervals that cover those of all error models, where these disagree.

    run: as for `with_added_error`. Residuals that are no noise have no likelihood by which one of
    the error models were better than another.
    """
    joined, names = concatenate(*several), found.names
    start = run(several, QUADRATIC)
    others = [start]
    for kind in ADDED if are_powers(joined.quantity).any() else (FLOOR,):
        taken = _further(kind, run, several, joined, start.fitted)
        if taken.kind[0]:
            others.append(run(_weighed(several, taken.sigma[0]), AUTO))
    equal = np.sqrt(np.mean(weighted_residuals(joined, start.fitted, stated=False) ** 2))
    others.append(
        run(_weighed(several, equal / np.maximum(arcs(joined, start.fitted), 1e-3)), AUTO)
    )
    parameters, scale = dict(found.parameters), np.ones((*found.shape, len(names)))
    moved = np.zeros(scale.shape, bool)
    for i, name in enumerate(names):
        e, each = found.parameters[name], [o.parameters[name] for o in others]
        value, sigma = (np.stack([getattr(o, p) for o in each]) for p in ("value", "sigma"))
        apart = (np.abs(value - e.value) > np.fmax(sigma, e.sigma)).any(0)
        every = np.stack([e.interval, *(o.interval for o in each)])
        wide = np.stack([np.fmin.reduce(every[..., 0]), np.fmax.reduce(every[..., 1])], -1)
        wide = np.where(apart[..., None], wide, e.interval)
        factor = np.ptp(wide, axis=-1) / np.ptp(e.interval, axis=-1)
        scale[..., i] = np.where(np.isfinite(factor), factor, 1.0)
        new = (e.sigma * scale[..., i])[()]
        limit = np.where(np.isfinite(e.upper_limit), wide[..., 1], np.nan)[()]
        parameters[name] = replace(e, sigma=new, interval=wide, upper_limit=limit)
        moved[..., i] = (wide != e.interval).any(-1)
    if not moved.any():
        return found
    told = Finding("errors_cover", moved.any(-1), {"parameters": those(names, moved)})
    return replace(
        found, parameters=parameters, findings=ranked([*found.findings, told]),
        covariance=found.covariance * scale[..., :, None] * scale[..., None, :],
    )  # fmt: skip
