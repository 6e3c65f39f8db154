"""Spectra of psi and Delta that SENTECH's SpectraRay exports as text.

A line "; WAVELENGTH 60.20 60.20 70.20 70.20" with the angle of incidence of each column; then rows
of the wavelength, of which no unit is said, and of psi and Delta at each angle, in degrees.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from fitting.data.errors import refuse

_HEAD = re.compile(r";\s*WAVELENGTH((?:\s+[0-9]+(?:[.,][0-9]+)?)+)\s*")


def as_plain_table(texts: Sequence[str]) -> tuple[list[tuple[int, str]], list[str]] | None:
    """Return the lines of a SpectraRay export as a tabbed table with a header; else None."""
    head = _HEAD.fullmatch(texts[0]) if texts else None
    if head is None:
        return None
    angles = head[1].replace(",", ".").split()
    if angles[::2] != angles[1::2]:
        refuse(
            "each angle of incidence was wanted twice, for psi and for Delta; other angles came. "
            "Export psi and Delta (not tan psi and cos Delta, and no Mueller matrix).",
            1,
        )
    names = [f"psi ({angle} deg)\tdelta ({angle} deg)" for angle in angles[::2]]
    table = [["wavelength", *names], *(text.split() for text in texts[1:])]
    out = list(enumerate(map("\t".join, table), start=1))
    return out, ["a SpectraRay file: psi, Delta at an angle"]
