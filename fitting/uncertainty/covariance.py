"""Residuals and derivatives at the best minimum: the last step, covariance, what is not seen."""

from __future__ import annotations

from typing import NamedTuple

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
    """Return residuals and derivatives of the priors."""
    rows, off = [], []
    for i, unknown in enumerate(u.moving):
        if unknown.prior is None:
            continue
        mean, sigma = unknown.prior
        value, slope = value_and_slope(unknown.parameter.coordinate, y[i : i + 1])
        line = np.zeros(len(y))
        line[i] = min(float(slope[0]), 1e12) / sigma
        rows.append(line)
        off.append((float(value[0]) - mean) / sigma)
    return np.array(off), np.array(rows).reshape(-1, len(y))


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
    """Covariance in the solver's coordinates, (p, p), with the quantities behind it.

    at_bound: (p,) "", "low" or "high". unseen: (p, u) directions that the data do not determine,
    in units in which every parameter changes the data equally; unseen_of: (p,) parameters without
    an error. variance: the factor on the covariance; step: the undamped step from here, (p,).
    wide: (p, p) covariance without bounds, for a variance of 1; wide_step: (p,) the step without
    bounds.
    rise: the increase of the cost at one standard error (the variance; for a robust loss times its
    mean curvature).
    """

    covariance: np.ndarray
    at_bound: tuple[str, ...]
    unseen: np.ndarray
    unseen_of: np.ndarray
    variance: float
    step: np.ndarray
    wide: np.ndarray
    wide_step: np.ndarray
    rise: float

    @property
    def edge(self) -> np.ndarray:
        """Standard errors (p,) of the coordinates if there were no bounds, for a variance of 1."""
        with np.errstate(invalid="ignore"):
            return np.sqrt(np.diagonal(self.wide))


def inverse_of(
    rows: np.ndarray, b: np.ndarray, use: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (J^T J)^-1 (p, p), the least-squares step (p,) and the directions not seen (p, u).

    Over the unknowns ``use``, NaN (0) for the others; in units in which every column has length 1,
    so that it does not matter what a parameter is measured in.
    """
    p = rows.shape[1]
    A, index = rows[:, use], np.flatnonzero(use)
    size = np.linalg.norm(A, axis=0)
    unit = np.where(size > 0.0, size, 1.0)
    # Fewer rows than unknowns: rows of zeros, so that the rest of the space is named too.
    lacking = max(len(index) - len(A), 0)
    both = np.pad(np.column_stack([A / unit, b]), ((0, lacking), (0, 0)))
    # The triangle of a QR decomposition has the same singular values, and far fewer rows.
    triangle = np.asarray(np.linalg.qr(both, mode="r"))
    U, values, V = np.linalg.svd(triangle[:, :-1], full_matrices=False)
    good = values > UNSEEN * values.max(initial=0.0)
    inverse = np.where(good, 1.0 / np.where(good, values, 1.0), 0.0)
    covariance, step = np.full((p, p), np.nan), np.zeros(p)
    with np.errstate(over="ignore"):  # of what has hardly an effect the variance is infinite
        covariance[np.ix_(index, index)] = (V.T * inverse**2) @ V / np.outer(unit, unit)
    step[index] = -(V.T @ (inverse * (U.T @ triangle[:, -1]))) / unit
    unseen = np.zeros((p, int((~good).sum())))
    unseen[index] = V[~good].T
    return covariance, step, unseen


def uncertainty(
    u: Unknowns,
    s: Slopes,
    y: np.ndarray,
    limits: tuple[np.ndarray, np.ndarray],
    noise: float,
    dof: int,
    scaled: bool,
    stated: bool,
    pooled: float | None = None,
) -> Uncertainty:
    """Return the uncertainty of the unknowns at y.

    noise: what the weights were divided by. scaled: multiply by the scatter of the residuals, or by
    ``pooled``, that of many fits alike.
    For a robust loss Huber's estimate of the covariance is taken (Robust Statistics, 1981,
    eq. 7.6.6): mean of the squared influence over the squared mean of its derivative.
    """
    r, J = s.residual / noise, s.jacobian / noise
    off, lines = prior_rows(u, y)
    pull, bend = influence(u.spec.loss, r)
    gradient = J.T @ pull + lines.T @ off
    low, high = limits
    free = u.free
    on_low, on_high = free & (y <= low) & (gradient >= 0.0), free & (y >= high) & (gradient <= 0.0)
    at_bound = tuple(
        "low" if a else "high" if b else "" for a, b in zip(on_low, on_high, strict=True)
    )
    use = free & ~on_low & ~on_high
    if u.spec.loss == "squares":
        # Without a degree of freedom only the stated errors are available.
        variance, curvature = float((r @ r) / dof) if dof > 0 else 1.0, 1.0
    else:
        curvature = max(float(bend.mean()), 1e-3)
        variance = float((pull @ pull) / max(dof, 1)) / curvature**2
    if not scaled:
        variance = 1.0 if u.spec.loss == "squares" else max(variance, 1.0)
    elif u.spec.priors and dof > 0 and u.spec.loss == "squares":
        # Data and priors were weighed against each other by the noise already.
        variance = 1.0
    if not stated and dof == 0:
        variance = np.nan
    if scaled and pooled is not None:
        variance = pooled
    rows, b = np.concatenate([J, lines]), np.concatenate([r, off])
    covariance, step, unseen = inverse_of(rows, b, use)
    wide, wide_step = covariance, step
    if (use != free).any():
        wide, wide_step, _ = inverse_of(rows, b, free)
    unseen_of = np.max(np.abs(unseen), axis=1, initial=0.0) > SHARE
    return Uncertainty(
        variance * covariance, at_bound, unseen, unseen_of, variance, step, wide,
        wide_step, variance * curvature,
    )  # fmt: skip
