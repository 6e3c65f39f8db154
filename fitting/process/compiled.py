"""How the programs of this package are compiled and run, whatever the caller has set in jax."""

from __future__ import annotations

import contextlib
import functools
import os
import threading
from collections import defaultdict
from collections.abc import Callable, Hashable, Iterator
from typing import Any

import jax
import numpy as np

from fresnel_jax.performance import jax_has_begun

# Each is used if the compiler at hand knows it (`python -m benchmarks.speed.compiler_options`):
OPTIONS: dict[str, Any] = {
    # jaxlib 0.10.2 hands sums of products to a library which gets some of them wrong
    # (jax-ml/jax#39103); none are handed over.
    "xla_cpu_experimental_ynn_fusion_type": "",
    # The older emitters, which jaxlib 0.12 no longer has, take 20 to 45 % less time to compile.
    "xla_cpu_use_fusion_emitters": False,
    # Without LLVM's costlier passes compilation takes 24 to 37 % less time (jaxlib 0.12), and the
    # programs are as fast and give the same bits.
    "xla_backend_optimization_level": 1,
    "xla_llvm_disable_expensive_passes": True,
}
_making = threading.Lock()


@functools.cache
def _known_options() -> dict[str, Any]:
    """Return those of `OPTIONS` that the compiler of this process knows.

    Not every jaxlib knows all of them, nor does a GPU's compiler. It is asked with a program of one
    number (0.015 s), and names the first that it does not know.
    """
    known = dict(OPTIONS)
    while known:
        try:
            jax.jit(lambda: 0, compiler_options=known).lower().compile()
            break
        except jax.errors.JaxRuntimeError as error:
            unknown = [name for name in known if f"'{name}'" in str(error)]
            if not unknown:
                raise
            del known[unknown[0]]
    return known


# Whether jax had run in the process from which this one was forked: a fork copies no threads but
# the one that called it, and the first program would wait for those of XLA without end.
_ran_before_fork = False
_threads_left_behind = False


def _before_fork() -> None:
    global _ran_before_fork
    _ran_before_fork = jax_has_begun()  # in the child it might wait for a lock of jax without end


def _after_fork() -> None:
    global _threads_left_behind
    _threads_left_behind = _ran_before_fork


if hasattr(os, "register_at_fork"):
    os.register_at_fork(before=_before_fork, after_in_child=_after_fork)


@contextlib.contextmanager
def fit_settings(*, own_function: bool = False) -> Iterator[None]:
    """Set what this package's programs are traced and run with: float64, promotion as NumPy has it.

    The switches by which callers check and debug code of their own would end each fit: a lane may
    become NaN or infinite (it is then left), and arrays of numpy go into every program. They belong
    to a thread, so the setting stands where a program is called, not where a fit begins.

    own_function: whether a function of the caller runs, for which NaN and infinity are reported as
        the caller has set it (`own_residuals` hands on the switches for promotion).
    Raises RuntimeError in a process forked from one in which jax had run.
    """
    if _threads_left_behind:
        raise RuntimeError(
            "this process was forked from one in which jax had run, and would wait without end for "
            "threads of jax that a fork does not copy. Start it in another way: "
            'multiprocessing.get_context("spawn"), or joblib or Dask as they are by default; see '
            "docs/howto/processes.md."
        )
    with (
        jax.enable_x64(True),
        jax.transfer_guard("allow"),
        jax.numpy_rank_promotion("allow"),
        jax.numpy_dtype_promotion("standard"),
        contextlib.ExitStack() as switches,
    ):
        if not own_function:
            switches.enter_context(jax.debug_nans(False))
            switches.enter_context(jax.debug_infs(False))
        yield


def compiled(function: Callable, static: tuple[str, ...]) -> Callable:
    """Return ``function`` jitted, with the arguments named in ``static`` static."""
    made: list[Callable] = []

    @functools.wraps(function)
    def call(*args: Any, **kwargs: Any) -> Any:
        if not made:
            options = _known_options()
            with _making:  # two programs made at once by two threads would both be compiled
                if not made:
                    made.append(jax.jit(function, static_argnames=static, compiler_options=options))
        return made[0](*args, **kwargs)

    return call


def in_turn(program: Callable, by_first: bool = False) -> Callable:
    """Return a compiled program which only one thread compiles if several call it first.

    by_first: whether the shapes of all arguments follow from that of the first one and from the
    static ones. To compare the shapes of all of them takes a tenth of a millisecond.
    """
    known: set[Hashable] = set()
    locks: dict[Hashable, threading.Lock] = defaultdict(threading.Lock)

    @functools.wraps(program)
    def call(*args: Any, **static: Any) -> Any:
        sizes = (
            [getattr(args[0], "shape", ())] if by_first else map(np.shape, jax.tree.leaves(args))
        )
        key = *static.values(), *sizes
        with contextlib.nullcontext() if key in known else locks[key]:
            out = program(*args, **static)
        known.add(key)
        return out

    return call
