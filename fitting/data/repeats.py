"""Rows that a table holds twice."""

from __future__ import annotations

import numpy as np

from fitting.data.checks import Data

# Fewer repeats may agree to the last digit by chance.
_LEAST = 3


def without_copies(data: Data) -> tuple[Data, str]:
    """Return the data without the copies of rows, and how many were left out, in words.

    Measurements that are repeated scatter, at least in some rows. If all values of every row that
    is repeated are the same to the last digit, and there are three such rows or more, the table was
    stored twice: counted as often, its rows would promise too small errors, and a test for noise
    would find that neighbours agree too well. The order of rows stays.
    """
    place = np.stack([
        np.nan_to_num(data.angle_deg), np.nan_to_num(data.wavelength_um, nan=-1.0),
        np.unique(data.quantity, return_inverse=True)[1], np.nan_to_num(data.polarizer_deg),
    ])  # fmt: skip
    datum = np.vstack([place, data.value, np.nan_to_num(data.sigma, nan=-1.0)])
    first, count = np.unique(datum, axis=1, return_index=True, return_counts=True)[1:]
    several = int((count > 1).sum())
    if several < _LEAST:
        return data, ""
    # Each row of the table, and whether it is repeated at all.
    which, times = np.unique(place, axis=1, return_inverse=True, return_counts=True)[1:]
    if (times > 1).sum() != several or (times[which.ravel()[first]] != count).any():
        return data, ""
    kept = np.sort(first)
    left = len(data.value) - len(kept)
    return Data(*(column[kept] for column in data)), f"; {left} exact copies of rows left out"
