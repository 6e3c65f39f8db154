"""How often the fit of a film finds the best minimum, and with it the right fringe order.

Random films: 5 nm to 20 um thick (evenly in the logarithm), of a Cauchy, a Cauchy-Urbach or a
Drude-Lorentz material with random parameters, on glass, silicon or silver; R alone, T alone, R and
T (on glass), or psi and Delta; random range of wavelengths and random angle, as many wavelengths as
resolve the fringes of the film, Gaussian noise of .001 (R, T), .05 and .1 degrees (psi, Delta). The
fit knows that the film is 5 nm to 20 um thick, and nothing else. It is compared with the best
minimum known, which may be that of a second fit that starts at the truth. Counted, in per cent, are

  best    chi2 within a hundredth of a unit of the best known
  alike   chi2 less than 6 higher: what is reported as an alternative. Thin films have hundreds of
          minima that differ by less, each with some ripple of the noise for its fringes
  false   chi2 higher than that, and yet nothing in the result says so (status "converged", three
          starts or more that ended in the same minimum, no alternative, no warning of residuals
          that are larger than the stated errors or autocorrelated)
  order   the thickness of the solution that is shown, or of an alternative, is within half a fringe
          of the truth, or its 95 % interval holds the truth: the quadratic one, which is faster, or
          else that of `fit` as everyone calls it
  untold  that is not so, and there is no warning that the thickness is not determined because its
          fringes are no larger than those of noise
  clear   there is no such warning; the last row but one counts these films alone

    python -m benchmarks.studies.film_success [--films 10000] [--minutes 60]
                                              [--seed N] [--only "on Si, R"]
                                              [--rows docs/benchmarks/film_success.csv]

Every film is a row of the file, which is added to until it has that many, so that a study of hours
may be many runs, also side by side, each with a seed of its own. The table is of all rows.
"""

from __future__ import annotations

import csv
import time
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.studies.study_options import add_row, run_study, study_options
from fitting import Fit, fit
from fitting.problem.lanes import LANES
from fitting.searching.minima import ALTERNATIVE_CHI2
from tests.truth.random_films import MEASURED, MODELS, Case, lowest_chi2, simulated

COUNTED = ("best", "alike", "false", "order", "untold", "clear")


def _holds(case: Case, found: Fit) -> bool:
    """Whether the thickness of a solution that is shown or listed is the true one."""
    true = case.truth["thickness_nm"]
    return any(
        abs(d.value - true) < 0.5 * case.fringe_nm or d.interval[0] <= true <= d.interval[1]
        for d in (f.parameters["thickness_nm"] for f in (found, *found.alternatives))
    )


def outcome(case: Case, seed: int, **options: Any) -> dict[str, Any]:
    """Return what the fit of a film came to."""
    began = time.perf_counter()
    found = fit(case.measurement, case.sample, errors="stated", intervals="quadratic", **options)
    seconds = time.perf_counter() - began
    start = {k: v for k, v in case.truth.items() if k != "edge_ev"}
    known = fit(
        case.measurement, case.sample, errors="stated", intervals="quadratic", start=start,
        starts=LANES - 1, **options,
    )  # fmt: skip
    reached = lowest_chi2(found)
    best = min(reached, lowest_chi2(known))
    good = bool(reached <= best + 0.01) and found.status != "not converged"
    alike = bool(reached < best + ALTERNATIVE_CHI2)
    misfit = {w.code for w in found.warnings} & {"chi2_large", "residuals_in_order"}
    alone = found.status == "converged" and found.reached >= 3 and not found.alternatives
    true = case.truth["thickness_nm"]
    noise = any(w.code == "fringes_in_noise" for w in found.warnings)
    order = _holds(case, found) or _holds(case, fit(case.measurement, case.sample, **options))
    return {
        "cell": case.cell, "best": good, "alike": alike,
        "false": not alike and alone and not misfit, "order": order,
        "untold": not order and not noise, "clear": not noise,
        "rise": reached - best, "seed": seed, "thickness": true, "seconds": seconds,
    }  # fmt: skip


def named(cell: tuple[str, str, str]) -> str:
    """Return a cell as its row is called."""
    return f"{cell[0]} on {cell[1]}, {cell[2]}"


def _line(name: str, rows: list[dict[str, Any]]) -> str:
    mean = [100.0 * float(np.mean([r[k] for r in rows])) for k in COUNTED]
    seconds = float(np.median([r["seconds"] for r in rows]))
    return f"{name:46}{len(rows):6d}" + "".join(f"{m:8.1f}" for m in mean) + f"{seconds:8.2f}"


def _written(r: dict[str, Any]) -> dict[str, Any]:
    """Return a row as the file has it."""
    film = dict(zip(("film", "substrate", "measured"), r["cell"], strict=True))
    numbers = {name: f"{r[name]:.4g}" for name in ("thickness", "rise", "seconds")}
    return {"seed": r["seed"], **film, **{name: int(r[name]) for name in COUNTED}, **numbers}


def _read(path: Path) -> list[dict[str, Any]]:
    """Return the rows of a file, none where there is no file yet."""
    if not path.exists():
        return []
    with path.open(newline="", encoding="utf-8") as file:
        return [
            {"cell": (r["film"], r["substrate"], r["measured"])}
            | {name: float(r[name]) for name in (*COUNTED, "thickness", "rise", "seconds")}
            for r in csv.DictReader(file)
        ]


def _tell(case: Case, r: dict[str, Any]) -> None:
    """Name a film whose best minimum or thickness was not found."""
    film = f"film {r['seed']}, {', '.join(case.cell)}, {r['thickness']:.4g} nm"
    if not r["best"]:
        print(f"missed: {film}, chi2 {r['rise']:.3g} above the best", flush=True)
    if r["untold"]:
        print(f"other thickness, untold: {film}", flush=True)


def main() -> None:
    """Print the table."""
    arguments = study_options(__doc__, "films", 10_000, rows=True)

    def one(seed: int) -> dict[str, Any] | None:
        case = simulated(seed)
        if case is None or not any(text in named(case.cell) for text in arguments.only):
            return None
        r = outcome(case, seed)
        _tell(case, r)
        if arguments.rows:
            add_row(arguments.rows, _written(r))
        return r

    rows = run_study(arguments, one, _read(arguments.rows) if arguments.rows else ())
    if arguments.rows:
        rows = _read(arguments.rows)
    heads = "".join(f"{h:>8}" for h in (*COUNTED, "s"))
    print(f"\n{'film on substrate, measured':46}{'films':>6}{heads}")
    for cell in sorted({r["cell"] for r in rows}):
        print(_line(named(cell), [r for r in rows if r["cell"] == cell]))
    bands = [
        (f"{low} to {high} nm", lambda r, low=low, high=high: low <= r["thickness"] < high)
        for low, high in ((5, 50), (50, 500), (500, 5000), (5000, 20000))
    ]
    kinds = [(kind, lambda r, kind=kind: kind in r["cell"]) for kind in (*MEASURED, *MODELS)]
    for name, belongs in (*bands, *kinds):
        some = [r for r in rows if belongs(r)]
        if some:
            print(_line(name, some))
    print(_line("all that are clear", [r for r in rows if r["clear"]]))
    print(_line("all", rows))


if __name__ == "__main__":
    main()
