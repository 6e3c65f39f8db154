"""Progress of a long computation: reported by whoever computes, shown as lines on a terminal."""

from __future__ import annotations

import contextlib
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextvars import ContextVar
from typing import NamedTuple

from fitting.process.visible import visible

# Seconds between two lines; a computation that is over before the first shows none.
EVERY = 2.0


class Step(NamedTuple):
    """A report: the number of steps done since the last one, those to come, and what comes next.

    total: of the steps from this report on, those in it included; None where nothing new is known
    of it. A fit may turn out to need more, and several fits may follow each other. doing: a word or
    two, stage: what of it, best: the best result so far; "" for no change.
    """

    done: int
    total: int | None
    doing: str
    stage: str = ""
    best: str = ""


_listener: ContextVar[Callable[[Step], None] | None] = ContextVar("listener", default=None)


def heard() -> bool:
    """Whether somebody listens, so that a report is worth its making."""
    return _listener.get() is not None


def tell(
    doing: str = "", done: int = 1, total: int | None = None, stage: str = "", best: str = ""
) -> None:
    """Report to the listener, if there is one, the number of steps done and what comes next."""
    listener = _listener.get()
    if listener is not None:
        listener(Step(done, total, doing, stage, best))


@contextlib.contextmanager
def listening(listener: Callable[[Step], None] | None) -> Iterator[None]:
    """Report every step within the context to ``listener``; None: to nobody."""
    token = _listener.set(listener)
    try:
        yield
    finally:
        _listener.reset(token)


class Lines:
    """What has been reported so far, and a thread that writes it to stderr every two seconds."""

    def __init__(self, what: str):
        self.what, self.begun = what, time.monotonic()
        self.done = self.total = 0
        self.doing = self.stage = self.best = ""
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._write, daemon=True)
        self._thread.start()

    def take(self, step: Step) -> None:
        """Listen to a report."""
        self.total = self.done + step.total if step.total else self.total
        self.done += step.done
        if step.doing and step.doing != self.doing:
            self.doing, self.stage, self.best = step.doing, "", ""
        self.stage, self.best = step.stage or self.stage, step.best or self.best

    def text(self) -> str:
        """Return what is done, how far that is, and the best result so far, as one line."""
        parts = [self.doing, self.stage, f"{self.done} of {self.total}" * (self.total > 0),
                 f"{time.monotonic() - self.begun:.0f} s"]  # fmt: skip
        best = f"; best so far: {self.best}" * bool(self.best)
        return visible(f"{self.what}: {', '.join(filter(None, parts))}{best}")

    def _write(self) -> None:
        while not self._over.wait(EVERY):
            with contextlib.suppress(OSError, ValueError):  # a terminal that was closed
                print(self.text(), file=sys.stderr, flush=True)

    def close(self) -> None:
        """Write no more."""
        self._over.set()
        self._thread.join()


@contextlib.contextmanager
def shown(what: str, *, quiet: bool = False) -> Iterator[None]:
    """Show the steps reported inside on a terminal, a line every two seconds."""
    if quiet or sys.stderr is None or not sys.stderr.isatty():
        yield
        return
    lines = Lines(what)
    try:
        with listening(lines.take):
            yield
    finally:
        lines.close()
