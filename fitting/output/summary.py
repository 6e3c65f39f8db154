"""A fit as text for people: facts, a table of parameters, warnings; and its one line.

The facts (a label and a text each), the rows of the table and the warnings are made here once, for
the terminal, the page and the pictures.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from fitting.outcomes.findings import is_outer
from fitting.output import numbers
from fitting.output.numbers import number, size_text, value_text
from fitting.process.visible import visible
from fitting.residuals.error_model import OF_EACH
from fitting.results.diagnostics import Finding
from fitting.results.result import FitData
from fitting.results.result_parts import UNDETERMINED, Alternative, Estimate
from fitting.results.sentences import rise_of_chi2
from fitting.uncertainty.limits import student_quantile

Facts = list[tuple[str, str]]
# How many second solutions, and how many correlations, are shown.
_OTHERS, _PAIRS = 3, 6
# Of a batch of more than _ROWS fits only the first and last _ENDS are shown.
_ROWS, _ENDS = 400, 20
_LABEL = 13  # width of the column of labels
_NCS = "cos 2psi, sin 2psi cos Delta, sin 2psi sin Delta"


def counted(count: int, what: str) -> str:
    """Return ``3 warnings``."""
    return f"{count} {what}{'s' * (count != 1)}"


def reach(fit: FitData) -> float:
    """Return half the width of a 95 % interval in standard errors: Student's t, or 1.96.

    NaN for a batch: its fits may share one estimate of the noise, whose degrees of freedom differ.
    """
    stated = fit.errors.taken == "stated"
    if fit.shape or not (stated or fit.dof):
        return math.nan
    return student_quantile(0 if stated else fit.dof)


def by_wavelength(fit: FitData) -> bool:
    """Whether the batch is one fit a wavelength."""
    waves = np.asarray(fit.wavelength_um)
    return fit.shape != () and waves.shape == fit.shape and bool(np.isfinite(waves).all())


def index_waves(fit: FitData) -> np.ndarray:
    """Return the known wavelengths, micrometres, at which `Fit.index` gives eta and k."""
    if fit.sample is None or fit.evaluator is None:
        return np.empty(0)
    waves = np.atleast_1d(np.asarray(fit.wavelength_um, float))
    return waves[np.isfinite(waves)]


def shown_name(fit: FitData, name: str) -> str:
    """Return the name under which a parameter is shown: those of a pseudo-index are <n> and <k>."""
    pseudo = any(note.code == "pseudo_index" for note in fit.notes)
    return {"eta": "<n>", "k": "<k>"}.get(name, name) if pseudo else name


def varied_of(fit: FitData) -> list[str]:
    """Return the fitted parameters; of a batch those of which every fit has its own value."""
    if not fit.shape:
        return list(fit.names)
    return [n for n, e in fit.parameters.items() if np.shape(e.value) == fit.shape]


def head_of(name: str, unit: str) -> str:
    """Return the header of a column: the name, and the unit in brackets."""
    return f"{name} ({unit})" if unit else name


def status_of(fit: FitData) -> str:
    """Return the status; of a batch how many fits have which."""
    if not fit.shape:
        return str(fit.status)
    each, count = np.unique(np.asarray(fit.status), return_counts=True)
    return ", ".join(f"{n} {status}" for status, n in zip(each, count, strict=True))


def title_of(fit: FitData) -> str:
    """Return what was fitted: the name of the file or files, or of the batch."""
    if fit.measurement is not None:
        return visible(fit.measurement.source)
    if fit.shape:
        return f"{' x '.join(map(str, fit.shape))} curves"
    return "one curve" if fit.sample is not None else "your own residuals"


def sample_text(fit: FitData) -> str:
    """Return the sample in its own notation and in words."""
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
        pseudo = shown_name(fit, "eta") != "eta"
        names = "the pseudo-index <n>, <k>" if pseudo else "eta and k"
        what += f", {names} free{' at every wavelength' * by_wavelength(fit)}"
    known = math.isfinite(sample.eta_i)
    light = f"a medium of index {sample.eta_i:.10g}" if known else sample.media[0].text
    return f"{sample} ({what}; light from {light})"


def _errors(fit: FitData) -> str:
    """Return how the standard errors were made; "" where there are none."""
    if not any(np.isfinite(np.asarray(e.sigma)).any() for e in fit.parameters.values() if e.free):
        return ""
    if fit.loss != "squares":
        noise = "the stated errors" if fit.errors.stated else "the noise above"
        return (
            f"one standard error (+-), from {noise} and the residuals as the {fit.loss} loss "
            "weighs them (Huber's estimate of the covariance)"
        )
    widened = np.asarray(fit.errors.widened, float)
    factor, added = np.asarray(fit.errors.factor, float) / widened, np.asarray(fit.errors.added)
    floor = share = "another at each wavelength"
    if not added.ndim:
        floor, share = f"{added:.2g}", f"{100.0 * added:.2g} % of each"
    by = f" = {factor:.3g}" if not factor.ndim and np.isfinite(factor) else ""
    stated = "the stated errors"
    made = {
        "stated": f"{stated} of the data as they are",
        "scaled": f"{stated} of the data times sqrt(chi2/dof){by}",
        "floor": f"{stated} and a common error of the data ({floor}), added in squares",
        "relative": f"{stated} and a relative error of the data ({share}), added in squares",
        "equal": "the scatter of the data about the fit (equal weights)",
        OF_EACH: "the scatter of each quantity about the fit",
    }
    if not fit.errors.stated:
        made["scaled"] = made["equal"]
    taken = np.unique(np.asarray(fit.errors.taken)).tolist()
    text = f"one standard error (+-), from {'; or '.join(made[kind] for kind in taken)}"
    if (widened > 1.0).any():
        upto = "up to " * bool(widened.min() < widened.max())
        text += f"; multiplied by {upto}{widened.max():.2g}, since the residuals are autocorrelated"
    if fit.sample is not None and fit.sample.films:
        # 1 nm of the wavelength is 30 standard errors of a thickness (300 nm of silica on Si).
        text += "; of the noise alone: angles, wavelengths and fixed indices may be off, too"
    return text


def _rms(fit: FitData) -> str:
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


def _correlation(fit: FitData) -> str:
    """Return all correlations, or the largest of many."""
    names, matrix = [shown_name(fit, name) for name in fit.names], fit.correlation
    pairs = [
        (float(matrix[i, j]), f"{names[j]} and {names[i]} ")
        for i in range(len(names))
        for j in range(i)
        if np.isfinite(matrix[i, j])  # that of a shared thickness is unknown at one wavelength
    ]
    many = len(pairs) > _PAIRS
    if many:
        pairs = sorted(pairs, key=lambda pair: -abs(pair[0]))
    text = ", ".join(f"{both}{c:+.3f}" for c, both in pairs[:_PAIRS])
    return f"{text} (the largest of {len(pairs)})" if many else text


def _of_second(e: Estimate, student: float) -> str:
    """Return a value with its standard error, or with its interval where that says otherwise."""
    text, ends = (
        value_text(e, student),
        numbers.interval_text(*np.asarray(e.interval, float).tolist()),
    )
    unclear = ends and "+-" not in text and not math.isfinite(e.upper_limit)
    return f"{text} ({ends})" if unclear else text


def _alternative(fit: FitData, other: Alternative) -> str:
    """Return a second solution: its values with their errors, and how much worse it fits."""
    student, each = reach(fit), other.parameters.items()
    values = ", ".join(f"{shown_name(fit, name)} {_of_second(e, student)}" for name, e in each)
    return f"{values} {rise_of_chi2({n: float(e.value) for n, e in each}, other.delta_chi2)}"


def index_rows(fit: FitData) -> list[list[str]]:
    """Return wavelength, eta and k of a dispersion model at every measured wavelength."""
    if fit.shape or fit.sample is None or fit.sample.by_wavelength or not len(index_waves(fit)):
        return []
    limited = any(
        not is_outer(name) and np.isfinite(np.asarray(e.upper_limit)).any()
        for name, e in fit.parameters.items()
    )
    return [
        [f"{w:.6g}", numbers.with_error(n, s), numbers.k_text(k, t, limited)]
        for w, n, s, k, t in zip(*(a.tolist() for a in fit.index()), strict=True)
    ]


def _index_ends(fit: FitData) -> Facts:
    """Return eta and k of a dispersion model at the ends and in the middle of a spectrum."""
    rows = index_rows(fit)
    known = {"eta", "k"} & set(fit.parameters) or all(map(is_outer, fit.parameters))
    if known or len(rows) < 2:
        return []
    some = (rows[i] for i in sorted({0, len(rows) // 2, len(rows) - 1}))
    return [(f"at {float(w):.4g} um", f"eta {eta}, k {k}") for w, eta, k in some]


def _of_one(fit: FitData) -> Facts:
    """Return how well one set of parameters describes the data, and how its errors were made."""
    freedom = "one degree" if fit.dof == 1 else f"{fit.dof} degrees"
    rows: Facts = [("dof", f"{freedom} of freedom (data minus fitted parameters)")]
    if not math.isnan(fit.chi2):
        each = number(fit.chi2_reduced, 3) if fit.dof else "-"
        rows = [("chi2/dof", f"{each}  (chi2 {number(fit.chi2)}, {freedom} of freedom)")]
    rows.append(("rms", _rms(fit)))
    if math.isfinite(fit.mse):
        text = "1000 sqrt(sum of squares of N, C, S / (3 points - fitted parameters))"
        rows.append(("MSE", f"{number(fit.mse, 3)}  ({text}, as ellipsometers print it)"))
    if fit.loss != "squares":
        unit = " times the stated errors" if fit.errors.stated else ""
        rows.append(("loss", f"{fit.loss}, for noise of {number(fit.noise, 3)}{unit}"))
    rows += [("errors", _errors(fit)), ("correlation", _correlation(fit))]
    if math.isfinite(fit.bic):
        text = f"BIC {fit.bic:.2f}" + f", AICc {fit.aicc:.2f}" * math.isfinite(fit.aicc)
        rows.append(("criteria", f"{text} (of models of the same data, lower is better)"))
    status = str(fit.status)
    # Where the parameters are undetermined the starts end all along a valley, which is one solution
    valley = status == UNDETERMINED
    if fit.starts and not valley:
        status += f"; {fit.reached} of {fit.starts} starting points led to this minimum"
    rows.append(("status", status))
    others = () if valley else fit.alternatives[:_OTHERS]
    return [*rows, *(("also fits", _alternative(fit, a)) for a in others)]


def _of_many(fit: FitData) -> Facts:
    """Return what all fits of a batch have in common."""
    rows = [
        (name, f"{value_text(e)}  ({numbers.beside(e)})")
        for name, e in fit.parameters.items()
        if np.shape(e.value) != fit.shape
    ]
    total = f"{np.size(fit.status)} {'wavelengths' if by_wavelength(fit) else 'curves'}"
    rows += [("status", f"{total}: {status_of(fit)}"), ("errors", _errors(fit))]
    limited = [
        shown_name(fit, n)
        for n, e in fit.parameters.items()
        if np.isfinite(np.asarray(e.upper_limit)).any()
    ]
    text = f"(< ...) behind {' or '.join(limited)}: the 95 % upper limit"
    return [*rows, *[("in brackets", text)] * bool(limited)]


def heading(fit: FitData) -> Facts:
    """Return how the file was read, and what was fitted."""
    m = fit.measurement
    read = [] if m is None else [("read", visible(m.understood.removeprefix("read ")))]
    return [*read, ("sample", sample_text(fit))]


def facts(fit: FitData) -> Facts:
    """Return what was found beside the parameters, of which there is a table."""
    rows = _of_many(fit) if fit.shape else _of_one(fit)
    status = np.asarray(fit.status)
    mostly = 2 * int((status == UNDETERMINED).sum()) > status.size
    if mostly and fit.sample is not None and fit.sample.by_wavelength:
        text = "measure s and p at several angles, some of them beyond 60 degrees"
        also = "; or fit a dispersion model to the whole spectrum (the sample 'auto')"
        rows.append(("what to do", text + also * by_wavelength(fit)))
    return [row for row in rows if row[1]]


def _told(fit: FitData) -> list[tuple[Finding, np.ndarray]]:
    """Return the warnings of a batch, the most serious first, each with the mask of its fits."""
    each = [(f, np.broadcast_to(np.asarray(f.at, bool), fit.shape)) for f in fit.findings]
    return [(finding, at) for finding, at in each if at.any()]


def _place(fit: FitData, index: tuple[int, ...]) -> str:
    """Return what one fit of a batch is called: its wavelength, or its place."""
    if by_wavelength(fit):
        return f"{np.asarray(fit.wavelength_um)[index]:.6g}"
    return ", ".join(str(i) for i in index)


def warnings_of(fit: FitData) -> Facts:
    """Return a label and a sentence for each kind of warning.

    Those of a batch have numbers; the sentence is that of the first fit that a warning concerns.
    """
    if not fit.shape:
        return [("warning", w.text) for w in fit.warnings]
    rows: Facts = []
    at, um, other = ("at", " um", "wavelength") if by_wavelength(fit) else ("curve", "", "curve")
    for finding, mask in _told(fit):
        first, *others = map(tuple, np.argwhere(mask))
        warning = finding.of(first, {})
        text = warning.sentence.removesuffix(".")
        where = f"{at} {_place(fit, first)}{um}"
        if others:
            own = any(isinstance(value, np.ndarray) for value in finding.values.values())
            where += f"; {'with other numbers ' * own}{'at' if um else 'in'} "
            where += counted(len(others), f"more {other}")
        rows.append((f"warning {len(rows) + 1}", f"{text} ({where}). {warning.advice}".rstrip()))
    return rows


def parameter_rows(fit: FitData) -> list[list[str]]:
    """Return a header, and for every parameter its name, its value and the remarks beside it."""
    rows = [
        [shown_name(fit, name), value_text(e, reach(fit)), numbers.beside(e)]
        for name, e in fit.parameters.items()
    ]
    # `choose` compares a sample without parameters with others
    return [["", "value +- std. error", "95 % interval"], *(rows or [["none was fitted", "", ""]])]


def batch_rows(fit: FitData, intervals: bool = False) -> list[list[str]]:
    """Return the header and one row for each fit of a batch, or for the first and last of many.

    intervals: whether to add a column with the 95 % interval of each parameter.
    """
    varied, masks = varied_of(fit), [at for _, at in _told(fit)]
    chi2, rms, all_status = (np.asarray(a) for a in (fit.chi2_reduced, fit.rms, fit.status))
    stated = bool(np.isfinite(chi2).any())
    head = ["wavelength_um" if by_wavelength(fit) else "curve"]
    head += [head_of(shown_name(fit, n), fit.parameters[n].unit) for n in varied]
    head += [f"{shown_name(fit, n)}, 95 % interval" for n in varied if intervals]
    rows = [[*head, *["chi2/dof"] * stated, "rms", "status", *["warnings"] * bool(masks)]]
    size = int(np.prod(fit.shape))
    shown = np.r_[:_ENDS, size - _ENDS : size] if size > _ROWS else np.arange(size)
    for at in zip(*np.unravel_index(shown, fit.shape), strict=True):
        each, status = [fit.parameters[name].at(at) for name in varied], str(all_status[at])
        # A value is put in brackets if it is one of many that fit equally well.
        form = "({})" if status == UNDETERMINED else "{}"
        cells = [_place(fit, at), *(form.format(value_text(e)) for e in each)]
        cells += [numbers.interval_of(e) for e in each if intervals]
        cells += [number(float(chi2[at]), 3)] * stated
        cells += [size_text(float(rms[at])), status]
        marks = " ".join(str(i) for i, mask in enumerate(masks, 1) if mask[at])
        rows.append([*cells, *[marks] * bool(masks)])
    if size > _ROWS:
        rows.insert(1 + _ENDS, ["...", *[""] * (len(rows[0]) - 1)])
    return rows


def rows_aligned(rows: Sequence[Sequence[str]], least: int = 0, margin: str = "  ") -> list[str]:
    """Return rows of cells as lines, the columns below each other; ``least``: width of the first"""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    widths[0] = max(widths[0], least)
    return [margin + "  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]


def _wrapped(facts: Iterable[tuple[str, str]], width: int) -> list[str]:
    """Return a label and a text beside it each, in lines of at most ``width`` characters."""
    return [
        textwrap.fill(
            text, max(width, 40), initial_indent=f"  {label + ' ':<{_LABEL}}",
            subsequent_indent=" " * (2 + _LABEL), break_long_words=False, break_on_hyphens=False,
        )
        for label, text in facts
    ]  # fmt: skip


def table(fit: FitData, width: int = 80, reference: str = "", choice: Any = None) -> str:
    """Return the fit as lines of at most ``width`` characters (rows of a batch may be longer).

    They say what was read and fitted; list every parameter with its standard error and 95 %
    interval, or one line for each fit of a batch; and state what the errors rest on, how well the
    fit describes the data, second solutions, warnings and notes.

    reference: what is said of a material, for comparison (`reference_text`); "" for nothing.
    choice: what was compared; None if no model was chosen.
    """
    rows = (
        rows_aligned(batch_rows(fit)) if fit.shape
        else rows_aligned(parameter_rows(fit), _LABEL - 2)
    )  # fmt: skip
    lines, told = [title_of(fit), *_wrapped(heading(fit), width)], warnings_of(fit)
    parts = [rows, _wrapped([*_index_ends(fit), *facts(fit)], width), _wrapped(told, width)]
    if fit.shape:  # the rows of many fits are too long to stand before what is said of them
        parts = [*parts[1:], rows]
    for part in (*parts, _wrapped([("note", note.text) for note in fit.notes], width)):
        lines += ["", *part] if part else []
    if choice is not None:
        lines += ["", "  models compared (BIC minus the lowest BIC; > marks the model taken)"]
        lines += [*rows_aligned(choice.table()), ""]
        lines += _wrapped([("choice", reason.text) for reason in choice.reasons], width)
    if reference:
        lines += ["", *_wrapped([("reference", reference)], width)]
    return visible("\n".join(lines), "\n") + "\n"


def one_line(fit: FitData) -> str:
    """Return ``<Fit: gold.csv, eta 0.344 +- 0.022, k 1.820 +- 0.087, converged>``.

    Of a batch how many fits converged, and how many have warnings.
    """
    free = [] if fit.shape else fit.names
    parts = [title_of(fit)]
    parts += [f"{shown_name(fit, n)} {value_text(fit.parameters[n], reach(fit))}" for n in free[:4]]
    if len(free) > 4:
        parts.append(counted(len(free) - 4, "more parameter"))
    parts.append(status_of(fit))
    if fit.findings and not fit.shape:
        parts.append(counted(len(fit.findings), "warning"))
    elif warned := int(np.any([np.broadcast_to(f.at, fit.shape) for f in fit.findings], 0).sum()):
        parts.append(f"{warned} with warnings")
    return visible(f"<Fit: {', '.join(parts)}>")


def reference_index(
    name: str, wavelength_um: np.ndarray, asked: str = "reference"
) -> tuple[np.ndarray, ...]:
    """Return wavelengths, eta and k of a named material, within the range of its source.

    asked: the argument or the option that named the material. Raises ValueError for an unknown
    material, or if no wavelength is known.
    """
    from fitting.process.compiled import fit_settings
    from fresnel_jax.dispersion import material

    try:
        found = material(name)
    except ValueError as error:
        raise ValueError(f"{asked} {name}: {error}, and so does fresnel-fit --materials.") from None
    if not np.isfinite(wavelength_um).any():
        raise ValueError(
            f"{asked} {name}: its index depends on the wavelength, which the data do not state; "
            "give it when the file is read (wavelength_um, --wavelength-um)."
        )
    low, high = found.range_um or (0.0, np.inf)
    inside = wavelength_um[(wavelength_um >= low) & (wavelength_um <= high)]
    with fit_settings():
        eta, k = (np.asarray(a) for a in found(inside)) if len(inside) else (inside, inside)
    return inside, eta, k


def reference_text(name: str, wavelength_um: Any, asked: str = "reference") -> str:
    """Return eta and k of a material at the ends and in the middle of the measured wavelengths."""
    inside, eta, k = reference_index(name, np.unique(np.asarray(wavelength_um, float)), asked)
    if not len(inside):
        return f"{name}: its source has no data at the measured wavelengths"
    some = sorted({0, len(inside) // 2, len(inside) - 1})
    parts = [f"at {inside[i]:.4g} um eta {eta[i]:.4g}, k {k[i]:.4g}" for i in some]
    return f"{name}: {'; '.join(parts)}"
