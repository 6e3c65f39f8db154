"""How often the 95 % intervals hold the truth where stated errors are not the errors.

    python -m benchmarks.studies.errors_study --repeats 10000 --curves 100000

R_s and R_p of gold and of silicon at 24 angles, stated errors alike for both polarizations or a
hundred times better for s. What is really wrong with the data: nothing; all errors three times as
large; a further white error of .02; a further error of 5 % of R; a gain of each polarization with a
scatter of 3 %; a further error of .02 that is smooth in angle (a wave of random phase and length).
Each by `errors=` "scaled", "floor", "relative" and the default, with the intervals that `fit`
gives. Gain and the smooth case are no white noise: they go through `fit`, which looks at the order
of residuals, with a fiftieth of the repeats, and the table tells in how many per cent of them that
was said. Then measurements drawn at random (`errors_at_random`).
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator

import numpy as np

from benchmarks.machine import conditions
from benchmarks.studies.errors_at_random import study
from fitting import Fit, Measurement, fit, fit_many
from tests.truth.random_measurements import textbook

ANGLES = np.linspace(15.0, 85.0, 24)
MATERIALS = {"gold": (0.36, 2.6), "silicon": (4.0, 0.4)}
ERRORS = {"alike": (2e-3, 2e-3), "unlike": (1e-4, 1e-2)}
WRONG = ("nothing", "factor 3", "white .02", "5 % of R", "gain 3 %", "smooth .02")
IN_ORDER = ("gain 3 %", "smooth .02")
KINDS = ("scaled", "floor", "relative", "auto")


def simulated(
    index: tuple[float, float], stated: tuple[float, float], wrong: str, repeats: int
) -> dict[str, np.ndarray]:
    """Return R_s and R_p, (repeats, angles)."""
    rng = np.random.default_rng([len(wrong), int(1e4 * index[0]), int(1e6 * stated[0])])
    out = {}
    both = textbook(ANGLES, np.array(complex(*index)))
    for name, sigma in zip(("R_s", "R_p"), stated, strict=True):
        clean = both[name]
        shape = repeats, len(ANGLES)
        noise = sigma * rng.standard_normal(shape) * (3.0 if wrong == "factor 3" else 1.0)
        if wrong == "white .02":
            noise += 0.02 * rng.standard_normal(shape)
        elif wrong == "5 % of R":
            noise += 0.05 * clean * rng.standard_normal(shape)
        elif wrong == "gain 3 %":
            noise += 0.03 * clean * rng.standard_normal((repeats, 1))
        elif wrong == "smooth .02":
            phase, waves = (
                rng.uniform(0.0, 2.0 * np.pi, (repeats, 1)),
                rng.uniform(1, 3, (repeats, 1)),
            )
            turn = 2.0 * np.pi * waves * (ANGLES - 15.0) / 70.0 + phase
            noise += 0.02 * np.sqrt(2.0) * np.sin(turn)
        out[name] = clean + noise
    return out


def _held(found: Fit, index: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Return the shares of intervals that hold eta and k, and the median half width of each."""
    shares, widths = [], []
    for name, truth in zip(("eta", "k"), index, strict=True):
        low, high = np.moveaxis(np.asarray(found.parameters[name].interval), -1, 0)
        shares.append(100.0 * np.mean((low <= truth) & (truth <= high)))
        widths.append(0.5 * float(np.nanmedian(high - low)))
    return np.array(shares), np.array(widths)


def _one_by_one(
    data: dict[str, np.ndarray], sigma: dict[str, float], errors: str, index: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray, float]:
    held, widths, said = [], [], 0
    for i in range(len(data["R_s"])):
        values = {name: np.clip(v[i], 0.0, 1.0) for name, v in data.items()}
        found = fit(Measurement.from_columns(ANGLES, sigma=sigma, **values), errors=errors)
        share, width = _held(found, index)
        held.append(share)
        widths.append(width)
        said += any(w.code == "residuals_in_order" for w in found.warnings)
    return np.mean(held, 0), np.median(widths, 0), 100.0 * said / len(held)


def rows(repeats: int) -> Iterator[str]:
    """Yield the lines of the table."""
    for name, index in MATERIALS.items():
        for like, stated in ERRORS.items():
            sigma = dict(zip(("R_s", "R_p"), stated, strict=True))
            for wrong in WRONG:
                few = max(repeats // 50, 20) if wrong in IN_ORDER else repeats
                data = simulated(index, stated, wrong, few)
                cells, base = [], None
                for kind in KINDS:
                    said = ""
                    if wrong in IN_ORDER:
                        held, width, told = _one_by_one(data, sigma, kind, index)
                        said = f", said in {told:.0f}"
                    else:
                        found = fit_many(ANGLES, **data, sigma=sigma, errors=kind, intervals="auto")
                        held, width = _held(found, index)
                    base = width if base is None else base
                    wide = " ".join(f"{w:.2f}" for w in width / base)
                    cells.append(f"{held[0]:.1f} {held[1]:.1f} ({wide}{said})")
                yield f"| {name}, {like} | {wrong} | " + " | ".join(cells) + " |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=10_000)
    parser.add_argument("--curves", type=int, default=100_000, help="measurements at random")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    repeats = options.repeats
    started = time.perf_counter()
    print(
        f"{conditions()}; {repeats} repeats; per cent that hold eta and k (width beside scaled)\n"
    )
    print("| data | what is wrong | " + " | ".join(KINDS) + " |")
    print("| --- " * (2 + len(KINDS)) + "|")
    for row in rows(repeats):
        print(row, flush=True)
    print(f"\n{options.curves} measurements at random (seed {options.seed}): eta and k held, %\n")
    for line in study(options.curves, options.seed):
        print(line, flush=True)
    print(f"\n{time.perf_counter() - started:.0f} s")


if __name__ == "__main__":
    main()
