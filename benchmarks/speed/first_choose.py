"""Seconds of a first `choose`, when nothing is compiled yet, and of the same call once more.

Each measurement runs in a process of its own without a cache. Those of ../shared/data, which are
not distributed, are left out where that folder is missing. psi and Delta are simulated, with noise:
of two oscillators, and of silicon as it is tabulated, which no model here describes. Those of the
films of WVASE were computed by that program, without noise. Run it on a quiet machine:
`python -m benchmarks.speed.first_choose`.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.machine import cores
from fitting import Measurement, choose, read_csv, simulate

ROOT = Path(__file__).resolve().parents[2]
MEASURED = ROOT.parent / "shared" / "data"
NOISE_DEG = 0.03
OSCILLATORS = {
    "eps_inf": 2.0, "strength_ev2_1": 30.0, "resonance_ev_1": 3.8, "width_ev_1": 0.6,
    "strength_ev2_2": 20.0, "resonance_ev_2": 5.0, "width_ev_2": 1.0,
}  # fmt: skip
DIAMOND = "diamond_film_on_glass/diamond_286nm_on_glass_R.csv"
HAFNIA = "hafnia_film_psi_delta/hafnia_on_silica_60deg_psi_delta.csv"
WOOD = "diffuse_wood_ir/FSRI_Wood_REFLECTIVITY_R1.csv"
WVASE = "wvase_films/WVASE_"
SILICA, SILICON = (MEASURED / f"wvase_films/materials/{name}.csv" for name in ("silica", "silicon"))


class Case(NamedTuple):
    """A measurement and what is asked of it; file: below `MEASURED`, none of a simulated one."""

    name: str
    file: str
    measurement: Callable[[], Measurement]
    sample: str = "auto"


def _file(name: str, file: str, sample: str = "auto", angle_deg: float | None = None) -> Case:
    return Case(name, file, lambda: read_csv(MEASURED / file, angle_deg=angle_deg), sample)


def _wvase(name: str, film: str, sample: str) -> Case:
    """Return a case of a file of wavelength (nm), angle, psi and Delta below a header, or none."""

    def measurement() -> Measurement:
        lines = (MEASURED / f"{WVASE}{film}.txt").read_text().splitlines()
        numbers = [row for line in lines if len(row := line.split()) == 4 and row[0].isdigit()]
        wavelength_nm, angle, psi, delta = np.array(numbers, float).T
        return Measurement.from_columns(angle, 1e-3 * wavelength_nm, psi=psi, delta=delta % 360.0)

    return Case(name, f"{WVASE}{film}.txt", measurement, f"{sample} | {SILICON}")


def _within(m: Measurement, low_um: float, high_um: float) -> Measurement:
    return m.where((m.wavelength_um >= low_um) & (m.wavelength_um <= high_um))


def _psi_delta(of: str, values: dict[str, float], *angles: float) -> Measurement:
    """Return psi and Delta of a surface at 100 wavelengths and some angles, with noise."""
    wavelength, angle = (a.ravel() for a in np.meshgrid(np.linspace(0.3, 0.8, 100), angles))
    rng, seen = np.random.default_rng(0), {}
    for quantity in ("psi", "delta"):
        exact = simulate(of, values, angle, wavelength, quantity)
        seen[quantity] = exact + rng.normal(0.0, NOISE_DEG, exact.shape)
    sigma = dict.fromkeys(seen, NOISE_DEG)
    return Measurement.from_columns(angle, wavelength, sigma=sigma, **seen)


FIVE = (55.0, 60.0, 65.0, 70.0, 75.0)
CASES = (
    _file("silver mirror, R", "metal_mirror/reflection_EKSMA_Ag.csv", angle_deg=0.0),
    _file("aluminium mirror, R", "metal_mirror/reflection_EKSMA_Al.csv", angle_deg=0.0),
    _file("glass plate, R and T", "glass_slab_RT/clear_glass_3mm_RT.csv",
          "air | auto 3 mm thick | air"),
    Case("two oscillators, psi and Delta", "", lambda: _psi_delta("lorentz:2", OSCILLATORS, 70.0)),
    Case("the same at five angles", "", lambda: _psi_delta("lorentz:2", OSCILLATORS, *FIVE)),
    Case("silicon, psi and Delta at five angles", "", lambda: _psi_delta("silicon", {}, *FIVE)),
    Case("diamond film, R, 420 to 800 nm", DIAMOND,
         lambda: _within(read_csv(MEASURED / DIAMOND), 0.42, 0.8), "air | auto 5..2000 nm | 1.53"),
    _file("diamond film, R, all", DIAMOND, "air | auto 5..2000 nm | 1.53"),
    Case("hafnia film, psi and Delta", HAFNIA,
         lambda: _within(read_csv(MEASURED / HAFNIA, angle_deg=60.0), 0.33, 2.0),
         "air | auto 5..2000 nm | fused silica"),
    _file("wood, R at 6,898 wavelengths", WOOD, angle_deg=0.0),
    _wvase("polymer film, dry", "example_2nmSiO2_20nmPNIPAM_MultiWavelength",
           f"air | auto 1..200 nm | {SILICA} 2 nm held"),
    _wvase("polymer film in water", "example_2nmSiO2_20nmPNIPAM_50EMA_MultiWavelength",
           f"1.33 | auto 1..200 nm | {SILICA} 2 nm held"),
    _wvase("silica film in water", "example_3nmSiO2_30EMA_MultiWavelength", "1.33 | auto 1..50 nm"),
    _wvase("gold film", "example_2nmSiO2_117nmAu_MultiWavelength",
           f"air | auto 5..500 nm | {SILICA} 2 nm held"),
    _wvase("gold film, oxide free too", "example_2nmSiO2_117nmAu_MultiWavelength",
           f"air | auto 5..500 nm | {SILICA} 1..50 nm"),
    _wvase("metal film, oxide free too", "example_10nmSiO2_325nmAl2O3_MultiWavelength",
           f"air | auto 50..2000 nm | {SILICA} 1..50 nm"),
    _wvase("absorbing film, seven angles",
           "TaucLorentz_example_350nmFilm_MultiWavelength_MultiAngle",
           f"air | auto 50..1000 nm | {SILICA} 3 nm held"),
)  # fmt: skip


def seconds(case: Case) -> tuple[float, float, str]:
    """Return the seconds of the first call and of the next one, and what was taken."""
    measurement, times = case.measurement(), []
    for _ in range(2):
        start = time.perf_counter()
        taken = choose(measurement, case.sample).taken
        times.append(time.perf_counter() - start)
    return times[0], times[1], taken.key.label


def main() -> None:
    """Measure and print."""
    if len(sys.argv) > 1:
        print(json.dumps(seconds(CASES[int(sys.argv[1])])))
        return
    print(f"load average {os.getloadavg()[0]:.1f}, {cores()} processors, seconds")
    print(f"{'data':42}{'first':>8}{'again':>8}  taken")
    for i, case in enumerate(CASES):
        if case.file and not (MEASURED / case.file).exists():
            print(f"{case.name:42}{'(not here)':>16}")
            continue
        done = subprocess.run(
            [sys.executable, "-m", "benchmarks.speed.first_choose", str(i)],
            cwd=ROOT, check=True, capture_output=True, text=True,
        )  # fmt: skip
        first, again, taken = json.loads(done.stdout)
        print(f"{case.name:42}{first:8.1f}{again:8.1f}  {taken}", flush=True)


if __name__ == "__main__":
    main()
