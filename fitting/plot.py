"""The picture of a fit: data with error bars, the fitted curve with its band, residuals below.

Needs matplotlib (the extra ``plot``), which is imported when a picture is drawn and not before.
"""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Iterator
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fitting.report import number, with_error

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from fitting.fit import FitResult
    from fitting.measurement import Measurement

FORMATS = (".png", ".pdf", ".svg")
# Okabe and Ito's colours, told apart by colour-blind readers too; markers differ as well.
# (M. Okabe and K. Ito, "Color universal design", 2008.)
_LOOKS = {
    "R_s": ("#0072B2", "o", r"$R_\mathrm{s}$"),
    "R_p": ("#D55E00", "s", r"$R_\mathrm{p}$"),
    "R": ("#009E73", "D", r"$R$"),
    "other": ("#CC79A7", "^", ""),
}
_GREY = "#595959"
_STYLE = {
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
}
_OUTSIDE = {"bbox_to_anchor": (1.0, 1.0), "fontsize": 10, "handletextpad": 0.1, "borderpad": 0.0}
# Beyond this many wavelengths error bars run together and a band is drawn instead.
_MANY = 60


def check_picture(path: str | PathLike[str]) -> None:
    """Raise ValueError where no picture can be drawn: no matplotlib, or an unknown kind of file."""
    if Path(path).suffix.lower() not in FORMATS:
        raise ValueError(f"--plot {path}: a name that ends in {', '.join(FORMATS)} was wanted.")
    if importlib.util.find_spec("matplotlib") is None:
        raise ValueError(
            "--plot needs matplotlib, which is not installed: pip install 'fresnel-jax[plot]'."
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
    if result.status == "converged":
        parts.append(f"$k$ = {_plus_minus(result.k, result.sigma_k)}")
    elif math.isfinite(result.k_upper_limit):
        parts.append(f"$k$ < {result.k_upper_limit:.2g} (95 %)")
    else:
        parts.append("$k$ = 0")
    if math.isfinite(result.chi2_reduced):
        parts.append(rf"$\chi^2$/dof = {result.chi2_reduced:.3g}")
    parts.append(f"rms = {number(result.rms, 2)}")
    return "     ".join(parts)


def _titles(axes: Axes, result: FitResult, measurement: Measurement) -> None:
    source = measurement.source.replace("$", r"\$")
    axes.set_title(source, loc="left", fontweight="bold", pad=30)
    subtitle = axes.annotate(
        _subtitle(result), (0.0, 1.0), (0.0, 9.0), xycoords="axes fraction",
        textcoords="offset points", va="bottom", ha="left", fontsize=11, color="#333333",
    )  # fmt: skip
    subtitle.set_in_layout(False)  # the title above it makes the room


def _series(measurement: Measurement) -> Iterator[tuple[str, float, np.ndarray]]:
    """Yield (quantity, angle of the polariser or NaN, mask) of each kind of datum."""
    m = measurement
    for quantity in dict.fromkeys(m.quantity.tolist()):
        of = m.quantity == quantity
        if np.isnan(m.polarizer_deg[of]).any():
            yield quantity, math.nan, of & np.isnan(m.polarizer_deg)
        for angle in np.unique(m.polarizer_deg[of & np.isfinite(m.polarizer_deg)]):
            yield quantity, float(angle), of & (m.polarizer_deg == angle)


def _look(quantity: str, polarizer: float) -> tuple[str, str, str]:
    if math.isfinite(polarizer):
        color, marker, _ = _LOOKS["other"]
        return color, marker, rf"${quantity}$, polariser at {polarizer:g}$\degree$"
    color, marker, label = _LOOKS.get(quantity, _LOOKS["other"])
    return color, marker, label or quantity


def _angles_shown(angle_deg: np.ndarray) -> tuple[float, float]:
    """Return the range of angles to draw: all of them, unless the data fill less than half."""
    low, high = float(angle_deg.min()), float(angle_deg.max())
    if high - low >= 45.0:
        return 0.0, 90.0
    margin = max(0.15 * (high - low), 2.0)
    return max(low - margin, 0.0), min(high + margin, 90.0)


def _points(axes: Axes, x: Any, y: Any, sigma: Any, color: str, marker: str, label: str) -> None:
    error = np.where(np.isfinite(sigma), sigma, 0.0) if np.isfinite(sigma).any() else None
    axes.errorbar(
        x, y, yerr=error, fmt=marker, color=color, label=label, markersize=5.5,
        markeredgecolor="white", markeredgewidth=0.6, elinewidth=1.4, capsize=0.0, zorder=3,
    )  # fmt: skip


def _model(result: FitResult, angle_deg: np.ndarray, quantity: str, polarizer: float):
    from fitting.curve import curve

    if math.isnan(polarizer):
        return curve(result, angle_deg, quantity)
    share = math.cos(math.radians(polarizer)) ** 2
    p, s = (curve(result, angle_deg, which)[0] for which in ("R_p", "R_s"))
    return share * p + (1.0 - share) * s, np.full(len(angle_deg), np.nan)


def _draw_curve(figure: Figure, result: FitResult, measurement: Measurement) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    from fitting.curve import fitted_values

    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(3.2, 1.0))
    fitted, _ = fitted_values(result, measurement)
    low, high = _angles_shown(measurement.angle_deg)
    angles = np.linspace(low, high, 361)
    for quantity, polarizer, of in _series(measurement):
        color, marker, label = _look(quantity, polarizer)
        m = measurement.where(of)
        _points(top, m.angle_deg, m.value, m.sigma, color, marker, label)
        _points(bottom, m.angle_deg, m.value - fitted[of], m.sigma, color, marker, "")
        if np.isnan(fitted[of]).all():
            continue
        value, sigma = _model(result, angles, quantity, polarizer)
        top.plot(angles, value, color=color, zorder=2)
        top.fill_between(
            angles, value - sigma, value + sigma, color=color, alpha=0.22, linewidth=0, zorder=1
        )
    handles, labels = top.get_legend_handles_labels()
    line = Line2D([], [], color=_GREY)
    band = Patch(color=_GREY, alpha=0.22, linewidth=0)
    top.legend(
        [*handles, (band, line)], [*labels, r"fit with 1$\sigma$ band"], loc="best",
        handlelength=1.6,
    )  # fmt: skip
    top.set_ylabel("reflectance")
    y_low, y_high = top.get_ylim()
    top.set_ylim(max(y_low, -0.02), min(y_high, 1.02))
    _draw_zero(bottom)
    bottom.set_xlabel("angle of incidence (degrees)")
    bottom.set_xlim(low, high)
    if high - low == 90.0:
        bottom.set_xticks(range(0, 91, 15))
    _titles(top, result, measurement)


def _draw_index(
    axes: Axes, x: Any, value: Any, sigma: Any, good: Any, color: str, bare_label: str
) -> None:
    """Draw one of eta and k over wavelength; nothing where the data give no index but a tick."""
    known = good & np.isfinite(sigma)
    if known.sum() > _MANY:
        gap = np.where(known, value, np.nan)
        axes.plot(x, gap, color=color, zorder=3)
        axes.fill_between(x, gap - sigma, gap + sigma, color=color, alpha=0.22, linewidth=0)
    elif known.any():
        _points(axes, x[known], value[known], sigma[known], color, "o", "")
    bare = good & ~known
    if bare.any():
        axes.plot(
            x[bare], value[bare], "o", markersize=5.0, markerfacecolor="white",
            markeredgecolor=color, markeredgewidth=1.2, zorder=3, label=bare_label,
        )  # fmt: skip
    if not good.all():
        axes.plot(
            x[~good], np.zeros((~good).sum()), "|", transform=axes.get_xaxis_transform(),
            color=_GREY, markersize=9.0, label="not determined",
        )  # fmt: skip
    if not good.any():
        axes.text(
            0.5, 0.5, "not determined by these data", transform=axes.transAxes,
            ha="center", va="center", color=_GREY,
        )  # fmt: skip
        axes.set_yticks([])


def _draw_zero(axes: Axes) -> None:
    axes.axhline(0.0, color=_GREY, linewidth=1.0, zorder=2)
    # Below 1e-4 there is nothing to see in a reflectance but rounding.
    reach = max(1.05 * max(abs(limit) for limit in axes.get_ylim()), 1e-4)
    axes.set_ylim(-reach, reach)
    axes.set_ylabel("data \u2212 fit")


def _draw_spectrum(figure: Figure, result: FitResult, measurement: Measurement) -> None:
    from fitting.curve import fitted_values

    first, second, bottom = figure.subplots(3, 1, sharex=True, height_ratios=(2.0, 2.0, 1.0))
    x = np.asarray(result.wavelength_um)
    status = np.asarray(result.status, dtype=str)
    good = np.char.startswith(status, "converged")
    eta, sigma_eta, k, sigma_k = map(
        np.asarray, (result.eta, result.sigma_eta, result.k, result.sigma_k)
    )
    _draw_index(first, x, eta, sigma_eta, good, "#0072B2", "without an error")
    _draw_index(second, x, k, sigma_k, good, "#D55E00", "compatible with 0")
    limit = np.where(good, np.asarray(result.k_upper_limit), np.nan)
    at = np.isfinite(limit)
    if at.any():
        second.plot(
            x[at], limit[at], "v", color="#D55E00", markersize=6.0, markerfacecolor="white",
            label="95 % upper limit", zorder=3,
        )  # fmt: skip
    first.set_ylabel(r"$\eta$")
    second.set_ylabel(r"$k$")
    low, high = second.get_ylim()
    if good.any() and low < 0.3 * high:
        second.set_ylim(-0.04 * high, high)  # from 0, with room for the points that lie there
    for axes in (first, second):
        if axes.get_legend_handles_labels()[0]:
            axes.legend(loc="upper left", **_OUTSIDE)
    fitted, _ = fitted_values(result, measurement)
    for quantity, polarizer, of in _series(measurement):
        color, _, label = _look(quantity, polarizer)
        m = measurement.where(of)
        bottom.plot(
            m.wavelength_um, m.value - fitted[of], "o", color=color, label=label, zorder=3,
            markersize=3.0,
        )  # fmt: skip
    _draw_zero(bottom)
    bottom.legend(loc="upper left", **_OUTSIDE)
    bottom.set_xlabel("wavelength (\u00b5m)")
    _titles(first, result, measurement)


def draw(result: FitResult, measurement: Measurement) -> Figure:
    """Return a matplotlib Figure of the fit ``result`` of ``measurement``.

    One curve: reflectance over angle with one-sigma error bars, the fitted curve with its one-sigma
    band, and data - fit below. A spectrum: eta and k over wavelength with their errors and upper
    limits, hollow where there is no error, grey where the data fix no index, and data - fit below.
    Raises ImportError where matplotlib is not installed.
    """
    import matplotlib
    from matplotlib.figure import Figure

    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(_STYLE)
        figure = Figure(figsize=(7.4, 6.2), layout="constrained", facecolor="white")
        if np.ndim(result.eta) == 0:
            _draw_curve(figure, result, measurement)
        else:
            _draw_spectrum(figure, result, measurement)
        figure.align_ylabels()
        return figure


def save_plot(
    result: FitResult, measurement: Measurement, path: str | PathLike[str], suffix: str = ""
) -> None:
    """Draw the fit to the file ``path`` in the format of ``suffix`` (default: its own)."""
    import matplotlib

    figure = draw(result, measurement)
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(_STYLE)
        figure.savefig(path, format=(suffix or Path(path).suffix).lower().lstrip("."))
