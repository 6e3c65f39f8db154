"""A file's bytes as numbered lines of text, whatever the encoding and the line ends."""

from __future__ import annotations

import codecs
import re
from pathlib import Path

from fitting.errors import MeasurementError

MAX_BYTES = 200_000_000  # text of a million rows; anything larger is not one curve

_MARKS = (  # the 32-bit mark begins with the 16-bit one, so the longer comes first
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
_NOT_TEXT = (
    (b"PK\x03\x04", "an Excel workbook or another zip archive; save the sheet as CSV"),
    (b"\xd0\xcf\x11\xe0", "an old Excel workbook; save the sheet as CSV"),
    (b"\x89HDF", "an HDF5 file; export the curve as CSV"),
    (b"%PDF", "a PDF"),
    (b"\x1f\x8b", "a gzip archive; unpack it first"),
    (b"\x93NUMPY", "a NumPy array; use Measurement.from_columns in Python"),
    (b"\x89PNG", "a picture"),
)
# Every byte is a character of Latin-1; measured files hold a few of its letters (micro, degree,
# Angstrom), which Windows-1252 writes alike. It is the reading of bytes that are not UTF-8.
_FALLBACK = "latin-1"
_MARKED_UP = re.compile(r"\ufeff?\s*(?:[{\[]\s*[\"{\[]|<[!?a-zA-Z])")
_LINE_END = re.compile("\r\n|\n|\r")  # not splitlines, which also cuts at form feeds


def _guess_encoding(data: bytes) -> str:
    for mark, name in _MARKS:
        if data.startswith(mark):
            return name
    head = data[:4096]
    zeros = head.count(0)
    if zeros:
        # ASCII characters in UTF-16 have a zero for every second byte
        odd, even = head[1::2].count(0), head[0::2].count(0)
        if odd > 0.4 * len(head[1::2]) and even < 0.1 * len(head):
            return "utf-16-le"
        if even > 0.4 * len(head[0::2]) and odd < 0.1 * len(head):
            return "utf-16-be"
        return ""
    try:
        data.decode("utf-8")
    except UnicodeDecodeError:
        return _FALLBACK
    return "utf-8"


def read_lines(path: Path, encoding: str | None) -> tuple[list[str], list[str]]:
    """Return the lines of the file at ``path`` without their ends, and notes on how they were read.

    encoding: a name that Python knows (utf-8, latin-1, utf-16, ...); None takes a byte-order mark,
        the zero bytes of UTF-16, valid UTF-8, else Latin-1, in this order.
    Lines end with LF, CRLF or CR. Raises MeasurementError where there is no text to read.
    """
    name = path.name
    try:
        if path.stat().st_size > MAX_BYTES:
            raise MeasurementError(f"{name}: the file is larger than {MAX_BYTES // 10**6} MB.")
        data = path.read_bytes()
    except (OSError, ValueError) as error:
        if isinstance(error, MeasurementError):
            raise
        what = getattr(error, "strerror", None) or str(error)
        raise MeasurementError(f"{path}: the file cannot be opened ({what}).") from error
    for magic, what in _NOT_TEXT:
        if data.startswith(magic):
            raise MeasurementError(f"{name}: this is not text but {what}.")
    chosen = str(encoding) if encoding else _guess_encoding(data)
    wanted = (
        "Say --encoding NAME (utf-8, utf-16, latin-1, ...) if it is text, else export it as CSV."
    )
    if not chosen:
        raise MeasurementError(f"{name}: the file holds zero bytes, as no text does. {wanted}")
    try:
        text = data.decode(chosen)
    except (UnicodeError, LookupError, ValueError) as error:
        raise MeasurementError(
            f"{name}: the bytes are not {chosen} text ({error}). {wanted}"
        ) from error
    if "\0" in text:
        raise MeasurementError(f"{name}: the file holds zero bytes, as no text does. {wanted}")
    if _MARKED_UP.match(text):
        raise MeasurementError(
            f"{name}: this is JSON or markup, not a table. Export the curve as CSV."
        )
    notes = []
    if not encoding and chosen == _FALLBACK:
        notes.append("letters read as Latin-1 (--encoding)")
    return _LINE_END.split(text.removeprefix("\ufeff")), notes
