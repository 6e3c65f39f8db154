"""Ellipsometer files of J. A. Woollam (WVASE, CompleteEASE), which name their columns nowhere.

A title, a line VASEmethod[...], often Original[...], the unit of the wavelength alone on a line;
then rows of wavelength, angle of incidence, psi, Delta and their standard errors, bare or after
the word E. Rows that begin with another word (dPolE, uR, mm12) hold something else.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence

from fitting.measurements.reader.cells import DELIMITERS
from fitting.measurements.reader.vocabulary import unit_of

_COLUMNS = ("angle (deg)", "psi (deg)", "delta (deg)", "sigma psi (deg)", "sigma delta (deg)")


def as_plain_table(texts: Sequence[str]) -> tuple[list[str], list[str]] | None:
    """Return the lines of a Woollam file as a tabbed table with a header, and notes; else None.

    The result has as many lines as ``texts``, so that line numbers stay. Rows of other records
    become empty lines and are counted in the notes.
    """
    head = next((i for i, text in enumerate(texts[:4]) if text.startswith("VASEmethod[")), 9)
    unit_line = next(
        (i for i in range(head + 1, head + 4) if unit_of("".join(texts[i : i + 1]))), 0
    )
    if not unit_line:
        return None
    out = ["# " + text if text else "" for text in texts[:unit_line]]
    out.append("")
    left_out: Counter[str] = Counter()
    width = 0
    for text in texts[unit_line + 1 :]:
        cells = re.split(r"[\t ]+", text.strip())
        if cells[0] == "E":
            cells = cells[1:]
        elif cells[0][:1].isalpha():
            left_out[cells[0]] += 1
            cells = []
        width = width or len(cells)
        out.append(DELIMITERS["tab"].join(cells))
    names = ("wavelength (" + texts[unit_line].strip() + ")",) + _COLUMNS
    if width not in (4, 6):
        return None
    out[unit_line] = "\t".join(names[:width])
    notes = ["a Woollam file: wavelength, angle, psi, delta"]
    notes += [f"{count} rows {word} left out" for word, count in left_out.items()]
    return out, notes
