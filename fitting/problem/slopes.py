"""What a model shows at given unknowns, the residuals, and the derivatives of both."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from fitting.optics.spec import NCS, Points, Spec
from fitting.problem.observations import Observations
from fitting.problem.programs import HUBER, Targets, linearised, robust
from fitting.problem.unknowns import Unknowns
from fitting.process.compiled import fit_settings
from fitting.samples.parameters import value_and_slope


def shown_at_y(
    spec: Spec, points: Points, held: np.ndarray, eta_i: Any, y: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return what each channel shows at y (p,), (K, M), and its derivatives, (K, M, p)."""
    with fit_settings():
        value, slope = map(np.asarray, linearised(y, points, held, eta_i, spec=spec))
    return value, slope


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

    @property
    def finite(self) -> bool:
        """Whether all residuals and derivatives are."""
        return bool(np.isfinite(self.residual).all() and np.isfinite(self.jacobian).all())


def slopes_at(spec: Spec, seen: Observations, targets: Targets, y: np.ndarray) -> Slopes:
    """Return residuals and derivatives with respect to the solver's coordinates y (p,)."""
    value, slope = shown_at_y(spec, targets.points, targets.held, targets.eta_i, y)
    alone = len(seen.values)
    measured, W = np.zeros_like(value), np.zeros((len(value), *value.shape))
    for i, (v, w) in enumerate(zip(seen.values, seen.weights, strict=True)):
        measured[i], W[i, i] = v[:, 0], w[:, 0]
    if NCS in seen.channels:
        measured[alone:], W[alone:, alone:] = seen.ncs[..., 0], seen.ncs_weights[..., 0]
    off = value - measured
    # Of psi without Delta only cos 2psi was measured; its residuals are three all the same.
    known, used = (np.abs(W).max(i) > 0.0 for i in (0, 1))
    used[alone:] = used[alone:].any(0)
    kind = np.array([c for c in seen.channels for _ in range(3 if c == NCS else 1)])
    return Slopes(
        value, np.einsum("jkm,km->jm", W, off)[used], np.einsum("jkm,kmp->jmp", W, slope)[used],
        np.nonzero(used)[1], off[known], kind[np.nonzero(known)[0]],
    )  # fmt: skip


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
    with np.errstate(over="ignore"):  # of the caller's own residuals
        return float((robust(loss, r, np) ** 2).sum())


def influence(loss: str, r: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return half the derivative of the loss, and its derivative."""
    if loss == "huber":
        inside = np.abs(r) <= HUBER
        return np.clip(r, -HUBER, HUBER), inside.astype(float)
    return r, np.ones_like(r)
