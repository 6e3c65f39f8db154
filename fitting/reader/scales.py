"""The units of values: degrees or radians for psi and Delta, percent or fraction for powers."""

from __future__ import annotations

import numpy as np

from fitting.reader.axes import HALF_PI
from fitting.reader.reading import Reading
from fitting.reader.rows import span_of


def psi_delta_unit(reading: Reading, columns: dict[int, np.ndarray]) -> dict[int, str]:
    """Return deg or rad for each column of psi and delta, by the option, the header, or the range.

    columns: numbers by the index of the column.
    Raises MeasurementError where the header contradicts the numbers, or neither tells.
    """
    layout, options = reading.layout, reading.options
    units: dict[int, str] = {}
    chosen = [v for v in layout.values if v.role.quantity in ("psi", "delta")]
    small: dict[str, bool] = {}
    beside = None if all(value.role.unit for value in chosen) else reading.said.one("psi unit")
    for value in chosen:
        limit = HALF_PI if value.role.quantity == "psi" else 2.0 * HALF_PI * 2.0
        numbers = columns[value.index]
        high = np.abs(numbers[np.isfinite(numbers)]).max(initial=0.0)
        quantity = value.role.quantity
        small[quantity] = small.get(quantity, True) and high <= limit
        if not options.psi_unit and value.role.unit == "rad" and high > limit:
            reading.refuse(
                value,
                f"the header says rad, the numbers are {span_of(numbers)}; {quantity} in radians "
                f"is at most {limit:.4f}. Say --psi-unit deg if they are degrees.",
            )
        if beside and value.role.unit:
            own = value.role.unit
            came = f"the header says {own}"
            reading.contradicted("psi unit", lambda u, own=own: u != own, value, came)
        own = value.role.unit or (str(beside.value) if beside else "")
        units[value.index] = options.psi_unit or own
    both = len(small) == 2
    for value in chosen:
        unit = units[value.index]
        if unit not in ("deg", "rad", ""):
            reading.refuse(value, f"an angle in {unit} came. Say --psi-unit deg or --psi-unit rad.")
        if options.psi_unit or unit == "rad":
            continue
        # all of them, or one in radians beside the other in degrees
        alone = small[value.role.quantity] and not unit and bool(columns[value.index].any())
        if alone or (all(small.values()) and (both or not unit)):
            came = "the header says degrees, but" if unit else "psi and delta have no unit, and"
            reading.refuse(
                value,
                f"{came} the numbers ({span_of(columns[value.index])}) are as small as radians. "
                "Say --psi-unit deg or --psi-unit rad.",
            )
        units[value.index] = "deg"
    return units


def power_scale(reading: Reading, columns: dict[int, np.ndarray], signs: dict[int, str]) -> float:
    """Return the factor that makes all powers of the file fractions; raise where it is open."""
    if reading.options.scale is not None:
        return reading.options.scale
    powers = [
        value for value in reading.layout.values if value.role.quantity not in ("psi", "delta")
    ]
    units = {v.index: "percent" if signs[v.index] == "%" else v.role.unit for v in powers}
    beside = None if all(units.values()) else reading.said.one("power unit")
    if beside and not any(units.values()):
        units = dict.fromkeys(units, str(beside.value))
        form = "as fractions" if beside.value == "1" else f"in {beside.value}"
        reading.notes.append(f"values {form} ({beside.where}; --scale)")
    for value in powers:
        own = units[value.index]
        came = f"the header says {own or 'no unit'}"
        reading.contradicted("power unit", lambda unit, own=own: unit != own, value, came)
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
