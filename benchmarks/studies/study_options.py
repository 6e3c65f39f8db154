"""What the studies of random films share: their options, and how they are ended."""

from __future__ import annotations

import argparse
import contextlib
import csv
import secrets
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np


def study_options(text: str, counted: str, many: int, rows: bool = False) -> argparse.Namespace:
    """Return what was asked of a study. text: its docstring; counted: what there are ``many`` of.

    rows: whether it can write a file of them.

    The count is in `count`; seed (of the system if none was given), minutes and only as the help
    has them.
    """
    parser = argparse.ArgumentParser(description=text.splitlines()[0])
    parser.add_argument(f"--{counted}", type=int, default=many, dest="count")
    parser.add_argument("--minutes", type=float, default=np.inf, help="stop after")
    parser.add_argument("--seed", type=int, help="the first film (default: one of the system)")
    parser.add_argument("--only", nargs="*", default=[""], help="rows with such a text")
    if rows:
        parser.add_argument("--rows", type=Path, help="a file that a row for each is added to")
    out = parser.parse_args()
    out.seed = secrets.randbelow(10**9) if out.seed is None else out.seed
    return out


def until_interrupted() -> contextlib.AbstractContextManager[None]:
    """Return a context that Ctrl-C leaves, so that a table of what was run until then follows."""
    return contextlib.suppress(KeyboardInterrupt)


def run_study(
    arguments: argparse.Namespace, one: Callable[[int], Any], rows: Sequence[Any] = ()
) -> list[Any]:
    """Return the rows, and those of further seeds until there are as many as asked.

    Or until the minutes are over or Ctrl-C is pressed. one: returns the row of a seed, or None.
    """
    out, began, seed = list(rows), time.perf_counter(), arguments.seed
    print(f"films from seed {seed}", flush=True)
    with until_interrupted():
        while len(out) < arguments.count and time.perf_counter() - began < 60.0 * arguments.minutes:
            row = one(seed)
            if row is not None:
                out.append(row)
            seed += 1
    return out


def add_row(path: Path, row: dict[str, Any]) -> None:
    """Add a line to a table, whose first line has the names."""
    new = not path.exists()
    with path.open("a", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(row), lineterminator="\n")
        if new:
            writer.writeheader()
        writer.writerow(row)
