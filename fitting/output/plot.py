"""The picture of a fit: data with error bars, the fitted curve with its band, residuals below.

Needs matplotlib (the extra ``plot``), which is imported when a picture is drawn and not before.
"""

from __future__ import annotations

import importlib.util
import math
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fitting.output.plot_parts import GREY, draw_zero, look, our_style, points, save, series, titles

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from fitting.bare_surface.solution import FitResult
    from fitting.measurement import Measurement

FORMATS = (".png", ".pdf", ".svg")


def check_matplotlib(flag: str = "--plot") -> None:
    """Raise ValueError where matplotlib, which ``flag`` needs, is not installed."""
    if importlib.util.find_spec("matplotlib") is None:
        raise ValueError(
            f"{flag} needs matplotlib, which is not installed: pip install 'fresnel-jax[plot]'."
        )


def check_picture(path: str | PathLike[str]) -> None:
    """Raise ValueError where no picture can be drawn: no matplotlib, or an unknown kind of file."""
    if Path(path).suffix.lower() not in FORMATS:
        raise ValueError(f"--plot {path}: a name that ends in {', '.join(FORMATS)} was wanted.")
    check_matplotlib()


def _angles_shown(angle_deg: np.ndarray) -> tuple[float, float]:
    """Return the range of angles to draw: all of them, unless the data fill less than half."""
    low, high = float(angle_deg.min()), float(angle_deg.max())
    if high - low >= 45.0:
        return 0.0, 90.0
    margin = max(0.15 * (high - low), 2.0)
    return max(low - margin, 0.0), min(high + margin, 90.0)


def _model(
    result: FitResult, angle_deg: np.ndarray, quantity: str, polarizer: float
) -> tuple[np.ndarray, np.ndarray]:
    from fitting.bare_surface.curves import curve, fitted_values
    from fitting.measurement import Measurement

    if math.isnan(polarizer):
        return curve(result, angle_deg, quantity)
    nothing = np.zeros_like(angle_deg)
    return fitted_values(
        result, Measurement.from_columns(angle_deg, polarizer_deg=polarizer, R=nothing)
    )


def _draw_curve(figure: Figure, result: FitResult, measurement: Measurement) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    from fitting.bare_surface.curves import fitted_values

    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(3.2, 1.0))
    fitted, _ = fitted_values(result, measurement)
    low, high = _angles_shown(measurement.angle_deg)
    angles = np.linspace(low, high, 361)
    banded = False
    for quantity, polarizer, of in series(measurement):
        color, marker, label = look(quantity, polarizer)
        m = measurement.where(of)
        points(top, m.angle_deg, m.value, m.sigma, color, marker, label)
        points(bottom, m.angle_deg, m.value - fitted[of], m.sigma, color, marker, "")
        if np.isnan(fitted[of]).all():
            continue
        value, sigma = _model(result, angles, quantity, polarizer)
        banded |= bool(np.isfinite(sigma).any())
        top.plot(angles, value, color=color, zorder=2)
        top.fill_between(
            angles, value - sigma, value + sigma, color=color, alpha=0.22, linewidth=0, zorder=1
        )
    handles, labels = top.get_legend_handles_labels()
    line = Line2D([], [], color=GREY)
    band = Patch(color=GREY, alpha=0.22, linewidth=0)
    fit_handle, fit_label = ((band, line), r"fit with 1$\sigma$ band") if banded else (line, "fit")
    top.legend([*handles, fit_handle], [*labels, fit_label], loc="best", handlelength=1.6)
    top.set_ylabel("reflectance")
    y_low, y_high = top.get_ylim()
    top.set_ylim(max(y_low, -0.02), min(y_high, 1.02))
    draw_zero(bottom)
    bottom.set_xlabel("angle of incidence (degrees)")
    bottom.set_xlim(low, high)
    if high - low == 90.0:
        bottom.set_xticks(range(0, 91, 15))
    titles(top, result, measurement)


def draw(result: FitResult, measurement: Measurement, reference: str | None = None) -> Figure:
    """Return a matplotlib Figure of the fit ``result`` of ``measurement``.

    One curve: reflectance over angle with one-sigma error bars, the fitted curve with its one-sigma
    band, and data - fit below. A spectrum: the same over wavelength, a line for each angle, then
    eta and k with their errors and upper limits, a tick on the axis where the data give no index;
    beside them eta and k of the material ``reference``.
    Raises ImportError where matplotlib is not installed.
    """
    from matplotlib.figure import Figure

    with our_style():
        single = np.ndim(result.eta) == 0
        size = (7.4, 6.2) if single else (8.2, 10.0)
        figure = Figure(figsize=size, layout="constrained", facecolor="white")
        if single:
            _draw_curve(figure, result, measurement)
        else:
            from fitting.output.plot_spectrum import draw_spectrum

            draw_spectrum(figure, result, measurement, reference)
        figure.align_ylabels()
        return figure


def save_plot(
    result: FitResult,
    measurement: Measurement,
    path: str | PathLike[str],
    suffix: str = "",
    reference: str | None = None,
) -> None:
    """Draw the fit to the file ``path`` in the format of ``suffix`` (default: its own)."""
    save(draw(result, measurement, reference), path, suffix)
