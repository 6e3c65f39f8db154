"""How often `choose` with a film of the sample left open (auto) takes the true model of its index.

Random films, 40 nm to 2 um thick (evenly in the logarithm), of random Cauchy, Urbach, Lorentz,
Drude-Lorentz and Tauc-Lorentz materials, on glass, silicon or silver; R at a random angle, R and T
(on glass), or psi and Delta at 55 to 75 degrees; 40 to 160 wavelengths of a random range; random
noise around .001 and .05 and .1 degrees. `choose` knows that the film is 20 nm to 3 um thick. In
per cent of the films:

  true     the true model was taken
  equal    another one with the same number of parameters
  larger   one with more: a parameter that the data do not need
  smaller  one with less: an effect too weak to be seen
  missed   the fit of the true model that starts at the truth has a BIC that is lower than that of
           the model taken by more than the margin: the search missed a minimum
  order    the thickness that is shown, or an alternative, is within half a fringe of an index of 2
           of the truth, or its 95 % interval holds it

    python -m benchmarks.studies.film_models [--films 200] [--minutes 60]
                                             [--seed N] [--only lorentz:2]
"""

from __future__ import annotations

import time
from typing import Any, NamedTuple

import numpy as np

from benchmarks.machine import conditions
from benchmarks.studies.study_options import run_study, study_options
from fitting import Measurement, choose, fit, simulate
from fitting.choice.candidates import MARGIN
from fitting.problem.lanes import LANES

LOW_NM, HIGH_NM = 20.0, 3000.0
MODELS = (
    "cauchy:2", "cauchy-urbach:2", "lorentz:1", "lorentz:2", "lorentz:3", "drude-lorentz:1",
    "tauc-lorentz:1",
)  # fmt: skip
MEASURED = {
    "R": {"R": 1e-3}, "R, T": {"R": 1e-3, "T": 1e-3}, "psi, Delta": {"psi": 0.05, "delta": 0.1},
}  # fmt: skip
KINDS = ("true", "equal", "larger", "smaller")


def _material(model: str, random: np.random.Generator, high_ev: float) -> dict[str, float]:
    """Return random parameters; high_ev: the highest energy that is measured."""
    kind, _, terms = model.partition(":")
    if kind.startswith("cauchy"):
        out = {"A": random.uniform(1.4, 2.4), "B": random.uniform(0.003, 0.02)}
        if kind == "cauchy":
            return out
        tail = {"urbach_ev": random.uniform(0.1, 0.4), "edge_ev": high_ev}
        return out | {"k_edge": 10.0 ** random.uniform(-2.0, -0.5)} | tail
    if kind == "tauc-lorentz":
        resonance = high_ev * random.uniform(0.9, 1.4)
        return {
            "eps_inf": random.uniform(1.0, 2.5), "amplitude_ev_1": random.uniform(30.0, 120.0),
            "resonance_ev_1": resonance, "width_ev_1": random.uniform(0.5, 2.0),
            "gap_ev": resonance * random.uniform(0.4, 0.7),
        }  # fmt: skip
    out = {"eps_inf": random.uniform(1.5, 4.0)}
    if kind == "drude-lorentz":
        out |= {"plasma_ev": random.uniform(0.5, 3.0), "width_ev": random.uniform(0.05, 0.3)}
    places = np.sort(random.uniform(0.45, 1.5, int(terms))) * high_ev
    for i, place in enumerate(places, 1):
        # above the spectrum strong, within it absorption lines
        strength = random.uniform(10.0, 40.0) if place > high_ev else random.uniform(0.2, 3.0)
        out[f"strength_ev2_{i}"], out[f"resonance_ev_{i}"] = strength, float(place)
        out[f"width_ev_{i}"] = random.uniform(0.1, 0.5)
    return out


class Film(NamedTuple):
    """What `choose` made of one film."""

    model: str
    measured: str
    substrate: str
    seed: int
    taken: str
    kind: str
    missed: bool
    order: bool
    seconds: float


def film(seed: int, only: list[str]) -> Film | None:
    """Return what `choose` takes of a random film; None if it was not asked for."""
    random = np.random.default_rng([21, seed])
    model, measured = str(random.choice(MODELS)), str(random.choice(list(MEASURED)))
    substrate = "BK7" if measured == "R, T" else str(random.choice(["BK7", "Si", "silver"]))
    if not any(text in f"{model}, {measured} on {substrate}" for text in only):
        return None
    short, long = random.uniform(0.35, 0.5), random.uniform(0.75, 1.1)
    waves = np.linspace(short, long, int(random.integers(40, 161)))
    values = _material(model, random, 1.23984 / short)
    values["thickness_nm"] = LOW_NM * 2.0 * 50.0 ** random.uniform()
    angle = random.uniform(55.0, 75.0) if measured == "psi, Delta" else random.uniform(0.0, 60.0)
    sample = f"air | {{}} {LOW_NM:g}..{HIGH_NM:g} nm | {substrate}"
    noise = 10.0 ** random.uniform(-0.4, 0.4)
    sigma = {quantity: noise * of for quantity, of in MEASURED[measured].items()}
    seen: dict[str, Any] = {}
    for quantity, error in sigma.items():
        exact = simulate(sample.format(model), values, angle, waves, quantity)
        seen[quantity] = exact + error * random.standard_normal(len(exact))
    if "psi" in seen:
        seen["psi"], seen["delta"] = np.clip(seen["psi"], 0.0, 90.0), seen["delta"] % 360.0
    m = Measurement.from_columns(angle, waves, sigma=sigma, **seen)
    began = time.perf_counter()
    choice = choose(m, sample.format("auto"), intervals="quadratic")
    seconds = time.perf_counter() - began
    start = {name: value for name, value in values.items() if name != "edge_ev"}
    known = fit(
        m, sample.format(model), starts=LANES - 1, start=start, errors="scaled",
        intervals="quadratic",
    )  # fmt: skip
    bic = next(c.fit.bic for c in choice.candidates if c.label == choice.taken.label)
    more = choice.taken.size - len(start)
    kind = "true" if choice.taken.label == model else KINDS[1 + (more > 0) + 2 * (more < 0)]
    thickness = values["thickness_nm"]
    shown = [f.parameters["thickness_nm"] for f in (choice.fit, *choice.fit.alternatives)]
    order = any(
        abs(d.value - thickness) < 125.0 * short or d.interval[0] <= thickness <= d.interval[1]
        for d in shown
    )
    return Film(
        model=model, measured=measured, substrate=substrate, seed=seed, taken=choice.taken.label,
        kind=kind, missed=bool(bic > known.bic + MARGIN), order=bool(order), seconds=seconds,
    )  # fmt: skip


def main() -> None:
    """Measure and print."""
    arguments = study_options(__doc__ or "", "films", 200)
    began = time.perf_counter()
    rows = run_study(arguments, lambda seed: film(seed, arguments.only))
    print(f"{conditions()}; {len(rows)} films, {time.perf_counter() - began:.0f} s\n")
    print("| truth | films | true | equal | larger | smaller | missed | order | seconds |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    for name in (*MODELS, "all"):
        some = [r for r in rows if name in ("all", r.model)]
        if not some:
            continue
        shares = [100.0 * np.mean([r.kind == kind for r in some]) for kind in KINDS]
        shares += [
            100.0 * np.mean([getattr(r, what) for r in some]) for what in ("missed", "order")
        ]
        cells = [f"{s:.0f}" for s in shares]
        middle = np.median([r.seconds for r in some])
        print(f"| {name} | {len(some)} | {' | '.join(cells)} | {middle:.1f} |")
    for r in rows:
        if r.missed or r.kind == "larger" or not r.order:
            print(f"seed {r.seed}: {r.model}, {r.measured} on {r.substrate}: {r.taken}, {r.kind}, "
                  f"missed {r.missed}, order {r.order}")  # fmt: skip


if __name__ == "__main__":
    main()
