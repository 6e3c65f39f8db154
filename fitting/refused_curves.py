"""Curves of a batch whose data cannot be measurements: refused one by one, not the whole batch."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fitting.data.checks import EXCURSION
from fitting.data.quantities import ANGLES, POWERS, TABLE

_Arrays = dict[str, Any]


def without_refused(given: _Arrays, sigma: Any) -> tuple[_Arrays, Any, np.ndarray | None]:
    """Return values with NaN in curves that are refused, errors, and reasons (...), "" for none.

    None: no curve is refused. A single curve, and a batch of which none would be left, pass: the
    checks of a call say what is wrong with them.
    """
    try:
        arrays = {q: np.asarray(v) for q, v in given.items()}
        values = {q: a.astype(float) for q, a in arrays.items() if a.dtype.kind != "c"}
        shape = np.broadcast_shapes(*(v.shape for v in values.values()))[:-1]
    except (TypeError, ValueError):
        return given, sigma, None
    if len(values) < len(given) or not shape or not np.prod(shape):
        return given, sigma, None
    reasons = np.full(shape, "", object)

    def refuse(where: Any, reason: str) -> None:
        reasons[np.broadcast_to(where, shape) & (reasons == "")] = reason

    for q, value in values.items():
        low, high = _range(q)
        with np.errstate(invalid="ignore"):
            if not (np.fmin.reduce(value, None) >= low and np.fmax.reduce(value, None) <= high):
                wrong = ((value < low) | (value > high)).any(-1)
                refuse(wrong, f"{q} has values outside of [{low:g}, {high:g}].")
    powers = [~v.any(-1) for q, v in values.items() if q in POWERS]
    if powers:
        refuse(np.logical_and.reduce(np.broadcast_arrays(*powers)), "all powers are 0.")
    if set(values) >= set(ANGLES):
        lone = np.isnan(values["psi"]) & np.isfinite(values["delta"])
        if lone.any():
            refuse(lone.any(-1), "values of Delta have no psi beside them.")
    errors = sigma if isinstance(sigma, Mapping) else {"sigma": sigma}
    for name, one in errors.items():
        wrong: Any = np.asarray(one, float) <= 0.0 if one is not None else np.zeros(1, bool)
        if wrong.any() and wrong.ndim > 1:  # else those of all curves are wrong
            refuse(wrong.any(-1), f"{name} has standard errors that are not above 0.")
            errors = {**errors, name: np.where(wrong, np.nan, np.asarray(one))}
    refused = reasons != ""
    if not refused.any() or refused.all():
        return given, sigma, None
    kept = {q: np.where(refused[..., None], np.nan, v) for q, v in values.items()}
    return kept, errors if isinstance(sigma, Mapping) else errors["sigma"], reasons


def _range(quantity: str) -> tuple[float, float]:
    """Return the range of the values of a quantity, with that of their noise."""
    _, low, high, *_ = TABLE[quantity]
    slack = EXCURSION if quantity in POWERS else 0.0
    return low - slack, high + slack
