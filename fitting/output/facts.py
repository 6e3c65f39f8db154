"""The lines of a table or page beside the parameters of a fit: a label and a text each."""

from __future__ import annotations

import math

import numpy as np

from fitting.outcomes.findings import is_outer
from fitting.output.estimates import (
    beside,
    by_wavelength,
    has_pseudo_index,
    index_waves,
    k_is_limited,
    k_text,
    reach,
    shown_name,
    value_text,
)
from fitting.output.numbers import interval_text, number, size_text, with_error
from fitting.process.visible import visible
from fitting.results.result import Fit
from fitting.results.result_parts import CONVERGED, UNDETERMINED, Alternative, Estimate

Facts = list[tuple[str, str]]
# How many second solutions, and how many correlations, are shown.
_OTHERS, _PAIRS = 3, 6
_NCS = "cos 2psi, sin 2psi cos Delta, sin 2psi sin Delta"


def counted(count: int, what: str) -> str:
    """Return ``3 warnings``."""
    return f"{count} {what}{'s' * (count != 1)}"


def converged(fit: Fit) -> str:
    """Return the status, or how many fits of a batch converged."""
    if not fit.shape:
        return str(fit.status)
    good = int((np.asarray(fit.status) == CONVERGED).sum())
    what = "wavelengths" if by_wavelength(fit) else "curves"
    return f"{good} of {np.size(fit.status)} {what} converged"


def title_of(fit: Fit) -> str:
    """Return what was fitted: the name of the file or files, or of the batch."""
    if fit.measurement is not None:
        return visible(fit.measurement.source)
    if fit.shape:
        return f"{' x '.join(map(str, fit.shape))} curves"
    return "one curve" if fit.sample is not None else "your own residuals"


def _structure(fit: Fit) -> str:
    sample = fit.sample
    if sample is None:
        return "your own residual function"
    films = sum(bool(m.thickness and m.thickness.coherent) for m in sample.layers)
    plates = len(sample.layers) - films
    film = "a film" if films == 1 else f"{films} films"
    plate = "a thick plate, both faces," if plates == 1 else f"{plates} thick plates"
    if sample.bare:
        what = "one bare surface"
    elif not plates:
        what = f"{film} on a substrate"
    else:
        what = f"{film} and " * bool(films) + f"{plate} whose reflections do not interfere"
    if sample.by_wavelength:
        names = "the pseudo-index <n>, <k>" if has_pseudo_index(fit) else "eta and k"
        each = " at every wavelength" if by_wavelength(fit) else ""
        what += f", {names} free{each}"
    return what


def sample_text(fit: Fit) -> str:
    """Return the sample in its own notation and in words."""
    if fit.sample is None:
        return _structure(fit)
    first = fit.sample.media[0]
    light = (
        f"a medium of index {fit.sample.eta_i:.10g}" if math.isfinite(fit.sample.eta_i)
        else first.text
    )  # fmt: skip
    return f"{fit.sample} ({_structure(fit)}; light from {light})"


def heading(fit: Fit) -> Facts:
    """Return how the file was read, and what was fitted."""
    rows: Facts = []
    if fit.measurement is not None:
        rows.append(("read", visible(fit.measurement.understood.removeprefix("read "))))
    return [*rows, ("sample", sample_text(fit))]


def _errors(fit: Fit) -> str:
    """Return how the standard errors were made; "" where there are none."""
    if not any(np.isfinite(np.asarray(e.sigma)).any() for e in fit.parameters.values() if e.free):
        return ""
    if fit.loss != "squares":
        noise = "the stated errors" if fit.errors.stated else "the noise above"
        return (
            f"one standard error (+-), from {noise} and the residuals as the {fit.loss} loss "
            "weighs them (Huber's estimate of the covariance)"
        )
    taken = np.unique(np.asarray(fit.errors.taken)).tolist()
    each = "; or ".join(_made_by(fit, kind) for kind in taken)
    widened = np.asarray(fit.errors.widened, float)
    text = f"one standard error (+-), from {each}"
    if (widened > 1.0).any():
        most = f"{widened.max():.2g}"
        upto = most if widened.min() == widened.max() else f"up to {most}"
        text += f"; multiplied by {upto}, since the residuals are autocorrelated"
    return text


def _made_by(fit: Fit, taken: str) -> str:
    if taken in ("floor", "relative"):
        added = np.asarray(fit.errors.added, float)
        size = "another at each wavelength"
        if not added.ndim:
            size = f"{added:.2g}" if taken == "floor" else f"{100.0 * added:.2g} % of each"
        kind = "a common error" if taken == "floor" else "a relative error"
        return f"the stated errors and {kind} of the data ({size}), added in squares"
    if taken == "equal" or (taken == "scaled" and not fit.errors.stated):
        return "the scatter of the data about the fit (equal weights)"
    if taken == "scaled":
        factor = np.asarray(fit.errors.factor, float) / np.asarray(fit.errors.widened, float)
        size = f" = {factor:.3g}" if not factor.ndim and np.isfinite(factor) else ""
        return f"the stated errors of the data times sqrt(chi2/dof){size}"
    return "the stated errors of the data as they are"


def _rms(fit: Fit) -> str:
    """Return the root mean square of the residuals, of all and of each quantity."""
    of = "unweighted"
    if len(fit.rms_of) == 1:
        (only,) = fit.rms_of
        of = f"of {_NCS if only == 'NCS' else only}; unweighted"
    elif fit.rms_of:
        names = {"NCS": f"psi and Delta, as {_NCS},"}
        each = (f"{names.get(q, q)} {size_text(float(v))}" for q, v in fit.rms_of.items())
        of += f"; of {'; '.join(each)}"
    return f"{size_text(fit.rms)}  (root mean square of data - fit, {of})"


def _chi2(fit: Fit) -> tuple[str, str]:
    freedom = "one degree" if fit.dof == 1 else f"{fit.dof} degrees"
    if math.isnan(fit.chi2):
        return "dof", f"{freedom} of freedom (data minus fitted parameters)"
    each = number(fit.chi2_reduced, 3) if fit.dof else "-"
    return "chi2/dof", f"{each}  (chi2 {number(fit.chi2)}, {freedom} of freedom)"


def _correlation(fit: Fit) -> str:
    """Return all correlations, or the largest of many."""
    names, matrix = fit.names, fit.correlation
    pairs = [
        (float(matrix[i, j]), f"{shown_name(fit, names[j])} and {shown_name(fit, names[i])} ")
        for i in range(len(matrix))  # that of a shared thickness is unknown at one wavelength
        for j in range(i)
        if np.isfinite(matrix[i, j])
    ]
    many = len(pairs) > _PAIRS
    if many:
        pairs = sorted(pairs, key=lambda pair: -abs(pair[0]))
    text = ", ".join(f"{both}{c:+.3f}" for c, both in pairs[:_PAIRS])
    return f"{text} (the largest of {len(pairs)})" if many else text


def _status(fit: Fit) -> str:
    """Return the status, and how many starting points led to the minimum.

    Where the parameters are undetermined the starts end all along a valley, and none is counted.
    """
    if not fit.starts or fit.status == UNDETERMINED:
        return str(fit.status)
    return f"{fit.status}; {fit.reached} of {fit.starts} starting points led to this minimum"


def _of_second(e: Estimate, student: float) -> str:
    """Return a value with its standard error, or with its interval where that says otherwise."""
    text, ends = value_text(e, student), interval_text(*np.asarray(e.interval, float).tolist())
    unclear = ends and "+-" not in text and not math.isfinite(e.upper_limit)
    return f"{text} ({ends})" if unclear else text


def _alternative(fit: Fit, other: Alternative) -> str:
    """Return a second solution: its values with their errors, and how much worse it fits."""
    student = reach(fit)
    values = ", ".join(
        f"{shown_name(fit, name)} {_of_second(e, student)}" for name, e in other.parameters.items()
    )
    higher = "higher" if other.delta_chi2 >= 0.0 else "lower"
    return f"{values} (chi2 {higher} by {abs(other.delta_chi2):.2g})"


def index_rows(fit: Fit) -> list[list[str]]:
    """Return wavelength, eta and k of a dispersion model at every measured wavelength."""
    if fit.shape or fit.sample is None or fit.sample.by_wavelength or not len(index_waves(fit)):
        return []
    limited = k_is_limited(fit)
    return [
        [f"{w:.6g}", with_error(n, s), k_text(k, t, limited)]
        for w, n, s, k, t in zip(*(a.tolist() for a in fit.index()), strict=True)
    ]


def index_ends(fit: Fit) -> Facts:
    """Return eta and k of a dispersion model at the ends and in the middle of a spectrum."""
    rows = index_rows(fit)
    known = {"eta", "k"} & set(fit.parameters) or all(map(is_outer, fit.parameters))
    if known or len(rows) < 2:
        return []
    some = (rows[i] for i in sorted({0, len(rows) // 2, len(rows) - 1}))
    return [(f"at {float(w):.4g} um", f"eta {eta}, k {k}") for w, eta, k in some]


def _shared(fit: Fit) -> Facts:
    """Return the parameters that all fits of a batch have in common."""
    return [
        (name, f"{value_text(e)}  ({beside(e)})")
        for name, e in fit.parameters.items()
        if np.shape(e.value) != fit.shape
    ]


def _remedy(fit: Fit) -> Facts:
    """Return the line that says what to measure if most fits are undetermined; else no line."""
    status = np.asarray(fit.status)
    if 2 * int((status == UNDETERMINED).sum()) <= status.size:
        return []
    if fit.sample is None or not fit.sample.by_wavelength:
        return []
    text = "measure s and p at several angles, some of them beyond 60 degrees"
    also = "; or fit a dispersion model to the whole spectrum (the sample 'auto')"
    return [("what to do", text + also * by_wavelength(fit))]


def _of_one(fit: Fit) -> Facts:
    """Return how well one set of parameters describes the data, and how its errors were made."""
    rows = [_chi2(fit), ("rms", _rms(fit))]
    if fit.loss != "squares":
        unit = " times the stated errors" if fit.errors.stated else ""
        rows.append(("loss", f"{fit.loss}, for noise of {number(fit.noise, 3)}{unit}"))
    if errors := _errors(fit):
        rows.append(("errors", errors))
    if correlations := _correlation(fit):
        rows.append(("correlation", correlations))
    if math.isfinite(fit.bic):
        text = f"BIC {fit.bic:.2f}" + f", AICc {fit.aicc:.2f}" * math.isfinite(fit.aicc)
        rows.append(("criteria", f"{text} (of models of the same data, lower is better)"))
    rows.append(("status", _status(fit)))
    if fit.status != UNDETERMINED:  # all of a valley is one solution
        rows += [("also fits", _alternative(fit, a)) for a in fit.alternatives[:_OTHERS]]
    return rows + _remedy(fit)


def _of_many(fit: Fit) -> Facts:
    """Return what holds for all fits of a batch."""
    status, count = np.unique(np.asarray(fit.status), return_counts=True)
    what = "wavelengths" if by_wavelength(fit) else "curves"
    total = ", ".join(f"{n} {one}" for one, n in zip(status, count, strict=True))
    rows = [("status", f"{count.sum()} {what}: {total}")]
    if errors := _errors(fit):
        rows.append(("errors", errors))
    limited = [
        shown_name(fit, n) for n, e in fit.parameters.items()
        if np.isfinite(np.asarray(e.upper_limit)).any()
    ]  # fmt: skip
    if limited:
        text = f"(< ...) behind {' or '.join(limited)}: the 95 % upper limit"
        rows.append(("in brackets", text))
    return rows + _remedy(fit)


def findings(fit: Fit) -> Facts:
    """Return what was found beside the parameters of which there is a table."""
    return [*_shared(fit), *_of_many(fit)] if fit.shape else _of_one(fit)
