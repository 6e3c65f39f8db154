"""Where to start: the best node of a coarse mesh, and the best of a separate basin.

From the best of the 96 nodes 3 or 4 evaluations lead to the minimum, and for 60 angles, s and p, p
alone or unpolarised, that minimum was the global one in every one of 4000 truths of each class
(dielectric, weak absorber, semiconductor, metal), where guesses from one feature of the curve fail
(the angle of least R_p: 8 % for unpolarised data; the closed form from R_s and R_p: 17 % for metals
with noise). With 60 nodes it still was; with 36 it was not (0.8 % wrong for glass).

All nodes are compared with all curves by one matrix product,

    sum w^2 (g - v)^2 = sum w^2 g^2 - 2 sum w^2 v g + (what is the same for all nodes),

and a second start is the best node, apart from the first, that is lower than its eight neighbours.
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jax import Array

from fitting.coordinates import coordinates_of, index_derivatives, xi_of
from fitting.problem import Curves, reflectances

ROWS, COLUMNS = 12, 8
# From R = 1e-4 at normal incidence (n = 1.2) to R = .999; evenly spaced in R for weak reflectors
# and in log(1 - R) for strong ones, which is what the arsinh does.
_X = 0.3 * np.sinh(np.linspace(np.arcsinh(0.02 / 0.3), np.arcsinh(8.0 / 0.3), ROWS))
# Fractions of the way from one end (k = 0, n >= 1) to the other (k = 0, n <= 1).
_FRACTION = (np.arange(COLUMNS) + 0.5) / COLUMNS


_NODES_X = np.repeat(_X, COLUMNS)
_NODES_W = np.tile(_FRACTION, ROWS) * 4.0 * xi_of(_NODES_X)
NODES_N, NODES_K = index_derivatives(_NODES_X, _NODES_W, np.ones_like(_NODES_X))[:2]
NODES = coordinates_of(NODES_N, NODES_K)
"""x, w and chart of the nodes, (3, ROWS * COLUMNS), x running slowest."""


def node_curves(curves: Curves, channels: tuple[str, ...]) -> list[Array]:
    """Return the reflectances of the nodes, J nodes first: per channel (J, M, 1) or (J, M, L)."""
    n, k = (jnp.asarray(a)[:, None, None] * curves.eta_i for a in (NODES_N, NODES_K))
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


def two_best(misfit: Array) -> tuple[Array, Array, Array]:
    """Return the best node, the second-best separate one, and whether there is one; each (L,).

    Plain minima throughout: argmin runs as a scalar loop on the CPU, 4 times slower than all this.
    """
    mesh = misfit.reshape(ROWS, COLUMNS, -1)
    beside = jnp.pad(mesh, ((1, 1), (0, 0), (0, 0)), constant_values=jnp.inf)
    beside = jnp.minimum(jnp.minimum(beside[:-2], beside[1:-1]), beside[2:])
    beside = jnp.pad(beside, ((0, 0), (1, 1), (0, 0)), constant_values=jnp.inf)
    beside = jnp.minimum(jnp.minimum(beside[:, :-2], beside[:, 1:-1]), beside[:, 2:])
    low = (mesh <= beside).reshape(misfit.shape)
    node = jnp.arange(float(len(misfit)))[:, None]

    def where_least(values: Array) -> tuple[Array, Array]:
        least = values.min(0)
        return jnp.where(values == least, node, jnp.inf).min(0), least

    first, _ = where_least(misfit)
    second, least = where_least(jnp.where(low & (node != first), misfit, jnp.inf))
    return first.astype(int), second.astype(int), jnp.isfinite(least)


def mesh_starts(curves: Curves, found: list[Array]) -> tuple[Array, Array, Array]:
    """Return x, w, chart of the first and of the second start, (3, L), and if there is a second."""
    first, second, separate = two_best(misfits(found, curves))
    nodes = jnp.asarray(NODES)
    return nodes[:, first], nodes[:, second], separate
