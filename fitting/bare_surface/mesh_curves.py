"""The curves of the mesh at the angles that many curves share, kept from call to call."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
from jax import Array

from fitting.bare_surface.curve_data import Data
from fitting.bare_surface.mesh import MESHES, node_curves
from fitting.bare_surface.reflectances import Curves
from fitting.process.compiled import compiled

# A mesh has as many nodes as some hundred lanes (3,000 for R_p alone), and to evaluate them takes
# as long as a third of the fit of 64 curves. Most calls are at angles that an earlier one had.
# Up to that many angles (19 MB with every channel and the largest mesh) they are kept.
KEPT, KEPT_ANGLES = 4, 256


def _evaluated(
    cos_theta: Any, s_share: Any, *, channels: tuple[str, ...], mesh: str
) -> tuple[Array, ...]:
    return node_curves(Curves(cos_theta[:, None], s_share[:, None], (), ()), channels, mesh)


_evaluated = compiled(_evaluated, ("channels", "mesh"))


@functools.lru_cache(maxsize=KEPT)
def _kept(
    cos_theta: bytes, s_share: bytes, channels: tuple[str, ...], mesh: str
) -> tuple[Array, ...]:
    cos, share = np.frombuffer(cos_theta), np.frombuffer(s_share)
    return _evaluated(cos, share, channels=channels, mesh=mesh)


def mesh_curves(data: Data, searched: bool) -> tuple[Any, ...]:
    """Return `mesh.node_curves` at shared angles, one (J, M, 1) a channel; else nothing.

    searched: whether a lane starts from the mesh; if none does zeros will do.
    """
    if data.cos_theta.ndim == 2:
        return ()
    channels, mesh = data.channels, data.mesh
    if len(data.cos_theta) <= KEPT_ANGLES:
        return _kept(data.cos_theta.tobytes(), data.s_share.tobytes(), channels, mesh)
    if searched:
        return _evaluated(data.cos_theta, data.s_share, channels=channels, mesh=mesh)
    shape = MESHES[mesh].index.shape[1], len(data.cos_theta), 1
    return (np.zeros(shape, np.float32 if mesh == "coarse" else np.float64),) * len(channels)
