"""A file as long columns: one datum per row, with its place in the file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fitting.data.checks import Data
from fitting.data.errors import refuse
from fitting.data.folds import folded
from fitting.data.quantities import (
    NAME,
    POWER_LETTERS,
    POWERS,
    are_powers,
    letter_of,
)
from fitting.data.units import scaled, span_of
from fitting.reader import instruments, jcamp
from fitting.reader.columns import Column, choose_columns
from fitting.reader.conversion import (
    FIELD_DEG,
    Reading,
    angles,
    light_of_rows,
    power_scale,
    psi_delta_unit,
    standard_errors,
    wavelengths,
)
from fitting.reader.names import Role
from fitting.reader.options import Options
from fitting.reader.remarks import evidence, statements, without
from fitting.reader.table import Table, read_table
from fitting.reader.text import STDIN, Lines, read_lines

# What makes a file of an instrument a plain table; each returns None for a file of another kind.
FORMATS: tuple[Callable, ...] = (
    instruments.film_sense,
    jcamp.as_plain_table,
    instruments.perkin_elmer,
    instruments.spectraray,
)


class LongColumns(NamedTuple):
    """The data of a file, and where each datum stands.

    places: (line, column of the value, column of its standard error) of each datum.
    labels: columns of the angle, the wavelength and the polarizer.
    understood: how the file was read. reference: the column of a reference at each datum.
    """

    data: Data
    places: list[tuple[int, str, str]]
    labels: dict[str, str]
    understood: str
    reference: np.ndarray | None = None

    def by(self, converted: tuple[Data, str]) -> LongColumns:
        """Return the columns with other data, row by row, and how they were made."""
        data, how = converted
        return self._replace(data=data, understood=f"{self.understood}; {how}")


def _refuse_code(reading: Reading, value: Column, row: int, code: str, came: str) -> None:
    """Raise because a number may stand for 'not measured', unless an option says that none does."""
    if "none" not in reading.options.missing:
        flag = f"--missing{'=' if code[0] == '-' else ' '}{code}"
        text = f"{came}. Say {flag} if that stands for 'not measured', --missing none if it was "
        reading.refuse(value, text + "measured.", row)


def _refuse_placeholders(reading: Reading, numbers: dict[int, np.ndarray]) -> None:
    """Raise where Delta repeats psi, or both are 0 in some rows, as for what was not measured."""
    by_name = {value.role.quantity: value for value in reading.layout.values}
    if not {"psi", "delta"} <= set(by_name):
        return
    psi, delta = (numbers[by_name[name].index] for name in ("psi", "delta"))
    if np.isfinite(psi).sum() > 1 and np.array_equal(psi, delta, equal_nan=True):
        text = "every number equals that of psi, which no surface gives. Name the right column with"
        reading.refuse(by_name["delta"], text + " --columns delta=..., or correct the file.")
    dark = np.flatnonzero((psi == 0.0) & (delta == 0.0))
    if len(dark) and np.any((psi != 0.0) & ~np.isnan(psi)):
        _refuse_code(reading, by_name["psi"], int(dark[0]), "0", "psi and Delta are both 0")


def _refuse_zeros(reading: Reading, value: Column, numbers: np.ndarray, name: np.ndarray) -> None:
    """Raise where codes or zeros among larger powers may stand for values never measured."""
    for i in np.flatnonzero(np.isin(numbers, (-1.0, -9.0, -99.0, -999.0, -9999.0)))[:1]:
        if np.nanmax(numbers, initial=0.0) > 1.0:
            _refuse_code(reading, value, i, f"{numbers[i]:g}", f"{numbers[i]:g} came")
    for quantity in np.unique(name):
        chosen = np.flatnonzero((name == quantity) & np.isfinite(numbers))
        zeros = chosen[numbers[chosen] == 0.0]
        others = np.abs(numbers[chosen][numbers[chosen] != 0.0])
        # a true zero (Brewster's angle, a fringe) is approached by its neighbours
        if len(zeros) and len(others) and others.min() > max(0.02 * others.max(), 1e-2):
            came = f"0 came, where the smallest other value is {others.min():.6g}"
            _refuse_code(reading, value, int(zeros[0]), "0", came)


def _refuse_other_quantity(reading: Reading) -> None:
    """Raise where the file speaks of another power alone than that of the columns."""
    value = reading.layout.values[0]
    here = {letter_of(value.role.quantity) for value in reading.layout.values} & {*POWER_LETTERS}
    if here and not here & {said.value for said in reading.said if said.kind == "quantity"}:
        came = f"the name says {value.role.quantity}"
        reading.contradicted("quantity", lambda letter: letter not in here, value, came)


def _understood(reading: Reading, data: Data, factor: float) -> str:
    table, layout, options, _, notes = reading
    angle, wavelength, quantity = data.angle_deg, data.wavelength_um, data.quantity
    spectral = len(np.unique(wavelength)) > 1
    axis, what, unit = (wavelength, "wavelength", "um") if spectral else (angle, "angle", "degrees")
    count = len(np.unique(axis))
    text = f"read {count} {what}{'s' * (count != 1)} ({span_of(axis, unit)}), "
    plain = " (unpolarized)" if angle.any() and np.isnan(data.polarizer_deg).all() else ""
    names = list(dict.fromkeys(quantity.tolist()))
    counts = [f"{np.sum(quantity == n)} {n}{plain * (n in POWER_LETTERS)}" for n in names]
    text += ", ".join(counts[:-1]) + " and " * (len(counts) > 1) + counts[-1]
    if are_powers(names).any():
        scale = " in percent" if factor == 0.01 else " as fractions" * (not options.divided)
        text += scale if options.scale is None else f", multiplied by {options.scale:g}"
    text += f", with{'' if np.isfinite(data.sigma).any() else 'out'} standard errors"
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


def _table_of(lines: Lines, options: Options) -> Table:
    """Return the table in the lines of a file of any known format."""
    texts = lines.texts
    if lines.tabbed:
        if options.delimiter:
            refuse("--delimiter is for text, and the cells of a table are known. Leave it out.")
        return read_table(list(enumerate(texts, start=1)), options._replace(delimiter="\t"))
    plain = instruments.woollam(texts, options.ignore)
    for as_plain_table in FORMATS:
        plain = plain or as_plain_table(texts)
    numbered, notes = plain or (list(enumerate(texts, start=1)), [])
    table = read_table(numbered, options)
    return table._replace(notes=table.notes + notes)


def _with_reference(table: Table, name: str) -> tuple[Table, Column | None]:
    """Return the table without the column of a reference, and this column, None if not there."""
    low = name.strip().lower()
    which = [i for i in table.filled if name and table.names[i].lower() == low]
    exists = name == STDIN or bool(name and Path(name).exists())
    if name and not (which or exists):
        names = ", ".join(filter(None, table.names))
        refuse(f"--divide-by {name} names neither a file nor a column; the columns are {names}.")
    if len(which) != 1:
        return table, None
    if exists:
        refuse(f"--divide-by {name} names a column and a file. If it is the file, say ./{name}.")
    rest = table._replace(filled=[i for i in table.filled if i not in which])
    return rest, Column(which[0], table.label(which[0]), Role("value"))


@np.errstate(all="ignore")  # what overflows or is NaN is refused by the checks of the Measurement
def long_columns(source: Any, options: Options) -> LongColumns:
    """Return the data of a file, a buffer or a table, column after column, gaps left out.

    Refuses what is ambiguous or contradicts itself; ranges are not checked.
    """
    lines = read_lines(source, options.encoding, options.sheet)
    table, by = _with_reference(_table_of(lines, options), options.reference)
    layout = choose_columns(table, options)
    said = evidence(lines.name, table.preamble)
    ats = dict.fromkeys(v.role.at for v in layout.values if v.role.at is not None)
    notes = [*table.notes, *lines.notes]
    notes += (f"angle {at:g} degrees by the column name" for at in ats)
    for value in [v for v in layout.values if options.columns and v.role.at is None]:
        said += (s for s in statements(table.header, value.label) if s.kind == "angle")
    reading = Reading(table, layout, options, without(said, options), notes)
    _refuse_other_quantity(reading)
    wavelength = wavelengths(reading)
    angle = angles(reading, wavelength)
    read = {v.index: reading.numbers(v, gaps=True) for v in layout.values}
    numbers = {index: pair[0] for index, pair in read.items()}
    _refuse_placeholders(reading, numbers)
    field = light_of_rows(reading, bool(np.nan_to_num(angle).any() or any(ats)))
    reading.refuse_left_out()
    factor = power_scale(reading, numbers, {index: pair[1] for index, pair in read.items()})
    psi_units = psi_delta_unit(reading, numbers)
    light = layout.polarizer or layout.polarization
    reference = np.full(len(angle), np.nan) if by is None else reading.numbers(by, gaps=True)[0]
    parts: list[tuple[np.ndarray, ...]] = []
    places: list[tuple[int, str, str]] = []
    for value, error in zip(layout.values, layout.sigmas, strict=True):
        raw, quantity = numbers[value.index], value.role.quantity
        power, unit = quantity in POWERS, psi_units.get(value.index, "")
        converted = np.degrees(raw) if unit == "rad" else scaled(raw, factor if power else 1.0)
        if value.role.at is not None and options.angle_deg is None:
            angle = np.full(len(raw), value.role.at)
        sigma = standard_errors(reading, value, error, unit, factor)
        if options.sigma is not None:
            sigma = np.where(np.isnan(sigma), options.sigma, sigma)
        name = np.full(len(raw), quantity, dtype=NAME)
        polarizer = np.full(len(raw), np.nan)
        needed = [(error, sigma, "standard error"), (layout.angle, angle, "angle"),
                  (layout.wavelength, wavelength, "wavelength")]  # fmt: skip
        if quantity in POWER_LETTERS:
            needed.append((light, field, "polarization"))
            for letter in "sp":
                name[field == FIELD_DEG[letter]] = f"{quantity}_{letter}"
            polarizer = np.where(np.isin(field, [*FIELD_DEG.values()]), np.nan, field)
        for column, known, what in needed:
            if column is not None:
                reading.refuse_gaps(column, ~np.isnan(raw) & np.isnan(known), what)
        if power:
            _refuse_zeros(reading, value, raw, name)
        kept = np.flatnonzero(~np.isnan(raw))
        columns = (angle, wavelength, name, converted, sigma, polarizer, reference)
        parts.append(tuple(column[kept] for column in columns))
        places += [(table.lines[i], value.label, error.label if error else "") for i in kept]
    if not places:
        came = f"the {len(table.rows)} rows hold gaps only"
        refuse(f"{came}; at least one measured value was wanted.", table.lines[0])
    *columns, reference = (np.concatenate(column) for column in zip(*parts, strict=True))
    reference = None if by is None else reference
    data = folded(Data(*columns), options.delta_range)
    if (data.quantity == "delta_folded").any():
        notes.append("Delta from 0 to 180 degrees, of unknown sign (--delta-range)")
    axes = {"angle": layout.angle, "wavelength": layout.wavelength, "polarizer": layout.polarizer}
    labels = {name: column.label for name, column in axes.items() if column is not None}
    return LongColumns(data, places, labels, _understood(reading, data, factor), reference)
