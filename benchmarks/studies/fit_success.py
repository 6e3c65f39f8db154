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

and how many of the 95 % intervals of converged fits hold the truth (more in `fit_coverage`).

    python -m benchmarks.studies.fit_success [--curves 1000000] [--seed 1] [--out docs/benchmarks]
    python -m benchmarks.studies.fit_success --curves 2000 --of-a-class 8 --entrance choose

Fits are those of `fit_many`, or come by another entrance, a curve at a time: `fit` of "free" or of
"constant", `choose`, or `fit_residuals` of the textbook's formula. `choose` may leave out k: it is
wrong where BIC asks for it by more than the margin.

The seeds of what was wrong or failed stand at the end (seed, geometry, curve), and with ``--out``
in fit_success.json; ``--geometry 17`` draws one of them again and prints its wrong curves. An
interrupt (Ctrl-C) ends the study with what was counted so far.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from benchmarks.machine import conditions
from benchmarks.studies.dense_search import polished, suspects
from fitting import Fit, Measurement, choose, fit, fit_many, fit_residuals
from fitting.results.result_parts import Estimate
from fitting.uncertainty.likelihood import MARGIN
from tests.truth.left_out import cost_of, cost_of_truth
from tests.truth.random_measurements import (
    CLASSES,
    CURVES_OF_A_CLASS,
    Batch,
    draw,
)

A_GEOMETRY = CURVES_OF_A_CLASS * len(CLASSES)
BATCH = "batch"
# One of so many curves that are not suspicious is searched, too.
SAMPLE = 500
TOO_HIGH = 0.01
KEPT = 200  # seeds


class Said(NamedTuple):
    """What the fits of a batch say, (N,) each.

    lowest: the cost of the lowest minimum that is shown or listed. second: whether there are
    several. without_k: whether k was left out. held: (N, 2), whether the 95 % intervals of eta and
    of k hold the truth; those of other solutions count too.
    """

    status: np.ndarray
    eta: np.ndarray
    k: np.ndarray
    lowest: np.ndarray
    second: np.ndarray
    n_data: np.ndarray
    evaluations: np.ndarray
    without_k: np.ndarray
    held: np.ndarray

    @classmethod
    def by(cls, found: Fit, truth: tuple[Any, Any]) -> Said:
        """Return what a fit says, or a batch of them; truth: eta and k."""
        every = found.parameters
        each = [holds({**every, **m.parameters}, *truth) for m in (found, *found.others)]
        eta, k = (every[name].value for name in ("eta", "k"))
        return cls(*map(np.atleast_1d, (
            found.status, eta, k, lowest(found), has_second(found), found.n_data, found.evaluations,
            np.full(found.shape, "k" not in found.names),
        )), np.any(each, axis=0).T)  # fmt: skip


class Judged(NamedTuple):
    """Of one batch: what the fits say; excess (N,): chi2 above the best known, by the noise.

    It is that of the lowest minimum that is shown or listed. wrong: (N,), where a fit says
    converged and is not at the best minimum known.
    """

    batch: Batch
    found: Said
    excess: np.ndarray
    wrong: np.ndarray
    searched: int


def has_second(found: Fit) -> np.ndarray:
    """Return where a second solution is reported, (N,)."""
    every = [np.isfinite(a.delta_chi2) for a in found.others]
    return np.logical_or.reduce([np.zeros(found.shape, bool), *every])


def holds(parameters: Mapping[str, Estimate], eta: Any, k: Any) -> np.ndarray:
    """Return whether the intervals of eta and of k hold the truth, (2, N); eta, k: (N,) or one."""
    ends = [np.atleast_2d(parameters[name].interval) for name in ("eta", "k")]
    pairs = zip(ends, (eta, k), strict=True)
    return np.stack([(end[:, 0] <= truth) & (truth <= end[:, 1]) for end, truth in pairs])


def lowest(found: Fit) -> np.ndarray:
    """Return the cost of the lowest minimum that is shown or listed, (N,)."""
    rise = np.fmin.reduce([np.zeros(found.shape), *(a.delta_chi2 for a in found.others)])
    return cost_of(found) + rise * found.errors.factor**2


def own_residuals(values: dict[str, Any], data: dict[str, Any]) -> Any:
    """Return the residuals of a curve as a user of JAX writes them; data: with rows in a row."""
    c, index = data["cos"], (values["eta"] + 1j * values["k"]) / data["eta_i"]
    q = jnp.sqrt(index**2 - (1.0 - c * c))
    R_s = jnp.abs((c - q) / (c + q)) ** 2
    R_p = jnp.abs((index**2 * c - q) / (index**2 * c + q)) ** 2
    return data["s_share"] * R_s + (1.0 - data["s_share"]) * R_p - data["value"]


OWN = {"eta": {"start": (0.05, 5.0), "bounds": (0.0, np.inf), "coordinate": "log"},
       "k": {"start": (0.0, 8.0), "bounds": (0.0, np.inf), "coordinate": "square"}}  # fmt: skip
S_SHARE = {"R_s": 1.0, "R_p": 0.0, "R": 0.5}


def fit_by_itself(batch: Batch, curve: int, entrance: str) -> Fit:
    """Return the fit of one curve of a batch."""
    g, data = batch.geometry, {q: v[curve] for q, v in batch.data.items()}
    if entrance == "residuals":
        value, cos = np.concatenate([*data.values()]), np.cos(np.radians(g.angles))
        share = np.repeat([S_SHARE[q] for q in data], len(cos))
        rows = {"cos": np.tile(cos, len(data)), "s_share": share, "value": value}
        rows["eta_i"] = np.full(len(value), g.eta_i)
        return fit_residuals(own_residuals, OWN, rows)
    m = Measurement.from_columns(g.angles, None, **data)
    if entrance == "choose":
        return choose(m, f"{float(g.eta_i)!r} | auto", errors="equal", instrument=False).fit
    return fit(m, f"{float(g.eta_i)!r} | {entrance}", errors="equal")


ENTRANCES = (BATCH, "free", "constant", "choose", "residuals")


def fitted(batch: Batch, entrance: str) -> Said:
    """Return what the fits of a batch say."""
    if entrance == BATCH:
        angles, data = batch.padded()
        sample = f"{float(batch.geometry.eta_i)!r} | free"
        # Equal weights, as those of the dense search; else R_s and R_p have each their own scatter.
        found = fit_many(angles, **data, sample=sample, errors="equal", intervals="auto")
        return Said.by(found, (batch.eta, batch.k))
    each = [
        Said.by(fit_by_itself(batch, i, entrance), (batch.eta[i], batch.k[i]))
        for i in range(len(batch.eta))
    ]
    return Said(*map(np.concatenate, zip(*each, strict=True)))


def judged(batch: Batch, rng: np.random.Generator, entrance: str = BATCH) -> Judged:
    """Return the fits of a batch beside the best minima known."""
    g = batch.geometry
    angles, data = batch.padded()
    found = fitted(batch, entrance)
    truth = {"eta": batch.eta, "k": batch.k}
    from_truth = fit_many(
        angles, **data, sample=f"{float(g.eta_i)!r} | free", start=truth, errors="equal"
    )
    unit = np.maximum(batch.noise, 1e-12) ** 2
    mine, theirs = found.lowest, lowest(from_truth)
    best = np.fmin(mine, theirs)
    said = (found.status == "converged") & (batch.noise > 0.0)
    odd = found.second | (np.abs(mine - theirs) > TOO_HIGH * unit)
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
    excess, n = (mine - best) / unit, found.n_data
    with np.errstate(divide="ignore"):
        asked_for = n * np.log(mine / best) > np.log(n) + MARGIN
    too_high = (excess > TOO_HIGH) & (asked_for | ~found.without_k)
    return Judged(batch, found, excess, too_high & (found.status == "converged"), len(search))


def _cell(batch: Batch, kind: str) -> tuple[str, str, str]:
    return batch.geometry.quantity, kind, batch.geometry.angle_bin


def study(curves: int, seed: int, of_a_class: int, entrance: str) -> dict[str, Any]:
    """Return the counts of all cells and the seeds of what went wrong."""
    a_geometry = of_a_class * len(CLASSES)
    cells: dict[tuple[str, str, str], np.ndarray] = {}
    seeds, calls, searched, started = [], {}, 0, time.perf_counter()
    held: list[np.ndarray] = []
    geometries = 0
    for number in range(max(1, round(curves / a_geometry))):
        try:
            one = judged(*draw(seed, number, of_a_class), entrance)
        except KeyboardInterrupt:
            break
        geometries += 1
        good = (one.found.status == "converged") & (one.batch.noise > 0.0)
        with_k = np.where(one.found.without_k, np.nan, one.found.held[:, 1])
        held.append(np.stack([one.found.held[:, 0], with_k], 1)[good])
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
            print(f"{(number + 1) * a_geometry} curves, {wrong} wrong, {spent:.0f} s", flush=True)
    rows: list[dict[str, Any]] = [
        dict(zip(("data", "class", "lowest angle", "curves", "wrong", "failed", "open"),
                 (*cell, *map(int, counts)), strict=True))
        for cell, counts in sorted(cells.items())
    ]  # fmt: skip
    total = {n: sum(row[n] for row in rows) for n in ("curves", "wrong", "failed", "open")}
    return {
        "conditions": conditions(), "entrance": entrance, "seed": seed, "of a class": of_a_class,
        "geometries": geometries, "total": total,
        "held": np.nanmean(np.concatenate(held), 0).tolist(), "fits": sum(map(len, held)),
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
        f"{found['conditions']}; {found['entrance']}, seed {found['seed']}",
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
        "95 % intervals of {} converged fits of noisy data: {:.1%} hold eta, {:.1%} k".format(
            found["fits"], *found["held"]
        ),
        f"median evaluations: {found['median evaluations']}",
    ]
    lines += [str(one) for one in found["seeds"][:20]]
    return "\n".join(lines)


def _again(seed: int, number: int, of_a_class: int, entrance: str) -> None:
    """Print the wrong and failed curves of one geometry."""
    one = judged(*draw(seed, number, of_a_class), entrance)
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
    parser.add_argument("--entrance", choices=ENTRANCES, default=BATCH)
    parser.add_argument("--of-a-class", type=int, default=CURVES_OF_A_CLASS,
                        help="curves of each class in a geometry")  # fmt: skip
    parser.add_argument("--geometry", type=int, help="draw this one again")
    parser.add_argument("--out", type=Path, help="folder for fit_success.json")
    options = parser.parse_args()
    if options.geometry is not None:
        _again(options.seed, options.geometry, options.of_a_class, options.entrance)
        return
    found = study(options.curves, options.seed, options.of_a_class, options.entrance)
    print(text(found))
    if options.out:
        options.out.mkdir(parents=True, exist_ok=True)
        (options.out / "fit_success.json").write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
