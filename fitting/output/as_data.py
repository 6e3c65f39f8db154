"""A fit as plain data: a dict with the names of its fields, a DataFrame, JSON and CSV."""

from __future__ import annotations

import csv
import importlib
import importlib.util
import io
import json
import math
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

import fitting
from fitting.data.errors import MissingExtra
from fitting.output.estimates import by_wavelength, has_several_curves, index_waves
from fitting.output.facts import sample_text, title_of
from fitting.output.outputs import WRITTEN_BY
from fitting.output.text_table import varied_of
from fitting.process.visible import visible
from fitting.residuals.residuals import residuals
from fitting.results.result import Fit
from fitting.results.result_parts import Alternative, Estimate

if TYPE_CHECKING:
    from fitting.choice.candidates import Choice

_AS_IT_IS = (
    "wavelength_um", "chi2", "chi2_reduced", "dof", "n_data", "rms", "rms_of", "status",
    "sigma_kind", "loss", "noise", "cost", "bic", "aicc", "evaluations", "starts", "reached",
)  # fmt: skip


DATA_MARK, INDEX_MARK = f"data of a fit, {WRITTEN_BY}", f"index of a fit, {WRITTEN_BY}"
"""The first comments of tables, by which a later run recognises files that it may replace."""


def plain(value: Any) -> Any:
    """Return ``value`` as lists, dicts, numbers and strings, for JSON; None if not finite."""
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def json_object(fields: Mapping[str, Any]) -> str:
    """Return ``fields`` as the text of a JSON object, one field a line; NaN is null."""
    lines = (
        f"  {json.dumps(name)}: {json.dumps(plain(value), allow_nan=False)}"
        for name, value in fields.items()
    )
    return "{\n" + ",\n".join(lines) + "\n}\n"


def _estimate(e: Estimate) -> dict[str, Any]:
    return {name: value for name, value in vars(e).items() if name != "name"}


def _alternative(a: Alternative) -> dict[str, Any]:
    parameters = {name: _estimate(e) for name, e in a.parameters.items()}
    return {"delta_chi2": a.delta_chi2, "reached": a.reached, "parameters": parameters}


def _each(fit: Fit, of: Any, value: Any) -> Any:
    """Return ``of`` applied to each element of a tuple, or of each tuple of an array."""
    if not fit.shape:
        return [of(one) for one in value]
    return [[of(one) for one in some] for some in value.ravel()]


def to_dict(fit: Fit) -> dict[str, Any]:
    """Return plain data for ``json.dumps``: NaN and infinity as None, arrays as lists.

    The names are those of the fields of `Fit` and `Estimate`; a warning has its code, where it
    holds, its values and its sentence. Of a batch warnings and alternatives are a list for each
    fit, in the order of the batch.
    """
    fields: dict[str, Any] = {"written_by": "fresnel-fit", "version": fitting.__version__}
    if fit.measurement is not None:
        fields["source"] = fit.measurement.source
        fields["understood"] = fit.measurement.understood
    fields["sample"] = None if fit.sample is None else str(fit.sample)
    fields["parameters"] = {name: _estimate(e) for name, e in fit.parameters.items()}
    if fit.sample is not None and (fit.evaluator is not None or "eta" in fit.parameters):
        fields |= {"eta": fit.eta, "k": fit.k}
    fields |= {"names": fit.names, "covariance": fit.covariance, "correlation": fit.correlation}
    fields |= {name: getattr(fit, name) for name in _AS_IT_IS}
    fields["errors"] = fit.errors._asdict()
    fields["warnings"] = _each(fit, lambda w: w.to_dict(), fit.warnings)
    fields["notes"] = [note.to_dict() for note in fit.notes]
    fields["alternatives"] = _each(fit, _alternative, fit.alternatives)
    fields["index"] = fit.index()._asdict() if len(index_waves(fit)) else {}
    return {name: plain(value) for name, value in fields.items()}


def json_text(fit: Fit, choice: Choice | None = None) -> str:
    """Return `to_dict` and what `choose` compared as a JSON object, one line for each field."""
    return json_object(to_dict(fit) | ({} if choice is None else choice.to_dict()))


# What makes a spreadsheet compute a cell; also as wide letters.
_FORMULA = ("=", "+", "-", "@", "\uff1d", "\uff0b", "\uff0d", "\uff20")


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


def _comments(fit: Fit) -> list[str]:
    understood = f": {fit.measurement.understood}" if fit.measurement is not None else ""
    comments = [f"{title_of(fit)}{understood}", sample_text(fit)]
    # Parameters that all fits of a batch share have no column of their own.
    values = ", ".join(f"{n} {v!r}" for n, v in fit.values.items() if not np.ndim(v))
    if not fit.shape:
        comments.append(f"{values}, {fit.status}")
    elif values:
        comments.append(values)
    return comments


def data_csv(fit: Fit, decimal: str = ".") -> str:
    """Return the measurement as CSV, one datum a row, with its fitted value and the error of that.

    Numbers read back to the last bit; an unknown one is an empty cell; residual = value - fitted.
    The columns of wavelength and polarizer are left out if no row has one, that of the curve if the
    quantity names it. `fitting.read_csv` reads the file as the same measurement. decimal: as of
    `csv_text`.
    """
    return csv_text([DATA_MARK, *_comments(fit)], data_columns(fit), decimal)


def data_columns(fit: Fit) -> dict[str, list[Any]]:
    """Return the columns of `data_csv` by their heads; ValueError for a fit that keeps no data."""
    m = fit.measurement
    if m is None:
        raise ValueError(
            "this fit keeps no data, so that there is no table of them. To keep them, fit a "
            "Measurement with fit(...)."
        )
    found = fit.predict()
    columns: dict[str, list[Any]] = {}
    if has_several_curves(fit) and fit.curve is not None:
        columns["curve"] = [visible(fit.curve_names[i]) for i in fit.curve]
    columns["angle_deg"] = m.angle_deg.tolist()
    if np.isfinite(m.wavelength_um).any():
        columns["wavelength_um"] = m.wavelength_um.tolist()
    columns["quantity"] = m.quantity.tolist()
    if np.isfinite(m.polarizer_deg).any():
        columns["polarizer_deg"] = m.polarizer_deg.tolist()
    return columns | {
        "value": m.value.tolist(),
        "sigma": m.sigma.tolist(),
        "fitted": found.value.tolist(),
        "sigma_fitted": found.sigma.tolist(),
        "residual": residuals(m, found.value).tolist(),
    }


def batch_columns(fit: Fit) -> dict[str, list[Any]]:
    """Return the results of a batch as columns with one row for each fit; a single fit is one row.

    First wavelength_um, or the index in the batch (a model of a spectrum has neither); then the
    parameters, eta and k first, and for each NAME: sigma_NAME, NAME_low and NAME_high (95 %
    interval), NAME_interval_kind, NAME_upper_limit; then chi2, ..., status.
    """
    columns: dict[str, list[Any]] = {}
    if by_wavelength(fit) or np.shape(fit.wavelength_um) == fit.shape == ():
        columns["wavelength_um"] = np.ravel(fit.wavelength_um).tolist()
    elif fit.shape:
        places = np.unravel_index(np.arange(int(np.prod(fit.shape))), fit.shape)
        heads = ["curve"] if len(places) == 1 else [f"curve_{i}" for i in range(len(places))]
        columns |= {head: place.tolist() for head, place in zip(heads, places, strict=True)}
    found = {name: fit.parameters[name] for name in varied_of(fit)}
    each: dict[str, Any] = {name: e.value for name, e in found.items()}
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
    for name, value in each.items():
        columns[name] = np.broadcast_to(np.asarray(value), fit.shape).ravel().tolist()
    return columns


def index_csv(fit: Fit, decimal: str = ".") -> str:
    """Return eta and k as CSV with one row for each wavelength (or curve of a batch).

    The first three columns are wavelength_um, eta and k, so that it can be read as a material; an
    unknown number is an empty cell. decimal: as of `csv_text`.
    """
    comments = [INDEX_MARK, *_comments(fit)]
    if fit.shape:
        return csv_text(comments, batch_columns(fit), decimal)
    band = fit.index()._asdict()
    order = ("wavelength_um", "eta", "k", "sigma_eta", "sigma_k")
    columns = {name: np.asarray(band[name]).tolist() for name in order}
    return csv_text(comments, columns, decimal)


def to_dataframe(fit: Fit) -> Any:
    """Return a pandas DataFrame: a row for each fit of a batch, else for each parameter.

    A batch has the columns of `batch_columns`, with the wavelength (or the place in the batch) as
    index. A single fit has the fields of `Estimate`, with the interval as ``low`` and ``high`` and
    the name of the parameter as index. Raises ImportError where pandas is not installed.
    """
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
