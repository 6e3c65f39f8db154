"""The arrays of a batch of curves: numbers of shapes that go together, curve by curve in range."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fitting.data.checks import EXCURSION, unmasked
from fitting.data.measurement import Measurement
from fitting.data.quantities import ANGLES, DELTAS, POWERS, TABLE
from fitting.results.result import FitData

_Arrays = dict[str, Any]


def without_refused(
    given: _Arrays, sigma: Any, whole: bool = False
) -> tuple[_Arrays, Any, np.ndarray | None]:
    """Return values with NaN in curves that are refused, errors, and reasons (...), "" for none.

    None: no curve is refused. A single curve, and a batch of which none would be left (without
    ``whole``: of a map a part), pass: the checks of a call say what is wrong with them.
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
    for q in {*DELTAS} & {*values} if "psi" in values else ():
        lone = np.isnan(values["psi"]) & np.isfinite(values[q])
        if lone.any():
            refuse(lone.any(-1), "values of Delta have no psi beside them.")
    errors = sigma if isinstance(sigma, Mapping) else {"sigma": sigma}
    for name, one in errors.items():
        wrong: Any = np.asarray(one, float) <= 0.0 if one is not None else np.zeros(1, bool)
        if wrong.any() and wrong.ndim > 1:  # else those of all curves are wrong
            refuse(wrong.any(-1), f"{name} has standard errors that are not above 0.")
            errors = {**errors, name: np.where(wrong, np.nan, np.asarray(one))}
    refused = reasons != ""
    if not refused.any() or (refused.all() and not whole):
        return given, sigma, None
    kept = {q: np.where(refused[..., None], np.nan, v) for q, v in values.items()}
    return kept, errors if isinstance(sigma, Mapping) else errors["sigma"], reasons


def _range(quantity: str) -> tuple[float, float]:
    """Return the range of the values of a quantity, with that of their noise."""
    _, low, high, *_ = TABLE[quantity]
    slack = EXCURSION if quantity in POWERS else 0.0
    return low - slack, high + slack


def _numbers(name: str, came: Any, low: float, high: float, wanted: str) -> np.ndarray:
    """Return real numbers, or NaN, between two values; raise ValueError for others."""
    try:
        found = np.asarray(unmasked(came))
        if found.dtype.kind == "c":
            raise TypeError("complex ones came")
        found = found.astype(float)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name} must be real numbers ({error}).") from None
    # fmin and fmax ignore NaN.
    ends = np.fmin.reduce(found, None, initial=high), np.fmax.reduce(found, None, initial=low)
    for extreme in ends:
        if not low <= extreme <= high:
            raise ValueError(f"{name} holds {extreme:g}; {wanted}.")
    return found


def arrays_of(given: Mapping[str, Any], sigma: Any, angles_deg: Any, wavelength_um: Any) -> tuple:
    """Return values and errors (N, M) by quantity, angles (M,) or (N, M), wavelengths, shape."""
    angle = _numbers(
        "angles_deg", angles_deg, 0.0, 90.0, "degrees from the normal, 0 to 90, were wanted"
    )
    if not np.isfinite(angle).all():
        raise ValueError("angles_deg must be an array of finite numbers.")
    wanted = "fractions were wanted; for percent divide by 100"
    units = "numbers from -1 to 1 were wanted", "degrees were wanted"
    values = {
        q: _numbers(q, v, *_range(q), wanted if q in POWERS else units[q in ANGLES])
        for q, v in given.items()
    }
    waves = np.nan if wavelength_um is None else wavelength_um
    wavelength = _numbers("wavelength_um", waves, 0.0, np.inf, "micrometres were wanted")
    errors = sigma if isinstance(sigma, Mapping) else dict.fromkeys(values, sigma)
    least = np.nextafter(0.0, 1.0)
    errors = {
        q: _numbers(
            f"sigma of {q}", np.nan if s is None else s, least, np.inf, "it must be above 0"
        )
        for q, s in errors.items()
    }
    try:
        points = np.broadcast_shapes((1,), angle.shape[-1:], wavelength.shape)
        full = np.broadcast_shapes(points, angle.shape, *(v.shape for v in values.values()))
        if len(points) != 1 or full[-1:] != points:
            raise ValueError
        whole = {q: np.broadcast_to(v, full).reshape(-1, full[-1]) for q, v in values.items()}
        wide = {q: np.broadcast_to(s, full).reshape(-1, full[-1]) for q, s in errors.items()}
        angle = np.broadcast_to(angle, full if angle.ndim > 1 else points)
    except ValueError:
        every = {"angles_deg": angle, "wavelength_um": wavelength, **values, **errors}
        shapes = ", ".join(f"{n} {a.shape}" for n, a in every.items())
        raise ValueError(
            f"the shapes of the arrays do not go together: {shapes}. The last axis is that of the "
            "M points: angles (M,), or (..., M) if each curve has its own, and wavelengths () or "
            "(M,); the axes before it are those of the batch."
        ) from None
    stray = [q for q in wide if q not in whole]
    if stray:
        raise ValueError(
            f"sigma has errors of {stray[0]}, of which there are no data; leave it out."
        )
    stated = sigma is not None
    lacking = [q for q in whole if stated and not np.isfinite(wide.get(q, np.nan)).any()]
    if lacking:
        raise ValueError(
            f"sigma has no errors of {lacking[0]}; give them for all data, or for none."
        )
    if stated:  # a datum without an error is left out
        whole = {q: np.where(np.isfinite(wide[q]), v, np.nan) for q, v in whole.items()}
    angle = angle.reshape(-1, full[-1]) if angle.ndim > 1 else angle
    return whole, wide if stated else None, angle, np.broadcast_to(wavelength, points), full[:-1]


def start_of(
    start: Mapping[str, Any] | None, near: FitData | None, shape: tuple[int, ...]
) -> dict[str, np.ndarray] | None:
    """Return values of parameters to begin from: (K, N) each, K starts of N curves."""
    if near is None and start is None:
        return None
    if near is not None:
        known = {n: e.value for n, e in near.parameters.items() if e.free}
        if near.shape not in ((), shape):
            raise ValueError(
                f"near has the shape {near.shape}, and the curves {shape}; the fit of one curve, "
                "or of a batch of this shape, was wanted."
            )
    else:
        try:
            known = dict(start or {})
        except TypeError:
            raise ValueError(
                f"start is {str(start)[:60]}; a mapping from the names of the fitted parameters to "
                "numbers or arrays was wanted, such as {'eta': 1.5, 'k': 0.1}."
            ) from None
    out = {}
    for name, value in known.items():
        try:
            array = np.asarray(value, float) + np.zeros(shape)
            if array.shape[array.ndim > len(shape) :] != shape:
                raise ValueError
        except (TypeError, ValueError):
            raise ValueError(
                f"the start of {name} is {str(value)[:40]}, of the shape {np.shape(value)}; a real "
                f"number, or an array of them of the shape {shape}, was wanted, or several of "
                "these on an axis in front."
            ) from None
        # Where the other fit has no value its middle one serves.
        array = np.where(np.isfinite(array), array, np.nanmedian(array))
        out[name] = array.reshape(-1, max(int(np.prod(shape)), 1))
    counts = {n: len(v) for n, v in out.items() if len(v) > 1}
    if len({*counts.values()}) > 1:
        raise ValueError(
            f"start holds {', '.join(f'{k} starts of {n}' for n, k in counts.items())}; as many of "
            "each, or one for all, was wanted."
        )
    return out


def pattern_of(
    curves: Mapping[str, np.ndarray], sigma: Any, angle_deg: np.ndarray, wavelength_um: np.ndarray
) -> Measurement:
    """Return a measurement of all quantities at all points, with values that are those of none."""
    middle = {"psi": (20.0, 70.0), "delta": (60.0, 300.0), "delta_folded": (60.0, 120.0)}
    rows = len(angle_deg)
    values: dict[str, Any] = {q: np.linspace(*middle.get(q, (0.2, 0.8)), rows) for q in curves}
    return Measurement.from_columns(
        angle_deg, wavelength_um, sigma=1e-3 if sigma else None, source="the arrays", **values
    )
