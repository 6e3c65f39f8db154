"""Many independent fits of one kind as lanes: their data, the solver on all of them, derivatives.

The fits share the sample, its unknowns and their bounds. The pixels of a map share their points,
too (`Curves`); the wavelengths of a free index do not (`OwnPoints`). A film of 60 wavelengths takes
30 us so, a fit by itself tens of ms.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from fitting.optics.observe import predicted
from fitting.optics.spec import NCS, Spec
from fitting.problem.lanes import Ends
from fitting.problem.observations import Observations, ncs_of, ncs_weights, squares_of
from fitting.problem.optics_inputs import spec_at
from fitting.problem.programs import Bounds, Targets, rows_of, solve, weighted
from fitting.problem.solver import START_DAMPING
from fitting.process.compiled import compiled, fit_settings

# Lanes of one call, and of the smallest one.
LANES, _FEW = 1024, 16
# Evaluations in a stage, after which lanes that have ended make room, and in all. From so many on a
# lane that is above the best one of its curve that has converged goes no further.
_STAGE, _MOST, _FAIR = 10, 120, 60


class OwnPoints(NamedTuple):
    """Data of N curves, each with points and constants of its own, as the lanes of `data`.

    data: arrays (..., rows, N), rows without a datum of weight 0; held (h, N), eta_i (rows, N) or
    a number. n_data: (N,). stated: whether every datum has an error.
    """

    data: Targets
    n_data: np.ndarray
    stated: bool

    @property
    def count(self) -> int:
        """The number N of curves."""
        return len(self.n_data)

    @property
    def width(self) -> int:
        """Lanes of one call: enough for many starts of each curve, and one program for all."""
        return LANES

    @property
    def outside(self) -> np.ndarray:
        """The index of the first medium, (N,)."""
        return np.broadcast_to(self.data.eta_i, self.data.points.angle_deg.shape).mean(0)

    def at(self, pick: np.ndarray) -> OwnPoints:
        """Return some of the curves."""
        d, names = self.data, ("values", "weights", "ncs", "ncs_weights", "held", "eta_i")
        places = "angle_deg", "wavelength_um", "s_share"

        def lanes(of: Any, name: str) -> Any:
            return jax.tree.map(lambda a: a[..., pick] if np.ndim(a) else a, getattr(of, name))

        points = d.points._replace(**{n: lanes(d.points, n) for n in places})
        data = d._replace(points=points, **{n: lanes(d, n) for n in names})
        return self._replace(data=data, n_data=self.n_data[pick])

    def targets(self, pick: np.ndarray) -> Targets:
        """Return the targets of the curves ``pick`` as lanes."""
        return self.at(pick).data


class Curves(NamedTuple):
    """Values of N curves, (N, M) by quantity, NaN where there is none; sigma: the same, or None.

    seen: the rows of a measurement that has every quantity at every one of the M points, in the
    order of ``values``. base: its targets.
    """

    seen: Observations
    base: Targets
    values: Mapping[str, np.ndarray]
    sigma: Mapping[str, np.ndarray] | None

    @property
    def count(self) -> int:
        """The number N of curves."""
        return len(next(iter(self.values.values())))

    @property
    def width(self) -> int:
        """Lanes of one call."""
        return min(LANES, max(_FEW, 1 << (self.count - 1).bit_length()))

    @property
    def stated(self) -> bool:
        """Whether every datum has an error."""
        return self.sigma is not None

    @property
    def n_data(self) -> np.ndarray:
        """The number of data of each curve, (N,)."""
        return np.sum([np.isfinite(v).sum(1) for v in self.values.values()], 0)

    @property
    def outside(self) -> np.ndarray:
        """The mean index of the first medium, (N,)."""
        return np.full(self.count, np.mean(self.base.eta_i))

    def _rows(self, quantity: str, of: np.ndarray) -> np.ndarray:
        """Return (n, M) of a quantity as rows of the points, (rows, n), NaN elsewhere."""
        out = np.full((len(self.seen.points.angle_deg), len(of)), np.nan)
        out[self.seen.row[self.seen.quantity == quantity]] = of.T
        return out

    def targets(self, pick: np.ndarray) -> Targets:
        """Return the targets of the curves ``pick`` as lanes."""
        values, weights = [], []
        for quantity in (c for c in self.seen.channels if c != NCS):
            value = self._rows(quantity, self.values[quantity][pick])
            weight = np.isfinite(value).astype(float)
            if self.sigma is not None:
                weight = weight / np.nan_to_num(
                    self._rows(quantity, self.sigma[quantity][pick]), nan=1.0
                )
            values.append(np.nan_to_num(value))
            weights.append(weight)
        base = self.base._replace(values=tuple(values), weights=tuple(weights))
        if NCS not in self.seen.channels:
            return base
        psi, delta = (self._rows(q, self.values[q][pick]) for q in ("psi", "delta"))
        errors = [
            np.ones_like(psi) if self.sigma is None else self._rows(q, self.sigma[q][pick])
            for q in ("psi", "delta")
        ]
        some = np.isfinite(psi)
        of_psi, of_delta = (np.nan_to_num(e, nan=1.0) for e in errors)
        psi, delta = np.where(some, psi, 45.0), np.where(some, delta, 0.0)
        W = ncs_weights(psi, delta, of_psi, of_delta, self.sigma is not None)
        measured = ncs_of(psi, np.nan_to_num(delta))
        return base._replace(ncs=np.where(some, measured, 0.0), ncs_weights=np.where(some, W, 0.0))


def _as_rows(targets: Targets) -> tuple[np.ndarray, np.ndarray]:
    """Return what was measured, (K, M, L), and where; K counts NCS as three."""
    measured, used = [*targets.values], [w > 0.0 for w in targets.weights]
    if np.size(targets.ncs):
        measured += [*targets.ncs]
        used += list(np.abs(targets.ncs_weights).sum(0) > 0.0)
    return np.stack(measured), np.stack(used)


def _calls(lanes: np.ndarray, width: int):
    """Yield lanes in calls of one width: those that count, and all, the last of them repeated."""
    for first in range(0, len(lanes), width):
        some = lanes[first : first + width]
        yield some, np.pad(some, (0, width - len(some)), "edge")


def run_curves(
    spec: Spec, curves: Curves | OwnPoints, start: np.ndarray, which: np.ndarray,
    limits: tuple[np.ndarray, np.ndarray], dof: np.ndarray,
) -> Ends:  # fmt: skip
    """Return where starts (p, L) end, each on the curve of a number ``which``, (L,).

    limits: bounds (p,). dof: (N,) of each curve.
    """
    low, high = (a[:, None] for a in limits)
    out, width = Ends.begun(np.clip(start, low, high)), curves.width
    damping, todo = np.full(len(which), START_DAMPING), np.arange(len(which))
    shape = len(start), width
    while len(todo):
        for some, lanes in _calls(todo, width):
            targets = curves.targets(which[lanes])
            bounds = Bounds(
                np.broadcast_to(low, shape), np.broadcast_to(high, shape),
                np.maximum(dof[which[lanes]], 1.0), squares_of(targets),
            )  # fmt: skip
            with fit_settings():
                found = solve(
                    targets, out.y[:, lanes], damping[lanes], bounds, np.int64(_STAGE),
                    spec=spec_at(spec, targets.points.angle_deg),
                )  # fmt: skip
            y, cost, done, used, left = (np.asarray(a)[..., : len(some)] for a in found)
            out.y[:, some], out.done[some], damping[some] = y, done, left
            out.cost[some] = np.where(np.isfinite(cost), cost, np.inf)
            out.evaluations[some] += used
        best = np.full(curves.count, np.inf)
        np.minimum.at(best, which[out.done], out.cost[out.done])
        worth = (out.evaluations < _FAIR) | (out.cost < best[which])
        worth &= ~out.done & np.isfinite(out.cost) & (out.evaluations < _MOST)
        todo = todo[worth[todo]]
    return out


def _derivatives(targets: Targets, y: Array, *, spec: Spec) -> tuple[Array, Array, Array]:
    """Return weighted residuals (C, M, L), derivatives (p, C, M, L), and channels (K, M, L)."""

    def at(y: Array) -> tuple[Array, Array]:
        values = spec.values(y, targets.held)
        found = predicted(spec, values, targets.points, targets.eta_i, directions=len(y))
        shape = (targets.points.angle_deg.shape[0], y.shape[1])
        return jnp.stack(weighted(spec, found, targets)), rows_of(spec, found, shape)

    (residual, shown), along = jax.linearize(at, y)
    slopes = [along(jnp.zeros_like(y).at[j].set(1.0))[0] for j in range(len(y))]
    return residual, jnp.stack(slopes), shown


_derivatives_of = compiled(_derivatives, ("spec",))


class Slopes(NamedTuple):
    """Of n lanes: residual (n, R) weighted, jacobian (n, R, p); shown, plain (n, K, M): the model,
    and its differences from the data, NaN where there is no datum; squares (n,) of the data."""

    residual: np.ndarray
    jacobian: np.ndarray
    shown: np.ndarray
    plain: np.ndarray
    squares: np.ndarray


def slopes(
    spec: Spec, curves: Curves | OwnPoints, y: np.ndarray, which: np.ndarray
) -> Iterator[tuple[np.ndarray, Slopes]]:
    """Yield lanes, as numbers into ``which``, and the `Slopes` at y (p, L) of their curves."""
    for some, lanes in _calls(np.arange(len(which)), curves.width):
        targets, count = curves.targets(which[lanes]), len(some)
        with fit_settings():
            found = _derivatives_of(
                targets, y[:, lanes], spec=spec_at(spec, targets.points.angle_deg)
            )
        r, J, shown = map(np.asarray, found)
        measured, used = _as_rows(targets)
        plain = np.where(used, shown - measured, np.nan)
        r, J, shown, plain = (np.moveaxis(a[..., :count], -1, 0) for a in (r, J, shown, plain))
        J = np.moveaxis(J, 1, -1)
        rows = r.reshape(count, -1), J.reshape(count, -1, len(y))
        yield some, Slopes(*rows, shown, plain, squares_of(targets)[:count])
