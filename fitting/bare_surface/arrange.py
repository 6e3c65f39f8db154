"""The curves to be fitted, from a Measurement or from arrays."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from fitting.bare_surface.curve_data import Data
from fitting.bare_surface.reflectances import CHANNELS
from fitting.data.checks import EXCURSION, unmasked
from fitting.data.measurement import Measurement


class Arranged(NamedTuple):
    """Curves in a row, and their place in the batch or the measurement.

    shape: the batch shape that the results take. stated: whether weights are 1 / sigma.
    angle_deg: (M,) or (N, M). wavelength_um: (N,). rows: of a Measurement, at which channel, curve
    and angle each datum stands, (3, data).
    """

    data: Data
    shape: tuple[int, ...]
    stated: bool
    angle_deg: np.ndarray
    wavelength_um: np.ndarray
    rows: np.ndarray = np.empty((3, 0), int)


def of_measurement(m: Measurement, eta_i: float, errors: str) -> Arranged:
    """Return the curves of a measurement, one for each wavelength, in rising order.

    errors: with "equal" the stated ones are not used.
    """
    stated = errors != "equal" and bool(np.isfinite(m.sigma).all())
    wavelengths, curve = np.unique(m.wavelength_um, return_inverse=True)  # NaN is one value, last
    share, channels = m.s_share, tuple(c for c in CHANNELS if (m.quantity == c).any())
    # One row of a curve holds at most one datum of each channel: a repeated datum gets a new row.
    rows: list[dict[tuple[float, float, int], int]] = [{} for _ in wavelengths]
    seen: dict[tuple[int, str, float, float], int] = {}
    place = np.empty(len(m), int)
    for i, (c, q, a, s) in enumerate(
        zip(curve.tolist(), m.quantity.tolist(), m.angle_deg.tolist(), share.tolist(), strict=True)
    ):
        repeat = seen[c, q, a, s] = seen.get((c, q, a, s), -1) + 1
        place[i] = rows[c].setdefault((a, s, repeat), len(rows[c]))
    longest = max(map(len, rows))
    shape = (len(wavelengths), longest)
    angle, s_share = np.zeros(shape), np.full(shape, 0.5)
    angle[curve, place], s_share[curve, place] = m.angle_deg, share
    values, weights = [], []
    for channel in channels:
        value, weight = np.zeros(shape), np.zeros(shape)
        here = m.quantity == channel
        value[curve[here], place[here]] = m.value[here]
        weight[curve[here], place[here]] = 1.0 / m.sigma[here] if stated else 1.0
        values.append(value)
        weights.append(weight)
    if (angle == angle[0]).all() and (s_share == s_share[0]).all():
        angle, s_share = angle[0], s_share[0]
    return Arranged(
        Data(
            np.cos(np.radians(angle)), s_share, tuple(values), tuple(weights), eta_i, channels
        ),
        () if len(wavelengths) == 1 else (len(wavelengths),),
        stated, angle, wavelengths,
        np.array([[channels.index(q) for q in m.quantity.tolist()], curve, place]),
    )  # fmt: skip


def _checked(name: str, array: Any, low: float, high: float, wanted: str) -> np.ndarray:
    try:
        came = np.asarray(unmasked(array))
        if came.dtype.kind == "c":
            raise TypeError("complex ones came")
        array = np.asarray(came, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name} must be real numbers ({error}).") from error
    # fmin and fmax ignore NaN without an array of truth values, in a third of the time.
    extremes = np.fmin.reduce(array, None, initial=high), np.fmax.reduce(array, None, initial=low)
    for extreme in extremes:
        if not low <= extreme <= high:
            raise ValueError(f"{name} holds {extreme:g}; {wanted}.")
    return array


def of_arrays(angles_deg: Any, channels: Mapping[str, Any], sigma: Any, eta_i: float) -> Arranged:
    """Return the curves of arrays (..., M); see `fit_many`."""
    angle = _checked(
        "angles_deg", angles_deg, 0.0, 90.0, "degrees from the normal, 0 to 90, were wanted"
    )
    if angle.ndim == 0 or not np.isfinite(angle).all():
        raise ValueError(
            "angles_deg must be an array of finite numbers, whose last axis is the angle."
        )
    wanted = "fractions were wanted; for percent divide by 100"
    given = {
        name: _checked(name, value, -EXCURSION, 1.0 + EXCURSION, wanted)
        for name, value in channels.items()
        if value is not None
    }
    if not given:
        raise ValueError("no reflectance came; one or more of R_s, R_p and R were wanted.")
    sigmas = sigma if isinstance(sigma, Mapping) else dict.fromkeys(given, sigma)
    stray = [name for name in sigmas if name not in given]
    if stray:
        raise ValueError(
            f"sigma has errors of {stray[0]}, of which there are no data; leave it out."
        )
    stated = any(s is not None for s in sigmas.values())
    lacking = [name for name in given if sigmas.get(name) is None]
    if stated and lacking:
        raise ValueError(
            f"sigma has no errors of {lacking[0]}; give them for all data, or for none."
        )
    errors = {
        name: _checked(f"sigma of {name}", s, np.nextafter(0.0, 1.0), np.inf, "it must be above 0")
        for name, s in sigmas.items()
        if stated
    }
    try:
        full = np.broadcast(angle, *given.values()).shape
        wide, broad = (
            {n: v if v.shape == full else np.broadcast_to(v, full) for n, v in some.items()}
            for some in (given, errors)
        )
    except ValueError as error:
        shapes = ", ".join(
            f"{n} {v.shape}" for n, v in {"angles_deg": angle, **given, **errors}.items()
        )
        raise ValueError(
            f"the shapes do not broadcast: {shapes}. The last axis is the angle, the others are "
            "the batch of curves."
        ) from error
    angles = full[-1]
    if angle.shape[-1] != angles or angles == 0:
        raise ValueError(
            f"{angle.shape[-1]} angles and {angles} data for each curve came; equal numbers were "
            "wanted."
        )
    one_set = angle.size == angles
    angle = angle.reshape(-1) if one_set else np.broadcast_to(angle, full).reshape(-1, angles)
    values, weights = [], []
    for name, value in wide.items():
        value, weight = value.reshape(-1, angles), np.ones(angles)
        gaps = np.isnan(value)
        if errors:
            error, shared = errors[name], errors[name].shape in ((), (1,), (angles,))
            # (M,) where all curves share the errors.
            weight = weight / (error if shared else broad[name].reshape(-1, angles))
            gaps = gaps | np.isnan(weight)
        if gaps.any():
            value, weight = np.where(gaps, 0.0, value), np.where(gaps, 0.0, weight)
        values.append(value)
        weights.append(weight)
    if len({w.ndim for w in weights}) > 1:
        weights = [np.broadcast_to(w, v.shape) for w, v in zip(weights, values, strict=True)]
    share = np.full_like(angle, 0.5)
    data = Data(
        np.cos(np.radians(angle)), share, tuple(values), tuple(weights), eta_i, tuple(given)
    )
    return Arranged(data, full[:-1], stated, angle, np.full(data.curves, np.nan))
