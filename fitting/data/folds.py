"""Delta whose sign is unknown: its curves go from 0 to 180 degrees and turn sharply at the ends."""

from __future__ import annotations

import numpy as np

from fitting.data.checks import Data
from fitting.data.errors import refuse

# Wavelengths of a curve at the least that show a fold; how many times smaller the kinks are where
# the curve goes on beyond 180 (or 0) instead; and how many times larger than elsewhere they are.
_FEWEST, _STRAIGHTER, _SHARPER = 20, 3.0, 5.0


def _has_folds(delta: np.ndarray) -> bool:
    """Return whether a curve of Delta from 0 to 180 degrees turns at an end as if it went on."""
    if len(delta) < _FEWEST or delta.min() < 0.0 or delta.max() > 180.0:
        return False
    bend = np.abs(np.diff(delta, 2))
    kink = np.hypot(bend[:-1], bend[1:])  # of four neighbours, if it folds between the middle ones
    near = np.minimum(delta[1:-2], delta[2:-1]) > 90.0
    a, b, c, d = (delta[i : len(delta) - 3 + i] for i in range(4))
    c, d = (np.where(near, 360.0 - x, -x) for x in (c, d))
    beyond = np.hypot(c - 2.0 * b + a, d - 2.0 * c + b)
    sharp = kink > np.maximum(_SHARPER * np.median(bend), 1.0)
    return bool((sharp & (kink > _STRAIGHTER * beyond)).any())


def folded(data: Data, wanted: str) -> Data:
    """Return the data with Delta as `delta_folded`, if it is so by its curves or by the option."""
    of, value = data.quantity == "delta", data.value
    if wanted and not of.any():
        refuse("--delta-range is for Delta, of which there is no column. Leave it out.")
    if not wanted:
        curves = [np.flatnonzero(of & (data.angle_deg == a)) for a in np.unique(data.angle_deg[of])]
        order = [rows[np.argsort(data.wavelength_um[rows], kind="stable")] for rows in curves]
        inside = ((value[of] >= 0.0) & (value[of] <= 180.0)).all()
        wanted = "180" if inside and any(_has_folds(value[rows]) for rows in order) else ""
    if wanted != "180":
        return data
    around = value % 360.0
    return data._replace(
        quantity=np.where(of, "delta_folded", data.quantity),
        value=np.where(of, np.minimum(around, 360.0 - around), value),
    )
