"""What the studies of random films share: their options, and how they are ended."""

from __future__ import annotations

import argparse
import contextlib
import secrets

import numpy as np


def study_options(text: str, counted: str, many: int) -> argparse.Namespace:
    """Return what was asked of a study. text: its docstring; counted: what there are ``many`` of.

    The count is in `count`; seed (of the system if none was given), minutes and only as the help
    has them.
    """
    parser = argparse.ArgumentParser(description=text.splitlines()[0])
    parser.add_argument(f"--{counted}", type=int, default=many, dest="count")
    parser.add_argument("--minutes", type=float, default=np.inf, help="stop after")
    parser.add_argument("--seed", type=int, help="the first film (default: one of the system)")
    parser.add_argument("--only", nargs="*", default=[""], help="rows with such a text")
    out = parser.parse_args()
    out.seed = secrets.randbelow(10**9) if out.seed is None else out.seed
    return out


def until_interrupted() -> contextlib.AbstractContextManager[None]:
    """Return a context that Ctrl-C leaves, so that a table of what was run until then follows."""
    return contextlib.suppress(KeyboardInterrupt)
