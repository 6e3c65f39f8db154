"""The units of values and of their standard errors: degrees or radians, percent or fractions."""

from __future__ import annotations

import numpy as np

from fitting.data.quantities import POWERS
from fitting.data.units import scaled, span_of
from fitting.reader.axes import HALF_PI
from fitting.reader.columns import Column
from fitting.reader.reading import Reading

# of radians
_LIMITS = {"psi": HALF_PI, "delta": 4.0 * HALF_PI}


def psi_delta_unit(reading: Reading, columns: dict[int, np.ndarray]) -> dict[int, str]:
    """Return deg or rad for each column of psi and delta, by the option, the header, or the range.

    columns: numbers by the index of the column.
    Refuses a file where the header contradicts the numbers, or neither tells.
    """
    given = reading.options.psi_unit
    chosen = [v for v in reading.layout.values if v.role.quantity in _LIMITS]
    units = {v.index: reading.unit("psi unit", v, given, "psi and delta") for v in chosen}
    if given:
        return units
    high = {v.index: np.nanmax(np.abs(columns[v.index]), initial=0.0) for v in chosen}
    small = {v.index: high[v.index] <= _LIMITS[v.role.quantity] for v in chosen}
    for value in chosen:
        unit, as_radians = units[value.index], small[value.index]
        doubtful = {
            "": as_radians and high[value.index] > 0.0,
            "rad": not as_radians,
            "deg": len(chosen) > 1 and all(small.values()),
        }
        if doubtful.get(unit, True):
            reading.refuse(
                value,
                f"the file {f'says {unit}' if unit else 'gives no unit'}, and the numbers are "
                f"{span_of(columns[value.index])}; in radians {value.role.quantity} is at most "
                f"{_LIMITS[value.role.quantity]:.4f}. Say --psi-unit deg or --psi-unit rad.",
            )
        units[value.index] = unit or "deg"
    return units


def power_scale(reading: Reading, columns: dict[int, np.ndarray], signs: dict[int, str]) -> float:
    """Return the factor that makes all powers of the file fractions; raise where it is open."""
    if reading.options.scale is not None:
        return reading.options.scale
    powers = [value for value in reading.layout.values if value.role.quantity in POWERS]
    units = {}
    for value in powers:
        unit = "percent" if signs[value.index] == "%" else value.role.unit
        value = value._replace(role=value.role._replace(unit=unit))
        units[value.index] = reading.unit("power unit", value, "", "values")
    percent = [value for value in powers if units[value.index] == "percent"]
    for value in powers:
        unit = units[value.index]
        if unit not in ("", "1", "percent") and not (reading.options.divided and unit == "arb"):
            reading.refuse(
                value,
                f"numbers in {'arbitrary units' if unit == 'arb' else unit} came where a fraction "
                "of the incident light was wanted. Divide them by the direct beam (--divide-by), "
                "or say --scale 1/(signal of the direct beam), as a number.",
            )
        if percent and unit != "percent":
            reading.refuse(
                value,
                f"column {percent[0].label!r} is in percent, but this one does not say so. Say "
                "--scale 0.01 if all are in percent.",
            )
    if not percent:
        return 1.0
    if max(np.nanmax(columns[v.index], initial=-np.inf) for v in percent) <= 1.0:
        reading.refuse(
            percent[0],
            "the header says percent, but no number is above 1 "
            f"({span_of(columns[percent[0].index])}). Say --scale 1 if they are fractions, --scale "
            "0.01 if they are percent.",
        )
    return 0.01


def standard_errors(
    reading: Reading, value: Column, column: Column | None, unit: str, factor: float
) -> np.ndarray:
    """Return the standard errors of one value in the unit of the result, NaN without a column.

    unit: of psi and delta. factor: what makes the values fractions.
    Refuses a file where the unit is another than that of the values, or may be.
    """
    if column is None:
        return np.full(len(reading.table.rows), np.nan)
    options = reading.options
    reading.one("errors")
    numbers, sign = reading.numbers(column, gaps=True)
    own = "percent" if sign == "%" else column.role.unit
    if value.role.quantity in _LIMITS:
        own = options.psi_unit or own or unit
        if own not in ("deg", "rad"):
            reading.refuse(
                column, f"standard errors in {own} came where degrees were wanted. Convert them."
            )
        return np.degrees(numbers) if own == "rad" else numbers
    if value.role.quantity not in POWERS:
        return numbers
    percent = factor == 0.01
    if options.scale is None and (own or percent) and own != ("percent" if percent else "1"):
        came = f"are in {own}" if own else "have no unit"
        reading.refuse(
            column,
            f"these standard errors ({span_of(numbers)}) {came}, but the values are "
            f"{'in percent' if percent else 'fractions'}: the errors may be relative, or in "
            "another unit. Say --scale 0.01 if all are in percent; else convert them, or leave "
            "them out by naming the columns to be read with --columns.",
        )
    return scaled(numbers, factor)
