"""Rough dielectric and conductor beside Mitsuba: `python -m benchmarks.speed.bsdf`.

Writes to docs/benchmarks; `python -m benchmarks` runs it too. One process per contestant, asked in
turn: a round asks every contestant once for every job, and ratios are medians of those within
rounds.
"""

import contextlib
import json
import sys
from pathlib import Path

from benchmarks.contestants import OURS, PEER, Contestant
from benchmarks.speed.turns import Process, in_rounds
from benchmarks.speed.worker import options_of, serve

SIZES = (10_000, 100_000, 1_000_000)
JOBS = ("sample", "evaluate", "density", "evaluate and density")
ALPHA, ETA, GOLD = 0.3, 1.5, (0.2, 3.9)
REFERENCE, MITSUBA, OF_MITSUBA = "fresnel_jax", "Mitsuba LLVM", 0.4
KEPT = "fresnel_jax, memory kept"
IN_BLOCKS, BLOCK = "fresnel_jax, in blocks", 50_000
CONTESTANTS = (
    Contestant(REFERENCE, OURS),
    Contestant(KEPT, OURS),
    Contestant(IN_BLOCKS, OURS),
    Contestant(MITSUBA, PEER, package="mitsuba", dtypes=("float32",)),
)


def inputs(dtype: str, size: int):
    """wo and wi over the whole sphere, and three random numbers; components first."""
    import numpy as np

    rng = np.random.default_rng(size)
    wo, wi = (rng.standard_normal((3, size)) for _ in range(2))
    return tuple(
        x.astype(dtype) for x in (wo / np.linalg.norm(wo, axis=0), wi / np.linalg.norm(wi, axis=0))
    ) + (rng.random(size).astype(dtype), rng.random((2, size)).astype(dtype))


def ours(dtype: str, way: str):
    """run(model, job, size) -> a callable without arguments that does the work once."""
    from fresnel_jax.performance import in_blocks, keep_memory

    if way == KEPT and not keep_memory():
        raise SystemExit("memory cannot be kept: the C library is not glibc")
    import jax
    import jax.numpy as jnp
    import numpy as np

    from fresnel_jax import bsdf

    jax.config.update("jax_enable_x64", dtype == "float64")
    one = np.dtype(dtype).type
    facets = bsdf.TrowbridgeReitz(one(ALPHA))
    models = {
        "dielectric": bsdf.Dielectric(one(ETA), facets),
        "conductor": bsdf.conductor(one(GOLD[0]), one(GOLD[1]), facets),
    }
    jobs = {
        "sample": lambda model, wo, wi, u_lobe, u: model.sample(wo, u_lobe, u),
        "evaluate": lambda model, wo, wi, u_lobe, u: model.evaluate(wo, wi),
        "density": lambda model, wo, wi, u_lobe, u: model.density(wo, wi),
    }
    jobs["evaluate and density"] = lambda *x: (jobs["evaluate"](*x), jobs["density"](*x))

    def compiled(job):
        if way != IN_BLOCKS:
            return jax.jit(job)
        return jax.jit(lambda model, *x: in_blocks(lambda *y: job(model, *y), *x, points=BLOCK))

    programs = {name: compiled(job) for name, job in jobs.items()}

    def prepare(model, job, size):
        wo, wi, u_lobe, u = inputs(dtype, size)
        given = tuple(jnp.asarray(x) for x in (wo.T, wi.T, u_lobe, u.T))
        return lambda: jax.block_until_ready(programs[job](models[model], *given))

    return prepare


def mitsuba(dtype: str):
    """The same by Mitsuba; its value is multiplied by the cosine."""
    from benchmarks.peers import Mitsuba

    Mitsuba(dtype)  # finds LLVM and chooses the variant
    import drjit as dr
    import mitsuba as mi

    common = {"distribution": "ggx", "alpha": ALPHA}
    models = {
        "dielectric": {"type": "roughdielectric", "int_ior": ETA, "ext_ior": 1.0} | common,
        "conductor": {"type": "roughconductor", "eta": GOLD[0], "k": GOLD[1]} | common,
    }
    models = {name: mi.load_dict(model) for name, model in models.items()}
    context = mi.BSDFContext()

    def prepare(model, job, size):
        wo, wi, u_lobe, u = inputs(dtype, size)
        surface = dr.zeros(mi.SurfaceInteraction3f, size)
        surface.wi = mi.Vector3f(wo)  # Mitsuba's wi is the known direction
        wi, u_lobe, u = mi.Vector3f(wi), mi.Float(u_lobe), mi.Point2f(u)
        dr.eval(surface, wi, u_lobe, u)
        method = {
            "sample": lambda: models[model].sample(context, surface, u_lobe, u),
            "evaluate": lambda: models[model].eval(context, surface, wi),
            "density": lambda: models[model].pdf(context, surface, wi),
            "evaluate and density": lambda: models[model].eval_pdf(context, surface, wi),
        }[job]

        def run():
            dr.eval(method())
            dr.sync_thread()

        return run

    return prepare


def work(name: str, dtype: str):
    """A contestant's process."""
    with contextlib.redirect_stdout(sys.stderr):
        prepare = mitsuba(dtype) if name.startswith("Mitsuba") else ours(dtype, name)
    serve(prepare)


def measure(rounds: int) -> dict:
    """{dtype: {model: {job: {size: {contestant: {"s": ..., "to_reference": ...}}}}}}."""
    results, left_out = {}, {}
    for dtype in ("float32", "float64"):
        processes = {}
        for contestant in CONTESTANTS:
            if dtype in contestant.dtypes and contestant.installed():
                process = Process(contestant, dtype, "cpu", ("benchmarks.speed.bsdf", "--worker"))
                processes[contestant.name] = process
            elif dtype in contestant.dtypes:
                left_out[contestant.name] = f"{contestant.package} is not installed"
        for name in list(processes):
            answer = processes[name].answer()
            if "failed" in answer:
                left_out[name] = answer["failed"]
                processes.pop(name).close()
        table = results[dtype] = {}
        for model in ("dielectric", "conductor"):
            for job in JOBS:
                for size in SIZES:
                    # below a block both are one program
                    some = {n: p for n, p in processes.items() if n != IN_BLOCKS or size > BLOCK}
                    asked = {"asked": (model, job, size), "seconds": 0.03}
                    found = table.setdefault(model, {}).setdefault(job, {})
                    found[str(size)] = in_rounds(some, asked, rounds, REFERENCE)
        for process in processes.values():
            process.close()
    return {"rounds": rounds, "left_out": left_out, "times": results}


def markdown(results: dict) -> str:
    """The tables: Mpoint/s, and how often Mitsuba's time fits ours."""
    machine, parts = results["machine"], []
    for dtype, models in results["times"].items():
        names = list(next(iter(next(iter(models.values())).values()))[str(SIZES[-1])])
        others = [name for name in names if name != REFERENCE]
        head = ["model, job, points", *(f"{x}, Mpt/s" for x in names)]
        head += [f"time of {x} / ours" for x in others]
        parts += [f"## {dtype}\n", "| " + " | ".join(head) + " |\n|" + " --- |" * len(head)]
        for model, jobs in models.items():
            for job, sizes in jobs.items():
                for size, found in sizes.items():
                    row = [f"rough {model}, {job}, {int(size):.0e}".replace("e+0", "e")]
                    for x in names:
                        row.append(f"{int(size) / found[x]['s'] / 1e6:.3g}" if x in found else "")
                    for x in others:
                        row.append(f"{found[x]['to_reference']:.2f}" if x in found else "")
                    parts.append("| " + " | ".join(row) + " |")
        parts.append("")
    parts.append(_aims(results["times"]))
    head = (
        "# Rough surfaces: speed\n\nMade by `make bench` (`python -m benchmarks.speed.bsdf`).\n\n"
        f"{machine['date']}; {machine['processor']}; {machine['cores']} cores, load "
        f"{machine['load_before']:.1f} before the run; {machine['system']}. Fastest calls and "
        f"median ratios of {results['rounds']} interleaved rounds; trust ratios. A ratio above 1: "
        "ours is faster. Directions over the whole sphere, "
        f"roughness {ALPHA}, eta = {ETA}; gold for the conductor. Ours takes and gives directions "
        "as (n, 3) and also gives index ratio, flags and validity; Mitsuba stores components "
        "apart and computes in float32 only. 'Memory kept': after `keep_memory`; 'in blocks': by "
        f"`in_blocks(..., points={BLOCK})`, so that intermediate arrays stay in the cache, on one "
        "core ([speed](../speed.md)); Mitsuba compiles each job to one loop, whose "
        "intermediates stay in registers.\n\n"
    )
    tail = "".join(f"\nLeft out: {name}: {why}.\n" for name, why in results["left_out"].items())
    return head + "\n".join(parts) + tail


def _aims(times: dict) -> str:
    """The aim for single precision, and what the better of our ways reaches."""
    rows = []
    for model, jobs in times.get("float32", {}).items():
        for job, sizes in jobs.items():
            for size in ("100000", "1000000"):
                found = sizes.get(size, {})
                if MITSUBA not in found:
                    continue
                shares = {x: found[MITSUBA]["s"] / found[x]["s"] for x in found if x != MITSUBA}
                best = max(shares, key=lambda x: shares[x])
                met = "yes" if shares[best] >= OF_MITSUBA else "no"
                what = f"rough {model}, {job}, {float(size):.0e}"
                rows.append(f"| {what} | {shares[best]:.2f} | {best} | {met} |")
    if not rows:
        return ""
    head = f"| float32 | speed over Mitsuba's, aim {OF_MITSUBA:g} | by | met |\n" + "| --- " * 4
    return "## Aims\n\n" + "\n".join([head + "|", *rows]) + "\n"


def run(out: Path, rounds: int, machine: dict):
    """Measures and writes bsdf.json and bsdf.md."""
    results = {"machine": machine} | measure(rounds)
    out.mkdir(parents=True, exist_ok=True)
    (out / "bsdf.json").write_text(json.dumps(results, indent=1) + "\n")
    (out / "bsdf.md").write_text(markdown(results))
    print(f"wrote {out / 'bsdf.json'} and bsdf.md")


def main():
    options = options_of("benchmarks.speed.bsdf", __doc__, work)
    from benchmarks.__main__ import machine

    return run(options.out, options.rounds, machine())


if __name__ == "__main__":
    main()
