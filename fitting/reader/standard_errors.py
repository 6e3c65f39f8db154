"""Standard errors in the unit of the result."""

from __future__ import annotations

import numpy as np

from fitting.reader.columns import Column
from fitting.reader.reading import Reading
from fitting.reader.rows import numbers_of, span_of
from fitting.reader.units import scaled


def standard_errors(
    reading: Reading, value: Column, column: Column | None, unit: str, factor: float
) -> np.ndarray:
    """Return the standard errors of one value in the unit of the result, NaN without a column.

    unit: of psi and delta. factor: what makes the values fractions.
    Raises MeasurementError where the unit is another than that of the values, or may be.
    """
    if column is None:
        return np.full(len(reading.table.rows), np.nan)
    options = reading.options
    numbers, sign = numbers_of(reading.table, column, options.missing)
    own = "percent" if sign == "%" else column.role.unit
    if value.role.quantity in ("psi", "delta"):
        own = options.psi_unit or own or unit
        if own not in ("deg", "rad"):
            reading.refuse(column, f"standard errors in {own} came where degrees were wanted.")
        return np.degrees(numbers) if own == "rad" else numbers
    if options.scale is not None:
        return scaled(numbers, factor)
    percent = factor == 0.01
    if own not in ("", "percent" if percent else "1"):
        reading.refuse(
            column,
            f"the standard errors are in {own}, the values are "
            f"{'percent' if percent else 'not'}: they may be relative. Leave them out by "
            "naming the columns to be read with --columns, or say --scale for both.",
        )
    if percent and not own:
        reading.refuse(
            column,
            f"the values are in percent, these standard errors ({span_of(numbers)}) have no "
            "unit and may be percent or fractions. Say --scale 0.01 if they are in percent too; "
            "if they are fractions, multiply them by 100; or leave them out by naming the columns "
            "to be read with --columns.",
        )
    return scaled(numbers, factor)
