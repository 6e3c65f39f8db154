"""One contestant in one process: reads a command per line, answers with one line of JSON.

Nothing another contestant does can warm it, and between commands it waits without work.
"""

import argparse
import contextlib
import json
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path


def main(name: str, dtype: str):
    import numpy as np

    from benchmarks import contestants
    from fresnel_jax.performance import keep_memory

    description = next(x for x in contestants.CONTESTANTS if x.name == name)
    with contextlib.redirect_stdout(sys.stderr):
        if description.kept:
            keep_memory()
        built = contestants.build(name, dtype)
    if "jax" in sys.modules:
        import jax

        # a precision is what a contestant is run in: float64 needs this switch
        jax.config.update("jax_enable_x64", dtype == "float64")
    answer({"ready": True})
    programs = {}
    for line in sys.stdin:
        command = json.loads(line)
        try:
            with contextlib.redirect_stdout(sys.stderr), np.errstate(all="ignore"):
                result = {
                    "evaluate": evaluate,
                    "time": time_calls,
                    "first": first_call,
                }[command.pop("do")](built, description, dtype, programs, **command)
        except Exception as error:
            result = {"failed": f"{type(error).__name__}: {str(error)[:200]}"}
        answer(result)


def answer(result):
    print(json.dumps(result), flush=True)


def evaluate(built, description, dtype, programs, scene):
    """R at the points of a class of scene, as exact Python floats."""
    import numpy as np

    from benchmarks import scenes

    values = scenes.points(scene, dtype)
    if scene in scenes.LOSSLESS:
        values = values[:2]
    R = built.points(*(built.to_device(x) for x in values))
    R = R[0] if isinstance(R, tuple) else R
    return {"R": [float(x) for x in np.asarray(R)]}


def program(built, description, dtype, what, lossless, size):
    """A callable without arguments that does the work to be timed."""
    import numpy as np

    from benchmarks import scenes

    values = scenes.timed(lossless, dtype, size)
    one = description.one_material or what.startswith("one material")
    if one:
        material = scenes.ONE_MATERIAL[: 1 if lossless else 2]
        values = (values[0], *(np.dtype(dtype).type(x) for x in material))
    values = tuple(built.to_device(x) for x in values)
    what = what.removeprefix("one material ")
    if what == "value":
        function = built.curve if one else built.points
    else:
        function = _in_jax(built.in_jax, what, one, len(values), values[0])
    return lambda: built.wait(function(*values))


def _in_jax(R, what, one, count, cosine):
    """Value with gradient with respect to eta (and k), or a loss, or a loss with its gradient."""
    import jax
    import jax.numpy as jnp

    if R is None:
        raise NotImplementedError("not differentiable")
    indices = tuple(range(1, count))
    if what == "gradient":
        axes = (0, *[None if one else 0] * (count - 1))
        return jax.jit(jax.vmap(jax.value_and_grad(R, argnums=indices), axes))
    data = cosine * 0.5

    def loss(*values):
        residual = R(*values) - data
        return jnp.mean(residual * residual)

    return jax.jit(loss if what == "loss" else jax.value_and_grad(loss, argnums=indices))


def first_call(built, description, dtype, programs, lossless, size):
    """Seconds of the first call (with compilation) and of the second."""
    run = program(built, description, dtype, "value", lossless, size)
    times = []
    for _ in range(2):
        start = time.perf_counter()
        run()
        times.append(time.perf_counter() - start)
    return {"first_s": times[0], "second_s": times[1]}


def time_calls(built, description, dtype, programs, what, lossless, size, seconds):
    """Seconds per call: the fastest of the calls that fit into the given time (1 at least)."""
    key = what, lossless, size
    if key not in programs:
        if programs and next(iter(programs))[2] != size:
            programs.clear()  # one size at a time: ten million points take much memory
        programs[key] = program(built, description, dtype, what, lossless, size)
        programs[key]()
        programs[key]()
    run, best, spent, calls = programs[key], float("inf"), 0.0, 0
    while calls == 0 or spent < seconds:
        start = time.perf_counter()
        run()
        took = time.perf_counter() - start
        best, spent, calls = min(best, took), spent + took, calls + 1
    return {"s": best, "calls": calls}


def options_of(prog: str, description: str, work: Callable[[str, str], None]):
    """The options of a benchmark whose contestants are processes of its own module.

    In such a process, which is started with --worker NAME DTYPE, ``work`` is called instead.
    """
    parser = argparse.ArgumentParser(prog=prog, description=description)
    parser.add_argument("--out", type=Path, default=Path("docs/benchmarks"))
    parser.add_argument("--rounds", type=int, default=4, help="rounds of interleaved timing")
    parser.add_argument("--worker", nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.worker:
        os.environ.setdefault("TF_CPP_MIN_LOG_LEVEL", "3")
        work(*options.worker)
        sys.exit()
    return options


def serve(prepare):
    """Answer commands with the fastest call of ``prepare(*asked)``, a callable, in some seconds."""
    answer({"ready": True})
    key, run = None, None
    for line in sys.stdin:
        command = json.loads(line)
        best, spent, asked = float("inf"), 0.0, command["asked"]
        try:
            with contextlib.redirect_stdout(sys.stderr):
                if asked != key:
                    run = None  # its arrays go before the next ones come
                    key, run = asked, prepare(*asked)
                    run()
                    run()
                while spent < command["seconds"]:
                    start = time.perf_counter()
                    run()
                    best, spent = min(best, took := time.perf_counter() - start), spent + took
        except Exception as error:
            answer({"failed": f"{type(error).__name__}: {str(error)[:200]}"})
        else:
            answer({"s": best})


if __name__ == "__main__":
    os.environ.setdefault("TF_CPP_MIN_LOG_LEVEL", "3")
    main(*sys.argv[1:])
