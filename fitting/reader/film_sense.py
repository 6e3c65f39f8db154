"""Files of Film Sense ellipsometers, one measurement each.

"Film_Sense_Data"; the number of wavelengths, of measurements, the angle of incidence with a minus;
a line for each wavelength, in nm, and its errors of calibration; a line for each wavelength with
N = cos 2 psi, C = sin 2 psi cos Delta, S = sin 2 psi sin Delta, the degree of polarization and the
intensity; then the fit of the instrument's own program.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from fitting.data.errors import refuse

_ROUNDED = 2e-3  # of N^2 + C^2 + S^2 = 1, where they are given to five decimals; damage is larger


def _numbers(texts: Sequence[str], line: int, count: int) -> list[float]:
    """Return the first numbers of a line, of which there must be ``count`` at least."""
    try:
        found = [float(cell) for cell in "".join(texts[line - 1 : line]).split("\t")[:count]]
    except ValueError:
        found = []
    if len(found) < count or not all(map(math.isfinite, found)):
        refuse(
            f"{count} numbers were wanted. This Film Sense file is damaged; export it anew.",
            line,
        )
    return found


def as_plain_table(texts: Sequence[str]) -> tuple[list[tuple[int, str]], list[str]] | None:
    """Return the lines of a Film Sense file as a tabbed table with a header; else None."""
    kind = texts[0].strip() if texts else ""
    if not kind.startswith("Film_Sense_"):
        return None
    if kind != "Film_Sense_Data":
        refuse(
            f"{kind} is a measurement over time, of which one time was wanted. Export it as "
            "Film_Sense_Data.",
            1,
        )
    count, measurements, angle = _numbers(texts, 2, 3)
    if measurements != 1 or count != int(count) or not 1 <= count < len(texts) / 2:
        refuse("one measurement at some wavelengths was wanted. Export one of them alone.", 2)
    out = [(2, "wavelength (nm)\tangle (deg)\tpsi (deg)\tdelta (deg)")]
    for line in range(3 + int(count), 3 + 2 * int(count)):
        n, c, s = _numbers(texts, line, 3)
        if abs(n * n + c * c + s * s - 1.0) > _ROUNDED:
            refuse("N^2 + C^2 + S^2 is not 1. The file is damaged; export it anew.", line)
        psi = math.degrees(math.atan2(math.hypot(c, s), n)) / 2.0
        delta = math.degrees(math.atan2(s, c))
        wavelength = _numbers(texts, line - int(count), 1)[0]
        out.append((line, f"{wavelength!r}\t{abs(angle)!r}\t{psi!r}\t{delta!r}"))
    return out, ["a Film Sense file: psi and Delta from N, C and S"]
