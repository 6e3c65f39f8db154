"""Output of the command on a terminal, its refusals, and its exit status."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from fitting.data.errors import for_command
from fitting.process.visible import visible

if TYPE_CHECKING:
    from fitting.fit_result import Fit

PROGRAM = "fresnel-fit"
FITTED, NOT_FITTED, MISUSED = 0, 1, 2


class Refused(Exception):
    """An error that the user can correct; the text says how."""


@contextlib.contextmanager
def refusals(kind: type[Exception] = ValueError) -> Iterator[None]:
    """Turn the ValueErrors of reading and fitting, whose texts are for the user, into Refused.

    Only these: a ValueError from anywhere else is a defect and should show its traceback.
    """
    try:
        yield
    except kind as error:
        raise Refused(for_command(error)) from error


def say(text: str) -> None:
    """Print ``text``; a reader that stops early (``| head``) is no error, files are written."""
    # A name or unit may hold letters that a terminal of another encoding cannot show.
    encoding = getattr(sys.stdout, "encoding", None) or "utf-8"
    try:
        text = visible(text, "\n")
        sys.stdout.write(text.encode(encoding, "backslashreplace").decode(encoding))
        sys.stdout.flush()
    except BrokenPipeError:
        # Python flushes stdout once more when it exits, and would complain.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def complain(text: str) -> None:
    """Print one line on stderr."""
    with contextlib.suppress(OSError):  # there is nowhere to write
        print(f"{PROGRAM}: {visible(text)}", file=sys.stderr)


def exit_status(fits: Iterable[Fit]) -> int:
    """Return FITTED if every curve of every fit converged, else NOT_FITTED.

    A script must not take the index of a "misfit" for a result, nor an "undetermined" one, beside
    which many others fit equally well.
    """
    import numpy as np

    good = all((np.atleast_1d(fit.status) == "converged").all() for fit in fits)
    return FITTED if good else NOT_FITTED
