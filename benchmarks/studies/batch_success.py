"""Whether `fit_many` ends where `fit` does, on maps of films and plates drawn at random.

    python -m benchmarks.studies.batch_success --maps 10 --seed 1

Each map has 24 curves (4, 6): thickness and index drift over it by up to 15 and 2 %; noise, gaps
and ranges are random. Every curve is also fitted by `fit`, from a full search. Printed for each
kind of sample: the share of curves whose chi2 is no more than .02, and no more than 6, above that
of `fit`; and of those that are off the truth by more than 5 standard errors without a word of other
minima.
"""

from __future__ import annotations

import argparse

import numpy as np

from fitting import Measurement, fit, fit_many, simulate

WAVES = np.linspace(0.4, 0.9, 40)
SHAPE = (4, 6)


def _grid(angles: list[float]) -> tuple[np.ndarray, np.ndarray]:
    angle, wave = np.meshgrid(angles, WAVES, indexing="ij")
    return angle.ravel(), wave.ravel()


# kind: sample ({low}, {high}: of the thickness in nm), its substrate, angles, quantities.
KINDS = {
    "film on silicon, R": ("air | cauchy:2 {low}..{high} nm | Si", [0.0], ("R",)),
    "film on glass, R_s": ("air | cauchy:2 {low}..{high} nm | 1.52", [30.0], ("R_s",)),
    "film on silicon, psi and Delta": (
        "air | cauchy:2 {low}..{high} nm | Si", [60.0, 70.0], ("psi", "delta"),
    ),
    "film on a plate, R and T": (
        "air | cauchy:2 {low}..{high} nm | 1.46 1 mm thick held | air", [0.0], ("R", "T"),
    ),
    "oxide below a film, psi and Delta": (
        "air | cauchy:2 {low}..{high} nm | SiO2 5..60 nm | Si", [65.0], ("psi", "delta"),
    ),
}  # fmt: skip
SIGMA = {"psi": (0.01, 0.2), "delta": (0.02, 0.5)}


def _drift(random: np.random.Generator, share: float) -> np.ndarray:
    """Return factors about 1 that change smoothly over a map, SHAPE."""
    i, j = np.meshgrid(*(np.linspace(-0.5, 0.5, n) for n in SHAPE), indexing="ij")
    slope = random.uniform(-share, share, 3)
    return 1.0 + slope[0] * i + slope[1] * j + slope[2] * (i * i + j * j)


def one_map(kind: str, random: np.random.Generator) -> tuple[int, int, int, int, int]:
    """Return how many curves were compared, are as low, within 6, silently wrong, and converged."""
    text, angles, quantities = KINDS[kind]
    angle, wave = _grid(angles)
    middle = 10.0 ** random.uniform(np.log10(40.0), np.log10(1500.0))
    thickness = middle * _drift(random, 0.15)
    A = random.uniform(1.4, 2.2) * _drift(random, 0.02)
    B = random.uniform(0.002, 0.02)
    sample = text.format(low=round(0.5 * thickness.min()), high=round(1.6 * thickness.max()))
    oxide = random.uniform(10.0, 50.0)
    data, sigma = {}, {}
    for q in quantities:
        low, high = SIGMA.get(q, (5e-4, 5e-3))
        sigma[q] = low * (high / low) ** random.random()
        values = np.empty((*SHAPE, len(angle)))
        for at in np.ndindex(*SHAPE):
            film = "film_1." if "SiO2" in text else ("film." if "thick held" in text else "")
            p = {f"{film}A": A[at], f"{film}B": B, f"{film}thickness_nm": thickness[at]}
            if "SiO2" in text:
                p["film_2.thickness_nm"] = oxide
            values[at] = simulate(sample, p, angle, wave, q)
        values += sigma[q] * random.standard_normal(values.shape)
        if q == "psi":
            values = np.clip(values, 0.0, 90.0)
        if q == "delta":
            values %= 360.0
        else:
            values[random.random(values.shape) < random.choice([0.0, 0.05])] = np.nan
        data[q] = values
    if "psi" in data:  # a Delta without psi would be refused
        data["delta"][np.isnan(data["psi"])] = np.nan
    found = fit_many(angle, wave, **data, sigma=sigma, sample=sample, check=4)
    told = {f.code: np.broadcast_to(f.at, SHAPE) for f in found.findings}
    low = near = wrong = 0
    name = next(n for n in found.names if n.endswith("thickness_nm"))
    for at in np.ndindex(*SHAPE):
        m = Measurement.from_columns(
            angle, wave, sigma=sigma, **{q: v[at] for q, v in data.items()}
        )  # fmt: skip
        one = fit(m, sample, errors="scaled", intervals="quadratic")
        unit = max(one.cost / max(one.dof, 1), 1.0)
        rise = (found.cost[at] - one.cost) / unit
        low += rise < 0.02
        near += rise < 6.0
        e = found.parameters[name].at(at)
        silent = not told.get("other_minima", np.zeros(SHAPE, bool))[at]
        silent &= str(found.status[at]) == "converged"
        if silent and abs(e.value - thickness[at]) > 5.0 * e.sigma:
            wrong += 1
            print(f"   {kind}: {at} {e.value:.5g} +- {e.sigma:.2g}, true {thickness[at]:.5g}, "
                  f"by fit {one.parameters[name].value:.5g}, rise {rise:.3g}")  # fmt: skip
    return int(np.prod(SHAPE)), low, near, wrong, int((found.status == "converged").sum())


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--maps", type=int, default=4)
    parser.add_argument("--seed", type=int, default=None)
    parser.add_argument("--only", default="")
    options = parser.parse_args()
    seed = options.seed if options.seed is not None else np.random.SeedSequence().entropy
    print(f"seed {seed}")
    print("| sample | curves | as low as fit | within 6 | silently wrong | converged |")
    print("| --- | --- | --- | --- | --- | --- |")
    for number, kind in enumerate(KINDS):
        if options.only not in kind:
            continue
        total = np.zeros(5, int)
        for i in range(options.maps):
            total += one_map(kind, np.random.default_rng([seed, number, i]))
        n = total[0]
        print(
            f"| {kind} | {n} | {100 * total[1] / n:.1f} % | {100 * total[2] / n:.1f} % | "
            f"{total[3]} | {total[4]} |", flush=True,
        )  # fmt: skip


if __name__ == "__main__":
    main()
