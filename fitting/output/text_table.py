"""The table of a fit on a terminal, and the one line that stands for it."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING

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
from fitting.output.numbers import number, size_text
from fitting.output.reference import reference_text
from fitting.process.visible import visible
from fitting.results.diagnostics import Finding
from fitting.results.result import Fit
from fitting.results.result_parts import UNDETERMINED

if TYPE_CHECKING:
    from fitting.choice.candidates import Choice

# Of a batch of more than _ROWS fits only the first and last _ENDS are shown.
_ROWS, _ENDS = 400, 20
_LABEL = 13  # width of the column of labels


def _told(fit: Fit) -> list[tuple[Finding, np.ndarray]]:
    """Return the warnings of a batch, the most serious first, each with the mask of its fits."""
    each = [(f, np.broadcast_to(np.asarray(f.at, bool), fit.shape)) for f in fit.findings]
    return [(finding, at) for finding, at in each if at.any()]


def _of_batch(fit: Fit, finding: Finding, at: np.ndarray) -> str:
    """Return the sentence of the first fit that a warning concerns, and how many others it does."""
    places = np.argwhere(at)
    text = finding.of(tuple(places[0]), {}).text.removesuffix(".")
    waves = by_wavelength(fit)
    first = wave_text(fit, tuple(places[0]))
    where = f"at {first} um" if waves else f"curve {first}"
    if len(places) > 1:
        own = any(isinstance(value, np.ndarray) for value in finding.values.values())
        more = facts.counted(len(places) - 1, f"more {'wavelength' if waves else 'curve'}")
        where += f"; {'with other numbers ' * own}{'at' if waves else 'in'} {more}"
    return f"{text} ({where})."


def warnings_of(fit: Fit) -> list[tuple[str, str]]:
    """Return a label and a sentence for each kind of warning; those of a batch have numbers."""
    if not fit.shape:
        return [("warning", w.text) for w in fit.warnings]
    told = [_of_batch(fit, *one) for one in _told(fit)]
    return [(f"warning {i}", text) for i, text in enumerate(told, 1)]


def _wrapped(label: str, text: str, width: int) -> str:
    """Return a label and a text beside it, in lines of at most ``width`` characters."""
    return textwrap.fill(
        text,
        max(width, 40),
        initial_indent=f"  {label + ' ':<{_LABEL}}",
        subsequent_indent=" " * (2 + _LABEL),
        break_long_words=False,
        break_on_hyphens=False,
    )


def rows_aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return rows of cells as lines with the columns below each other."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    return [
        "  " + "  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip()
        for row in rows
    ]


def parameter_rows(fit: Fit) -> list[list[str]]:
    """Return a header, and for every parameter its name, its value and the remarks beside it."""
    student = reach(fit)
    rows = [
        [shown_name(fit, name), value_text(e, student), beside(e)]
        for name, e in fit.parameters.items()
    ]
    # `choose` compares a sample without parameters with others
    return [["", "value +- std. error", "95 % interval"], *(rows or [["none was fitted", "", ""]])]


def _parameters(fit: Fit) -> list[str]:
    rows = parameter_rows(fit)
    first = max(_LABEL, 1 + max(len(row[0]) for row in rows))
    second = 2 + max(len(row[1]) for row in rows)
    return [f"  {name:<{first}}{value:<{second}}{more}".rstrip() for name, value, more in rows]


def head_of(name: str, unit: str) -> str:
    """Return the header of a column: the name, and the unit in brackets."""
    return f"{name} ({unit})" if unit else name


def varied_of(fit: Fit) -> list[str]:
    """Return the fitted parameters; of a batch those of which every fit has its own value."""
    if not fit.shape:
        return list(fit.names)
    return [n for n, e in fit.parameters.items() if np.shape(e.value) == fit.shape]


def batch_rows(fit: Fit, intervals: bool = False) -> list[list[str]]:
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
        cells = [wave_text(fit, at), *(form.format(value_text(e)) for e in each)]
        cells += [interval_of(e) for e in each if intervals]
        cells += [number(float(chi2[at]), 3)] * stated
        cells += [size_text(float(rms[at])), status]
        marks = " ".join(str(i) for i, mask in enumerate(masks, 1) if mask[at])
        rows.append([*cells, *[marks] * bool(masks)])
    if size > _ROWS:
        rows.insert(1 + _ENDS, ["...", *[""] * (len(rows[0]) - 1)])
    return rows


def table(fit: Fit, width: int = 80) -> str:
    """Return the fit as lines of at most ``width`` characters (rows of a batch may be longer).

    They say what was read and fitted; list every parameter with its standard error and 95 %
    interval, or one line for each fit of a batch; and state what the errors rest on, how well the
    fit describes the data, second solutions, warnings and notes.
    """
    blocks = [
        facts.heading(fit),
        [*facts.index_ends(fit), *facts.findings(fit)],
        warnings_of(fit),
        [("note", note.text) for note in fit.notes],
    ]
    heading, found, *told = [[_wrapped(*row, width) for row in rows] for rows in blocks]
    rows = rows_aligned(batch_rows(fit)) if fit.shape else _parameters(fit)
    lines = [facts.title_of(fit), *heading, "", *rows, "", *found]
    for paragraphs in filter(None, told):
        lines += ["", *paragraphs]
    return "\n".join(visible(line) for line in "\n".join(lines).split("\n")) + "\n"


def text_of(fit: Fit, width: int = 80, reference: str = "", choice: Choice | None = None) -> str:
    """Return what the command line prints: the table, the models compared, and a reference.

    reference: the name of a material whose eta and k are shown for comparison; "" for none.
    choice: what was compared; None if no model was chosen.
    """
    text = table(fit, width)
    if choice is not None:
        lines = ["", "  models compared (BIC minus the lowest BIC; > marks the model taken)"]
        lines += rows_aligned(choice.table())
        lines += ["", *(_wrapped("choice", reason.text, width) for reason in choice.reasons)]
        text += "\n".join(lines) + "\n"
    if reference:
        waves = np.atleast_1d(fit.wavelength_um)
        text += "\n" + _wrapped("reference", reference_text(reference, waves), width) + "\n"
    return text


def one_line(fit: Fit) -> str:
    """Return ``<Fit: gold.csv, eta 0.344 +- 0.022, k 1.820 +- 0.087, converged>``."""
    free = [] if fit.shape else fit.names
    student = reach(fit)
    parts = [facts.title_of(fit)]
    parts += [f"{shown_name(fit, n)} {value_text(fit.parameters[n], student)}" for n in free[:4]]
    if len(free) > 4:
        parts.append(facts.counted(len(free) - 4, "more parameter"))
    parts.append(facts.converged(fit))
    if fit.findings and not fit.shape:
        parts.append(facts.counted(len(fit.findings), "warning"))
    return visible(f"<Fit: {', '.join(parts)}>")
