"""Columns that are not read: which of them a fit may do without."""

from __future__ import annotations

import re

from fitting.data.checks import all_alike, is_running
from fitting.reader.cells import is_missing, is_number
from fitting.reader.names import Role, role_of
from fitting.reader.table import Table
from fitting.reader.vocabulary import light_of_cell


def _is_harmless(table: Table, index: int, role: Role, constants: bool, axes: list[int]) -> bool:
    """Return whether a fit may do without a column: nothing of the measurement is in it."""
    cells = [row[index] for row in table.rows]
    if is_running(cells):  # and is not the axis itself
        return len({tuple(row[i] for i in axes) for row in table.rows}) > 1
    means = role.quantity or light_of_cell(cells[0]) or role_of(cells[0]).quantity
    alike = all_alike(cells) and (constants or not is_number(cells[0]))
    return role.kind == "aside" or bool(alike and not means)


def left_out(
    table: Table, columns: dict[int, Role], axes: list[int], constants: bool = True
) -> dict[int, str]:
    """Return what each of the columns may be that are not read but may hold something of use.

    Constant columns, running numbers and what is nothing to be fitted may be left out.
    axes: columns that tell the rows apart. constants: whether numbers that are the same in all
    rows may be left out.
    """
    lost = {}
    for index, role in columns.items():
        if _is_harmless(table, index, role, constants, axes):
            continue
        cells = [row[index] for row in table.rows]
        why = role.why if role.why.startswith("it ") else ""
        lost[index] = re.sub("^it (is|may be) ", "", why) or (
            "an axis, a value or its standard error under a name or in a unit that is not known"
            if all(is_number(cell) or is_missing(cell) for cell in cells)
            else "the polarization, or the name of a sample"
        )
    return lost


def came_in(table: Table, index: int) -> str:
    """Return the first cells of a column, for messages."""
    cells = list(dict.fromkeys(row[index][:20] for row in table.rows))
    return ", ".join(cells[:3]) + ", ..." * (len(cells) > 3)
