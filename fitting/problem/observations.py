"""Measurements as the rows and channels with which a model is compared."""

from __future__ import annotations

from collections.abc import Sequence
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

    @property
    def squares(self) -> float:
        """The sum of squares of the data in units of their errors."""
        return float(squares_of(self).sum())


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
    psi: np.ndarray, delta: np.ndarray, sigma_psi: np.ndarray, sigma_delta: np.ndarray, stated: bool
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
    for i, key in enumerate(
        zip(
            file.tolist(),
            angle.tolist(),
            wave.tolist(),
            share.tolist(),
            (mirrored & (not compared)).tolist(),
            strict=True,
        )
    ):
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
    values, weights = [], []
    for q in channels:
        if q == NCS:
            continue
        here = quantity == q
        v, w = np.zeros((total, 1)), np.zeros((total, 1))
        v[row[here], 0] = value[here]
        w[row[here], 0] = 1.0 / error[here] if stated else 1.0
        values.append(v)
        weights.append(w)
    ncs, ncs_weights = np.empty((3, 0, 1)), np.empty((3, 3, 0, 1))
    if compared:
        ncs, ncs_weights = _ellipsometry(quantity, row, value, error, total, stated)
    return Observations(
        tuple(channels), curves, points, tuple(values), tuple(weights), ncs, ncs_weights,
        row, quantity, channel, curve, curve_names, stated,
    )  # fmt: skip


def labels_of(sources: list[str]) -> list[str]:
    """Return the names of the files, with a number added where they are the same."""
    return [
        s if sources.count(s) == 1 else f"{s}#{sources[:i].count(s) + 1}"
        for i, s in enumerate(sources)
    ]


def _ellipsometry(quantity, row, value, error, total: int, stated: bool):
    psi_rows, delta_rows = quantity == "psi", np.isin(quantity, DELTAS)
    if not (psi_rows.any() or delta_rows.any()):
        return np.empty((3, 0, 1)), np.empty((3, 3, 0, 1))
    table = np.full((4, total), np.nan)
    for i, here in ((0, psi_rows), (1, delta_rows)):
        table[i, row[here]] = value[here]
        table[2 + i, row[here]] = error[here]
    lone = int((np.isnan(table[0]) & ~np.isnan(table[1])).sum())
    if lone:
        raise ValueError(
            f"{lone} of the values of Delta have no psi at the same angle and wavelength, together "
            "with which they are compared. Give psi too, or leave these values of Delta out."
        )
    some = ~np.isnan(table[0])
    psi, delta, sigma_psi, sigma_delta = table[:, some]
    ncs, weights = np.zeros((3, total, 1)), np.zeros((3, 3, total, 1))
    ncs[:, some, 0] = ncs_of(psi, np.where(np.isnan(delta), 0.0, delta))
    weights[:, :, some, 0] = ncs_weights(psi, delta, sigma_psi, sigma_delta, stated)
    return ncs, weights


def missing_errors(measurements: Sequence[Measurement], errors: str) -> tuple[Warning, ...]:
    """Return the note on data without a standard error, where others have one."""
    known = np.concatenate([np.isfinite(m.sigma) for m in measurements])
    if errors == "equal" or known.all() or not known.any():
        return ()
    return (Warning("sigma_missing", {}, {"missing": int((~known).sum()), "of": len(known)}),)
