"""Starts of a bare surface whose index is free, from its powers over the angle: a mesh of indices.

All nodes are compared with all curves by matrix products, and between two neighbouring nodes the
curve is taken to change linearly: the best place on such a segment, and what it misses there, then
follow in closed form. A mesh of nodes alone would have to be as fine as the basins are narrow, and
the data fix two numbers very unequally: R(0) to the noise, the other one by the shape over angle
only. Segments lie along R(0), so that the mesh is fine in the other one for little. Starts are the
segments that miss less than their neighbours.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from fitting.data.quantities import REFLECTED
from fitting.problem.curve_lanes import Curves
from fitting.samples.parameters import from_parameter
from fitting.searching.batch_search import BatchSearch
from fitting.searching.starts import starts

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


class _Mesh(NamedTuple):
    """blocks: nodes (rows, columns), segments lie along rows. most: starts of a curve. share: of
    the sum of squares of the data, above which a further start is hopeless."""

    blocks: tuple[np.ndarray, ...]
    most: int
    share: float


def _mesh(plane: np.ndarray, totally: int, most: int, share: float, *lossless: tuple) -> _Mesh:
    """Return a mesh of the plane, of so many n < 1, and of k = 0 where few data leave it open."""
    # By critical angle: in total reflection 1 - R is proportional to k, a small one like no other.
    n = np.sin(np.radians(np.linspace(88.0, 6.0, totally)))
    edges = [1.0 + np.geomspace(*ends)[:, None] + 0j for ends in lossless]
    return _Mesh((plane, n * (1.0 + 1j * np.array([[0.0], [2e-3], [2e-2]])), *edges), most, share)


# For the ordinary curve; for few angles, or angles near the normal only; and for R_p alone, which
# has indices below and above the one whose Brewster angle was measured, lossless and absorbing
# ones, and in total reflection one wherever a critical angle falls between two data.
_ABOVE, _BELOW = (0.02, 110.0), (-0.03, -0.93)
MESHES = {
    "coarse": _mesh(_plane(12, 8, 0.02), 48, 3, 0.005),
    "fine": _mesh(_plane(16, 24, 0.002), 48, 8, 0.1, (*_ABOVE, 48)),
    "open": _mesh(_plane(32, 80, 0.002), 96, 16, 1.0, (*_ABOVE, 160), (*_BELOW, 32)),
}


class _Sums(NamedTuple):
    """Of N curves over G angles: sums of w^2 s v, w^2 p v and of w^2 s s, s p, p p, where a datum
    is v = s R_s + p R_p with an error 1 / w; of v v over all."""

    s: np.ndarray
    p: np.ndarray
    ss: np.ndarray
    sp: np.ndarray
    pp: np.ndarray
    square: np.ndarray


def _sums(curves: Curves, grid: np.ndarray) -> _Sums:
    """Return the sums over the angles ``grid``: those of the rows, or `_GRID`."""
    points, count = curves.base.points, curves.count
    angle, share = (curves.own.get(n, getattr(points, n)) for n in ("angle_deg", "s_share"))
    square, totals = np.zeros(count), np.zeros((5, count, len(grid)))
    each = np.arange(count)[:, None]
    for q, v in curves.values.items():
        rows = curves.seen.row[curves.seen.quantity == q]
        sigma = 1.0 if curves.sigma is None else curves.sigma[q]
        w, v = np.where(np.isfinite(v), np.power(sigma, -2.0), 0.0), np.nan_to_num(v)
        s = {"R_s": 1.0, "R_p": 0.0}.get(q, share[rows].T)
        p, wv = 1.0 - s, w * v
        square += (wv * v).sum(1)
        place = angle[rows].T * (len(grid) - 1) / 90.0
        below = np.minimum(place.astype(int), len(grid) - 2)
        for total, factor, of in zip(
            totals, (s, p, s * s, s * p, p * p), (wv, wv, w, w, w), strict=True
        ):
            if not np.any(factor):
                continue
            if grid is not _GRID:
                total[:, rows] += of * factor
            else:
                np.add.at(total, (each, below), of * factor * (1.0 - place + below))
                np.add.at(total, (each, below + 1), of * factor * (place - below))
    ss, sp, pp = (t[:1] if (t == t[:1]).all() else t for t in totals[2:])
    return _Sums(totals[0], totals[1], ss, sp, pp, square)


def _reflectances(index: np.ndarray, angle_deg: np.ndarray) -> np.ndarray:
    """Return R_s and R_p, (2, ..., G)."""
    c, eps = np.cos(np.radians(angle_deg)), index[..., None] ** 2
    root = np.sqrt(eps - np.sin(np.radians(angle_deg)) ** 2)
    return np.abs([(c - root) / (c + root), (eps * c - root) / (eps * c + root)]) ** 2


def _along_segments(nodes: np.ndarray, sums: _Sums) -> tuple[np.ndarray, np.ndarray]:
    """Return the least misfit on each segment (..., rows - 1, columns, lanes), and where on it.

    nodes: (2, rows, columns, G), R_s and R_p. The best place, 0 to 1, is that of a straight line:
    t = sum w^2 d (v - g) / sum w^2 d^2 with d the change of g from end to end.
    """

    def over_data(*parts: tuple[Any, np.ndarray]) -> Any:
        # Small products: of large ones each has BLAS wait for its threads, ten times as long.
        of = _as_lanes(sums.square[:, None])
        nothing = np.zeros((len(of), *parts[0][0].shape[:-1], of.shape[-1]))
        return sum((np.matmul(a, _as_lanes(w)) for a, w in parts if w.any()), nothing)

    def squares(s: np.ndarray, p: np.ndarray) -> np.ndarray:
        return over_data((s * s, sums.ss), (2.0 * s * p, sums.sp), (p * p, sums.pp))

    linear = over_data(*zip(nodes, sums[:2], strict=True))
    plain, length = squares(*nodes), squares(*np.diff(nodes, axis=1))
    low = plain[..., :-1, :, :]
    slope = np.diff(linear, axis=-3) - 0.5 * (np.diff(plain, axis=-3) - length)
    t = np.clip(slope / np.where(length > 0.0, length, 1.0), 0.0, 1.0)
    gain = 2.0 * linear[..., :-1, :, :] + t * (2.0 * slope - t * length)
    return _as_lanes(sums.square[:, None]) + low - gain, t


def _as_lanes(a: np.ndarray) -> np.ndarray:
    """Return (N, G) as (N / lanes, 1, G, lanes)."""
    lanes = min(len(a), _LANES)
    return a.reshape(-1, 1, lanes, a.shape[1]).swapaxes(2, 3)


def _among_neighbours(misfit: np.ndarray) -> np.ndarray:
    """Return the least value of each segment and its neighbours in (..., rows, columns, lanes)."""
    for axis in (-3, -2):
        a, out = np.moveaxis(misfit, axis, 0), np.moveaxis(misfit, axis, 0).copy()
        np.minimum(out[1:], a[:-1], out=out[1:])
        np.minimum(out[:-1], a[1:], out=out[:-1])
        misfit = np.moveaxis(out, 0, axis)
    return misfit


def _kinds(sums: _Sums, angle_deg: np.ndarray, denser: np.ndarray) -> np.ndarray:
    """Return the mesh that each curve needs, (N,): by what its angles leave open."""
    some = sums.ss + sums.pp > 0.0
    count = some.sum(1)
    lowest = np.where(some, angle_deg, 90.0).min(1)
    highest = np.where(some, angle_deg, 0.0).max(1)
    few = count <= _FEW
    p_alone = (sums.ss <= (_NEARLY_P / (1.0 - _NEARLY_P)) ** 2 * sums.pp).all(1)
    is_open = p_alone & (few | (lowest >= _OPEN_ABOVE) | denser)
    return np.where(is_open, "open", np.where(few | (highest < _NARROW), "fine", "coarse"))


def _low_places(
    mesh: _Mesh, tables: list[np.ndarray], sums: _Sums, pick: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the places (L,) on segments that miss less than their neighbours, and their curves."""
    parts = [_along_segments(nodes, sums) for nodes in tables]
    best = np.min([misfit.min((-3, -2)) for misfit, _ in parts], 0)
    bound = np.maximum(4.0 * best, mesh.share * sums.square.reshape(best.shape))[:, None, None]
    index, curve, miss = [], [], []
    for block, (misfit, t) in zip(mesh.blocks, parts, strict=True):
        at = np.nonzero((misfit <= _among_neighbours(misfit)) & (misfit <= bound))
        low, high = block[at[1:3]], block[at[1] + 1, at[2]]
        index.append(low + t[at] * (high - low))
        curve.append(at[0] * t.shape[-1] + at[3])
        miss.append(misfit[at])
    index, curve, miss = map(np.concatenate, (index, curve, miss))
    order = np.lexsort((miss, curve))
    index, curve = index[order], curve[order]
    rank = np.arange(len(curve)) - np.searchsorted(curve, curve)
    keep = (rank < mesh.most) & (curve < len(pick))
    return index[keep], pick[curve[keep]]


def mesh_starts(search: BatchSearch) -> tuple[np.ndarray, np.ndarray]:
    """Return starts (p, L) in the solver's coordinates, and the curve of each, (L,)."""
    u, outside = search.job.u, search.curves.outside
    both = [{n.rpartition(".")[2]: w for n, w in zip(u.spec.moving, u.moving, strict=True)}[part]
            for part in ("eta", "k")]  # fmt: skip

    def inside(index: np.ndarray, unit: Any) -> list[np.ndarray]:
        parts = np.real(index) * unit, np.imag(index) * unit
        return [np.clip(x, w.low, w.high) for x, w in zip(parts, both, strict=True)]

    middle = np.median(outside)
    meshes = {kind: m._replace(blocks=tuple(
        (eta + 1j * k) / middle for eta, k in (inside(b, middle) for b in m.blocks)
    )) for kind, m in MESHES.items()}  # fmt: skip
    found, tables = list[tuple[np.ndarray, np.ndarray]](), dict[str, list[np.ndarray]]()
    every = np.flatnonzero(search.known)
    angle = search.curves.own.get("angle_deg", search.curves.base.points.angle_deg)
    grid = angle[:, 0] if (angle == angle[:, :1]).all() else _GRID
    for first in range(0, len(every), _SIDE_BY_SIDE):
        pick = every[first : first + _SIDE_BY_SIDE]
        sums = _sums(search.curves.at(pick), grid)
        kinds = np.broadcast_to(_kinds(sums, grid, outside[pick] > 1.0), len(pick))
        for kind in np.unique(kinds):
            mine = np.flatnonzero(kinds == kind)
            if kind not in tables:
                tables[kind] = [_reflectances(b, grid) for b in meshes[kind].blocks]
            # In whole calls, filled up with the last curve.
            full = np.pad(mine, (0, -len(mine) % min(len(mine), _LANES)), "edge")
            part = _Sums._make(a[full] if len(a) == len(pick) else a for a in sums)
            found.append(_low_places(meshes[kind], tables[kind], part, pick[mine]))
    index, which = (np.concatenate(parts) for parts in zip(*found, strict=True))
    rows = [from_parameter(w.parameter.coordinate, x)
            for w, x in zip(both, inside(index, outside[which]), strict=True)]  # fmt: skip
    return np.stack(rows if u.moving[0] is both[0] else rows[::-1]), which


def search_surface(search: BatchSearch) -> None:
    """Follow the starts of the mesh; and others where none of these ends."""
    search.run(*mesh_starts(search))
    rest = np.flatnonzero(search.known & ~search.best.done)
    if len(rest):
        others = starts(search.job.u.moving, _OTHERS, 0)
        search.run(np.tile(others, len(rest)), np.repeat(rest, _OTHERS))
