"""How often --sample auto takes the true model, and how seldom a parameter that is not needed.

Spectra of 40 wavelengths from .4 to 1 um at 55, 65 and 75 degrees, R_s and R_p, noise .1 %, of
materials with random parameters, and curves of 30 angles at one wavelength. Of the models taken,
in per cent:

  true     the one that the data were made with
  equal    another one with the same number of parameters
  larger   one with more: a parameter that the data do not need
  smaller  one with less: an effect too weak to be seen

    python -m benchmarks.studies.model_choice [--repeats 40] [--only NAME ...]
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from collections.abc import Callable

import numpy as np

from benchmarks.machine import conditions
from fitting.choice.selection import choose
from fitting.data.measurement import Measurement
from fitting.predictions import simulate

WAVELENGTHS = np.linspace(0.4, 1.0, 40)
NOISE = 1e-3
Draw = Callable[[np.random.Generator], dict[str, float]]


def _oscillator(rng: np.random.Generator, number: int, low: float, high: float) -> dict[str, float]:
    return {
        f"strength_ev2_{number}": rng.uniform(1.0, 5.0),
        f"resonance_ev_{number}": rng.uniform(low, high),
        f"width_ev_{number}": rng.uniform(0.15, 0.4),
    }


# name -> label of the true model, whether at one wavelength, and its parameters
TRUTHS: dict[str, tuple[str, bool, Draw]] = {
    "glass, one wavelength": ("constant, k = 0", True, lambda r: {"eta": r.uniform(1.4, 2.5)}),
    "absorber, one wavelength": (
        "constant", True, lambda r: {"eta": r.uniform(1.4, 3.0), "k": r.uniform(0.3, 2.0)},
    ),
    "without dispersion": ("constant, k = 0", False, lambda r: {"eta": r.uniform(1.4, 2.5)}),
    "grey absorber": (
        "constant", False, lambda r: {"eta": r.uniform(1.5, 3.0), "k": r.uniform(0.3, 2.0)},
    ),
    "Cauchy, 2 terms": (
        "cauchy:2", False, lambda r: {"A": r.uniform(1.4, 2.2), "B": r.uniform(0.004, 0.02)},
    ),
    "Sellmeier, 1 term": (
        "sellmeier:1", False,
        lambda r: {"strength_1": r.uniform(1.0, 3.0), "resonance_um_1": r.uniform(0.15, 0.25)},
    ),
    "Cauchy, with a scale": (
        "cauchy:2, scale", False,
        lambda r: {"A": r.uniform(1.4, 2.2), "B": r.uniform(0.004, 0.02), "scale": 0.97},
    ),
    "Drude": (
        "drude", False,
        lambda r: {"eps_inf": r.uniform(1.0, 5.0), "plasma_ev": r.uniform(5.0, 10.0),
                   "width_ev": r.uniform(0.05, 0.5)},
    ),
    "Lorentz, 1 oscillator": (
        "lorentz:1", False,
        lambda r: {"eps_inf": r.uniform(1.5, 3.0), **_oscillator(r, 1, 1.6, 2.8)},
    ),
    "Lorentz, 2 oscillators": (
        "lorentz:2", False,
        lambda r: {"eps_inf": r.uniform(1.5, 3.0), **_oscillator(r, 1, 1.4, 1.9),
                   **_oscillator(r, 2, 2.3, 2.9)},
    ),
    "Drude and 1 oscillator": (
        "drude-lorentz:1", False,
        lambda r: {"eps_inf": r.uniform(1.5, 4.0), "plasma_ev": r.uniform(5.0, 9.0),
                   "width_ev": r.uniform(0.05, 0.3), **_oscillator(r, 1, 2.0, 2.8)},
    ),
}  # fmt: skip


def simulated(label: str, one: bool, values: dict[str, float], rng: np.random.Generator):
    """Return a Measurement of the model with noise."""
    angles = np.linspace(20.0, 80.0, 30) if one else np.repeat([55.0, 65.0, 75.0], 40)
    waves = np.full(30, 0.6) if one else np.tile(WAVELENGTHS, 3)
    model = label.split(",")[0]
    values = {"k": 0.0, **values} if model == "constant" else values
    data = {
        q: simulate(model, values, angles, waves, q) + NOISE * rng.standard_normal(len(angles))
        for q in ("R_s", "R_p")
    }
    return Measurement.from_columns(angles, waves, sigma=NOISE, **data)


def study(name: str, repeats: int) -> tuple[list[float], str]:
    """Return the four shares and what else was taken."""
    label, one, draw = TRUTHS[name]
    found: Counter[str] = Counter()
    kinds: Counter[str] = Counter()
    for seed in range(repeats):
        rng = np.random.default_rng(seed)
        values = draw(rng)
        taken = choose(simulated(label, one, values, rng)).taken
        # A scale is one parameter a curve (R_s and R_p): one more than was drawn.
        size = len(values) + ("scale" in values)
        kind = "larger" if taken.size > size else "smaller" if taken.size < size else "equal"
        kinds["true" if taken.label == label else kind] += 1
        if taken.label != label:
            found[taken.label] += 1
    shares = [100.0 * kinds[k] / repeats for k in ("true", "equal", "larger", "smaller")]
    return shares, "; ".join(f"{other} {count}" for other, count in found.most_common(3))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=40)
    parser.add_argument("--only", nargs="*", default=list(TRUTHS), metavar="NAME")
    options = parser.parse_args()
    started = time.perf_counter()
    print(f"{conditions()}; {options.repeats} repeats\n")
    print("| truth | true | equal | larger | smaller | taken instead |")
    print("| --- | --- | --- | --- | --- | --- |")
    larger = []
    for name in options.only:
        shares, others = study(name, options.repeats)
        larger.append(shares[2])
        print(f"| {name} | {' | '.join(f'{s:.0f}' for s in shares)} | {others} |", flush=True)
    print(f"\na parameter too many: {np.mean(larger):.1f} % of all, {max(larger):.0f} % at most")
    print(f"{time.perf_counter() - started:.0f} s")


if __name__ == "__main__":
    main()
