"""Rows of a table that are means or deviations of its other rows."""

from __future__ import annotations

from fitting.errors import MeasurementError, place
from fitting.reader.table import Table, label_of

_STATISTICS = frozenset(
    ["mean", "avg", "average", "std", "stdev", "sd", "sigma", "error", "median"]
)
_ZONES = frozenset("05")


def refuse_computed_rows(table: Table, used: set[int]) -> None:
    """Raise where a column shows that some rows are means or deviations of others."""
    for index, name in enumerate(table.names):
        # Accurion EP3 and EP4 write the mean of the zones as zone 0, their deviation as zone 5
        zones = name.lower() == "zone"
        if index in used and not zones:
            continue
        words = _ZONES if zones else _STATISTICS
        cells = [row[index].lower() for row in table.rows]
        first = next((i for i, cell in enumerate(cells) if cell in words), -1)
        if first >= 0 and len(set(cells)) > 1:
            label = label_of(table, index)
            keep = (
                f"{name}=1,2,3,4 for the measured ones (or {name}=0)" if zones else f"{label}=WORD"
            )
            raise MeasurementError(
                f"{place(table.source, table.lines[first], label)}: {table.rows[first][index]!r} "
                "says that this row is a mean or a standard deviation of others. Say which rows to "
                f"read with --keep {keep}."
            )
