"""The text formats that are no plain tables: each is asked in turn whether a file is its own."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from fitting.reader import woollam

Lines = tuple[list[str], list[str]]
FORMATS: tuple[Callable[[Sequence[str]], Lines | None], ...] = (woollam.as_plain_table,)
"""Functions from the lines of a file to those of a plain table with a header, as many of them (so
that line numbers stay), and sentences on how they were read; None for a file of another kind."""


def plain_table(texts: Sequence[str]) -> Lines | None:
    """Return the lines of a plain table and notes, from the first format that knows the file."""
    return next((found for each in FORMATS if (found := each(texts)) is not None), None)
