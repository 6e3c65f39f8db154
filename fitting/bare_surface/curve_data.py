"""The data of many curves in the form of the compiled program: selected, padded, completed."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import numpy as np

from fitting.bare_surface.reflectances import CHANNELS


class Data(NamedTuple):
    """N curves, curves first; C channels out of ``reflectances.CHANNELS``, M angles.

    cos_theta, s_share: (M,) or (N, M). values: C arrays (N, M), 0 where missing.
    weights: C arrays (M,) or (N, M), 1 / sigma, 0 where missing.
    """

    cos_theta: np.ndarray
    s_share: np.ndarray
    values: tuple[np.ndarray, ...]
    weights: tuple[np.ndarray, ...]
    eta_i: float
    channels: tuple[str, ...]
    mesh: str = "coarse"  # of `starts.MESHES`, where the curves start
    few: bool = True  # whether all calls for them are for a few curves

    def take(self, index: slice | np.ndarray) -> Data:
        """Return the curves of ``index``."""
        return self._map(lambda a, fill: a[index] if a.ndim == 2 else a)

    def padded(self, curves: int, angles: int) -> Data:
        """Return the data with empty curves and empty angles added up to these numbers."""

        def pad(a: np.ndarray, fill: float) -> np.ndarray:
            goal = (curves, angles)[-a.ndim :]
            if a.shape == goal:
                return a
            full = np.full(goal, fill) if fill else np.zeros(goal)  # np.pad takes 20 us
            full[tuple(map(slice, a.shape))] = a
            return full

        return self._map(pad)

    def with_all_channels(self) -> Data:
        """Return the data with all CHANNELS, some empty, and weights of every curve's own.

        One compiled program then serves data of all kinds.
        """
        none = np.zeros_like(self.values[0])
        values, weights = (
            dict.fromkeys(CHANNELS, none) | dict(zip(self.channels, of, strict=True))
            for of in (self.values, self.wide_weights)
        )
        return self._replace(
            values=tuple(values.values()), weights=tuple(weights.values()), channels=CHANNELS
        )

    @property
    def wide_weights(self) -> tuple[np.ndarray, ...]:
        """The weights as C arrays (N, M)."""
        return tuple(
            np.broadcast_to(w, v.shape) for w, v in zip(self.weights, self.values, strict=True)
        )

    def _map(self, change) -> Data:
        return self._replace(
            cos_theta=change(self.cos_theta, 1.0),
            s_share=change(self.s_share, 0.5),
            values=tuple(change(v, 0.0) for v in self.values),
            weights=tuple(change(w, 0.0) for w in self.weights),
        )

    @property
    def curves(self) -> int:
        """The number of curves."""
        return len(self.values[0])


class Extent(NamedTuple):
    """Where a curve has data: how many angles, the least and the largest of them (degrees; inf and
    -inf without data), and how many channels. (N,) each, or (1,) if all curves are alike."""

    count: np.ndarray
    low_deg: np.ndarray
    high_deg: np.ndarray
    channels: np.ndarray


def extent_of(data: Data, angle_deg: np.ndarray) -> Extent:
    """Return where the curves have data. angle_deg: (M,) or (N, M)."""
    angle = np.atleast_2d(angle_deg)
    if all((w > 0.0).all() for w in data.weights):
        count, channels = np.array([[angle.shape[1]], [len(data.weights)]])
        return Extent(count, angle.min(1), angle.max(1), channels)
    used = np.array([np.atleast_2d(w) > 0.0 for w in data.weights])
    some = np.logical_or.reduce(used)
    channels = used.any(2).sum(0)
    low = np.where(some, angle, np.inf).min(1)
    return Extent(some.sum(1), low, np.where(some, angle, -np.inf).max(1), channels)


def of_rows(of: Any, rows: np.ndarray) -> Any:
    """Return the rows of every array in a tuple of them, however nested."""
    return jax.tree.map(lambda a: np.asarray(a)[rows], of)


def put_rows(old: Any, new: Any, rows: Any) -> Any:
    """Return ``old`` with ``new`` in the rows of every array in it."""

    def put(a: Any, b: Any) -> np.ndarray:
        out = np.array(a)
        out[rows] = b
        return out

    return jax.tree.map(put, old, new)
