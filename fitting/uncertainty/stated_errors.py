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


class Weighed(NamedTuple):
    """N fits with certain errors of their data.

    model: of the fits (k,) at their data, (k, n). result: of all, its chi2 with the stated errors.
    """

    model: Callable[[np.ndarray], np.ndarray]
    result: Callable[[], FitData]


class Fits(NamedTuple):
    """N fits of n data each, fitted with one factor on their errors; of a single fit N is 1.

    value, sigma: (N, n), NaN and inf where there is no datum; sigma None: no errors are stated.
    angle_deg: (1, n) or (N, n). wavelength_um, power, curve: (n,), which data are powers, and of
    which of the ``names`` of quantities each is. chi2, dof: (N,). values: returns the parameters by
    name. compared: of fits (k,) and their model (k, n) the residuals, and the factors that bring
    errors to the unit of these. again: the fits, those of numbers (k,) with other errors (k, n).
    """

    value: np.ndarray
    sigma: np.ndarray | None
    angle_deg: np.ndarray
    wavelength_um: np.ndarray
    power: np.ndarray
    curve: np.ndarray
    names: Sequence[str]
    chi2: np.ndarray
    dof: np.ndarray
    values: Callable[[], Mapping[str, Any]]
    compared: Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
    first: Weighed
    again: Callable[[np.ndarray, np.ndarray], Weighed]


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
def _further_errors(errors: str, fits: Fits, far: np.ndarray) -> Taken:
    """Return the further error of each of the fits ``far`` (N,) that is to have one."""
    count, stated, some = len(fits.value), fits.sigma, np.flatnonzero(far)
    assert stated is not None
    taken = Taken(
        np.full(count, "", f"<U{max(map(len, ADDED))}"), np.zeros(count), np.full(count, -np.inf),
        stated.copy(),
    )  # fmt: skip
    fitted = fits.first.model(some)
    for kind in added_kinds(errors):
        live, model, s, gain = some, fitted, np.zeros(len(some)), taken.gain[some]
        least: Any = 0.0
        for left in reversed(range(ROUNDS)):
            off, unit = fits.compared(live, model)
            own, size = stated[live] * unit, sizes(kind, model, fits.power)
            added = likeliest_added(off, own, size)
            go = np.ones(len(live), bool)
            if left == ROUNDS - 1:
                least, gain = one_factor(off, own), -np.inf
                go = worth_a_fit(errors, off, own, added)
            new = 0.5 * (least - added.minus_two_log)
            if errors == "auto":  # each round gains less than the one before
                go &= new + (new - gain) >= GAIN
            # Where Delta has no effect (psi of 0) its error has none.
            weighed = np.hypot(stated[live], added.s[:, None] * size / np.maximum(unit, 1e-6))
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
            model = fits.again(weighed[go], live).model(live)
    return taken


def with_error_model(fits: Fits, errors: str) -> FitData:
    """Return fits with a further error if it is asked for, or likelier than one factor.

    And those of errors that are not stated with the scatter of each quantity, where these differ.
    """
    if fits.sigma is None:
        # With fewer degrees of freedom residuals are far smaller than the noise.
        enough = np.flatnonzero(2 * fits.dof >= np.isfinite(fits.value).sum(1))
        own = errors == "auto" and len(enough) and len(fits.names) > 1 and fits.power.all()
        return _with_own_scatter(fits, enough) if own else fits.first.result()
    large, _ = beyond_chance(fits.chi2 / np.maximum(fits.dof, 1), fits.dof)
    far = (large if errors == "auto" else fits.dof > 0) & np.isfinite(fits.chi2)
    if not added_kinds(errors) or not far.any():
        return fits.first.result()
    taken = _further_errors(errors, fits, far)
    used = np.flatnonzero(taken.kind != "")
    if not len(used):
        return fits.first.result()
    return _told(fits.values(), fits.again(taken.sigma[used], used).result(), taken)


def _with_own_scatter(fits: Fits, some: np.ndarray) -> FitData:
    """Return fits, of which ``some`` (k,) have for each R and T the scatter of its own.

    With one scatter for both a noisy T hides what a quiet R says.
    """
    angle = fits.angle_deg if len(fits.angle_deg) == 1 else fits.angle_deg[some]
    off = fits.value[some] - fits.first.model(some)
    sigma = scatter_of_each(angle, fits.wavelength_um, fits.curve, fits.value[some], off)
    differ = np.isfinite(sigma).any(1)
    some, sigma = some[differ], sigma[differ]
    if not len(some):
        return fits.first.result()
    best, count = fits.again(sigma, some).result(), len(fits.names)
    noise = np.full((len(fits.value), count), np.nan)
    noise[some] = sigma[:, np.unique(fits.curve, return_index=True)[1]]
    noise = np.resize(noise, (*best.shape, count))
    own = np.isfinite(noise)
    at, values = own.any(-1), {"curves": tuple(fits.names), "noise": those(noise, own)}
    taken = np.where(at, OF_EACH, best.errors.taken)[()]
    findings = ranked([*best.findings, Finding("errors_of_each", at, values)])
    return replace(best, errors=best.errors._replace(taken=taken), findings=findings)


@np.errstate(all="ignore")
def of_measurements(
    run: Run, several: Sequence[Measurement], found: FitData, intervals: str
) -> Fits:
    """Return a single fit of measurements, ``found`` with one factor on the stated errors.

    run: fits measurements again, with this kind of intervals.
    """
    joined = m = concatenate(*several)
    ends = np.cumsum([len(m) for m in several])[:-1]
    which = np.unique(m.wavelength_um, return_inverse=True)[1] if found.shape else [0] * len(m)
    none = np.full(found.shape, np.nan)[()]

    def again(sigma: np.ndarray, _: Any) -> Weighed:
        parts = zip(several, np.split(sigma[0], ends), strict=True)
        weighed = [replace(m, sigma=s) for m, s in parts]

        def result() -> FitData:
            best = run(weighed, intervals)
            if found.errors.stated:
                chi2 = np.bincount(which, weighted_residuals(joined, best.fitted) ** 2)
                return replace(best, measurement=joined, chi2=chi2.reshape(best.shape)[()])
            # These errors are not stated ones: nothing is said of how far the residuals are from
            # them, and models are compared with equal weights.
            left = [f for f in best.findings if f.code not in ("chi2_large", "chi2_small")]
            return replace(
                best, measurement=joined, chi2=none, chi2_reduced=none, bic=found.bic,
                aicc=found.aicc, errors=best.errors._replace(stated=False), findings=tuple(left),
            )  # fmt: skip

        return Weighed(lambda _: run(weighed, QUADRATIC).fitted[None], result)

    def compared(_: Any, model: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        off = weighted_residuals(joined, model[0], stated=False)
        return off[None], arcs(joined, model[0])[None]

    return Fits(
        value=m.value[None], sigma=m.sigma[None] if found.errors.stated else None,
        angle_deg=m.angle_deg[None], wavelength_um=m.wavelength_um, power=are_powers(m.quantity),
        curve=found.curve, names=found.curve_names,  # type: ignore
        chi2=np.array([np.nansum(found.chi2)]), dof=np.array([np.sum(found.dof)]),
        values=lambda: found.values, compared=compared,
        first=Weighed(lambda _: found.fitted[None], lambda: found), again=again,
    )  # fmt: skip


@np.errstate(all="ignore")
def _told(before: Mapping[str, Any], best: FitData, taken: Taken) -> FitData:
    """Return the ``best`` fits with further errors, and what is told of them.

    before: name -> value of the parameters, fitted with one factor.
    """
    kind, s, gain = (np.resize(a, best.shape)[()] for a in taken[:3])
    reduced = np.where(np.asarray(best.dof) > 0, best.chi2 / np.asarray(best.dof), np.nan)
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
    return replace(best, chi2_reduced=reduced, errors=errors, findings=every)


@np.errstate(all="ignore")
def covering(run: Run, several: Sequence[Measurement], found: FitData) -> FitData:
    """Return a misfit with intervals that cover those of all error models, where these disagree.

    run: as for `of_measurements`. Residuals that are no noise have no likelihood by which one of
    the error models were better than another.
    """
    start, names = run(several, QUADRATIC), found.names
    fits, alone = of_measurements(run, several, start, AUTO), np.arange(1)
    others = [start]
    for kind in ADDED if fits.power.any() else (FLOOR,):
        taken = _further_errors(kind, fits, alone == 0)
        if taken.kind[0]:
            others.append(fits.again(taken.sigma, alone).result())
    off, unit = fits.compared(alone, start.fitted[None])
    equal = np.sqrt(np.mean(off**2)) / np.maximum(unit, 1e-3)
    others.append(fits.again(equal, alone).result())
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
