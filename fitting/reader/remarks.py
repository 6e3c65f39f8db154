"""Remarks between the rows of a table and behind them."""

from __future__ import annotations

import re
from collections.abc import Callable

from fitting.errors import MeasurementError, place
from fitting.reader.evidence import statements
from fitting.reader.header import split_names

# a comment after the numbers; "#N/A" and its kin are gaps
_INLINE = re.compile(r"\s(?:#(?!n/?a|nv|num|value|div)|//|!)", re.IGNORECASE)


def without_remark(text: str) -> str:
    """Return a row without the remark that stands behind its numbers."""
    if "#" not in text and "//" not in text and "!" not in text:
        return text
    return _INLINE.split(text, maxsplit=1)[0] if text.strip()[:1] not in '#!/"%;' else text


def refuse_inside(
    source: str,
    remarks: list[tuple[int, str]],
    before: list[str],
    recognise: Callable[[str], bool],
    count: int,
) -> None:
    """Raise where a remark between the rows says what the rows below it are: another measurement.

    before: the lines above the numbers, which a page may repeat.
    """
    for line, text in remarks:
        names = split_names(text, "", count)
        other = len(names) == count and sum(map(recognise, names)) >= 2
        if text not in before and (other or statements(line, text)):
            raise MeasurementError(
                f"{place(source, line)}: {text[:60]!r} stands between the numbers, and may say "
                "that another measurement begins. Read one of them with --lines A-B."
            )
