"""What a map on disk costs beside `fit_many` in memory: rates, workers, memory, films.

    python -m benchmarks.speed.maps [--curves 400000] [--films 20000] [--euros 0.04]

Prints the table of docs/howto/map.md. Rates are ratios of runs in turn in one process, after one
that compiles; the peak memory is that of a process of its own, which fits a part of a larger map.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from fitting import fit_many, fit_map, simulate
from fitting.maps.cube import lazy
from tests.truth import textbook

ANGLE_DEG = np.linspace(20.0, 80.0, 30)
WAVELENGTH_UM = np.linspace(0.42, 0.8, 60)
FILM = "air | cauchy:2 60..900 nm | Si"
BOUNDS = {"A": (1.3, 1.8)}
SIGMA, WIDTH = 0.002, 500


class _Rows:
    """Random bare surfaces that are made when they are read, of any number of rows."""

    dtype, chunks = np.dtype(float), None

    def __init__(self, rows: int) -> None:
        self.shape = rows, WIDTH, 2, len(ANGLE_DEG)

    def __getitem__(self, index: tuple[slice, ...]) -> np.ndarray:
        rows, *others = index
        return np.stack([_row(i) for i in range(self.shape[0])[rows]])[:, *others]


def synthetic(rows: int) -> Any:
    """Return a cube of so many rows, of which nothing is made yet."""
    coords = {"quantity": ["R_s", "R_p"], "angle": ("angle", ANGLE_DEG, {"units": "deg"})}
    return lazy(_Rows(rows), ("y", "x", "quantity", "angle"), coords)


def _row(i: int) -> np.ndarray:
    random = np.random.default_rng(i)
    eta, k = random.uniform(0.2, 5.0, WIDTH), random.uniform(0.1, 4.0, WIDTH)
    p = textbook.reflectances(np.cos(np.deg2rad(ANGLE_DEG)), (eta + 1j * k)[:, None])
    exact = np.stack([p["R_s"], p["R_p"]], 1)
    return exact + SIGMA * random.standard_normal(exact.shape)


def _fastest(calls: dict[str, Callable[[], object]], rounds: int = 3) -> dict[str, float]:
    """Return the least seconds of each call, in turn."""
    times: dict[str, list[float]] = {name: [] for name in calls}
    for _ in range(rounds):
        for name, call in calls.items():
            begun = time.perf_counter()
            call()
            times[name].append(time.perf_counter() - begun)
    return {name: min(t) for name, t in times.items()}


def memory_mb(rows: int, blocks: int) -> float:
    """Return the peak memory of a process that fits the first blocks of a map of so many rows."""
    code = f"""
import tempfile
from benchmarks.speed import maps
from fitting.maps import map_store
every = map_store.MapStore.missing
map_store.MapStore.missing = lambda store: every(store)[:{blocks}]
with tempfile.TemporaryDirectory() as folder:
    maps.fit_map(maps.synthetic({rows}), out=folder + "/m.zarr", sigma=maps.SIGMA)
# Not ru_maxrss, which a process has from the one that started it.
print(open("/proc/self/status").read().partition("VmHWM:")[2].split()[0])
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return float(done.stdout) / 1024.0


def surfaces(curves: int, folder: Path, workers: bool) -> tuple[float, float]:
    """Print the rate of maps of bare surfaces; return curves a second and processors used."""
    rows = max(curves // WIDTH, 20)
    cube = np.concatenate([_row(i) for i in range(rows)]).reshape(rows, WIDTH, 2, -1)
    np.save(folder / "cube.npy", cube)
    known = {"sigma": SIGMA, "quantity": ("R_s", "R_p"), "angle_deg": ANGLE_DEG}
    count = iter(range(10**6))

    def on_disk(client: object = None) -> None:
        fit_map(folder / "cube.npy", out=folder / f"{next(count)}.zarr", client=client, **known)

    def in_memory() -> None:
        for i in range(0, rows, 20):
            R_s, R_p = np.moveaxis(cube[i : i + 20], 2, 0)
            fit_many(ANGLE_DEG, R_s=R_s, R_p=R_p, sigma=SIGMA)

    in_memory()
    seconds = _fastest({"in memory": in_memory, "on disk": on_disk})
    rate = rows * WIDTH / seconds["on disk"]
    print(f"| curves a second, bare surfaces, blocks of 10,000 | {rate:,.0f} |")
    print(
        f"| the same beside fit_many in memory | {seconds['in memory'] / seconds['on disk']:.2f} |"
    )
    if workers:
        import distributed

        times = {}
        for n in (1, 2):
            with (
                distributed.LocalCluster(n_workers=n, threads_per_worker=1, env={"NPROC": "1"},
                                         dashboard_address=None) as cluster,
                distributed.Client(cluster) as client,
            ):  # fmt: skip
                on_disk(client)
                times[n] = _fastest({"": lambda c=client: on_disk(c)})[""]
        print(f"| two workers of one core beside one | {times[1] / times[2]:.2f} |")
    return rate, os.cpu_count() or 1


def films(curves: int, folder: Path) -> None:
    """Print the rate of a map of films, and how many pixels are at another order than thorough."""
    rows = max(curves // WIDTH, 20)
    random = np.random.default_rng(2)
    y, x = np.mgrid[:rows, :WIDTH] / WIDTH
    thickness = 300.0 + 300.0 * ((y - 0.2) ** 2 + (x - 0.4) ** 2)
    table = np.linspace(thickness.min(), thickness.max(), 400)
    truth = {"A": 1.46, "B": 0.004}
    R = np.stack([simulate(FILM, {**truth, "thickness_nm": d}, 0.0, WAVELENGTH_UM, "R")
                  for d in table])  # fmt: skip
    nearest = np.argmin(np.abs(table - thickness[..., None]), -1)
    cube = R[nearest] + SIGMA * random.standard_normal((rows, WIDTH, len(WAVELENGTH_UM)))
    np.save(folder / "films.npy", cube)
    known = {"sigma": SIGMA, "quantity": "R", "angle_deg": 0.0, "wavelength_um": WAVELENGTH_UM,
             "bounds": BOUNDS}  # fmt: skip
    fit_map(folder / "films.npy", FILM, folder / "first.zarr", **known)
    for path in (folder / "first.zarr" / "status" / "c").iterdir():
        shutil.rmtree(path)
    begun = time.perf_counter()
    found = fit_map(folder / "films.npy", FILM, folder / "first.zarr", **known)
    rate = cube[..., 0].size / (time.perf_counter() - begun)
    print(f"| films a second, 60 wavelengths | {rate:,.0f} |")
    wrong = np.abs(found["thickness_nm"].values - table[nearest]) > 20.0
    print(f"| films 20 nm and more from the truth | {wrong.mean():.2e} |")


def main() -> None:
    """Print the table."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--curves", type=int, default=400_000)
    options.add_argument("--films", type=int, default=20_000)
    options.add_argument("--euros", type=float, default=0.04, help="of a core for an hour")
    options.add_argument("--without-workers", action="store_true")
    asked = options.parse_args()
    print("| figure | here |\n| --- | --- |")
    with tempfile.TemporaryDirectory() as name:
        rate, cores = surfaces(asked.curves, Path(name), not asked.without_workers)
        films(asked.films, Path(name))
    for rows, text in ((2_000, "1e6"), (200_000, "1e8")):
        print(f"| peak memory, first 20 blocks of {text} curves, MB | {memory_mb(rows, 20):.0f} |")
    hours = 1e9 / rate * cores / 3600.0
    print(f"| 1e9 bare surfaces: core hours, euros | {hours:.0f}, {hours * asked.euros:.1f} |")


if __name__ == "__main__":
    main()
