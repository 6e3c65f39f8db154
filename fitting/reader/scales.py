"""The units of values: degrees or radians for psi and Delta, percent or fraction for powers."""

from __future__ import annotations

import numpy as np

from fitting.reader.axes import HALF_PI
from fitting.reader.reading import Reading
from fitting.reader.rows import span_of

# of radians
_LIMITS = {"psi": HALF_PI, "delta": 4.0 * HALF_PI}


def psi_delta_unit(reading: Reading, columns: dict[int, np.ndarray]) -> dict[int, str]:
    """Return deg or rad for each column of psi and delta, by the option, the header, or the range.

    columns: numbers by the index of the column.
    Raises MeasurementError where the header contradicts the numbers, or neither tells.
    """
    given = reading.options.psi_unit
    chosen = [v for v in reading.layout.values if v.role.quantity in _LIMITS]
    units = {v.index: reading.unit("psi unit", v, given, "psi and delta") for v in chosen}
    if given:
        return units
    small = {
        v.index: bool(np.nanmax(np.abs(columns[v.index]), initial=0.0) <= _LIMITS[v.role.quantity])
        for v in chosen
    }
    for value in chosen:
        unit, numbers = units[value.index], columns[value.index]
        came = f"the numbers are {span_of(numbers)}, and "
        if unit not in ("deg", "rad", ""):
            came = f"an angle in {unit} came"
        elif unit == "rad":
            if small[value.index]:
                continue
            came += f"the header says rad, in which {value.role.quantity} is at most "
            came += f"{_LIMITS[value.role.quantity]:.4f}"
        elif small[value.index] and not unit and numbers.any():
            came += "as small as radians, without a unit"
        elif unit and len(chosen) > 1 and all(small.values()):
            came += "the header says degrees, though they are as small as radians"
        else:
            units[value.index] = "deg"
            continue
        reading.refuse(value, f"{came}. Say --psi-unit deg or --psi-unit rad.")
    return units


def power_scale(reading: Reading, columns: dict[int, np.ndarray], signs: dict[int, str]) -> float:
    """Return the factor that makes all powers of the file fractions; raise where it is open."""
    if reading.options.scale is not None:
        return reading.options.scale
    powers = [
        value for value in reading.layout.values if value.role.quantity not in ("psi", "delta")
    ]
    units = {}
    for value in powers:
        unit = "percent" if signs[value.index] == "%" else value.role.unit
        value = value._replace(role=value.role._replace(unit=unit))
        units[value.index] = reading.unit("power unit", value, "", "values")
    percent = [value for value in powers if units[value.index] == "percent"]
    for value in powers:
        unit = units[value.index]
        if unit not in ("", "1", "percent"):
            reading.refuse(
                value,
                f"numbers in {'arbitrary units' if unit == 'arb' else unit} came where a fraction "
                "of the incident light was wanted. Divide them by the direct beam, or say --scale "
                "1/(direct beam) as a number.",
            )
        if percent and unit != "percent":
            reading.refuse(
                value,
                f"column {percent[0].label!r} is in percent, this one has no such sign. Say "
                "--scale 0.01 if all are in percent.",
            )
    if not percent:
        return 1.0
    high = max(np.nan_to_num(columns[v.index], nan=-np.inf).max(initial=-np.inf) for v in percent)
    if high <= 1.0:
        reading.refuse(
            percent[0],
            "the header says percent, but no number is above 1 "
            f"({span_of(columns[percent[0].index])}). Say --scale 1 if they are fractions, --scale "
            "0.01 if they are percent.",
        )
    return 0.01
