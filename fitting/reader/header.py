"""The lines above the numbers: which one names the columns, which gives their units."""

from __future__ import annotations

import re
from collections.abc import Sequence

from fitting.data.errors import refuse
from fitting.reader.cells import (
    DIGIT,
    is_comment,
    is_missing,
    is_number,
    looks_like_data,
    split_cells,
)
from fitting.reader.evidence import statements
from fitting.reader.names import role_of
from fitting.reader.vocabulary import unit_of

_LETTER = re.compile(r"[^\W\d_]")
_RULE = re.compile(r"[\s|:=+_\-]*")  # "|---|---|" and empty cells
# "#columns Qz R dR" of the neutron formats
_KEYWORD = re.compile(r"^(?:columns?|fields|labels)\b\s*[:=]?\s*", re.IGNORECASE)

Lines = Sequence[tuple[int, str]]


def uncomment(text: str) -> str:
    """Return a line of comment without its mark, any other stripped."""
    text = text.strip()
    if text.startswith("%") and text[1:2].isalpha():
        return text  # "%R" is a name, "% angle" a comment
    if text.strip('"#!;/ ') == "%" != text:
        return "%"  # "# %": the unit of the values
    return text.lstrip('"#!;%/ ').strip() if is_comment(text, "") else text


def split_names(text: str, delimiter: str, count: int) -> list[str]:
    """Return the header line in ``count`` names, or parted by ``delimiter`` if nothing fits."""
    text = _KEYWORD.sub("", text.strip(" \r\n"))  # a tab at the end parts a last, empty name
    ways = [split_cells(text, mark) for mark in delimiter + "|\t;,"]
    ways.append([cell for cell in re.split(r"\s{2,}|\t", text) if cell])
    words = re.findall(r"[^\s(\[]+(?:\s?[(\[][^()\[\]]*[)\]])?", text)  # "angle (deg) R_s"
    if delimiter == " " or len(ways[0]) == 1 or known_names(words) == count:
        ways.append(words)  # else "R parallel" would be two names
    if '"' in text and len(ways[0]) == count - 1:
        return ["", *ways[0]]  # R does not name the column of the names of rows
    for cells in ways:
        if len(cells) >= count and not any(cells[count:]):
            return cells[:count]
    return ways[0]


def known_names(cells: list[str]) -> int:
    """Return how many of the cells are names of columns."""
    return sum(bool(role_of(cell).kind) for cell in cells)


def below_thousand(names: list[str], units: list[str]) -> set[int]:
    """Return the columns whose numbers are below 1000 by their names: percent, degrees, ..."""
    roles = [role_of(name, unit) for name, unit in zip(names, units, strict=True)]
    return {
        i for i, role in enumerate(roles)
        if (role.kind in ("value", "sigma") and role.unit in ("percent", "1", "deg", "rad"))
        or (role.kind == "angle" and role.unit in ("deg", "rad"))
        or role.kind == "index"
    }  # fmt: skip


def units_row(cells: list[str]) -> list[str] | None:
    """Return the units in a row that holds nothing else, "" for a rule or a gap; else None.

    Among more that are known a unit may be as it is spelled, where it is no name of a column.
    """
    units = [unit_of(cell) or "" for cell in cells]
    unknown = [c for c, u in zip(cells, units, strict=True) if not (u or _RULE.fullmatch(c))]
    few = len(unknown) < len([*filter(None, units)])
    if unknown and not (few and not known_names(unknown) and not any(map(is_number, unknown))):
        return None
    return [cell if cell in unknown else unit for cell, unit in zip(cells, units, strict=True)]


def find_header(
    before: Lines, delimiter: str, count: int, top: int
) -> tuple[list[str], list[str], int]:
    """Return names, units and the line of the header among the lines before the numbers.

    The line with the most names that are known wins, the nearest of equals; a line without any
    is taken if it stands right above the numbers and every name in it has a letter.
    top: line of the first row.
    """
    units, units_line = [""] * count, 0
    best, best_line, best_known = [""] * count, 0, 0
    nearest = True
    for line, text in reversed(before):
        marked, row = is_comment(text, delimiter), split_cells(text, delimiter)
        if line >= top - 1 and all(is_number(cell) or is_missing(cell) for cell in row):
            top = line  # a row of the same table, which --lines leaves out
            continue
        if not (nearest or marked) and looks_like_data(row)[0]:
            break  # what stands above other numbers is their header
        cells = split_names(uncomment(text) if marked else text, delimiter, count)
        here = units_row(cells) if len(cells) == count else None
        adjacent, nearest = nearest, nearest and (marked or here is not None)
        if here is not None:
            if not (units_line or best_line) and any(here):
                units, units_line = here, line
        elif len(cells) == count:
            known = known_names(cells)
            words = all(not cell or _LETTER.search(cell) for cell in cells)
            if known > best_known or (adjacent and words and not marked):
                best, best_line, best_known = cells, line, known
    return best, units, best_line


def refuse_strays(before: Lines, header: int, delimiter: str, count: int) -> None:
    """Raise if a line between the header and the numbers, or right above, may be a broken row."""
    last = before[-1][0] if before else 0
    for line, text in before:
        if line == header or not (last == line or line > header > 0) or is_comment(text, delimiter):
            continue
        cells = split_cells(text, delimiter)
        digits = sum(DIGIT.search(cell) is not None for cell in cells)
        if not header:  # settings such as "Int.Time2:0.0" may stand there
            like_a_row = any(map(is_number, cells)) or len(cells) == count
            digits *= 2 * digits >= len(cells) >= 2 and like_a_row
        if digits and not units_row(cells):
            refuse(
                f"{text.strip()[:60]!r} stands before the numbers and is neither a header nor a "
                f"row of {count} numbers. Correct it, mark it with #, or start below it with "
                f"--lines {line + 1}-.",
                line,
            )


def refuse_between(remarks: Lines, before: list[str], count: int) -> None:
    """Refuse a remark between the rows that says what the rows below it are.

    before: the lines above the numbers, which a page may repeat.
    """
    for line, text in remarks:
        other = known_names(split_names(text, "", count)) >= 2
        if text not in before and (other or statements(line, text)):
            refuse(
                f"{text[:60]!r} stands between the numbers, and may say that another measurement "
                "begins. Read one of them with --lines A-B.",
                line,
            )
