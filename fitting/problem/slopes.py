"""Residuals and derivatives of one fit at a place, row by row, with those of its priors."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fitting.optics.spec import NCS
from fitting.problem.model_at import Shown
from fitting.problem.observations import Observations
from fitting.problem.programs import HUBER, robust
from fitting.problem.unknowns import Unknowns
from fitting.samples.parameters import value_and_slope


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
