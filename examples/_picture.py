"""Where the examples' pictures go and how they look.

Needs matplotlib, the extra `plot`.
"""

import argparse
import contextlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

OUTPUT = Path(__file__).resolve().parent / "output"
# Okabe and Ito's colours, told apart by colour-blind readers too ("Color universal design", 2008).
BLUE, ORANGE, GREEN, GREY = "#0072B2", "#D55E00", "#009E73", "#595959"
# The style of the pictures of fits, and room between panels.
_STYLE = Path(__file__).resolve().parents[1] / "fitting" / "output" / "fresnel_fit.mplstyle"
_ROOM = {"figure.constrained_layout.h_pad": 0.1, "figure.constrained_layout.w_pad": 0.12}


def arguments(
    doc: str | None, name: str, size: int, meaning: str, argv: Sequence[str] | None
) -> tuple[Path, int]:
    """The command line of an example: (where the picture goes, its size).

    Arguments: `doc`, the example's docstring, whose first line the help shows; `name`, the
    picture's file name in examples/output where the command line gives none; `size`, the default
    of --size; `meaning`, what --size counts; `argv`, the command line (None: the process's own).
    """
    parser = argparse.ArgumentParser(description=(doc or "").partition("\n")[0])
    parser.add_argument(
        "picture", nargs="?", type=Path, default=OUTPUT / name, help="the PNG file to write"
    )
    parser.add_argument("--size", type=int, default=size, help=f"{meaning} (default {size})")
    given = parser.parse_args(argv)
    return given.picture, given.size


@contextlib.contextmanager
def figure(path: Path, width: float, height: float, **options: Any) -> Iterator[Any]:
    """A matplotlib Figure of width by height inches, written to `path` when the block ends.

    Further options go to `Figure`. ModuleNotFoundError where matplotlib is not installed.
    """
    try:
        from matplotlib import style
        from matplotlib.figure import Figure
    except ModuleNotFoundError:
        raise ModuleNotFoundError(
            "the examples draw with matplotlib, which is not installed: pip install matplotlib"
        ) from None
    with style.context([_STYLE, _ROOM], after_reset=True):
        settings: dict[str, Any] = {"layout": "constrained"} | options
        drawn = Figure(figsize=(width, height), **settings)
        yield drawn
        path.parent.mkdir(parents=True, exist_ok=True)
        drawn.savefig(path, dpi=120)
