"""Blocks of a map on the workers of a Dask cluster.

Tasks are small: each looks first whether its block is done, and returns a number. Few wait at a
time, and each is forgotten when it is done, so that no scheduler is told of 1e5 blocks at once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any

from fitting.maps.cube import package

Place = tuple[int, ...]
# So many tasks for each thread of the cluster are known to the scheduler.
WINDOW = 2


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
    client.wait_for_workers(1)
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
    left, running, where = iter(places), distributed.as_completed(), dict[str, Place]()
    killed = []

    def submit() -> None:
        for place in _first(left):
            function, *arguments = tasks(place)
            key = f"{function.__name__}-{arguments[1][:12]}-{'.'.join(map(str, place))}{mark}"
            where[key] = place
            running.add(client.submit(function, *arguments, key=key, pure=False))

    for _ in range(window):
        submit()
    try:
        for future in running:
            place = where.pop(future.key)
            if future.status == "error":
                error = future.exception()
                if not isinstance(error, distributed.KilledWorker):
                    raise error
                killed.append(place)
            else:
                done(future.result())
            submit()
    finally:
        client.cancel(list(running.futures))
    return killed
