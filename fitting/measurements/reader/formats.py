"""Files that are no plain tables: which format it is, and its table with the lines of the file."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Sequence

from fitting.measurements.reader import film_sense, jcamp, perkin_elmer, spectraray, woollam
from fitting.measurements.reader.table import Form, Table, line_range, read_table

FORMATS = (
    film_sense.as_plain_table,
    jcamp.as_plain_table,
    perkin_elmer.as_plain_table,
    spectraray.as_plain_table,
    woollam.as_plain_table,
)
"""What knows the text formats that are no plain tables. Each takes the lines of a file and returns
those of a plain table with a header, and sentences on how they were read; None for a file of
another kind. Where a line of the file holds several rows, a third list has the number of the line
from which each line of the table comes. What they refuse, they refuse with its line."""


def read_formatted(texts: Sequence[str], form: Form) -> Table:
    """Return the table of numbers in a file of any known format; arguments as of `read_table`."""
    for each in FORMATS:
        if (found := each(texts)) is not None:
            break
    else:
        return read_table(texts, form)
    plain, notes, *rest = found
    numbers: Sequence[int] = rest[0] if rest else range(1, len(plain) + 1)
    if form.lines and rest:  # a range of lines of the file
        first, last = line_range(form.lines, len(texts))
        first, last = bisect_left(numbers, first + 1) + 1, max(1, bisect_right(numbers, last))
        form = form._replace(lines=f"{first}-{last}")
    table = read_table(plain, form)
    return table._replace(
        header=numbers[table.header - 1] if table.header else 0,
        lines=[numbers[i - 1] for i in table.lines],
        preamble=[(numbers[i - 1], text) for i, text in table.preamble],
        notes=table.notes + notes,
    )
