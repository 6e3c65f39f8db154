"""Numbered lines of text as one table of cells: header, units row, comments, gaps, footers.

First the cells: where a line parts into them, which are numbers, and which numbers they are.
"""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple, NoReturn

import numpy as np

from fitting.data.errors import refuse
from fitting.reader.names import LONGEST, role_of, unit_of
from fitting.reader.options import DELIMITERS, Options
from fitting.reader.remarks import statements

MISSING = frozenset([
    "", "nan", "na", "n/a", "#n/a", "#na", "#nv", "#num!", "#value!", "#div/0!", "null", "none",
    "nil", "nd", "n.d.", "-", "--", "---", ".", "?", "*", "/",
])  # fmt: skip
DIGIT = re.compile("[0-9]")
_NUMBER = re.compile(
    "[+\\-\u2212]?(?:[0-9]+(?:[.,][0-9]*)?|[.,][0-9]+)(?:[eEdD][+\\-\u2212]?[0-9]+)?(?:\\s?[%\u00b0])?"
)
_WORD = re.compile(r"[^\W\d_]{2}")
_PLAIN = re.compile(r"[0-9.eE+\-]*")
_GROUPED = re.compile(r"[+-]?[1-9][0-9]{0,2},[0-9]{3}")
_COMMENT = ("#", '"#', "%", "!", "//")
_SAMPLE = 48  # lines looked at for the delimiter: all of a short file, an even sample of a long one
_LETTER = re.compile(r"[^\W\d_]")
_RULE = re.compile(r"[\s|:=+_\-]*")  # "|---|---|" and empty cells
# "#columns Qz R dR" of the neutron formats
_KEYWORD = re.compile(r"^(?:columns?|fields|labels)\b\s*[:=]?\s*", re.IGNORECASE)

Lines = Sequence[tuple[int, str]]
# The columns of a file are compared with one another: of 1,000 this takes two seconds.
MOST_COLUMNS = 1000


def is_comment(text: str, delimiter: str) -> bool:
    """Return whether the line begins with a comment mark: # % ! // and, if no delimiter, ;."""
    text = text.lstrip()
    return text.startswith(_COMMENT) or (text.startswith(";") and delimiter != ";")


def split_cells(line: str, delimiter: str) -> list[str]:
    """Return the stripped cells of ``line``; quotes protect a delimiter, blanks come in runs."""
    if delimiter == " ":
        if '"' not in line:
            return line.split()
        line = " ".join(line.split())
    if delimiter == "|":
        line = line.strip().removeprefix("|").removesuffix("|")
    if '"' in line:
        try:
            cells = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [""])
        except csv.Error:
            cells = line.replace('"', "").split(delimiter)
        return [cell.strip() for cell in cells]
    return [cell.strip() for cell in line.split(delimiter)]


def is_number(cell: str) -> bool:
    """Return whether ``cell`` reads as a number with a point or a comma, percent or degree sign."""
    return _NUMBER.fullmatch(cell) is not None


def is_missing(cell: str) -> bool:
    """Return whether ``cell`` says that nothing was measured: empty, NaN, n/a, a dash."""
    return cell.lower() in MISSING


def number_or_none(text: str) -> float | None:
    """Return the number that ``text`` is, with a point or a comma; None where it is none."""
    try:
        return float(text.replace(",", "."))
    except ValueError:
        return None


def looks_like_data(cells: list[str]) -> tuple[bool, int]:
    """Return whether cells could be a row of a table, and how many mix digits with other signs.

    A row has two numbers, or one and gaps.
    """
    numbers = gaps = odd = 0
    for cell in cells:
        if is_number(cell):
            numbers += 1
        elif is_missing(cell):
            gaps += 1
        elif DIGIT.search(cell) and not _WORD.search(cell):  # "0 92", not the label "gold 1"
            odd += 1
    return numbers >= 2 or (numbers == 1 and len(cells) == 1 + gaps >= 2), odd


def guess_delimiter(texts: Sequence[str], wanted: str | None) -> tuple[str, int]:
    """Return the delimiter and number of cells that make the most lines rows; 0 cells if none do.

    Ties go to the first of ``DELIMITERS``: blanks also part a tabbed file, but lose its gaps.
    """
    full = [text for text in texts if text and not text.isspace()]
    step = max(1, len(full) // _SAMPLE)
    sample = full[::step] + (full[-8:] if step > 1 else [])
    best, best_score = (wanted or ",", 0), 0
    for delimiter in [wanted] if wanted else DELIMITERS.values():
        votes: Counter[int] = Counter()
        for text in sample:
            if (delimiter != " " and delimiter not in text) or is_comment(text, delimiter):
                continue
            cells = split_cells(text, delimiter)
            data, odd = looks_like_data(cells)
            if data:
                # an odd cell such as "0 92" shows that blanks, not this mark, part the numbers
                votes[len(cells)] += 1 if odd else 2
        if votes:
            count, score = max(votes.items(), key=lambda item: (item[1], item[0]))
            if score > best_score:
                best, best_score = (delimiter, count), score
    return best


def decide_decimal(
    rows: list[list[str]], lines: list[int], wanted: str | None, small: set[int]
) -> str:
    """Return the decimal mark that the cells show; raise where they show both, or leave it open.

    small: the columns whose numbers cannot reach a thousand, so that 10,123 there is 10.123.
    """
    if wanted:
        return wanted
    numbered = list(zip(lines, rows, strict=True))
    commas = [(n, c) for n, row in numbered for c in row if "," in c and is_number(c)]
    points = (n for n, row in numbered for c in row if "." in c and "," not in c and is_number(c))
    if not commas:
        return "."
    comma, point = commas[0][0], next(points, 0)
    if point:
        refuse(
            f"the decimal mark is a comma on line {comma} and a point on line {point}. Write all "
            "numbers with one of them, or leave lines out with --lines A-B."
        )
    sure = any("," in row[i] for row in rows for i in small)
    if not sure and all(_GROUPED.fullmatch(cell) for _, cell in commas):
        refuse(
            "a comma before three digits may be a decimal mark or separate thousands. Say "
            "--decimal , if it is the decimal mark; else write the numbers without it.",
            comma,
        )
    return ","


def to_numbers(
    cells: list[str], lines: list[int], decimal: str, column: str
) -> tuple[np.ndarray, str]:
    """Return the cells as float64, NaN where one says missing, and the sign (% or degree) on them.

    A number is ``float`` of its text, to the last bit, after the decimal mark and a Fortran
    exponent letter were made Python's. Refuses the first cell that is neither.
    """
    joined = "".join(cells)
    if "" not in cells and _PLAIN.fullmatch(joined) and (decimal == "." or "." not in joined):
        try:
            return np.array([float(cell) for cell in cells]), ""
        except ValueError:
            pass
    other = "." if decimal == "," else ","
    numbers: list[float] = []
    signs: dict[str, int] = {}
    for cell, line in zip(cells, lines, strict=True):
        if is_missing(cell):
            numbers.append(np.nan)
            continue
        if not is_number(cell) or other in cell:
            hint = f" (the decimal mark is {decimal!r})" if is_number(cell) else ""
            refuse(
                f"{cell[:40]!r} came where a number was wanted{hint}. Correct it, or leave the "
                "cell empty if nothing was measured.",
                line,
                column,
            )
        signs.setdefault(cell[-1] if cell[-1] in "%\u00b0" else "", line)
        text = cell.rstrip("%\u00b0 ").replace("\u2212", "-").replace(",", ".")
        numbers.append(float(text.replace("d", "e").replace("D", "e")))
    if len(signs) > 1:
        refuse(
            f"some numbers of this column have the sign {max(signs)}, others do not. Write all of "
            "them alike.",
            max(signs.values()),
            column,
        )
    return np.array(numbers), max(signs, default="")


class Table(NamedTuple):
    """Cells as text, with the number of the line that each row stands on.

    names and units have one entry per column, "" where the file gives none; ``header`` is the
    line of the names, 0 where there is none.
    ``preamble`` holds (line, text) of what stands before the numbers, comment marks taken off;
    ``filled`` the columns that hold anything at all.
    """

    names: list[str]
    units: list[str]
    header: int
    rows: list[list[str]]
    lines: list[int]
    preamble: list[tuple[int, str]]
    decimal: str
    notes: list[str]
    filled: list[int]

    @property
    def top(self) -> int:
        """The line of the names, or of the first row."""
        return self.header or self.lines[0]

    def label(self, index: int) -> str:
        """Return the name of a column, or its number from 1 where it has none."""
        return self.names[index] or str(index + 1)

    def cells(self, index: int) -> list[str]:
        """Return the cells of a column."""
        return [row[index] for row in self.rows]

    def refuse(self, text: str, column: str = "") -> NoReturn:
        """Refuse at the line of the names, or at the name of a column."""
        refuse(text, self.top, column)

    def came_in(self, index: int) -> str:
        """Return the first cells of a column, for messages."""
        cells = list(dict.fromkeys(cell[:20] for cell in self.cells(index)))
        return ", ".join(cells[:3]) + ", ..." * (len(cells) > 3)

    def find(self, wanted: str) -> int:
        """Return the index of the column that --columns names by header or by number from 1."""
        names, low = self.names, wanted.strip().lower()
        match = [i for i, name in enumerate(names) if name and name == wanted]
        match = match or [i for i, name in enumerate(names) if name and name.lower() == low]
        if len(match) > 1:
            numbers = " and ".join(str(i + 1) for i in match[:2])
            refuse(
                f"columns {numbers} are both named {wanted!r}; give --columns the number of one "
                "instead.",
                self.header,
            )
        if match:
            return match[0]
        if re.fullmatch("[0-9]{1,5}", wanted) and 1 <= int(wanted) <= len(names):
            return int(wanted) - 1
        there = ", ".join(f"{i + 1} {name}".strip() for i, name in enumerate(names))
        refuse(
            f"--columns names column {wanted!r}, which the file does not have. Its columns are "
            f"{there[:300]}."
        )


def uncomment(text: str) -> str:
    """Return a line of comment without its mark, any other stripped."""
    text = text.strip()
    if text.startswith("%") and text[1:2].isalpha():
        return text  # "%R" is a name, "% angle" a comment
    if text.strip('"#!;/ ') == "%" != text:
        return "%"  # "# %": the unit of the values
    return text.lstrip('"#!;%/ ').strip() if is_comment(text, "") else text


def _split_names(text: str, delimiter: str, count: int) -> list[str]:
    """Return the header line in ``count`` names, or parted by ``delimiter`` if nothing fits."""
    text = _KEYWORD.sub("", text.strip(" \r\n"))  # a tab at the end parts a last, empty name
    ways = [split_cells(text, mark) for mark in delimiter + "|\t;,"]
    ways.append([cell for cell in re.split(r"\s{2,}|\t", text) if cell])
    words = re.findall(r"[^\s(\[]+(?:\s?[(\[][^()\[\]]*[)\]])?", text)  # "angle (deg) R_s"
    if delimiter == " " or len(ways[0]) == 1 or _known_names(words) == count:
        ways.append(words)  # else "R parallel" would be two names
    if '"' in text and len(ways[0]) == count - 1:
        return ["", *ways[0]]  # R does not name the column of the names of rows
    for cells in ways:
        if len(cells) >= count and not any(cells[count:]):
            return cells[:count]
    return ways[0]


def _known_names(cells: list[str]) -> int:
    """Return how many of the cells are names of columns."""
    return sum(bool(role_of(cell).kind) for cell in cells)


def _units_row(cells: list[str]) -> list[str] | None:
    """Return the units in a row that holds nothing else, "" for a rule or a gap; else None.

    Among more that are known a unit may be as it is spelled, where it is no name of a column.
    """
    units = [unit_of(cell) or "" for cell in cells]
    unknown = [c for c, u in zip(cells, units, strict=True) if not (u or _RULE.fullmatch(c))]
    few = len(unknown) < len([*filter(None, units)])
    if unknown and not (few and not _known_names(unknown) and not any(map(is_number, unknown))):
        return None
    return [cell if cell in unknown else unit for cell, unit in zip(cells, units, strict=True)]


def _find_header(
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
        cells = _split_names(uncomment(text) if marked else text, delimiter, count)
        here = _units_row(cells) if len(cells) == count else None
        adjacent, nearest = nearest, nearest and (marked or here is not None)
        if here is not None:
            if not (units_line or best_line) and any(here):
                units, units_line = here, line
        elif len(cells) == count:
            known = _known_names(cells)
            words = all(not cell or _LETTER.search(cell) for cell in cells)
            if known > best_known or (adjacent and words and not marked):
                best, best_line, best_known = cells, line, known
    return best, units, best_line


def _refuse_strays(before: Lines, header: int, delimiter: str, count: int) -> None:
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
        if digits and not _units_row(cells):
            refuse(
                f"{text.strip()[:60]!r} stands before the numbers and is neither a header nor a "
                f"row of {count} numbers. Correct it, mark it with #, or start below it with "
                f"--lines {line + 1}-.",
                line,
            )


def _body(
    lines: Lines, delimiter: str, count: int, header: str
) -> tuple[list[list[str]], list[int], list[tuple[int, str]], list[str]]:
    """Return rows of ``count`` cells, their lines, the remarks beside, and what was left out."""
    rows: list[list[str]] = []
    numbers: list[int] = []
    remarks: list[tuple[int, str]] = []
    marked, texts = 0, 0  # rows behind a comment mark; line of the first text
    for line, text in lines:
        cells = split_cells(text, delimiter)
        if is_comment(text, delimiter):
            if looks_like_data(split_cells(uncomment(text), delimiter))[0]:
                marked += 1
            else:
                remarks.append((line, uncomment(text)))
            continue
        head = next(iter(cells), "")[:1]
        if not (head.isdigit() or (head and head in "+-.")) and not any(map(is_number, cells)):
            # gaps, or a header that is repeated on every page, say nothing new
            said = not all(map(is_missing, cells)) and text.strip() != header
            if said and _units_row(cells) is None:
                texts = texts or line
                remarks.append((line, text.strip()))
            continue
        if texts:
            refuse(
                "text stands in the middle of the numbers. If another table begins there, read "
                "one with --lines A-B; if it is a remark, mark it with #.",
                texts,
            )
        if not any(cells[count:]):
            cells = cells[:count]
        if len(cells) != count:
            why = "If the delimiter was misread, say --delimiter; else correct the row."
            if len(cells) < count:
                why = "It may be cut short. Complete it (a gap is an empty cell), or leave it out "
                why += "with --lines A-B."
            refuse(
                f"{len(cells)} cell{'s' * (len(cells) > 1)} came where {count} were wanted. {why}",
                line,
            )
        rows.append(cells)
        numbers.append(line)
    notes = [f"{marked} commented-out row{'s' * (marked > 1)} left out"] * bool(marked)
    notes += [f"text after the numbers (line {texts}) left out"] * bool(texts)
    return rows, numbers, remarks, notes


def read_table(numbered: Lines, options: Options) -> Table:
    """Return the table of numbers in the lines of one file, each with its number."""
    first, last = options.lines
    inside = [(line, text) for line, text in numbered if first <= line <= last]
    mark, count = guess_delimiter([text for _, text in inside], options.delimiter)
    splits = ((i, split_cells(text, mark)) for i, (_, text) in enumerate(inside)
              if count and not is_comment(text, mark))  # fmt: skip
    start = next((i for i, row in splits if len(row) == count and looks_like_data(row)[0]), None)
    if start is None:
        came = len(inside)
        refuse(
            f"no row with two numbers or more was found in {came} line{'s' * (came != 1)}. A "
            "table was wanted: a column of angles or wavelengths, and one or more of R, T, psi or "
            "delta. If there is one, say how to read it with --delimiter or --decimal."
        )
    if count > MOST_COLUMNS:
        refuse(
            f"{count} columns came, and {MOST_COLUMNS} are the most that are read. Give those that "
            "belong to one measurement as a file of its own, or say --delimiter if the cells were "
            "parted at the wrong sign.",
            inside[start][0],
        )
    above = sum(line < first for line, _ in numbered) + start
    before = [(line, text) for line, text in numbered[:above] if text.strip()]
    names, units, header = _find_header(before, mark, count, inside[start][0])
    body = [(line, text) for line, text in inside[start:] if text.strip()]
    head = dict(before).get(header, "").strip()
    rows, row_lines, remarks, notes = _body(body, mark, count, head)
    filled = [i for i in range(count) if any(not is_missing(row[i]) for row in rows)]
    if len(filled) == 1:
        refuse(
            f"only one column holds numbers ({len(rows)} rows, the first {rows[0][filled[0]]!r}). "
            "A curve was wanted: an angle or a wavelength and a value in each row. If this file "
            "is one point of a scan, gather the points, divided by the direct beam, in a table "
            "with the header angle_deg,R_s,sigma_R_s.",
            row_lines[0],
        )
    below = [remark for remark in remarks if remark[0] > row_lines[-1]]
    known = [uncomment(text) for _, text in before]  # which a page may repeat
    for line, text in remarks[: len(remarks) - len(below)]:
        header_like = _known_names(_split_names(text, "", count)) >= 2
        if text not in known and (header_like or statements(line, text)):
            refuse(
                f"{text[:60]!r} stands between the numbers, and may say that another measurement "
                "begins. Read one of them with --lines A-B.",
                line,
            )
    _refuse_strays([b for b in before if b[0] >= first], header, mark, count)
    beside = []
    for line, text in before:
        cells = split_cells(uncomment(text), mark)
        row = _units_row(cells)
        # units of all columns were taken; one unit alone is said of the whole measurement
        says = row is None or (any(row) and len(cells) != count)
        if line != header and says and (line >= first or _known_names(cells) < 2):
            beside.append((line, uncomment(text)))
    small = set()  # columns of numbers below 1000 by their names: percent, degrees, an index
    for i, role in enumerate(map(role_of, names, units)):
        sized = ("percent", "1", "deg", "rad") if role.kind in ("value", "sigma") else ()
        sized = ("deg", "rad") if role.kind == "angle" else sized
        if role.kind == "index" or role.unit in sized:
            small.add(i)
    return Table(
        names=[name if len(name) <= LONGEST else name[:80] + "\u2026" for name in names],
        units=units,
        header=header,
        rows=rows,
        lines=row_lines,
        preamble=beside + below,
        decimal=decide_decimal(rows, row_lines, options.decimal, small),
        notes=notes,
        filled=filled,
    )
