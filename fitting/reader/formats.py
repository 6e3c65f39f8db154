"""Files that are no plain tables: which format it is, and the table that it holds."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from fitting.reader import film_sense, jcamp, perkin_elmer, spectraray, woollam
from fitting.reader.options import Options
from fitting.reader.table import Table, read_table

FORMATS: tuple[Callable, ...] = (
    film_sense.as_plain_table,
    jcamp.as_plain_table,
    perkin_elmer.as_plain_table,
    spectraray.as_plain_table,
    woollam.as_plain_table,
)
"""What knows the text formats that are no plain tables. Each takes the lines of a file and returns
those of a plain table with a header, each with the number of the line of the file from which it
comes, and sentences on how they were read; None for a file of another kind."""


def read_formatted(texts: Sequence[str], options: Options) -> Table:
    """Return the table of numbers in the lines of a file of any known format."""
    for each in FORMATS:
        found = each(texts, options.ignore) if each is woollam.as_plain_table else each(texts)
        if found:
            plain, notes = found
            table = read_table(plain, options)
            return table._replace(notes=table.notes + notes)
    return read_table(list(enumerate(texts, start=1)), options)
