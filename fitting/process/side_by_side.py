"""Threads for work that can be done side by side, no more than there are processors.

A fit, whether it compiles its programs or runs them, takes 1.0 to 1.3 processors: XLA's own threads
share little of the work.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any


def _processors() -> int:
    """Return how many processors this process may use: under taskset or SLURM not all there are.

    NPROC in the environment, by which XLA too counts them, is the share of one of several workers.
    """
    if (share := os.environ.get("NPROC", "")).isdecimal():
        return max(int(share), 1)
    if count := getattr(os, "process_cpu_count", None):  # Python 3.13
        return count() or 1
    if hasattr(os, "sched_getaffinity"):  # Linux
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


PROCESSORS = _processors()  # asking again and again takes as long as a small fit


def side_by_side(one: Callable[[Any], Any], each: Sequence[Any]) -> list[Any]:
    """Return what ``one`` returns for each, in threads; for a single one in this thread."""
    if len(each) < 2:
        return [one(x) for x in each]
    with ThreadPoolExecutor(min(len(each), PROCESSORS)) as pool:
        return list(pool.map(one, each))
