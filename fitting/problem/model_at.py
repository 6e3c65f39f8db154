"""What the model of a fit shows at given unknowns, its derivatives, and the index of a medium."""

from __future__ import annotations

import numpy as np

from fitting.optics.spec import Spec
from fitting.problem.programs import Targets, linearised, without_data
from fitting.problem.programs_in_parts import Parts, filled, in_parts
from fitting.problem.row_blocks import ROWS, SLOTS, Blocks
from fitting.process.compiled import fit_settings


class Shown:
    """What each channel of a fit shows, formed at many y: what stays the same is formed once."""

    def __init__(self, spec: Spec, targets: Targets):
        self.spec, self.targets = spec, without_data(targets)
        with fit_settings():
            self.parts = Parts(spec, self.targets) if in_parts(spec, targets) else None

    def __call__(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return what each channel shows at y (p,), (K, M), and its derivatives, (K, M, p)."""
        with fit_settings():
            if self.parts is None:
                value, slope = linearised(self.targets, y, spec=self.spec)
                return np.asarray(value), np.asarray(slope)
            each = [_of_blocks(self.parts, blocks, y) for blocks in self.parts.blocks]
        value, slope = (np.concatenate(a, 1) for a in zip(*each, strict=True))
        return value, slope


def _of_blocks(parts: Parts, blocks: Blocks, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the part of `Shown` in some blocks."""
    trial = np.repeat(filled(y[:, None]), SLOTS, 1)
    moving, columns = parts.quantities(trial, np.zeros(blocks.columns, int), blocks)
    shown, slopes = (
        np.asarray(a).reshape(*a.shape[:-1], ROWS, blocks.columns)[..., : blocks.count]
        for a in parts.shown(moving, blocks)
    )
    by_unknown = sum(
        d[..., None] * np.moveaxis(np.asarray(c)[: len(y), :, : blocks.count], 0, -1)
        for d, c in zip(slopes, columns, strict=True)
    )
    # rows before columns
    each = np.swapaxes(shown, 1, 2), np.swapaxes(by_unknown, 1, 2)
    value, slope = (a.reshape(len(a), -1, *a.shape[3:]) for a in each)
    return value, slope


def index_in_parts(parts: Parts, y: np.ndarray, medium: int) -> np.ndarray:
    """Return eta and k of a medium, (2, M, L), at y (p, L), by the solver's programs."""
    count = y.shape[1]
    found = np.empty((2, ROWS * sum(blocks.count for blocks in parts.blocks), count))
    if medium not in parts.core.indices:
        known = [i for i in range(len(parts.spec.media.index)) if i not in parts.core.indices]
        at = 2 * known.index(medium)
        for blocks in parts.blocks:
            for part, x in zip(found, blocks.known[at : at + 2], strict=True):
                of_rows = np.asarray(x).reshape(ROWS, blocks.columns)[:, : blocks.count]
                part[blocks.rows] = of_rows.T.reshape(-1, 1)
        return found
    at = 2 * parts.core.indices.index(medium)
    for begin in range(0, count, SLOTS):
        some = filled(y[:, np.minimum(np.arange(begin, begin + SLOTS), count - 1)])
        for blocks in parts.blocks:
            for slots, slot in blocks.calls(np.arange(min(SLOTS, count - begin))):
                moving, _ = parts.quantities(some, slot, blocks)
                for part, x in zip(found, map(np.asarray, moving[at : at + 2]), strict=True):
                    x = x.reshape(ROWS, blocks.columns)[:, slot < SLOTS]
                    by_lane = x.reshape(ROWS, len(slots), blocks.count).transpose(2, 0, 1)
                    part[blocks.rows, begin + slots] = by_lane.reshape(-1, len(slots))
    return found
