"""How often the 95 % intervals of a model fit hold the truth.

For each material and measurement, repeats with fresh normal noise: the share whose interval of each
parameter holds the true value, for the three kinds of intervals, with errors taken as stated
("absolute"). "by profile" is the share of the parameters for which "auto" took the profile. Where
a parameter lies on the end of its range, the problem is not regular: it cannot be below. Intervals
beside 0 allow for that; beside another end they hold 97.5 % and not 95.

The statistical error of a share near .95 is .34 % (one sigma) at 4000 repeats.

    python -m benchmarks.studies.model_coverage [--repeats 4000] [--only glass]
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from benchmarks.machine import conditions
from fitting import Measurement, fit, simulate

KINDS = ("quadratic", "profile", "auto")
MANY = tuple(np.linspace(20.0, 80.0, 13))
FEW = (45.0, 65.0, 75.0)
SPECTRUM = tuple(np.linspace(0.4, 0.9, 14))
TINTED = {"A": 1.5, "B": 0.012, "k_edge": 0.1, "urbach_ev": 0.4, "edge_ev": 3.0}


class Case(NamedTuple):
    """What is measured and how it is fitted."""

    name: str
    model: str
    truth: dict[str, float]
    angles: tuple[float, ...]
    wavelengths: tuple[float, ...]
    quantities: tuple[str, ...]
    noise: float
    regular: bool
    options: Mapping[str, Any] = {}


CASES = (
    Case("tinted glass", "constant", {"eta": 1.5, "k": 0.3}, MANY, (0.6,), ("R_s", "R_p"), 2e-3,
         True),
    Case("Cauchy and a scale", "cauchy:2", {"A": 1.5, "B": 0.012, "scale": 0.97}, FEW, SPECTRUM,
         ("R_s",), 2e-3, True, {"free": ("scale",)}),
    Case("Lorentz", "lorentz:1",
         {"eps_inf": 2.0, "strength_ev2_1": 6.0, "resonance_ev_1": 2.3, "width_ev_1": 0.5},
         FEW, SPECTRUM, ("R_s", "R_p"), 1e-2, True),
    Case("metal", "constant", {"eta": 1.1, "k": 7.0}, FEW, (0.6,), ("R_s", "R_p"), 5e-3, False),
    Case("glass", "constant", {"eta": 1.5, "k": 0.0}, MANY, (0.6,), ("R_s", "R_p"), 2e-3, False),
    Case("weak absorber", "constant", {"eta": 1.5, "k": 0.06}, MANY, (0.6,), ("R_s", "R_p"), 2e-3,
         False),
    Case("Cauchy, A >= 1.5", "cauchy:2", {"A": 1.5, "B": 0.012}, FEW, SPECTRUM, ("R_s", "R_p"),
         2e-3, False, {"bounds": {"A": (1.5, 3.0)}}),
    Case("Cauchy and Urbach", "cauchy-urbach:2", TINTED, FEW, SPECTRUM, ("R_s", "R_p"), 2e-3,
         False, {"fixed": {"edge_ev": 3.0}}),
)  # fmt: skip


def study(case: Case, repeats: int) -> tuple[tuple[str, ...], dict[str, np.ndarray], np.ndarray]:
    """Return the parameters, shares of intervals that hold the truth, and of those by profile."""
    random = np.random.default_rng(7)
    angle, wavelength = (a.ravel() for a in np.meshgrid(case.angles, case.wavelengths))
    clean = {q: simulate(case.model, case.truth, angle, wavelength, q) for q in case.quantities}
    held: dict[str, Any] = {kind: 0 for kind in KINDS}
    by_profile: Any = 0
    names: tuple[str, ...] = ()
    for _ in range(repeats):
        noisy: dict[str, Any] = {
            q: v + case.noise * random.standard_normal(len(v)) for q, v in clean.items()
        }
        m = Measurement.from_columns(angle, wavelength, sigma=case.noise, **noisy)
        for kind in KINDS:
            found = fit(m, case.model, errors="stated", intervals=kind, **case.options)
            true = np.array([case.truth[name] for name in found.names])
            free = [found.parameters[name] for name in found.names]
            low, high = np.array([e.interval for e in free]).T
            held[kind] = held[kind] + ((low <= true) & (true <= high))
            names = found.names
        by_profile = by_profile + np.array([e.interval_kind == "profile" for e in free])
    return names, {kind: held[kind] / repeats for kind in KINDS}, by_profile / repeats


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=4000)
    parser.add_argument("--only", default="", help="cases that begin so")
    arguments = parser.parse_args()
    started = time.perf_counter()
    print(f"{conditions()}; {arguments.repeats} repeats; per cent that hold the true value\n")
    print("| case | regular | parameter | " + " | ".join(KINDS) + " | by profile |")
    print("| --- " * 7 + "|")
    off = 0
    for case in CASES:
        if not case.name.startswith(arguments.only):
            continue
        names, shares, by_profile = study(case, arguments.repeats)
        for i, name in enumerate(names):
            cells = [f"{100.0 * shares[kind][i]:.1f}" for kind in KINDS]
            cells.append(f"{100.0 * by_profile[i]:.0f}")
            regular = "yes" if case.regular else "no"
            print(f"| {case.name} | {regular} | {name} | " + " | ".join(cells) + " |", flush=True)
            if case.regular:
                off += sum(not 0.94 <= shares[kind][i] <= 0.96 for kind in ("profile", "auto"))
    print(f"\n{off} shares of the regular cases, by profile or auto, outside of 94 to 96 %")
    print(f"{time.perf_counter() - started:.0f} s")


if __name__ == "__main__":
    main()
