"""Which warnings fits get: the conditions and their thresholds, on one fit or on each of many."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from fitting.data.measurement import Measurement
from fitting.data.quantities import REFLECTED, are_powers
from fitting.optics.instrument import INSTRUMENT
from fitting.optics.spec import NCS
from fitting.outcomes.doubtful_index import implausible_indices
from fitting.problem.evaluation import at_data
from fitting.problem.problem import Problem
from fitting.problem.unknowns import Unknowns
from fitting.residuals.error_model import OUT_OF_MODEL, beyond_chance
from fitting.residuals.pattern import pattern
from fitting.results.diagnostics import Finding, ranked, those
from fitting.results.result import FitData
from fitting.results.result_parts import (
    AT_LOWER,
    AT_UPPER,
    CONVERGED,
    FITTED,
    MISFIT,
    NOT_CONVERGED,
    PROFILE,
    QUADRATIC,
    UNDETERMINED,
    Estimate,
)
from fitting.results.sentences import SENTENCES
from fitting.samples.dispersion import CAUCHY_NAMES, Model
from fitting.samples.known_media import Mixture
from fitting.samples.sample import FREE, Sample
from fitting.uncertainty.covariance import End
from fitting.uncertainty.intervals import OFF

# Parameters of one formula (A, B and C of Cauchy's) are usually correlated, which does no harm. A
# parameter of the instrument that is correlated with the index does (angle offset of the gold scan:
# .79 and .71).
CORRELATED_WITHIN, CORRELATED = 0.999, 0.7
VAGUE = 0.5
# Errors of eta and k of more than this part of the radius of their circle are not to be believed.
_TURN = 0.1
# The zero of a goniometer is known better than that.
PLAUSIBLE_OFFSET_DEG = 2.0
FEW_REACHED = 3
# A fit lies between its prior and what the data alone give: by chance it is farther from the prior
# than so many of its standard errors in less than one of 10,000 fits.
PRIOR_ERRORS = 4.0
# A value of 0 within its error is usual of these, so that a large relative error is no news.
_MAY_VANISH = (*(set(INSTRUMENT) - {"scale"}), *"BCDEF")  # and the higher terms of Cauchy's index


# What says that the sample does not describe the data: such a fit is a misfit, not converged.
MISFITS = "does_not_describe", "candidates_do_not_describe", "explained_by", "alike"
# Residuals whose neighbours are correlated by this are twice as large as the noise that second
# differences show: the variance of these is 1 - 4 rho / 3 + rho^2 / 3 of theirs.
_TWICE_THE_NOISE = 0.68

# Without these a fit is one of a simpler sample or instrument.
_MAY_BE_0 = "k", "leak", "divergence", "bandwidth"
_ENDS = {AT_LOWER: "lower", AT_UPPER: "upper"}


class Subject(NamedTuple):
    """What is fitted: all files joined; None for the caller's own residuals."""

    sample: Sample | None
    measurement: Measurement | None

    @property
    def films(self) -> bool:
        """Whether the sample has a layer whose reflections interfere."""
        return self.sample is not None and self.sample.films


def _finding(code: str, **values: Any) -> Finding:
    return Finding(code, np.True_, values)


def _bare(name: str) -> str:
    return name.partition("[")[0].rpartition(".")[2]


def is_outer(name: str) -> bool:
    """Whether a parameter is not one of a material: of the instrument, or a thickness."""
    return _bare(name) in INSTRUMENT or _bare(name).startswith("thickness")


def with_formula(sample: Sample | None, absorbs: bool) -> str:
    """Return the text of a sample of whose formulas all absorb, or none; "" if that is so."""
    out = sample
    for index in {m.index for m in sample.media} if sample else ():
        if out and isinstance(index, Model) and index.absorbs != absorbs:
            out = out.with_model("cauchy-urbach" if absorbs else "cauchy", index)
    return "" if out == sample else str(out)


def other_formulas(sample: Sample | None) -> dict[str, str]:
    """Return the samples that show what is the model's alone: with a free index, without a k."""
    bare = sample if sample and sample.bare and not sample.by_wavelength else None
    free = f"{bare.media[0]} | {FREE}" if bare else ""
    return {"free": free, "clear": with_formula(sample, absorbs=False)}


def _held(found: FitData, names: Any) -> tuple[str, float] | None:
    """Return the last of these that may be fixed, and its value; None of a batch."""
    for name in () if found.shape else reversed(names):
        value = found.parameters[name].value
        if np.isfinite(value) and _bare(name) not in INSTRUMENT:  # which was freed as unknown
            return name, float(value)
    return None


def _beyond(found: FitData, name: str, end: str) -> str:
    """Return a range twice as long, beyond the end that was reached; "" where none may be set."""
    u: Unknowns | None = getattr(found.evaluator, "unknowns", None)
    if u is None:  # of a batch, or of the caller's own residuals
        return ""
    w = next(w for w in u.moving if u.labels.get(w.parameter.name) == name)
    p, length = w.parameter, w.high - w.low
    least, most = (0.0, np.inf) if "thickness" in name else (p.low, p.high)
    low = max(w.low - length, least) if end == "lower" else w.low
    high = min(w.high + length, most) if end == "upper" else w.high
    ends = (f"{x:.6g}" if np.isfinite(x) else "" for x in (low, high))
    return "" if (low, high) == (w.low, w.high) else "..".join(ends)


def _correlated(
    found: FitData, names: tuple[str, ...], ok: np.ndarray
) -> Iterator[tuple[Any, ...]]:
    """Yield the code, where (S), and values of correlated pairs, the most correlated first."""
    pairs = [(i, j) for i in range(len(names)) for j in range(i)]
    if not pairs:
        return
    seconds, firsts = (np.array([names[pair[n]] for pair in pairs], object) for n in (0, 1))
    outer = [is_outer(a) or is_outer(b) for a, b in zip(seconds, firsts, strict=True)]
    c = np.stack([found.correlation[..., i, j] for i, j in pairs], -1)
    at = ok[..., None] & (np.abs(c) > np.where(outer, CORRELATED, CORRELATED_WITHIN))
    order = np.argsort(-np.abs(np.nan_to_num(c)), -1, kind="stable")

    def listed(values: np.ndarray) -> Any:
        whole = np.broadcast_to(values, c.shape)
        return those(*(np.take_along_axis(a, order, -1) for a in (whole, at)))

    first, second = listed(firsts), listed(seconds)
    hold = _held(found, (*first[:1], *second[:1]))
    values = {"first": first, "second": second, "correlation": listed(c), "hold": hold}
    yield "correlated", at.any(-1), values


# If a film is thinner than this part of the wavelength, and its thickness and index are correlated
# by more than this, the data determine little more than their product.
_THIN, _ONE_PRODUCT = 0.08, 0.95


def _thin_film(
    known: Mapping[str, Estimate], correlation: np.ndarray, shortest_um: float
) -> Iterator[Finding]:
    """Yield the finding that only the product of thickness and index of a thin film is known."""
    for (name, e), row in zip(known.items(), np.abs(correlation), strict=True):
        if not name.endswith("thickness_nm") or not e.value < _THIN * 1e3 * shortest_um:
            continue
        head = name.removesuffix("thickness_nm")
        own = {
            n: c for n, c in zip(known, row.tolist(), strict=True)
            if n != name and n.startswith(head) and c > _ONE_PRODUCT
        }  # fmt: skip
        if own and np.isfinite(e.sigma):
            share = e.sigma / e.value
            held = float(np.sqrt(max(1.0 - max(own.values()) ** 2, 0.0)))
            yield _finding(
                "thin_film", thickness=name, value=e.value, share=share, parameters=tuple(own),
                held_share=share * held,
            )  # fmt: skip


def not_quadratic(known: Mapping[str, Estimate], plain: np.ndarray) -> list[Finding]:
    """Return the finding on parameters whose interval does not follow from the standard error.

    plain: the quadratic intervals (..., P, 2), in the shape of the fits.
    """
    kind, sigma, ends = (
        np.stack([getattr(e, name) for e in known.values()], plain.ndim - 2)
        for name in ("interval_kind", "sigma", "interval")
    )
    bent = (kind == PROFILE) & np.isfinite(sigma)
    bent &= np.abs(ends - plain).max(-1) > OFF * 0.5 * np.ptp(ends, axis=-1)
    if not bent.any():
        return []
    own = {"parameters": list(known), "intervals": ends, "by_sigma": plain}
    return [Finding("not_quadratic", bent.any(-1), {n: those(v, bent) for n, v in own.items()})]


def _a_k_is_free(u: Unknowns) -> bool:
    """Whether the fit determines the k of a medium; numbers are held, with k too."""
    free = {name for name, w in zip(u.spec.moving, u.moving, strict=True) if w.free}
    return any(
        index.absorbs and any(_acts_on_k(name, place) for name in free)
        for place, index in zip(u.spec.media.places, u.spec.media.index, strict=True)
        if isinstance(index, Model | Mixture)
    )


def _acts_on_k(name: str, place: str) -> bool:
    of, _, parameter = name.rpartition(".")
    # Cauchy's terms are of eta, and k beside them is that of an Urbach tail.
    others = ("eta", *CAUCHY_NAMES, "thickness_nm", "thickness_um", "grade", "birefringence")
    return of == place and parameter not in others and not parameter.startswith("fraction")


def _by_the_model_alone(u: Unknowns, m: Measurement, determined: bool) -> bool:
    """Whether k comes from the model: every wavelength has a single value, and that one of R or T.

    At one wavelength two unknowns that the data determine are k too.
    """
    if not _a_k_is_free(u) or not are_powers(m.quantity).all():
        return False
    waves = len(np.unique(m.wavelength_um))
    if waves == 1 and u.free.sum() > 1 and determined:
        return False
    columns = m.wavelength_um.tolist(), m.quantity.tolist(), m.angle_deg.tolist()
    normal = not m.angle_deg.any() and len(set(m.quantity.tolist())) == 1
    return normal or len({*zip(*columns, strict=True)}) == waves


def _what(sample: Any) -> str:
    return "one bare surface" if sample.bare else "this stack" if sample.films else "this plate"


def with_headline(found: FitData) -> FitData:
    """Return the fits with the status "misfit" where the sample does not describe the data.

    That is where a warning says so, or residuals are in order and larger than the stated errors or,
    without these, than twice the noise.
    """
    told = list(found.findings)
    missed = np.any([np.zeros(found.shape, bool), *(f.at for f in told if f.code in MISFITS)], 0)
    for f in [f for f in told if f.code == "residuals_in_order" and found.sample is not None]:
        far = beyond_chance(found.chi2_reduced, found.dof)[0]
        if not found.errors.stated:
            far = np.asarray(f.values["correlation"]).astype(float) > _TWICE_THE_NOISE
        new = f.at & far & ~missed
        if np.any(new):
            values = {"rms": found.rms, "sample": _what(found.sample), "noise": np.nan}
            values["absorbing"] = with_formula(found.sample, absorbs=True)
            told.append(Finding("does_not_describe", new, values))
            missed = missed | new
    status = np.where(missed & np.equal(found.status, CONVERGED), MISFIT, found.status)
    status = status if found.shape else status.item()
    return replace(found, status=status, findings=ranked(told))


def on_rows(
    u: Unknowns, m: Measurement, fitted: np.ndarray, curve: np.ndarray, stated: bool,
    determined: bool, sample: Sample | None = None,
) -> Iterator[Finding]:  # fmt: skip
    """Yield what the data and their residuals tell of a fit.

    fitted, curve: (N,) the model at each datum, and its curve. determined: by the data. sample:
    None for one of many wavelengths, for which the instrument cannot be fitted.
    """
    if _by_the_model_alone(u, m, determined):
        yield _finding("by_the_model_alone", **other_formulas(sample))
    order = pattern(m, fitted, curve, stated)
    if order is not None:
        free = (u.labels.get(n, "") for n, w in zip(u.spec.moving, u.moving, strict=True) if w.free)
        yield _finding(
            "residuals_in_order", along=order.along, correlation=order.correlation,
            chance=order.chance, powers=bool(are_powers(m.quantity).all()),
            as_it_is=sample is not None and not any(_bare(name) in INSTRUMENT for name in free),
        )  # fmt: skip


def _on_measured(fit: Problem, of: Subject, end: End) -> Iterator[Finding]:
    """Yield what is told of a measurement; rows of the caller's own residuals have no angle."""
    m, seen, determined = of.measurement, fit.seen, not end.known.unseen.size
    if m is None:
        return
    yield from on_rows(
        fit.u, m, at_data(seen, end.slopes.seen), seen.curve, seen.stated, determined, of.sample
    )  # fmt: skip
    if determined:
        for code, values in implausible_indices(fit, end, np.unique(m.wavelength_um)).items():
            yield _finding(code, **values)


def _other_minima(found: FitData, ok: np.ndarray) -> Iterator[tuple[Any, ...]]:
    """Yield what is told of other minima: the best of them, and the range of thicknesses in all."""
    if not found.others:
        return
    best = found.others[0]
    sets = [found.parameters, *(a.parameters for a in found.others)]
    each = {n: np.stack([np.asarray(p[n].value) for p in sets]) for n in best.parameters}
    thick = tuple(n for n in each if "thickness" in n)
    ranges = [np.stack([f.reduce(each[n], 0) for f in (np.fmin, np.fmax)], -1) for n in thick]
    there = np.stack([np.isfinite(a.delta_chi2) for a in found.others])
    yield "other_minima", ok & there[0], {
        "count": there.sum(0), "parameters": tuple(each),
        "values": np.stack([values[1] for values in each.values()], -1),
        "delta_chi2": best.delta_chi2, "thicknesses": thick,
        "ranges": np.stack(ranges, -2) if ranges else (),
        "own": () if found.shape else tuple(float(values[0]) for values in each.values()),
        "spectrum": found.sample is not None and found.sample.bare and len(found.shape) == 1
        and found.measurement is not None,
    }  # fmt: skip


def contradicted_priors(
    u: Unknowns, known: Mapping[str, Estimate], status: Any
) -> Iterator[Finding]:
    """Yield the finding on priors from which fits are far away, if they converged."""
    each = [(u.labels.get(w.parameter.name, ""), w.prior) for w in u.moving if w.prior]
    each = [(name, *prior) for name, prior in each if name in known]
    if not each:
        return
    value = np.stack([known[name].value for name, *_ in each], -1)
    errors = np.abs([(value[..., j] - mean) / sigma for j, (_, mean, sigma) in enumerate(each)])
    away = (errors > PRIOR_ERRORS) & np.not_equal(status, NOT_CONVERGED)
    told = np.empty(away.shape[1:], object)
    for i in map(tuple, np.argwhere(away.any(0))):
        told[i] = {name: (mean, sigma, float(value[i][j]), float(errors[j][i]))
                   for j, (name, mean, sigma) in enumerate(each) if away[j][i]}  # fmt: skip
    yield Finding("prior_contradicted", away.any(0), {"priors": told[()]})


def _on_parameters(
    found: FitData, known: Mapping[str, Estimate], ok: np.ndarray
) -> Iterator[tuple[Any, ...]]:
    """Yield code, where (S), and values of what fits ``ok`` (S) are told of their parameters."""
    # whose possible values at 0 are in the errors of the others
    covered = "k" if found.sample is not None and found.sample.by_wavelength else ""
    names = tuple(known)
    value, sigma, limit, state, kind, interval = (
        np.stack([np.asarray(getattr(e, part)) for e in known.values()], ok.ndim)
        for part in ("value", "sigma", "upper_limit", "status", "interval_kind", "interval")
    )
    of, profile, limited = ok[..., None], kind == PROFILE, np.isfinite(limit)
    for i, name in enumerate(names):
        others = np.arange(len(names)) != i
        bound = ok & np.isin(state[..., i], [*_ENDS])
        if not (bound | ok & limited[..., i]).any():
            continue
        values = {
            "parameter": name, "value": known[name].value,
            "others": those(
                names, bound[..., None] & others & np.isfinite(sigma) & (name != covered)
            ),
            "profile": profile[..., others].any(-1),
            "may_be_0": _bare(name) in _MAY_BE_0 and not ok.ndim,
        }  # fmt: skip
        near_zero = ok & limited[..., i]
        yield "compatible_with_zero", near_zero, {**values, "limit": known[name].upper_limit}
        for there, end in _ENDS.items():
            at = ok & ~near_zero & (state[..., i] == there)
            beyond = _beyond(found, name, end) if at.any() else ""
            yield "at_bound", at, {**values, "end": end, "beyond": beyond}
    bent = of & np.isnan(sigma) & (state == FITTED) & profile & ~limited
    yield "no_slope", bent.any(-1), {"parameters": those(names, bent)}
    unlimited = of & np.isinf(interval).any(-1)
    open_ = those(names, unlimited)
    yield "open_interval", unlimited.any(-1), {"parameters": open_, "hold": _held(found, open_)}
    # the standard error, or a quarter of an interval by profile if that is less
    error = np.where(profile, np.fmin(sigma, 0.25 * np.ptp(interval, axis=-1)), sigma)
    share = error / np.abs(value)
    vague = of & (share > VAGUE) & ~limited & [_bare(n) not in _MAY_VANISH for n in names]
    values = {"parameters": those(names, vague), "shares": those(share, vague)}
    hold = _held(found, values["parameters"])
    yield "poorly_determined", vague.any(-1), {**values, "hold": hold}


def _turned(found: FitData) -> Any:
    """Return where quadratic errors of a bare surface are no small part of its circle of one R(0).

    Along that circle (`surface_verdicts`) an index is least determined.
    """
    of = {n.rpartition(".")[2]: e for n, e in found.parameters.items() if e.free}
    assert found.sample is not None
    if not (found.sample.bare and {"eta", "k"} <= {*of} and set(found.rms_of) <= set(REFLECTED)):
        return False
    m, eta, k = found.sample.eta_i, of["eta"], of["k"]
    cosh = (m * m + eta.value**2 + k.value**2) / (2.0 * eta.value * m)
    far = np.hypot(eta.sigma, k.sigma) > _TURN * m * np.sqrt(cosh**2 - 1.0)
    return far & (np.asarray(eta.interval_kind) == QUADRATIC)


@np.errstate(all="ignore")
def findings_of_all(
    found: FitData,
    reduced: Any,
    missed: Any,
    unseen: Iterable[tuple[Any, Any]],
    noise: Any = np.nan,
) -> list[Finding]:
    """Return the findings that fits of any shape S have in common, on one fit or on each of many.

    reduced: chi2 / dof, without outliers; NaN where no errors are stated. missed: which fits do not
    describe their data without a degree of freedom. unseen: for the first combination of parameters
    that the data do not determine, the second, ... which fits have one, and the names in it.
    noise: that of data over the angle which a fit misses by more, else NaN.
    """
    known = {n: e for n, e in found.parameters.items() if e.free}
    status, dof, rms = np.asarray(found.status), np.asarray(found.dof), np.asarray(found.rms)
    ok, failed = np.isin(status, (CONVERGED, UNDETERMINED)), status == NOT_CONVERGED
    stated, taken = found.errors.stated, found.errors.taken
    large, small = beyond_chance(reduced, dof)
    unseen = list(unseen)
    # A bare surface is searched from a mesh of indices.
    own_starts = not found.shape and not (found.sample is not None and found.sample.by_wavelength)
    more = 4 * found.starts * own_starts
    as_it_is = not found.shape and not any(_bare(name) in INSTRUMENT for name in known)
    m = found.measurement if as_it_is and found.sample is not None else None
    measured = () if m is None else (*found.rms_of, *np.unique(m.quantity).tolist())
    few = ok & (np.asarray(found.n_data) < len(known)) & (status == UNDETERMINED)
    absorbing = with_formula(found.sample, absorbs=True)
    chi2 = {
        "chi2_reduced": reduced, "factor": np.sqrt(reduced),
        "errors": taken if stated else "scaled", "robust": found.loss != "squares",
        "no_sample": found.sample is None, "measured": measured, "absorbing": absorbing,
    }  # fmt: skip
    told: list[tuple[Any, ...]] = [
        ("not_converged", failed & np.logical_not(missed), {"more": more}),
        ("misses_without_freedom", failed & missed, {
            "n_data": found.n_data, "rms": rms,
            "errors_small": stated & (rms < OUT_OF_MODEL) & (found.sample is not None),
        }),
        *(
            ("not_seen", ok & at, {"parameters": names, "hold": _held(found, names)})
            for at, names in unseen
        ),
        ("one_value", few & ~np.any([at for at, _ in unseen], 0), {}),
        ("chi2_large", ok & large, chi2), ("chi2_small", ok & small & stated, chi2),
    ]  # fmt: skip
    if known:
        told += [*_on_parameters(found, known, ok), *_correlated(found, tuple(known), ok)]
    sure = status == CONVERGED
    reached = {"starts": found.starts, "reached": found.reached, "more": more}
    few = (np.asarray(found.starts) > FEW_REACHED) & (np.asarray(found.reached) < FEW_REACHED)
    told += [*_other_minima(found, sure), ("few_starts_agree", sure & few, reached)]
    sample = found.sample
    if sample is not None:
        far = {"rms": found.rms, "sample": _what(sample), "noise": noise, "measured": measured,
               "absorbing": absorbing}  # fmt: skip
        told.append(("does_not_describe", ok & ((rms > OUT_OF_MODEL) | np.isfinite(noise)), far))
        told.append(("quadratic_misleads", ok & _turned(found), {}))
    seen = np.any([np.isfinite(e.sigma) for e in known.values()], axis=0)
    data = found.measurement
    given = sample is None or (stated if data is None else np.isfinite(data.sigma).all())
    values = {"n_data": found.n_data, "unknowns": len(known), "stated": stated & seen,
              "sigma": not given and (0.05 if NCS in found.rms_of else 0.002)}  # fmt: skip
    told.append(("no_degrees_of_freedom", ok & (dof == 0), values))
    return [Finding(code, at, values) for code, at, values in told if np.any(at)]


def findings(
    fit: Problem, of: Subject, end: End, lower: float, fringeless: dict[str, Any] | None,
    found: FitData,
) -> list[Finding]:  # fmt: skip
    """Return the further findings on a single fit; see `of_fit.Found`."""
    known = {n: e for n, e in found.parameters.items() if e.free}
    out = []
    if fringeless is not None:
        out.append(_finding("fringes_in_noise", **fringeless))
    if of.measurement is not None and of.films:
        shortest = float(np.nanmin(of.measurement.wavelength_um))
        out += _thin_film(known, found.correlation, shortest)
    out += _on_measured(fit, of, end)
    if lower:
        out.append(_finding("better_minimum_met", by=lower, more=4 * fit.starts))
    if "angle_offset" in known and abs(known["angle_offset"].value) > PLAUSIBLE_OFFSET_DEG:
        out.append(_finding("implausible_offset", value=known["angle_offset"].value))
    return out


# What may be tried on one fit and not on one of many, which take one value for all.
_OF_ONE: dict[str, Any] = {
    "own": (), "measured": (), "as_it_is": False, "hold": None,
}  # fmt: skip


def stacked_findings(fits: Sequence[Sequence[Finding]]) -> tuple[Finding, ...]:
    """Return the findings on each of many fits as those on all, the most serious first."""
    out = []
    for code in SENTENCES:
        # A code may come more than once (a limit for each of two parameters).
        each = [[x for x in own if x.code == code] for own in fits]
        for i in range(max(map(len, each))):
            at = np.array([len(own) > i for own in each])
            names = {name for own in each if len(own) > i for name in own[i].values}
            values: dict[str, Any] = {n: x for n, x in _OF_ONE.items() if n in names}
            for name in sorted(names - values.keys()):
                values[name] = np.empty(len(fits), dtype=object)
                for j in np.flatnonzero(at):
                    values[name][j] = each[j][i].values.get(name)
            out.append(Finding(code, at, values))
    return tuple(out)
