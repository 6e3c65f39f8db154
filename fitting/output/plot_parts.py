"""What the pictures of a curve and of a spectrum have in common."""

from __future__ import annotations

import contextlib
import math
import re
import warnings
from collections.abc import Iterator
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fitting.output.report import number, with_error

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from fitting.index.fit import FitResult
    from fitting.measurement import Measurement

# Okabe and Ito's colours, told apart by colour-blind readers too; markers differ as well.
# (M. Okabe and K. Ito, "Color universal design", 2008.)
LOOKS = {
    "R_s": ("#0072B2", "o", r"$R_\mathrm{s}$"),
    "R_p": ("#D55E00", "s", r"$R_\mathrm{p}$"),
    "R": ("#009E73", "D", r"$R$"),
    "other": ("#CC79A7", "^", ""),
}
GREY = "#595959"
STYLE: Any = {
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
    "lines.linewidth": 1.8,
    "mathtext.fontset": "dejavusans",
    "savefig.dpi": 200,
    "svg.fonttype": "none",
    "svg.hashsalt": "fresnel-fit",  # names inside the file that do not change from run to run
}


@contextlib.contextmanager
def our_style() -> Iterator[None]:
    """Draw in the style of this package, whatever the user's matplotlibrc says."""
    import matplotlib

    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(STYLE)
        yield


def save(figure: Figure, path: str | PathLike[str], suffix: str = "") -> None:
    """Write the picture to the file ``path`` in the format of ``suffix`` (default: its own).

    The same picture gives the same bytes: no date is written. Letters that the font lacks are
    drawn as boxes, and one warning names them.
    """
    kind = (suffix or Path(path).suffix).lower().lstrip(".")
    undated: dict[str, Any] = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}
    with our_style(), warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        figure.savefig(path, format=kind, metadata=undated.get(kind))
    lacking = []
    for warning in caught:
        if glyph := re.match(r"Glyph (\d+) .*missing from", str(warning.message)):
            lacking.append(chr(int(glyph[1])))
        else:
            warnings.warn_explicit(
                warning.message, warning.category, warning.filename, warning.lineno
            )
    if lacking:
        letters = "".join(dict.fromkeys(lacking))
        warnings.warn(
            f"the font of the picture lacks {letters!r}; boxes stand for it", stacklevel=2
        )


def _plus_minus(value: float, sigma: float) -> str:
    return with_error(value, sigma).replace("+-", r"$\pm$")


def _subtitle(result: FitResult) -> str:
    if np.ndim(result.eta):
        good = np.char.startswith(np.asarray(result.status, dtype=str), "converged")
        return f"one bare interface, wavelength by wavelength: {good.sum()} of {good.size} fitted"
    if result.status not in ("converged", "converged at k = 0"):
        return f"{result.status}: the data give no index"
    parts = [rf"$\eta$ = {_plus_minus(result.eta, result.sigma_eta)}"]
    if math.isfinite(result.k_upper_limit):
        parts.append(f"$k$ < {number(result.k_upper_limit, 2)} (95 %)")
    else:
        parts.append(f"$k$ = {_plus_minus(result.k, result.sigma_k)}")
    if math.isfinite(result.chi2_reduced):
        parts.append(rf"$\chi^2$/dof = {number(result.chi2_reduced, 3)}")
    parts.append(f"rms = {number(result.rms, 2)}")
    return "     ".join(parts)


def titles(axes: Axes, result: FitResult, measurement: Measurement) -> None:
    """Write the name of the file and what was found above ``axes``."""
    source = measurement.source.replace("$", r"\$")
    axes.set_title(source, loc="left", fontweight="bold", pad=30)
    subtitle = axes.annotate(
        _subtitle(result), (0.0, 1.0), (0.0, 9.0), xycoords="axes fraction",
        textcoords="offset points", va="bottom", ha="left", fontsize=11, color="#333333",
    )  # fmt: skip
    subtitle.set_in_layout(False)  # the title above it makes the room


def series(measurement: Measurement) -> Iterator[tuple[str, float, np.ndarray]]:
    """Yield (quantity, angle of the polariser or NaN, mask) of each kind of datum."""
    m = measurement
    for quantity in dict.fromkeys(m.quantity.tolist()):
        of = m.quantity == quantity
        if np.isnan(m.polarizer_deg[of]).any():
            yield quantity, math.nan, of & np.isnan(m.polarizer_deg)
        for angle in np.unique(m.polarizer_deg[of & np.isfinite(m.polarizer_deg)]):
            yield quantity, float(angle), of & (m.polarizer_deg == angle)


def look(quantity: str, polarizer: float) -> tuple[str, str, str]:
    """Return colour, marker and label of a kind of datum."""
    if math.isfinite(polarizer):
        from matplotlib import colormaps
        from matplotlib.colors import to_hex

        color, marker = to_hex(colormaps["cividis"](polarizer / 90.0)), LOOKS["other"][1]
        return color, marker, rf"${quantity}$, polariser at {polarizer:g}$\degree$"
    color, marker, label = LOOKS.get(quantity, LOOKS["other"])
    return color, marker, label or quantity


def points(axes: Axes, x: Any, y: Any, sigma: Any, color: str, marker: str, label: str) -> None:
    """Draw data with one-sigma bars where there is a sigma."""
    error = np.where(np.isfinite(sigma), sigma, 0.0) if np.isfinite(sigma).any() else None
    axes.errorbar(
        x, y, yerr=error, fmt=marker, color=color, label=label, markersize=5.5,
        markeredgecolor="white", markeredgewidth=0.6, elinewidth=1.4, capsize=0.0, zorder=3,
    )  # fmt: skip


def draw_zero(axes: Axes) -> None:
    """Make ``axes`` those of data - fit: a line at 0, as much room above it as below."""
    axes.axhline(0.0, color=GREY, linewidth=1.0, zorder=2)
    # Below 1e-4 there is nothing to see in a reflectance but rounding.
    reach = max(1.05 * max(abs(limit) for limit in axes.get_ylim()), 1e-4)
    axes.set_ylim(-reach, reach)
    axes.set_ylabel("data \u2212 fit")
