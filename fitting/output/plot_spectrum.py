"""The picture of a spectrum: data and fit, data - fit, eta and k over wavelength."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from fitting.bare_surface.curves import fitted_values
from fitting.output.plot_parts import GREY, draw_zero, look, points, series, titles
from fitting.output.reference import reference_index

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from fitting.bare_surface.solution import FitResult
    from fitting.measurement import Measurement

_OUTSIDE: dict[str, Any] = {
    "loc": "upper left",
    "bbox_to_anchor": (1.0, 1.0),
    "fontsize": 10,
    "handletextpad": 0.1,
    "borderpad": 0.0,
}
# Beyond this many wavelengths error bars run together and a band is drawn instead.
_MANY = 60


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
        points(axes, x[known], value[known], sigma[known], color, "o", "")
    bare = good & ~known
    if bare.any():
        axes.plot(
            x[bare], value[bare], "o", markersize=5.0, markerfacecolor="white",
            markeredgecolor=color, markeredgewidth=1.2, zorder=3, label=bare_label,
        )  # fmt: skip
    if not good.all():
        axes.plot(
            x[~good], np.zeros((~good).sum()), "|", transform=axes.get_xaxis_transform(),
            color=GREY, markersize=9.0, label="not determined",
        )  # fmt: skip
    if not good.any():
        axes.text(
            0.5, 0.5, "not determined by these data", transform=axes.transAxes,
            ha="center", va="center", color=GREY,
        )  # fmt: skip
        axes.set_yticks([])


def _draw_reference(first: Axes, second: Axes, name: str, x: np.ndarray) -> None:
    at, eta, k = reference_index(name, np.linspace(x.min(), x.max(), 300))
    first.plot(at, eta, "--", color=GREY, linewidth=1.2, label=f"{name} (reference)")
    second.plot(at, k, "--", color=GREY, linewidth=1.2)


def _draw_data(top: Axes, bottom: Axes, result: FitResult, measurement: Measurement) -> None:
    fitted, sigma = fitted_values(result, measurement)
    for quantity, polarizer, of in series(measurement):
        color, marker, label = look(quantity, polarizer)
        for angle in np.unique(measurement.angle_deg[of]):
            rows = np.flatnonzero(of & (measurement.angle_deg == angle))
            rows = rows[np.argsort(measurement.wavelength_um[rows], kind="stable")]
            x, value = measurement.wavelength_um[rows], measurement.value[rows]
            if len(rows) > _MANY:
                top.plot(x, value, ".", color=color, markersize=3.0, label=label, zorder=3)
            else:
                points(top, x, value, measurement.sigma[rows], color, marker, label)
            line, spread = fitted[rows], sigma[rows]
            top.plot(x, line, color=color, linewidth=1.2, zorder=2)
            top.fill_between(x, line - spread, line + spread, color=color, alpha=0.22, linewidth=0)
            bottom.plot(x, value - line, ".", color=color, markersize=5.0, zorder=3)
            label = ""  # one line of the legend for all angles
    top.set_ylabel("reflectance")
    top.legend(**_OUTSIDE)
    draw_zero(bottom)


def draw_spectrum(
    figure: Figure, result: FitResult, measurement: Measurement, reference: str | None = None
) -> None:
    """Draw data and fit, data - fit, eta and k over wavelength into the empty ``figure``.

    reference: a named material, whose eta and k are drawn beside.
    """
    top, bottom, first, second = figure.subplots(4, 1, sharex=True, height_ratios=(3, 1, 2, 2))
    _draw_data(top, bottom, result, measurement)
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
    if reference:
        _draw_reference(first, second, reference, x)
    first.set_ylabel(r"$\eta$")
    second.set_ylabel(r"$k$")
    low, high = second.get_ylim()
    if good.any() and low < 0.3 * high:
        second.set_ylim(-0.04 * high, high)  # from 0, with room for the points that lie there
    for axes in (first, second):
        if axes.get_legend_handles_labels()[0]:
            axes.legend(**_OUTSIDE)
    second.set_xlabel("wavelength (\u00b5m)")
    titles(top, result, measurement)
