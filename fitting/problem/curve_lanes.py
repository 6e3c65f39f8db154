"""Many independent fits of one kind as lanes: their data, the solver on all of them, derivatives.

The fits share the sample, its unknowns and their bounds; the pixels of a map share their points,
too, the wavelengths of a free index do not. A film of 60 wavelengths takes 30 us so, a fit by
itself tens of ms.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from fitting.optics.observe import predicted
from fitting.optics.spec import NCS, Spec
from fitting.problem.lanes import ahead, in_calls
from fitting.problem.observations import Observations, data_of, squares_of
from fitting.problem.programs import Targets, robust, rows_of, weighted
from fitting.problem.solver import add
from fitting.process.compiled import compiled, fit_settings
from fresnel_jax.performance import computed_once

# Lanes of one call, and of the smallest one: what they need is in the cache then.
LANES, _FEW = 256, 16


@dataclass(frozen=True)
class Curves:
    """Values of N curves, (N, M) by quantity, NaN where there is none; sigma: the same, or None.

    seen: the rows of a measurement that has every quantity at every one of the M points, in the
    order of ``values``. base: its targets. own: those of `Targets` and its points that differ from
    curve to curve (angles, wavelengths, shares of s and eta_i over rows; constants), (..., N).
    noise: 1, or (N,) where it is to be found; the residuals of each curve are divided by it.
    """

    seen: Observations
    base: Targets
    values: Mapping[str, np.ndarray]
    sigma: Mapping[str, np.ndarray] | None
    own: Mapping[str, np.ndarray] = field(default_factory=dict)
    noise: Any = 1.0

    def at(self, pick: np.ndarray) -> Curves:
        """Return some of the curves."""
        values = {q: v[pick] for q, v in self.values.items()}
        sigma = None if self.sigma is None else {q: s[pick] for q, s in self.sigma.items()}
        own = {name: a[..., pick] for name, a in self.own.items()}
        return replace(self, values=values, sigma=sigma, own=own)

    @property
    def count(self) -> int:
        """The number N of curves."""
        return len(next(iter(self.values.values())))

    @property
    def width(self) -> int:
        """Lanes of one call; those of few wavelengths, each of many starts, share a program."""
        return LANES if self.own else min(LANES, max(_FEW, 1 << (self.count - 1).bit_length()))

    @property
    def stated(self) -> np.ndarray:
        """Which curves have errors of their data, (N,); the others have equal weights."""
        known = [np.isfinite(s).any(1) for s in (self.sigma or {}).values()]
        return np.any(known or [np.zeros(self.count)], 0)

    def weighed(self, noise: np.ndarray, prior_weight: np.ndarray) -> Curves:
        """Return the curves with another noise (N,), and other weights of the priors (p,)."""
        base = self.base._replace(prior_weight=prior_weight)
        return replace(self, base=base, noise=noise)

    @property
    def n_data(self) -> np.ndarray:
        """The number of data of each curve, (N,)."""
        return np.sum([np.isfinite(v).sum(1) for v in self.values.values()], 0)

    @property
    def outside(self) -> np.ndarray:
        """The mean index of the first medium, (N,)."""
        eta_i = self.own.get("eta_i", np.full((1, self.count), np.mean(self.base.eta_i)))
        return eta_i.mean(0)

    @property
    def critical(self) -> np.ndarray:
        """The index below which light of the largest angle is totally reflected, (N,)."""
        angle = self.own.get("angle_deg", self.seen.points.angle_deg)
        return self.outside * np.sin(np.radians(angle.max(0)))

    def _rows(self, quantity: str, of: np.ndarray) -> np.ndarray:
        """Return (N, M) of a quantity as rows of the points, (rows, N), NaN elsewhere."""
        out = np.full((len(self.seen.points.angle_deg), self.count), np.nan)
        out[self.seen.row[self.seen.quantity == quantity]] = of.T
        return out

    @cached_property
    def _data(self) -> dict[str, Any]:
        """What `Targets` has of the data, of all curves as lanes."""
        values = {q: self._rows(q, v) for q, v in self.values.items()}
        sigma = self.sigma and {q: self._rows(q, s) for q, s in self.sigma.items()}
        return data_of(self.seen.channels, values, sigma)

    def targets(self, pick: np.ndarray) -> Targets:
        """Return the targets of the curves ``pick`` as lanes."""
        data, own = jax.tree.map(lambda a: np.take(a, pick, -1), (self._data, dict(self.own)))
        points = {n: own.pop(n) for n in self.base.points._fields if n in own}
        noise = self.noise[pick] if np.ndim(self.noise) else self.base.noise
        points = self.base.points._replace(**points)
        return self.base._replace(points=points, noise=noise, **own, **data)

    def of_points(self, name: str, pick: np.ndarray) -> np.ndarray:
        """Return what the points of the curves ``pick`` have, angles or shares of s, (n, rows)."""
        one = getattr(self.base.points, name)[..., 0]
        return self.own[name][:, pick].T if name in self.own else np.tile(one, (len(pick), 1))

    @cached_property
    def squares(self) -> np.ndarray:
        """The sum of squares of the data of each curve in units of their errors, (N,)."""
        return squares_of(self.base._replace(**self._data)) / self.noise**2


def triangle(columns: list[list[Array]]) -> Array:
    """Return the triangle (C, C, L) of a QR decomposition of C columns, each of arrays (M, L).

    By modified Gram-Schmidt, whose triangle is as accurate as Householder's (A. Bjorck, BIT 7, 1,
    1967, doi:10.1007/BF01934122); the normal equations would lose what is seen 1e-8 as well as the
    rest. All sums over a column are one reduction, as in `solver.normal_sums`.
    """
    out = list[Array]()
    while columns:
        first = columns[0]
        products = [sum(b * c for b, c in zip(first, each, strict=True)) for each in columns]
        square, *along = jax.lax.reduce(products, [jnp.zeros(())] * len(products), add, (0,))
        size = jnp.sqrt(square)
        inverse = jnp.where(size > 0.0, 1.0 / size, 0.0)
        along = [a * inverse for a in along]
        out.append(jnp.stack([*[jnp.zeros_like(size)] * len(out), size, *along]))
        # Of more columns what is formed anew in every loop costs more than to store it.
        keep = computed_once if len(columns) > 2 else lambda x: x
        columns = [
            [keep(b - (a * inverse) * c) for b, c in zip(column, first, strict=True)]
            for a, column in zip(along, columns[1:], strict=True)
        ]
    return jnp.stack(out)


def measured_rows(spec: Spec, targets: Targets) -> tuple[list[Any], list[Any]]:
    """Return what each channel measured and where it did, (M, L) each, NCS as three."""
    measured, used = [*targets.values], [w > 0.0 for w in targets.weights]
    if NCS in spec.channels:
        measured += [*targets.ncs]
        used += [*(abs(targets.ncs_weights).sum(0) > 0.0)]
    return measured, used


def _evaluate(targets: Targets, y: Array, *, spec: Spec) -> tuple[Array, ...]:
    """Return `Slopes`, lanes last, and what each channel shows, (K, M, L)."""
    shape = (targets.points.angle_deg.shape[0], y.shape[1])

    def at(y: Array) -> tuple[list[Array], Array]:
        values = spec.values(y, targets.held)
        found = predicted(spec, values, targets.points, targets.eta_i, directions=len(y))
        found = jax.tree.map(computed_once, found)
        return weighted(spec, found, targets), rows_of(spec, found, shape)

    (residual, shown), along = jax.linearize(at, y)
    columns = [*(along(jnp.zeros_like(y).at[j].set(1.0))[0] for j in range(len(y))), residual]
    if spec.loss == "squares":
        rows = triangle(columns)
    else:
        rows = jnp.stack([jnp.concatenate(column) for column in columns], 1)
    sane = jnp.isfinite(rows).all((0, 1))
    rows = jnp.where(sane, rows, 0.0)
    measured, used = measured_rows(spec, targets)
    squares = jnp.where(jnp.stack(used), shown - jnp.stack(measured), 0.0) ** 2
    kind = np.minimum(np.arange(len(used)), len(spec.channels) - 1)  # N, C and S are one
    plain, counts = (
        jax.ops.segment_sum(a.sum(1), kind, len(spec.channels)) for a in (squares, jnp.stack(used))
    )
    cost = jnp.where(sane, (robust(spec.loss, rows[:, -1]) ** 2).sum(0), jnp.inf)
    whole = jnp.stack([jnp.pad(a, ((0, -len(a) % 4), (0, 0))) for a in residual])
    fours = whole.reshape(len(whole), -1, 4, whole.shape[-1]).sum(2)
    return rows, cost, plain, counts, (fours**2).sum((0, 1)), shown


_evaluated = compiled(_evaluate, "spec")


class Slopes(NamedTuple):
    """Of n lanes: residuals and derivatives, cost (n,), what was not weighted.

    triangle: (n, p + 1, p + 1) of a QR decomposition of the derivatives, and beside them the
    residuals, both weighted: what of the rows counts in sums over them; of a robust loss all rows,
    (n, R, p + 1). 0 of lanes that are not finite, of which the cost is infinite; this is without
    priors. plain, counts: (n, C) by channel the sum of squares of the differences from the data,
    and how many there are. together: (n,) the sum of squares of the sums of four residuals side by
    side, which is the cost where these are noise. shown: (n, K, M).
    """

    triangle: np.ndarray
    cost: np.ndarray
    plain: np.ndarray
    counts: np.ndarray
    together: np.ndarray
    shown: np.ndarray


def _evaluations(
    spec: Spec, curves: Curves, y: np.ndarray, which: np.ndarray
) -> Iterator[list[np.ndarray]]:
    """Yield what `_evaluate` returns at y (p, L) of the curves ``which``, lanes first."""

    calls = (
        (some, _evaluated(curves.targets(which[lanes]), y[:, lanes], spec=spec))
        for some, lanes in in_calls(np.arange(len(which)), curves.width)
    )
    for some, found in ahead(calls):
        yield [np.moveaxis(np.asarray(a)[..., : len(some)], -1, 0) for a in found]


@fit_settings()
def slopes(spec: Spec, curves: Curves, y: np.ndarray, which: np.ndarray) -> Slopes:
    """Return the `Slopes` at y (p, L) of the curves ``which``, (L,)."""
    calls = _evaluations(spec, curves, y, which)
    return Slopes(*map(np.concatenate, zip(*calls, strict=True)))


@fit_settings()
def shown_at(spec: Spec, curves: Curves, y: np.ndarray, which: np.ndarray) -> np.ndarray:
    """Return what each channel shows, (L, K, M), K counts NCS as three."""
    return np.concatenate([found[-1] for found in _evaluations(spec, curves, y, which)])
