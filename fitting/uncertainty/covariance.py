"""Residuals and derivatives at the best minimum: the last step, covariance, what is not seen."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from fitting.optics.observe import NCS
from fitting.problem.model_at import Shown
from fitting.problem.observations import Observations
from fitting.problem.problem import HUBER, STUDENT, robust
from fitting.problem.unknowns import Unknowns
from fitting.samples.parameters import value_and_slope

# A direction in which the data change by less than this share of what they change along the best
# known one is not seen: below it derivatives are rounding.
UNSEEN = 1e-7
# A parameter has no error of its own if so much of it lies along what is not seen.
SHARE = 1e-3


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
    if loss == "student":
        q = 1.0 + r * r / STUDENT
        return r / q, (1.0 - r * r / STUDENT) / q**2
    return r, np.ones_like(r)


class Uncertainty(NamedTuple):
    """Covariance in the solver's coordinates, (..., p, p), with the quantities behind it.

    Of one minimum, or of a batch (...). at_bound: (..., p) "", "low" or "high". directions: (...,
    p, p), in columns, in units in which every parameter changes the data equally; hidden: (..., p),
    which of them the data do not determine; unseen_of: (..., p) parameters without an error.
    variance: the factor on the covariance; step: the undamped step from here, (..., p).
    wide: (..., p, p) covariance without bounds, for a variance of 1; wide_step: (..., p) the step
    without bounds.
    rise: the increase of the cost at one standard error (the variance; for a robust loss times its
    mean curvature).
    """

    covariance: np.ndarray
    at_bound: np.ndarray
    directions: np.ndarray
    hidden: np.ndarray
    unseen_of: np.ndarray
    variance: Any
    step: np.ndarray
    wide: np.ndarray
    wide_step: np.ndarray
    rise: Any

    @property
    def unseen(self) -> np.ndarray:
        """The directions (p, u) that the data do not determine, of one minimum."""
        return self.directions[:, self.hidden]

    @property
    def edge(self) -> np.ndarray:
        """Standard errors (..., p) of the coordinates without bounds, for a variance of 1."""
        with np.errstate(invalid="ignore"):
            return np.sqrt(np.diagonal(self.wide, axis1=-2, axis2=-1))


class Inverse(NamedTuple):
    """(J^T J)^-1 (..., p, p), the least-squares step (..., p), and what is not seen.

    NaN (of the step 0) for unknowns that are not used. directions, hidden: see `Uncertainty`.
    """

    covariance: np.ndarray
    step: np.ndarray
    directions: np.ndarray
    hidden: np.ndarray


def inverse_of(rows: np.ndarray, b: np.ndarray, use: np.ndarray) -> Inverse:
    """Return the inverse of derivatives (..., R, p) over the unknowns ``use``, (..., p).

    b: residuals (..., R). In units in which every column has length 1, so that it does not matter
    what a parameter is measured in.
    """
    p = rows.shape[-1]
    size = np.linalg.norm(rows, axis=-2)
    unit = np.where(use & (size > 0.0), size, 1.0)
    # An unknown that is not used gets a row of its own, which parts it from all others; these rows,
    # 0 for the rest, also complete the space where there are fewer data than unknowns.
    own = np.where(use, 0.0, 1.0)[..., None] * np.eye(p)
    A = np.concatenate([np.where(use[..., None, :], rows / unit[..., None, :], 0.0), own], -2)
    both = np.concatenate([A, np.pad(b, [(0, 0)] * (b.ndim - 1) + [(0, p)])[..., None]], -1)
    # The triangle of a QR decomposition has the same singular values, and far fewer rows.
    triangle = np.linalg.qr(both, mode="r")
    U, values, V = np.linalg.svd(triangle[..., :-1], full_matrices=False)
    good = values > UNSEEN * values.max(-1, keepdims=True)
    inverse = np.where(good, 1.0 / np.where(good, values, 1.0), 0.0)
    along = np.swapaxes(V, -1, -2)
    with np.errstate(over="ignore"):  # of what has hardly an effect the variance is infinite
        covariance = (along * inverse[..., None, :] ** 2) @ V
        covariance = covariance / (unit[..., :, None] * unit[..., None, :])
    taken = (np.swapaxes(U, -1, -2) @ triangle[..., -1:])[..., 0]
    step = -(along @ (inverse * taken)[..., None])[..., 0] / unit
    both_used = use[..., :, None] & use[..., None, :]
    return Inverse(
        np.where(both_used, covariance, np.nan), np.where(use, step, 0.0),
        np.where(use[..., None], along, 0.0), ~good,
    )  # fmt: skip


def uncertainty(
    u: Unknowns,
    residual: np.ndarray,
    jacobian: np.ndarray,
    y: np.ndarray,
    limits: tuple[np.ndarray, np.ndarray],
    noise: float,
    dof: Any,
    scaled: bool,
    stated: bool,
    pooled: float | None = None,
) -> Uncertainty:
    """Return the uncertainty of the unknowns at y (..., p), of one minimum or of a batch.

    residual, jacobian: (..., R) and (..., R, p), as in `Slopes`. noise: what the weights were
    divided by. dof: (...). scaled: multiply by the scatter of the residuals, or by ``pooled``, that
    of many fits alike.
    For a robust loss Huber's estimate of the covariance is taken (Robust Statistics, 1981,
    eq. 7.6.6): mean of the squared influence over the squared mean of its derivative.
    """
    r, J, dof = residual / noise, jacobian / noise, np.asarray(dof)
    off, lines = prior_rows(u, y)
    pull, bend = influence(u.spec.loss, r)
    gradient = np.einsum("...rp,...r->...p", J, pull) + np.einsum("...kp,...k->...p", lines, off)
    low, high = limits
    free = u.free
    on_low, on_high = free & (y <= low) & (gradient >= 0.0), free & (y >= high) & (gradient <= 0.0)
    at_bound = np.where(on_low, "low", np.where(on_high, "high", ""))
    use = free & ~on_low & ~on_high
    many = np.maximum(dof, 1)
    if u.spec.loss == "squares":
        # Without a degree of freedom only the stated errors are available.
        variance, curvature = np.where(dof > 0, np.vecdot(r, r) / many, 1.0), 1.0
    else:
        curvature = np.maximum(bend.mean(-1), 1e-3)
        variance = np.vecdot(pull, pull) / many / curvature**2
    if not scaled:
        variance = 1.0 if u.spec.loss == "squares" else np.maximum(variance, 1.0)
    elif u.spec.priors and u.spec.loss == "squares":
        # Data and priors were weighed against each other by the noise already.
        variance = np.where(dof > 0, 1.0, variance)
    if not stated:
        variance = np.where(dof == 0, np.nan, variance)
    if scaled and pooled is not None:
        variance = pooled
    rows, b = np.concatenate([J, lines], -2), np.concatenate([r, off], -1)
    inner = whole = inverse_of(rows, b, use)
    if (use != free).any():
        whole = inverse_of(rows, b, np.broadcast_to(free, y.shape))
    seen_no = np.where(inner.hidden[..., None, :], np.abs(inner.directions), 0.0)
    variance = np.broadcast_to(np.asarray(variance, float), dof.shape)[()]
    return Uncertainty(
        variance[..., None, None] * inner.covariance, at_bound, inner.directions, inner.hidden,
        seen_no.max(-1) > SHARE, variance, inner.step, whole.covariance, whole.step,
        variance * curvature,
    )  # fmt: skip
