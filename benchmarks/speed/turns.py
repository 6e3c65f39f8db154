"""Timing: one process per contestant, asked in turn, so that all meet the same machine.

A round asks every contestant once for every job; ratios are taken within a round and the median
over rounds is kept, so that what disturbs the machine for a while disturbs both sides of a ratio.
"""

import contextlib
import json
import os
import select
import statistics
import subprocess
import sys
from pathlib import Path

from benchmarks.contestants import CONTESTANTS, OURS, PRINTED, TIER, Contestant

SIZES = (1, 100, 1_000, 10_000, 100_000, 1_000_000, 10_000_000)
LARGE_SIZES = (100_000, 1_000_000)
MAIN_SIZE = 1_000_000
REFERENCE = "reflectance"
# A call that is expected to take longer is not made: the table then shows the largest size done.
LONGEST_CALL_S = 0.4
LONGEST_ANSWER_S = 180
ROOT = Path(__file__).resolve().parents[2]


class Process:
    """A contestant at work; `ask` sends a command and waits for its answer."""

    def __init__(
        self,
        contestant: Contestant,
        dtype: str,
        platform: str,
        module: tuple[str, ...] = ("benchmarks.speed.worker",),
    ):
        self.contestant, self.dtype = contestant, dtype
        environment = os.environ | {"JAX_PLATFORMS": {"gpu": "cuda"}.get(platform, platform)}
        # on a GPU every process would else take most of its memory at once
        environment |= {"XLA_PYTHON_CLIENT_PREALLOCATE": "false"} | contestant.environment
        self._process = subprocess.Popen(
            [sys.executable, "-W", "ignore", "-m", *module, contestant.name, dtype],
            cwd=ROOT,
            env=environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )

    def ask(self, **command) -> dict:
        try:
            self._process.stdin.write(json.dumps(command) + "\n")
            self._process.stdin.flush()
        except (BrokenPipeError, ValueError):
            return {"failed": "the process has ended"}
        return self.answer()

    def answer(self) -> dict:
        ready, _, _ = select.select([self._process.stdout], [], [], LONGEST_ANSWER_S)
        if not ready:
            self._process.kill()
            return {"failed": f"no answer within {LONGEST_ANSWER_S} s"}
        line = self._process.stdout.readline()
        return json.loads(line) if line else {"failed": "the process has ended"}

    def close(self):
        with contextlib.suppress(BrokenPipeError):
            self._process.stdin.close()
        self._process.wait(timeout=30)


def takes_part(contestant: Contestant, dtype: str, lossless: bool) -> bool:
    return dtype in contestant.dtypes and (contestant.lossless if lossless else contestant.lossy)


def start(dtype: str, platform: str, only: list[str] | None) -> tuple[dict[str, Process], dict]:
    """The processes that came up, by name, and why the others did not."""
    processes, left_out = {}, {}
    for contestant in CONTESTANTS:
        on_this = platform == "cpu" or contestant.runs_on_gpu
        if dtype not in contestant.dtypes or not on_this:
            continue
        if only and contestant.name not in only:
            continue
        if not contestant.installed():
            left_out[contestant.name] = f"{contestant.package} is not installed"
            continue
        processes[contestant.name] = Process(contestant, dtype, platform)
    for name, process in list(processes.items()):
        answer = process.answer()
        if "failed" in answer:
            left_out[name] = answer["failed"]
            processes.pop(name).close()
    return processes, left_out


def jobs(contestant: Contestant, lossless: bool, sizes) -> list[tuple[str, int]]:
    """What a contestant is timed at: (what, size)."""
    large = [size for size in sizes if size in LARGE_SIZES]
    largest = max(sizes, key=lambda size: size if size <= MAIN_SIZE else 0)
    mine = [size for size in sizes if size >= LARGE_SIZES[0]] if contestant.large_only else sizes
    listed = [("value", size) for size in mine]
    if contestant.family in (OURS, PRINTED, TIER) or contestant.package == "tmmax":
        listed += [("gradient", size) for size in large]
    if contestant.loss and not lossless:
        kinds = ("one material value", "one material gradient", "loss", "loss gradient")
        listed += [(kind, largest) for kind in kinds]
    return listed


def measure(processes: dict[str, Process], lossless: bool, rounds: int, sizes=SIZES) -> dict:
    """{name: {"first call": ..., "value 1000": {"s": fastest, "to_reference": ratio}, ...}}."""
    names = [n for n, p in processes.items() if takes_part(p.contestant, p.dtype, lossless)]
    tables = {}
    for name in names:
        answer = processes[name].ask(do="first", lossless=lossless, size=1_000)
        tables[name] = {"first call": answer} if "failed" not in answer else {}
    todo = {
        name: jobs(processes[name].contestant, lossless, sizes) for name in names if tables[name]
    }
    per_point = {}  # seconds, by name and what: whether a call at the next size is affordable
    for job in sorted({job for listed in todo.values() for job in listed}, key=lambda j: j[1]):
        what, size = job
        takers = [n for n in todo if job in todo[n]]
        # A call of few points may be nearly all overhead: that of 1,000 was made already.
        known = {n: tables[n]["first call"]["second_s"] * max(1.0, size / 1_000) for n in takers}
        takers = [
            n
            for n in takers
            if min(known[n], per_point.get((n, what), 0.0) * size) < LONGEST_CALL_S
        ]
        times = {name: [] for name in takers}
        for number in range(rounds):
            # every other round backwards: nobody always follows the same neighbour
            for name in takers if number % 2 == 0 else takers[::-1]:
                command = {"what": what, "lossless": lossless, "size": size, "seconds": 0.005}
                answer = processes[name].ask(do="time", **command)
                if "failed" in answer:
                    per_point[name, what] = float("inf")
                    tables[name][f"{what} {size}"] = answer
                    continue
                times[name].append(answer["s"])
        for name, taken in times.items():
            if taken:
                per_point[name, what] = min(taken) / size
                tables[name][f"{what} {size}"] = _summary(taken, times.get(REFERENCE))
    return tables


def _summary(times, reference) -> dict:
    summary = {"s": min(times), "median_s": statistics.median(times)}
    if reference and len(reference) == len(times):
        pairs = zip(times, reference, strict=True)
        summary["to_reference"] = statistics.median(t / r for t, r in pairs)
    return summary


def in_rounds(processes: dict[str, Process], asked, rounds: int, reference: str) -> dict:
    """{name: {"s": fastest, "to_reference": median ratio in rounds}} of workers that `serve`."""
    times = {name: [] for name in processes}
    for number in range(rounds):
        names = list(processes)
        # every other round backwards: nobody always follows the same neighbour
        for name in names if number % 2 == 0 else names[::-1]:
            times[name].append(processes[name].ask(**asked).get("s", float("nan")))
    return {
        name: {
            "s": min(taken),
            "to_reference": statistics.median(
                t / r for t, r in zip(taken, times[reference], strict=True)
            ),
        }
        for name, taken in times.items()
    }
