"""Columns as the text of a CSV file, with the decimal mark that a spreadsheet expects."""

from __future__ import annotations

import io
import math
from collections.abc import Iterable, Mapping
from typing import Any

from fitting.visible import visible


def _cell(value: Any, decimal: str) -> str:
    if isinstance(value, float):
        return "" if math.isnan(value) else str(value).replace(".", decimal)
    # a mark that parts cells would shift what stands behind
    return str(value).replace(",", " ").replace(";", " ")


def csv_text(comments: Iterable[str], columns: Mapping[str, Iterable[Any]], decimal: str) -> str:
    """Return columns as CSV below comment lines; what is NaN is empty.

    decimal: "." with cells parted by commas, or "," with cells parted by semicolons, as
    spreadsheets open them where the comma is the decimal mark. Numbers read back to the last bit.
    """
    mark = ";" if decimal == "," else ","
    out = io.StringIO()
    for comment in comments:
        out.write("# " + visible(" ".join(comment.split())) + "\n")
    out.write(mark.join(columns) + "\n")
    for row in zip(*columns.values(), strict=True):
        out.write(mark.join(_cell(c, decimal) for c in row) + "\n")
    return out.getvalue()
