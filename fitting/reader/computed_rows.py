"""Rows of a table that are means or deviations of its other rows."""

from __future__ import annotations

from fitting.errors import MeasurementError, place
from fitting.reader.table import Table, label_of

_STATISTICS = frozenset(
    ["mean", "avg", "average", "std", "stdev", "sd", "sigma", "error", "median"]
)


def refuse_computed_rows(table: Table, used: set[int]) -> None:
    """Raise where a column shows that some rows are means or deviations of others."""
    for index, name in enumerate(table.names):
        cells = {row[index].lower() for row in table.rows}
        label = label_of(table, index)
        if name.lower() == "zone" and cells & {"0", "5"} and len(cells) > 1:
            # Accurion EP3 and EP4 write the mean of the zones as zone 0, their deviation as zone 5
            line = next(
                n
                for row, n in zip(table.rows, table.lines, strict=True)
                if row[index] in ("0", "5")
            )
            raise MeasurementError(
                f"{place(table.source, line, label)}: zones 0 and 5 are means and standard "
                f"deviations of the other rows. Say --keep {name}=1,2,3,4 for the measured ones "
                f"(or {name}=0)."
            )
        if index not in used and cells & _STATISTICS and len(cells) > 1:
            word = sorted(cells & _STATISTICS)[0]
            line = next(
                n
                for row, n in zip(table.rows, table.lines, strict=True)
                if row[index].lower() == word
            )
            raise MeasurementError(
                f"{place(table.source, line, label)}: the word {word!r} says that this row is "
                f"computed from others. Say which rows to read with --keep {label}=WORD."
            )
