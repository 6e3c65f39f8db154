"""How the programs of this package are compiled and run, whatever the caller has set in jax."""

from __future__ import annotations

import contextlib
import functools
import os
import sys
import threading
from collections import defaultdict
from collections.abc import Callable, Hashable, Iterator
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

# XLA's older CPU emitters halve the time to compile the fit (1.5 s instead of 2.7 s) and make it a
# fifth faster. Measured with jax 0.10.2 on AVX-512, 60 angles, s and p. Vectors of 512 bits would
# be a tenth faster, but their programs can be wrong: with jaxlib 0.10.2 the derivative program of a
# film (psi, Delta and a free angle offset) returns cos 2psi off by 2.7.
_OPTIONS = {"xla_cpu_use_fusion_emitters": False}

# Whether jax had run in the process from which this one was forked: a fork copies no threads but
# the one that called it, and the first program would wait for those of XLA without end.
_threads_left_behind = False


def _after_fork() -> None:
    global _threads_left_behind
    # jax has no public name for it that does not start its threads, or take a lock of the parent.
    running = getattr(sys.modules.get("jax._src.xla_bridge"), "_backends", ())
    _threads_left_behind = _threads_left_behind or bool(running)


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork)


@contextlib.contextmanager
def in_float64(*, own_function: bool = False) -> Iterator[None]:
    """Compute in float64, without the switches by which callers debug functions of their own.

    A lane of a fit may become NaN or infinite (it is then left), and arrays of numpy go into every
    program: `jax_debug_nans`, `jax_debug_infs` and `jax_transfer_guard` would end each fit.

    own_function: whether a function of the caller runs, for which NaN and infinity are reported as
        the caller has set it.
    Raises RuntimeError in a process forked from one in which jax had run.
    """
    if _threads_left_behind:
        raise RuntimeError(
            "this process was forked from one in which jax had run, and would wait without end for "
            "threads of jax that a fork does not copy. Start it in another way: "
            'multiprocessing.get_context("spawn"), or joblib or Dask as they are by default; see '
            "docs/howto/processes.md."
        )
    with jax.enable_x64(True), jax.transfer_guard("allow"), contextlib.ExitStack() as switches:
        if not own_function:
            switches.enter_context(jax.debug_nans(False))
            switches.enter_context(jax.debug_infs(False))
        yield


def compiled(function: Callable, static: tuple[str, ...]) -> Callable:
    """Return ``function`` jitted, with the arguments named in ``static`` static."""
    plain = jax.jit(function, static_argnames=static)
    suited = jax.jit(function, static_argnames=static, compiler_options=_OPTIONS)
    refused = threading.Event()

    @functools.wraps(function)
    def call(*args: Any, **kwargs: Any) -> Any:
        if not refused.is_set():
            try:
                return suited(*args, **kwargs)
            except jax.errors.JaxRuntimeError as error:
                # A GPU's compiler does not know the option, nor may that of another jaxlib. Several
                # threads may find this out at once: each of them then takes the plain program.
                if "compile option" not in str(error):
                    raise
                refused.set()
        return plain(*args, **kwargs)

    return call


def computed_once(x: Array) -> Array:
    """Return a real array that XLA does not compute again for everything that reads it.

    Its CPU compiler repeats what stands before a loop in every loop behind it, except for divisions
    and roots (the cosine of the angle of incidence was formed 18 times in the program of a film, a
    third of its time). A division by one is exact; `fresnel_jax._compiler` has the measurements.
    """
    return x / jnp.where(x == x, 1.0, 2.0)


def in_turn(program: Callable, by_first: bool = False) -> Callable:
    """Return a compiled program which only one thread compiles if several call it first.

    by_first: whether the shapes of all arguments follow from that of the first one and from the
    static ones. To compare the shapes of all of them takes a tenth of a millisecond.
    """
    known: set[Hashable] = set()
    locks: dict[Hashable, threading.Lock] = defaultdict(threading.Lock)

    @functools.wraps(program)
    def call(*args: Any, **static: Any) -> Any:
        told = [getattr(args[0], "shape", ())] if by_first else map(np.shape, jax.tree.leaves(args))
        key = *static.values(), *told
        if key not in known:
            with locks[key]:
                if key not in known:
                    out = program(*args, **static)
                    known.add(key)
                    return out
        return program(*args, **static)

    return call
