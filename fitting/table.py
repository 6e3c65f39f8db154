"""Numbered lines of text as one table of cells: header, units row, comments, gaps, footers."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import NamedTuple

from fitting.cells import (
    DELIMITERS,
    DIGIT,
    decide_decimal,
    guess_delimiter,
    is_comment,
    is_missing,
    is_number,
    looks_like_data,
    split_cells,
)
from fitting.errors import MeasurementError, place
from fitting.units import unit_of

_LETTER = re.compile(r"[^\W\d_]")
_RULE = re.compile(r"[\s|:=+_\-]*")  # "|---|---|" and empty cells
# a comment after the numbers; "#N/A" and its kin are gaps
_INLINE = re.compile(r"\s(?:#(?!n/?a|nv|num|value|div)|//|!)", re.IGNORECASE)

Lines = Sequence[tuple[int, str]]


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


def _uncomment(text: str) -> str:
    text = text.strip()
    if text.startswith("%") and text[1:2].isalpha():
        return text  # "%R" is a name, "% angle" a comment
    return text.lstrip('"#!;%/ ').strip() if is_comment(text, "") else text


def _first_row(lines: Lines, delimiter: str, count: int) -> int:
    """Return the index of the first line of the table's numbers, or -1."""
    candidate, earlier = -1, [""]
    for index, (_, text) in enumerate(lines):
        if is_comment(text, delimiter):
            continue
        cells = split_cells(text, delimiter)
        if len(cells) != count or not looks_like_data(cells)[0]:
            continue
        if candidate < 0:
            candidate, earlier = index, cells
            continue
        # "wavelength,45,60" above rows of numbers is a header, though two of its names are numbers
        headed = any(
            is_number(now) and not (is_number(was) or DIGIT.search(was) or is_missing(was))
            for was, now in zip(earlier, cells, strict=True)
        )
        return index if headed else candidate
    return candidate


def _split_names(text: str, delimiter: str, count: int) -> list[str]:
    """Return the header line in ``count`` names, or parted by ``delimiter`` if nothing fits."""
    # "#columns Qz R dR" of the neutron formats
    text = re.sub(r"^(?:columns?|fields|labels)\b\s*[:=]?\s*", "", text.strip(), flags=re.IGNORECASE)
    ways = [split_cells(text, delimiter)]
    ways += [split_cells(text, mark) for mark in "|\t;," if mark in text and mark != delimiter]
    ways.append([cell for cell in re.split(r"\s{2,}|\t", text) if cell])
    ways.append(re.findall(r"[^\s(\[]+(?:\s?[(\[][^)\]]*[)\]])?", text))  # "angle (deg) R_s"
    ways.append(text.split())
    for cells in ways:
        while len(cells) > count and not cells[-1]:
            cells = cells[:-1]
        if len(cells) == count:
            return cells
    return ways[0]


def _units_row(cells: list[str]) -> list[str] | None:
    units = [unit_of(cell) or "" for cell in cells]
    known = all(unit or _RULE.fullmatch(cell) for unit, cell in zip(units, cells, strict=True))
    return units if known else None


def _find_header(
    before: Lines, delimiter: str, count: int, recognise: Callable[[str], bool]
) -> tuple[list[str], list[str], int, str]:
    """Return names, units, line of the header among the lines before the numbers, and a misfit.

    The line with the most names that are recognised wins, the nearest of equals; a line without any
    is taken if it stands right above the numbers and every name in it has a letter.
    """
    nothing = [""] * count
    units, units_line, misfit = nothing, 0, ""
    best, best_line, best_known = nothing, 0, 0
    nearest = True
    for line, text in reversed(before):
        cells = _split_names(_uncomment(text), delimiter, count)
        if not any(cells):
            continue
        known = sum(map(recognise, cells))
        if len(cells) != count:
            if known >= 2 and not misfit:
                misfit = (
                    f"the header on line {line} has {len(cells)} names, the rows have {count} cells"
                )
            continue
        row = _units_row(cells)
        if row is not None:
            if not (units_line or best_line) and any(row):
                units, units_line = row, line
            continue
        words = all(not cell or _LETTER.search(cell) for cell in cells)
        if known > best_known or (nearest and words and not is_comment(text, delimiter)):
            best, best_line, best_known = cells, line, known
        nearest = nearest and is_comment(text, delimiter)
    if best_line:
        return best, units, best_line, ""
    if units_line:  # "nm,%" alone: the units are all the names that there are
        return units, nothing, units_line, misfit
    return nothing, nothing, 0, misfit


def _refuse_strays(source: str, before: Lines, header: int, delimiter: str, count: int) -> None:
    """Raise if a line between the header and the numbers, or right above them, may be a broken row."""
    last = before[-1][0] if before else 0
    for line, text in before:
        if line == header or not (last == line or line > header > 0) or is_comment(text, delimiter):
            continue
        cells = split_cells(text, delimiter)
        digits = sum(DIGIT.search(cell) is not None for cell in cells)
        if len(cells) == count and 2 * digits >= (1 if header else count) and not _units_row(cells):
            raise MeasurementError(
                f"{place(source, line)}: {text.strip()[:60]!r} stands before the numbers and is "
                f"neither a header nor a row of {count} numbers. Mend it, mark it with #, or start "
                f"below it with --lines {line + 1}-."
            )


def _body(
    source: str, lines: Lines, delimiter: str, count: int, header: str, whole: bool
) -> tuple[list[list[str]], list[int], list[str]]:
    """Return rows of ``count`` cells, their lines, and notes on what was left out or filled up."""
    rows: list[list[str]] = []
    numbers: list[int] = []
    marked = short = 0
    texts: list[int] = []
    gap = len(lines) and lines[-1][0]
    for line, text in lines:
        if not text or text.isspace():
            continue
        if is_comment(text, delimiter):
            marked += looks_like_data(split_cells(_uncomment(text), delimiter))[0]
            continue
        if "#" in text or "//" in text or "!" in text:
            text = _INLINE.split(text, maxsplit=1)[0]
        cells = split_cells(text, delimiter)
        if not any(cells):
            continue
        head = cells[0][:1]
        if not (head.isdigit() or (head and head in "+-.")) and not any(map(is_number, cells)):
            if all(map(is_missing, cells)):
                continue
            # a header that is repeated on every page says nothing new
            if text.strip() != header and _units_row(cells) is None:
                texts.append(line)
            continue
        if texts:
            raise MeasurementError(
                f"{place(source, texts[0])}: text stands in the middle of the numbers. If another "
                f"table begins there, read one with --lines A-B; if it is a remark, mark it with #."
            )
        if len(cells) > count and not any(cells[count:]):
            cells = cells[:count]
        if len(cells) < count:
            cut = whole and line == gap
            if cut or delimiter == " " or len(cells) < 2:
                why = " The file ends in it and may be cut short." if cut else ""
                raise MeasurementError(
                    f"{place(source, line)}: {len(cells)} cell{'s' * (len(cells) > 1)} came where {count} "
                    f"were wanted.{why} Complete the row, or leave it out with --lines A-B."
                )
            short += 1
            cells += [""] * (count - len(cells))
        elif len(cells) > count:
            raise MeasurementError(
                f"{place(source, line)}: {len(cells)} cells came where {count} were wanted. If the "
                "delimiter was misread, say --delimiter; else mend the row."
            )
        rows.append(cells)
        numbers.append(line)
    notes = []
    if marked:
        notes.append(f"{marked} commented-out row{'s' * (marked > 1)} left out")
    if short:
        notes.append(f"{short} row{'s' * (short > 1)} with fewer cells filled with gaps")
    if texts:
        notes.append(f"text after the numbers (line {texts[0]}) left out")
    return rows, numbers, notes


def _refuse_one_column(source: str, rows: list[list[str]], lines: list[int]) -> None:
    filled = [i for i in range(len(rows[0])) if any(not is_missing(row[i]) for row in rows)]
    if len(filled) == 1:
        raise MeasurementError(
            f"{place(source, lines[0])}: the numbers stand in one column only ({len(rows)} rows, the "
            f"first {rows[0][filled[0]]!r}). A curve was wanted: an angle or a wavelength and a value in "
            "each row. If this file is one point of a scan, gather the points, divided by the direct "
            "beam, in a table with the header angle_deg,R_s,sigma_R_s."
        )


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
    *,
    delimiter: str | None = None,
    decimal: str | None = None,
    lines: str | None = None,
) -> Table:
    """Return the table of numbers that stands in ``texts``, the lines of one file.

    source: name of the file, for refusals.
    recognise: whether a header name means something; decides which line is the header.
    delimiter: tab, semicolon, comma, pipe, blank or the sign itself; None guesses by the split that
        makes the most lines rows of one length.
    decimal: "." or ","; None takes the mark that the cells show.
    lines: range of lines that may hold rows; the header may stand before it.
    Raises MeasurementError where no table is found, or a line may be part of it or not.
    """
    if delimiter is not None:
        delimiter = DELIMITERS.get(delimiter, delimiter)
        if len(delimiter) != 1 or delimiter.isalnum() or delimiter in "\r\n\"'.+-":
            names = ", ".join(DELIMITERS)
            raise MeasurementError(f"{source}: --delimiter {delimiter!r} is none of {names}, nor a sign.")
    if decimal not in (None, ".", ","):
        raise MeasurementError(f"{source}: --decimal {decimal!r} is neither . nor , (a comma).")
    if texts and (match := re.fullmatch(r'"?sep=(.)"?', texts[0].strip())) and not delimiter:
        delimiter = match[1]  # the line by which spreadsheets tell each other
    if texts and texts[0].strip() in ("sep=", "sep=\\t"):
        delimiter = delimiter or "\t"
    first, last = _range(source, lines, len(texts))
    numbered = list(enumerate(texts[:last], start=1))
    inside = numbered[first:]
    delimiter, count = guess_delimiter([text for _, text in inside], delimiter)
    start = _first_row(inside, delimiter, count) if count else -1
    if start < 0:
        raise MeasurementError(
            f"{source}: no row with two numbers or more was found in {len(inside)} lines. A table "
            "was wanted: a column of angles or wavelengths, one or more of R, T, psi or delta. If it is "
            "there, say --delimiter or --decimal."
        )
    before = [(line, text) for line, text in numbered[: first + start] if text.strip()]
    names, units, header, misfit = _find_header(before, delimiter, count, recognise)
    # a file that ends without a line end may have been cut in its last row
    whole = last >= len(texts) and bool(texts[-1].strip())
    head = texts[header - 1].strip() if header else ""
    rows, row_lines, notes = _body(source, inside[start:], delimiter, count, head, whole)
    _refuse_one_column(source, rows, row_lines)
    _refuse_strays(source, [b for b in before if b[0] > first], header, delimiter, count)
    return Table(
        source=source,
        names=names,
        units=units,
        header=header,
        misfit=misfit,
        rows=rows,
        lines=row_lines,
        preamble=[(line, _uncomment(text)) for line, text in before if line != header],
        decimal=decide_decimal(source, rows, row_lines, decimal),
        notes=notes,
    )
