"""Spectra in JCAMP-DX 4.24 (R. S. McDonald and P. A. Wilks, Appl. Spectrosc. 42, 151, 1988).

Records ``##LABEL= value``, one of which is the table: ``(X++(Y..Y))``, where a line has its first
abscissa and then ordinates at equal steps, as numbers (AFFN, PAC) or with letters for the sign and
the first digit (SQZ), differences (DIF) and repeats (DUP); or ``(XY..XY)``, pairs. Whatever the
file says twice must agree: the points, the abscissa of each line, the ordinate that a line of
differences repeats.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Sequence
from decimal import Decimal
from itertools import chain
from typing import Any

from fitting.data.errors import refuse
from fitting.reader.instruments import Plain, spectrum_header

_MAX_POINTS = 1_000_000  # a repeat count of a few digits must not fill the memory
_FACTOR_ERROR = Decimal("0.01")  # of FIRSTY: factors are rounded, wrong ones are off by far more
_TABLES = ("XYDATA", "XYPOINTS", "PEAKTABLE")
_NUMBER = r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[Ee][+-]?[0-9]{1,3})?"
# E5 behind a number is an ordinate of SQZ, E-5 and E+5 are exponents
_ORDINATE = re.compile(
    r"(?:[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[Ee][+-][0-9]{1,3}(?=[\s+-]|$))?|\?"
    r"|[@A-Ia-i%J-Rj-rS-Zs][0-9]*)(?![0-9.])"
)
_PAIR = re.compile(rf"({_NUMBER})(?:\s*,\s*|\s+)({_NUMBER})\s*(?:;\s*|(?<=\s)|$)")
_DIGITS = [*map(str, range(10)), *map(str, range(-1, -10, -1))]
_SQZ = dict(zip("@ABCDEFGHIabcdefghi", _DIGITS, strict=True))
_DIF = dict(zip("%JKLMNOPQRjklmnopqr", _DIGITS, strict=True))
_DUP = dict(zip("STUVWXYZs", "123456789", strict=True))
_TOLD = ("TITLE", "SAMPLEDESCRIPTION", "SAMPLINGPROCEDURE", "$")  # may say angle and polarization

_DAMAGED = ". The file is damaged; export it anew."

Points = list[tuple[Decimal, Decimal | None, int]]


class _Records:
    """The records of one block: label -> (line, value), the first line of text of each."""

    def __init__(self, texts: Sequence[str]) -> None:
        self.found = defaultdict[str, list[tuple[int, str]]](list)
        self.rows = defaultdict[str, list[tuple[int, str]]](list)  # further lines of each
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
            refuse(
                f"a second record ##{label}= came. Delete the wrong one.", self.found[label][1][0]
            )
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


def _parts(form: re.Pattern[str], text: str, line: int, wanted: str) -> list[Any]:
    """Return all that ``form`` finds in a line, which must hold nothing else."""
    if rest := form.sub(" ", text).split():
        refuse(f"{rest[0][:30]!r} came where {wanted} were wanted" + _DAMAGED, line)
    return form.findall(text)


def _ordinates(tokens: list[str], line: int, most: int) -> tuple[list[Decimal | None], bool]:
    """Return the ordinates of a line without the factor, and whether the last is a difference.

    None is a gap. Refuses more than ``most``.
    """
    each: list[str] = []
    for token in tokens:
        if token[0] in _DUP and each:
            count = min(Decimal(_DUP[token[0]] + token[1:]), most + 1)
            each += each[-1:] * (int(count) - 1)
        else:
            each.append(token)
        if len(each) > most:
            refuse("the table has more points than ##NPOINTS= says" + _DAMAGED, line)
    values: list[Decimal | None] = []
    for token in each:
        first, digits = token[0], token[1:]
        last = values[-1] if values else None
        if first in _DUP or (first in _DIF and last is None):
            came = f"{token!r} repeats or changes a value, but is the first ordinate of the line"
            refuse(f"{came} or follows a missing one (?)" + _DAMAGED, line)
        if first in _DIF and last is not None:
            values.append(last + Decimal(_DIF[first] + digits))
        else:
            values.append(None if first == "?" else Decimal(_SQZ.get(first, first) + digits))
    return values, bool(each) and each[-1][0] in _DIF


def _equal_steps(records: _Records, table: str, at: int, count: int) -> Points:
    """Return the points of (X++(Y..Y))."""
    first, last = records.number("FIRSTX", at), records.number("LASTX", at)
    x_factor, y_factor = records.number("XFACTOR", at), records.number("YFACTOR", at)
    step = (last - first) / max(count - 1, 1)
    points: Points = []
    check: Decimal | None = None  # the last ordinate, which the next line repeats
    repeated = False
    for line, text in records.rows[table]:
        tokens = _parts(_ORDINATE, text, line, "ordinates in AFFN, PAC, SQZ, DIF or DUP")
        (start, *_), _ = _ordinates(tokens[:1], line, 1)
        values, differs = _ordinates(tokens[1:], line, count + 1 - len(points))
        if start is None or not values:
            came = f"{text[:30]!r} came where an abscissa and ordinates were wanted"
            refuse(came + _DAMAGED, line)
        at_x = first + step * (len(points) - repeated)
        if abs(start * x_factor - at_x) > abs(step) / 2 + abs(_unit(start) * x_factor) / 2:
            refuse(
                f"the line begins at x = {start * x_factor}, but ##FIRSTX=, ##LASTX=, ##NPOINTS= "
                f"and the {len(points) - repeated} points before it give {at_x:.10g}. Points are "
                "missing or damaged; export the file anew.",
                line,
            )
        if repeated and values[0] != check:
            refuse(
                f"the line repeats the ordinate {values[0]}, the line before it ended with "
                f"{check} (the check of DIF)" + _DAMAGED,
                line,
            )
        for value in values[repeated:]:
            y = None if value is None else value * y_factor
            points.append((first + step * len(points), y, line))
        check, repeated = values[-1], differs
    return points


def _pairs(records: _Records, table: str) -> Points:
    """Return the points of (XY..XY)."""
    x_factor, y_factor = (
        records.number(label, 0) if records.found[label] else Decimal(1)
        for label in ("XFACTOR", "YFACTOR")
    )
    return [
        (Decimal(x) * x_factor, Decimal(y) * y_factor, line)
        for line, text in records.rows[table]
        for x, y in _parts(_PAIR, text, line, "pairs x, y")
    ]


def _check_ends(records: _Records, points: Points, at: int, count: int) -> None:
    """Raise where the table and the records on its first and last point contradict each other."""
    if len(points) != count:
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
        refuse(
            "this JCAMP-DX file has no ##XYDATA=, ##XYPOINTS= or ##PEAK TABLE=. Export "
            "the spectrum as one of them.", start,
        )  # fmt: skip
    at, table = tables[0]
    header = spectrum_header(*records.text("XUNITS", at), *records.text("YUNITS", at))
    said = records.number("NPOINTS", at)
    if not 1 <= said <= _MAX_POINTS or said != int(said):
        came = f"##NPOINTS= {said} came where a whole number from 1 to {_MAX_POINTS} was wanted"
        refuse(came + _DAMAGED, records.found["NPOINTS"][0][0])
    form = re.sub(r"\s", "", records.found[table][0][1]).upper()
    if form not in ("(X++(Y..Y))", "(XY..XY)"):
        refuse(
            f"the table has the form {form[:30]}; (X++(Y..Y)) or (XY..XY) was wanted. Export the "
            "spectrum in one of them.",
            at,
        )
    equal = form == "(X++(Y..Y))"
    points = _equal_steps(records, table, at, int(said)) if equal else _pairs(records, table)
    _check_ends(records, points, at, int(said))
    told = [found for label, found in records.found.items() if label.startswith(_TOLD)]
    out = [(line, "# " + value) for line, value in sorted(chain(*told)) if line < at]
    out += [(at, header), *((n, f"{x}\t{'nan' if y is None else y}") for x, y, n in points)]
    return out, [f"a JCAMP-DX file: {len(points)} points"]
