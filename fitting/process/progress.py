"""Progress of a long computation, reported to a function that `listening` names, if any."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from contextvars import ContextVar
from typing import NamedTuple


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
