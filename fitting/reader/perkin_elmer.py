"""Spectra that Perkin-Elmer programs export as text (PEDS; .asc of UV WinLab and Spectrum).

The first line is "PE UV ... ASCII PEDS 4.00". Below #GR stand the units of abscissa and ordinate,
and in the seventh line the number of points; below #DATA the points. The lines above are settings.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from fitting.data.errors import refuse
from fitting.reader.spectrum_header import spectrum_header

_FIRST = re.compile(r"PE [A-Z]{2}\s.*\bASCII\s+PEDS\b")
_DESCRIPTION = 9  # line with the description of the sample


def as_plain_table(texts: Sequence[str]) -> tuple[list[tuple[int, str]], list[str]] | None:
    """Return the lines of a Perkin-Elmer export as a plain table with a header; else None."""
    if not texts or not _FIRST.match(texts[0]):
        return None
    stripped = [text.strip() for text in texts]
    if "#GR" not in stripped or "#DATA" not in stripped[stripped.index("#GR") :]:
        refuse("this Perkin-Elmer file has no lines #GR and #DATA. Export the spectrum anew.", 1)
    units = stripped.index("#GR") + 1
    start = stripped.index("#DATA", units)
    count = "".join(stripped[units:start][6:7])
    points = sum(bool(text) for text in stripped[start + 1 :])
    if count != str(points):
        refuse(
            f"the file says {count or 'nothing'} of the number of points, and has {points} rows "
            "below #DATA. Rows are missing or damaged; export it anew.",
            units + 7,
        )
    out = []
    if units > _DESCRIPTION and not stripped[_DESCRIPTION - 1].startswith("#"):
        out.append((_DESCRIPTION, "# " + stripped[_DESCRIPTION - 1]))
    header = spectrum_header(units + 1, stripped[units], units + 2, stripped[units + 1])
    out += enumerate([header, *texts[start + 1 :]], start + 1)
    return out, [f"a Perkin-Elmer file: {points} points"]
