"""The content of the HTML page of a fit: facts, parameters, warnings, the picture, the data."""

from __future__ import annotations

import math

import numpy as np

from fitting.output import facts
from fitting.output.as_data import data_columns
from fitting.output.estimates import (
    by_wavelength,
    index_waves,
    interval_of,
    k_is_limited,
    k_text,
    reach,
    shown_name,
    state_of,
    value_text,
)
from fitting.output.numbers import number, with_error
from fitting.output.page import Table, fragment, page
from fitting.output.text_table import Comparison, batch_rows, shared_of
from fitting.output.warning_texts import warning_texts
from fitting.results.result import Fit


def _facts(fit: Fit) -> facts.Facts:
    head = facts.heading(fit)
    if fit.shape:
        return [*head, *shared_of(fit), *facts.findings_of_many(fit)]
    return [*head, *facts.findings_of_one(fit)]


def _parameters(fit: Fit) -> Table:
    student = reach(fit)
    rows = [
        [shown_name(fit, name), value_text(e, student), interval_of(e), state_of(e)]
        for name, e in fit.parameters.items()
    ]
    head = ["parameter", "value +- standard error", "95 % interval", "remark"]
    return Table("Parameters", head, rows or [["none was fitted", "", "", ""]])


def _correlations(fit: Fit) -> Table:
    rows = [
        [name, *("-" if np.isnan(c) else f"{c:+.3f}" for c in row)]
        for name, row in zip(fit.names, fit.correlation.tolist(), strict=True)
    ]
    return Table("Correlations", ["", *fit.names], rows)


def _index(fit: Fit) -> list[Table]:
    """Return eta and k of a dispersion model at every measured wavelength."""
    if fit.sample is None or fit.sample.by_wavelength or not len(index_waves(fit)):
        return []
    limited = k_is_limited(fit)
    rows = [
        [f"{w:.6g}", with_error(n, s), k_text(k, t, limited)]
        for w, n, s, k, t in zip(*(a.tolist() for a in fit.index()), strict=True)
    ]
    return [Table("Index over wavelength", ["wavelength, um", "eta", "k"], rows)]


def _batch(fit: Fit) -> Table:
    """Return a row for each fit of a batch, each parameter with its 95 % interval."""
    head, *rows = batch_rows(fit, intervals=True)
    if not by_wavelength(fit):
        return Table("Curves", head, rows)
    return Table("Index over wavelength", ["wavelength, um", *head[1:]], rows)


def _to_six_digits(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.6g}"


def _to_five_digits(value: float) -> str:
    return number(value, 5)


# The columns of data that the page shows: the header, and how a number is written.
_DATA = {
    "quantity": ("quantity", str),
    "angle_deg": ("angle, degrees", _to_six_digits),
    "wavelength_um": ("wavelength, um", _to_six_digits),
    "polarizer_deg": ("polarizer, degrees", _to_six_digits),
    "value": ("value", _to_five_digits),
    "sigma": ("standard error", _to_five_digits),
    "fitted": ("fitted", _to_five_digits),
    "residual": ("value - fitted", _to_five_digits),
}


def data_table(fit: Fit) -> list[Table]:
    """Return a table of data, fitted values and residuals; none if the fit keeps no data."""
    if fit.measurement is None:
        return []
    columns = data_columns(fit)
    shown = [(columns[name], *how) for name, how in _DATA.items() if name in columns]
    cells = [[text(x) for x in column] for column, _, text in shown]
    title = "Data (R and T as fractions, psi and Delta in degrees)"
    return [Table(title, [head for _, head, _ in shown], list(zip(*cells, strict=True)))]


def _tables(fit: Fit, comparison: Comparison | None) -> list[Table]:
    tables = [_batch(fit)] if fit.shape else [_parameters(fit)]
    if not fit.shape and len(fit.names) > 1:
        tables.append(_correlations(fit))
    if comparison is not None:
        head, *rows = comparison.rows
        tables.append(Table("Models compared", head, rows))
    return tables if fit.shape else [*tables, *_index(fit)]


def _notes(fit: Fit, comparison: Comparison | None) -> list[str]:
    reasons = [] if comparison is None else list(comparison.reasons)
    return [*reasons, *(note.text for note in fit.notes)]


def _caption(fit: Fit) -> str:
    text = "Data with one standard error, the fitted curve with its one-sigma band, data - fit"
    if fit.measurement is None:
        return "The fitted parameters of the batch."
    spectrum = len(index_waves(fit)) > 1
    return f"{text}{', eta and k over wavelength' if spectrum else ''}."


def fit_page(fit: Fit, png: bytes, command: str = "", comparison: Comparison | None = None) -> str:
    """Return the page of a fit, one self-contained HTML file.

    png: the picture. command: the command line that made the fit, for the foot of the page.
    comparison: what `choose` compared, if a model was chosen.
    """
    pictures = [(_caption(fit), png)] if png else []
    tables = [*_tables(fit, comparison), *data_table(fit)]
    above = 0 if fit.shape else 1  # the table of parameters; that of a batch is too long
    # The correlations have a table.
    shown = [(label, text) for label, text in _facts(fit) if label != "correlation"]
    return page(
        facts.title_of(fit), shown, warning_texts(fit).texts, _notes(fit, comparison), pictures,
        tables[above:], command, tables[:above], numbered=bool(fit.shape),
    )  # fmt: skip


def notebook(fit: Fit) -> str:
    """Return facts, warnings and parameters as HTML for a notebook's cell."""
    return fragment(
        facts.title_of(fit), _facts(fit), warning_texts(fit).texts, _notes(fit, None),
        _tables(fit, None)[:1], numbered=bool(fit.shape),
    )  # fmt: skip
