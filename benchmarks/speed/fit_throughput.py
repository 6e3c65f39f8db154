"""Fits a second: one curve to many, beside scipy and lmfit in the same run.

Semiconductors (eta 2-5, k 0.01-3), 60 angles from 1 to 89 degrees, R_s and R_p, noise 0.1 %,
float64. Beside them batches of 100 and of 10,000 in which dielectrics, weak absorbers,
semiconductors and metals are mixed, whose slow curves must not hold the others. And 10,000 films on
silicon, 60 wavelengths, three unknowns, each begun from a neighbour's minimum.

Every round times each contestant once, and the best of the rounds counts, since other programs on
the machine can only slow a round down. The time of the processor is given as well: on a busy
machine two cores divided by that is what a quiet one would do.

    python -m benchmarks.speed.fit_throughput [--largest 100000] [--rounds 5]
                                              [--out docs/benchmarks]

With ``--out`` the figures go to fits.md and fits.json in that folder.
"""

from __future__ import annotations

import argparse
import json
import time
import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.machine import conditions, cores
from fitting import fit_many, simulate
from tests.truth.fit_batches import ANGLES, mixed, truths

PEER_FITS = 200
# Calls of up to 100 curves are made so many times in a row: the first of them finds the memory and
# the caches as a batch of 100,000 has left them, and takes half as long again; and of calls of 2 ms
# most are interrupted by other programs for a part of that.
SMALL, IN_A_ROW = 100, 200
MIXED = (100, 10_000)
FILMS = 10_000


def textbook(angle_deg: np.ndarray, eta: float, k: float) -> np.ndarray:
    """R_s and R_p in a row, as a user of scipy writes them."""
    c = np.cos(np.radians(angle_deg))
    index = eta + 1j * k
    q = np.sqrt(index**2 - (1.0 - c * c))
    r_s = (c - q) / (c + q)
    r_p = (index**2 * c - q) / (index**2 * c + q)
    return np.concatenate([np.abs(r_s) ** 2, np.abs(r_p) ** 2])


def peers() -> dict[str, Callable[[np.ndarray], object]]:
    """Return the peers that are installed, each a function of one curve (120,)."""
    found = {}
    try:
        from scipy.optimize import curve_fit

        def by_scipy(y: np.ndarray) -> object:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # no covariance for some, which is not timed
                return curve_fit(textbook, ANGLES, y, p0=(3.0, 1.0))

        found["scipy curve_fit"] = by_scipy
    except ImportError:
        pass
    try:
        import lmfit

        model = lmfit.Model(textbook)
        found["lmfit"] = lambda y: model.fit(y, angle_deg=ANGLES, eta=3.0, k=1.0)
    except ImportError:
        pass
    return found


def timed(call: Callable[[], object]) -> tuple[float, float]:
    """Return wall and processor seconds of one call."""
    wall, cpu = time.perf_counter(), time.process_time()
    call()
    return time.perf_counter() - wall, time.process_time() - cpu


def films(count: int) -> Callable[[], object]:
    """Return the fit of films of 100 to 103 nm, from the minimum of one of them."""
    random, wave = np.random.default_rng(0), np.linspace(0.4, 0.8, 60)
    sample, values = "air | cauchy:2 80..200 nm | Si", {"A": 1.46, "B": 0.004}
    few = [
        simulate(sample, {**values, "thickness_nm": nm}, 0.0, wave, "R")
        for nm in np.linspace(100.0, 103.0, 50)
    ]
    R = np.resize(np.stack(few), (count, len(wave)))
    R = R + 0.002 * random.standard_normal(R.shape)
    options = {"sigma": 0.002, "sample": sample}
    one = fit_many(0.0, wave, R=R[0], **options, check=0)
    return lambda: fit_many(0.0, wave, R=R, **options, near=one, check=0)


def _contests(sizes: list[int], data: dict[str, np.ndarray]) -> dict[str, tuple[int, Callable]]:
    """Return name -> (fits in a call, the call)."""

    def many(n: int) -> Callable[[], object]:
        R_s, R_p = (data[q][:n] if n > 1 else data[q][0] for q in ("R_s", "R_p"))
        return lambda: fit_many(ANGLES, R_s=R_s, R_p=R_p)

    calls: dict[str, tuple[int, Callable]] = {}
    for n in sizes:
        calls[f"fit_many, {n}"] = (n, many(n))
        if n in MIXED:
            calls[f"fit_many, {n} mixed"] = (n, partial(fit_many, ANGLES, **mixed(n)))
    if max(sizes) >= FILMS:
        calls[f"fit_many, {FILMS} films"] = (FILMS, films(FILMS))
    columns = np.concatenate([data["R_s"], data["R_p"]], axis=1)[:PEER_FITS]
    for name, peer in peers().items():
        calls[name] = (len(columns), lambda peer=peer: [peer(y) for y in columns])
    return calls


def measure(largest: int, rounds: int) -> dict:
    """Return all figures of one run, as JSON has them."""
    about = conditions()
    sizes = sorted({1, min(100, largest), min(10_000, largest), largest})
    eta, _, data = truths(largest)
    calls = _contests(sizes, data)
    # The first call of each size of program: 8 curves for few, 1024 for many.
    compiling = [f"fit_many, {n}" for n in sizes[:2]]
    first = {name: timed(calls[name][1]) for name in compiling}
    walls: dict[str, list[float]] = {name: [] for name in calls}
    cpus: dict[str, list[float]] = {name: [] for name in calls}
    for _ in range(rounds):
        for name, (count, call) in calls.items():
            for _ in range(IN_A_ROW if count <= SMALL else 1):
                wall, cpu = timed(call)
                walls[name].append(wall)
                cpus[name].append(cpu)
    rates = {name: count / min(walls[name]) for name, (count, _) in calls.items()}
    each_cpu = {name: 1e6 * min(cpus[name]) / count for name, (count, _) in calls.items()}
    found = fit_many(ANGLES, R_s=data["R_s"], R_p=data["R_p"])
    counts = np.atleast_1d(found.evaluations)
    off = np.abs(np.atleast_1d(found.eta) - eta) / np.atleast_1d(found.parameters["eta"].sigma)
    best = f"fit_many, {largest}"
    rivals = {name: rate for name, rate in rates.items() if "fit_many" not in name}
    fastest = max(rivals, key=lambda name: rivals[name]) if rivals else None
    return {
        "conditions": about,
        "rounds": rounds,
        "cores": cores(),
        "sizes": sizes,
        "fits_per_second": rates,
        "processor_us_a_fit": each_cpu,
        "first_call_s": {name: wall for name, (wall, _) in first.items()},
        "evaluations": {
            "median": float(np.median(counts)),
            "mean": float(counts.mean()),
            "most": int(counts.max()),
        },
        "fastest_peer": fastest,
        "times_the_fastest_peer": rates[best] / rivals[fastest] if fastest else None,
        "eta_within_2_sigma": float((off < 2.0).mean()),
    }


def _aims(r: dict) -> list[tuple[str, str, float, bool]]:
    """Return what was aimed at: figure, aim, measured, met."""
    rates, largest = r["fits_per_second"], f"fit_many, {r['sizes'][-1]}"
    cpu = r["processor_us_a_fit"]
    rows = []

    def at_least(what: str, aim: float, value: float) -> None:
        rows.append((what, f">= {aim:g}", value, value >= aim))

    def at_most(what: str, aim: float, value: float) -> None:
        rows.append((what, f"<= {aim:g}", value, value <= aim))

    for n in r["sizes"]:
        if n == 100:
            at_least("fits/s, batch of 100", 60_000, rates["fit_many, 100"])
        if n >= 10_000:
            name = f"fit_many, {n}"
            at_least(f"fits/s, batch of {n}", 100_000, rates[name])
            quiet = 1e6 * r["cores"] / cpu[name]
            at_least(f"the same by processor time, {r['cores']} processors", 100_000, quiet)
    if 10_000 in r["sizes"]:
        slower = cpu["fit_many, 10000"] / cpu["fit_many, 10000 mixed"]
        at_least("rate of 10,000 mixed / of semiconductors, by processor time", 0.5, slower)
    if f"fit_many, {FILMS} films" in rates:
        at_least("films/s, from a neighbour's minimum", 3_000, rates[f"fit_many, {FILMS} films"])
    at_most("first call, compiling, s", 2.0, max(r["first_call_s"].values()))
    at_most("evaluations a fit, median", 4, r["evaluations"]["median"])
    if peer := r["fastest_peer"]:
        at_least(f"times as fast as {peer}", 80, r["times_the_fastest_peer"])
        by_cpu = r["cores"] * cpu[peer] / cpu[largest]
        at_least("the same by processor time", 80, by_cpu)
    return rows


def markdown(r: dict) -> str:
    """Return the figures of `measure` as a page."""
    lines = [
        "# Fits a second",
        "",
        "Made by `python -m benchmarks.speed.fit_throughput --out docs/benchmarks`. One bare "
        "interface, 60 angles from 1 to 89 degrees, R_s and R_p, noise 0.1 %, float64; "
        "semiconductors (eta 2 to 5, k 0.01 to 3), or mixed with dielectrics, weak absorbers and "
        f"metals. The best of {r['rounds']} interleaved rounds, in each of which a batch of up to "
        f"{SMALL} is fitted "
        f"{IN_A_ROW} times. The peers use one processor, fit_many all; other programs slow down "
        "both, but fit_many more. The processor time says what a machine with nothing else to do "
        "would show.",
        "",
        r["conditions"] + ".",
        "",
        "| figure | aim | measured | met |",
        "| --- | --- | --- | --- |",
    ]
    for what, aim, value, met in _aims(r):
        shown = f"{value:.0f}" if value >= 1e3 else f"{value:.3g}"
        lines.append(f"| {what} | {aim} | {shown} | {'yes' if met else 'no'} |")
    lines += [
        "",
        "| tool, batch | fits/s | processor time a fit, us | first call, s |",
        "| --- | --- | --- | --- |",
    ]
    for name, rate in r["fits_per_second"].items():
        first = r["first_call_s"].get(name)
        told = f"{first:.2f}" if first else ""
        lines.append(f"| {name} | {rate:.0f} | {r['processor_us_a_fit'][name]:.1f} | {told} |")
    lines += [
        "",
        f"Evaluations of residuals and derivatives a fit: median {r['evaluations']['median']:.0f}, "
        f"mean {r['evaluations']['mean']:.2f}, most {r['evaluations']['most']}, all starts of a "
        "curve counted. Of the fitted eta "
        f"{100.0 * r['eta_within_2_sigma']:.1f} % lie within 2 sigma of the truth.",
    ]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Print the figures, or write them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--largest", type=int, default=100_000, help="largest batch")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--out", type=Path, help="folder for fits.md and fits.json")
    options = parser.parse_args()
    found = measure(options.largest, options.rounds)
    text = markdown(found)
    print(text)
    if options.out:
        options.out.mkdir(parents=True, exist_ok=True)
        (options.out / "fits.md").write_text(text)
        (options.out / "fits.json").write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
