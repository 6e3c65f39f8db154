"""Blocks of a map on the workers of a Dask cluster.

Tasks are small: each looks first whether its block is done, and returns a number. Few wait at a
time, and each is forgotten when it is done, so that no scheduler is told of 1e5 blocks at once.
"""

from __future__ import annotations

import contextlib
import queue
from collections.abc import Callable, Iterable, Iterator
from typing import Any

from fitting.maps.cube import package
from fitting.maps.map_store import MapStoreError
from fitting.process.progress import tell

Place = tuple[int, ...]
# So many tasks for each thread of the cluster are known to the scheduler.
WINDOW = 2
# After so long without a block it is looked at whether there are workers.
QUIET_S = 30.0
_GONE = (
    "the scheduler of the workers does not answer. The blocks that are done stay; the same command "
    "goes on with the others when there is a scheduler."
)


def run_on(
    client: Any, tasks: Callable[[Place], tuple[Any, ...]], places: Iterable[Place],
    done: Callable[[int], None],
) -> list[Place]:  # fmt: skip
    """Run a task for each place, and return the places of those that kill their workers.

    tasks: gives function and arguments of a place. done: is told what each task returned.
    A task that was on a worker that died, as often as the scheduler allows (allowed-failures), may
    be innocent: it is run again at the end, alone.
    """
    distributed = package("distributed", "client")
    try:
        client.wait_for_workers(1, timeout=QUIET_S)
    except TimeoutError:
        raise MapStoreError(
            f"{client.scheduler.address}: this scheduler has no worker; start some (dask worker "
            "ADDRESS), and run the same again."
        ) from None
    left = iter(places)
    # The first compiles the programs, and the others load them.
    suspects = _run(client, distributed, tasks, _first(left), 1, "", done)
    window = WINDOW * max(sum(client.nthreads().values()), 1)
    suspects += _run(client, distributed, tasks, left, window, "", done)
    return [p for one in suspects for p in _run(client, distributed, tasks, [one], 1, "-", done)]


def _first(left: Iterator[Place]) -> list[Place]:
    one = next(left, None)
    return [] if one is None else [one]


def _run(
    client: Any, distributed: Any, tasks: Callable[[Place], tuple[Any, ...]],
    places: Iterable[Place], window: int, mark: str, done: Callable[[int], None],
) -> list[Place]:  # fmt: skip
    """Run tasks, so many at a time; return the places of those whose workers died."""
    left, running, killed = iter(places), dict[Any, Place](), list[Place]()
    ended: queue.Queue[Any] = queue.Queue()

    def submit() -> None:
        for place in _first(left):
            function, *arguments = tasks(place)
            key = f"{function.__name__}-{arguments[1][:12]}-{'.'.join(map(str, place))}{mark}"
            future = client.submit(function, *arguments, key=key, pure=False)
            running[future] = place
            future.add_done_callback(ended.put)

    for _ in range(window):
        submit()
    try:
        while running:
            try:
                future = ended.get(timeout=QUIET_S)
            except queue.Empty:
                if client.status != "running":
                    raise MapStoreError(_GONE) from None
                tell("" if client.nthreads() else "waiting for workers: there is none", done=0)
                continue
            place = running.pop(future)
            if future.cancelled():
                raise MapStoreError(_GONE)
            if future.status == "error":
                error = future.exception()
                if not isinstance(error, distributed.KilledWorker):
                    raise error
                killed.append(place)
            else:
                done(future.result())
            submit()
    finally:
        with contextlib.suppress(Exception):  # of a scheduler that is gone
            client.cancel(list(running))
    return killed
