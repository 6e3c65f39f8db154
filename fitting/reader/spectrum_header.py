"""The header of a spectrum from the units that a file format gives on lines of their own."""

from __future__ import annotations

import re

from fitting.data.errors import refuse
from fitting.data.units import FORM_OF
from fitting.reader.vocabulary import unit_of

_NOT_A_POWER = re.compile(r"(?i).*(absorb|extinc|log|kubelka|munk|emi)|a$")


def spectrum_header(x_line: int, x_units: str, y_line: int, y_units: str) -> str:
    """Return the tabbed header of a table of ``y_units`` over ``x_units``.

    Refuses, with the line, an axis that is no wavelength, wavenumber, energy
    or frequency, and for absorbance and the like. Other values are left to the rest of the reader.
    """
    unit = unit_of(x_units) or ""
    form = "q" if unit == "Hz" else FORM_OF.get(unit, "q")  # NMR
    if form == "q":
        refuse(
            f"the unit {x_units[:30]!r} came where 1/CM, NANOMETERS or MICROMETERS were wanted. "
            "Export the spectrum over one of them.",
            x_line,
        )
    if not y_units or _NOT_A_POWER.match(y_units):
        refuse(
            f"values in {y_units[:30]!r} came where fractions of the incident light were wanted. "
            "Export the spectrum as REFLECTANCE or TRANSMITTANCE (the absorbance A of transmitted "
            "light is T = 10^-A).",
            y_line,
        )
    name = re.sub(r"(?i)\bpercent\b", "%", y_units).replace("\t", " ")
    return f"{form} ({unit})\t{name}"
