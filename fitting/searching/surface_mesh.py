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

from fitting.samples.parameters import from_parameter
from fitting.searching.batch_search import BatchSearch
from fitting.searching.starts import starts

POWERS_OF_SURFACE = ("R_s", "R_p", "R")
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
    return names == {"eta", "k"} and len(spec.media.index) == 1 and set(spec.channels) <= set(
        POWERS_OF_SURFACE
    )


def _plane(rows: int, columns: int, lowest: float) -> np.ndarray:
    """Return relative indices from R(0) = tanh(x / 2), x = lowest, to .999, all |N| that have it.

    x = log[(1 + |N|^2) / 2n] is evenly spaced in R(0) for weak reflectors and in log(1 - R(0)) for
    strong ones; on a line of constant x, |N| runs from e^xi to e^-xi with cosh xi = e^x.
    """
    x = 0.3 * np.sinh(np.linspace(np.arcsinh(lowest / 0.3), np.arcsinh(6.0 / 0.3), rows))[:, None]
    log = np.arccosh(np.exp(x)) * (1.0 - 2.0 * (np.arange(columns) + 0.5) / columns)
    cosine = np.cosh(log) * np.exp(-x)
    return np.exp(log) * (cosine + 1j * np.sqrt(1.0 - cosine**2))


def _totally(columns: int) -> np.ndarray:
    """Return n < 1 by the critical angle; 1 - R is proportional to k, a small one is like none."""
    return np.sin(np.radians(np.linspace(88.0, 6.0, columns))) * (
        1.0 + 1j * np.array([[0.0], [2e-3], [2e-2]])
    )


def _lossless(first: float, last: float, rows: int) -> np.ndarray:
    return 1.0 + np.geomspace(first, last, rows)[:, None] + 0j


class _Mesh(NamedTuple):
    """blocks: nodes, segments lie along the first axis. most: starts of a curve. share: of the sum
    of squares of the data, above which a further start is hopeless."""

    blocks: tuple[np.ndarray, ...]
    most: int
    share: float


MESHES = {
    "coarse": _Mesh((_plane(12, 8, 0.02), _totally(48)), 3, 0.005),
    "fine": _Mesh((_plane(16, 24, 0.002), _totally(48), _lossless(0.02, 110.0, 48)), 8, 0.1),
    "open": _Mesh(
        (_plane(32, 80, 0.002), _totally(96), _lossless(0.02, 110.0, 160),
         _lossless(-0.03, -0.93, 32)), 16, 1.0,
    ),
}  # fmt: skip


class _Sums(NamedTuple):
    """Of N curves over G angles: sums of w^2 s v, w^2 p v and of w^2 s s, s p, p p, where a datum
    is v = s R_s + p R_p with an error 1 / w; of v v over all. angle_deg: (G,)."""

    s: np.ndarray
    p: np.ndarray
    ss: np.ndarray
    sp: np.ndarray
    pp: np.ndarray
    square: np.ndarray
    angle_deg: np.ndarray


def _sums(search: BatchSearch, pick: np.ndarray) -> _Sums:
    curves = search.curves.at(pick)
    points, count = curves.base.points, curves.count
    angle, share = (curves.own.get(n, getattr(points, n)) for n in ("angle_deg", "s_share"))
    shared = bool((angle == angle[:, :1]).all())
    grid = angle[:, 0] if shared else _GRID
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
            if shared:
                total[:, rows] += of * factor
            else:
                np.add.at(total, (each, below), of * factor * (1.0 - place + below))
                np.add.at(total, (each, below + 1), of * factor * (place - below))
    of_nodes = [t[:1] if (t == t[:1]).all() else t for t in totals[2:]]
    return _Sums(*totals[:2], *of_nodes, square, grid)


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

    def over_data(*parts: tuple[Any, np.ndarray]) -> np.ndarray:
        # Small products: of large ones each has BLAS wait for its threads, ten times as long.
        return sum(np.matmul(a, _as_lanes(w)) for a, w in parts if w.any())

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


def _kinds(sums: _Sums, denser: np.ndarray) -> np.ndarray:
    """Return the mesh that each curve needs, (N,): by what its angles leave open."""
    some = sums.ss + sums.pp > 0.0
    count = some.sum(1)
    lowest = np.where(some, sums.angle_deg, 90.0).min(1)
    highest = np.where(some, sums.angle_deg, 0.0).max(1)
    few = count <= _FEW
    p_alone = (sums.ss <= (_NEARLY_P / (1.0 - _NEARLY_P)) ** 2 * sums.pp).all(1)
    is_open = p_alone & (few | (lowest >= _OPEN_ABOVE) | denser)
    return np.where(is_open, "open", np.where(few | (highest < _NARROW), "fine", "coarse"))


def mesh_starts(search: BatchSearch) -> tuple[np.ndarray, np.ndarray]:
    """Return starts (p, L) in the solver's coordinates, and the curve of each, (L,)."""
    u, outside = search.job.u, search.curves.outside
    names = [name.rpartition(".")[2] for name in u.spec.moving]
    eta, k = (u.moving[names.index(n)] for n in ("eta", "k"))
    middle = np.median(outside)
    boxed = {
        kind: mesh._replace(blocks=tuple(
            np.clip(b.real, eta.low / middle, eta.high / middle)
            + 1j * np.clip(b.imag, k.low / middle, k.high / middle)
            for b in mesh.blocks
        ))
        for kind, mesh in MESHES.items()
    }  # fmt: skip
    found = list[tuple[np.ndarray, np.ndarray]]()
    every, tables = np.flatnonzero(search.known), dict[str, list[np.ndarray]]()
    for first in range(0, len(every), _SIDE_BY_SIDE):
        pick = every[first : first + _SIDE_BY_SIDE]
        sums = _sums(search, pick)
        kinds = np.broadcast_to(_kinds(sums, outside[pick] > 1.0), len(pick))
        for kind in np.unique(kinds):
            mine = np.flatnonzero(kinds == kind)
            mesh = boxed[kind]
            if kind not in tables or len(tables[kind][0][0, 0, 0]) != len(sums.angle_deg):
                tables[kind] = [_reflectances(b, sums.angle_deg) for b in mesh.blocks]
            # In whole calls, filled up with the last curve.
            lanes = min(len(mine), _LANES)
            full = np.pad(mine, (0, -len(mine) % lanes), "edge")
            part = _Sums(*(a[full] if len(a) == len(pick) else a for a in sums[:-1]), sums[-1])
            found.append(_low_places(mesh, tables[kind], part, pick[mine]))
    index, which = (np.concatenate(parts) for parts in zip(*found, strict=True))
    index = index * outside[which]
    rows = [from_parameter(w.parameter.coordinate, np.clip(x, w.low, w.high))
            for w, x in ((eta, index.real), (k, index.imag))]  # fmt: skip
    return np.stack(rows if names[0] == "eta" else rows[::-1]), which


def search_surface(search: BatchSearch) -> None:
    """Follow the starts of the mesh; and others where none of these ends."""
    search.run(*mesh_starts(search))
    rest = np.flatnonzero(search.known & ~search.best.done)
    if len(rest):
        others = starts(search.job.u.moving, _OTHERS, 0)
        search.run(np.tile(others, len(rest)), np.repeat(rest, _OTHERS))


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
