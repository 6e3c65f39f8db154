"""The table of a fit on a terminal, and the one line that stands for it."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from fitting.output import facts
from fitting.output.estimates import (
    beside,
    by_wavelength,
    interval_of,
    reach,
    shown_name,
    value_text,
    wave_text,
)
from fitting.output.numbers import number, size_text, with_unit
from fitting.output.reference import reference_text
from fitting.output.warning_texts import warning_texts
from fitting.process.visible import visible
from fitting.results.result import UNDETERMINED, Estimate, Fit

# Of a batch of more than _ROWS fits only the first and last _ENDS are shown.
_ROWS, _ENDS = 400, 20
_LABEL = 13  # width of the column of labels


class Comparison(NamedTuple):
    """What `choose` compared, for the table and the page.

    rows: the header and one row of texts for each model; ``>`` marks the one taken. reasons:
    sentences that say why it was taken. data: the same as plain data, for JSON.
    """

    rows: Sequence[Sequence[str]]
    reasons: Sequence[str]
    data: dict[str, Any]


def _wrapped(label: str, text: str, width: int) -> str:
    """Return a label and a text beside it, in lines of at most ``width`` characters."""
    return textwrap.fill(
        text,
        max(width, 40),
        initial_indent=f"  {label:<{_LABEL}}",
        subsequent_indent=" " * (2 + _LABEL),
        break_long_words=False,
        break_on_hyphens=False,
    )


def _labelled(texts: Iterable[tuple[str, str]], width: int) -> list[str]:
    """Return an empty line and one paragraph for each label and text; nothing if there are none."""
    lines = [_wrapped(label, text, width) for label, text in texts]
    return ["", *lines] if lines else []


def rows_aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return rows of cells as lines with the columns below each other."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    return [
        "  " + "  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip()
        for row in rows
    ]


def parameter_rows(fit: Fit) -> list[list[str]]:
    """Return for every parameter its name, its value, and the remarks beside it."""
    student = reach(fit)
    return [
        [shown_name(fit, name), value_text(e, student), beside(e)]
        for name, e in fit.parameters.items()
    ]


def _one(fit: Fit, width: int) -> list[str]:
    rows = [["", "value +- std. error", "95 % interval"], *parameter_rows(fit)]
    first = max(_LABEL, 1 + max(len(row[0]) for row in rows))
    second = 2 + max(len(row[1]) for row in rows)
    lines = [f"  {name:<{first}}{value:<{second}}{more}".rstrip() for name, value, more in rows]
    if len(rows) == 1:  # a sample without parameters, which `choose` compared with others
        lines = ["  no parameter was fitted: the indices and thicknesses of the sample are fixed"]
    lines.append("")
    more = [*facts.index_rows(fit), *facts.findings_of_one(fit)]
    lines += [_wrapped(label, text, width) for label, text in more]
    return lines + _labelled((("warning", text) for text in warning_texts(fit).texts), width)


def _cells(
    fit: Fit, index: tuple[int, ...], varied: list[str], stated: bool, intervals: bool
) -> list[str]:
    status = str(np.asarray(fit.status)[index])
    each = [fit.parameters[name].at(index) for name in varied]
    # A value is put in brackets if it is one of many that fit equally well.
    form = "({})" if status == UNDETERMINED else "{}"
    cells = [wave_text(fit, index), *(form.format(value_text(e)) for e in each)]
    if intervals:
        cells += map(interval_of, each)
    if stated:
        cells.append(number(float(np.asarray(fit.chi2_reduced)[index]), 3))
    return [*cells, size_text(float(np.asarray(fit.rms)[index])), status]


def varied_of(fit: Fit) -> list[str]:
    """Return the parameters of which every fit of a batch has a value of its own."""
    return [n for n, e in fit.parameters.items() if np.shape(e.value) == fit.shape]


def shared_of(fit: Fit) -> list[tuple[str, str]]:
    """Return the parameters that all fits of a batch have in common."""
    return [
        (name, f"{value_text(e)}  ({beside(e)})")
        for name, e in fit.parameters.items()
        if np.shape(e.value) != fit.shape
    ]


def batch_rows(fit: Fit, intervals: bool = False) -> list[list[str]]:
    """Return the header and one row for each fit of a batch, or for the first and last of many.

    intervals: whether to add a column with the 95 % interval of each parameter.
    """
    varied, warned = varied_of(fit), warning_texts(fit)
    stated = bool(np.isfinite(np.asarray(fit.chi2_reduced)).any())
    units = {n: fit.parameters[n].unit for n in varied}
    head = ["wavelength_um" if by_wavelength(fit) else "curve"]
    head += [with_unit(shown_name(fit, n), f"({units[n]})" if units[n] else "") for n in varied]
    head += [f"{shown_name(fit, n)}, 95 % interval" for n in varied if intervals]
    head += [*["chi2/dof"] * stated, "rms", "status"]
    notes = bool(warned.texts)
    rows = [[*head, *["warnings"] * notes]]
    size = int(np.prod(fit.shape))
    shown = list(range(size))
    if size > _ROWS:
        shown = [*range(_ENDS), *range(size - _ENDS, size)]
    for i in shown:
        index = tuple(int(j) for j in np.unravel_index(i, fit.shape))
        rows.append(
            [*_cells(fit, index, varied, stated, intervals), *[warned.marks(index)] * notes]
        )
    if size > _ROWS:
        rows.insert(1 + _ENDS, ["...", *[""] * (len(rows[0]) - 1)])
    return rows


def _many(fit: Fit, width: int) -> list[str]:
    lines = [*rows_aligned(batch_rows(fit)), ""]
    lines += [_wrapped(f"{label} ", text, width) for label, text in shared_of(fit)]
    lines += [_wrapped(label, text, width) for label, text in facts.findings_of_many(fit)]
    texts = warning_texts(fit).texts
    return lines + _labelled(((f"warning {i}", t) for i, t in enumerate(texts, 1)), width)


def table(fit: Fit, width: int = 80) -> str:
    """Return the fit as lines of at most ``width`` characters (rows of a batch may be longer).

    They say what was read and fitted; list every parameter with its standard error and 95 %
    interval, or one line for each fit of a batch; and state what the errors rest on, how well the
    fit describes the data, second solutions, warnings and notes.
    """
    lines = [facts.title_of(fit)]
    lines += [_wrapped(label, text, width) for label, text in facts.heading(fit)]
    lines += ["", *(_many(fit, width) if fit.shape else _one(fit, width))]
    lines += _labelled((("note", note.text) for note in fit.notes), width)
    return "\n".join(visible(line) for line in "\n".join(lines).split("\n")) + "\n"


def text_of(
    fit: Fit, width: int = 80, reference: str = "", comparison: Comparison | None = None
) -> str:
    """Return what the command line prints: the table, the models compared, and a reference.

    reference: the name of a material whose eta and k are shown for comparison; "" for none.
    comparison: what `choose` compared; None if no model was chosen.
    """
    text = table(fit, width)
    if comparison is not None:
        lines = ["", "  models compared (BIC minus the lowest BIC; > marks the model taken)"]
        lines += rows_aligned(comparison.rows)
        lines += ["", *(_wrapped("choice", reason, width) for reason in comparison.reasons)]
        text += "\n".join(lines) + "\n"
    if reference:
        waves = np.atleast_1d(fit.wavelength_um)
        text += "\n" + _wrapped("reference", reference_text(reference, waves), width) + "\n"
    return text


def one_line(fit: Fit) -> str:
    """Return ``<Fit: gold.csv, eta 0.344 +- 0.022, k 1.820 +- 0.087, converged>``."""
    parts = [facts.title_of(fit)]
    if fit.shape:
        status = np.asarray(fit.status)
        good = int((status == "converged").sum())
        what = "wavelengths" if by_wavelength(fit) else "curves"
        parts.append(f"{good} of {status.size} {what} converged")
    else:
        free = [e for e in fit.parameters.values() if isinstance(e, Estimate) and e.free]
        student = reach(fit)
        parts += [f"{shown_name(fit, e.name)} {value_text(e, student)}" for e in free[:4]]
        more = len(free) - 4
        parts += [f"{more} more parameter{'s' * (more > 1)}"] * (more > 0)
        parts.append(str(fit.status))
        if fit.findings:
            parts.append(f"{len(fit.findings)} warning{'s' * (len(fit.findings) > 1)}")
    return visible(f"<Fit: {', '.join(parts)}>")
