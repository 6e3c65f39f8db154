"""Where the time of one `fresnel-fit FILE` goes: `python -m benchmarks.speed.startup`.

Runs the command in processes of its own: once with an empty cache folder (the first time ever, or
after an update), then several times with what that left behind. Prints, for the first and for the
median of the later ones, the seconds of each stage, and the wall and processor time of the plain
command. Run it on a quiet machine.
"""

from __future__ import annotations

import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.machine import cores

ROOT = Path(__file__).resolve().parents[2]
GOLD = ROOT / "examples" / "data" / "gold_532nm.csv"
AGAIN = 7

# The stages of cli._run, one after another, each timed from the end of the one before. The first
# begins when the parent starts the process.
STAGES = f"""
import sys, time
marks = [("start", float(sys.argv[1]))]
def mark(name):
    marks.append((name, time.time()))
mark("start of Python")
from fitting.command import cli
cli.parser().parse_args([{str(GOLD)!r}])
mark("options")
from fitting.process.start_up import set_up_jax
import numpy
mark("import numpy")
import jax
mark("import jax")
set_up_jax()
mark("set up jax")
from fitting.measured_file import read_csv
measurement = read_csv({str(GOLD)!r})
mark("read the file")
from fitting.fits import fit
mark("import fitting.fits" + " and optimistix" * ("optimistix" in sys.modules))
result = fit(measurement)
mark("fit, first call")
text = str(result)
mark("table")
fit(measurement)
mark("(fit once more)")
for (_, before), (name, after) in zip(marks, marks[1:]):
    print(f"{{name}}\\t{{after - before}}")
"""


def stages(environment: dict[str, str]) -> dict[str, float]:
    """Return stage -> seconds of one process."""
    done = subprocess.run(
        [sys.executable, "-c", STAGES, repr(time.time())],
        env=environment, cwd=ROOT, check=True, capture_output=True, text=True,
    )  # fmt: skip
    lines = (line.split("\t") for line in done.stdout.splitlines())
    return {name: float(seconds) for name, seconds in lines}


def command(environment: dict[str, str]) -> tuple[float, float]:
    """Return wall and processor seconds of the command itself."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    start = time.perf_counter()
    subprocess.run(
        [sys.executable, "-m", "fitting", str(GOLD), "--quiet"],
        env=environment, cwd=ROOT, check=True,
    )  # fmt: skip
    wall = time.perf_counter() - start
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    """Measure and print."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    command(
        {**environment, "XDG_CACHE_HOME": "/dev/null"}
    )  # byte code is compiled once and for all
    print(f"load average {os.getloadavg()[0]:.1f}, {cores()} processors")
    with tempfile.TemporaryDirectory() as folder:
        environment["XDG_CACHE_HOME"] = folder
        first_stages = stages(environment)
        later_stages = [stages(environment) for _ in range(AGAIN)]
    with tempfile.TemporaryDirectory() as folder:
        environment["XDG_CACHE_HOME"] = folder
        first = command(environment)
        later = [command(environment) for _ in range(AGAIN)]
        size = sum(p.stat().st_size for p in Path(folder).rglob("*") if p.is_file())
    median = {
        name: statistics.median(run.get(name, 0.0) for run in later_stages)
        for name in dict.fromkeys([*first_stages, *later_stages[0]])
    }
    print(f"{'seconds':34}{'first':>8}{'later':>8}")
    for name, seconds in median.items():
        print(f"{name:34}{first_stages.get(name, 0.0):8.3f}{seconds:8.3f}")
    for i, kind in enumerate(("wall", "processor")):
        middle, least = statistics.median(run[i] for run in later), min(run[i] for run in later)
        print(f"{f'command, {kind} time':34}{first[i]:8.3f}{middle:8.3f}  (least {least:.3f})")
    print(f"cache {size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
