"""Ellipsometer files of J. A. Woollam (WVASE, CompleteEASE), which name their columns nowhere.

A title, a line VASEmethod[...], often Original[...], the unit of the wavelength alone on a line;
then rows of wavelength, angle of incidence, psi, Delta and their standard errors, bare or after
the word E. Rows that begin with another word (uR, mm12) hold something else; dPolE is the share of
depolarized light that comes with psi and Delta.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from fitting.data.errors import refuse
from fitting.reader.vocabulary import unit_of

_COLUMNS = ("angle (deg)", "psi (deg)", "delta (deg)", "sigma psi (deg)", "sigma delta (deg)")


def as_plain_table(
    texts: Sequence[str], ignore: Sequence[str] = ()
) -> tuple[list[tuple[int, str]], list[str]] | None:
    """Return the lines of a Woollam file as a tabbed table with a header, and notes; else None.

    Rows dPolE and those whose word is in ``ignore`` (small letters) are left out and counted in the
    notes; those of other records are refused.
    """
    head = next((i for i, text in enumerate(texts[:4]) if text.startswith("VASEmethod[")), 9)
    unit_line = next(
        (i for i in range(head + 1, head + 4) if unit_of("".join(texts[i : i + 1]))), 0
    )
    if not unit_line:
        return None
    rows = []
    left_out: Counter[str] = Counter()
    for line, text in enumerate(texts[unit_line + 1 :], start=unit_line + 2):
        cells = text.split()
        if cells[:1] == ["E"]:
            rows.append((line, cells[1:]))
        elif cells and cells[0][0].isalpha():
            if cells[0].lower() not in ("dpole", *ignore):
                refuse(
                    f"rows that begin with {cells[0]} hold another quantity than psi and Delta, "
                    f"which is not read. If the fit may do without them, say --ignore {cells[0]}.",
                    line,
                )
            left_out[cells[0]] += 1
        elif cells:
            rows.append((line, cells))
    width = len(rows[0][1]) if rows else 0
    if width not in (4, 6):
        return None
    names = [f"wavelength ({texts[unit_line].strip()})", *_COLUMNS][:width]
    out = [(line, "# " + text) for line, text in enumerate(texts[:unit_line], start=1) if text]
    out += [(line, "\t".join(cells)) for line, cells in [(unit_line + 1, names), *rows]]
    notes = ["a Woollam file: wavelength, angle, psi, delta"]
    notes += [f"{count} rows {word} left out" for word, count in left_out.items()]
    return out, notes
