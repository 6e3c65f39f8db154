"""Starts of a bare surface whose index is free, from its powers over the angle: a mesh of indices."""

from __future__ import annotations

import numpy as np

from fitting.searching.batch_search import BatchSearch
from fitting.searching.starts import starts

POWERS_OF_SURFACE = ("R_s", "R_p", "R")


def of_bare_surface(search: BatchSearch) -> bool:
    """Whether all that is fitted is eta and k of one boundary, to powers alone."""
    spec = search.job.u.spec
    names = {name.rpartition(".")[2] for name in spec.moving}
    return names == {"eta", "k"} and len(spec.media.index) == 1 and set(spec.channels) <= set(
        POWERS_OF_SURFACE
    )


def mesh_starts(search: BatchSearch) -> tuple[np.ndarray, np.ndarray]:
    """Return starts (p, L) in the solver's coordinates, and the curve of each, (L,)."""
    every = np.flatnonzero(search.known)
    some = starts(search.job.u.moving, 16, 0)
    return np.tile(some, len(every)), np.repeat(every, some.shape[1])
