"""Many files, each fitted by itself: a table with one row for each, as text, CSV and JSON."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from fitting.output.as_data import batch_columns, csv_text, json_object, to_dict
from fitting.output.estimates import value_text
from fitting.output.facts import converged, counted
from fitting.output.numbers import number
from fitting.output.outputs import WRITTEN_BY
from fitting.output.text_table import head_of, rows_aligned, varied_of
from fitting.process.visible import visible
from fitting.results.result import Fit
from fitting.results.result_parts import UNDETERMINED

REFUSED = "refused"
EACH_MARK = f"results of files fitted one by one, {WRITTEN_BY}"
"""The first comment of `rows_csv`, by which a later run recognises that it is no measurement."""


class OfFile(NamedTuple):
    """The result for one file. name: as it was given; fit: None if the file was refused.

    error: why it was refused, else "".
    """

    name: str
    fit: Fit | None
    error: str = ""


def _value(fit: Fit, name: str) -> str:
    """Return a parameter with its error; of a spectrum its smallest and largest value."""
    e = fit.parameters[name]
    if fit.shape:
        values = np.asarray(e.value)
        some = values[np.isfinite(values)]
        return f"{some.min():.4g} to {some.max():.4g}" if some.size else "-"
    return f"({value_text(e)})" if fit.status == UNDETERMINED else value_text(e)


def _chi2(fit: Fit) -> str:
    value = np.ravel(fit.chi2_reduced).astype(float)
    some = value[np.isfinite(value)]
    return number(float(np.median(some)), 3) if some.size else "-"


def rows_text(files: Sequence[OfFile]) -> str:
    """Return the table for a terminal; a spectrum is one row, with the range of its index.

    chi2/dof of a spectrum is the median over its wavelengths.
    """
    fits = [file.fit for file in files if file.fit is not None]
    heads = {n: head_of(n, fit.parameters[n].unit) for fit in fits for n in varied_of(fit)}
    stated = any(_chi2(fit) != "-" for fit in fits)
    rows = [["file", *heads.values(), *["chi2/dof"] * stated, "status"]]
    for name, fit, _ in files:
        if fit is None:
            rows.append([visible(name), *["-"] * (len(heads) + stated), REFUSED])
            continue
        cells = [_value(fit, n) if n in fit.parameters else "-" for n in heads]
        warned = f", {counted(len(fit.findings), 'warning')}" if fit.findings else ""
        rows.append([visible(name), *cells, *[_chi2(fit)] * stated, converged(fit) + warned])
    return "\n".join(rows_aligned(rows)) + "\n"


def _rows(file: OfFile) -> list[dict[str, Any]]:
    """Return one row for a file, or one for each wavelength if the index is free at each."""
    fit, first = file.fit, {"file": visible(file.name)}
    if fit is None:
        return [{**first, "status": REFUSED, "message": visible(file.error)}]
    first["sample"] = str(fit.sample)
    columns = batch_columns(fit)
    warnings = np.ravel(fit.warnings) if fit.shape else [fit.warnings]
    columns["warnings"] = [" ".join(w.code for w in some) for some in warnings]
    cells = zip(*columns.values(), strict=True)
    return [{**first, **dict(zip(columns, row, strict=True))} for row in cells]


def rows_csv(files: Sequence[OfFile], decimal: str = ".") -> str:
    """Return a CSV with a row for each file, or for each wavelength if the index is free at each.

    Columns: file, sample, those of `batch_columns`, the codes of the warnings, and the message of a
    file that was refused. Columns that would be empty are left out.
    """
    rows = [row for file in files for row in _rows(file)]
    ends = ["chi2", "chi2_reduced", "dof", "n_data", "rms", "status", "warnings", "message"]
    heads = dict.fromkeys(["file", "sample", "wavelength_um"])
    heads |= dict.fromkeys(head for row in rows for head in row if head not in ends)
    columns = {head: [row.get(head, "") for row in rows] for head in [*heads, *ends]}
    filled = {h: c for h, c in columns.items() if any(x not in ("", None) and x == x for x in c)}
    return csv_text([EACH_MARK], filled, decimal)


def rows_json(files: Sequence[OfFile]) -> str:
    """Return ``{"files": [...]}``: for each file the fields of `to_dict`, or why it was refused."""
    each = []
    for name, fit, error in files:
        fields = {"status": REFUSED, "message": error} if fit is None else to_dict(fit)
        each.append({"file": name, **fields})
    return json_object({"written_by": "fresnel-fit", "files": each})
