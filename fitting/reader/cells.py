"""Cells of text: where a line parts into them, which are numbers, and which numbers they are."""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Sequence

import numpy as np

from fitting.data.errors import refuse

DELIMITERS = {"tab": "\t", "semicolon": ";", "comma": ",", "pipe": "|", "blank": " "}
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
