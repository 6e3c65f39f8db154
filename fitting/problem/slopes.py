"""What a model shows at given unknowns, the residuals, and the derivatives of both; its index."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fitting.optics.spec import NCS, Spec
from fitting.problem.observations import Observations
from fitting.problem.programs import HUBER, Targets, linearised, robust, without_data
from fitting.problem.programs_in_parts import Parts, filled, in_parts
from fitting.problem.row_blocks import ROWS, SLOTS, Blocks
from fitting.problem.unknowns import Unknowns
from fitting.process.compiled import fit_settings
from fitting.samples.parameters import value_and_slope


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


class Slopes(NamedTuple):
    """The model and the residuals at y, row by row, with their derivatives.

    seen: (K, M), NCS as three. residual: (R,) weighted, jacobian (R, p), row:
    (R,) of the points; plain: without weights, of what was measured; kind: the channel of each of
    these.
    """

    seen: np.ndarray
    residual: np.ndarray
    jacobian: np.ndarray
    row: np.ndarray
    plain: np.ndarray
    kind: np.ndarray


def slopes_at(seen: Observations, shown: Shown, y: np.ndarray) -> Slopes:
    """Return residuals and derivatives with respect to the solver's coordinates y (p,)."""
    value, slope = shown(y)
    residual, jacobian, row, plain, kind = [], [], [], [], []
    alone = [c for c in seen.channels if c != NCS]
    for i, (channel, v, w) in enumerate(zip(alone, seen.values, seen.weights, strict=True)):
        rows = np.flatnonzero(w[:, 0] > 0.0)
        off = value[i, rows] - v[rows, 0]
        residual.append(off * w[rows, 0])
        jacobian.append(slope[i, rows] * w[rows])
        row.append(rows)
        plain.append(off)
        kind += [channel] * len(rows)
    if NCS in seen.channels:
        at = len(alone)
        weights = seen.ncs_weights[..., 0]
        rows = np.flatnonzero(np.abs(weights).sum((0, 1)) > 0.0)
        off = value[at : at + 3, rows] - seen.ncs[:, rows, 0]
        for i in range(3):
            residual.append((weights[i][:, rows] * off).sum(0))
            jacobian.append(np.einsum("jm,jmp->mp", weights[i][:, rows], slope[at:, rows]))
            row.append(rows)
            # Of psi without Delta only cos 2psi was measured.
            known = np.abs(weights[:, i, rows]).sum(0) > 0.0
            plain.append(off[i, known])
            kind += [NCS] * int(known.sum())
    r, J, at_row, off = (np.concatenate(a) for a in (residual, jacobian, row, plain))
    return Slopes(value, r, J, at_row, off, np.array(kind))


def prior_rows(u: Unknowns, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return residuals (..., K) of the priors at y (..., p), and their derivatives (..., K, p)."""
    some = [i for i, unknown in enumerate(u.moving) if unknown.prior is not None]
    off, rows = np.zeros((*y.shape[:-1], len(some))), np.zeros((*y.shape[:-1], len(some), u.size))
    for row, i in enumerate(some):
        mean, sigma = u.moving[i].prior  # type: ignore[misc]
        value, slope = value_and_slope(u.moving[i].parameter.coordinate, y[..., i])
        rows[..., row, i] = np.minimum(slope, 1e12) / sigma
        off[..., row] = (value - mean) / sigma
    return off, rows


def loss_of(loss: str, r: np.ndarray) -> float:
    """Return the sum of the loss of residuals in standard deviations."""
    return float((robust(loss, r, np) ** 2).sum())


def influence(loss: str, r: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return half the derivative of the loss, and its derivative."""
    if loss == "huber":
        inside = np.abs(r) <= HUBER
        return np.clip(r, -HUBER, HUBER), inside.astype(float)
    return r, np.ones_like(r)
