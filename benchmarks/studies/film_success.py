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
from typing import Any, NamedTuple

import numpy as np

from benchmarks.studies.model_success import truth
from benchmarks.studies.study_options import add_row, run_study, study_options
from fitting import Fit, Measurement, fit, simulate
from fitting.problem.lanes import LANES
from fitting.samples.known_media import known_medium
from fitting.searching.minima import ALTERNATIVE_CHI2

LOW_NM, HIGH_NM = 5.0, 20_000.0
MODELS = ("cauchy:3", "cauchy-urbach:2", "drude-lorentz:1")
SUBSTRATES = ("BK7", "Si", "silver")
MEASURED = {
    "R": {"R": 1e-3}, "T": {"T": 1e-3}, "R, T": {"R": 1e-3, "T": 1e-3},
    "psi, Delta": {"psi": 0.05, "delta": 0.1},
}  # fmt: skip
# Numbers of wavelengths: each of them takes a program of its own for every cell, 10 s to compile.
SIZES = (128, 512)
COUNTED = ("best", "alike", "false", "order", "untold", "clear")


class Case(NamedTuple):
    """One simulated film: what it is, what was measured, and the truth by parameter."""

    cell: tuple[str, str, str]
    measurement: Measurement
    truth: dict[str, float]
    fringe_nm: float

    @property
    def sample(self) -> str:
        """What is fitted."""
        model, substrate, _ = self.cell
        return f"air | {model} {LOW_NM:g}..{HIGH_NM:g} nm | {substrate}"


def _parameters(model: str, random: np.random.Generator, shortest_um: float) -> dict[str, float]:
    """Return a random material that a film of it is seen through at some wavelengths."""
    p = truth(model, random)
    if model.startswith("cauchy-urbach"):
        p = {k: v for k, v in p.items() if k != "C"}
        p |= {"k_edge": 10.0 ** random.uniform(-3.0, -0.7), "edge_ev": 1.2398 / shortest_um}
    if model.startswith("drude-lorentz"):
        # a transparent conductor: free electrons in the infrared, a resonance in the ultraviolet
        p |= {
            "eps_inf": random.uniform(1.5, 4.0), "plasma_ev": 10.0 ** random.uniform(-0.7, 0.4),
            "width_ev": 10.0 ** random.uniform(-1.3, -0.3),
            "resonance_ev_1": random.uniform(3.5, 8.0), "width_ev_1": random.uniform(0.05, 1.0),
        }  # fmt: skip
    return p


def simulated(seed: int, noise: float = 1.0) -> Case | None:
    """Return a random film; None where the random material is none. noise: a factor on it."""
    random = np.random.default_rng([7, seed])
    model, substrate = random.choice(MODELS), random.choice(SUBSTRATES)
    names = list(MEASURED) if substrate == "BK7" else ["R", "psi, Delta"]
    measured = str(random.choice(names))
    low = random.uniform(0.35, 0.5)
    high = min(low * random.uniform(1.5, 3.0), 0.99 * known_medium(substrate).range_um[1])  # type: ignore
    thickness = float(np.exp(random.uniform(np.log(LOW_NM), np.log(HIGH_NM))))
    p = _parameters(model, random, low)
    angle = 0.0 if measured != "psi, Delta" else random.uniform(55.0, 75.0)
    # five points to the narrowest fringe of an index of 2.5, as a spectrometer that is up to it
    fringes = 2.0 * 2.5 * thickness * 1e-3 * (1.0 / low - 1.0 / high)
    count = next((n for n in SIZES if n > 5.0 * fringes), SIZES[-1])
    wavelength = 1.0 / np.linspace(1.0 / high, 1.0 / low, count)
    values = p | {"thickness_nm": thickness}
    sample = f"air | {model} {thickness:.6g} nm | {substrate}"
    columns, sigma = {}, {}
    for quantity, usual in MEASURED[measured].items():
        error = noise * usual
        value = simulate(sample, values, angle, wavelength, quantity)
        if not np.isfinite(value).all():
            return None
        value = value + error * random.standard_normal(count)
        value = np.clip(value, 0.0, 90.0) if quantity == "psi" else value
        value = value % 360.0 if quantity == "delta" else value
        columns[quantity], sigma[quantity] = value, error
    m = Measurement.from_columns(angle, wavelength, sigma=sigma, **columns)
    index = 2.0  # a fringe, for the tolerance of the order
    return Case((str(model), str(substrate), measured), m, values, 1e3 * low / (2.0 * index))


def _holds(case: Case, found: Fit) -> bool:
    """Whether the thickness of a solution that is shown or listed is the true one."""
    true = case.truth["thickness_nm"]
    return any(
        abs(d.value - true) < 0.5 * case.fringe_nm or d.interval[0] <= true <= d.interval[1]
        for d in (f.parameters["thickness_nm"] for f in (found, *found.alternatives))
    )


def lowest_chi2(found: Fit) -> float:
    """Return the lowest chi2 of a fit with stated errors, of what is shown or listed.

    What is shown is a film without fringes where those of the lowest minimum may be noise.
    """
    rise = min([0.0, *(float(a.delta_chi2) for a in found.alternatives)])
    # In units of chi2 / dof of the lowest one where that is above 1.
    return min(found.cost / (1.0 - rise / found.dof), found.cost + rise)


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
