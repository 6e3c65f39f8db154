"""How every picture looks, and how it is written: the same bytes from the same fit.

Needs matplotlib (the extra ``plot``), which is imported when a picture is drawn and not before.
"""

from __future__ import annotations

import contextlib
import importlib.util
import re
import warnings
from collections.abc import Iterator
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fitting.data.errors import MissingExtra

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FORMATS = (".png", ".pdf", ".svg")
GREY = "#595959"
ETA_COLOR, K_COLOR, WARNING_COLOR = "#0072B2", "#D55E00", "#A84300"
_STYLE: Any = {
    "font.size": 11.0,
    "axes.labelsize": 12.0,
    "axes.titlesize": 13.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.9,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e6e6e6",
    "grid.linewidth": 0.8,
    "legend.frameon": False,
    "legend.fontsize": 10.0,
    "lines.linewidth": 1.5,
    "mathtext.fontset": "dejavusans",
    "savefig.dpi": 200,
    "svg.fonttype": "none",
    # Without this constant an SVG contains random names, and no two files are the same.
    "svg.hashsalt": "fresnel-fit",
}
# Who wrote it. The time of writing is left out, so that two pictures of one fit are the same file.
_PROPERTIES: dict[str, dict[str, Any]] = {
    "png": {"Software": "fresnel-fit"},
    "svg": {"Creator": "fresnel-fit", "Date": None},
    "pdf": {"Creator": "fresnel-fit", "CreationDate": None},
}
_GLYPH = re.compile(r"Glyph (\d+) .*missing from")


@contextlib.contextmanager
def our_style() -> Iterator[None]:
    """Draw in the style of this package, whatever the user's matplotlibrc says."""
    import matplotlib

    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(_STYLE)
        yield


def check_matplotlib(asked: str) -> None:
    """Raise ImportError where matplotlib, which ``asked`` needs, is not installed."""
    if importlib.util.find_spec("matplotlib") is None:
        raise MissingExtra(asked, "matplotlib", "plot")


def check_picture(path: str | PathLike[str]) -> None:
    """Raise ValueError for an unknown kind of picture file, ImportError without matplotlib."""
    if Path(path).suffix.lower() not in FORMATS:
        endings = ", ".join(FORMATS)
        raise ValueError(f"--plot {path}: the name of a picture must end in one of {endings}.")
    check_matplotlib("--plot")


def save(figure: Figure, path: str | PathLike[str], suffix: str = "") -> None:
    """Write the picture to the file ``path`` in the format of ``suffix`` (default: its own).

    The same figure gives the same bytes. Letters that the font does not have are drawn as boxes;
    one warning names them all.
    """
    kind = (suffix or Path(path).suffix).lower().lstrip(".")
    with our_style(), warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        figure.savefig(path, format=kind, metadata=_PROPERTIES.get(kind, {}))
    missing: dict[str, None] = {}
    for one in caught:
        found = _GLYPH.match(str(one.message))
        if found:
            missing[chr(int(found[1]))] = None
        else:
            warnings.warn_explicit(one.message, one.category, one.filename, one.lineno)
    if missing:
        warnings.warn(
            f"the font of the picture lacks the letters {' '.join(missing)}; boxes stand for them.",
            stacklevel=2,
        )


def points(axes: Axes, x: Any, y: Any, sigma: Any, look: tuple[str, str, bool], label: str) -> None:
    """Draw data with one-sigma bars where there is a sigma; many of them as small dots."""
    color, marker, hollow = look
    sigma = np.asarray(sigma)
    error = np.where(np.isfinite(sigma), sigma, 0.0) if np.isfinite(sigma).any() else None
    many = len(x) > MANY
    axes.errorbar(
        x, y, yerr=error, fmt=marker, color=color, label=label,
        markersize=(3.2 if hollow else 2.4) if many else 5.5,
        markerfacecolor="none" if hollow else color,
        markeredgecolor=color if hollow else "white",
        markeredgewidth=(0.6 if hollow else 0.0) if many else (1.0 if hollow else 0.6),
        elinewidth=0.7 if many else 1.4, capsize=0.0, zorder=3,
    )  # fmt: skip


# Beyond this many points a line marks run together and are drawn small.
MANY = 60


def band(axes: Axes, x: Any, low: Any, high: Any, color: str) -> None:
    """Draw a one-sigma band, where it is known."""
    if np.isfinite(low).any():
        axes.fill_between(x, low, high, color=color, alpha=0.22, linewidth=0, zorder=1)


def symbol(name: str) -> str:
    """Return a shown name as a picture writes it: the symbol of an index, else as it is."""
    index = {"eta": r"\eta", "k": "k", "<n>": r"\langle n \rangle", "<k>": r"\langle k \rangle"}
    return f"${index[name]}$" if name in index else name


def plain_title(text: str) -> str:
    """Return ``text`` as a title of one line; the middle of a long text is left out."""
    if len(text) > 78:
        text = f"{text[:37]} ... {text[-36:]}"
    return text.replace("$", r"\$")
