"""The page of a fit of one bare interface: what was read, found and not found, in one HTML file."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from fitting.output.page import Table, page
from fitting.output.report import between, facts, grouped_warnings, number, with_error
from fitting.residuals import residuals

if TYPE_CHECKING:
    from fitting.bare_surface.solution import FitResult
    from fitting.measurement import Measurement

CAPTIONS = {
    True: "Data with one standard error, the fitted curve with its one-sigma band, and data - fit.",
    False: "eta and k over wavelength with one standard error, and data - fit.",
}


def data_table(measurement: Measurement, fitted: np.ndarray) -> Table:
    """Return the data with the fitted value and the residual beside each."""
    m = measurement
    waves = np.isfinite(m.wavelength_um).any()
    head = ["quantity", "angle, degrees", *(["wavelength, um"] if waves else [])]
    head += ["value", "sigma", "fitted", "value - fitted"]
    rows, off = [], residuals(m, fitted)
    for i in range(len(m)):
        row = [str(m.quantity[i]), f"{m.angle_deg[i]:.6g}"]
        row += [f"{m.wavelength_um[i]:.6g}"] if waves else []
        row += [number(x, 5) for x in (m.value[i], m.sigma[i], fitted[i], off[i])]
        rows.append(row)
    return Table("Data", head, rows)


def _index_table(result: FitResult) -> Table:
    rows = []
    for i in range(len(result.eta)):
        one = result.at(i)
        limit = f"< {number(one.k_upper_limit, 2)}" if math.isfinite(one.k_upper_limit) else ""
        ranges = [
            between(*ends) if np.isfinite(ends).all() else "-"
            for ends in (one.eta_interval, one.k_interval)
        ]
        rows.append([
            f"{one.wavelength_um:.6g}", with_error(one.eta, one.sigma_eta), ranges[0],
            limit or with_error(one.k, one.sigma_k), ranges[1], number(one.rms, 3), one.status,
        ])  # fmt: skip
    head = ["wavelength, um", "eta", "95 % range", "k", "95 % range", "rms", "status"]
    return Table("Index over wavelength", head, rows)


def fit_page(
    result: FitResult, measurement: Measurement, fitted: np.ndarray, png: bytes, command: str
) -> str:
    """Return the page of a fit.

    fitted: the fitted value at every datum, NaN where none. png: the picture (`plot`).
    command: how the fit was asked for, for the foot of the page.
    """
    one = np.ndim(result.eta) == 0
    tables = [] if one else [_index_table(result)]
    return page(
        measurement.source,
        facts(result, measurement),
        grouped_warnings(result),
        result.notes,
        [(CAPTIONS[one], png)],
        [*tables, data_table(measurement, fitted)],
        command,
    )
