"""What a script reads of a fit: JSON and CSV."""

from __future__ import annotations

import io
import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from fitting.plain_data import json_object
from fitting.residuals import residuals

if TYPE_CHECKING:
    from fitting.index.fit import FitResult
    from fitting.measurement import Measurement


def _version() -> str | None:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("fresnel-jax")
    except PackageNotFoundError:
        return None


def json_text(result: FitResult, measurement: Measurement) -> str:
    """Return the fit as a JSON object, a field a line, with the names of ``FitResult.to_dict``.

    NaN is null. Three fields come first that the fit does not know: ``version`` of the program,
    ``source`` and ``understood``.
    """
    fields = {
        "version": _version(),
        "source": measurement.source,
        "understood": measurement.understood,
        **result.to_dict(),
    }
    return json_object(fields)


def csv_text(comments: Iterable[str], columns: dict[str, Iterable[Any]]) -> str:
    """Return columns as CSV below comment lines; what is NaN is empty."""
    out = io.StringIO()
    for comment in comments:
        out.write("# " + " ".join(comment.split()) + "\n")
    out.write(",".join(columns) + "\n")
    for row in zip(*columns.values(), strict=True):
        cells = ("" if isinstance(c, float) and math.isnan(c) else str(c) for c in row)
        out.write(",".join(cells) + "\n")
    return out.getvalue()


def measured_columns(
    measurement: Measurement, fitted: np.ndarray, sigma_fitted: np.ndarray
) -> dict[str, Iterable[Any]]:
    """Return the columns of a table of data with the fitted value beside each.

    Wavelength and polariser are left out where no row has one.
    """
    m = measurement
    columns: dict[str, Iterable[Any]] = {"angle_deg": m.angle_deg.tolist()}
    if np.isfinite(m.wavelength_um).any():
        columns["wavelength_um"] = m.wavelength_um.tolist()
    columns["quantity"] = m.quantity.tolist()
    if np.isfinite(m.polarizer_deg).any():
        columns["polarizer_deg"] = m.polarizer_deg.tolist()
    return columns | {
        "value": m.value.tolist(),
        "sigma": m.sigma.tolist(),
        "fitted": np.asarray(fitted).tolist(),
        "sigma_fitted": np.asarray(sigma_fitted).tolist(),
        "residual": residuals(m, np.asarray(fitted)).tolist(),
    }


def _comments(result: FitResult, measurement: Measurement) -> list[str]:
    comments = [f"{measurement.source}: {measurement.understood}"]
    if np.ndim(result.eta) == 0:
        fitted = f"eta {result.eta!r}, k {result.k!r}"
        comments.append(f"one bare interface, eta_i {result.eta_i!r}: {fitted}, {result.status}")
    else:
        comments.append(f"one bare interface, eta_i {result.eta_i!r}, wavelength by wavelength")
    return comments


def data_csv(
    result: FitResult, measurement: Measurement, fitted: np.ndarray, sigma_fitted: np.ndarray
) -> str:
    """Return the measurement as CSV, a datum a row, with the fitted value beside each.

    fitted, sigma_fitted: as `fitting.index.curves.fitted_values` gives them, NaN where not fitted.
    Numbers are written so that they read back to the last bit; what is not known is empty;
    residual = value - fitted. Wavelength and polariser are left out where no row has one.
    """
    columns = measured_columns(measurement, fitted, sigma_fitted)
    return csv_text(_comments(result, measurement), columns)


def index_csv(result: FitResult, measurement: Measurement) -> str:
    """Return eta and k over wavelength as CSV, a wavelength a row; what is not known is empty."""
    names = ("wavelength_um", "eta", "sigma_eta", "k", "sigma_k", "correlation", "k_upper_limit")
    names += ("chi2", "dof", "n_data", "rms", "status")
    columns = {name: np.atleast_1d(getattr(result, name)).tolist() for name in names}
    for name in ("eta", "k"):
        ends = np.reshape(getattr(result, f"{name}_interval"), (-1, 2))
        columns |= {f"{name}_low": ends[:, 0].tolist(), f"{name}_high": ends[:, 1].tolist()}
    columns["interval_kind"] = np.atleast_1d(result.interval_kind).tolist()
    return csv_text(_comments(result, measurement), columns)
