"""Stacks of films: layer-points a second, compile times and errors, against the peers installed.

A layer-point is one layer at one angle, wavelength and polarization; every program computes R and T
for s and p of L layers at 100 angles times 200 wavelengths. Peers (tmm, tmm-fast) take part
where they are installed (the extra `peers`). Errors are those of R in eps, against mpmath at a
dozen points. Run on a quiet machine:

    python -m benchmarks.stacks --layers 1 2 10 100
"""

import argparse
import importlib.util
import sys
import time
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from fresnel_jax.layers import stack

jax.config.update("jax_enable_x64", True)
ANGLES, WAVELENGTHS = np.linspace(0.0, 1.5, 100), np.linspace(0.4, 0.8, 200)


def _media(layers: int):
    rng = np.random.default_rng(layers)
    index = rng.uniform(1.3, 2.6, layers + 2) + 1j * rng.uniform(0.0, 0.02, layers + 2)
    index[0] = 1.0
    return index, rng.uniform(0.02, 0.2, layers)


def _seconds(call, rounds: int) -> float:
    best = np.inf
    for _ in range(rounds):
        start = time.perf_counter()
        jax.block_until_ready(call())
        best = min(best, time.perf_counter() - start)
    return best


def _ours(index, thickness, rounds):
    c, w = jnp.cos(jnp.asarray(ANGLES))[:, None], jnp.asarray(WAVELENGTHS)
    arguments = (c, jnp.asarray(index)[:, None, None], jnp.asarray(thickness)[:, None, None], w)

    def powers(c, index, thickness, w):
        return stack(c, index, thickness, w)[:4]

    def loss(n, k, thickness):
        return sum(jnp.sum(z) for z in powers(c, n + 1j * k, thickness, w))

    n, k = jnp.real(arguments[1]), jnp.imag(arguments[1])
    gradient = jax.value_and_grad(loss, (0, 1, 2))
    rows = []
    for name, program, given in (
        ("stack", powers, arguments),
        ("stack, value and gradient", gradient, (n, k, arguments[2])),
    ):
        start = time.perf_counter()
        compiled = jax.jit(program).lower(*given).compile()
        compile_time = time.perf_counter() - start
        seconds = _seconds(lambda run=compiled, given=given: run(*given), rounds)
        R = compiled(*given)[:2] if program is powers else None
        rows.append((name, compile_time, seconds, R))
    return rows


def _tmm_fast(index, thickness, rounds):
    import tmm_fast

    nk = np.broadcast_to(index[None, :, None], (1, len(index), len(WAVELENGTHS)))
    d = np.concatenate([[np.inf], thickness, [np.inf]])[None]

    def call():
        return [tmm_fast.coh_tmm(p, nk, d, ANGLES, WAVELENGTHS, device="cpu")["R"][0] for p in "sp"]

    return [("tmm-fast", 0.0, _seconds(call, max(1, rounds // 3)), [np.asarray(z) for z in call()])]


def _error(R, index, thickness) -> float:
    """The largest error of R_s and R_p in eps, at a dozen points."""
    sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
    import stack_oracle

    worst = 0.0
    for i in (0, 33, 66, 99):
        for j in (0, 90, 199):
            exact = stack_oracle.stack(
                np.cos(ANGLES[i]), index.tolist(), thickness.tolist(), WAVELENGTHS[j]
            )
            for mine, truth in zip(R, exact[:2], strict=True):
                worst = max(worst, float(abs(float(mine[i, j]) - truth) / truth))
    return worst / np.finfo(float).eps


def main(argv=None) -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--layers", type=int, nargs="+", default=[1, 2, 10, 100])
    parser.add_argument("--rounds", type=int, default=9)
    given = parser.parse_args(argv)
    print("| layers | program | compile, s | run, ms | 1e6 layer-points/s | error of R, eps |")
    print("| --- | --- | --- | --- | --- | --- |")
    for layers in given.layers:
        index, thickness = _media(layers)
        rows = _ours(index, thickness, given.rounds)
        if importlib.util.find_spec("tmm_fast"):
            rows += _tmm_fast(index, thickness, given.rounds)
        for name, compile_time, seconds, R in rows:
            points = 2 * layers * len(ANGLES) * len(WAVELENGTHS)
            error = "" if R is None else f"{_error(R, index, thickness):.0f}"
            print(
                f"| {layers} | {name} | {compile_time:.1f} | {1e3 * seconds:.1f} | "
                f"{points / seconds / 1e6:.1f} | {error} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
