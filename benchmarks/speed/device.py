"""Accuracy and speed on whatever device jax finds, in under ten minutes on a GPU: `make gpu`.

A GPU's compiler may contract a product and a sum into one operation, which could break the exact
sums of the library: the bounds of docs/accuracy.md are looked for at random points. Then the points
a second of values and gradients, beside what copying the same bytes would allow, and fits a second.

    python -m benchmarks.speed.device [--scale 0.1] [--seed N]

--scale: the share of points, curves and calls (the tests run it with little, on the CPU). The exit
status is 1 if a bound is exceeded. Prints Markdown.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.accuracy import search_functions
from benchmarks.accuracy.search import FUNCTIONS, random_points
from benchmarks.accuracy.search_quantities import QUANTITIES, errors
from benchmarks.machine import conditions
from benchmarks.speed.compiler_options import fit_of
from fresnel_jax import bsdf, powers, reflectance
from fresnel_jax.layers import stack

POINTS, TIMED, CURVES, CALLS = 4_096, 10_000_000, 100_000, 5
ENTRIES = ("stack of one layer", "stack of a thick layer")


def accuracy(seed: int, points: int) -> bool:
    """Print the largest errors at random points beside their bounds; return whether all hold."""
    print("\n| quantity | precision | largest error, eps | bound |\n| --- | --- | --- | --- |")
    hold = True

    def row(name: str, dtype: type, error: float, bound: float) -> None:
        nonlocal hold
        hold &= error <= bound
        above = "" if error <= bound else " EXCEEDED"
        print(f"| {name} | {dtype.__name__} | {error:.3g} | {bound:.4g}{above} |", flush=True)

    for dtype in (np.float64, np.float32):
        random = np.random.default_rng(seed)
        for name, quantity in QUANTITIES.items():
            places = random_points(random, points, dtype)
            share = errors(name, "all given", places, dtype) / quantity.bound_at(places)
            bound = float(quantity.bound_at(places)[np.argmax(share)])
            row(name, dtype, float(share.max()) * bound, bound)
        for name in ENTRIES:
            entry = FUNCTIONS[name]
            assert entry.bound is not None
            worst, *_ = search_functions.search(entry, False, dtype, random, points // 8)
            row(name, dtype, float(worst) * entry.bound, entry.bound)
    return hold


def seconds_of(call: Callable[[], Any], calls: int) -> float:
    """Return the seconds of the fastest of some calls, after a first one that compiles."""
    best = float("inf")
    for i in range(calls + 1):
        start = time.perf_counter()
        jax.block_until_ready(call())
        best = min(best, time.perf_counter() - start) if i else best
    return best


def speed(points: int, calls: int) -> None:
    """Print points a second, and the share of the copy bandwidth that inputs and outputs take."""
    print("\n| program | precision | million points/s | share of copy bandwidth |")
    print("| --- | --- | --- | --- |")

    def film(c: Any, n: Any, k: Any) -> Any:
        return stack(
            c,
            jnp.stack([jnp.ones_like(n), n + 1j * k, n + 1.0]),
            thickness_um=k[None],
            wavelength_um=0.5,
        ).R_p

    def rough(c: Any, n: Any, k: Any) -> Any:
        wo = jnp.stack([jnp.sqrt(1.0 - c * c), 0.0 * c, c], -1)
        return bsdf.conductor(n, k, bsdf.TrowbridgeReitz(0.2 + 0.1 * c)).evaluate(wo, wo)

    programs = {
        "copy": lambda c, n, k: (c + 1, n + 1, k + 1),
        "reflectance": reflectance,
        "powers": powers,
        "stack of one film": film,
        "rough conductor": rough,
    }
    for dtype in (np.float32, np.float64):
        random = np.random.default_rng(0)
        given = [jnp.asarray(random.uniform(*x, points), dtype) for x in ((0, 1), (1, 3), (0.1, 2))]
        bandwidth = 0.0
        for name, function in programs.items():
            forms = {name: jax.jit(function)}
            if name != "copy":
                total = lambda *x, f=function: sum(jnp.sum(y) for y in jax.tree.leaves(f(*x)))  # noqa: E731
                forms[f"{name}, gradient"] = jax.jit(jax.grad(total, argnums=(0, 1, 2)))
            for form, program in forms.items():
                seconds = seconds_of(partial(program, *given), calls)
                outputs = jax.tree.leaves(jax.eval_shape(program, *given))
                moved = sum(x.size * x.dtype.itemsize for x in [*given, *outputs]) / seconds
                bandwidth = moved if name == "copy" else bandwidth
                shown = f"{moved / 1e9:.0f} GB/s" if name == "copy" else f"{moved / bandwidth:.2f}"
                rate = points / seconds / 1e6
                print(f"| {form} | {dtype.__name__} | {rate:.1f} | {shown} |", flush=True)


def fits(curves: int, calls: int) -> None:
    """Print bare curves a second by `fit_many`, and the seconds of one film."""
    bare, film = (fit_of(case, curves) for case in ("batch", "film"))
    rate = curves / seconds_of(lambda: bare().eta, calls)
    print(f"\nfit_many, bare surfaces, 60 angles, s and p: {rate:,.0f} curves/s")
    print(f"fit, one film, 60 wavelengths: {seconds_of(lambda: film().chi2, calls):.2f} s")


def main(arguments: list[str] | None = None) -> int:
    """Measure and print; return the exit status."""
    parser = argparse.ArgumentParser("python -m benchmarks.speed.device")
    parser.add_argument("--scale", type=float, default=1.0)
    parser.add_argument("--seed", type=int)
    given = parser.parse_args(arguments)
    seed = np.random.SeedSequence().entropy % 10**9 if given.seed is None else given.seed
    jax.config.update("jax_enable_x64", True)
    print(f"{jax.devices()[0].device_kind}; {conditions()}; seed {seed}")
    hold = accuracy(seed, max(int(POINTS * given.scale), 32))
    calls = max(int(CALLS * given.scale), 1)
    speed(max(int(TIMED * given.scale), 1_000), calls)
    fits(max(int(CURVES * given.scale), 100), calls)
    return 0 if hold else 1


if __name__ == "__main__":
    sys.exit(main())
