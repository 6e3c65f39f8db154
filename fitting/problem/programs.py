"""The compiled programs of a model fit: all starts at once, and the derivatives at the end.

There is one program for each `observe.Spec` and number of rows. Lanes are the starts of one fit, or
of several wavelengths that are fitted independently, each with its own starts.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jax import Array

from fitting.optics.observe import medium_index, predicted
from fitting.optics.spec import NCS, Points, Spec
from fitting.problem.observations import Observations
from fitting.problem.solver import BatchLevenbergMarquardt
from fitting.problem.unknowns import Unknowns
from fitting.process.compiled import compiled
from fitting.samples.parameters import to_parameter

SOLVER = BatchLevenbergMarquardt()

# Huber's constant in standard deviations: 95 % as efficient as least squares where the noise is
# Gaussian (P. J. Huber, Robust Statistics, 1981, sec. 4.3 to 4.5).
HUBER = 1.345
LOSSES = ("squares", "huber")


class Targets(NamedTuple):
    """The data and priors of a fit; arrays as in `observations.Observations`, lanes 1 or L.

    noise: (), by which the weights are divided. prior, prior_weight: (p,) of the parameters,
    weight 0 where there is none. held: constants. eta_i: index of the medium in front.
    """

    points: Points
    values: tuple[Any, ...]
    weights: tuple[Any, ...]
    ncs: Any
    ncs_weights: Any
    noise: Any
    prior: Any
    prior_weight: Any
    held: Any
    eta_i: Any


def targets_of(u: Unknowns, seen: Observations, eta_i: Any) -> Targets:
    """Return the data and priors that the unknowns are compared with."""
    prior = np.array([w.prior[0] if w.prior else 0.0 for w in u.moving])
    weight = np.array([1.0 / w.prior[1] if w.prior else 0.0 for w in u.moving])
    return Targets(
        points=seen.points, values=seen.values, weights=seen.weights, ncs=seen.ncs,
        ncs_weights=seen.ncs_weights, noise=np.float64(1.0), prior=prior, prior_weight=weight,
        held=u.held, eta_i=eta_i,
    )  # fmt: skip


def robust(loss: str, r: Any, xp: Any = jnp) -> Any:
    """Return f(r) with f^2 = the loss of the residual r in standard deviations.

    Huber: r^2 up to c, then 2c|r| - c^2. xp: the array module, jax.numpy or numpy.
    """
    if loss == "huber":
        far = xp.abs(r) > HUBER
        root = xp.sqrt(xp.where(far, 2.0 * HUBER * xp.abs(r) - HUBER**2, 1.0))
        return xp.where(far, xp.sign(r) * root, r)
    return r


def weighted(spec: Spec, found: Mapping[str, Any], targets: Targets) -> list[Array]:
    """Return weighted residuals of predicted channels, (M, L) each, three for NCS."""
    alone = [c for c in spec.channels if c != NCS]
    out = [
        (found[c] - v) * w for c, v, w in zip(alone, targets.values, targets.weights, strict=True)
    ]
    if NCS in spec.channels:
        away = [seen - measured for seen, measured in zip(found[NCS], targets.ncs, strict=True)]
        # Rows without data have some finite model value; their weight is 0.
        W = targets.ncs_weights
        out += [W[i, 0] * away[0] + W[i, 1] * away[1] + W[i, 2] * away[2] for i in range(3)]
    return [r / targets.noise for r in out]


class Residuals(NamedTuple):
    """The residual function ``(y (p, L), targets) -> arrays (M, L), None`` of a fit.

    It is a value and not a closure, so that two fits of one kind share one compiled program.
    spec: a `Spec`, or one with its own residuals (`own_residuals.OwnSpec`).
    """

    spec: Any

    def __call__(self, y: Array, targets: Targets) -> tuple[tuple[Array, ...], None]:
        spec = self.spec
        if isinstance(spec, Spec):
            values, directions = spec.values(y, targets.held), len(spec.moving)
            found = predicted(spec, values, targets.points, targets.eta_i, directions)
            raw = weighted(spec, found, targets)
        else:
            raw = spec.raw(y, targets)
        out = [robust(spec.loss, r) for r in raw]
        if spec.priors:
            x = jnp.stack(to_parameter(spec.coordinates, y))
            off = (x - targets.prior[:, None]) * targets.prior_weight[:, None]
            # In arrays of the size of the data, as the sums need it.
            size = len(out[0])
            padded = jnp.zeros((-(-len(off) // size) * size, *off.shape[1:]), off.dtype)
            out += list(padded.at[: len(off)].set(off).reshape(-1, *out[0].shape))
        return tuple(out), None


def _solve(
    targets: Targets, start: Array, options: dict[str, Any], *, spec: Any
) -> tuple[Array, dict[str, Array]]:
    """Return y (p, L) and the statistics of the lanes; see `BatchLevenbergMarquardt`."""
    solution = optx.least_squares(
        Residuals(spec), SOLVER, start, targets, options, max_steps=None, throw=False
    )
    return solution.value, solution.stats


def rows_of(spec: Spec, found: Mapping[str, Any], shape: tuple[int, ...]) -> Array:
    """Return all channels stacked, (K, M, L); K counts NCS as three."""
    rows = [row for c in spec.channels for row in (found[c] if c == NCS else [found[c]])]
    return jnp.stack([jnp.broadcast_to(row, shape) for row in rows])


def with_slopes(f: Callable[[Array], Array], y: Array) -> tuple[Array, Array]:
    """Return f at y (p,), where it takes lanes (p, L), and its derivatives, on a last axis (p,).

    Lanes are directions: one derivative call gives all columns.
    """
    p, lanes = len(y), max(len(y), 1)
    value, slope = jax.jvp(f, (jnp.broadcast_to(y[:, None], (p, lanes)),), (jnp.eye(p, lanes),))
    return value[..., 0], slope[..., :p]


def _linearised(
    y: Array, points: Points, held: Array, eta_i: Array, *, spec: Spec
) -> tuple[Array, Array]:
    """Return the prediction of each channel at y (p,), (K, M), and its derivatives, (K, M, p).

    K counts NCS as three.
    """

    def seen(lanes: Array) -> Array:
        found = predicted(spec, spec.values(lanes, held), points, eta_i)
        return rows_of(spec, found, (points.angle_deg.shape[0], lanes.shape[1]))

    return with_slopes(seen, y)


def _index(
    y: Array, held: Array, wavelength_um: Array, eta_i: Any, *, spec: Spec, medium: int
) -> tuple[Array, Array]:
    """Return eta and k of a medium, (2, W), and their derivatives with respect to y, (2, W, p).

    eta_i: index of the first medium, () or (W, 1), which a rough surface contains.
    """

    def at(lanes: Array) -> Array:
        values = spec.values(lanes, held)
        return jnp.stack(medium_index(spec, medium, values, wavelength_um[:, None], eta_i))

    return with_slopes(at, y)


solve = compiled(_solve, "spec")
linearised = compiled(_linearised, "spec")
index_slopes = compiled(_index, "spec", "medium")
