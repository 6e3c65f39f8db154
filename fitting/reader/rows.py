"""Rows of a table that are to be read, and the numbers in one of its columns."""

from __future__ import annotations

import re

import numpy as np

from fitting.errors import MeasurementError, place
from fitting.reader.cells import is_missing, number_or_none, to_numbers
from fitting.reader.columns import Column
from fitting.reader.options import Options
from fitting.reader.table import Table, find_column


def _span(word: str) -> tuple[float, float] | None:
    """Return the ends of a range such as 1-4, None for any other word."""
    match = re.fullmatch(r"\s*(-?[0-9.]+)\s*-\s*(-?[0-9.]+)\s*", word)
    ends = [number_or_none(end) for end in match.groups()] if match else [None]
    return None if None in ends else (ends[0], ends[1])  # type: ignore[return-value]


def keep_rows(table: Table, options: Options) -> Table:
    """Return the table with the rows that the option ``keep`` (column=1,3-5,...) lets through."""
    rows, lines = table.rows, table.lines
    for name, wanted in options.keep.items():
        index = find_column(table, name, "--keep")
        texts = {word.lower() for word in wanted}
        numbers = {number for word in wanted if (number := number_or_none(word)) is not None}
        spans = [_span(word) for word in wanted]
        cells = [row[index] for row in rows]
        kept = [
            c.lower() in texts
            or (number := number_or_none(c)) in numbers
            or any(s and number is not None and s[0] <= number <= s[1] for s in spans)
            for c in cells
        ]
        chosen = [i for i, keep in enumerate(kept) if keep]
        rows, lines = [rows[i] for i in chosen], [lines[i] for i in chosen]
        if not rows:
            raise MeasurementError(
                f"{table.source}: --keep {name}={','.join(wanted)} leaves no row."
            )
    return table._replace(rows=rows, lines=lines)


def numbers_of(table: Table, column: Column, gaps: list[str]) -> tuple[np.ndarray, str]:
    """Return the numbers of a column, NaN for gaps and the words ``gaps``, and the sign on them."""
    cells = [row[column.index] for row in table.rows]
    if gaps:
        words = {gap.lower() for gap in gaps}
        values = [number for gap in gaps if (number := number_or_none(gap)) is not None]
        cells = ["" if cell.lower() in words else cell for cell in cells]
        numbers, sign = to_numbers(cells, table.lines, table.decimal, table.source, column.label)
        for value in values:
            numbers[numbers == value] = np.nan
        return numbers, sign
    return to_numbers(cells, table.lines, table.decimal, table.source, column.label)


def span_of(numbers: np.ndarray) -> str:
    """Return "low to high" of the finite numbers, for messages."""
    finite = numbers[np.isfinite(numbers)]
    return f"{finite.min():.6g} to {finite.max():.6g}" if len(finite) else "nothing"


def refuse_gaps(table: Table, column: Column, gone: np.ndarray, what: str) -> None:
    """Raise for the first row in ``gone``, which has a value but no ``what``."""
    found = np.flatnonzero(gone)
    if len(found):
        i = int(found[0])
        cell = table.rows[i][column.index]
        came = (
            f"the {what} is missing" if is_missing(cell) else f"{what} {cell[:30]!r} is not known"
        )
        raise MeasurementError(
            f"{place(table.source, table.lines[i], column.label)}: {came} in a row that has a "
            "value. Fill it in, or leave the line out with --lines A-B."
        )
