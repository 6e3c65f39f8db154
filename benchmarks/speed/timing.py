"""Ratios of programs in one process: interleaved, the fastest call of each."""

import time
from collections.abc import Callable

import jax


def fastest(programs: dict[str, Callable], arguments, rounds: int = 12) -> dict[str, float]:
    """Seconds of the fastest call of each program; every round calls each of them."""
    for program in programs.values():
        jax.block_until_ready(program(*arguments))
    best = dict.fromkeys(programs, float("inf"))
    for number in range(rounds):
        names = list(programs)
        for name in names if number % 2 == 0 else names[::-1]:
            for _ in range(6):
                start = time.perf_counter()
                jax.block_until_ready(programs[name](*arguments))
                best[name] = min(best[name], time.perf_counter() - start)
    return best
