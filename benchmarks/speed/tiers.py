"""What the compensated sum of `reflectance` costs, and what is lost without it.

    python -m benchmarks.speed.tiers

Prints the tables of docs/speed_tiers.md. Times are ratios of interleaved calls in one process;
errors are against 100 digits at the exact arguments, in eps of R.
"""

import functools
import itertools

import jax
import mpmath as mp
import numpy as np

from benchmarks.speed.operations import with_gradient
from benchmarks.speed.timing import fastest
from fresnel_jax import reflectance
from tests.truth import oracle

plain = functools.partial(reflectance, compensated=False)
COLUMNS = [(lossy, dtype) for lossy in (False, True) for dtype in ("float64", "float32")]
EDGES = (1e-8, 1e-6, 1e-4, 0.01, 0.1, 1.0, 10.0, 40.0)  # degrees
POINTS = 1000


def points(lossy: bool, dtype: str, size: int):
    random = np.random.default_rng(20261121)
    values = [random.uniform(0, 1, size), random.uniform(1.1, 4, size)]
    if lossy:
        values.append(random.uniform(0.1, 4, size))
    return [jax.numpy.asarray(x, dtype) for x in values]


def relative_times() -> None:
    print("| without compensation / with it | " + " | ".join(_heads()) + " |")
    print("| --- " * (1 + len(COLUMNS)) + "|")
    for what, size in (("value", 10**5), ("value", 10**6), ("value with gradient", 10**5)):
        cells = []
        for lossy, dtype in COLUMNS:
            arguments = points(lossy, dtype, size)
            forms = {"plain": plain, "compensated": reflectance}
            if what != "value":
                forms = {name: with_gradient(f, len(arguments)) for name, f in forms.items()}
            times = fastest({name: jax.jit(f) for name, f in forms.items()}, arguments)
            cells.append(f"{times['plain'] / times['compensated']:.2f}")
        print(f"| {what}, {size:.0e} points | {' | '.join(cells)} |")


def gradient_over_value() -> None:
    print("| value with gradient / value | " + " | ".join(_heads()) + " |")
    print("| --- " * (1 + len(COLUMNS)) + "|")
    cells = []
    for lossy, dtype in COLUMNS:
        arguments = points(lossy, dtype, 10**5)
        forms = {"value": reflectance, "both": with_gradient(reflectance, len(arguments))}
        times = fastest({name: jax.jit(f) for name, f in forms.items()}, arguments)
        cells.append(f"{times['both'] / times['value']:.2f}")
    print(f"| `reflectance`, 1e5 points | {' | '.join(cells)} |")


def _heads() -> list[str]:
    return [f"{'lossy' if lossy else 'lossless'} {dtype}" for lossy, dtype in COLUMNS]


def errors_by_distance() -> None:
    print("| degrees from the critical angle | " + " | ".join(_heads()) + " |")
    print("| --- " * (1 + len(COLUMNS)) + "|")
    random = np.random.default_rng(20261121)
    for low, high in itertools.pairwise(EDGES):
        cells = []
        for lossy, dtype in COLUMNS:
            n = random.uniform(0.4, 0.95, POINTS).astype(dtype)
            k = (10.0 ** random.uniform(-12, -3, POINTS) * lossy).astype(dtype)
            aside = 10.0 ** random.uniform(np.log10(low), np.log10(high), POINTS)
            angle = np.degrees(np.arcsin(n.astype(float))) + random.choice([-1, 1], POINTS) * aside
            c = np.cos(np.radians(np.clip(angle, 0.0, 89.0))).astype(dtype)
            R = plain(c, n, k if lossy else 0)
            true = [oracle.reflectance(*point, 1.0) for point in zip(c, n, k, strict=True)]
            relative = [
                abs(mp.mpf(float(x)) - t) / t for x, t in zip(np.asarray(R), true, strict=True)
            ]
            cells.append(f"{float(max(relative)) / float(np.finfo(dtype).eps):.2g}")
        print(f"| {low:g} to {high:g} | {' | '.join(cells)} |")


def main():
    jax.config.update("jax_enable_x64", True)
    mp.mp.dps = 50
    relative_times()
    print()
    gradient_over_value()
    print()
    errors_by_distance()


if __name__ == "__main__":
    main()
