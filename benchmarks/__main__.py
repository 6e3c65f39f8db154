"""`python -m benchmarks`: measures, then writes table, JSON and charts to docs/benchmarks/."""

import argparse
import datetime
import importlib.metadata
import json
import os
import platform
import subprocess
import sys
import time
from pathlib import Path

from benchmarks import scenes
from benchmarks.accuracy import scene_errors
from benchmarks.contestants import CONTESTANTS, LIMIT
from benchmarks.machine import cores
from benchmarks.speed import bsdf, turns
from benchmarks.speed.report import main_platform, markdown

PACKAGES = (
    *("jax", "jaxlib", "numpy", "numba", "tmm", "tmm_fast", "torch", "tmmax", "jaxlayerlumos"),
    *("pyElli", "PyMoosh", "mitsuba"),
)


def machine() -> dict:
    """What the figures depend on."""
    versions = {}
    for package in PACKAGES:
        try:
            versions[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            continue
    return {
        "date": datetime.date.today().isoformat(),
        "processor": _processor(),
        "cores": cores(),
        "load_before": os.getloadavg()[0] if hasattr(os, "getloadavg") else None,
        "system": f"{platform.system()} {platform.machine()}, Python {platform.python_version()}",
        "versions": versions,
    }


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor()
    facts = dict(line.split(":", 1) for line in lines if ":" in line)
    facts = {k.strip(): v.strip() for k, v in facts.items()}
    name = f"{facts.get('model name', '?')}, family {facts.get('cpu family')}, "
    widest = "AVX-512" if "avx512f" in facts.get("flags", "") else "no AVX-512"
    return name + f"model {facts.get('model')}, {widest}"


def gpu() -> str:
    """The name of the GPU that jax sees, or "" (asked in another process: it would keep memory)."""
    question = "import jax; print(*(d.device_kind for d in jax.devices('gpu')[:1]))"
    answer = subprocess.run([sys.executable, "-c", question], capture_output=True, text=True)
    return answer.stdout.strip() if answer.returncode == 0 else ""


def errors_of(processes: dict, dtype: str) -> dict:
    """{name: {scene: errors}} of the contestants that take part in a class."""
    table = {}
    for name, process in processes.items():
        if process.contestant.family == LIMIT or process.contestant.variant:
            continue
        table[name] = {}
        for scene in scenes.CLASSES:
            if turns.takes_part(process.contestant, dtype, scene in scenes.LOSSLESS):
                answer = process.ask(do="evaluate", scene=scene)
                failed = "failed" in answer
                table[name][scene] = (
                    answer if failed else scene_errors.errors(scene, dtype, answer["R"])
                )
    return table


def main():
    parser = argparse.ArgumentParser(prog="benchmarks", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("docs/benchmarks"))
    parser.add_argument("--rounds", type=int, default=4, help="rounds of interleaved timing")
    parser.add_argument("--quick", action="store_true", help="2 rounds, no size above 1e6")
    parser.add_argument("--only", nargs="*", metavar="NAME", help="names of contestants")
    parser.add_argument(
        "--platform", nargs="*", choices=["cpu", "gpu"], help="those that jax finds are the default"
    )
    parser.add_argument("--chart-only", action="store_true", help="draw again what was measured")
    options = parser.parse_args()
    data_file = options.out / "benchmarks.json"
    if options.chart_only:
        results = json.loads(data_file.read_text())
    else:
        results = run(options)
        options.out.mkdir(parents=True, exist_ok=True)
        data_file.write_text(json.dumps(results, indent=1) + "\n")
    (options.out / "benchmarks.md").write_text(markdown(results))
    from benchmarks.speed.chart import draw
    from benchmarks.speed.overview import draw_overview

    for where in sorted({x["platform"] for x in results["runs"]}):
        draw(results, options.out, where)
    draw_overview(results, options.out / "overview.png", main_platform(results))
    print(f"wrote {data_file}, benchmarks.md and the charts beside it")
    if not options.chart_only and not options.only:
        bsdf.run(options.out, 2 if options.quick else options.rounds, machine())


def run(options) -> dict:
    started = time.perf_counter()
    sizes = [n for n in turns.SIZES if n <= 1_000_000] if options.quick else turns.SIZES
    rounds = 2 if options.quick else options.rounds
    if options.only and turns.REFERENCE not in options.only:
        options.only.append(turns.REFERENCE)
    results = {"machine": machine(), "rounds": rounds, "left_out": {}, "runs": []}
    results["families"] = {x.name: x.family for x in CONTESTANTS}
    results["one_material"] = [x.name for x in CONTESTANTS if x.one_material]
    if gpu():
        results["machine"]["gpu"] = gpu()
    for where in options.platform or (["cpu", "gpu"] if gpu() else ["cpu"]):
        for dtype in ("float64", "float32"):
            processes, left_out = turns.start(dtype, where, options.only)
            results["left_out"] |= left_out
            print(f"{where} {dtype}: {len(processes)} contestants", flush=True)
            results["runs"].append(
                {
                    "platform": where,
                    "dtype": dtype,
                    "errors": errors_of(processes, dtype),
                    "lossless": turns.measure(processes, True, rounds, sizes),
                    "lossy": turns.measure(processes, False, rounds, sizes),
                }
            )
            for process in processes.values():
                process.close()
            print(f"  {time.perf_counter() - started:.0f} s", flush=True)
    for name, reason in results["left_out"].items():
        print(f"left out: {name}: {reason}")
    return results


if __name__ == "__main__":
    main()
