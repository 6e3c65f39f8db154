"""How often the 95 % intervals of a fit hold the truth.

For each material and set of data, 1e4 repeats of the same measurement with fresh normal noise: the
share whose interval of eta, and of k, holds the true value; quadratic intervals and those of the
profile likelihood, with errors taken as stated ("absolute") and estimated from the scatter
("scaled"). "seen" is the share of repeats in which k is more than compatible with 0. Where k is
0 or cannot be seen, or where the valley of the fit bends (R_s of metals), the problem is not
regular: k cannot be negative, for which intervals by profile allow, and the quadratic one of k.

The statistical error of a share near .95 is .2 % (one sigma).

Then the same of measurements drawn at random (`random_measurements`: angles, quantity, noise,
media, materials): one repeat of each, by quantity, class and lowest angle, of fits that converged.
Where the fit names other solutions that fit nearly as well (`Fit.alternatives`), noise decides
which of them is the lowest, and the intervals of all of them count together. "left out" are
intervals that are wrong beyond chance: the true index fits as well as their ends, and yet lies
outside by more than a tenth of their width (of undetermined fits too, whose interval is the range
of values that fit; not where other solutions are named).

    python -m benchmarks.studies.fit_coverage [--repeats 10000] [--curves 100000] [--seed 1]
"""

from __future__ import annotations

import argparse
import time
from typing import NamedTuple

import jax
import numpy as np

from benchmarks.machine import conditions
from benchmarks.studies.fit_success import A_GEOMETRY, has_second, holds
from fitting import Fit, fit_many
from fresnel_jax import powers
from tests.truth.left_out import left_out
from tests.truth.random_measurements import CLASSES, draw

MANY = np.linspace(1.0, 89.0, 60)
FEW = np.linspace(20.0, 80.0, 13)
THREE = np.array([65.0, 70.0, 75.0])
# name, eta, k, channels, angles, noise, whether the problem is regular; last eta_i where not 1
CASES = (
    ("tinted glass", 1.52, 0.2, ("R_s", "R_p"), MANY, 1e-3, True),
    ("germanium", 5.5, 1.6, ("R_s", "R_p"), MANY, 1e-3, True),
    ("germanium", 5.5, 1.6, ("R",), MANY, 1e-3, True),
    ("gold", 0.36, 2.6, ("R_s", "R_p"), MANY, 1e-3, True),
    ("gold", 0.36, 2.6, ("R_p",), FEW, 1e-3, True),
    ("aluminium", 1.1, 7.0, ("R_s", "R_p"), FEW, 1e-3, True),
    ("absorber", 2.5, 1.0, ("R_s", "R_p"), THREE, 1e-3, True),
    ("gold", 0.36, 2.6, ("R_s",), MANY, 1e-3, False),
    ("silicon", 4.15, 0.05, ("R_s", "R_p"), MANY, 1e-3, False),
    ("glass", 1.5, 0.0, ("R_s", "R_p"), MANY, 1e-3, False),
    ("glass", 1.5, 0.0, ("R",), FEW, 5e-3, False),
    ("weak absorber", 2.0, 0.1, ("R_s",), MANY, 1e-3, False),
    # total reflection, where the curve is linear in k
    ("water from glass", 1.33, 0.0, ("R_s", "R_p"), MANY, 2e-3, False, 1.5),
    ("water from glass", 1.33, 3e-5, ("R_s", "R_p"), MANY, 2e-3, False, 1.5),
    ("air from glass", 1.0, 3e-4, ("R_s", "R_p"), FEW, 5e-3, False, 1.5),
    ("air from glass", 1.0, 2e-3, ("R_s", "R_p"), FEW, 5e-3, True, 1.5),
)


def held(result: Fit, eta: float, k: float) -> tuple[float, float]:
    """Return the shares of intervals that hold the true eta and the true k."""
    of_eta, of_k = holds(result.parameters, eta, k).mean(1)
    return float(of_eta), float(of_k)


def study(case: tuple, repeats: int) -> dict:
    """Return the shares of one case."""
    name, eta, k, channels, angles, noise, regular, *outside = case
    eta_i = outside[0] if outside else 1.0
    rng = np.random.default_rng(7)
    with jax.enable_x64(True):
        exact = powers(np.cos(np.radians(angles)), eta, k, eta_i)
        clean = {"R_s": exact.R_s, "R_p": exact.R_p, "R": exact.R}
    data = {
        c: np.asarray(clean[c]) + noise * rng.standard_normal((repeats, len(angles)))
        for c in channels
    }
    found: dict = {"name": name, "eta": eta, "k": k, "regular": regular, "noise": noise}
    found["data"] = f"{' and '.join(channels)}, {len(angles)} angles"
    for kind, options in (("absolute", {"sigma": noise, "errors": "stated"}), ("scaled", {})):
        for intervals in ("quadratic", "profile"):
            sample = f"{float(eta_i)!r} | free"
            result = fit_many(angles, **data, **options, sample=sample, intervals=intervals)
            found[kind, intervals] = held(result, eta, k)
    found["seen"] = float(np.isfinite(result.parameters["k"].sigma).mean())
    return found


class Cell(NamedTuple):
    """What holds in one cell: quantity, class and bin of the lowest angle.

    fits: how many converged. several: of how many the fit names other solutions. eta, k: shares of
    all whose interval holds the truth. of_one: the same, (2,), where no other solution is named.
    left_out: how many whose interval is wrong.
    """

    name: tuple[str, str, str]
    fits: int
    several: int
    eta: float
    k: float
    of_one: np.ndarray
    left_out: int


def random_study(curves: int, seed: int) -> list[Cell]:
    """Return cells of measurements drawn at random."""
    cells: dict[tuple[str, str, str], list[np.ndarray]] = {}
    missed: dict[tuple[str, str, str], int] = {}
    for number in range(max(1, round(curves / A_GEOMETRY))):
        batch, _ = draw(seed, number)
        with_noise = np.flatnonzero(batch.noise > 0.0)
        noisy = batch.take(with_noise)
        angles, data = noisy.padded()
        result = fit_many(
            angles, **data, sample=f"{float(noisy.geometry.eta_i)!r} | free", intervals="auto"
        )
        hold = holds(result.parameters, noisy.eta, noisy.k)
        several = has_second(result)
        wrong = left_out(noisy, result) & ~several
        for curve in with_noise[wrong]:
            print(f"left out: seed {seed}, geometry {number}, curve {curve}", flush=True)
        for other in result.others:
            hold |= holds(other.parameters, noisy.eta, noisy.k)
        for kind in CLASSES:
            mine = (result.status == "converged") & (noisy.kind == kind)
            cell = (noisy.geometry.quantity, kind, noisy.geometry.angle_bin)
            cells.setdefault(cell, []).append(np.stack([*hold, several])[:, mine])
            missed[cell] = missed.get(cell, 0) + int(wrong[noisy.kind == kind].sum())
    rows = []
    for cell, parts in sorted(cells.items()):
        *hold, several = np.concatenate(parts, axis=1)
        if len(several):
            eta, k = (float(one.mean()) for one in hold)
            one = np.stack(hold)[:, ~several].mean(1)
            rows.append(Cell(cell, len(several), int(several.sum()), eta, k, one, missed[cell]))
    return rows


def print_random(rows: list[Cell]) -> None:
    """Print the cells and the one with the least share."""
    print("\n| data | class | lowest angle, degrees | fits | with other solutions | eta | k |"
          " eta, k where there is one | left out |")  # fmt: skip
    print("| --- " * 9 + "|")
    for row in rows:
        one = ", ".join(f"{100.0 * share:.1f}" for share in row.of_one)
        both = f"{100.0 * row.eta:.1f} | {100.0 * row.k:.1f}"
        print(f"| {' | '.join(row.name)} | {row.fits} | {row.several} | {both} | {one} "
              f"| {row.left_out} |")  # fmt: skip
    fits = sum(row.fits for row in rows)
    eta, k = (sum(getattr(row, name) * row.fits for row in rows) / fits for name in ("eta", "k"))
    wrong = sum(row.left_out for row in rows)
    print(f"\nall {fits}: {100.0 * eta:.1f}, {100.0 * k:.1f} %; left out {wrong}")
    worst = min(rows, key=lambda row: min(row.eta, row.k))
    print(f"worst cell: {', '.join(worst.name)}: {100.0 * worst.eta:.1f}, {100.0 * worst.k:.1f} %"
          f" of {worst.fits}")  # fmt: skip


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=10_000)
    parser.add_argument("--curves", type=int, default=100_000, help="measurements at random")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    repeats = options.repeats
    started = time.perf_counter()
    print(f"{conditions()}; {repeats} repeats; per cent that hold the true eta, k\n")
    sorts = [(kind, way) for kind in ("absolute", "scaled") for way in ("quadratic", "profile")]
    print("| material | data | regular | k seen | " + " | ".join(f"{w}, {k}" for k, w in sorts))
    print("| --- " * (4 + len(sorts)) + "|")
    off = 0
    for case in CASES:
        row = study(case, repeats)
        cells = [" ".join(f"{100.0 * share:.1f}" for share in row[sort]) for sort in sorts]
        if row["regular"]:
            off += sum(not 0.94 <= share <= 0.96 for sort in sorts for share in row[sort])
        first = f"{row['name']} {row['eta']:g} + {row['k']:g} i | {row['data']}"
        first += f" | {'yes' if row['regular'] else 'no'} | {100.0 * row['seen']:.0f} %"
        print(f"| {first} | " + " | ".join(cells) + " |", flush=True)
    print(f"\n{off} shares of the regular cases outside of 94 to 96 %")
    print_random(random_study(options.curves, options.seed))
    print(f"{time.perf_counter() - started:.0f} s")


if __name__ == "__main__":
    main()
