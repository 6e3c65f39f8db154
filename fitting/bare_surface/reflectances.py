"""Many measured curves of one bare interface at once: data, model, residuals.

Lanes (curves) are the last axis of every array: the reflectances of all lanes at one angle are
then one contiguous vector, and the sums over angles run down columns.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import Array

from fitting.bare_surface.coordinates import index_of_lanes
from fresnel_jax import powers
from fresnel_jax.performance import computed_once

CHANNELS = ("R_s", "R_p", "R")
"""What can be fitted. R is a mixture, R_p + s_share (R_s - R_p); s_share is 1/2 if unpolarized."""

# The residuals whose sum is squared to see whether neighbours are alike. Of fours smooth misfits
# are told from noise better than of pairs or eights, at 6 to 200 angles.
SIDE_BY_SIDE = 4


class Curves(NamedTuple):
    """Measured curves, lanes last; M angles, L lanes, C channels out of ``CHANNELS``.

    cos_theta: (M, 1) for angles that all lanes share, or (M, L).
    s_share: (M, 1) or (M, L), the part of s in the channel R.
    values: C arrays (M, L); what stands where the weight is 0 is never looked at, but is finite.
    weights: C arrays (M, L) or (M, 1): 1 / sigma, 0 where there is no datum.
    """

    cos_theta: Array
    s_share: Array
    values: tuple[Array, ...]
    weights: tuple[Array, ...]


def reflectances(
    cos_theta: Array, s_share: Array, n: Array, k: Array, channels: tuple[str, ...]
) -> tuple[Array, ...]:
    """Return the reflectance of each of ``channels`` for a relative index; arguments broadcast."""
    both = powers(cos_theta, n, k)
    of = {"R_s": both.R_s, "R_p": both.R_p}
    if "R" in channels:
        of["R"] = both.R_p + s_share * (both.R_s - both.R_p)
    return tuple(of[channel] for channel in channels)


def model(curves: Curves, x: Array, w: Array, chart: Array, channels: tuple[str, ...]):
    """Return the reflectances of every lane at its coordinates, one (M, L) array a channel."""
    n, k = index_of_lanes(x, w, chart)
    # Else XLA repeats the coordinate map for every angle, inside the big loop.
    n, k = map(computed_once, (n, k))
    return reflectances(curves.cos_theta, curves.s_share, n, k, channels)


class Residuals(NamedTuple):
    """The residual function ``(y, (curves, chart)) -> C arrays (M, L)`` of y = stack([x, w]).

    A value (not a closure) so that two fits of the same channels share one compiled program.
    """

    channels: tuple[str, ...]

    def __call__(self, y: Array, args: tuple[Curves, Array]) -> tuple[Array, ...]:
        curves, chart = args
        found = model(curves, y[0], y[1], chart, self.channels)
        return tuple(
            (f - v) * w for f, v, w in zip(found, curves.values, curves.weights, strict=True)
        )


def count_and_scale(curves: Curves) -> tuple[Array, Array]:
    """Return, per lane, the number of data and the weighted sum of squares of the values."""
    shape = curves.values[0].shape
    weights = [jnp.broadcast_to(w, shape) for w in curves.weights]
    count = jnp.stack([(w > 0.0).sum(0) for w in weights]).sum(0)
    squares = [((v * w) ** 2).sum(0) for v, w in zip(curves.values, weights, strict=True)]
    return count, jnp.stack(squares).sum(0)


def _added(parts: list[Array], axis: int) -> list[Array]:
    """Return the sum of each array along an axis.

    All in one reduction, as in `solver.normal_sums`: 3 times as fast as one by one.
    """
    zeros = [jnp.zeros((), a.dtype) for a in parts]
    return jax.lax.reduce(
        parts, zeros, lambda a, b: [x + y for x, y in zip(a, b, strict=True)], (axis,)
    )


def sums_of_squares(curves: Curves, found: tuple[Array, ...]) -> tuple[Array, Array, Array]:
    """Return, per lane, three sums over what ``found`` is off by, M a multiple of SIDE_BY_SIDE.

    The squares with weights, the squares without, and the squares of the sums of so many residuals
    side by side, with weights: each is read once, while the products of neighbours would have the
    compiler form the curve twice, a third of the time of a large batch.
    """
    squares = plain = jnp.zeros((), found[0].dtype)
    each = []
    for f, v, w in zip(found, curves.values, curves.weights, strict=True):
        r = f - v
        e = r * w
        squares, plain = squares + e * e, plain + r * r * (w > 0.0)
        each.append(e)
    parts = [a.reshape(-1, SIDE_BY_SIDE, a.shape[-1]) for a in (squares, plain, *each)]
    squares, plain, first, *rest = _added(parts, 1)
    together = first * first
    for e in rest:
        together = together + e * e
    squares, plain, together = _added([squares, plain, together], 0)
    return squares, plain, together
