"""The picture of a fitted model: data, fit and band, residuals, eta and k over wavelength."""

from __future__ import annotations

from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np

from fitting.model.result import ModelFit
from fitting.output.plot_parts import GREY, draw_zero, our_style, points, save
from fitting.output.reference import reference_index
from fitting.output.report import number
from fitting.residuals import residuals

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from fitting.model.points import PointFits

_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
_MARKERS = "osD^v<>"
# Points of a curve; more data than that are drawn as dots.
_FINE, MANY = 200, 60


def _groups(fit: ModelFit | PointFits) -> list[tuple[str, np.ndarray]]:
    """Return label and rows of every line: a curve, at one angle if over wavelength."""
    m = fit.measurement
    over_wavelength = _over_wavelength(fit)
    out = []
    for i, name in enumerate(fit.curve_names):
        for quantity in dict.fromkeys(m.quantity[fit.curve == i].tolist()):
            rows = (fit.curve == i) & (m.quantity == quantity)
            label = name.replace("NCS", quantity)
            angles = np.unique(m.angle_deg[rows]) if over_wavelength else np.array([])
            for angle in angles:
                at = rf"{label} {angle:g}$\degree$" if len(angles) > 1 or angle > 0.0 else label
                out.append((at, np.flatnonzero(rows & (m.angle_deg == angle))))
            if not over_wavelength:
                out.append((label, np.flatnonzero(rows)))
    return out


def _over_wavelength(fit: ModelFit | PointFits) -> bool:
    known = fit.measurement.wavelength_um
    return len(np.unique(known[np.isfinite(known)])) > 1


def draw_data(top: Any, bottom: Any, fit: ModelFit | PointFits) -> None:
    """Draw data, fitted curves and their bands on ``top``, data - fit on ``bottom``."""
    m = fit.measurement
    x = m.wavelength_um if _over_wavelength(fit) else m.angle_deg
    value, sigma = fit.fitted()
    off = residuals(m, value)
    degrees = np.isin(m.quantity, ("psi", "delta"))
    # R and T beside psi and Delta have a scale of their own, on the right.
    mixed = degrees.any() and not degrees.all()
    right = [axes.twinx() for axes in (top, bottom)] if mixed else []
    for i, (label, rows) in enumerate(_groups(fit)):
        color, marker = _COLOURS[i % len(_COLOURS)], _MARKERS[i % len(_MARKERS)]
        rows = rows[np.argsort(x[rows], kind="stable")]
        residual = off[rows]
        fitted = m.value[rows] - residual
        upper, lower = right if right and not degrees[rows[0]] else (top, bottom)
        if len(rows) > MANY:
            upper.plot(x[rows], m.value[rows], ".", color=color, markersize=3, label=label)
            lower.plot(x[rows], residual, ".", color=color, markersize=3)
        else:
            points(upper, x[rows], m.value[rows], m.sigma[rows], color, marker, label)
            points(lower, x[rows], residual, m.sigma[rows], color, marker, "")
        line = fitted
        if (m.quantity[rows] == "delta").all():
            # Broken where Delta goes round from 360 to 0.
            line = np.where(np.abs(np.diff(fitted, prepend=fitted[0])) > 180.0, np.nan, fitted)
        upper.plot(x[rows], line, color=color, linewidth=1.3, zorder=2)
        if np.isfinite(sigma[rows]).any():
            upper.fill_between(
                x[rows], fitted - sigma[rows], fitted + sigma[rows], color=color, alpha=0.22,
                linewidth=0, zorder=1,
            )  # fmt: skip
    of_powers = "fraction of the light"
    top.set_ylabel("degrees" if degrees.any() else of_powers)
    handles, labels = top.get_legend_handles_labels()
    for axes in right:
        axes.grid(False)
        axes.spines["right"].set_visible(True)
    if right:
        right[0].set_ylabel(of_powers)
        more, names = right[0].get_legend_handles_labels()
        handles, labels = handles + more, labels + names
        draw_zero(right[1])
    # Beside the axes and, if there are any, the figures of those on the right.
    at = (1.12 if right else 1.0, 1.0)
    top.legend(handles, labels, loc="upper left", bbox_to_anchor=at, fontsize=9)
    draw_zero(bottom)


def _draw_index(axes: Axes, fit: ModelFit, reference: str | None) -> None:
    known = fit.measurement.wavelength_um
    known = known[np.isfinite(known)]
    fine = np.linspace(known.min(), known.max(), _FINE)
    band = fit.index(fine)
    twin = axes.twinx()
    for on, value, sigma, color, label in (
        (axes, band.eta, band.sigma_eta, "#0072B2", r"$\eta$"),
        (twin, band.k, band.sigma_k, "#D55E00", r"$k$"),
    ):
        on.plot(fine, value, color=color)
        with np.errstate(invalid="ignore"):
            on.fill_between(
                fine, value - sigma, value + sigma, color=color, alpha=0.22, linewidth=0
            )
        on.set_ylabel(label, color=color)
        on.tick_params(axis="y", colors=color)
    twin.grid(False)
    twin.spines["right"].set_visible(True)
    if reference:
        shown, eta, k = reference_index(reference, fine)
        (line,) = axes.plot(shown, eta, "--", color="#0072B2", linewidth=1.2)
        twin.plot(shown, k, "--", color="#D55E00", linewidth=1.2)
        axes.legend([line], [f"{reference} (reference)"], loc="best", fontsize=9)
    axes.set_xlabel("wavelength (\u00b5m)")


def draw_model(fit: ModelFit, reference: str | None = None) -> Figure:
    """Return a matplotlib Figure: data, fitted curves and their one-sigma bands, data - fit, and
    eta and k over wavelength, beside those of the material ``reference``.

    Raises ImportError where matplotlib is not installed, ValueError for an unknown material.
    """
    from matplotlib.figure import Figure

    spectrum = _over_wavelength(fit)
    with our_style():
        size = (8.2, 8.4 if spectrum else 6.4)
        figure = Figure(figsize=size, layout="constrained", facecolor="white")
        ratios = (3.0, 1.0, 2.2) if spectrum else (3.2, 1.0)
        axes = figure.subplots(len(ratios), 1, sharex=True, height_ratios=ratios)
        draw_data(axes[0], axes[1], fit)
        if spectrum:
            _draw_index(axes[2], fit, reference)
        else:
            axes[1].set_xlabel("angle of incidence (degrees)")
        title = fit.measurement.source.replace("$", r"\$")
        axes[0].set_title(title, loc="left", fontweight="bold", pad=24)
        text = f"{fit.model}, {fit.structure}, {fit.status}     rms = {number(fit.rms, 2)}"
        axes[0].annotate(
            text, (0.0, 1.0), (0.0, 6.0), xycoords="axes fraction", textcoords="offset points",
            va="bottom", ha="left", fontsize=10, color=GREY,
        ).set_in_layout(False)  # fmt: skip
        return figure


def save_model_plot(
    fit: ModelFit, path: str | PathLike[str], suffix: str = "", reference: str | None = None
) -> None:
    """Draw the fit to the file ``path`` in the format of ``suffix`` (default: its own)."""
    save(draw_model(fit, reference), path, suffix)
