"""How often `choose` takes the true one of several samples, and how seldom a needless layer.

Bare silicon or an oxide on it; a film of a Cauchy material on silicon, glass or silver that is
nothing but that, or has a rough surface, an index that changes with depth, or an oxide below.
Films, thicknesses and gradients are random, so that the effect of what is added goes from nothing
to a hundred times the noise: the largest difference of the true curve from the fitted one of the
sample without it, in standard errors of a datum. 30 wavelengths of a random range; psi and Delta at
a random angle, or R at normal incidence; random noise around .05 and .1 degrees and .001. Counted,
in per cent, are

  needless  a sample with more parameters than the true one was taken
  true      the true one was, of all films, and of those whose effect is above three

    python -m benchmarks.studies.film_choice [--repeats 40] [--minutes 60] [--seed N] [--only rough]
"""

from __future__ import annotations

import itertools
import time
from typing import Any, NamedTuple

import numpy as np

from benchmarks.machine import conditions
from benchmarks.studies.study_options import study_options, until_interrupted
from fitting import Measurement, Sample, choose, simulate
from fitting.choice.selection import Choice

WAVELENGTHS = 30
SUBSTRATES = ("Si", "BK7", "silver")
MEASURED = {"psi, Delta": {"psi": 0.05, "delta": 0.1}, "R": {"R": 1e-3}}
OXIDE = ("Si", "air | SiO2 0.1..60 nm | Si")
FILMS = (
    "air | cauchy:2 50..500 nm | {}",
    "air | rough 0.1..30 nm | cauchy:2 50..500 nm | {}",
    "air | cauchy:2 50..500 nm graded | {}",
    "air | cauchy:2 50..500 nm | SiO2 0.1..30 nm | {}",
)
# name -> the samples that are compared, {} for the substrate, and which of them is true
TRUTHS = {
    "bare": (OXIDE, 0), "oxide": (OXIDE, 1), "film": (FILMS, 0), "rough film": (FILMS, 1),
    "graded film": (FILMS, 2), "film on oxide": (FILMS, 3),
}  # fmt: skip


def _values(name: str, random: np.random.Generator) -> dict[str, float]:
    """Return random parameters of a true sample."""
    film = {
        "A": random.uniform(1.4, 2.3), "B": random.uniform(0.002, 0.02),
        "thickness_nm": random.uniform(80.0, 400.0),
    }  # fmt: skip
    thin = float(10.0 ** random.uniform(-0.5, 1.2))
    if name == "bare":
        return {}
    if name == "oxide":
        return {"thickness_nm": thin}
    if name == "graded film":
        return film | {"grade": random.choice([-1.0, 1.0]) * 10.0 ** random.uniform(-3.0, -0.8)}
    if name == "film":
        return film
    place, other = ("film_2", "film_1") if name == "rough film" else ("film_1", "film_2")
    return {f"{place}.{k}": v for k, v in film.items()} | {f"{other}.thickness_nm": thin}


class Outcome(NamedTuple):
    """What was taken. effect: of what the true sample has more than the first; NaN if nothing."""

    name: str
    measured: str
    substrate: str
    seed: int
    taken: str
    true: bool
    needless: bool
    effect: float


def outcome(name: str, measured: str, seed: int) -> Outcome:
    """Return what `choose` takes of a random film."""
    random = np.random.default_rng([20, seed])
    samples, which = TRUTHS[name]
    substrate = str(random.choice(SUBSTRATES)) if "{}" in samples[0] else "Si"
    samples = tuple(text.format(substrate) for text in samples)
    true = Sample.parse(samples[which])
    values = _values(name, random)
    angle = 0.0 if measured == "R" else random.uniform(55.0, 75.0)
    waves = np.linspace(random.uniform(0.35, 0.5), random.uniform(0.75, 0.95), WAVELENGTHS)
    noise = 10.0 ** random.uniform(-0.4, 0.4)
    sigma_of = {quantity: noise * sigma for quantity, sigma in MEASURED[measured].items()}
    columns, ideal, sigmas = {}, [], []
    for quantity, sigma in sigma_of.items():
        curve = simulate(true, values, angle, waves, quantity)
        ideal.append(curve)
        sigmas.append(np.full(len(curve), sigma))
        noisy = curve + sigma * random.standard_normal(len(curve))
        noisy = np.clip(noisy, 0.0, 90.0) if quantity == "psi" else noisy
        columns[quantity] = noisy % 360.0 if quantity == "delta" else noisy
    m = Measurement.from_columns(angle, waves, sigma=sigma_of, **columns)
    choice = choose(m, samples, intervals="quadratic")
    size = {c.label: c.size for c in choice.candidates}
    taken = choice.taken.label
    effect = np.nan
    if which:
        effect = _effect(choice, str(Sample.parse(samples[0])), columns, ideal, sigmas)
    needless = size[taken] > size[str(true)]
    return Outcome(
        name=name, measured=measured, substrate=substrate, seed=seed, taken=taken,
        true=taken == str(true), needless=needless, effect=effect,
    )  # fmt: skip


def _effect(choice: Choice, simple: str, columns: Any, ideal: Any, sigmas: Any) -> float:
    """Return the largest difference of the true curves from those of a fitted sample."""
    found = next(c.fit for c in choice.candidates if c.label == simple)
    m = found.measurement
    assert m is not None
    shown = found.predict().value
    off = []
    for quantity, curve, sigma in zip(columns, ideal, sigmas, strict=True):
        away = shown[m.quantity == quantity] - curve
        away = (away + 180.0) % 360.0 - 180.0 if quantity == "delta" else away
        off.append(np.abs(away) / sigma)
    return float(np.max(off))


def _line(name: str, rows: list[Outcome]) -> str:
    strong = [r for r in rows if not r.effect <= 3.0]
    others = sorted({f"{r.taken} (seed {r.seed})" for r in strong if not r.true})
    shares = [[r.needless for r in rows], [r.true for r in rows], [r.true for r in strong]]
    cells = [f"{100.0 * np.mean(s):.0f}" if s else "" for s in shares]
    return f"| {name} | {len(rows)} | {' | '.join(cells)} of {len(strong)} | {'; '.join(others)} |"


def main() -> None:
    """Print the table."""
    arguments = study_options(__doc__, "repeats", 40)
    seed = arguments.seed
    cells = [
        cell for cell in itertools.product(TRUTHS, MEASURED)
        if any(text in ", ".join(cell) for text in arguments.only)
    ]  # fmt: skip
    print(f"{conditions()}; seed {seed}\n", flush=True)
    rows: list[Outcome] = []
    began = time.perf_counter()
    with until_interrupted():
        for repeat, cell in itertools.product(range(arguments.count), cells):
            if time.perf_counter() - began > 60.0 * arguments.minutes:
                break
            rows.append(outcome(*cell, seed + repeat))
    print("| sample, measured | films | needless | true | true, effect above 3 | taken instead |")
    print("| --- | --- | --- | --- | --- | --- |")
    for cell in cells:
        some = [r for r in rows if (r.name, r.measured) == cell]
        if some:
            print(_line(", ".join(cell), some))
    for substrate in SUBSTRATES:
        print(_line(f"on {substrate}", [r for r in rows if r.substrate == substrate]))
    print(_line("all", rows))


if __name__ == "__main__":
    main()
