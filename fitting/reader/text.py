"""Files, buffers, data frames and spreadsheets as numbered lines of text, for one reader of all."""

from __future__ import annotations

import codecs
import io
import re
import sys
from collections.abc import Sequence
from decimal import Decimal
from os import PathLike
from pathlib import Path, PurePath
from typing import Any, NamedTuple

import numpy as np

from fitting.data.checks import unmasked
from fitting.data.errors import MeasurementError, MissingExtra, refuse
from fitting.process.visible import visible
from fitting.reader.table import is_number

# Some 400,000 rows, which take 5 s and, as cells of text, 35 times the memory of the file.
MAX_BYTES = 10_000_000
STDIN = "-"

_WORKBOOKS = (".xlsx", ".xlsm", ".xls", ".ods", ".numbers")
_PATH = (str, PathLike)
_UTF_16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
# What lists the columns of a table: of dictionaries and pandas, of Arrow, of polars.
_NAMES = ("keys", "column_names", "columns")
_MARKED_UP = re.compile(r"\ufeff?\s*(?:[{\[]\s*[\"{\[]|<[!?a-zA-Z])")
_LINE_END = re.compile("\r\n|\n|\r")  # not splitlines, which also cuts at form feeds
Rows = Sequence[Sequence[str]]


def source_of(source: Any) -> str:
    """Return the name of a file, buffer or table as messages and results show it."""
    name = source if isinstance(source, _PATH) else getattr(source, "name", None)
    if isinstance(name, _PATH) and (name is source or hasattr(source, "read")):
        return "standard input" if str(name) == STDIN else visible(Path(name).name)
    return "buffer" if hasattr(source, "read") else "table"


def _contents(source: Any, encoding: str | None) -> bytes:
    """Return what a file, pipe, device or buffer holds, up to the limit."""
    try:
        if not isinstance(source, _PATH):
            data = source.read()
            data = data.encode(encoding or "utf-8") if isinstance(data, str) else data
        elif str(source) == STDIN:
            data = sys.stdin.buffer.read(MAX_BYTES + 1)
        else:
            with Path(source).open("rb") as file:
                data = file.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:
        what = getattr(error, "strerror", None) or str(error)
        raise MeasurementError(
            f"{visible(str(source))}: the file cannot be opened ({what})."
        ) from error
    _refuse_larger(len(data))
    return data


def _refuse_larger(size: int) -> None:
    if size > MAX_BYTES:
        refuse(
            f"more than {MAX_BYTES // 10**6} MB came, which is the most that is read (some "
            "400,000 rows). Average or thin out the rows, or give the curves as files of their "
            "own."
        )


def _written(value: Any, percent: bool = False) -> str:
    """Return a cell of a table as a text file has it, to the last bit; percent: as it is shown."""
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return f"{Decimal(repr(value)).scaleb(2)}%" if percent else repr(value)
    text = "" if value is None or str(value) in ("<NA>", "NaT") else str(value)
    return " ".join(visible(text.replace('"', "'"), "\t\r\n").split())


def _sheet(data: bytes, wanted: str | None) -> tuple[str, Rows]:
    """Return the name and the rows of the sheet of a workbook (.xlsx) that holds the data."""
    try:
        import openpyxl
    except ImportError:
        raise MissingExtra("a spreadsheet (.xlsx)", "openpyxl", "spreadsheet") from None
    try:
        book = openpyxl.load_workbook(io.BytesIO(data), read_only=True, data_only=True)
    except Exception as error:  # of its parts: zipfile, XML, openpyxl
        refuse(f"this spreadsheet cannot be read ({error}). Save it anew as .xlsx, or as CSV.")
    sheets = {}
    for sheet in book.worksheets:
        sheet.reset_dimensions()  # which some programs write wrongly
        rows = [[_written(c.value, "%" in (c.number_format or "")) for c in row]
                for row in sheet.iter_rows()]  # fmt: skip
        width = max(map(len, rows), default=0)
        # a remark in the first cell is a line of its own
        sheets[sheet.title] = [
            row + [""] * (width - len(row)) if any(row[1:]) or is_number("".join(row)) else row[:1]
            for row in rows
        ]
    names = [name for name, rows in sheets.items() if any(map(any, rows))]
    chosen = names if wanted is None else [n for n in sheets if n.lower() == wanted.lower()]
    if len(chosen) != 1:
        came = "more than one sheet holds something" if len(names) > 1 else "no sheet holds data"
        came = came if wanted is None else f"there is no sheet {wanted!r}"
        refuse(f"{came}. Say --sheet NAME with one of {', '.join(map(repr, sheets))}.")
    return chosen[0], sheets[chosen[0]]


def _rows_of(table: Any) -> Rows:
    """Return the named columns of a table as rows: names, units where it has some, values."""
    units: dict[str, str] = {}
    if hasattr(table, "coords"):  # of xarray, where units are attributes
        every = table if hasattr(table, "data_vars") else table.to_dataset(name=table.name or "?")
        units = {str(n): str(v.attrs.get("units", "")) for n, v in every.variables.items()}
        table = every.to_dataframe()
    elif hasattr(table, "to_frame"):  # a single column
        table = table.to_frame()
    if any(name is not None for name in getattr(getattr(table, "index", None), "names", ())):
        table = table.reset_index()  # of pandas, which has angles or wavelengths there
    found: Any = next((getattr(table, of) for of in _NAMES if hasattr(table, of)), ())
    listed: Any = found() if callable(found) else found
    names = [*listed]
    if not names:
        refuse(
            f"{type(table).__name__} came; a table with named columns was wanted, such as a data "
            "frame or a dictionary of arrays (arrays without names: Measurement.from_columns)."
        )
    try:
        columns = np.broadcast_arrays(*(np.asarray(unmasked(table[name])) for name in names))
        if columns[0].ndim != 1:
            raise ValueError("two columns may have one name")
    except (ValueError, TypeError) as error:
        refuse(f"the columns must be of one length, with a name each ({error}).")
    heads = [names, [units.get(str(name), "") for name in names]][: 1 + any(units.values())]
    cells = [[_written(x) for x in (c.astype(float) if c.dtype.kind == "f" else c).tolist()]
             for c in columns]  # fmt: skip
    return [*([*map(_written, head)] for head in heads), *zip(*cells, strict=True)]


class Lines(NamedTuple):
    """The lines of a file, buffer or table, and notes on how they were read.

    name: words that may say what was measured, of the file and the sheet. tabbed: whether the cells
    are known, as those of a table, and parted by tabs.
    """

    texts: list[str]
    notes: list[str]
    name: str
    tabbed: bool = False


def read_lines(source: Any, encoding: str | None = None, sheet: str | None = None) -> Lines:
    """Return the lines of a file, a buffer or a table without their ends: LF, CRLF or CR.

    ``-`` is standard input. Control characters are shown as escapes; a form feed is a blank. The
    rows of a table are numbered as in a spreadsheet: the names stand in line 1.

    encoding: a name that Python knows; None takes a byte-order mark, valid UTF-8, else Latin-1.
    sheet: name of that of a workbook. Refuses a file where there is no text to read.
    """
    name = source_of(source)
    readable = isinstance(source, _PATH) or hasattr(source, "read")
    data = _contents(source, encoding) if readable else b""
    book = data.startswith(b"PK\x03\x04") and b"xl/workbook" in data
    if sheet and not book:
        refuse(f"--sheet {sheet} is for a spreadsheet (.xlsx), which this is not. Leave it out.")
    if encoding and (book or not readable):
        refuse("--encoding is for text, and this is a table. Leave it out.")
    if book or not readable:
        title, rows = _sheet(data, sheet) if book else ("", _rows_of(source))
        lines = [*map("\t".join, rows)]
        _refuse_larger(sum(map(len, lines)))
        said = f"{PurePath(name).stem} {title}" * book
        return Lines(lines, [f"sheet {title!r}"] * book, said, True)
    if PurePath(name).suffix.lower() in _WORKBOOKS:
        refuse("this is the name of a workbook, but no .xlsx workbook. Save the sheet as CSV.")
    chosen, notes = encoding or ("utf-16" if data.startswith(_UTF_16) else "utf-8"), []
    try:
        try:
            text = data.decode(chosen)
        except UnicodeDecodeError:
            if encoding or chosen == "utf-16":
                raise
            # The letters that measured files hold (micro, degree) are the same in Windows-1252.
            text, notes = data.decode("latin-1"), ["text read as Latin-1 (--encoding)"]
        if "\0" in text:
            raise ValueError("there are zero bytes")
    except (UnicodeError, LookupError, ValueError) as error:
        refuse(
            f"the bytes are not {'latin-1' if notes else chosen} text ({error}). Say --encoding "
            "NAME (utf-8, utf-16, latin-1, ...) if it is text; a PDF, or a workbook that is no "
            ".xlsx, must be saved as CSV."
        )
    if _MARKED_UP.match(text):
        refuse("this is JSON or markup, not a table. Export the curve as CSV.")
    text = visible(text.removeprefix("\ufeff").replace("\f", " ").replace("\v", " "), "\t\r\n")
    lines = _LINE_END.split(text)
    lines = lines if lines[-1] else lines[:-1]  # what stands behind the last line end is no line
    return Lines(lines, notes, PurePath(name).stem)
