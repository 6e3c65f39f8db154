"""Angles, wavelengths and quantities that a caller names, checked, as points without values."""

from __future__ import annotations

from typing import Any

import numpy as np

from fitting.data.measurement import QUANTITIES, Measurement


def numbers(name: str, came: Any) -> np.ndarray:
    """Return an array of floats, or raise ValueError with the name if it has other values."""
    try:
        found = np.asarray(came)
    except ValueError:  # a ragged list
        found = np.asarray(None)
    if found.dtype.kind not in "iuf":
        raise ValueError(f"{name} is {repr(came)[:60]}; real numbers were wanted.")
    return found.astype(float)


def _angles_of(angle_deg: Any) -> np.ndarray:
    """Return angles of incidence, (A,), or raise ValueError for other values."""
    angle = np.atleast_1d(numbers("the angle of incidence", angle_deg))
    if angle.ndim != 1 or not angle.size:
        raise ValueError(f"angles of shape {angle.shape} came; a number or one axis was wanted.")
    strange = angle[~((angle >= 0.0) & (angle <= 90.0))]
    if strange.size:
        raise ValueError(
            f"an angle of incidence of {strange[0]:g} degrees came; 0 to 90 degrees from the "
            "normal of the surface were wanted."
        )
    return angle


def points_of(angle_deg: Any, quantity: Any, wavelength_um: Any = None) -> Measurement:
    """Return points that the caller names as a measurement without values."""
    waves = numbers("wavelength_um", np.nan if wavelength_um is None else wavelength_um)
    strange = waves[~(np.isnan(waves) | ((waves > 0.0) & np.isfinite(waves)))]
    if strange.size:
        raise ValueError(f"wavelength_um holds {strange[0]:g}; micrometres above 0 were wanted.")
    columns = _angles_of(angle_deg), np.asarray(quantity), waves
    try:
        angle, names, waves = np.broadcast_arrays(*columns)
    except ValueError:
        angle = np.empty((0, 0))
    if angle.ndim != 1 or not angle.size:
        shapes = ", ".join(str(c.shape) for c in columns)
        raise ValueError(
            f"angles, quantities and wavelengths of shapes {shapes} came; for each a single value "
            "or one axis of a common length was wanted."
        )
    unknown = [str(name) for name in np.unique(names) if name not in QUANTITIES]
    if unknown:
        wanted = ", ".join(QUANTITIES)
        raise ValueError(f"there is no quantity {unknown[0]!r}; one of {wanted} was wanted.")
    nothing = np.full(len(angle), np.nan)
    return Measurement(
        angle_deg=angle, wavelength_um=waves, quantity=np.asarray(names, dtype=str),
        value=np.zeros(len(angle)), sigma=nothing, polarizer_deg=nothing, source="points",
        understood="",
    )  # fmt: skip
