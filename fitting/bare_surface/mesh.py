"""Where to start: the best node of a coarse mesh, and the best of separate basins.

From the best of the 96 nodes 3 or 4 evaluations lead to the minimum, and for 60 angles, s and p, p
alone or unpolarized, that minimum was the global one in every one of 4000 truths of each class
(dielectric, weak absorber, semiconductor, metal), where guesses from one feature of the curve fail
(the angle of least R_p: 8 % for unpolarized data; the closed form from R_s and R_p: 17 % for metals
with noise). With 60 nodes it still was; with 36 it was not (0.8 % wrong for glass).

All nodes are compared with all curves by one matrix product,

    sum w^2 (g - v)^2 = sum w^2 g^2 - 2 sum w^2 v g + (what is the same for all nodes),

and further starts are nodes that are lower than their neighbours. Few angles can have several
solutions (R_p at 60 and 75 degrees: 1.5 for a dielectric on average), so that there the mesh is
finer, a line of nodes along k = 0 is added, and five further starts are followed: that finds the
best solution of every one of 300 curves of each kind tried and 97 % of all that fit alike, where
the coarse mesh and one further start found 89 and 73 %.

R_p alone has further minima over a limited range of angles, however many there are: indices below
and above the one whose Brewster angle was measured, lossless ones on a line of their own, absorbing
ones between, and in total reflection one wherever a critical angle falls between two data. With the
coarse mesh 16 % of dielectrics from 50 to 75 degrees and 76 % of those of n 1.3 to 2 from 55 to 70
ended in a wrong one; with the mesh "open", its dense lines of nodes and fifteen further starts, 8
of 40,000 curves with ranges, noise and media at random. It takes some 40 evaluations for 4, and is
used where the angles leave this open (`kinds`).

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
# R_p alone may have further minima where no angle below this one (degrees) is measured.
OPEN_ABOVE_DEG = 10.0
# Of a mixture that is R_p but for this part of R_s the same is true.
NEARLY_P = 0.1


class Block(NamedTuple):
    """Nodes in rows and columns, or in one row; lows: how many of its low nodes to start from."""

    rows: int
    columns: int
    lows: int


NONE = Block(0, 1, 0)


class Mesh(NamedTuple):
    """Blocks of nodes. index: relative n and k, (2, J). points: x, w and chart, (3, J).

    first: the best of so many blocks is where every fit starts; the low nodes of all are followed
    beside it.
    """

    blocks: tuple[Block, ...]
    first: int
    index: np.ndarray
    points: np.ndarray


def _spaced(low: float, high: float, count: int) -> np.ndarray:
    """x evenly spaced in R(0) for weak reflectors and in log(1 - R(0)) for strong ones."""
    return 0.3 * np.sinh(np.linspace(np.arcsinh(low / 0.3), np.arcsinh(high / 0.3), count))


def _mesh(
    plane: Block, lowest: float, totally: Block, above: Block = NONE, below: Block = NONE
) -> Mesh:
    """Return a mesh: the plane; totally: n < 1 and a small k; above, below: k = 0, n > 1, n < 1."""
    x = np.repeat(_spaced(lowest, 8.0, plane.rows), plane.columns)
    w = np.tile((np.arange(plane.columns) + 0.5) / plane.columns, plane.rows) * 4.0 * xi_of(x)
    n = np.repeat(np.linspace(0.99, 0.1, totally.rows), totally.columns)
    # 1 - R is proportional to k there: one k stands for some decades of it.
    k = n * np.tile([2e-3, 4e-4, 1e-2][: totally.columns], totally.rows)
    # n from 1.02 to 110; evenly in log(n - 1), since two minima on this line may be as near to each
    # other as 1.33 and 1.44 (16 angles, 73 to 83 degrees).
    at_edge = 1.0 + np.geomspace(0.02, 110.0, above.rows)
    at_edge = (at_edge - 1.0) ** 2 / (2.0 * at_edge)
    at_edge = np.log1p(at_edge)
    beyond = _spaced(5e-4, 2.0, below.rows)  # n from .97 to .07
    edge = np.full(above.rows, W_MIN), np.ones(above.rows)
    index = np.concatenate([
        index_derivatives(x, w, np.ones_like(x))[:2],
        [n, k],
        index_derivatives(at_edge, *edge)[:2],
        index_derivatives(beyond, np.full(below.rows, W_MIN), -np.ones(below.rows))[:2],
    ], axis=1)  # fmt: skip
    blocks = tuple(block for block in (plane, totally, above, below) if block.rows)
    return Mesh(blocks, 2, index, coordinates_of(*index))


# From R(0) = 1e-4 (n = 1.2; the fine ones 1e-6) to .999, all the way between the two ends k = 0.
MESHES = {
    "coarse": _mesh(Block(12, 8, 1), 0.02, Block(16, 1, 0)),
    "fine": _mesh(Block(24, 16, 2), 0.002, Block(32, 1, 1), Block(48, 1, 2)),
    "open": _mesh(
        Block(32, 24, 6), 0.002, Block(64, 3, 4), Block(160, 1, 4), Block(32, 1, 1)
    ),
}  # fmt: skip


def kinds(
    channels: tuple[str, ...],
    count: np.ndarray,
    lowest_deg: np.ndarray,
    s_share: np.ndarray,
    denser: bool,
) -> np.ndarray:
    """Return the mesh that each curve needs, (N,) keys of MESHES.

    count: angles with data. lowest_deg: the least of them. s_share: the most of s in R.
    denser: whether the light may come from the denser side, so that R_p has kinks.
    """
    few = count <= FEW_ANGLES
    p_alone = "R_s" not in channels and (np.asarray(s_share) < NEARLY_P) | ("R" not in channels)
    open_to_others = few | (lowest_deg > OPEN_ABOVE_DEG) | denser
    return np.where(p_alone & open_to_others, "open", np.where(few, "fine", "coarse"))


def node_curves(curves: Curves, channels: tuple[str, ...], mesh: str) -> list[Array]:
    """Return the reflectances of the nodes, J nodes first: per channel (J, M, 1) or (J, M, L)."""
    n, k = (jnp.asarray(a[:, None, None]) for a in MESHES[mesh].index)
    return list(reflectances(curves.cos_theta, curves.s_share, n, k, channels))


def misfits(found: list[Array], curves: Curves, mesh: str) -> Array:
    """Return (J, L): the sum of squares at each node, less what is the same for all nodes.

    In single precision with the coarse mesh, to save a twentieth of the time of a fit: its nodes
    lie too far apart to be told from each other by rounding.
    """
    precision = jnp.float32 if mesh == "coarse" else found[0].dtype
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


def mesh_starts(
    curves: Curves, found: list[Array], mesh: str
) -> tuple[Array, list[tuple[Array, Array]]]:
    """Return the first start, x, w and chart (3, L), and more, each with where there is one.

    found: of `node_curves`. The same number of further starts for all curves of one ``mesh``.
    """
    blocks, first_of, _, points = MESHES[mesh]
    misfit = misfits(found, curves, mesh)
    ends = np.cumsum([block.rows * block.columns for block in blocks])
    first, exists = _least(misfit[: ends[first_of - 1]], jnp.ones((), bool))
    further = []
    for block, end in zip(blocks, ends.tolist(), strict=True):
        begin = end - block.rows * block.columns
        shape = (block.rows, block.columns)
        low = _lowest(misfit[begin:end], shape, first - begin, block.lows) if block.lows else []
        further += [(node + begin, exists) for node, exists in low]
    at = jnp.asarray(points)
    chosen = [(at[:, node[0].astype(int)], ok) for node, ok in [(first, exists), *further]]
    return chosen[0][0], chosen[1:]
