"""What options of XLA's CPU compiler do to fits: `python -m benchmarks.speed.compiler_options`.

Each set of options runs in processes of its own, where nothing is compiled, in turn with the
others, so that a busy machine slows all of them. Printed are seconds of processor time, of a first
fit (most of it compilation) and of the same fit again, medians over the rounds, and by how much the
values found differ from those without options.
"""

from __future__ import annotations

import json
import statistics
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.machine import conditions

ROOT = Path(__file__).resolve().parents[2]
ROUNDS = 3
CHEAPER = {"xla_backend_optimization_level": 1, "xla_llvm_disable_expensive_passes": True}
OPTIONS: dict[str, dict[str, Any]] = {
    "none": {},
    "xla_cpu_experimental_ynn_fusion_type=": {"xla_cpu_experimental_ynn_fusion_type": ""},
    "xla_cpu_use_fusion_emitters=false": {"xla_cpu_use_fusion_emitters": False},
    "level 1, no expensive passes": CHEAPER,
    "older emitters, level 1, no expensive passes": {
        "xla_cpu_use_fusion_emitters": False,
        **CHEAPER,
    },
}
CASES = ("bare", "film", "batch")


def fit_of(case: str, curves: int = 10_000) -> Callable:
    """Return a function that fits: gold over angles, a film over wavelengths, many surfaces.

    curves: the number of these surfaces.
    """
    from fitting import Measurement, fit, fit_many, read_csv, simulate
    from fresnel_jax import powers

    rng = np.random.default_rng(0)
    if case == "bare":
        gold = read_csv(ROOT / "examples" / "data" / "gold_532nm.csv")
        return lambda: fit(gold)
    if case == "film":
        wavelength, text = np.linspace(0.4, 0.8, 60), "air | cauchy 110 nm | Si"
        values = {"A": 1.45, "B": 0.004, "C": 0.0, "thickness_nm": 110.0}
        R = simulate(text, values, 0.0, wavelength, "R") + rng.normal(0.0, 0.002, 60)
        film = Measurement.from_columns(0.0, wavelength, R=R, sigma=0.002)
        return lambda: fit(film, text)
    angles = np.linspace(1.0, 89.0, 60)
    eta, k = rng.uniform(2.0, 5.0, (curves, 1)), rng.uniform(0.01, 3.0, (curves, 1))
    exact = powers(np.cos(np.deg2rad(angles)), eta, k)._asdict()
    data = {q: exact[q] + rng.normal(0.0, 1e-3, exact[q].shape) for q in ("R_s", "R_p")}
    return lambda: fit_many(angles, **data)


def one_case(case: str, options: dict[str, Any]) -> None:
    """Print, as JSON, the processor seconds of a first fit and of the next ones, and the values."""
    from fitting.process import compiled

    compiled.OPTIONS = options
    call, seconds = fit_of(case), []
    for _ in range(4):
        start = time.process_time()
        result = call()
        seconds.append(time.process_time() - start)
    values = np.concatenate([np.ravel(p.value) for p in result.parameters.values()])
    known = compiled._known_options() == options
    print(json.dumps([known, seconds[0], min(seconds[1:]), values.tolist()]))


def main() -> None:
    """Measure and print."""
    print(conditions())
    seconds, values = defaultdict(list), {}
    for _ in range(ROUNDS):
        for case in CASES:
            for name, options in OPTIONS.items():
                call = f"benchmarks.speed.compiler_options.one_case({case!r}, {options!r})"
                code = [sys.executable, "-c", f"import benchmarks.speed.compiler_options; {call}"]
                done = subprocess.run(code, cwd=ROOT, capture_output=True, text=True, check=True)
                known, *pair, found = json.loads(done.stdout)
                if known:
                    seconds[case, name].append(pair)
                    values[case, name] = np.array(found)
    print("| fit | options | first | again | differs by |\n| --- | --- | --- | --- | --- |")
    for (case, name), pairs in seconds.items():
        first, again = (statistics.median(x) for x in zip(*pairs, strict=True))
        plain = values[case, "none"]
        apart = np.max(np.abs(values[case, name] - plain)) / np.max(np.abs(plain))
        print(f"| {case} | {name} | {first:.2f} | {again:.3f} | {apart:.0e} |")


if __name__ == "__main__":
    main()
