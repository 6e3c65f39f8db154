"""Labels, columns and paragraphs of plain text."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence

LABEL = 13


def wrapped(label: str, text: str, width: int) -> str:
    """Return a label and a text beside it, in lines of at most ``width`` characters."""
    return textwrap.fill(
        text,
        max(width, 40),
        initial_indent=f"  {label:<{LABEL}}",
        subsequent_indent=" " * (2 + LABEL),
        break_long_words=False,
        break_on_hyphens=False,
    )


def labelled(texts: Iterable[tuple[str, str]], width: int) -> list[str]:
    """Return labels and texts as lines below an empty one; no line at all without a text."""
    lines = [wrapped(label, text, width) for label, text in texts]
    return ["", *lines] if lines else []


def rows_aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return rows of cells as lines with the columns below each other."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    return [
        "  " + "  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip()
        for row in rows
    ]
