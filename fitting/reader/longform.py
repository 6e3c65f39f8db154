"""A table with its columns chosen becomes long columns: one datum per row, with its place."""

from __future__ import annotations

from pathlib import PurePath
from typing import NamedTuple

import numpy as np

from fitting.checks import Data
from fitting.errors import MeasurementError, place
from fitting.reader.axes import angles, wavelengths
from fitting.reader.columns import Column, Layout
from fitting.reader.evidence import evidence, statements
from fitting.reader.light import light_of_rows
from fitting.reader.options import Options
from fitting.reader.reading import Reading
from fitting.reader.rows import numbers_of, refuse_gaps
from fitting.reader.scales import power_scale, psi_delta_unit
from fitting.reader.standard_errors import standard_errors
from fitting.reader.table import Table
from fitting.reader.units import scaled


class LongColumns(NamedTuple):
    """The data of a file, and where each datum stands.

    places: (line, column of the value, column of its standard error) of each datum.
    labels: columns of the angle, the wavelength and the polariser.
    understood: how the file was read.
    """

    data: Data
    places: list[tuple[int, str, str]]
    labels: dict[str, str]
    understood: str


def _refuse_placeholders(reading: Reading, numbers: dict[int, np.ndarray]) -> None:
    """Raise where Delta repeats psi, or both are 0 in some rows, as for what was not measured."""
    by_name = {value.role.quantity: value for value in reading.layout.values}
    if not {"psi", "delta"} <= set(by_name):
        return
    psi, delta = (numbers[by_name[name].index] for name in ("psi", "delta"))
    if np.isfinite(psi).sum() > 1 and np.array_equal(psi, delta, equal_nan=True):
        reading.refuse(
            by_name["delta"],
            "every number equals psi, which no surface gives. Mend the file, or name another "
            "column with --columns delta=...",
        )
    dark = np.flatnonzero((psi == 0.0) & (delta == 0.0))
    if len(dark) and not reading.options.zero_is_value and np.any((psi != 0.0) & ~np.isnan(psi)):
        reading.refuse(
            by_name["psi"],
            "psi and Delta are both 0. Say --missing 0 if that stands for 'not measured', "
            "--missing none if it was measured.",
            int(dark[0]),
        )


def _refuse_zeros(reading: Reading, value: Column, numbers: np.ndarray, name: np.ndarray) -> None:
    """Raise where zeros among larger values may stand for values never measured."""
    if reading.options.zero_is_value or value.role.quantity in ("psi", "delta"):
        return
    bare = np.flatnonzero(np.isin(numbers, (-1.0, -9.0, -99.0, -999.0, -9999.0)))
    if len(bare) and np.nanmax(numbers, initial=0.0) > 1.0:
        code = f"{numbers[bare[0]]:g}"
        reading.refuse(
            value,
            f"{code} came, which may stand for 'not measured'. Say --missing={code} if so, "
            "--missing none if it was measured.",
            int(bare[0]),
        )
    for quantity in np.unique(name):
        chosen = np.flatnonzero((name == quantity) & np.isfinite(numbers))
        zeros = chosen[numbers[chosen] == 0.0]
        others = np.abs(numbers[chosen][numbers[chosen] != 0.0])
        least = others.min(initial=np.inf)
        # a true zero (Brewster's angle, a fringe) is approached by its neighbours
        if len(zeros) and len(others) and least > max(0.02 * others.max(), 1e-2):
            reading.refuse(
                value,
                f"0 came, where the smallest other value is {least:.6g}. Say --missing 0 if it "
                "stands for 'not measured', --missing none if it was measured.",
                int(zeros[0]),
            )


def _refuse_other_quantity(reading: Reading) -> None:
    """Raise where the file speaks of transmission or absorption alone, and the columns are R."""
    value, quantities = reading.layout.values[0], reading.said.quantities
    here = {value.role.quantity[0] for value in reading.layout.values} & {"R", "T"}
    if here and quantities and not here & quantities and not reading.options.columns:
        word = {"R": "reflection", "T": "transmission", "A": "absorption"}[min(quantities)]
        reading.refuse(
            value,
            f"a column of {value.role.quantity}, and the lines around the table or the file name "
            f"speak of {word}. Name all columns to be read, for example --columns "
            f"angle=1,{value.role.quantity}={value.index + 1}.",
        )


def _listed(names: list[str]) -> str:
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def _understood(reading: Reading, data: Data, factor: float) -> str:
    table, layout, options, _, notes = reading
    angle, wavelength, quantity = data.angle_deg, data.wavelength_um, data.quantity
    spectral = len(np.unique(wavelength)) > 1
    axis, what, unit = (wavelength, "wavelength", "um") if spectral else (angle, "angle", "degrees")
    count = len(np.unique(axis))
    span = f"{axis.min():.6g} to {axis.max():.6g}" if count > 1 else f"{axis[0]:.6g}"
    text = f"read {count} {what}{'s' * (count != 1)} ({span} {unit})"
    names = list(dict.fromkeys(quantity.tolist()))
    plain = " (unpolarised)" if angle.any() and np.isnan(data.polarizer_deg).all() else ""
    text += ", " + _listed(
        [f"{np.sum(quantity == name)} {name}{plain * (name in ('R', 'T'))}" for name in names]
    )
    if any(name not in ("psi", "delta") for name in names):
        if options.scale is not None:
            text += f", times {options.scale:g}"
        else:
            text += ", percent" if factor == 0.01 else ", fraction"
    known = np.isfinite(data.sigma)
    text += ", with standard errors" if known.any() else ", without standard errors"
    if spectral:
        several = len(np.unique(angle))
        if several > 1 or layout.angle is not None or options.angle_deg is not None:
            text += f"; {several} angles" if several > 1 else f"; angle {angle[0]:g} degrees"
    elif np.isnan(wavelength).all():
        text += "; no wavelength given"
    elif layout.wavelength is not None or options.wavelength_um is not None:
        text += f"; wavelength {wavelength[0]:.6g} um"
    gaps = len(table.rows) * len(layout.values) - len(quantity)
    if gaps:
        notes.append(f"{gaps} gap{'s' * (gaps != 1)}")
    if layout.unused:
        notes.append("columns not used: " + ", ".join(layout.unused[:12]))
    return "; ".join([text, *dict.fromkeys(notes)])


@np.errstate(all="ignore")  # what overflows or is NaN is refused by the checks of the Measurement
def long_columns(table: Table, layout: Layout, options: Options) -> LongColumns:
    """Return the data of the chosen columns, column after column, gaps left out.

    Raises MeasurementError for what is ambiguous or contradicts itself; ranges are for the
    Measurement to check.
    """
    said = evidence(table.source, PurePath(table.source).stem, table.preamble)
    ats = [value.role.at for value in layout.values]
    notes = [
        f"angle {at:g} degrees by the column name" for at in dict.fromkeys(ats) if at is not None
    ]
    for value in [v for v in layout.values if options.columns and v.role.at is None]:
        said.said.extend(s for s in statements(table.header, value.label) if s.kind == "angle")
    said = said.without(options)
    reading = Reading(table, layout, options, said, [*table.notes, *notes])
    _refuse_other_quantity(reading)
    wavelength = wavelengths(reading)
    angle = angles(reading, wavelength)
    read = {v.index: numbers_of(table, v, options.missing) for v in layout.values}
    numbers = {index: pair[0] for index, pair in read.items()}
    _refuse_placeholders(reading, numbers)
    light = light_of_rows(reading, bool(np.nan_to_num(angle).any() or any(ats)))
    signs = {index: pair[1] for index, pair in read.items()}
    factor = power_scale(reading, numbers, signs)
    psi_units = psi_delta_unit(reading, numbers)
    parts: list[tuple[np.ndarray, ...]] = []
    places: list[tuple[int, str, str]] = []
    for value, sigma_column in zip(layout.values, layout.sigmas, strict=True):
        raw, quantity = numbers[value.index], value.role.quantity
        unit = psi_units.get(value.index, "")
        if quantity in ("psi", "delta"):
            converted = np.degrees(raw) if unit == "rad" else raw
        else:
            converted = scaled(raw, factor)
        if value.role.at is not None and options.angle_deg is None:
            angle = np.full(len(raw), value.role.at)
        sigma = standard_errors(reading, value, sigma_column, unit, factor)
        there = ~np.isnan(raw)
        if sigma_column is not None and options.sigma is None:
            refuse_gaps(table, sigma_column, there & np.isnan(sigma), "standard error")
        if options.sigma is not None:
            sigma = np.where(np.isnan(sigma), options.sigma, sigma)
        if layout.angle is not None:
            refuse_gaps(table, layout.angle, there & np.isnan(angle), "angle")
        if layout.wavelength is not None:
            refuse_gaps(table, layout.wavelength, there & np.isnan(wavelength), "wavelength")
        name = np.full(len(raw), quantity, dtype="<U6")
        polarizer = np.full(len(raw), np.nan)
        if quantity in ("R", "T"):
            column = layout.polarizer or layout.polarization
            if column is not None:
                known = (light.letter != "") | ~np.isnan(light.polarizer_deg)
                refuse_gaps(table, column, there & ~known, "polarisation")
            for letter in "sp":
                name[light.letter == letter] = f"{quantity}_{letter}"
            polarizer = light.polarizer_deg
        _refuse_zeros(reading, value, raw, name)
        kept = np.flatnonzero(there)
        columns = (angle, wavelength, name, converted, sigma, polarizer)
        parts.append(tuple(column[kept] for column in columns))
        error = sigma_column.label if sigma_column is not None else ""
        places += [(table.lines[i], value.label, error) for i in kept]
    if not places:
        raise MeasurementError(
            f"{place(table.source, table.lines[0])}: the {len(table.rows)} rows hold gaps only; at "
            "least one measured value was wanted."
        )
    joined = [np.concatenate(column) for column in zip(*parts, strict=True)]
    axes = {"angle": layout.angle, "wavelength": layout.wavelength, "polarizer": layout.polarizer}
    labels = {name: column.label for name, column in axes.items() if column is not None}
    data = Data(*joined)
    understood = _understood(reading, data, factor)
    return LongColumns(data, places, labels, understood)
