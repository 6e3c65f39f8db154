"""Where to start: the best node of a coarse mesh, and the best of separate basins.

From the best of the 96 nodes 3 or 4 evaluations lead to the minimum, and for 60 angles, s and p, p
alone or unpolarised, that minimum was the global one in every one of 4000 truths of each class
(dielectric, weak absorber, semiconductor, metal), where guesses from one feature of the curve fail
(the angle of least R_p: 8 % for unpolarised data; the closed form from R_s and R_p: 17 % for metals
with noise). With 60 nodes it still was; with 36 it was not (0.8 % wrong for glass).

All nodes are compared with all curves by one matrix product,

    sum w^2 (g - v)^2 = sum w^2 g^2 - 2 sum w^2 v g + (what is the same for all nodes),

and further starts are nodes that are lower than their neighbours. Few angles can have several
solutions close together along k = 0 (p alone at 65, 70 and 75 degrees: the best of three was missed
for 4 % of the dielectrics), so there a fine mesh on that line gives two more starts.
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jax import Array

from fitting.coordinates import W_MIN, coordinates_of, index_derivatives, xi_of
from fitting.problem import Curves, reflectances

ROWS, COLUMNS, EDGE = 12, 8, 48
# Up to this many angles the mesh on the line k = 0 is used too.
FEW_ANGLES = 24


def _spaced(low: float, high: float, count: int) -> np.ndarray:
    """x evenly spaced in R(0) for weak reflectors and in log(1 - R(0)) for strong ones."""
    return 0.3 * np.sinh(np.linspace(np.arcsinh(low / 0.3), np.arcsinh(high / 0.3), count))


def _nodes() -> tuple[np.ndarray, np.ndarray]:
    """Return (n, k), (2, J), and (x, w, chart), (3, J), of the mesh and then of the line k = 0."""
    # From R(0) = 1e-4 (n = 1.2) to .999, and in between the two ends k = 0 of constant R(0).
    x = np.repeat(_spaced(0.02, 8.0, ROWS), COLUMNS)
    w = np.tile((np.arange(COLUMNS) + 0.5) / COLUMNS, ROWS) * 4.0 * xi_of(x)
    x = np.concatenate([x, _spaced(5e-4, 4.0, EDGE)])  # n from 1.03 to 110
    w = np.concatenate([w, np.full(EDGE, W_MIN)])
    index = np.array(index_derivatives(x, w, np.ones_like(x))[:2])
    return index, coordinates_of(*index)


INDEX, NODES = _nodes()


def node_curves(curves: Curves, channels: tuple[str, ...]) -> list[Array]:
    """Return the reflectances of the nodes, J nodes first: per channel (J, M, 1) or (J, M, L)."""
    count = ROWS * COLUMNS + (EDGE if len(curves.cos_theta) <= FEW_ANGLES else 0)
    n, k = (jnp.asarray(a[:count, None, None]) * curves.eta_i for a in INDEX)
    return list(reflectances(curves.cos_theta, curves.s_share, n, k, curves.eta_i, channels))


def misfits(found: list[Array], curves: Curves) -> Array:
    """Return (J, L): the sum of squares at each node, less what is the same for all nodes."""
    total = jnp.zeros(())
    for g, v, w in zip(found, curves.values, curves.weights, strict=True):
        w2 = w * w
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
        parts = [jnp.take(wide, jnp.arange(i, i + size), axis) for i in range(3)]
        misfit = jnp.minimum(jnp.minimum(*parts[:2]), parts[2])
    return misfit


def _least(misfit: Array, allowed: Array) -> tuple[Array, Array]:
    """Return the best allowed node, (1, L), and whether there is one, (L,).

    Plain minima: argmin runs as a scalar loop on the CPU, 4 times slower than all the rest.
    """
    values = jnp.where(allowed, misfit, jnp.inf)
    least = values.min(0, keepdims=True)
    node = jnp.arange(float(len(misfit)))[:, None]
    node = jnp.where(values == least, node, jnp.inf).min(0, keepdims=True)
    exists = jnp.isfinite(least[0])
    return jnp.where(exists, node, 0.0), exists


def mesh_starts(curves: Curves, found: list[Array]) -> tuple[Array, list[tuple[Array, Array]]]:
    """Return the first start, x, w and chart (3, L), and more, each with where there is one.

    The same number of further starts for all curves: one, or three for few angles.
    """
    misfit = misfits(found, curves)
    inner = ROWS * COLUMNS
    nodes = jnp.asarray(NODES)
    number = jnp.arange(float(len(misfit)))[:, None]

    def lows(part: Array, rows: int) -> Array:
        square = part.reshape(rows, -1, part.shape[-1])
        return (square <= _among_neighbours(square)).reshape(part.shape)

    chosen = [_least(misfit[:inner], jnp.ones((), bool))]
    low = lows(misfit[:inner], ROWS) & (number[:inner] != chosen[0][0])
    chosen.append(_least(misfit[:inner], low))
    if len(misfit) > inner:
        edge, number = misfit[inner:], number[:EDGE]
        low = lows(edge, EDGE)
        one, exists = _least(edge, low)
        two, also = _least(edge, low & (number != one))
        chosen += [(one + inner, exists), (two + inner, also)]
    points = [(nodes[:, node[0].astype(int)], exists) for node, exists in chosen]
    return points[0][0], points[1:]
