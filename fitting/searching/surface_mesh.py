"""Starts of a bare surface whose index is free, from its powers over the angle: a mesh of indices.

All nodes are compared with all curves by matrix products, and between two neighbouring nodes the
curve is taken to change linearly: the best place on such a segment, and what it misses there, then
follow in closed form. A mesh of nodes alone would have to be as fine as the basins are narrow, and
the data fix two numbers very unequally: R(0) to the noise, the other one by the shape over angle
only. Segments lie along R(0), so that the mesh is fine in the other one for little. Starts are the
segments that miss less than their neighbours.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from fitting.data.quantities import REFLECTED
from fitting.problem.curve_lanes import Curves
from fitting.process.side_by_side import side_by_side
from fitting.samples.parameters import from_parameter
from fitting.searching.batch_search import BatchSearch

# Curves that are compared side by side.
_SIDE_BY_SIDE, _LANES = 512, 32
# Where curves have angles of their own, nodes are interpolated from these, degrees.
_GRID = np.linspace(0.0, 90.0, 181)
# Starts anywhere of a curve of which none of the mesh comes to rest: 8 in 10,000. They lie where
# R has its least value over n, and the data do not tell in which direction to go.
_OTHERS = 16
# Up to so many angles, and up to this highest one, the fine mesh is used; R_p alone (R with less
# than this part of R_s) is open from this lowest angle on.
_FEW, _NARROW, _NEARLY_P, _OPEN_ABOVE = 24, 40.0, 0.1, 10.0


def of_bare_surface(search: BatchSearch) -> bool:
    """Whether all that is fitted is eta and k of one boundary, to powers alone."""
    spec = search.job.u.spec
    names = {name.rpartition(".")[2] for name in spec.moving}
    return names == {"eta", "k"} and spec.media.bare and {*spec.channels} <= {*REFLECTED}


def _plane(rows: int, columns: int, lowest: float) -> np.ndarray:
    """Return relative indices from R(0) = tanh(x / 2), x = lowest, to .999, all |N| that have it.

    x = log[(1 + |N|^2) / 2n] is evenly spaced in R(0) for weak reflectors and in log(1 - R(0)) for
    strong ones; on a line of constant x, |N| runs from e^xi to e^-xi with cosh xi = e^x.
    """
    x = 0.3 * np.sinh(np.linspace(np.arcsinh(lowest / 0.3), np.arcsinh(6.0 / 0.3), rows))[:, None]
    log = np.arccosh(np.exp(x)) * (1.0 - 2.0 * (np.arange(columns) + 0.5) / columns)
    cosine = np.cosh(log) * np.exp(-x)
    return np.exp(log) * (cosine + 1j * np.sqrt(1.0 - cosine**2))


def _mesh(plane: np.ndarray, totally: int, *lossless: tuple) -> list[np.ndarray]:
    """Return a mesh of the plane, of so many n < 1, and of k = 0 where few data leave it open.

    Nodes (rows, columns) each; segments lie along rows.
    """
    # By critical angle: in total reflection 1 - R is proportional to k, a small one like no other.
    n = np.sin(np.radians(np.linspace(88.0, 6.0, totally)))
    edges = [1.0 + np.geomspace(*ends)[:, None] + 0j for ends in lossless]
    return [plane, n * (1.0 + 1j * np.array([[0.0], [2e-3], [2e-2]])), *edges]


# For the ordinary curve; for few angles, or angles near the normal only; and for R_p alone, which
# has indices below and above the one whose Brewster angle was measured, lossless and absorbing
# ones, and in total reflection one wherever a critical angle falls between two data. Beside each
# mesh the most starts of a curve, and the part of the sum of squares of the data above which a
# further start is hopeless.
_ABOVE, _BELOW = (0.02, 110.0), (-0.03, -0.93)
MESHES = {
    "coarse": (_mesh(_plane(12, 8, 0.02), 48), 3, 0.005),
    "fine": (_mesh(_plane(16, 24, 0.002), 48, (*_ABOVE, 48)), 8, 0.1),
    "open": (_mesh(_plane(32, 80, 0.002), 96, (*_ABOVE, 160), (*_BELOW, 32)), 16, 1.0),
}


class _Sums(NamedTuple):
    """Of N curves over G angles, of data v = s R_s + p R_p with errors 1 / w: sums of w^2 v times
    s and p, (2, G, N), of w^2 times s s, 2 s p and p p, (3, G, N), and of w^2 v v, (1, N)."""

    linear: np.ndarray
    quadratic: np.ndarray
    square: np.ndarray


def _sums(curves: Curves, pick: np.ndarray, grid: np.ndarray) -> _Sums:
    """Return the sums of the curves ``pick`` over angles ``grid``: those of rows, or `_GRID`."""
    targets, each = curves.targets(pick), np.arange(len(pick))
    square, totals = np.zeros((1, len(pick))), np.zeros((5, len(grid), len(pick)))
    place = targets.points.angle_deg * (len(grid) - 1) / 90.0
    below = np.minimum(place.astype(int), len(grid) - 2)
    for q, v, w in zip(curves.seen.channels, targets.values, targets.weights, strict=True):
        s = float(q == "R_s") if q in ("R_s", "R_p") else targets.points.s_share
        p, w, wv = 1.0 - s, w * w, w * w * v
        square += (wv * v).sum(0)
        several = wv * s, wv * p, w * s * s, 2.0 * w * s * p, w * p * p
        for total, of in zip(totals, several, strict=True):
            if grid is not _GRID:
                total += of
            else:
                np.add.at(total, (below, each), of * (1.0 - place + below))
                np.add.at(total, (below + 1, each), of * (place - below))
    quadratic = totals[2:]
    alike = (quadratic == quadratic[:, :, :1]).all()
    return _Sums(totals[:2], quadratic[:, :, :1] if alike else quadratic, square)


def _reflectances(index: np.ndarray, angle_deg: np.ndarray) -> np.ndarray:
    """Return R_s and R_p, (2, ..., G)."""
    c, eps = np.cos(np.radians(angle_deg)), index[..., None] ** 2
    root = np.sqrt(eps - np.sin(np.radians(angle_deg)) ** 2)
    return np.abs([(c - root) / (c + root), (eps * c - root) / (eps * c + root)]) ** 2


def _along_segments(nodes: np.ndarray, sums: _Sums) -> tuple[np.ndarray, np.ndarray]:
    """Return the least misfit on each segment (N / l, rows - 1, columns, l), and where on it.

    nodes: (2, rows, columns, G), R_s and R_p. The best place, 0 to 1, is that of a straight line:
    t = sum w^2 d (v - g) / sum w^2 d^2 with d the change of g from end to end. l: lanes of a call.
    """

    def as_lanes(a: np.ndarray) -> np.ndarray:
        return a.reshape(len(a), -1, min(a.shape[1], _LANES)).swapaxes(0, 1)

    def over_data(curves: Sequence[np.ndarray], weights: np.ndarray) -> np.ndarray:
        # Small products: of large ones each has BLAS wait for its threads, ten times as long.
        pairs = [(a, w) for a, w in zip(curves, weights, strict=True) if w.any()]
        # all of them 0: of data that are
        pairs = pairs or [(curves[0], weights[0])]
        total: Any = sum(np.matmul(a.reshape(-1, len(w)), as_lanes(w)) for a, w in pairs)
        return total.reshape(len(total), -1, nodes.shape[2], total.shape[-1])

    def squares(s: np.ndarray, p: np.ndarray) -> np.ndarray:
        return over_data((s * s, s * p, p * p), sums.quadratic)

    linear = over_data([*nodes], sums.linear)
    plain, length = squares(*nodes), squares(*np.diff(nodes, axis=1))
    slope = np.diff(linear, axis=1) - 0.5 * (np.diff(plain, axis=1) - length)
    t = np.minimum(np.maximum(slope / np.where(length > 0.0, length, 1.0), 0.0), 1.0)
    gain = 2.0 * linear[:, :-1] + t * (2.0 * slope - t * length)
    return as_lanes(sums.square)[:, None] + plain[:, :-1] - gain, t


def _among_neighbours(misfit: np.ndarray) -> np.ndarray:
    """Return the least value of each segment and its neighbours in (..., rows, columns, lanes)."""
    for axis in (-3, -2):
        a, misfit = np.moveaxis(misfit, axis, 0), misfit.copy()
        out = np.moveaxis(misfit, axis, 0)
        np.minimum(out[1:], a[:-1], out=out[1:])
        np.minimum(out[:-1], a[1:], out=out[:-1])
    return misfit


def _kinds(sums: _Sums, angle_deg: np.ndarray, denser: np.ndarray) -> np.ndarray:
    """Return the mesh that each curve needs, (N,): by what its angles leave open."""
    by_s, _, by_p = sums.quadratic
    some, angle = by_s + by_p > 0.0, angle_deg[:, None]
    few = some.sum(0) <= _FEW
    lowest, highest = np.where(some, angle, 90.0).min(0), np.where(some, angle, 0.0).max(0)
    p_alone = (by_s <= (_NEARLY_P / (1.0 - _NEARLY_P)) ** 2 * by_p).all(0)
    is_open = p_alone & (few | (lowest >= _OPEN_ABOVE) | denser)
    return np.where(is_open, "open", np.where(few | (highest < _NARROW), "fine", "coarse"))


def _low_places(
    sums: _Sums, mine: np.ndarray, mesh: list[np.ndarray], tables: list[np.ndarray], most: int,
    share: float,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Return the places (L,) on segments that miss less than their neighbours, and their curves.

    mine: those of the curves of ``sums`` that this mesh is for. tables: its `_reflectances`.
    """
    # whole calls, filled up with the last curve
    full = np.pad(mine, (0, -len(mine) % min(len(mine), _LANES)), "edge")
    sums = _Sums(*(a[..., full] if a.shape[-1] > 1 else a for a in sums))
    parts = [_along_segments(nodes, sums) for nodes in tables]
    best = np.min([misfit.min((1, 2)) for misfit, _ in parts], 0)
    bound = np.maximum(4.0 * best, share * sums.square.reshape(best.shape))[:, None, None]
    found = []
    for block, (misfit, t) in zip(mesh, parts, strict=True):
        at = np.nonzero((misfit <= _among_neighbours(misfit)) & (misfit <= bound))
        low, high = block[at[1:3]], block[at[1] + 1, at[2]]
        found.append((low + t[at] * (high - low), at[0] * t.shape[-1] + at[3], misfit[at]))
    index, curve, miss = (np.concatenate(each) for each in zip(*found, strict=True))
    order = np.lexsort((miss, curve))
    index, curve = index[order], curve[order]
    rank = np.arange(len(curve)) - np.searchsorted(curve, curve)
    keep = (rank < most) & (curve < len(mine))
    return index[keep], mine[curve[keep]]


def search_surface(search: BatchSearch) -> None:
    """Follow the starts of the mesh; and others where none of these ends."""
    u, curves, outside = search.job.u, search.curves, search.curves.outside
    names = [name.rpartition(".")[2] for name in u.spec.moving]
    both = [u.moving[names.index(part)] for part in ("eta", "k")]

    def inside(index: np.ndarray, unit: Any) -> list[np.ndarray]:
        parts = np.real(index) * unit, np.imag(index) * unit
        return [np.clip(x, w.low, w.high) for x, w in zip(parts, both, strict=True)]

    angle = curves.own.get("angle_deg", curves.base.points.angle_deg)
    grid = angle[:, 0] if (angle == angle[:, :1]).all() else _GRID
    meshes, middle = dict[str, tuple](), np.median(outside)
    for kind, (mesh, most, share) in MESHES.items():
        parts = [inside(block, middle) for block in mesh]
        mesh = [(eta + 1j * k) / middle for eta, k in parts]
        meshes[kind] = mesh, [_reflectances(block, grid) for block in mesh], most, share

    def of_block(pick: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        sums = _sums(curves, pick, grid)
        kinds = np.broadcast_to(_kinds(sums, grid, outside[pick] > 1.0), len(pick))
        found = [_low_places(sums, np.flatnonzero(kinds == kind), *meshes[kind])
                 for kind in np.unique(kinds)]  # fmt: skip
        return [(index, pick[curve]) for index, curve in found]

    every, _ = np.flatnonzero(search.known), curves.squares  # made before threads ask for the data
    parts = np.split(every, range(_SIDE_BY_SIDE, len(every), _SIDE_BY_SIDE))
    found = [one for some in side_by_side(of_block, parts) for one in some]
    index, which = (np.concatenate(each) for each in zip(*found, strict=True))
    rows = [from_parameter(w.parameter.coordinate, x)
            for w, x in zip(both, inside(index, outside[which]), strict=True)]  # fmt: skip
    search.run(np.stack(rows if names[0] == "eta" else rows[::-1]), which)
    rest = np.flatnonzero(search.known & ~search.best.done)
    if len(rest):
        search.run_random(_OTHERS, 0, rest)
