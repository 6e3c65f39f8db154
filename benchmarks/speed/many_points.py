"""A million points and more: what becomes of the speed, and what each way out brings.

    python -m benchmarks.speed.many_points --out docs/benchmarks

Writes many_points.md and many_points.png. Each way is a process of its own, asked in turn: `WAYS`.
"""

import math

from benchmarks import scenes
from benchmarks.contestants import OURS, Contestant
from benchmarks.machine import cores
from benchmarks.speed.many_points_chart import draw
from benchmarks.speed.turns import Process, in_rounds
from benchmarks.speed.worker import options_of, serve

CORES = cores()
PLAIN, KEPT = "as it comes", "memory kept"
WAYS = {
    PLAIN: "the plain call",
    KEPT: "the plain call after `keep_memory()`",
    "kept late": "the same settings of the allocator, told after jax has begun",
    "in blocks": "`in_blocks`: `lax.map` or `lax.scan` over blocks of 2^17 points",
    "in place": "`lax.fori_loop` over such blocks, each written into its place of one array",
    "all cores": "`in_blocks` in `jax.shard_map` over one CPU device for each core (`XLA_FLAGS`)",
    "threads": "one call for each block, by a pool of threads in Python",
}
BLOCK = 2**17
SIZES = (10_000, 100_000, 1_000_000, 10_000_000)
LARGE = SIZES[2:]
VALUES = ("reflectance", "powers", "amplitudes")
ELEMENTWISE, LOSS = "one material, with gradient", "loss with gradient"
CHARTED = (*VALUES, "lossy, with gradient")
JOBS = (*CHARTED, "lossless", "lossless, with gradient", ELEMENTWISE, LOSS)


def worker(way: str, dtype: str):
    """A process: everything in one way."""
    from fresnel_jax import performance

    if way == KEPT and not performance.keep_memory():
        raise SystemExit("memory cannot be kept: the C library is not glibc")
    import jax

    jax.config.update("jax_enable_x64", dtype == "float64")
    jax.block_until_ready(jax.numpy.ones(10) + 1.0)
    if way == "kept late":
        performance._keep()
    serve(preparing(way, dtype))


def preparing(way: str, dtype: str):
    """prepare(job, size) -> a callable without arguments that does the work once."""
    import jax
    import jax.numpy as jnp
    import numpy as np

    from benchmarks.speed.operations import with_gradient
    from fresnel_jax import amplitudes, powers, reflectance
    from fresnel_jax.performance import in_blocks

    mesh = jax.make_mesh((jax.device_count(),), ("points",))
    split = jax.sharding.PartitionSpec("points")
    eta, k = (np.dtype(dtype).type(x) for x in scenes.ONE_MATERIAL)

    def square(cosine, eta, k):
        return (reflectance(cosine, eta, k) - 0.5 * cosine) ** 2

    def loss(eta, k, cosine):
        def of_points(c):
            return square(c, eta, k)

        if way in ("in blocks", "all cores"):
            return in_blocks(of_points, cosine, total=True)
        return of_points(cosine).sum()

    functions = {
        "reflectance": reflectance,
        "powers": powers,
        "amplitudes": amplitudes,
        "lossless": reflectance,
        "lossless, with gradient": with_gradient(reflectance, 2),
        "lossy, with gradient": with_gradient(reflectance, 3),
        ELEMENTWISE: lambda c: jax.vmap(
            jax.value_and_grad(square, argnums=(1, 2)), (0, None, None)
        )(c, eta, k),
    }

    def compiled(function):
        if way == "in blocks":
            return jax.jit(lambda *x: in_blocks(function, *x))
        if way == "in place":
            return jax.jit(_in_place(function))
        if way == "threads":
            return _by_threads(jax.jit(function))
        if way != "all cores":
            return jax.jit(function)

        def of_core(*x):
            return in_blocks(function, *x)

        return jax.jit(
            jax.shard_map(of_core, mesh=mesh, in_specs=split, out_specs=split, check_vma=False)
        )

    def prepare(job, size):
        count = 1 if job in (ELEMENTWISE, LOSS) else 3
        given = scenes.timed(job.startswith("lossless"), dtype, size)[:count]
        given = tuple(jnp.asarray(x) for x in given)
        if way == "all cores" and job != LOSS:
            sharding = jax.sharding.NamedSharding(mesh, split)
            given = tuple(jax.device_put(x, sharding) for x in given)
        if job == LOSS:
            program, given = jax.jit(jax.value_and_grad(loss, argnums=(0, 1))), (eta, k, *given)
        else:
            program = compiled(functions[job])
        return lambda: jax.block_until_ready(program(*given))

    return prepare


def _in_place(function):
    """The function over blocks, the last of which goes back over points that are done."""
    import jax
    from jax import lax

    def of_blocks(*arrays):
        number = len(arrays[0])
        size = min(BLOCK, number)

        def block(i, results):
            at = jax.numpy.minimum(i * size, number - size)
            found = function(*(lax.dynamic_slice_in_dim(x, at, size) for x in arrays))
            return jax.tree.map(
                lambda a, x: lax.dynamic_update_slice_in_dim(a, x, at, 0), results, found
            )

        of_one = jax.eval_shape(function, *(x[:size] for x in arrays))
        empty = jax.tree.map(lambda x: jax.numpy.zeros(number, x.dtype), of_one)
        return lax.fori_loop(0, math.ceil(number / size), block, empty)

    return of_blocks


def _by_threads(program):
    """Blocks side by side; they are not joined, which would be a copy more."""
    from concurrent.futures import ThreadPoolExecutor

    import numpy as np

    pool, pieces = ThreadPoolExecutor(CORES), {}

    def call(*arrays):
        key = tuple(map(id, arrays))
        if key not in pieces:
            count = max(1, len(arrays[0]) // BLOCK)
            pieces.clear()
            pieces[key] = list(
                zip(*(np.array_split(np.asarray(x), count) for x in arrays), strict=True)
            )
        return list(pool.map(lambda piece: program(*piece), pieces[key]))

    return call


def jobs(way: str) -> list[tuple[str, int]]:
    """What a way is timed at; all sizes only for the two that the aims speak of."""
    if way in (PLAIN, KEPT):
        return [(job, size) for job in JOBS for size in (SIZES if job in CHARTED else LARGE)]
    some = ("powers", "lossy, with gradient", ELEMENTWISE, LOSS)
    last = None if way in ("in blocks", "all cores") else 2
    return [(job, size) for job in some[:last] for size in LARGE]


def measure(rounds: int) -> dict:
    """{dtype: {way: {(job, size): {"s": ..., "to_reference": ...}}}}."""
    devices = {"XLA_FLAGS": f"--xla_force_host_platform_device_count={CORES}"}
    results = {}
    for dtype in ("float64", "float32"):
        processes = {}
        for way in WAYS if dtype == "float64" else (PLAIN, KEPT):
            contestant = Contestant(way, OURS, environment=devices if way == "all cores" else {})
            module = ("benchmarks.speed.many_points", "--worker")
            processes[way] = Process(contestant, dtype, "cpu", module)
        for way in list(processes):
            if "failed" in processes[way].answer():
                processes.pop(way).close()
        table = results[dtype] = {way: {} for way in processes}
        for size in SIZES:
            for job in JOBS:
                takers = {w: p for w, p in processes.items() if (job, size) in jobs(w)}
                if takers:
                    asked = {"asked": (job, size), "seconds": 0.2 if size in LARGE else 0.03}
                    for way, found in in_rounds(takers, asked, rounds, PLAIN).items():
                        table[way][job, size] = found
        for process in processes.values():
            process.close()
    return results


def aims(results: dict) -> list[tuple]:
    """(precision, way, figure, aim, measured, met)."""
    rows = []
    for dtype, ways in results.items():
        for way in (PLAIN, KEPT):
            if way not in ways:
                continue
            times = {job: found["s"] for job, found in ways[way].items()}
            for job in VALUES:
                rates = {size: size / times[job, size] for size in SIZES}
                share = rates[LARGE[-1]] / max(rates.values())
                rows.append(
                    (dtype, way, f"{job}, 1e7: of its best rate", ">= 0.9", share, share >= 0.9)
                )
            for kind, of, most in (
                ("lossless, with gradient", "lossless", 2.0),
                ("lossy, with gradient", "reflectance", 2.2),
                (LOSS, ELEMENTWISE, 1.5),
            ):
                for size in LARGE:
                    ratio = times[kind, size] / times[of, size]
                    what = f"{kind}, {size:.0e}: over {'value' if of != ELEMENTWISE else of}"
                    rows.append((dtype, way, what, f"<= {most:g}", ratio, ratio <= most))
    return rows


def markdown(results: dict, machine: dict) -> str:
    """The page: aims, then the speed of every way."""
    parts = [
        "# A million points and more\n\n"
        "`python -m benchmarks.speed.many_points --out docs/benchmarks` (`make bench` runs it "
        "too). What to do about it is said in [speed](../speed.md).\n\n"
        f"{machine['date']}; {machine['processor']}; {machine['cores']} cores, load "
        f"{machine['load_before']:.1f} before the run; {machine['system']}. Fastest calls of "
        "interleaved rounds.\n\n![](many_points.png)\n\n## Aims\n\n"
        "| precision | way | figure | aim | measured | met |\n"
        + "| --- " * 6 + "|\n"
    ]  # fmt: skip
    for *cells, measured, met in aims(results):
        parts.append(f"| {' | '.join(cells)} | {measured:.2f} | {'yes' if met else 'no'} |\n")
    parts.append("\n## Million points a second\n\n")
    parts += [f"- {way}: {what}.\n" for way, what in WAYS.items()]
    for dtype, ways in results.items():
        parts.append(f"\n| {dtype} | points | {' | '.join(ways)} |\n" + "| --- " * (2 + len(ways)))
        parts.append("|\n")
        for job in JOBS:
            for size in SIZES:
                cells = [ways[way].get((job, size)) for way in ways]
                if any(cells):
                    rates = [f"{size / c['s'] / 1e6:.3g}" if c else "" for c in cells]
                    parts.append(f"| {job} | {size:.0e} | {' | '.join(rates)} |\n")
    return "".join(parts)


def main():
    options = options_of("benchmarks.speed.many_points", __doc__, worker)
    from benchmarks.__main__ import machine

    about = machine()
    results = measure(options.rounds)
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / "many_points.md").write_text(markdown(results, about))
    draw(results["float64"], CHARTED, options.out / "many_points.png")
    print(f"wrote many_points.md and many_points.png in {options.out}")


if __name__ == "__main__":
    main()
