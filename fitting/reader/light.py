"""The polarization of each row: a column of words, codes or angles, or one for the file."""

from __future__ import annotations

import numpy as np

from fitting.data.checks import number_or_none
from fitting.data.errors import refuse
from fitting.data.quantities import POLARIZED, POWER_LETTERS
from fitting.reader.cells import is_missing, is_number
from fitting.reader.columns import Column
from fitting.reader.reading import Reading
from fitting.reader.vocabulary import light_of_cell

# Angles of the field from the plane of incidence. Half p and half s is what unpolarized light is.
FIELD_DEG = {"p": 0.0, "s": 90.0, "u": 45.0}


def _from_angles(reading: Reading, column: Column) -> np.ndarray:
    numbers, _ = reading.numbers(column)
    unit = column.role.unit or "deg"
    if unit not in ("deg", "rad"):
        reading.refuse(
            column, f"a polarizer angle in {unit} came. Convert it to degrees or radians."
        )
    degrees = np.degrees(numbers) if unit == "rad" else numbers
    # a linear polarizer looks the same after half a turn, and the power after a reflection too
    turned = np.mod(degrees + (90.0 if reading.options.polarizer == "angle-from-s" else 0.0), 180.0)
    return np.where(turned > 90.0, 180.0 - turned, turned)


def _from_cells(reading: Reading, column: Column) -> np.ndarray:
    cells = [row[column.index] for row in reading.table.rows]
    codes = reading.options.codes
    numbers = {number_or_none(code): letter for code, letter in codes.items()}
    numbers.pop(None, "")
    known = {
        cell: codes.get(cell.lower()) or numbers.get(number_or_none(cell), "")
        if codes
        else light_of_cell(cell)
        for cell in set(cells)
    }
    lost = [i for i, cell in enumerate(cells) if not known[cell] and not is_missing(cell)]
    if lost:
        values = sorted({cells[i] for i in lost})[:4]
        first = cells[lost[0]][:30]
        came = f"{first!r} came where s, p, TE, TM or unpolarized was wanted"
        option = f"{first}=s"
        if all(is_number(value) for value in values):
            came = f"{', '.join(values)} may be codes or angles of a polarizer"
            codes = ",".join(v + "=" + "sp"[n % 2] for n, v in enumerate(values[:2]))
            option = f"{codes} (or the other way round), or angle-from-p or angle-from-s if they "
            option += "are degrees"
        reading.refuse(column, f"{came}. Say what is meant with --polarization {option}.", lost[0])
    reading.refuse_other_light(set(known.values()) - {""}, column)
    return np.array([FIELD_DEG.get(known[cell], np.nan) for cell in cells])


def _from_column(reading: Reading, column: Column) -> np.ndarray:
    options = reading.options
    if options.light:
        reading.refuse_both(column, "the polarization", "--polarization")
    if options.polarizer:
        return _from_angles(reading, column)
    if column is reading.layout.polarizer and not options.codes:
        reading.refuse(
            column,
            "a polarizer's angle can count from the plane of incidence (0 is p) or from its "
            "normal (0 is s). Say --polarization angle-from-p or angle-from-s.",
        )
    return _from_cells(reading, column)


def light_of_rows(reading: Reading, oblique: bool) -> np.ndarray:
    """Return the polarization of each row as far as it is not said by the columns' own names.

    It is the angle of the field from the plane of incidence, as in `FIELD_DEG`; NaN: not said.
    oblique: whether any angle is not 0, where s and p are one.
    Refuses a file where two facts disagree, or a code has two readings.
    """
    table, layout, options, _, notes = reading
    rows = len(table.rows)
    column = layout.polarizer or layout.polarization
    bare = [v for v in layout.values if v.role.quantity in POWER_LETTERS]
    named = [v for v in layout.values if v.role.quantity in POLARIZED]
    if column is not None:
        other = layout.polarization if layout.polarizer else named[0] if named else None
        if other:
            reading.refuse(
                column,
                f"this column gives the polarization, and so does column {other.label!r}. Name "
                "the columns to be read with --columns.",
            )
        return _from_column(reading, column)
    if options.codes or options.polarizer:
        refuse(
            "--polarization gives a meaning to a column, but none is named as the polarization. "
            "Say which it is with --columns polarization=..., or --polarization s or p."
        )
    letter = options.light
    if letter and any(POLARIZED[v.role.quantity] != letter for v in named):
        reading.refuse(
            named[0],
            f"the column is named {named[0].role.quantity}, but --polarization says otherwise. "
            "Name the columns to be read with --columns.",
        )
    if not letter and bare and not named and oblique and (beside := reading.one("light")):
        letter = str(beside.value)
        what = {"s": "s-polarized", "p": "p-polarized", "u": "unpolarized"}[letter]
        notes.append(f"{what} light ({beside.where}; --polarization)")
    elif named and not letter:
        reading.refuse_other_light({POLARIZED[v.role.quantity] for v in named}, named[0])
    return np.full(rows, FIELD_DEG[letter or "u"])
