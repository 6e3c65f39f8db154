"""How often a fit finds the best minimum, and whether its status tells the truth.

Everything is drawn at random (`random_measurements`): 5 to 60 angles, equidistant or not, the
lowest 0 to 75 degrees and the highest to 89; R_s and R_p, either alone, or unpolarized; the index
of the medium outside; noise 0 to 1 %; materials of five classes. Every curve is fitted as a user
gets it and compared with the best minimum known: the lowest of that fit, of the same fit started at
the true index as well, and, of every suspicious curve and one in 500 of the others, of a dense
search that shares nothing with the fit (`dense_search`). Suspicious is a curve that has a second
solution, or ends elsewhere from the truth, or does not fit as well as the truth itself.

Counted are, for each quantity, class and lowest angle,

  wrong   chi2 of the solution, and of all that are listed beside it, more than a hundredth of a
          unit above the best known, yet reported as converged. Where noise decides which of several
          minima is the lowest, that of a solid is shown first and the others are listed
  failed  reported as "not converged"
  open    reported as "undetermined"

    python -m benchmarks.studies.fit_success [--curves 1000000] [--seed 1] [--out docs/benchmarks]

The seeds of what was wrong or failed stand at the end (seed, geometry, curve), and with ``--out``
in fit_success.json; ``--geometry 17`` draws one of them again and prints its wrong curves. An
interrupt (Ctrl-C) ends the study with what was counted so far.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.machine import conditions
from benchmarks.studies.dense_search import polished, suspects
from fitting import Fit, fit_many
from tests.truth.left_out import cost_of, cost_of_truth
from tests.truth.random_measurements import (
    CLASSES,
    CURVES_OF_A_CLASS,
    Batch,
    draw,
)

A_GEOMETRY = CURVES_OF_A_CLASS * len(CLASSES)
# One of so many curves that are not suspicious is searched, too.
SAMPLE = 500
TOO_HIGH = 0.01
KEPT = 200  # seeds


class Judged(NamedTuple):
    """Of one batch: what the fits say; excess (N,): chi2 above the best known, by the noise.

    It is that of the lowest minimum that is shown or listed.
    """

    batch: Batch
    found: Fit
    excess: np.ndarray
    searched: int

    @property
    def wrong(self) -> np.ndarray:
        """Where a fit says converged and is not at the best minimum known."""
        return (self.found.status == "converged") & (self.excess > TOO_HIGH)


def has_second(found: Fit) -> np.ndarray:
    """Return where a second solution is reported, (N,)."""
    every = [np.isfinite(a.delta_chi2) for a in found.others]
    return np.logical_or.reduce([np.zeros(found.shape, bool), *every])


def lowest(found: Fit) -> np.ndarray:
    """Return the cost of the lowest minimum that is shown or listed, (N,)."""
    rise = np.fmin.reduce([np.zeros(found.shape), *(a.delta_chi2 for a in found.others)])
    return cost_of(found) + rise * found.errors.factor**2


def judged(batch: Batch, rng: np.random.Generator) -> Judged:
    """Return the fits of a batch beside the best minima known."""
    g = batch.geometry
    angles, data = batch.padded()
    sample = f"{float(g.eta_i)!r} | free"
    # Equal weights, as those of the dense search; else R_s and R_p have each their own scatter.
    found = fit_many(angles, **data, sample=sample, errors="equal")
    truth = {"eta": batch.eta, "k": batch.k}
    from_truth = fit_many(angles, **data, sample=sample, start=truth, errors="equal")
    unit = np.maximum(batch.noise, 1e-12) ** 2
    mine, theirs = lowest(found), lowest(from_truth)
    best = np.fmin(mine, theirs)
    said = (found.status == "converged") & (batch.noise > 0.0)
    odd = has_second(found) | (np.abs(mine - theirs) > TOO_HIGH * unit)
    odd |= (mine > cost_of_truth(batch)) | (rng.random(len(mine)) < 1.0 / SAMPLE)
    search = np.flatnonzero(said & odd)
    if len(search):
        part = batch.take(search)
        curve, eta, k = suspects(part, found.eta[search], found.k[search], best[search])
        for i, eta_0, k_0 in zip(curve.tolist(), eta.tolist(), k.tolist(), strict=True):
            cost, *_ = polished(g, {q: v[i] for q, v in part.data.items()}, eta_0, k_0)
            best[search[i]] = min(best[search[i]], cost)
    # Of data without noise what is left is their rounding.
    unit = np.maximum(unit, best / found.n_data)
    return Judged(batch, found, (mine - best) / unit, len(search))


def _cell(batch: Batch, kind: str) -> tuple[str, str, str]:
    return batch.geometry.quantity, kind, batch.geometry.angle_bin


def study(curves: int, seed: int) -> dict[str, Any]:
    """Return the counts of all cells and the seeds of what went wrong."""
    cells: dict[tuple[str, str, str], np.ndarray] = {}
    seeds, calls, searched, started = [], {}, 0, time.perf_counter()
    geometries = 0
    for number in range(max(1, round(curves / A_GEOMETRY))):
        try:
            one = judged(*draw(seed, number))
        except KeyboardInterrupt:
            break
        geometries += 1
        failed = one.found.status == "not converged"
        undetermined = one.found.status == "undetermined"
        for kind in CLASSES:
            mine = one.batch.kind == kind
            counts = [np.sum(mine & w) for w in (one.wrong, failed, undetermined)]
            new = np.array([mine.sum(), *counts])
            cells[_cell(one.batch, kind)] = cells.get(_cell(one.batch, kind), 0) + new
        bad = np.flatnonzero(one.wrong | failed)
        seeds += [
            {"seed": seed, "geometry": number, "curve": int(i), "excess": float(one.excess[i])}
            for i in bad
        ]
        calls.setdefault(one.batch.geometry.quantity, []).append(np.median(one.found.evaluations))
        searched += one.searched
        if number % 20 == 19:
            wrong = sum(int(c[1]) for c in cells.values())
            spent = time.perf_counter() - started
            print(f"{(number + 1) * A_GEOMETRY} curves, {wrong} wrong, {spent:.0f} s", flush=True)
    rows: list[dict[str, Any]] = [
        dict(zip(("data", "class", "lowest angle", "curves", "wrong", "failed", "open"),
                 (*cell, *map(int, counts)), strict=True))
        for cell, counts in sorted(cells.items())
    ]  # fmt: skip
    total = {n: sum(row[n] for row in rows) for n in ("curves", "wrong", "failed", "open")}
    return {
        "conditions": conditions(), "seed": seed, "geometries": geometries, "total": total,
        "searched": searched, "cells": rows, "seeds": seeds[:KEPT], "all bad": len(seeds),
        "median evaluations": {q: float(np.median(c)) for q, c in calls.items()},
    }  # fmt: skip


def worst(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the cell with the largest share of wrong answers."""
    return max(rows, key=lambda row: (row["wrong"] / row["curves"], row["failed"] / row["curves"]))


def text(found: dict[str, Any]) -> str:
    """Return the table, the worst cell and the seeds."""
    total = found["total"]
    lines = [
        f"{found['conditions']}; seed {found['seed']}",
        f"{total['curves']} curves of {found['geometries']} geometries, {found['searched']} of "
        "them searched densely",
        "",
        "| data | class | lowest angle, degrees | curves | wrong | failed | undetermined |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for row in found["cells"]:
        first = f"| {row['data']} | {row['class']} | {row['lowest angle']} | {row['curves']} "
        share = (
            f"| {row['wrong']} | {row['failed']} | {100.0 * row['open'] / row['curves']:.1f} % |"
        )
        lines.append(first + share)
    least = worst(found["cells"])
    lines += [
        "",
        f"all: {total['wrong']} wrong ({total['wrong'] / total['curves']:.1e}), {total['failed']} "
        f"failed, {100.0 * total['open'] / total['curves']:.1f} % undetermined",
        f"worst cell: {least['data']}, {least['class']}, lowest angle {least['lowest angle']} "
        f"degrees: {least['wrong']} of {least['curves']} ({least['wrong'] / least['curves']:.1e})",
        f"median evaluations: {found['median evaluations']}",
    ]
    lines += [str(one) for one in found["seeds"][:20]]
    return "\n".join(lines)


def _again(seed: int, number: int) -> None:
    """Print the wrong and failed curves of one geometry."""
    one = judged(*draw(seed, number))
    batch, found = one.batch, one.found
    print(batch.geometry)
    for i in np.flatnonzero(one.wrong | (found.status == "not converged")):
        print(
            f"curve {i}: {batch.kind[i]} {batch.eta[i]:.4f} + {batch.k[i]:.4g} i, noise "
            f"{batch.noise[i]:.2g}: {found.status[i]}, {found.eta[i]:.4f} + {found.k[i]:.4g} i, "
            f"chi2 {one.excess[i]:.3g} above the best"
        )


def main() -> None:
    """Print the table, or write it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--curves", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--geometry", type=int, help="draw this one again")
    parser.add_argument("--out", type=Path, help="folder for fit_success.json")
    options = parser.parse_args()
    if options.geometry is not None:
        _again(options.seed, options.geometry)
        return
    found = study(options.curves, options.seed)
    print(text(found))
    if options.out:
        options.out.mkdir(parents=True, exist_ok=True)
        (options.out / "fit_success.json").write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
