"""The units of values: degrees or radians for psi and Delta, percent or fraction for powers."""

from __future__ import annotations

import numpy as np

from fitting.errors import MeasurementError, place
from fitting.reader.axes import HALF_PI
from fitting.reader.columns import Layout
from fitting.reader.evidence import Evidence
from fitting.reader.options import Options
from fitting.reader.rows import span_of
from fitting.reader.table import Table


def psi_delta_unit(
    table: Table, layout: Layout, options: Options, columns: dict[int, np.ndarray], said: Evidence
) -> dict[int, str]:
    """Return deg or rad for each column of psi and delta, by the option, the header, or the range.

    columns: numbers by the index of the column.
    Raises MeasurementError where the header contradicts the numbers, or neither tells.
    """
    units: dict[int, str] = {}
    chosen = [v for v in layout.values if v.role.quantity in ("psi", "delta")]
    small: dict[str, bool] = {}
    beside = None if all(value.role.unit for value in chosen) else said.one("psi unit")
    for value in chosen:
        limit = HALF_PI if value.role.quantity == "psi" else 2.0 * HALF_PI * 2.0
        numbers = columns[value.index]
        high = np.abs(numbers[np.isfinite(numbers)]).max(initial=0.0)
        quantity = value.role.quantity
        small[quantity] = small.get(quantity, True) and high <= limit
        at = place(table.source, table.header, value.label)
        if not options.psi_unit and value.role.unit == "rad" and high > limit:
            raise MeasurementError(
                f"{at}: the header says rad, the numbers are {span_of(numbers)}; "
                f"{value.role.quantity} in radians is at most {limit:.4f}. Say --psi-unit deg if "
                "they are degrees."
            )
        if beside and value.role.unit:
            came = f"the header says {value.role.unit}"
            said.refuse_other("psi unit", lambda u, own=value.role.unit: u != own, at, came)
        own = value.role.unit or (str(beside.value) if beside else "")
        units[value.index] = options.psi_unit or own
    both = len(small) == 2
    for value in chosen:
        at = place(table.source, table.header, value.label)
        unit = units[value.index]
        if unit not in ("deg", "rad", ""):
            raise MeasurementError(
                f"{at}: an angle in {unit} came. Say --psi-unit deg or --psi-unit rad."
            )
        if options.psi_unit or unit == "rad":
            continue
        # all of them, or one in radians beside the other in degrees
        alone = small[value.role.quantity] and not unit and bool(columns[value.index].any())
        if alone or (all(small.values()) and (both or not unit)):
            came = "the header says degrees, but" if unit else "psi and delta have no unit, and"
            raise MeasurementError(
                f"{at}: {came} the numbers ({span_of(columns[value.index])}) are as small as "
                "radians. Say --psi-unit deg or --psi-unit rad."
            )
        units[value.index] = "deg"
    return units


def power_scale(
    table: Table,
    layout: Layout,
    options: Options,
    columns: dict[int, np.ndarray],
    signs: dict[int, str],
    said: Evidence,
    notes: list[str],
) -> float:
    """Return the factor that makes all powers of the file fractions; raise where it is open."""
    if options.scale is not None:
        return options.scale
    powers = [value for value in layout.values if value.role.quantity not in ("psi", "delta")]
    units = {v.index: "percent" if signs[v.index] == "%" else v.role.unit for v in powers}
    beside = None if all(units.values()) else said.one("power unit")
    if beside and not any(units.values()):
        units = dict.fromkeys(units, str(beside.value))
        notes.append(
            f"values in {beside.value} ({beside.where}; --scale)".replace(
                " in 1 ", " as fractions "
            )
        )
    for value in powers:
        at, own = place(table.source, table.header, value.label), units[value.index]
        came = f"the header says {own or 'no unit'}"
        said.refuse_other("power unit", lambda unit, own=own: unit != own, at, came)
    percent = [value for value in powers if units[value.index] == "percent"]
    for value in powers:
        at = place(table.source, table.header, value.label)
        unit = units[value.index]
        if unit not in ("", "1", "percent"):
            raise MeasurementError(
                f"{at}: numbers in {'arbitrary units' if unit == 'arb' else unit} came where a "
                "fraction of the incident light was wanted. Divide them by the direct beam, or "
                "say --scale 1/(direct beam) as a number."
            )
        if percent and unit != "percent":
            raise MeasurementError(
                f"{at}: column {percent[0].label!r} is in percent, this one has no such sign. Say "
                "--scale 0.01 if all are in percent."
            )
    if not percent:
        return 1.0
    high = max(np.nan_to_num(columns[v.index], nan=-np.inf).max(initial=-np.inf) for v in percent)
    if high <= 1.0:
        at = place(table.source, table.header, percent[0].label)
        raise MeasurementError(
            f"{at}: the header says percent, but no number is above 1 "
            f"({span_of(columns[percent[0].index])}). Say --scale 1 if they are fractions, --scale "
            "0.01 if they are percent."
        )
    return 0.01
