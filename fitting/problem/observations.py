"""Measurements as the rows and channels with which a model is compared."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from fitting.data.measurement import Measurement
from fitting.data.quantities import ANGLES, DELTAS, QUANTITIES
from fitting.optics.spec import NCS, Points
from fitting.results.diagnostics import Warning

# The number of rows is rounded up to a multiple, with rows of weight 0, so that a few compiled
# programs serve all files.
_LEAST_ROWS, _MULTIPLE = 16, 64


class Observations(NamedTuple):
    """M rows of points (padded), and the values that were measured there.

    channels: the measured quantities, with NCS for psi and Delta as the last one. values, weights:
    one (M, 1) array for each of them except NCS; weight 0: not measured.
    ncs, ncs_weights: (3, M, 1) measured N, C, S and (3, 3, M, 1): residual_i = sum_j W_ij (model -
    measured)_j; empty arrays without ellipsometry.
    row, quantity, channel: (N,) of every datum; the channel of psi and delta is NCS.
    curve: (N,), curve_names: which quantity of which file a datum belongs to.
    """

    channels: tuple[str, ...]
    curves: tuple[tuple[int, ...], ...]
    points: Points
    values: tuple[np.ndarray, ...]
    weights: tuple[np.ndarray, ...]
    ncs: np.ndarray
    ncs_weights: np.ndarray
    row: np.ndarray
    quantity: np.ndarray
    channel: np.ndarray
    curve: np.ndarray
    curve_names: tuple[str, ...]
    stated: bool

    @property
    def measured(self) -> np.ndarray:
        """Which of the rows are no padding, (M,) bool."""
        return np.arange(self.points.wavelength_um.shape[0]) <= self.row.max()


def squares_of(data: Any) -> np.ndarray:
    """Return the sum of squares of `Observations` or targets in units of their errors, (L,)."""
    own = [(v * w) ** 2 for v, w in zip(data.values, data.weights, strict=True)]
    if np.size(data.ncs):
        own += [*np.einsum("ijml,jml->iml", data.ncs_weights, data.ncs) ** 2]
    return np.sum(own, (0, 1)) if own else np.zeros(1)  # none of the caller's own residuals


def padded(rows: int) -> int:
    """Return the number of rows that a program is compiled for."""
    if rows <= 2 * _MULTIPLE:
        return max(_LEAST_ROWS, 1 << (rows - 1).bit_length())
    return -(-rows // _MULTIPLE) * _MULTIPLE


def ncs_of(psi_deg: np.ndarray, delta_deg: np.ndarray) -> np.ndarray:
    """Return cos 2psi, sin 2psi cos Delta, sin 2psi sin Delta, (3, ...)."""
    two_psi, delta = np.radians(2.0 * np.asarray(psi_deg)), np.radians(delta_deg)
    return np.stack([
        np.cos(two_psi), np.sin(two_psi) * np.cos(delta), np.sin(two_psi) * np.sin(delta)
    ])  # fmt: skip


def ncs_directions(psi_deg: np.ndarray, delta_deg: np.ndarray) -> np.ndarray:
    """Return the unit vectors along which psi, Delta and depolarization act, (3, 3, ...).

    N, C, S of pure light is a point of a sphere; psi moves it along a meridian, by 2 for each
    radian, Delta along a parallel, by sin 2psi.
    """
    two_psi, delta = np.radians(2.0 * np.asarray(psi_deg)), np.radians(delta_deg)
    zero = np.zeros_like(two_psi)
    along_psi = [-np.sin(two_psi), np.cos(two_psi) * np.cos(delta), np.cos(two_psi) * np.sin(delta)]
    along_delta = [zero, -np.sin(delta), np.cos(delta)]
    return np.stack([np.stack(along_psi), np.stack(along_delta), ncs_of(psi_deg, delta_deg)])


def ncs_weights(
    psi: np.ndarray, delta: np.ndarray, sigma_psi: np.ndarray, sigma_delta: Any, stated: bool
) -> np.ndarray:
    """Return W (3, 3, ...) for pairs of psi and Delta; where Delta is NaN, for psi by N alone."""
    alone = np.isnan(delta)
    axes = ncs_directions(psi, np.where(alone, 0.0, delta))
    if not stated:
        weights = np.zeros_like(axes)
        weights[[0, 1, 2], [0, 1, 2]] = 1.0
        weights[:, :, alone] = np.array([1.0, 0, 0, 0, 0, 0, 0, 0, 0]).reshape(3, 3, 1)
        return weights
    of_psi = np.radians(2.0 * sigma_psi)
    # At a pole Delta has no effect, but an error of psi moves the point in any direction.
    reach = np.maximum(np.abs(np.sin(np.radians(2.0 * psi))), of_psi)
    of_delta = np.radians(np.where(alone, 1.0, sigma_delta)) * reach
    # Fully polarized light has no third error. But a model off the sphere, or on its far side, must
    # not count as near: the larger of the two errors ensures that without adding information.
    sigmas = np.stack([of_psi, of_delta, np.maximum(of_psi, of_delta)])
    weights = axes / sigmas[:, None]
    only_n = np.zeros_like(weights)
    only_n[0, 0] = 1.0 / (of_psi * np.maximum(np.abs(np.sin(np.radians(2.0 * psi))), of_psi))
    return np.where(alone, only_n, weights)


def data_of(
    channels: Sequence[str], values: Mapping[str, np.ndarray], sigma: Mapping[str, Any] | None
) -> dict[str, Any]:
    """Return values, weights, ncs and ncs_weights as `Observations` has them, in lanes.

    values: (M, L) by quantity, NaN where it was not measured; sigma: their errors.
    """
    known = {q: np.isfinite(v) for q, v in values.items()}
    given = {q: sigma[q] if sigma else np.ones(()) for q in values}
    errors = {q: np.where(known[q] & np.isfinite(e), e, 1.0) for q, e in given.items()}
    alone = [c for c in channels if c != NCS]
    out: dict[str, Any] = {
        "values": tuple(np.where(known[q], values[q], 0.0) for q in alone),
        "weights": tuple(known[q] / errors[q] for q in alone),
    }
    if "psi" not in values:
        return out
    name, some = next((q for q in DELTAS if q in values), ""), known["psi"]
    psi = np.where(some, values["psi"], 45.0)
    delta = np.where(some, values.get(name, np.nan), 0.0)
    W = ncs_weights(psi, delta, errors["psi"], errors.get(name, 1.0), sigma is not None)
    ncs = np.where(some, ncs_of(psi, np.nan_to_num(delta)), 0.0)
    return out | {"ncs": ncs, "ncs_weights": np.where(some, W, 0.0)}


def _repeated(wavelength_um: np.ndarray) -> dict[str, np.ndarray]:
    """Return `Points.distinct_um` and `place`; empty arrays if that saves no padded row."""
    distinct, place = np.unique(wavelength_um, return_inverse=True)
    size = padded(len(distinct))
    if len(distinct) == 1 or size == len(wavelength_um):
        return {}
    full = np.pad(distinct, (0, size - len(distinct)), mode="edge")
    return {"distinct_um": full[:, None], "place": place.astype(np.int32)}


def observations(
    measurements: Sequence[Measurement], errors: str, compared: bool = True
) -> Observations:
    """Return rows and channels of measurements; with ``errors`` "equal" stated ones are not used.

    compared: whether there are values to compare with, or only points to predict at.

    A row is a point (file, angle, wavelength, polarizer); a repeated point gets a new row.
    Raises ValueError for Delta without psi.
    """
    file = np.concatenate([np.full(len(m), i) for i, m in enumerate(measurements)])
    quantity, angle, wavelength, share, value, error = (
        np.concatenate([getattr(m, name) for m in measurements])
        for name in ("quantity", "angle_deg", "wavelength_um", "s_share", "value", "sigma")
    )
    stated = errors != "equal" and bool(np.isfinite(error).all())
    wave = np.where(np.isnan(wavelength), -1.0, wavelength)
    mirrored = quantity == "delta_folded"
    row = np.empty(len(value), int)
    rows: dict[tuple[float, ...], int] = {}
    seen: dict[tuple, int] = {}
    columns = file, angle, wave, share, mirrored & (not compared)
    for i, key in enumerate(zip(*(a.tolist() for a in columns), strict=True)):
        again = (*key, quantity[i])
        repeat = seen[again] = seen.get(again, -1) + 1
        row[i] = rows.setdefault((*key, repeat), len(rows))
    total = padded(len(rows))
    fill = total - len(rows)
    keys = np.array([*rows, *[next(iter(rows))] * fill])
    points = Points(
        keys[:, 1:2], np.where(keys[:, 2:3] < 0.0, 1.0, keys[:, 2:3]), keys[:, 3:4],
        keys[:, 0].astype(np.int32),
    )  # fmt: skip
    points = points._replace(**_repeated(points.wavelength_um[:, 0]))
    if mirrored.any():
        points = points._replace(folded=np.isin(np.arange(total), row[mirrored])[:, None])
    channels = [q for q in QUANTITIES if q not in ANGLES and (quantity == q).any()]
    pairs = np.isin(quantity, ANGLES)
    channel = np.where(pairs, NCS, quantity)
    if pairs.any():
        channels.append(NCS)
    names: dict[tuple[int, str], int] = {}
    several = len(measurements) > 1
    curve = np.array([
        names.setdefault((f, q), len(names))
        for f, q in zip(file.tolist(), channel.tolist(), strict=True)
    ])  # fmt: skip
    labels = labels_of([m.source for m in measurements])
    curve_names = tuple(f"{labels[f]} {q}" if several else q for f, q in names)
    first = {q: i for (_, q), i in reversed(names.items())}
    curves = tuple(
        tuple(names.get((f, q), first[q]) for f in range(len(measurements))) for q in channels
    )
    table, sigma = {}, {}
    for q in dict.fromkeys(quantity.tolist()):
        here, name = quantity == q, "delta" if q in DELTAS else q
        for of, column in ((table, value), (sigma, error)):
            of.setdefault(name, np.full((total, 1), np.nan))[row[here], 0] = column[here]
    lone = np.isfinite(table.get("delta", np.nan)) & np.isnan(table.get("psi", np.nan))
    if compared and lone.any():
        raise ValueError(
            f"{int(lone.sum())} of the values of Delta have no psi at the same angle and "
            "wavelength, together with which they are compared. Give psi too, or leave these "
            "values of Delta out."
        )
    none = {"ncs": np.empty((3, 0, 1)), "ncs_weights": np.empty((3, 3, 0, 1))}
    data = data_of(channels, table, sigma if stated else None)
    return Observations(
        tuple(channels), curves, points, **(none | data), row=row, quantity=quantity,
        channel=channel, curve=curve, curve_names=curve_names, stated=stated,
    )  # fmt: skip


def labels_of(sources: list[str]) -> list[str]:
    """Return the names of the files, with a number added where they are the same."""
    return [
        s if sources.count(s) == 1 else f"{s}#{sources[:i].count(s) + 1}"
        for i, s in enumerate(sources)
    ]


def numbers(name: str, came: Any) -> np.ndarray:
    """Return an array of floats, or raise ValueError with the name if it has other values."""
    try:
        found = np.asarray(came)
    except ValueError:  # a ragged list
        found = np.asarray(None)
    if found.dtype.kind not in "iuf":
        raise ValueError(f"{name} is {repr(came)[:60]}; real numbers were wanted.")
    return found.astype(float)


def points_of(angle_deg: Any, quantity: Any, wavelength_um: Any = None) -> Measurement:
    """Return points that the caller names as a measurement without values."""
    waves = numbers("wavelength_um", np.nan if wavelength_um is None else wavelength_um)
    strange = waves[~(np.isnan(waves) | ((waves > 0.0) & np.isfinite(waves)))]
    if strange.size:
        raise ValueError(f"wavelength_um holds {strange[0]:g}; micrometres above 0 were wanted.")
    angle = np.atleast_1d(numbers("the angle of incidence", angle_deg))
    if angle.ndim != 1 or not angle.size:
        raise ValueError(f"angles of shape {angle.shape} came; a number or one axis was wanted.")
    strange = angle[~((angle >= 0.0) & (angle <= 90.0))]
    if strange.size:
        raise ValueError(
            f"an angle of incidence of {strange[0]:g} degrees came; 0 to 90 degrees from the "
            "normal of the surface were wanted."
        )
    columns = angle, np.asarray(quantity), waves
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


def missing_errors(measurements: Sequence[Measurement], errors: str) -> tuple[Warning, ...]:
    """Return the note on data without a standard error, where others have one."""
    known = np.concatenate([np.isfinite(m.sigma) for m in measurements])
    if errors == "equal" or known.all() or not known.any():
        return ()
    return (Warning("sigma_missing", {}, {"missing": int((~known).sum()), "of": len(known)}),)
