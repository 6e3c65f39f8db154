"""Who wants to know how far a long computation has come: nobody, unless `listening` says so."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from contextvars import ContextVar
from typing import NamedTuple


class Step(NamedTuple):
    """What is told: how many steps are done since the last time, of how many, and what is next.

    total: of all steps, None where it is not known. doing: a word or two, "" for no change.
    """

    done: int
    total: int | None
    doing: str


_listener: ContextVar[Callable[[Step], None] | None] = ContextVar("listener", default=None)


def tell(doing: str = "", done: int = 1, total: int | None = None) -> None:
    """Tell the listener, if there is one, that so many steps are done and what comes next."""
    listener = _listener.get()
    if listener is not None:
        listener(Step(done, total, doing))


@contextlib.contextmanager
def listening(listener: Callable[[Step], None] | None) -> Iterator[None]:
    """Have ``listener`` told of every step meanwhile; None: nobody."""
    token = _listener.set(listener)
    try:
        yield
    finally:
        _listener.reset(token)
