"""Where to start: the best place of a coarse mesh, and the best of separate basins.

All nodes are compared with all curves by matrix products of sums over the data, and between two
neighbouring nodes the curve is taken to change linearly: the best place on such a segment, and what
it misses there, then follow in closed form from the sums of its two ends. A mesh of nodes alone
would have to be as fine as the basins are narrow, and the data fix the two coordinates very
unequally: R(0) to the noise, the other one by the shape over angle only. Segments lie along the
coordinate that is fixed well, so that the mesh is fine in the other one for little.

From the best place 3 or 4 evaluations lead to the minimum, and for 60 angles, s and p or
unpolarized, that is nearly always the global one. Further starts are the segments that miss less
than their neighbours. Three meshes are used, by what the angles leave open (`kinds`):

"coarse"  the ordinary curve. Starts of a further basin are followed only if they miss little of
          the data: nearly none.
"fine"    few angles, or angles near normal incidence only: several solutions may fit.
"open"    R_p alone over a limited range of angles. There are further minima however many angles
          there are: indices below and above the one whose Brewster angle was measured, lossless
          ones on a line of their own, absorbing ones between, and in total reflection one wherever
          a critical angle falls between two data. Some 16 starts are followed.

In total reflection 1 - R is proportional to k, and a curve of small k is like no node of the plane;
a block of its own has segments along k at each n.

The success study (`benchmarks.studies.fit_success`, docs/status.md) is the measure of all this.
With meshes of nodes alone, and more of them, ten times as many fits ended in a wrong minimum, and
the median curve of few angles took three times the evaluations.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from fitting.bare_surface.coordinates import coordinates_of, index_derivatives, xi_of
from fitting.bare_surface.reflectances import Curves, reflectances

# Up to this many angles the fine mesh is used; its cost grows with their number.
FEW_ANGLES = 24
# R_p alone may have further minima where no angle below this one (degrees) is measured.
OPEN_ABOVE_DEG = 10.0
# Light near normal incidence tells one index from another by little: the fine mesh up to here.
NARROW_BELOW_DEG = 40.0
# Of a mixture that is R_p but for this part of R_s the same is true.
NEARLY_P = 0.1
# Of k / n in total reflection.
SMALL_K = np.array([0.0, 2e-3, 2e-2])
# Further starts of the coarse mesh that miss this share of the sum of squares of the data are left:
# the second number where the best place has |N| < 1, since a curve with a critical angle is unlike
# its neighbours. Of 6e5 random curves no minimum and none of 1,231 alternatives was lost against .1
# everywhere, which had a start for total reflection followed of every other metal.
HOPELESS, HOPELESS_INSIDE = 0.005, 0.1


class Block(NamedTuple):
    """Nodes in rows and columns; lows: how many of its low places to start from.

    The curve is taken to change linearly from a row to the next.
    """

    rows: int
    columns: int
    lows: int

    @property
    def nodes(self) -> int:
        """How many nodes."""
        return self.rows * self.columns

    @property
    def segments(self) -> int:
        """How many segments from a row to the next."""
        return self.nodes - self.columns


class Mesh(NamedTuple):
    """Blocks of nodes, and the relative n and k of all of them, (2, J).

    Every fit starts at the best place of the first two blocks; the low places of each are followed
    beside it.
    """

    blocks: tuple[Block, ...]
    index: np.ndarray


def _spaced(low: float, high: float, count: int) -> np.ndarray:
    """x evenly spaced in R(0) for weak reflectors and in log(1 - R(0)) for strong ones."""
    return 0.3 * np.sinh(np.linspace(np.arcsinh(low / 0.3), np.arcsinh(high / 0.3), count))


def _mesh(plane: Block, lowest: float, totally: Block, *edges: Block) -> Mesh:
    """Return a mesh: the plane; totally: n < 1 and a small k; edges: k = 0, n > 1 and n < 1."""
    x = np.repeat(_spaced(lowest, 8.0, plane.rows), plane.columns)
    w = np.tile((np.arange(plane.columns) + 0.5) / plane.columns, plane.rows) * 4.0 * xi_of(x)
    critical_angle = np.radians(np.linspace(88.0, 6.0, totally.columns))
    n = np.tile(np.sin(critical_angle), totally.rows)
    k = n * np.repeat(SMALL_K, totally.columns)
    index = [index_derivatives(x, w, np.ones_like(x))[:2], (n, k)]
    # n from 1.02 to 110, and from .97 to .07; evenly in log(n - 1) above, since two minima on this
    # line may be as near to each other as 1.33 and 1.44 (16 angles, 73 to 83 degrees).
    ends = (0.02, 110.0), (-0.03, -0.93)
    for block, (first, last) in zip(edges, ends, strict=False):
        index.append((1.0 + np.geomspace(first, last, block.rows), np.zeros(block.rows)))
    blocks = plane, totally, *edges
    return Mesh(blocks, np.concatenate(index, axis=1))


# From R(0) = 1e-4 (n = 1.2; the fine ones 1e-6) to .999, all the way between the two ends k = 0.
MESHES = {
    "coarse": _mesh(Block(12, 8, 1), 0.02, Block(len(SMALL_K), 48, 1)),
    "fine": _mesh(Block(16, 24, 2), 0.002, Block(len(SMALL_K), 48, 2), Block(48, 1, 2)),
    "open": _mesh(
        Block(32, 80, 7), 0.002, Block(len(SMALL_K), 96, 4), Block(160, 1, 4), Block(32, 1, 1)
    ),
}  # fmt: skip


def kinds(
    channels: tuple[str, ...],
    count: np.ndarray,
    lowest_deg: np.ndarray,
    highest_deg: np.ndarray,
    s_share: np.ndarray,
    denser: bool,
) -> np.ndarray:
    """Return the mesh that each curve needs, (N,) keys of MESHES.

    count: angles with data. lowest_deg, highest_deg: of them. s_share: the most of s in R.
    denser: whether the light may come from the denser side, so that R_p has kinks.
    """
    few = count <= FEW_ANGLES
    p_alone = "R_s" not in channels and (np.asarray(s_share) < NEARLY_P) | ("R" not in channels)
    open_to_others = few | (lowest_deg >= OPEN_ABOVE_DEG) | denser
    return np.where(
        p_alone & open_to_others,
        "open",
        np.where(few | (highest_deg < NARROW_BELOW_DEG), "fine", "coarse"),
    )


def node_curves(curves: Curves, channels: tuple[str, ...], mesh: str) -> tuple[Array, ...]:
    """Return the reflectances of the nodes, J nodes first: per channel (J, M, 1) or (J, M, L).

    In the precision in which they are compared with the data: of the coarse mesh in float32, to
    save a twentieth of the time of a fit. Its nodes lie too far apart to be told from each other by
    rounding.
    """
    n, k = (jnp.asarray(a[:, None, None]) for a in MESHES[mesh].index)
    found = reflectances(curves.cos_theta, curves.s_share, n, k, channels)
    return tuple(f.astype(jnp.float32) for f in found) if mesh == "coarse" else found


def _misfits(found: tuple[Array, ...], curves: Curves, mesh: str) -> tuple[Array, Array, Array]:
    """Return the least sum of squares on each segment and where on it, from 0 to 1; (S, L) each.

    And the sum of squares of the data, (L,). All in the precision of ``found``.
    """
    precision = found[0].dtype
    most = jnp.stack([w.max(0) for w in curves.weights]).max(0)
    most = jnp.where(most > 0.0, most, 1.0)  # keeps squared weights in the range of float32
    weights = [((w / most) ** 2).astype(precision) for w in curves.weights]
    values = [v.astype(precision) for v in curves.values]
    of_data = jnp.stack([(w2 * v * v).sum(0) for v, w2 in zip(values, weights, strict=True)]).sum(0)
    # All nodes in one product: block by block it takes half as long again.
    with_data = square = jnp.zeros((), precision)
    for g, v, w2 in zip(found, values, weights, strict=True):
        with_data = with_data + _summed(g, w2 * v)
        square = square + _summed(g * g, w2)
    parts, begin = [], 0
    for block in MESHES[mesh].blocks:
        own = slice(begin, begin + block.nodes)
        nodes = [g[own] for g in found]
        parts.append(_along_segments(nodes, weights, with_data[own], square[own], block))
        begin += block.nodes
    misfit, along = (jnp.concatenate(part) for part in zip(*parts, strict=True))
    return misfit + of_data, along, of_data


def _summed(a: Array, weight: Array) -> Array:
    """Return the sums over the data: (J, M, 1 or L) and (M, 1 or L) -> (J, 1 or L)."""
    if a.shape[-1] == 1:  # one set of angles: a matrix product
        return a[:, :, 0] @ weight
    return (a * weight).sum(1)


def _along_segments(
    nodes: list[Array], weights: list[Array], with_data: Array, square: Array, block: Block
) -> tuple[Array, Array]:
    """Return the least misfit on each segment of a block, less sum w^2 v^2, and where on it.

    nodes: the curves g of each channel. with_data, square: sum w^2 g v and sum w^2 g^2 of them all.
    Along a segment the curve is taken to change linearly, so that the best place on it is that of a
    straight line: t = sum w^2 d (v - g) / sum w^2 d^2 with d the change of g from end to end.
    """
    low, high = slice(block.segments), slice(block.columns, None)
    product = jnp.zeros((), square.dtype)
    for g, w2 in zip(nodes, weights, strict=True):
        product = product + _summed(g[low] * g[high], w2)
    slope = with_data[high] - with_data[low] - (product - square[low])
    length = square[high] + square[low] - 2.0 * product
    t = jnp.clip(slope / jnp.where(length > 0.0, length, 1.0), 0.0, 1.0)
    return square[low] - 2.0 * with_data[low] - t * (2.0 * slope - t * length), t


def _among_neighbours(misfit: Array) -> Array:
    """Return the least value of each segment and its neighbours in (A, B, L)."""
    for axis in (0, 1):
        size = misfit.shape[axis]
        widths = [(1, 1) if a == axis else (0, 0) for a in range(3)]
        wide = jnp.pad(misfit, widths, constant_values=jnp.inf)
        before, here, after = (jax.lax.slice_in_dim(wide, i, i + size, axis=axis) for i in range(3))
        misfit = jnp.minimum(jnp.minimum(before, here), after)
    return misfit


def _least(misfit: Array, allowed: Array) -> tuple[Array, Array]:
    """Return the best allowed segment, (1, L), and its misfit, (1, L), infinite if there is none.

    Plain minima: argmin runs as a scalar loop on the CPU, 4 times slower than all the rest.
    """
    values = jnp.where(allowed, misfit, jnp.inf)
    least = values.min(0, keepdims=True)
    number = jnp.arange(len(misfit), dtype=misfit.dtype)[:, None]
    segment = jnp.where(values == least, number, jnp.inf).min(0, keepdims=True)
    return jnp.where(jnp.isfinite(least), segment, 0.0), least


def _lowest(misfit: Array, shape: tuple[int, int], taken: Array, count: int) -> list:
    """Return ``count`` segments lower than their neighbours, best first, other than ``taken``."""
    square = misfit.reshape(*shape, -1)
    allowed = (square <= _among_neighbours(square)).reshape(misfit.shape)
    number = jnp.arange(len(misfit), dtype=misfit.dtype)[:, None]
    chosen = []
    for _ in range(count):
        allowed &= number != taken
        taken, least = _least(misfit, allowed)
        chosen.append((taken, least))
    return chosen


def _ends_of_segments(blocks: tuple[Block, ...], index: np.ndarray) -> list[np.ndarray]:
    """Return n and k at the beginning and at the end of each segment, (2, S) each."""
    of_block = np.split(index, np.cumsum([block.nodes for block in blocks])[:-1], axis=1)
    pairs = [
        (a[:, : block.segments], a[:, block.columns :])
        for a, block in zip(of_block, blocks, strict=True)
    ]
    return [np.concatenate(part, axis=1) for part in zip(*pairs, strict=True)]


def no_starts(lanes: int, mesh: str) -> Array:
    """Return starts as `mesh_starts` does, all NaN, for lanes that are not searched."""
    further = sum(block.lows for block in MESHES[mesh].blocks)
    return jnp.full((1 + further, 3, lanes), jnp.nan)


def mesh_starts(curves: Curves, found: tuple[Array, ...], mesh: str) -> Array:
    """Return the starts (1 + E, 3, L), x, w and chart each: the first one, and E further ones.

    found: of `node_curves`. E is the same for all curves of one ``mesh``; where a curve has fewer
    further starts they are NaN.
    """
    blocks, index = MESHES[mesh]
    misfit, along, of_data = _misfits(found, curves, mesh)
    ends = np.cumsum([block.segments for block in blocks]).tolist()
    first, _ = _least(misfit[: ends[1]], jnp.ones((), bool))
    low, high = (jnp.asarray(a) for a in _ends_of_segments(blocks, index))

    def point(segment: Array) -> Array:
        here = segment[0].astype(int)
        t = jnp.take_along_axis(along, here[None], 0).astype(index.dtype)
        return coordinates_of(*(low[:, here] + t * (high - low)[:, here]), xp=jnp)

    points, hopeless = [point(first)], jnp.inf
    if mesh == "coarse":
        hopeless = jnp.where(points[0][2] > 0.0, HOPELESS, HOPELESS_INSIDE) * of_data
    for block, end in zip(blocks, ends, strict=True):
        begin = end - block.segments
        shape = (block.rows - 1, block.columns)
        points += [
            jnp.where(least[0] < hopeless, point(segment + begin), jnp.nan)
            for segment, least in _lowest(misfit[begin:end], shape, first - begin, block.lows)
        ]
    return jnp.stack(points)
