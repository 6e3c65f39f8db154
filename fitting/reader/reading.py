"""Rows to be read, numbers in a column, and what is known of a file while they are made of it."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any, NamedTuple, NoReturn

import numpy as np

from fitting.data.checks import number_or_none
from fitting.data.errors import refuse
from fitting.reader.cells import is_missing, to_numbers
from fitting.reader.columns import Column, Layout
from fitting.reader.evidence import FULL_NAME, OPTION, Said
from fitting.reader.options import Options
from fitting.reader.table import Table, find_column, label_of
from fitting.reader.unread_columns import came_in


def _span(word: str) -> tuple[float, float] | None:
    """Return the ends of a range such as 1-4, those of a number twice; None for any other word."""
    match = re.fullmatch(r"\s*(-?[0-9.]+)\s*-\s*(-?[0-9.]+)\s*", word)
    low, high = (number_or_none(end) for end in (match.groups() if match else (word, word)))
    return None if low is None or high is None else (low, high)


def keep_rows(table: Table, options: Options) -> Table:
    """Return the table with the rows that the option ``keep`` (column=1,3-5,...) lets through."""
    rows, lines = table.rows, table.lines
    for name, wanted in options.keep.items():
        index = find_column(table, name, "--keep")
        words = {word.lower() for word in wanted}
        spans = [span for word in wanted if (span := _span(word))]
        chosen = []
        for i, row in enumerate(rows):
            number = number_or_none(row[index])
            inside = number is not None and any(low <= number <= high for low, high in spans)
            if inside or row[index].lower() in words:
                chosen.append(i)
        rows, lines = [rows[i] for i in chosen], [lines[i] for i in chosen]
        if not rows:
            refuse(
                f"--keep {name}={','.join(wanted)} came, but no row has such a value in this "
                "column."
            )
    return table._replace(rows=rows, lines=lines)


class Reading(NamedTuple):
    """A table, its columns in use, the options, what is said beside, and notes, which grow."""

    table: Table
    layout: Layout
    options: Options
    said: list[Said]
    notes: list[str]

    def refuse(self, column: Column, text: str, row: int | None = None) -> NoReturn:
        """Refuse at a column's name, or at its cell in a row."""
        line = (self.table.header or self.table.lines[0]) if row is None else self.table.lines[row]
        refuse(text, line, column.label)

    def refuse_left_out(self) -> None:
        """Refuse a column that is not read, but may hold something of use."""
        table, layout = self.table, self.layout
        if not layout.left_out:
            return
        index, what = next(iter(layout.left_out.items()))
        axes = (layout.angle, layout.wavelength, layout.polarization, layout.polarizer)
        read = [column for column in (*axes, *layout.values) if column is not None]
        columns = [f"{c.role.quantity or c.role.kind}={c.index + 1}" for c in read]
        role = "wavelength" if layout.wavelength is None else "ROLE"
        role = next((r for r in ("polarization", "angle") if what.startswith("the " + r)), role)
        names = [label_of(table, i) for i in layout.left_out]
        if any(re.search(r"[\s,;]", name) for name in names):
            names = [str(i + 1) for i in layout.left_out]
        refuse(
            f"this column ({came_in(table, index)}) is not read, but it may be {what}. If the fit "
            f"may do without it, say --ignore {','.join(names)}; else name all columns to be read: "
            f"--columns {','.join(columns)},{role}={index + 1}.",
            table.header or table.lines[0],
            label_of(table, index),
        )

    def refuse_both(self, column: Column, what: str, option: str) -> NoReturn:
        """Raise because an option gives what a column gives."""
        self.refuse(
            column,
            f"the file gives {what}, and {option} came too. Drop the option, or name the columns "
            "to be read with --columns.",
        )

    def refuse_gaps(self, column: Column, gone: np.ndarray, what: str) -> None:
        """Raise for the first row in ``gone``, which has a value but no ``what``."""
        for i in np.flatnonzero(gone)[:1].tolist():
            cell = self.table.rows[i][column.index]
            came = f"the {what} is missing in a row that has a value"
            if not is_missing(cell):
                came = f"{cell[:30]!r} gives no {what}: Q lies between 0 and 4 pi / wavelength "
                came += "(--wavelength-um), the minutes of an angle are at most 59 (--angle-unit)"
            self.refuse(column, f"{came}. Correct it, or leave the line out with --lines A-B.", i)

    def numbers(self, column: Column, gaps: bool = False) -> tuple[np.ndarray, str]:
        """Return the numbers of a column, NaN for missing ones, and the sign (% or degree) on them.

        gaps: whether the words of the option ``missing`` count as missing too.
        """
        table, missing = self.table, self.options.missing if gaps else []
        cells = [row[column.index] for row in table.rows]
        if missing:
            words = {gap.lower() for gap in missing}
            cells = ["" if cell.lower() in words else cell for cell in cells]
        numbers, sign = to_numbers(cells, table.lines, table.decimal, column.label)
        values = [number for gap in missing if (number := number_or_none(gap)) is not None]
        return np.where(np.isin(numbers, values), np.nan, numbers), sign

    def not_understood(self, said: Said) -> NoReturn:
        """Raise because something beside the table is not understood, or not here."""
        gives, option, _ = OPTION[said.kind]
        if said.where == FULL_NAME and said.kind == "angle":
            refuse(
                f"the file name says {said.text} degrees. If that is the angle of incidence, say "
                f"--angle-deg {said.text}; else say --angle-deg NUMBER."
            )
        refuse(
            f"{said.where} ({said.text!r}) may state {gives}, but is not understood. Say {option}."
        )

    def one(self, kind: str) -> Said | None:
        """Return the one thing that is said of ``kind`` beside the table, None where nothing is.

        Refuses a file where it is not understood, or two places contradict one another.
        """
        chosen = [said for said in self.said if said.kind == kind]
        clear = [said for said in chosen if said.value is not None]
        for said in chosen:
            if said.value is None:
                if said.where == FULL_NAME and clear and clear[0].value in said.numbers:
                    continue  # gold_60deg.csv, and a line that gives 60 degrees
                self.not_understood(said)
            if said.value != clear[0].value:
                gives, option, _ = OPTION[kind]
                refuse(
                    f"{clear[0].where} ({clear[0].text!r}) and {said.where} ({said.text!r}) "
                    f"contradict each other on {gives}. Say {option}."
                )
        return clear[0] if clear else None

    def contradicted(
        self, kind: str, is_other: Callable[[Any], bool], column: Column, came: str
    ) -> None:
        """Raise where what is said of ``kind`` is other than what ``column`` shows (``came``).

        Columns that an option names hold against all that is said.
        """
        for said in [] if self.options.columns else self.said:
            values = said.numbers if said.value is None else (said.value,)
            if said.kind == kind and any(map(is_other, values)):
                gives, option, _ = OPTION[kind]
                self.refuse(
                    column,
                    f"{came}, but {said.where} ({said.text!r}) states {gives} differently. If the "
                    "column is right, name all columns to be read with --columns; else say "
                    f"{option}.",
                )

    def refuse_other_light(self, letters: set[str], column: Column) -> None:
        """Raise where another light than that of the columns or rows, s, p or u, is said."""
        came = f"the light is {' and '.join(sorted(letters))}-polarized"
        self.contradicted("light", lambda letter: letter not in letters, column, came)

    def unit(self, kind: str, column: Column, option: str, what: str) -> str:
        """Return the unit of a column: of the option, the header, or a line beside; else "".

        kind: the kind of statement. what: the numbers, for the sentence on how they were read.
        Refuses a file where the header and a line say different things.
        """
        if option:
            return option
        own = column.role.unit
        if own:  # by which the name of the file is of no matter
            lines = self._replace(said=[said for said in self.said if said.where != FULL_NAME])
            lines.one(kind)
            lines.contradicted(kind, lambda u: u != own, column, f"the header says {own}")
            return own
        beside = self.one(kind)
        if beside:
            flag = OPTION[kind][1].split(" ")[0]
            self.notes.append(f"{what} in {beside.value} ({beside.where}; {flag})")
        return str(beside.value if beside else "")
