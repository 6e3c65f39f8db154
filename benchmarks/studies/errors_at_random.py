"""How often 95 % intervals hold the truth where stated errors are not the errors, all at random.

Geometry, quantity, medium outside and material are those of `random_measurements`; stated errors
are 1e-4 to 3e-3, and those of a second polarization up to a hundred times larger in half of the
curves. What is really wrong, drawn for each curve: nothing; all errors too small by a factor of 1.5
to 5; a further white error of .003 to .03; a further error of 1 to 5 % of R. One repeat of each, by
the default errors, of fits that converged; where a fit names other solutions, the intervals of all
of them count together.

The seeds of intervals that leave out the truth though it fits as well as their ends stand at the
end (seed, geometry, curve).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from benchmarks.studies.fit_success import KEPT, has_second, holds
from fitting import Fit, fit_many
from fitting.residuals.error_model import sizes
from tests.truth.left_out import far_outside, rise_allowed
from tests.truth.random_measurements import (
    CLASSES,
    QUANTITIES,
    Geometry,
    draw_geometry,
    draw_index,
    textbook,
    with_gaps,
)

WRONG = ("nothing", "factor", "white", "% of R")
OF_A_CLASS = 25
A_GEOMETRY = OF_A_CLASS * len(CLASSES)
# A cell of fewer fits is not called the worst one: its share is uncertain by more than 1.5 %.
ENOUGH = 200
# What is beyond is no reflectance, and refused.
_LEAST, _MOST = -0.19, 1.19


class Batch(NamedTuple):
    """Curves of one geometry: true index, class, what is wrong (N,); data and sigma (N, M)."""

    geometry: Geometry
    eta: np.ndarray
    k: np.ndarray
    kind: np.ndarray
    wrong: np.ndarray
    data: dict[str, np.ndarray]
    sigma: dict[str, np.ndarray]


def draw(seed: int, number: int) -> Batch:
    """Return the curves of geometry ``number``."""
    rng = np.random.default_rng([seed, number])
    g = draw_geometry(rng, list(QUANTITIES)[number % len(QUANTITIES)])
    found = [draw_index(kind, OF_A_CLASS, g.eta_i, rng) for kind in CLASSES]
    eta, k = (np.concatenate(part) for part in zip(*found, strict=True))
    clean = textbook(g.angles, (eta + 1j * k)[:, None], g.eta_i)
    stated = 10.0 ** rng.uniform(-4.0, -2.5, A_GEOMETRY)
    second = np.where(rng.random(A_GEOMETRY) < 0.5, 1.0, 10.0 ** rng.uniform(0.0, 2.0, A_GEOMETRY))
    wrong, size = rng.integers(0, len(WRONG), A_GEOMETRY), rng.random(A_GEOMETRY)
    factor, white, part = (
        np.where(wrong == i, of, usual)[:, None]
        for i, of, usual in (
            (1, 1.5 + 3.5 * size, 1.0), (2, 10.0 ** (-2.5 + size), 0.0),
            (3, 10.0 ** (-2.0 + 0.7 * size), 0.0),
        )
    )  # fmt: skip
    data, sigma = {}, {}
    for i, name in enumerate(QUANTITIES[g.quantity]):
        R, own = clean[name], (stated * (second if i else 1.0))[:, None]
        noise = rng.standard_normal((3, *R.shape))
        value = R + factor * own * noise[0] + white * noise[1] + part * R * noise[2]
        data[name], sigma[name] = np.clip(value, _LEAST, _MOST), np.broadcast_to(own, R.shape)
    return Batch(g, eta, k, np.repeat(CLASSES, OF_A_CLASS), wrong, data, sigma)


def fitted(batch: Batch) -> Fit:
    """Return the fit of a batch, by the default errors."""
    angles = batch.geometry.padded_angles
    data, sigma = (with_gaps(of) for of in (batch.data, batch.sigma))
    sample = f"{float(batch.geometry.eta_i)!r} | free"
    return fit_many(angles, **data, sigma=sigma, sample=sample, intervals="auto")


def left_out(found: Fit, batch: Batch) -> np.ndarray:
    """Return whose interval leaves out a true index that fits as well as its ends, (N,).

    By more than a tenth of its width, and with the errors that the fit took.
    """
    kind, s = (np.asarray(of)[:, None] for of in (found.errors.taken, found.errors.added))
    cost = np.zeros((2, len(batch.eta)))
    for name, value in batch.data.items():
        with np.errstate(all="ignore"):  # an index of 0, of a fit that did not converge
            fitted, true = (
                textbook(batch.geometry.angles, index[:, None], batch.geometry.eta_i)[name]
                for index in (found.eta + 1j * found.k, batch.eta + 1j * batch.k)
            )
        sigma = np.hypot(batch.sigma[name], s * sizes(kind, fitted))
        cost += [(((value - curve) / sigma) ** 2).sum(1) for curve in (fitted, true)]
    with np.errstate(all="ignore"):
        rise = (cost[1] - cost[0]) / (cost[0] / found.dof)
    return far_outside(found, batch.eta, batch.k) & rise_allowed(rise, found.dof)


def study(curves: int, seed: int) -> Iterator[str]:
    """Yield the lines of the table, of the worst cell, and of what was left out."""
    cells: dict[tuple[str, str, str], list[np.ndarray]] = {}
    left: list[str] = []
    for number in range(max(1, round(curves / A_GEOMETRY))):
        batch = draw(seed, number)
        found = fitted(batch)
        hold = holds(found.parameters, batch.eta, batch.k)
        for other in found.others:
            hold |= holds(other.parameters, batch.eta, batch.k)
        good = found.status == "converged"
        out = good & left_out(found, batch) & ~has_second(found)
        left += [f"{seed}, {number}, {i}" for i in np.flatnonzero(out)]
        for kind in CLASSES:
            for i, wrong in enumerate(WRONG):
                mine = good & (batch.kind == kind) & (batch.wrong == i)
                cell = batch.geometry.quantity, kind, wrong
                cells.setdefault(cell, []).append(hold[:, mine])
    every = {cell: np.concatenate(parts, axis=1) for cell, parts in cells.items()}
    yield "| quantity | " + " | ".join(WRONG) + " |"
    yield "| --- " * (1 + len(WRONG)) + "|"
    for quantity in (*QUANTITIES, "all"):
        row = []
        for wrong in WRONG:
            same = [v for (q, _, w), v in every.items() if w == wrong and quantity in (q, "all")]
            held = 100.0 * np.concatenate(same, axis=1).mean(1)
            row.append(f"{held[0]:.1f}, {held[1]:.1f} of {sum(v.shape[1] for v in same)}")
        yield f"| {quantity} | " + " | ".join(row) + " |"
    large = {cell: v.mean(1) for cell, v in every.items() if v.shape[1] >= ENOUGH}
    for which, pick in (("least", min), ("most", max)):
        if large:
            cell = pick(large, key=lambda c: pick(large[c]))
            eta, k = 100.0 * large[cell]
            fits = every[cell].shape[1]
            yield f"\n{which} held: {', '.join(cell)}: {eta:.1f}, {k:.1f} of {fits} fits"
    yield f"\nleft out: {len(left)}; seed, geometry, curve: {'; '.join(left[:KEPT])}"
