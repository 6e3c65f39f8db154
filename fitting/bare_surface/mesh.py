"""Where to start: the best node of a coarse mesh, and the best of separate basins.

From the best of the 96 nodes 3 or 4 evaluations lead to the minimum, and for 60 angles, s and p, p
alone or unpolarised, that minimum was the global one in every one of 4000 truths of each class
(dielectric, weak absorber, semiconductor, metal), where guesses from one feature of the curve fail
(the angle of least R_p: 8 % for unpolarised data; the closed form from R_s and R_p: 17 % for metals
with noise). With 60 nodes it still was; with 36 it was not (0.8 % wrong for glass).

All nodes are compared with all curves by one matrix product,

    sum w^2 (g - v)^2 = sum w^2 g^2 - 2 sum w^2 v g + (what is the same for all nodes),

and further starts are nodes that are lower than their neighbours. Few angles can have several
solutions (R_p at 60 and 75 degrees: 1.5 for a dielectric on average), so that there the mesh is
finer, a line of nodes along k = 0 is added, and five further starts are followed: that finds the
best solution of every one of 300 curves of each kind tried and 97 % of all that fit alike, where
the coarse mesh and one further start found 89 and 73 %.

In total reflection 1 - R is proportional to k, and a curve of small k is like no node of the mesh;
without a line of nodes of their own 2 to 25 % of curves that see nothing else (11 angles from 62 to
85 degrees, n .3 to .95, k 1e-4 to 1e-2) ended in a worse minimum, with it 0 to .2 %.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from fitting.bare_surface.coordinates import W_MIN, coordinates_of, index_derivatives, xi_of
from fitting.bare_surface.reflectances import Curves, reflectances

# Up to this many angles the fine mesh is used; its cost grows with their number.
FEW_ANGLES = 24


class Mesh(NamedTuple):
    """Nodes: rows of x by columns of w (x slowest), then lines of nodes.

    totally: with n < 1 and a small k, for total reflection. edge: along k = 0, n > 1. index:
    relative n and k, (2, J). points: x, w and chart, (3, J). lows: how many of the low nodes of the
    mesh and of each line to start from beside the best.
    """

    rows: int
    columns: int
    totally: int
    edge: int
    index: np.ndarray
    points: np.ndarray
    lows: tuple[int, int, int]


def _spaced(low: float, high: float, count: int) -> np.ndarray:
    """x evenly spaced in R(0) for weak reflectors and in log(1 - R(0)) for strong ones."""
    return 0.3 * np.sinh(np.linspace(np.arcsinh(low / 0.3), np.arcsinh(high / 0.3), count))


def _mesh(
    rows: int, columns: int, totally: int, edge: int, lowest: float, lows: tuple[int, int, int]
) -> Mesh:
    x = np.repeat(_spaced(lowest, 8.0, rows), columns)
    w = np.tile((np.arange(columns) + 0.5) / columns, rows) * 4.0 * xi_of(x)
    at_edge = _spaced(5e-4, 4.0, edge)  # n from 1.03 to 110
    n = np.linspace(0.99, 0.1, totally)
    index = np.concatenate([
        index_derivatives(x, w, np.ones_like(x))[:2],
        [n, 2e-3 * n],
        index_derivatives(at_edge, np.full(edge, W_MIN), np.ones(edge))[:2],
    ], axis=1)  # fmt: skip
    return Mesh(rows, columns, totally, edge, index, coordinates_of(*index), lows)


# From R(0) = 1e-4 (n = 1.2; the fine one 1e-6) to .999, all the way between the two ends k = 0.
COARSE = _mesh(12, 8, 16, 0, 0.02, (1, 0, 0))
FINE = _mesh(24, 16, 32, 48, 0.002, (2, 1, 2))


def mesh_for(curves: Curves) -> Mesh:
    """Return the mesh that suits the number of angles."""
    return FINE if len(curves.cos_theta) <= FEW_ANGLES else COARSE


def node_curves(curves: Curves, channels: tuple[str, ...]) -> list[Array]:
    """Return the reflectances of the nodes, J nodes first: per channel (J, M, 1) or (J, M, L)."""
    n, k = (jnp.asarray(a[:, None, None]) for a in mesh_for(curves).index)
    return list(reflectances(curves.cos_theta, curves.s_share, n, k, channels))


def misfits(found: list[Array], curves: Curves) -> Array:
    """Return (J, L): the sum of squares at each node, less what is the same for all nodes.

    In single precision with the coarse mesh, to save a twentieth of the time of a fit: its nodes
    lie too far apart to be told from each other by rounding.
    """
    precision = found[0].dtype if mesh_for(curves) is FINE else jnp.float32
    most = jnp.stack([w.max(0) for w in curves.weights]).max(0)
    most = jnp.where(most > 0.0, most, 1.0)  # keeps squared weights in the range of float32
    total = jnp.zeros((), precision)
    for g, v, w in zip(found, curves.values, curves.weights, strict=True):
        w2 = (w / most) ** 2
        g, v, w2 = (a.astype(precision) for a in (g, v, w2))
        if g.shape[-1] == 1:  # one set of angles: matrix products
            g = g[:, :, 0]
            total = total + (g * g) @ w2 - 2.0 * (g @ (w2 * v))
        else:
            total = total + (w2 * (g - 2.0 * v) * g).sum(1)
    return total


def _among_neighbours(misfit: Array) -> Array:
    """Return the least value of each node and its neighbours in (A, B, L)."""
    for axis in (0, 1):
        size = misfit.shape[axis]
        widths = [(1, 1) if a == axis else (0, 0) for a in range(3)]
        wide = jnp.pad(misfit, widths, constant_values=jnp.inf)
        before, here, after = (jax.lax.slice_in_dim(wide, i, i + size, axis=axis) for i in range(3))
        misfit = jnp.minimum(jnp.minimum(before, here), after)
    return misfit


def _least(misfit: Array, allowed: Array) -> tuple[Array, Array]:
    """Return the best allowed node, (1, L), and whether there is one, (L,).

    Plain minima: argmin runs as a scalar loop on the CPU, 4 times slower than all the rest.
    """
    values = jnp.where(allowed, misfit, jnp.inf)
    least = values.min(0, keepdims=True)
    node = jnp.arange(len(misfit), dtype=misfit.dtype)[:, None]
    node = jnp.where(values == least, node, jnp.inf).min(0, keepdims=True)
    exists = jnp.isfinite(least[0])
    return jnp.where(exists, node, 0.0), exists


def _lowest(misfit: Array, shape: tuple[int, int], taken: Array, count: int) -> list:
    """Return ``count`` nodes lower than their neighbours, best first, other than ``taken``."""
    square = misfit.reshape(*shape, -1)
    allowed = (square <= _among_neighbours(square)).reshape(misfit.shape)
    number = jnp.arange(len(misfit), dtype=misfit.dtype)[:, None]
    chosen = []
    for _ in range(count):
        allowed &= number != taken
        taken, exists = _least(misfit, allowed)
        chosen.append((taken, exists))
    return chosen


def mesh_starts(curves: Curves, found: list[Array]) -> tuple[Array, list[tuple[Array, Array]]]:
    """Return the first start, x, w and chart (3, L), and more, each with where there is one.

    The same number of further starts for all curves: one, or five for few angles.
    """
    mesh = mesh_for(curves)
    misfit = misfits(found, curves)
    inner = mesh.rows * mesh.columns
    first, exists = _least(misfit[: inner + mesh.totally], jnp.ones((), bool))
    further, begin = [], 0
    for shape, count in zip(
        ((mesh.rows, mesh.columns), (mesh.totally, 1), (mesh.edge, 1)), mesh.lows, strict=True
    ):
        end = begin + shape[0] * shape[1]
        low = _lowest(misfit[begin:end], shape, first - begin, count) if count else []
        further += [(node + begin, exists) for node, exists in low]
        begin = end
    points = jnp.asarray(mesh.points)
    chosen = [(points[:, node[0].astype(int)], ok) for node, ok in [(first, exists), *further]]
    return chosen[0][0], chosen[1:]
