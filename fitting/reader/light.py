"""The polarisation of each row: a column of words, codes or angles, or one for the file."""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np

from fitting.errors import MeasurementError
from fitting.reader.cells import is_missing, is_number, number_or_none
from fitting.reader.columns import Column
from fitting.reader.reading import Reading
from fitting.reader.vocabulary import light_of, plain

_GLUED = {"rs": "s", "rp": "p"}
_TAIL = re.compile(r"(?<=.)(?:pol|polarized|polarised|polarization|polarisation|wave)$")


class Light(NamedTuple):
    """For each row "s", "p", "u" or "" (not said), and a polariser's angle from p, else NaN."""

    letter: np.ndarray
    polarizer_deg: np.ndarray


def _letter(cell: str) -> str:
    word = re.sub(r"[^a-z]", "", plain(cell).lower()) if not any(map(str.isdigit, cell)) else ""
    return _GLUED.get(word) or light_of(word) or light_of(_TAIL.sub("", word))


def _from_angles(reading: Reading, column: Column) -> Light:
    numbers = reading.numbers(column)
    unit = column.role.unit or "deg"
    if unit not in ("deg", "rad"):
        reading.refuse(column, f"a polariser angle in {unit} came where degrees were wanted.")
    degrees = np.degrees(numbers) if unit == "rad" else numbers
    # a linear polariser looks the same after half a turn, and the power after a reflection too
    turned = np.mod(degrees + (90.0 if reading.options.polarizer == "angle-from-s" else 0.0), 180.0)
    folded = np.where(turned > 90.0, 180.0 - turned, turned)
    # half p and half s is what unpolarised light is
    letter = np.select([folded == 0.0, folded == 90.0, folded == 45.0], ["p", "s", "u"], "")
    return Light(letter, np.where(letter == "", folded, np.nan))


def _from_cells(reading: Reading, column: Column) -> Light:
    cells = [row[column.index] for row in reading.table.rows]
    codes = reading.options.codes
    known: dict[str, str] = {}
    for cell in set(cells):
        text = cell.lower()
        letter = codes.get(text, "") or (not codes and _letter(cell)) or ""
        if not letter and (number := number_or_none(cell)) is not None:
            letter = next((codes[c] for c in codes if number_or_none(c) == number), "")
        known[cell] = letter
    lost = [i for i, cell in enumerate(cells) if not known[cell] and not is_missing(cell)]
    if lost:
        i = lost[0]
        values = sorted({cells[j] for j in lost})[:4]
        if all(is_number(value) for value in values):
            codes = ",".join(v + "=" + "sp"[n % 2] for n, v in enumerate(values[:2]))
            reading.refuse(
                column,
                f"{', '.join(values)} may be codes or angles of a polariser. Say --polarization "
                f"{codes} (or the other way round), or angle-from-p or angle-from-s if they are "
                "degrees.",
                i,
            )
        reading.refuse(
            column,
            f"{cells[i][:30]!r} came where s, p, TE, TM or unpolarized was wanted. Say what it "
            f"means with --polarization {cells[i][:30]}=s.",
            i,
        )
    return Light(np.array([known[cell] for cell in cells]), np.full(len(cells), np.nan))


def light_of_rows(reading: Reading, oblique: bool) -> Light:
    """Return the polarisation of each row as far as it is not said by the columns' own names.

    oblique: whether any angle is not 0, where s and p are one.
    Raises MeasurementError where two facts disagree, or a code has two readings.
    """
    table, layout, options, said, notes = reading
    rows = len(table.rows)
    column = layout.polarizer or layout.polarization
    bare = [v for v in layout.values if v.role.quantity in ("R", "T")]
    named = [v for v in layout.values if v.role.quantity[1:] in ("_s", "_p")]
    if layout.polarizer and layout.polarization:
        raise MeasurementError(
            f"{table.source}: columns {layout.polarization.label!r} and {layout.polarizer.label!r} "
            "both give the polarisation. Name all columns to be read with --columns."
        )
    if column is not None:
        if named:
            reading.refuse(
                column,
                "this column gives the polarisation, and so does the name of column "
                f"{named[0].label!r}. Name the columns to be read with --columns.",
            )
        if not bare:
            notes.append(f"column {column.label} not needed")
            return Light(np.full(rows, ""), np.full(rows, np.nan))
        if options.light:
            reading.refuse_both(column, "the polarisation", "--polarization")
        if options.polarizer:
            return _from_angles(reading, column)
        if column is layout.polarizer and not options.codes:
            reading.refuse(
                column,
                "a polariser's angle can count from the plane of incidence (0 is p) or from its "
                "normal (0 is s). Say --polarization angle-from-p or angle-from-s.",
            )
        light = _from_cells(reading, column)
        here = set(light.letter.tolist()) - {""}
        if not options.columns:
            came = f"the rows are of {' and '.join(sorted(here))}-polarised light"
            reading.contradicted("light", lambda letter: letter not in here, column, came)
        return light
    if options.codes or options.polarizer:
        raise MeasurementError(
            f"{table.source}: --polarization gives a meaning to a column, but none is named as the "
            "polarisation. Say which it is with --columns polarization=..., or --polarization s "
            "or p."
        )
    letter = options.light
    if letter and any(v.role.quantity[2:] != letter for v in named):
        reading.refuse(
            named[0],
            f"the column is named {named[0].role.quantity}, and --polarization says otherwise. "
            "Name the columns to be read with --columns.",
        )
    if not letter and bare and not named and oblique and (beside := said.one("light")):
        letter = str(beside.value)
        what = {"s": "s", "p": "p", "u": "unpolarised"}[letter]
        notes.append(f"{what} light ({beside.where}; --polarization)")
    elif not options.light and not options.columns and named:
        here = {v.role.quantity[2:] for v in named}
        came = f"the columns are of {' and '.join(sorted(here))}-polarised light"
        reading.contradicted("light", lambda letter: letter not in here, named[0], came)
    return Light(np.full(rows, letter or "u"), np.full(rows, np.nan))
