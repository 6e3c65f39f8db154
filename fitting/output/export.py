"""Fits as data for other programs: a dict, a DataFrame, JSON, CSV, and a file of a material."""

from __future__ import annotations

import csv
import importlib
import importlib.util
import io
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

import fitting
from fitting.data.errors import MissingExtra
from fitting.data.units import span_of
from fitting.output import summary
from fitting.output.numbers import number, value_text
from fitting.predictions import predict
from fitting.process.visible import visible
from fitting.residuals.residuals import residuals
from fitting.results.diagnostics import Warning
from fitting.results.result import FitData
from fitting.results.result_parts import DETERMINED, REFUSED, UNDETERMINED, Alternative, Estimate

_AS_IT_IS = (
    "names", "covariance", "correlation", "wavelength_um", "chi2", "chi2_reduced", "dof", "n_data",
    "rms", "rms_of", "mse", "status", "sigma_kind", "loss", "noise", "cost", "bic", "aicc",
    "evaluations", "starts", "reached", "warnings", "notes", "alternatives",
)  # fmt: skip
WRITTEN_BY = "written by fresnel-fit"
DATA_MARK, INDEX_MARK = f"data of a fit, {WRITTEN_BY}", f"index of a fit, {WRITTEN_BY}"
EACH_MARK = f"results of files fitted one by one, {WRITTEN_BY}"
"""The first comments of tables, by which a later run recognises what is no measurement, and which
files it may replace."""
# What makes a spreadsheet compute a cell; also as wide letters.
_FORMULA = ("=", "+", "-", "@", "\uff1d", "\uff0b", "\uff0d", "\uff20")


class OfFile(NamedTuple):
    """The result for one file. name: as it was given; fit: None if the file was refused.

    error: why it was refused, else "".
    """

    name: str
    fit: FitData | None
    error: str = ""


def plain(value: Any) -> Any:
    """Return ``value`` as lists, dicts, numbers and strings, for JSON; None if not finite.

    Estimates and warnings are dicts; an array of tuples, as of the warnings of a batch, is a list
    for each fit.
    """
    if isinstance(value, Estimate | Alternative):
        value = {name: part for name, part in vars(value).items() if name != "name"}
    elif isinstance(value, Warning):
        value = value.to_dict()
    elif isinstance(value, np.ndarray | np.generic):
        value = (value.ravel() if value.dtype == object else value).tolist()
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def json_object(fields: Mapping[str, Any]) -> str:
    """Return ``fields`` as the text of a JSON object, one field a line; NaN is null."""
    lines = (
        f"  {json.dumps(name)}: {json.dumps(plain(value), allow_nan=False)}"
        for name, value in fields.items()
    )
    return "{\n" + ",\n".join(lines) + "\n}\n"


def to_dict(fit: FitData) -> dict[str, Any]:
    """Return a fit as plain data; see `Fit.to_dict`."""
    fields: dict[str, Any] = {"written_by": "fresnel-fit", "version": fitting.__version__}
    if fit.measurement is not None:
        fields["source"] = fit.measurement.source
        fields["understood"] = fit.measurement.understood
    fields["sample"] = None if fit.sample is None else str(fit.sample)
    fields["parameters"] = fit.parameters
    if fit.sample is not None and (fit.evaluator is not None or "eta" in fit.parameters):
        fields |= {"eta": fit.eta, "k": fit.k}
    fields |= {name: getattr(fit, name) for name in _AS_IT_IS}
    fields["errors"] = fit.errors._asdict()
    fields["index"] = fit.index()._asdict() if len(summary.index_waves(fit)) else {}
    return plain(fields)


def json_text(fit: FitData, choice: Any = None) -> str:
    """Return `to_dict` and what `choose` compared as a JSON object, one line for each field."""
    return json_object(to_dict(fit) | ({} if choice is None else choice.to_dict()))


def _cell(value: Any, decimal: str) -> str:
    if isinstance(value, float):
        return "" if math.isnan(value) else str(value).replace(".", decimal)
    text = visible(str(value))
    return f"'{text}" if text.startswith(_FORMULA) else text


def csv_text(comments: Iterable[str], columns: Mapping[str, Iterable[Any]], decimal: str) -> str:
    """Return comment lines, a header and columns as CSV; NaN is an empty cell.

    decimal: "." with commas between the cells, or "," with semicolons between them, as spreadsheets
    expect where the comma is the decimal mark. Numbers read back to the last bit. A text that
    spreadsheets would take for a formula begins with an apostrophe.
    """
    out = io.StringIO()
    out.writelines(f"# {visible(' '.join(comment.split()))}\n" for comment in comments)
    table = csv.writer(out, delimiter=";" if decimal == "," else ",", lineterminator="\n")
    table.writerow(columns)
    for row in zip(*columns.values(), strict=True):
        table.writerow([_cell(value, decimal) for value in row])
    return out.getvalue()


def _comments(fit: FitData) -> list[str]:
    understood = f": {fit.measurement.understood}" if fit.measurement is not None else ""
    # Parameters that all fits of a batch share have no column of their own.
    values = ", ".join(f"{n} {v!r}" for n, v in fit.values.items() if not np.ndim(v))
    last = values if fit.shape else f"{values}, {fit.status}"
    return [f"{summary.title_of(fit)}{understood}", summary.sample_text(fit), *[last] * bool(last)]


def data_columns(fit: FitData) -> dict[str, list[Any]]:
    """Return the columns of `data_csv` by their heads; ValueError for a fit that keeps no data."""
    m, found = fit.measurement, predict(fit)
    assert m is not None  # else there is no prediction for it
    columns: dict[str, Any] = {}
    if has_several_curves(fit) and fit.curve is not None:
        columns["curve"] = np.array([visible(name) for name in fit.curve_names])[fit.curve]
    columns["angle_deg"] = m.angle_deg
    if np.isfinite(m.wavelength_um).any():
        columns["wavelength_um"] = m.wavelength_um
    columns["quantity"] = m.quantity
    if np.isfinite(m.polarizer_deg).any():
        columns["polarizer_deg"] = m.polarizer_deg
    columns |= {"value": m.value, "sigma": m.sigma}
    columns |= {"fitted": found.value, "sigma_fitted": found.sigma}
    columns["residual"] = residuals(m, found.value)
    return {head: column.tolist() for head, column in columns.items()}


def has_several_curves(fit: FitData) -> bool:
    """Whether the names of the curves say more than the quantities do: there are several files."""
    if fit.measurement is None or fit.curve is None:
        return False
    return not set(fit.curve_names) <= {*fit.measurement.quantity.tolist(), "NCS"}


def data_csv(fit: FitData, decimal: str = ".") -> str:
    """Return the measurement as CSV, one datum a row, with its fitted value and the error of that.

    Numbers read back to the last bit; an unknown one is an empty cell; residual = value - fitted.
    The columns of wavelength and polarizer are left out if no row has one, that of the curve if the
    quantity names it. decimal: as of `csv_text`.
    """
    return csv_text([DATA_MARK, *_comments(fit)], data_columns(fit), decimal)


def batch_columns(fit: FitData) -> dict[str, list[Any]]:
    """Return the results of a batch as columns with one row for each fit; a single fit is one row.

    First wavelength_um, or the index in the batch (a model of a spectrum has neither); then the
    parameters, eta and k first, and for each NAME: sigma_NAME, NAME_low and NAME_high (95 %
    interval), NAME_interval_kind, NAME_upper_limit; then chi2, ..., status.
    """
    each: dict[str, Any] = {}
    if summary.by_wavelength(fit) or np.shape(fit.wavelength_um) == fit.shape == ():
        each["wavelength_um"] = fit.wavelength_um
    elif fit.shape:
        places = np.indices(fit.shape)
        heads = ["curve"] if len(places) == 1 else [f"curve_{i}" for i in range(len(places))]
        each |= dict(zip(heads, places, strict=True))
    found = {name: fit.parameters[name] for name in summary.varied_of(fit)}
    each |= {name: e.value for name, e in found.items()}
    for name, e in found.items():
        low, high = np.moveaxis(e.interval, -1, 0)
        each |= {f"sigma_{name}": e.sigma, f"{name}_low": low, f"{name}_high": high}
        each[f"{name}_interval_kind"] = e.interval_kind
        if np.isfinite(e.upper_limit).any():
            each[f"{name}_upper_limit"] = e.upper_limit
    if len(fit.names) == 2:
        each["correlation"] = fit.correlation[..., 0, 1]
    for name in ("chi2", "chi2_reduced", "dof", "n_data", "rms", "status"):
        each[name] = getattr(fit, name)
    return {
        name: np.broadcast_to(np.asarray(value), fit.shape).ravel().tolist()
        for name, value in each.items()
    }


def index_csv(fit: FitData, decimal: str = ".") -> str:
    """Return eta and k as CSV with one row for each wavelength (or curve of a batch).

    The first three columns are wavelength_um, eta and k, so that it can be read as a material; an
    unknown number is an empty cell. decimal: as of `csv_text`.
    """
    if fit.shape:
        columns = batch_columns(fit)
    else:
        band = fit.index()
        order = ("wavelength_um", "eta", "k", "sigma_eta", "sigma_k")
        columns = {name: getattr(band, name).tolist() for name in order}
    return csv_text([INDEX_MARK, *_comments(fit)], columns, decimal)


def to_dataframe(fit: FitData) -> Any:
    """Return a fit as a pandas DataFrame; see `Fit.to_dataframe`."""
    if importlib.util.find_spec("pandas") is None:
        raise MissingExtra("to_dataframe", "pandas", "dataframe")
    pandas: Any = importlib.import_module("pandas")
    if fit.shape:
        columns = batch_columns(fit)
        places = [head for head in columns if head == "wavelength_um" or head.startswith("curve")]
        return pandas.DataFrame(columns).set_index(places)
    rows = [
        {**vars(e), "low": float(e.interval[0]), "high": float(e.interval[1])}
        for e in fit.parameters.values()
    ]
    order = ["name", "value", "sigma", "low", "high", "interval_kind", "unit", "upper_limit"]
    return pandas.DataFrame(rows, columns=[*order, "status"]).set_index("name")


def rows_text(files: Sequence[OfFile]) -> str:
    """Return a row for each file for a terminal; a spectrum has the range of its index.

    chi2/dof of a spectrum is the median over its wavelengths.
    """

    def finite(values: Any) -> np.ndarray:
        flat = np.ravel(values).astype(float)
        return flat[np.isfinite(flat)]

    fits = [file.fit for file in files if file.fit is not None]
    heads = {
        n: summary.head_of(n, fit.parameters[n].unit)
        for fit in fits
        for n in summary.varied_of(fit)
    }
    rows = [["file", *heads.values(), "chi2/dof", "status"]]
    for name, fit, _ in files:
        cells = ["-"] * (len(heads) + 1) + [REFUSED]
        if fit is not None:
            for i, e in enumerate(map(fit.parameters.get, heads)):
                if e is not None and not fit.shape:
                    text = value_text(e)
                    cells[i] = f"({text})" if fit.status == UNDETERMINED else text
                elif e is not None and (some := finite(e.value)).size:
                    cells[i] = f"{some.min():.4g} to {some.max():.4g}"
            if (chi2 := finite(fit.chi2_reduced)).size:
                cells[-2] = number(float(np.median(chi2)), 3)
            warned = f", {summary.counted(len(fit.findings), 'warning')}" if fit.findings else ""
            cells[-1] = summary.status_of(fit) + warned
        rows.append([visible(name), *cells])
    if all(row[-2] == "-" for row in rows[1:]):  # no errors are stated
        rows = [[*row[:-2], row[-1]] for row in rows]
    return "\n".join(summary.rows_aligned(rows)) + "\n"


def rows_csv(files: Sequence[OfFile], decimal: str = ".") -> str:
    """Return a CSV with a row for each file, or for each wavelength if the index is free at each.

    Columns: file, sample, those of `batch_columns`, the codes of the warnings, and the message of a
    file that was refused. Columns that would be empty are left out.
    """
    rows: list[dict[str, Any]] = []
    for name, fit, error in files:
        first = {"file": visible(name)}
        if fit is None:
            rows.append({**first, "status": REFUSED, "message": visible(error)})
            continue
        columns = batch_columns(fit)
        warnings = np.ravel(fit.warnings) if fit.shape else [fit.warnings]
        columns["warnings"] = [" ".join(w.code for w in some) for some in warnings]
        first["sample"] = str(fit.sample)
        cells = zip(*columns.values(), strict=True)
        rows += [first | dict(zip(columns, row, strict=True)) for row in cells]
    ends = ["chi2", "chi2_reduced", "dof", "n_data", "rms", "status", "warnings", "message"]
    heads = dict.fromkeys(["file", "sample", "wavelength_um"])
    heads |= dict.fromkeys(head for row in rows for head in row if head not in ends)
    table = {head: [row.get(head, "") for row in rows] for head in [*heads, *ends]}
    filled = {h: c for h, c in table.items() if any(x not in ("", None) and x == x for x in c)}
    return csv_text([EACH_MARK], filled, decimal)


def rows_json(files: Sequence[OfFile]) -> str:
    """Return ``{"files": [...]}``: for each file the fields of `to_dict`, or why it was refused."""
    each = [
        {"file": name} | ({"status": REFUSED, "message": error} if fit is None else to_dict(fit))
        for name, fit, error in files
    ]
    return json_object({"written_by": "fresnel-fit", "files": each})


def _with_error(e: Estimate) -> str:
    """Return a value with six digits, so that a formula gives the curve again, and its error."""
    error = f" +- {float(e.sigma):.2g}" if e.free and np.isfinite(e.sigma) else ""
    return f"{float(e.value):.6g}{error} {e.unit}".strip()


def material_of(fit: FitData, medium: str | None = None) -> tuple[str, str]:
    """Return an index as YAML in the format of refractiveindex.info, and a CSV with its errors.

    Other programs read the YAML, and so does the next fit (--sample 'air | film.yml 80 nm | Si').
    The format has no place for standard errors; hence the CSV, which `material_files` reads too.
    medium: as for `Fit.index`. Of an index that is free at every wavelength those are left out at
    which the data do not determine it. Raises ValueError where there is no index or no wavelength.
    """
    band, m = fit.index(None, medium), fit.measurement
    good = [*DETERMINED] if fit.shape else [*DETERMINED, UNDETERMINED]
    known = np.isin(np.broadcast_to(np.ravel(fit.status), band.eta.shape), good)
    columns = np.array([band.wavelength_um, band.eta, band.k, band.sigma_eta, band.sigma_k], float)
    rows = columns.T[known & np.isfinite(columns[:3]).all(axis=0)]
    if not len(rows):
        raise ValueError(
            "eta and k are known at no wavelength, and no file was written: the wavelength is not "
            "stated, or the data do not determine eta and k."
        )
    rows = rows[np.argsort(rows[:, 0], kind="stable")]
    comments = ["The standard errors of n and k are in the CSV file beside this one."]
    conditions = {"sample": str(fit.sample)}
    if m is not None:
        conditions["angle_of_incidence_deg"] = span_of(m.angle_deg)
    for name, e in fit.parameters.items():
        if "thickness" in name and not np.ndim(e.value):
            conditions[name] = _with_error(e)
        elif "thickness" not in name and not fit.shape:
            comments.append(f"{name} = {_with_error(e)}")
    comments += [] if fit.shape else [f"Warning: {w.text}" for w in fit.warnings]
    reference = f"Fitted by fresnel-fit to {'arrays' if m is None else m.source}"
    lines = []
    for key, texts in (("REFERENCES", reference), ("COMMENTS", "\n".join(comments))):
        lines += [f"{key}: |", *(f"    {visible(line)}" for line in texts.splitlines())]
    lines.append("CONDITIONS:")
    for name, text in conditions.items():  # in quotes, which YAML cannot misread
        quoted = visible(text).replace("\\", "\\\\").replace('"', '\\"')
        lines.append(f'  {name}: "{quoted}"')
    lines += ["DATA:", "  - type: tabulated nk", "    data: |"]
    lines += ["        " + " ".join(f"{x:.9g}" for x in row[:3]) for row in rows]
    heads = ["wavelength_um", "n", "k", "sigma_n", "sigma_k"]
    errors: dict[str, Any] = dict(zip(heads, rows.T.tolist(), strict=True))
    return "\n".join(lines) + "\n", csv_text([INDEX_MARK], errors, ".")
