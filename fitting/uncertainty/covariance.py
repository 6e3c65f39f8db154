"""Residuals and derivatives at the best minimum: the last step, covariance, what is not seen."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from fitting.problem.problem import Problem
from fitting.problem.slopes import Slopes, influence, prior_rows
from fitting.problem.unknowns import Unknowns
from fitting.samples.parameters import SQUARE
from fitting.uncertainty.limits import ROUNDING, mean_square

# A direction in which the data change by less than this share of what they change along the best
# known one is not seen: below it derivatives are rounding.
UNSEEN = 1e-7
# A parameter has no error of its own if so much of it lies along what is not seen.
SHARE = 1e-3


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
    triangle = np.asarray(np.linalg.qr(both, mode="r"))
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
    u: Unknowns, residual: np.ndarray, jacobian: np.ndarray, y: np.ndarray,
    limits: tuple[np.ndarray, np.ndarray], noise: float, dof: Any, scaled: bool, stated: Any,
    squares: Any, pooled: float | None = None,
) -> Uncertainty:  # fmt: skip
    """Return the uncertainty of the unknowns at y (..., p), of one minimum or of a batch.

    residual, jacobian: (..., R) and (..., R, p), as in `Slopes`. noise: what the weights were
    divided by. dof, squares: (...), these of the data. scaled: multiply by the scatter of the
    residuals, or by ``pooled``, that of many fits alike.
    For a robust loss Huber's estimate of the covariance is taken (Robust Statistics, 1981,
    eq. 7.6.6): mean of the squared influence over the squared mean of its derivative.
    """
    r, J, dof = residual / noise, jacobian / noise, np.asarray(dof)
    off, lines = prior_rows(u, y)
    pull, bend = influence(u.spec.loss, r)
    gradient = np.einsum("...rp,...r->...p", J, pull) + np.einsum("...kp,...k->...p", lines, off)
    low, high = limits
    # A pull against a bound that is rounding of the residuals is none.
    rounding = np.sqrt(ROUNDING * np.asarray(squares))[..., None] / noise
    free = u.free
    with np.errstate(over="ignore", invalid="ignore"):
        pulled = free & (np.abs(gradient) >= rounding * np.linalg.norm(J, axis=-2))
    on_low = pulled & (y <= low) & (gradient >= 0.0)
    on_high = pulled & (y >= high) & (gradient <= 0.0)
    at_bound = np.where(on_low, "low", np.where(on_high, "high", ""))
    use = free & ~on_low & ~on_high
    many = np.maximum(dof, 1)
    if u.spec.loss == "squares":
        # Without a degree of freedom only the stated errors are available.
        variance, curvature = np.where(dof > 0, np.vecdot(r, r) / many, 1.0), 1.0
    else:
        used = (J != 0.0).any(-1) | (r != 0.0)  # a batch has rows without data
        curvature = np.maximum((bend * used).sum(-1) / np.maximum(used.sum(-1), 1), 1e-3)
        variance = np.vecdot(pull, pull) / many / curvature**2
    if not scaled:
        variance = 1.0 if u.spec.loss == "squares" else np.maximum(variance, 1.0)
    elif u.spec.priors and u.spec.loss == "squares":
        # Data and priors were weighed against each other by the noise already.
        variance = np.where(dof > 0, 1.0, variance)
    variance = np.where((dof == 0) & ~np.asarray(stated), np.nan, variance)
    if scaled and pooled is not None:
        variance = pooled
    rows, b = np.concatenate([J, lines], -2), np.concatenate([r, off], -1)
    inner = inverse_of(rows, b, use)
    wide, wide_step, on = inner.covariance, inner.step, (use != free).any(-1)
    if on.any():
        whole = inverse_of(rows[on], b[on], np.broadcast_to(free, y.shape)[on])
        wide, wide_step = wide.copy(), wide_step.copy()
        wide[on], wide_step[on] = whole.covariance, whole.step
    seen_no = np.where(inner.hidden[..., None, :], np.abs(inner.directions), 0.0)
    variance = np.broadcast_to(np.asarray(variance, float), dof.shape)[()]
    covariance = variance[..., None, None] * inner.covariance
    for i in np.flatnonzero([w.parameter.coordinate == SQUARE for w in u.moving]):
        # A k of 0 may be what its limit allows, and the others what they then are.
        there = on_low[..., i] & (y[..., i] == 0.0)
        if there.any():
            own = wide[there, i, i]
            square = mean_square(
                np.minimum(wide_step[there, i], 0.0), np.sqrt(variance[there] * own)
            )
            with np.errstate(invalid="ignore"):  # of an infinite variance
                along = wide[there, :, i] / own[:, None]
                further = along[:, :, None] * along[:, None, :] * square[:, None, None]
            covariance[there] += np.where(np.isfinite(further), further, 0.0)
    return Uncertainty(
        covariance, at_bound, inner.directions, inner.hidden,
        seen_no.max(-1) > SHARE, variance, inner.step, wide, wide_step,
        variance * curvature,
    )  # fmt: skip


class End(NamedTuple):
    """One minimum with its derivatives and errors. finite: whether all of them are finite."""

    y: np.ndarray
    slopes: Slopes
    known: Uncertainty
    cost: float
    finite: bool


def uncertainty_at(fit: Problem, s: Slopes, y: np.ndarray, noise: float) -> Uncertainty:
    """Return the uncertainty of one fit at y (p,), where its derivatives are ``s``."""
    jacobian = np.where(fit.lost(s, y), 0.0, s.jacobian)
    return uncertainty(
        fit.u, s.residual, jacobian, y, fit.limits, noise, fit.dof, fit.asked.scaled,
        fit.seen.stated, fit.squares,
    )  # fmt: skip
