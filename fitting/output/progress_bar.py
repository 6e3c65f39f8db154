"""A progress bar (tqdm's, if that is installed) for work that takes longer than a second."""

from __future__ import annotations

import contextlib
import importlib
import importlib.util
import sys
import threading
from collections.abc import Iterator
from typing import Any

from fitting.process.progress import Step, listening

# Seconds until a bar is shown, and between two updates of it.
DELAY, EVERY = 1.0, 0.1
# Until the total number of steps is known, the number done and the time are shown without a bar.
_OPEN = "{desc}: {n} [{elapsed}{postfix}]"
_FILLED = "{desc}: {percentage:3.0f}%|{bar}| [{elapsed}<{remaining}{postfix}]"


class Progress:
    """Counts steps on a terminal; shows nothing in the first second, in a pipe, or without tqdm.

    Leaving the context removes the bar. quiet: never show it. A thread of its own draws the bar:
    it sleeps for the first second, so that quicker work does not even import tqdm, and it updates
    the time while one step (a compilation) takes long.
    """

    def __init__(self, what: str, *, quiet: bool = False) -> None:
        self._what, self._total, self._done, self._doing = what, 0, 0, ""
        self._over = threading.Event()
        self._thread: threading.Thread | None = None
        if not quiet and sys.stderr is not None and sys.stderr.isatty():
            self._thread = threading.Thread(target=self._show, daemon=True)

    def take(self, step: Step) -> None:
        """Add a step reported by `fitting.process.progress.tell`."""
        if step.total:
            self._total = self._done + step.total
        self._done += step.done
        self._doing = step.doing or self._doing

    def _show(self) -> None:
        if self._over.wait(DELAY) or importlib.util.find_spec("tqdm") is None:
            return
        tqdm = importlib.import_module("tqdm").tqdm
        # With a delay, however short, tqdm itself draws nothing before the first refresh below.
        bar: Any = tqdm(
            desc=self._what, leave=False, unit="", file=sys.stderr, bar_format=_OPEN, delay=1e-9
        )
        bar.start_t -= DELAY
        while True:
            if self._total:
                bar.total, bar.bar_format = self._total, _FILLED
            bar.n = self._done
            bar.set_postfix_str(self._doing, refresh=True)
            if self._over.wait(EVERY):
                break
        bar.close()

    def __enter__(self) -> Progress:
        if self._thread is not None:
            self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        if self._thread is not None:
            self._thread.join()


@contextlib.contextmanager
def shown(what: str, *, quiet: bool = False) -> Iterator[Progress]:
    """Show a bar of the steps that the fits inside the context report."""
    with Progress(what, quiet=quiet) as bar, listening(bar.take):
        yield bar
