"""The data table that this package writes (``--csv``), read back to the last bit.

Cells are parted by commas, or by semicolons beside decimal commas.

Its columns have fixed names and units, a datum a row; the comments above tell of the fit and of the
file that was read then, and are no statements about these numbers.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence

import numpy as np

from fitting.data.checks import Data, number_or_none
from fitting.data.errors import refuse
from fitting.data.quantities import QUANTITIES
from fitting.reader.longform import LongColumns

_NEEDED = {"angle_deg", "quantity", "value", "fitted", "residual"}
_NUMBERS = ("angle_deg", "wavelength_um", "value", "sigma", "polarizer_deg")


def own_header(texts: Sequence[str]) -> int:
    """Return where the header of a table that this package wrote stands; -1 in any other file."""
    start = next((i for i, text in enumerate(texts) if not text.startswith("#")), -1)
    return start if start >= 0 and set(re.split("[,;]", texts[start])) >= _NEEDED else -1


def own_columns(texts: Sequence[str], start: int) -> LongColumns:
    """Return the data of a table that this package wrote, its header at ``start``.

    Refuses a file where a row was damaged since.
    """
    table = csv.DictReader(texts[start:], delimiter=";" if ";" in texts[start] else ",")
    quantities, rows, lines = [], [], []
    for row in table:
        line = start + table.line_num
        whole = None not in row and None not in row.values()  # neither more cells nor less
        numbers = [number_or_none(row.get(name) or "nan") for name in _NUMBERS]
        if not whole or None in numbers or row["quantity"] not in QUANTITIES:
            refuse(
                "this is no row of the table that fresnel-fit writes (--csv). Write the file "
                "anew, or name the columns to be read with --columns.",
                line,
            )
        quantities.append(row["quantity"])
        rows.append(numbers)
        lines.append(line)
    angle, wavelength, value, sigma, polarizer = np.array(rows).reshape(-1, len(_NUMBERS)).T
    data = Data(angle, wavelength, np.array(quantities, dtype=str), value, sigma, polarizer)
    return LongColumns(
        data,
        [(line, "value", "sigma") for line in lines],
        {"angle": "angle_deg", "wavelength": "wavelength_um", "polarizer": "polarizer_deg"},
        f"read {len(lines)} values from a table that fresnel-fit wrote",
    )
