"""Stacks of films: layer-points a second, compile times and errors, against the peers installed.

A layer-point is one layer at one angle, wavelength and polarization; every program computes R and T
for s and p of L layers at 100 angles times 200 wavelengths, in float64. Packages that compute one
point a call get a share of the angles and wavelengths, and their rate counts. Errors are those of R
in eps, against mpmath at a dozen points. The programs of one number of layers take turns, so that
all of them see the same machine. Part of `make bench`; or, for other numbers of layers,

    python -m benchmarks.speed.stacks --layers 1 2 10 100 --out docs/benchmarks
"""

import argparse
import importlib.metadata
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks import stack_peers
from fresnel_jax.layers import stack

ANGLES, WAVELENGTHS = np.linspace(0.0, 1.5, 100), np.linspace(0.4, 0.8, 200)


@dataclass
class Program:
    """One way to compute a stack: a call without arguments, and how many points it computes."""

    name: str
    call: Any
    points: int
    compile_s: float | None
    error_eps: float | None
    seconds: list[float] = field(default_factory=list)

    def time(self) -> None:
        start = time.perf_counter()
        jax.block_until_ready(self.call())
        self.seconds.append(time.perf_counter() - start)


def media(layers: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(layers)
    index = rng.uniform(1.3, 2.6, layers + 2) + 1j * rng.uniform(0.0, 0.02, layers + 2)
    index[0] = 1.0
    return index, rng.uniform(0.02, 0.2, layers)


def ours(index, thickness) -> list[Program]:
    """Each tier: value, and value with the gradient of a sum by all n, k and thicknesses."""
    return [program for exact in (True, False) for program in _tier(index, thickness, exact)]


def _tier(index, thickness, exact: bool) -> list[Program]:
    c, w = jnp.cos(jnp.asarray(ANGLES))[:, None], jnp.asarray(WAVELENGTHS)
    arguments = (c, jnp.asarray(index)[:, None, None], jnp.asarray(thickness)[:, None, None], w)

    def powers(c, index, thickness, w):
        return stack(c, index, thickness_um=thickness, wavelength_um=w, exact=exact)[:4]

    def loss(n, k, thickness):  # of the first medium n alone, which is lossless
        media = n + 1j * k.at[0].set(0.0)
        return sum(jnp.sum(z) for z in powers(c, media, thickness, w))

    n, k = jnp.real(arguments[1]), jnp.imag(arguments[1])
    gradient = jax.value_and_grad(loss, (0, 1, 2))
    programs, tier = [], "stack" if exact else "stack, exact=False"
    for name, function, given in (
        (tier, powers, arguments),
        (f"{tier}, value and gradient", gradient, (n, k, arguments[2])),
    ):
        start = time.perf_counter()
        compiled = jax.jit(function).lower(*given).compile()
        compile_s = time.perf_counter() - start
        error = None
        if function is powers:
            R = np.array(compiled(*given)[:2])
            error = error_eps(R, index, thickness, range(len(ANGLES)), range(len(WAVELENGTHS)))
        points = len(ANGLES) * len(WAVELENGTHS)
        call = lambda run=compiled, given=given: run(*given)  # noqa: E731
        programs.append(Program(name, call, points, compile_s, error))
    return programs


def theirs(package: str, peer, index, thickness) -> Program:
    """A peer, at its share of the angles and wavelengths."""
    every = max(1, round(peer.share**-0.5))
    rows, columns = range(0, len(ANGLES), every), range(0, len(WAVELENGTHS), every)
    angles, wavelengths = ANGLES[::every], WAVELENGTHS[::every]

    def call():
        return peer.powers(index, thickness, angles, wavelengths)

    start = time.perf_counter()
    R = np.asarray(call())[:2]
    first = time.perf_counter() - start
    again = time.perf_counter()
    call()
    compile_s = first - (time.perf_counter() - again)
    version = importlib.metadata.version(NAMES.get(package, package))
    program = Program(
        f"{package} {version}", call, len(angles) * len(wavelengths), max(compile_s, 0.0), None
    )
    program.error_eps = error_eps(R, index, thickness, rows, columns)
    return program


NAMES = {"elli": "pyElli"}


def error_eps(R, index, thickness, rows, columns) -> float:
    """The largest error of R_s and R_p in eps, at a dozen points; R has those rows and columns."""
    from tests.truth import stack_oracle

    worst = 0.0
    for i in {0, len(rows) // 3, 2 * len(rows) // 3, len(rows) - 1}:
        for j in {0, len(columns) // 2, len(columns) - 1}:
            exact = stack_oracle.stack(
                np.cos(ANGLES[rows[i]]), index.tolist(), thickness.tolist(), WAVELENGTHS[columns[j]]
            )
            for value, truth in zip(R, exact[:2], strict=True):
                worst = max(worst, float(abs(float(value[i, j]) - truth) / truth))
    return worst / float(np.finfo(float).eps)


def measure(layers: int, rounds: int) -> tuple[list[Program], dict[str, str]]:
    """The programs of one number of layers, timed in turns, and the peers left out."""
    index, thickness = media(layers)
    programs = ours(index, thickness)
    peers, left_out = stack_peers.installed()
    for package, peer in peers.items():
        try:
            programs.append(theirs(package, peer, index, thickness))
        except Exception as error:  # a foreign package may fail in any way
            left_out[package] = f"{type(error).__name__}: {str(error)[:100]}"
    for _ in range(rounds):
        for program in programs:
            program.time()
    return programs, left_out


def rate(program: Program, layers: int) -> float:
    """1e6 layer-points a second."""
    return 2e-6 * layers * program.points / min(program.seconds)


def main(argv=None) -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--layers", type=int, nargs="+", default=[1, 2, 10, 100])
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--out", type=Path, help="a folder for stacks.md and stacks.png")
    given = parser.parse_args(argv)
    jax.config.update("jax_enable_x64", True)
    lines = [
        "| layers | program | compile, s | run, ms | 1e6 layer-points/s | error of R, eps |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    print("\n".join(lines))
    measured, left_out = {}, {}
    for layers in given.layers:
        measured[layers], missing = measure(layers, given.rounds)
        left_out |= missing
        for program in measured[layers]:
            error = "" if program.error_eps is None else f"{program.error_eps:.2g}"
            lines.append(
                f"| {layers} | {program.name} | {program.compile_s:.1f} | "
                f"{1e3 * min(program.seconds):.1f} | {rate(program, layers):.3g} | {error} |"
            )
            print(lines[-1], flush=True)
    for package, reason in left_out.items():
        lines += ["", f"Left out: {package} ({reason})."]
        print(lines[-1])
    if given.out is not None:
        write(given.out, lines, measured)


def write(out: Path, lines: list[str], measured: dict[int, list[Program]]) -> None:
    from benchmarks.__main__ import machine
    from benchmarks.speed.stack_chart import draw

    about = machine()
    text = f"""# Stacks: speed and error

`python -m benchmarks.speed.stacks --out docs/benchmarks`: R and T for s and p at 100 angles times
200 wavelengths, float64; a layer-point is one layer at one angle, wavelength and polarization. The
fastest of the rounds counts; compile time is the first call less a later one. Error: the largest of
R at a dozen points, against mpmath.

{about["processor"]}, {about["cores"]} cores, load {about["load_before"]:.1f} before;
{about["date"]}.

"""
    out.mkdir(parents=True, exist_ok=True)
    (out / "stacks.md").write_text(text + "\n".join(lines) + "\n\n![](stacks.png)\n")
    draw(
        {
            layers: [(p.name, rate(p, layers), p.error_eps) for p in programs]
            for layers, programs in measured.items()
        },
        out / "stacks.png",
    )


if __name__ == "__main__":
    main()
