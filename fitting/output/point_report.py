"""What a person and a script read of fits wavelength by wavelength (`PointFits`)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from fitting.model.points import PointFits
from fitting.output.export import csv_text
from fitting.output.report import number, rows_aligned, with_error, wrapped
from fitting.plain_data import json_object


def _what(fits: PointFits) -> str:
    d = fits.fits[0].fixed.get("thickness_um")
    slab = f"a slab of {d:.6g} um, both faces" if d is not None else "one bare interface"
    return f"eta and k of {slab}, wavelength by wavelength"


def _rows(fits: PointFits) -> list[list[str]]:
    rows = [["wavelength_um", "eta", "k", "rms", "status"]]
    limits = fits.k_upper_limit
    for i, (w, fit) in enumerate(zip(fits.wavelength_um.tolist(), fits.fits, strict=True)):
        k = with_error(fit.value_of("k"), fit.sigma_of("k"))
        if math.isfinite(limits[i]):
            k = f"{number(fit.value_of('k'), 2)} (< {number(limits[i], 2)})"
        eta = with_error(fit.value_of("eta"), fit.sigma_of("eta"))
        rows.append([f"{w:.6g}", eta, k, number(fit.rms, 3), fit.status])
    return rows


def table(fits: PointFits, width: int = 80) -> str:
    """Return the fits as a line a wavelength, and what some of them warn of."""
    m = fits.measurement
    lines = [m.source, wrapped("read", m.understood.removeprefix("read "), width)]
    lines += [wrapped("model", _what(fits), width), "", *rows_aligned(_rows(fits)), ""]
    status, count = np.unique(fits.status, return_counts=True)
    total = ", ".join(f"{c} {s}" for s, c in zip(status, count, strict=True))
    lines.append(wrapped("status", f"{len(fits.fits)} wavelengths: {total}", width))
    double = sum(bool(f.others) for f in fits.fits)
    if double:
        text = (
            f"at {double} wavelengths another index fits as well; shown is the one above 1 (at "
            "normal incidence an index and its inverse reflect alike). All are in the JSON file."
        )
        lines.append(wrapped("note", text, width))
    kinds: dict[str, list[float]] = {}
    for w, f in zip(fits.wavelength_um.tolist(), fits.fits, strict=True):
        for text in f.warnings:
            if "as well" not in text:
                kinds.setdefault(text, []).append(w)
    for text, where in list(kinds.items())[:5]:
        more = f" and {len(where) - 1} more" if len(where) > 1 else ""
        lines.append(wrapped("warning", f"{text} (at {where[0]:.6g} um{more})", width))
    return "\n".join(lines) + "\n"


def json_text(fits: PointFits) -> str:
    """Return the fits as a JSON object, a field a line, arrays over the wavelengths."""
    m = fits.measurement
    fields: dict[str, Any] = {"source": m.source, "understood": m.understood, **fits.to_dict()}
    return json_object(fields)


def _comments(fits: PointFits) -> list[str]:
    return [f"{fits.measurement.source}: {fits.measurement.understood}", _what(fits)]


def data_csv(fits: PointFits) -> str:
    """Return the measurement as CSV, a datum a row, with the fitted value and its error beside."""
    m = fits.measurement
    value, sigma = fits.fitted()
    columns = {
        "angle_deg": m.angle_deg.tolist(), "wavelength_um": m.wavelength_um.tolist(),
        "quantity": m.quantity.tolist(), "value": m.value.tolist(), "sigma": m.sigma.tolist(),
        "fitted": value.tolist(), "sigma_fitted": sigma.tolist(),
        "residual": (m.value - value).tolist(),
    }  # fmt: skip
    return csv_text(_comments(fits), columns)


def index_csv(fits: PointFits) -> str:
    """Return eta and k as CSV, a wavelength a row; what is not known is empty."""
    names = ("wavelength_um", "eta", "sigma_eta", "k", "sigma_k", "k_upper_limit", "rms", "status")
    return csv_text(_comments(fits), {name: getattr(fits, name).tolist() for name in names})
