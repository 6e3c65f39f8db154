"""Standard errors in the unit of the result; of errors without a unit, what the data say of it."""

from __future__ import annotations

import numpy as np

from fitting.errors import MeasurementError, place
from fitting.reader.columns import Column
from fitting.reader.options import Options
from fitting.reader.rows import numbers_of, span_of
from fitting.reader.table import Table
from fitting.reader.units import scaled

# Errors above this part of the values they belong to (at the median) are none.
MOST_OF_VALUE = 0.5
# Values that lie this much closer to the line between their neighbours than their errors: chi2 of
# 1e-2, which 5 such values have by chance once in 400 times.
TOO_SMOOTH, LEAST_COUNT = 0.1, 5


def _roughness(axis: np.ndarray, value: np.ndarray, group: np.ndarray) -> float:
    """Return the median distance of a value from the line between its neighbours on the axis.

    group: a number for each row; rows of different groups are no neighbours. Curvature counts as
    roughness, so that this is no less than the noise. Infinite for fewer than LEAST_COUNT values.
    """
    distances = []
    for each in np.unique(group):
        rows = np.flatnonzero((group == each) & np.isfinite(value) & np.isfinite(axis))
        rows = rows[np.argsort(axis[rows], kind="stable")]
        x, y = axis[rows], value[rows]
        if len(rows) > 2:
            part = (x[1:-1] - x[:-2]) / (x[2:] - x[:-2])
            off = np.abs(y[1:-1] - y[:-2] - part * (y[2:] - y[:-2]))
            distances.append(off[np.isfinite(off)])
    every = np.concatenate(distances) if distances else np.empty(0)
    return float(np.median(every)) if len(every) >= LEAST_COUNT else np.inf


def _no_fractions(
    value: np.ndarray, error: np.ndarray, axis: np.ndarray, group: np.ndarray
) -> bool:
    """Return whether ``error``, beside values in percent, cannot be meant as fractions.

    As such they would be above 1, or most of the values themselves, or the values far smoother than
    their errors allow.
    """
    there = np.isfinite(value) & np.isfinite(error)
    if not there.any():
        return True
    usual = float(np.median(np.abs(error[there])))
    return bool(
        np.abs(error[there]).max() > 1.0
        or usual > MOST_OF_VALUE * np.median(np.abs(value[there])) / 100.0
        or _roughness(axis, value, group) / 100.0 < TOO_SMOOTH * usual
    )


def standard_errors(
    table: Table,
    value: Column,
    column: Column | None,
    options: Options,
    unit: str,
    factor: float,
    rows: tuple[np.ndarray, np.ndarray, np.ndarray],
    notes: list[str],
) -> np.ndarray:
    """Return the standard errors of one value in the unit of the result, NaN without a column.

    unit: of psi and delta. factor: what makes the values fractions. rows: the values as they stand,
    their axis, and their group (rows of another polarisation or angle are of another curve).
    Raises MeasurementError where the unit is another than that of the values, or may be.
    """
    if column is None:
        return np.full(len(table.rows), np.nan)
    numbers, sign = numbers_of(table, column, options.missing)
    own = "percent" if sign == "%" else column.role.unit
    at = place(table.source, table.header, column.label)
    if value.role.quantity in ("psi", "delta"):
        own = options.psi_unit or own or unit
        if own not in ("deg", "rad"):
            raise MeasurementError(
                f"{at}: standard errors in {own} came where degrees were wanted."
            )
        return np.degrees(numbers) if own == "rad" else numbers
    if options.scale is not None:
        return scaled(numbers, factor)
    percent = factor == 0.01
    if own not in ("", "percent" if percent else "1"):
        raise MeasurementError(
            f"{at}: the standard errors are in {own}, the values are "
            f"{'percent' if percent else 'not'}: they may be relative. Leave them out by "
            "naming the columns to be read with --columns, or say --scale for both."
        )
    if percent and not own:
        if not _no_fractions(rows[0], numbers, rows[1], rows[2]):
            raise MeasurementError(
                f"{at}: the values are in percent, these standard errors ({span_of(numbers)}) have "
                "no unit and may be percent or fractions. Say --scale 0.01 if they are in percent "
                "as well; if they are fractions, multiply them by 100; or leave them out by naming "
                "the columns to be read with --columns."
            )
        notes.append(f"errors of {value.label} read as percent (--scale)")
    return scaled(numbers, factor)
