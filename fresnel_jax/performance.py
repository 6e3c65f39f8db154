"""Speed on a CPU: memory that is kept, sums in blocks, and fences against the compiler.

Half of the time of a program of a million points and more goes to fresh memory, not to arithmetic:
the system has to supply and to clear every page of every array (docs/speed.md has the
measurements). `computed_once` and `fenced` change no value, but the loops that XLA makes.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable
from typing import Any

import jax
from jax import lax
from jaxtyping import ArrayLike

from ._numerics.fences import computed_once as computed_once
from ._numerics.fences import fenced

__all__ = ["computed_once", "fenced", "in_blocks", "jax_has_begun", "keep_memory"]

# Of malloc.h: the most that is kept at the top of the heap, the most arrays mapped apart, the most
# arenas. An arena of a thread holds at most 64 MB, and larger arrays are mapped anew at every call.
_TRIM_THRESHOLD, _MMAP_MAX, _ARENA_MAX = -1, -4, -8


def jax_has_begun() -> bool:
    """Return whether jax has computed in this process, and so has threads and memory of its own.

    An import of jax does not count, nor does a function that is only defined. Nothing is started.
    """
    # Of the options that jax lets nobody change once it has begun, the one that matters least: a
    # thread that starts jax between the two lines waits a minute longer for other machines, if any.
    name = "jax_cpu_get_local_topology_timeout_minutes"
    minutes = getattr(jax.config, name)
    try:
        jax.config.update(name, minutes + 1)
        jax.config.update(name, minutes)
    except RuntimeError:
        return True
    return False


def keep_memory() -> bool:
    """Let the C library keep freed memory for the next array instead of giving it back.

        from fresnel_jax.performance import keep_memory

        keep_memory()  # before jax's first computation, which starts the threads that allocate

    At 1e7 points everything is then 1.6 to 2.5 times as fast in float64, `powers` and `amplitudes`
    at 1e5 too; at 1e4 nothing changes. The price: the process keeps the most memory that it ever
    used, and all its threads allocate from one heap.

    Returns whether it took effect: False without glibc (macOS, Windows), and after jax has begun.
    """
    return not jax_has_begun() and _keep()


def _keep() -> bool:
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError, TypeError):
        return False
    largest = 2**31 - 1
    settings = ((_ARENA_MAX, 1), (_MMAP_MAX, 0), (_TRIM_THRESHOLD, largest))
    return all([mallopt(name, value) for name, value in settings])


def in_blocks(
    function: Callable[..., Any], *arrays: ArrayLike, points: int = 2**17, total: bool = False
) -> Any:
    """Return ``function(*arrays)``, or its sum over all points, computed block by block.

        residual = lambda cosine, data: (reflectance(cosine, eta, k) - data) ** 2
        loss = in_blocks(residual, cosines, data, total=True)

    In one program, under `jax.jit` and every kind of derivative: what a block needs on the way is
    computed again for its gradient, so that memory is that of one block, and the inputs are not
    copied (unless the number of points is a prime or the like: once). XLA runs such a loop on one
    core, so the plain call is as fast or faster, if there is memory for it: docs/speed.md has
    figures.

    Args:
        function: of arrays with points first, each point by itself; parameters are closed over.
            Its results are arrays, or a tree of arrays, with points first.
        arrays: shapes (N, ...), one N.
        points: the most points of a block; 2**17 was the best of 2**14 to 2**17.
        total: whether the results are summed over the points.

    Returns what ``function`` does, shapes (N, ...), or with ``total`` (...). The results are those
    of the plain call to rounding.

    Raises ValueError for arrays of different length, a tuple, or blocks of less than a point.
    """
    if any(isinstance(a, tuple) for a in arrays):
        raise ValueError("a tuple came among the arrays; give eta and k of an Index as two arrays.")
    given = tuple(map(jax.numpy.asarray, arrays))
    lengths = [a.shape[:1] for a in given]
    if not given or lengths[0] == () or len(set(lengths)) > 1:
        shapes = ", ".join(str(a.shape) for a in given)
        raise ValueError(f"arrays (N, ...) of one N were wanted, came: {shapes or 'none'}.")
    if points < 1:
        raise ValueError(f"points: {points} came; the points of a block, 1 or more, were wanted.")
    number = lengths[0][0]

    def of_block(block: tuple) -> Any:
        found = function(*block)
        return jax.tree.map(lambda x: fenced(x).sum(0), found) if total else found

    count = _number_of_blocks(number, points)
    if count <= 1:
        return of_block(given)
    size = number // count
    blocks = tuple(a[: count * size].reshape(count, size, *a.shape[1:]) for a in given)
    again = jax.checkpoint(of_block)
    if total:
        nothing = jax.tree.map(
            lambda x: jax.numpy.zeros(x.shape, x.dtype),
            jax.eval_shape(of_block, tuple(b[0] for b in blocks)),
        )
        found, _ = lax.scan(
            lambda sums, block: (jax.tree.map(jax.numpy.add, sums, again(block)), None),
            nothing, blocks,
        )  # fmt: skip
    else:
        found = lax.map(again, blocks)
        found = jax.tree.map(lambda x: x.reshape(count * size, *x.shape[2:]), found)
    if count * size == number:
        return found
    rest = of_block(tuple(a[count * size :] for a in given))
    if total:
        return jax.tree.map(jax.numpy.add, found, rest)
    return jax.tree.map(lambda *x: jax.numpy.concatenate(x), found, rest)


def _number_of_blocks(number: int, points: int) -> int:
    """Return into how many blocks; if one can be found, a number that leaves no remainder."""
    least = math.ceil(number / points)
    whole = (count for count in range(max(least, 1), 4 * least + 1) if number % count == 0)
    return next(whole, least)
