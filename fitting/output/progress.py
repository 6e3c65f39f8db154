"""A progress bar for what takes longer than a second: tqdm's, where that is installed."""

from __future__ import annotations

import importlib
import importlib.util
import sys
from typing import Any


class Progress:
    """Counts steps on a terminal; shows nothing in the first second, in a pipe, or without tqdm.

    As a context manager it clears the bar away. quiet: never show it.
    """

    def __init__(self, what: str, *, quiet: bool = False) -> None:
        self._bar: Any = None
        if not quiet and sys.stderr.isatty() and importlib.util.find_spec("tqdm") is not None:
            tqdm = importlib.import_module("tqdm").tqdm
            self._bar = tqdm(desc=what, delay=1.0, leave=False, unit="", file=sys.stderr)

    def expect(self, total: int) -> None:
        """Say how many steps there will be in all, as far as is known by now."""
        if self._bar is not None:
            self._bar.total = total
            self._bar.refresh()

    def step(self, doing: str = "") -> None:
        """Count one step as done; ``doing`` is what comes next."""
        if self._bar is not None:
            self._bar.update()
            self._bar.set_postfix_str(doing)

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.close()
