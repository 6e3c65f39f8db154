"""Numbered lines of text as one table of cells: header, units row, comments, gaps, footers."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import NamedTuple

from fitting.errors import MeasurementError, place
from fitting.reader.cells import (
    DELIMITERS,
    decide_decimal,
    guess_delimiter,
    is_comment,
    is_missing,
    is_number,
    looks_like_data,
    split_cells,
)
from fitting.reader.header import Lines, find_header, refuse_strays, uncomment, units_row
from fitting.reader.remarks import refuse_inside, without_remark
from fitting.reader.vocabulary import LONGEST


class Table(NamedTuple):
    """Cells as text, with the number of the line that each row stands on.

    names and units have one entry per column, "" where the file gives none; ``header`` is the
    line of the names, 0 where there is none, and ``misfit`` says why a header was not taken.
    ``preamble`` holds (line, text) of what stands before the numbers, comment marks taken off.
    """

    source: str
    names: list[str]
    units: list[str]
    header: int
    misfit: str
    rows: list[list[str]]
    lines: list[int]
    preamble: list[tuple[int, str]]
    decimal: str
    notes: list[str]


def label_of(table: Table, index: int) -> str:
    """Return the name of a column, or its number from 1 where it has none."""
    return table.names[index] or str(index + 1)


def find_column(table: Table, wanted: str, option: str) -> int:
    """Return the index of the column that an option names by header or by number from 1."""
    names = table.names
    plain_name = wanted.strip().lower()
    for match in (
        [i for i, name in enumerate(names) if name and name == wanted],
        [i for i, name in enumerate(names) if name and name.lower() == plain_name],
    ):
        if len(match) > 1:
            numbers = " and ".join(str(i + 1) for i in match[:2])
            raise MeasurementError(
                f"{place(table.source, table.header)}: columns {numbers} are both named "
                f"{wanted!r}; {option} can have the number instead."
            )
        if match:
            return match[0]
    if wanted.isascii() and wanted.isdigit() and len(wanted) < 6 and 1 <= int(wanted) <= len(names):
        return int(wanted) - 1
    there = ", ".join(f"{i + 1} {name}".strip() for i, name in enumerate(names))
    raise MeasurementError(
        f"{table.source}: {option} names column {wanted!r}; the file has {there[:300]}."
    )


def _first_row(lines: Lines, delimiter: str, count: int) -> int:
    """Return the index of the first line of the table's numbers, or -1."""
    for index, (_, text) in enumerate(lines):
        if not is_comment(text, delimiter):
            cells = split_cells(text, delimiter)
            if len(cells) == count and looks_like_data(cells)[0]:
                return index
    return -1


def _body(
    source: str, lines: Lines, delimiter: str, count: int, header: str, whole: bool
) -> tuple[list[list[str]], list[int], list[tuple[int, str]], list[str]]:
    """Return rows of ``count`` cells, their lines, the remarks between and below them, and notes.

    The notes say what was left out.
    """
    rows: list[list[str]] = []
    numbers: list[int] = []
    marked = 0
    remarks: list[tuple[int, str]] = []
    texts: list[int] = []
    end = lines[-1][0]
    for line, text in lines:
        if not text or text.isspace():
            continue
        if is_comment(text, delimiter):
            if looks_like_data(split_cells(uncomment(text), delimiter))[0]:
                marked += 1
            else:
                remarks.append((line, uncomment(text)))
            continue
        cells = split_cells(text, delimiter)
        if not any(cells):
            continue
        head = cells[0][:1]
        if not (head.isdigit() or (head and head in "+-.")) and not any(map(is_number, cells)):
            if all(map(is_missing, cells)):
                continue
            # a header that is repeated on every page says nothing new
            if text.strip() != header and units_row(cells) is None:
                texts.append(line)
                remarks.append((line, text.strip()))
            continue
        if texts:
            raise MeasurementError(
                f"{place(source, texts[0])}: text stands in the middle of the numbers. If another "
                "table begins there, read one with --lines A-B; if it is a remark, mark it with #."
            )
        if len(cells) > count and not any(cells[count:]):
            cells = cells[:count]
        if len(cells) < count:
            why = " The file ends in it and may be cut short." if whole and line == end else ""
            raise MeasurementError(
                f"{place(source, line)}: {len(cells)} cell{'s' * (len(cells) > 1)} came where "
                f"{count} were wanted.{why} Complete the row (a gap is an empty cell), or leave it "
                "out with --lines A-B."
            )
        if len(cells) > count:
            raise MeasurementError(
                f"{place(source, line)}: {len(cells)} cells came where {count} were wanted. If the "
                "delimiter was misread, say --delimiter; else mend the row."
            )
        rows.append(cells)
        numbers.append(line)
    notes = []
    if marked:
        notes.append(f"{marked} commented-out row{'s' * (marked > 1)} left out")
    if texts:
        notes.append(f"text after the numbers (line {texts[0]}) left out")
    return rows, numbers, remarks, notes


def _refuse_one_column(source: str, rows: list[list[str]], lines: list[int]) -> None:
    filled = [
        i for i in range(len(rows[0]) if rows else 0) if any(not is_missing(row[i]) for row in rows)
    ]
    if len(filled) == 1:
        raise MeasurementError(
            f"{place(source, lines[0])}: only one column holds numbers ({len(rows)} rows, the "
            f"first {rows[0][filled[0]]!r}). A curve was wanted: an angle or a wavelength and a "
            "value in each row. If this file is one point of a scan, gather the points, divided "
            "by the direct beam, in a table with the header angle_deg,R_s,sigma_R_s."
        )


def _block(before: Lines, delimiter: str, count: int, line: int) -> int:
    """Return the first line of the rows that stand without a break above ``line``."""
    for number, text in reversed(before):
        cells = split_cells(text, delimiter)
        if number != line - 1 or len(cells) != count or not all(map(is_number, cells)):
            break
        line = number
    return line


def _range(source: str, option: str | None, count: int) -> tuple[int, int]:
    """Return the half-open range of indices that the option lines (10-200, 10-, -200) leaves."""
    if not option:
        return 0, count
    match = re.fullmatch(r"\s*([0-9]{0,9})\s*-\s*([0-9]{0,9})\s*", str(option))
    first, last = (match[1] or "1", match[2] or str(count)) if match else ("", "")
    if not match or not (match[1] or match[2]) or not 1 <= int(first) <= int(last):
        raise MeasurementError(
            f"{source}: --lines {option} is no range of lines such as 10-200, 10- or -200."
        )
    return int(first) - 1, int(last)


def read_table(
    source: str,
    texts: Sequence[str],
    recognise: Callable[[str], bool],
    below_thousand: Callable[[str], bool],
    *,
    delimiter: str | None = None,
    decimal: str | None = None,
    lines: str | None = None,
) -> Table:
    """Return the table of numbers that stands in ``texts``, the lines of one file.

    source: name of the file, for refusals.
    recognise: whether a header name means something; decides which line is the header.
    below_thousand: whether a header name means numbers that cannot reach a thousand.
    delimiter: tab, semicolon, comma, pipe, blank or the sign itself; None guesses by the split that
        makes the most lines rows of one length.
    decimal: "." or ","; None takes the mark that the cells show.
    lines: range of lines that may hold rows; the header may stand before it.
    Raises MeasurementError where no table is found, or a line may be part of it or not.
    """
    if delimiter is not None:
        delimiter = DELIMITERS.get(str(delimiter), str(delimiter))
        if len(delimiter) != 1 or delimiter.isalnum() or delimiter in "\r\n\"'.+-":
            names = ", ".join(DELIMITERS)
            raise MeasurementError(
                f"{source}: --delimiter {delimiter!r} is none of {names}, nor a sign."
            )
    if decimal not in (None, ".", ","):
        raise MeasurementError(f"{source}: --decimal {decimal!r} is neither . nor , (a comma).")
    if texts and (match := re.fullmatch(r'"?sep=(.)"?', texts[0].strip())) and not delimiter:
        delimiter = match[1]  # the line by which spreadsheets tell each other
    if texts and texts[0].strip() in ("sep=", "sep=\\t"):
        delimiter = delimiter or "\t"
    if delimiter is not None and delimiter == decimal:
        raise MeasurementError(
            f"{source}: --delimiter and --decimal are both {decimal!r}; one sign cannot be both."
        )
    first, last = _range(source, lines, len(texts))
    numbered = list(enumerate(texts[:last], start=1))
    inside = [(line, without_remark(text)) for line, text in numbered[first:]]
    delimiter, count = guess_delimiter([text for _, text in inside], delimiter)
    start = _first_row(inside, delimiter, count) if count else -1
    if start < 0:
        # What stands behind the last line end is no line.
        came = len(inside) - (bool(inside) and last >= len(texts) and not texts[-1])
        raise MeasurementError(
            f"{source}: no row with two numbers or more was found in {came} line{'s' * (came != 1)}"
            ". A table was wanted: a column of angles or wavelengths, one or more of R, T, psi or "
            "delta. If it is there, say --delimiter or --decimal."
        )
    before = [(line, text) for line, text in numbered[: first + start] if text.strip()]
    body = (split_cells(text, delimiter) for _, text in inside[start:])
    spare = not split_cells(inside[start][1], delimiter)[-1] and all(
        len(cells) != count or not cells[-1] for cells in body
    )
    block = _block(before, delimiter, count, first + start + 1)
    names, units, header, misfit = find_header(
        before, delimiter, count, int(spare), recognise, block
    )
    # a file that ends without a line end may have been cut in its last row
    whole = last >= len(texts) and bool(texts[-1].strip())
    head = texts[header - 1].strip() if header else ""
    rows, row_lines, remarks, notes = _body(source, inside[start:], delimiter, count, head, whole)
    below = [remark for remark in remarks if remark[0] > row_lines[-1]]
    known = [uncomment(text) for _, text in before]
    refuse_inside(source, remarks[: len(remarks) - len(below)], known, recognise, count)
    behind = [(n, texts[n - 1][len(text) :]) for n, text in inside if len(text) < len(texts[n - 1])]
    used = set(row_lines)
    refuse_inside(source, [r for r in behind if r[0] in used], known, recognise, 0)
    _refuse_one_column(source, rows, row_lines)
    refuse_strays(source, [b for b in before if b[0] > first], header, delimiter, count)
    beside = [
        (line, uncomment(text))
        for line, text in before
        if units_row(split_cells(uncomment(text), delimiter)) is None
        and (line > first or sum(map(recognise, split_cells(text, delimiter))) < 2)
    ]
    small = {i for i, name in enumerate(names) if below_thousand(name)}
    return Table(
        source=source,
        names=[name if len(name) <= LONGEST else name[:80] + "\u2026" for name in names],
        units=units,
        header=header,
        misfit=misfit,
        rows=rows,
        lines=row_lines,
        preamble=[(line, text) for line, text in beside if line != header] + below,
        decimal=decide_decimal(source, rows, row_lines, decimal, small),
        notes=notes,
    )
