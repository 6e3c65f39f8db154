"""A table with its columns chosen becomes long columns: one datum per row, with its place."""

from __future__ import annotations

from pathlib import PurePath
from typing import NamedTuple

import numpy as np

from fitting.checks import Data
from fitting.errors import MeasurementError, place
from fitting.reader.axes import angles, wavelengths
from fitting.reader.columns import Column, Layout
from fitting.reader.evidence import Evidence, evidence
from fitting.reader.light import light_of_rows
from fitting.reader.options import Options
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


def _refuse_copies(table: Table, layout: Layout, numbers: dict[int, np.ndarray]) -> None:
    """Raise where Delta repeats psi."""
    by_name = {value.role.quantity: value for value in layout.values}
    if "psi" in by_name and "delta" in by_name:
        psi, delta = numbers[by_name["psi"].index], numbers[by_name["delta"].index]
        if np.isfinite(psi).sum() > 1 and np.array_equal(psi, delta, equal_nan=True):
            raise MeasurementError(
                f"{place(table.source, table.header, by_name['delta'].label)}: every number equals "
                "psi, which no surface gives. Mend the file, or name another column with "
                "--columns delta=..."
            )


def _refuse_zeros(
    table: Table, value: Column, numbers: np.ndarray, name: np.ndarray, options: Options
) -> None:
    """Raise where zeros among larger values may stand for values never measured."""
    if options.zero_is_value or value.role.quantity in ("psi", "delta"):
        return
    bare = np.flatnonzero(np.isin(numbers, (-1.0, -9.0, -99.0, -999.0, -9999.0)))
    if len(bare) and np.nanmax(numbers, initial=0.0) > 1.0:
        raise MeasurementError(
            f"{place(table.source, table.lines[int(bare[0])], value.label)}: "
            f"{numbers[bare[0]]:g} came, which may stand for 'not measured'. Say "
            f"--missing={numbers[bare[0]]:g} if so, --missing none if it was measured."
        )
    for quantity in np.unique(name):
        chosen = np.flatnonzero((name == quantity) & np.isfinite(numbers))
        zeros = chosen[numbers[chosen] == 0.0]
        others = np.abs(numbers[chosen][numbers[chosen] != 0.0])
        # a true zero (Brewster's angle, a fringe) is approached by its neighbours
        if (
            len(zeros)
            and len(others)
            and others.min() > 0.02 * others.max()
            and others.min() > 1e-2
        ):
            i = int(zeros[0])
            raise MeasurementError(
                f"{place(table.source, table.lines[i], value.label)}: 0 came, where the smallest "
                f"other value is {others.min():.6g}. Say --missing 0 if it stands for 'not "
                "measured', --missing none if it was measured."
            )


def _refuse_dark_rows(
    table: Table, layout: Layout, numbers: dict[int, np.ndarray], options: Options
) -> None:
    """Raise where psi and Delta are both 0 in some rows, as files write what was not measured."""
    by_name = {value.role.quantity: value for value in layout.values}
    if options.zero_is_value or not {"psi", "delta"} <= set(by_name):
        return
    psi, delta = numbers[by_name["psi"].index], numbers[by_name["delta"].index]
    dark = np.flatnonzero((psi == 0.0) & (delta == 0.0))
    if len(dark) and np.any((psi != 0.0) & ~np.isnan(psi)):
        raise MeasurementError(
            f"{place(table.source, table.lines[int(dark[0])], by_name['psi'].label)}: psi and "
            "Delta are both 0. Say --missing 0 if that stands for 'not measured', --missing none "
            "if it was measured."
        )


def _refuse_other_quantity(table: Table, layout: Layout, options: Options, said: Evidence) -> None:
    """Raise where the file speaks of transmission or absorption alone, and the columns are R."""
    here = {value.role.quantity[0] for value in layout.values} & {"R", "T"}
    if here and said.quantities and not here & said.quantities and not options.columns:
        word = {"R": "reflection", "T": "transmission", "A": "absorption"}[min(said.quantities)]
        value = layout.values[0]
        raise MeasurementError(
            f"{place(table.source, table.header, value.label)}: a column of {value.role.quantity}, "
            f"and the lines around the table or the file name speak of {word}. Name all columns to "
            f"be read, for example --columns angle=1,{value.role.quantity}={value.index + 1}."
        )


def _drop_mean(
    table: Table, layout: Layout, numbers: dict[int, np.ndarray], notes: list[str]
) -> Layout:
    """Return the layout without an R (or T) that is only the mean of R_s and R_p beside it."""
    by_name = {value.role.quantity: value for value in layout.values}
    for letter in "RT":
        three = [by_name.get(letter + tail) for tail in ("", "_s", "_p")]
        if None in three:
            continue
        mean, s, p = (numbers[column.index] for column in three if column is not None)
        both = np.isfinite(mean) & np.isfinite(s) & np.isfinite(p)
        slack = 2e-3 * np.nanmax(np.abs(mean), initial=0.0)
        if both.any() and np.all(np.abs(mean - 0.5 * (s + p))[both] <= slack):
            kept = [i for i, v in enumerate(layout.values) if v.role.quantity != letter]
            layout = layout._replace(
                values=[layout.values[i] for i in kept], sigmas=[layout.sigmas[i] for i in kept]
            )
            notes.append(f"{letter} left out: the mean of {letter}_s and {letter}_p")
    return layout


def _listed(names: list[str]) -> str:
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def _understood(
    table: Table, layout: Layout, options: Options, data: Data, factor: float, notes: list[str]
) -> str:
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
    if angled := sorted({v.role.at for v in layout.values if v.role.at is not None}):
        notes.append(f"angles {', '.join(f'{at:g}' for at in angled)} degrees by the column names")
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
    notes = [*table.notes]
    said = evidence(table.source, PurePath(table.source).stem, table.preamble)
    said = said.without(options)
    _refuse_other_quantity(table, layout, options, said)
    wavelength = wavelengths(table, layout, options, said, notes)
    angle = angles(table, layout, options, wavelength, said, notes)
    if layout.wavelength is None and options.wavelength_um is None:
        said.one("wavelength")
    read = {v.index: numbers_of(table, v, options.missing) for v in layout.values}
    numbers = {index: pair[0] for index, pair in read.items()}
    _refuse_copies(table, layout, numbers)
    layout = _drop_mean(table, layout, numbers, notes)
    ats = [value.role.at for value in layout.values]
    oblique = bool(np.nan_to_num(angle).any() or any(ats))
    light = light_of_rows(table, layout, options, oblique, said, notes)
    signs = {index: pair[1] for index, pair in read.items()}
    factor = power_scale(table, layout, options, numbers, signs, said, notes)
    psi_units = psi_delta_unit(table, layout, options, numbers, said)
    _refuse_dark_rows(table, layout, numbers, options)
    columns_angle = angle
    parts: list[tuple[np.ndarray, ...]] = []
    places: list[tuple[int, str, str]] = []
    for value, sigma_column in zip(layout.values, layout.sigmas, strict=True):
        raw, quantity = numbers[value.index], value.role.quantity
        if value.role.at is not None and options.angle_deg is None:
            angle = np.full(len(raw), value.role.at)
        else:
            angle = columns_angle
        unit = psi_units.get(value.index, "")
        if quantity in ("psi", "delta"):
            converted = np.degrees(raw) if unit == "rad" else raw
        else:
            converted = scaled(raw, factor)
        sigma = standard_errors(table, value, sigma_column, options, unit, factor)
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
                said = (light.letter != "") | ~np.isnan(light.polarizer_deg)
                refuse_gaps(table, column, there & ~said, "polarisation")
            letter = light.letter
            name = np.where(
                letter == "s", quantity + "_s", np.where(letter == "p", quantity + "_p", name)
            )
            polarizer = light.polarizer_deg
        _refuse_zeros(table, value, raw, name, options)
        kept = np.flatnonzero(there)
        parts.append(
            (
                angle[kept],
                wavelength[kept],
                name[kept],
                converted[kept],
                sigma[kept],
                polarizer[kept],
            )
        )
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
    understood = _understood(table, layout, options, data, factor, notes)
    return LongColumns(data, places, labels, understood)
