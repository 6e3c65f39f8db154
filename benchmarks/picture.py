"""How the charts look: the style of the pictures of fits, which is set in one file."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from matplotlib import style
from matplotlib.figure import Figure

STYLE = Path(__file__).resolve().parents[1] / "fitting" / "output" / "fresnel_fit.mplstyle"


@contextlib.contextmanager
def figure(path: Path, width: float, height: float, **options: Any) -> Iterator[Figure]:
    """Yield a figure of width by height inches, which is written to ``path`` at the end.

    options: of `Figure`.
    """
    with style.context(STYLE, after_reset=True):
        drawn = Figure(figsize=(width, height), **{"layout": "constrained"} | options)
        yield drawn
        drawn.savefig(path)
