"""Spectra in JCAMP-DX 4.24 (R. S. McDonald and P. A. Wilks, Appl. Spectrosc. 42, 151, 1988).

Records ``##LABEL= value``, one of which is the table: ``(X++(Y..Y))``, where a line has its first
abscissa and then ordinates at equal steps, or ``(XY..XY)``, pairs. Numbers are written out (AFFN);
packed ones (PAC, SQZ, DIF, DUP) are refused. Whatever the file says twice must agree: the points,
the abscissa of each line, the first ordinate.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Sequence
from decimal import Decimal
from itertools import chain

from fitting.data.errors import refuse
from fitting.reader.instruments import DAMAGED, Plain, spectrum_header

_FACTOR_ERROR = Decimal("0.01")  # of FIRSTY: factors are rounded, wrong ones are off by far more
_TABLES = ("XYDATA", "XYPOINTS", "PEAKTABLE")
_NUMBER = r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[Ee][+-]?[0-9]{1,3})?"
_PAIR = re.compile(rf"({_NUMBER})(?:\s*,\s*|\s+)({_NUMBER})\s*(?:;\s*|(?<=\s)|$)")
_SQUEEZED = re.compile("[Ee][0-9]")  # the exponent of a number, or an ordinate of its own in SQZ
_TOLD = ("TITLE", "SAMPLEDESCRIPTION", "SAMPLINGPROCEDURE", "$")  # may say angle and polarization

Points = list[tuple[Decimal, Decimal | None, int]]


class _Records:
    """The records of one block: label -> (line, value), and the further lines of each."""

    def __init__(self, texts: Sequence[str]) -> None:
        self.found = defaultdict[str, list[tuple[int, str]]](list)
        self.rows = defaultdict[str, list[tuple[int, str]]](list)
        label = ""
        for line, text in enumerate(texts, start=1):
            text = text.split("$$")[0].strip()
            if text.startswith("##"):
                name, _, value = text[2:].partition("=")
                label = re.sub(r"[\s/_-]", "", name).upper()
                self.found[label].append((line, value.strip()))
            elif text:
                self.rows[label].append((line, text))

    def text(self, label: str, at: int) -> tuple[int, str]:
        """Return line and value of a record that must be there once."""
        if not self.found[label]:
            refuse(f"this JCAMP-DX file has no record ##{label}=, which its table needs.", at)
        if len(self.found[label]) > 1:
            line = self.found[label][1][0]
            refuse(f"a second record ##{label}= came. Delete the wrong one.", line)
        return self.found[label][0]

    def number(self, label: str, at: int) -> Decimal:
        """Return the number of a record that must be there once."""
        line, value = self.text(label, at)
        if not re.fullmatch(_NUMBER, value):
            refuse(f"##{label}= is {value[:30]!r}; a number was wanted. Correct it.", line)
        return Decimal(value)


def _unit(number: Decimal) -> Decimal:
    """Return one unit of the last digit of a number as it is written."""
    return Decimal(1).scaleb(int(number.as_tuple().exponent))


def _equal_steps(records: _Records, table: str, at: int, count: int) -> Points:
    """Return the points of (X++(Y..Y))."""
    first, last, x_factor, y_factor = (
        records.number(label, at) for label in ("FIRSTX", "LASTX", "XFACTOR", "YFACTOR")
    )
    step = (last - first) / max(count - 1, 1)
    points: Points = []
    for line, text in records.rows[table]:
        numbers = [None if cell == "?" else cell for cell in text.split()]
        for cell in filter(None, numbers):
            if not re.fullmatch(_NUMBER, cell) or _SQUEEZED.search(cell):
                refuse(
                    f"{cell[:30]!r} came where numbers parted by blanks (AFFN) were wanted. If "
                    "they are packed (PAC, SQZ, DIF, DUP), export the spectrum unpacked, as AFFN "
                    "or as pairs (XY..XY); else the file is damaged.",
                    line,
                )
        if numbers[0] is None or len(numbers) < 2:
            came = f"{text[:30]!r} came where an abscissa and ordinates were wanted"
            refuse(came + DAMAGED, line)
        start, at_x = Decimal(numbers[0]), first + step * len(points)
        if abs(start * x_factor - at_x) > abs(step) / 2 + abs(_unit(start) * x_factor) / 2:
            refuse(
                f"the line begins at x = {start * x_factor}, but ##FIRSTX=, ##LASTX=, ##NPOINTS= "
                f"and the {len(points)} points before it give {at_x:.10g}. Points are missing or "
                "damaged; export the file anew.",
                line,
            )
        for y in numbers[1:]:
            value = None if y is None else Decimal(y) * y_factor
            points.append((first + step * len(points), value, line))
    return points


def _pairs(records: _Records, table: str) -> Points:
    """Return the points of (XY..XY)."""
    x_factor, y_factor = (
        records.number(label, 0) if records.found[label] else Decimal(1)
        for label in ("XFACTOR", "YFACTOR")
    )
    points: Points = []
    for line, text in records.rows[table]:
        if rest := _PAIR.sub(" ", text).split():
            refuse(f"{rest[0][:30]!r} came where pairs x, y were wanted" + DAMAGED, line)
        found = _PAIR.findall(text)
        points += [(Decimal(x) * x_factor, Decimal(y) * y_factor, line) for x, y in found]
    return points


def _check_ends(records: _Records, points: Points, at: int, count: Decimal) -> None:
    """Raise where the table and the records on its first and last point contradict each other."""
    if len(points) != count or not points:
        refuse(
            f"the table has {len(points)} points, ##NPOINTS= says {count}. Points are missing or "
            "damaged; export the file anew.",
            at,
        )
    for label, i, column in (("FIRSTX", 0, 0), ("LASTX", -1, 0), ("FIRSTY", 0, 1)):
        found = points[i][column]
        if not records.found[label] or not isinstance(found, Decimal):
            continue
        said = records.number(label, at)
        close = _unit(said) if column == 0 else _unit(said) + abs(said) * _FACTOR_ERROR
        if abs(said - found) >= max(close, _unit(found)):
            refuse(
                f"##{label}= {said}, the table gives {found:.10g} (with the factor ##"
                f"{label[-1]}FACTOR=). Correct the wrong one of them.",
                records.found[label][0][0],
            )


def as_plain_table(texts: Sequence[str]) -> Plain:
    """Return the lines of a JCAMP-DX file as a tabbed table with a header; else None."""
    if not next((text for text in texts if text.strip()), "").lstrip().startswith("##"):
        return None
    records = _Records(texts)
    if not records.found["JCAMPDX"]:
        return None
    start = records.found["JCAMPDX"][0][0]
    tables = [(at, label) for label in _TABLES for at, _ in records.found[label]]
    blocks = max(len(records.found["TITLE"]), len(tables))
    if blocks > 1:
        refuse(
            f"this JCAMP-DX file has {blocks} blocks, of which one was wanted. Save each alone.",
            start,
        )
    if not tables:
        wanted = "##XYDATA=, ##XYPOINTS= or ##PEAK TABLE=. Export the spectrum as one of them."
        refuse(f"this JCAMP-DX file has no {wanted}", start)
    at, table = tables[0]
    header = spectrum_header(*records.text("XUNITS", at), *records.text("YUNITS", at))
    count = records.number("NPOINTS", at)
    form = re.sub(r"\s", "", records.found[table][0][1]).upper()
    if form not in ("(X++(Y..Y))", "(XY..XY)"):
        refuse(
            f"the table has the form {form[:30]}; (X++(Y..Y)) or (XY..XY) was wanted. Export the "
            "spectrum in one of them.",
            at,
        )
    equal = form == "(X++(Y..Y))"
    points = _equal_steps(records, table, at, int(count)) if equal else _pairs(records, table)
    _check_ends(records, points, at, count)
    told = [found for label, found in records.found.items() if label.startswith(_TOLD)]
    out = [(line, "# " + value) for line, value in sorted(chain(*told)) if line < at]
    out += [(at, header), *((n, f"{x}\t{'nan' if y is None else y}") for x, y, n in points)]
    return out, [f"a JCAMP-DX file: {len(points)} points"]
