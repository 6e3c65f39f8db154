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


# The processes that jax had run in when they were forked: a fork copies no threads but the one that
# called it, and in the child the first program would wait for those of XLA without end.
_forked = set[int]()


def _before_fork() -> None:
    if jax_has_begun():  # in the child it might wait for a lock of jax without end
        _forked.add(os.getpid())


if hasattr(os, "register_at_fork"):
    os.register_at_fork(before=_before_fork)


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
    if _forked - {os.getpid()}:
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


def compiled(function: Callable, *static: str) -> Callable:
    """Return ``function`` jitted, with the arguments named static.

    If several threads call it first for the same shapes, which follow from those of its first two
    arguments and from what is static, one of them compiles and the others wait.
    """
    made = functools.cache(
        lambda: jax.jit(function, static_argnames=static, compiler_options=_known_options())
    )
    known: set[Hashable] = set()
    locks: dict[Hashable, threading.Lock] = defaultdict(threading.Lock)

    @functools.wraps(function)
    def call(*args: Any, **kwargs: Any) -> Any:
        own = (kwargs[name] for name in static if name in kwargs)
        key = *own, *map(np.shape, jax.tree.leaves(args[:2]))
        with contextlib.nullcontext() if key in known else locks[key]:
            with _making:  # two programs made at once by two threads would both be compiled
                program = made()
            out = program(*args, **kwargs)
        known.add(key)
        return out

    return call
