"""Progress of a long computation: reported by whoever computes, shown by tqdm on a terminal."""

from __future__ import annotations

import contextlib
import importlib
import importlib.util
import sys
from collections.abc import Callable, Iterator
from contextvars import ContextVar
from typing import Any, NamedTuple


class Step(NamedTuple):
    """A report: the number of steps done since the last one, those to come, and what comes next.

    total: of the steps from this report on, those in it included; None where nothing new is known
    of it. A fit may turn out to need more, and several fits may follow each other. doing: a word or
    two, "" for no change.
    """

    done: int
    total: int | None
    doing: str


_listener: ContextVar[Callable[[Step], None] | None] = ContextVar("listener", default=None)


def tell(doing: str = "", done: int = 1, total: int | None = None) -> None:
    """Report to the listener, if there is one, the number of steps done and what comes next."""
    listener = _listener.get()
    if listener is not None:
        listener(Step(done, total, doing))


@contextlib.contextmanager
def listening(listener: Callable[[Step], None] | None) -> Iterator[None]:
    """Report every step within the context to ``listener``; None: to nobody."""
    token = _listener.set(listener)
    try:
        yield
    finally:
        _listener.reset(token)


@contextlib.contextmanager
def shown(what: str, *, quiet: bool = False) -> Iterator[None]:
    """Show the steps reported inside on a terminal, after a second, where tqdm is installed."""
    terminal = sys.stderr is not None and sys.stderr.isatty()
    if quiet or not terminal or importlib.util.find_spec("tqdm") is None:
        yield
        return
    tqdm: Any = importlib.import_module("tqdm").tqdm
    with tqdm(desc=what, leave=False, delay=1.0, miniters=0, unit="", file=sys.stderr) as bar:

        def take(step: Step) -> None:
            if step.total:
                bar.total = bar.n + step.total
            if step.doing:
                bar.set_postfix_str(step.doing, refresh=False)
            bar.update(step.done)

        with listening(take):
            yield
