"""A file's bytes as numbered lines of text, whatever the encoding and the line ends."""

from __future__ import annotations

import codecs
import re
import sys
from os import PathLike
from pathlib import Path

from fitting.data.errors import MeasurementError, refuse
from fitting.process.visible import visible

# Some 400,000 rows, which take 5 s and, as cells of text, 35 times the memory of the file.
MAX_BYTES = 10_000_000
STDIN = "-"

# Every byte is a character of Latin-1; measured files hold a few of its letters (micro, degree,
# Angstrom), which Windows-1252 writes alike. It is the reading of bytes that are not UTF-8.
_FALLBACK = "latin-1"
_WORKBOOKS = (".xlsx", ".xlsm", ".ods", ".numbers")
_MARKED_UP = re.compile(r"\ufeff?\s*(?:[{\[]\s*[\"{\[]|<[!?a-zA-Z])")
_LINE_END = re.compile("\r\n|\n|\r")  # not splitlines, which also cuts at form feeds


def _guess_encoding(data: bytes) -> str:
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    try:
        data.decode("utf-8")
    except UnicodeDecodeError:
        return _FALLBACK
    return "utf-8"


def source_of(path: str | PathLike[str]) -> str:
    """Return the name of a file as messages and results show it, escapes and all."""
    return "standard input" if str(path) == STDIN else visible(Path(path).name)


def _bytes(path: Path) -> bytes:
    """Return what the file, pipe or device holds, up to the limit, or refuse it."""
    size, data = 0, b""
    try:
        if str(path) == STDIN:
            data = sys.stdin.buffer.read(MAX_BYTES + 1)
        elif (size := path.stat().st_size) <= MAX_BYTES:
            with path.open("rb") as file:
                data = file.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:
        what = getattr(error, "strerror", None) or str(error)
        raise MeasurementError(
            f"{visible(str(path))}: the file cannot be opened ({what})."
        ) from error
    if max(size, len(data)) > MAX_BYTES:
        refuse(
            f"more than {MAX_BYTES // 10**6} MB came, which is the most that is read (some "
            "400,000 rows). Average or thin out the rows, or give the curves as files of their "
            "own."
        )
    return data


def read_lines(path: Path, encoding: str | None) -> tuple[list[str], list[str]]:
    """Return the lines of the file at ``path`` without their ends, and notes on how they were read.

    ``-`` is standard input. Control characters are shown as escapes; a form feed is a blank.

    encoding: a name that Python knows (utf-8, latin-1, utf-16, ...); None takes a byte-order mark,
        valid UTF-8, else Latin-1, in this order.
    Lines end with LF, CRLF or CR. Refuses a file where there is no text to read.
    """
    if path.suffix.lower() in _WORKBOOKS:
        refuse("this is the name of a workbook, not of a text file. Save the sheet as CSV.")
    data = _bytes(path)
    chosen = str(encoding) if encoding else _guess_encoding(data)
    try:
        text = data.decode(chosen)
        if "\0" in text:
            raise ValueError("there are zero bytes")
    except (UnicodeError, LookupError, ValueError) as error:
        refuse(
            f"the bytes are not {chosen} text ({error}). Say --encoding NAME (utf-8, utf-16, "
            "latin-1, ...) if it is text; a workbook or a PDF must be saved as CSV."
        )
    if _MARKED_UP.match(text):
        refuse("this is JSON or markup, not a table. Export the curve as CSV.")
    guessed = not encoding and chosen == _FALLBACK
    text = visible(text.removeprefix("\ufeff").replace("\f", " ").replace("\v", " "), "\t\r\n")
    lines = _LINE_END.split(text)
    lines = lines if lines[-1] else lines[:-1]  # what stands behind the last line end is no line
    return lines, ["text read as Latin-1 (--encoding)"] if guessed else []
