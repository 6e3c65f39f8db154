"""What is known of a file while its columns become numbers: one thing that is handed around."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, NoReturn

import numpy as np

from fitting.errors import MeasurementError, place
from fitting.reader.columns import Column, Layout
from fitting.reader.evidence import OPTION, Evidence
from fitting.reader.options import Options
from fitting.reader.rows import numbers_of
from fitting.reader.table import Table


class Reading(NamedTuple):
    """A table, its columns in use, the options, what is said beside, and notes, which grow."""

    table: Table
    layout: Layout
    options: Options
    said: Evidence
    notes: list[str]

    def refuse(self, column: Column, text: str, row: int | None = None) -> NoReturn:
        """Raise MeasurementError at a column's name, or at its cell in a row."""
        line = (self.table.header or self.table.lines[0]) if row is None else self.table.lines[row]
        raise MeasurementError(f"{place(self.table.source, line, column.label)}: {text}")

    def refuse_both(self, column: Column, what: str, option: str) -> NoReturn:
        """Raise because an option gives what a column gives."""
        self.refuse(
            column,
            f"the file gives {what}, and {option} came too. Drop the option, or name the columns "
            "to be read with --columns.",
        )

    def numbers(self, column: Column) -> np.ndarray:
        """Return the numbers of a column, NaN for gaps."""
        return numbers_of(self.table, column, [])[0]

    def contradicted(
        self, kind: str, is_other: Callable[[Any], bool], column: Column, came: str
    ) -> None:
        """Raise where what is said of ``kind`` is other than what ``column`` shows (``came``)."""
        at = place(self.table.source, self.table.header, column.label)
        self.said.refuse_other(kind, is_other, at, came)

    def unit(self, kind: str, column: Column, option: str, what: str) -> str:
        """Return the unit of a column: of the option, the header, or a line beside; else "".

        kind: the kind of statement. what: the numbers, for the sentence on how they were read.
        Raises MeasurementError where the header and a line say different things.
        """
        if option:
            return option
        beside, own = self.said.one(kind), column.role.unit
        if own:
            self.contradicted(kind, lambda u: u != own, column, f"the header says {own}")
        if beside:
            flag = OPTION[kind][1].split(" ")[0]
            self.notes.append(f"{what} in {beside.value} ({beside.where}; {flag})")
        return own or str(beside.value if beside else "")
