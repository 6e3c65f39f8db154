"""The picture of fits wavelength by wavelength: data and fit, residuals, eta and k as points."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fitting.model.points import PointFits
from fitting.output.plot_model import draw_data, reference_index
from fitting.output.plot_parts import GREY, our_style

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def draw_points(fits: PointFits, reference: str | None = None) -> Figure:
    """Return a matplotlib Figure: data with the fit, data - fit, eta, and k on a logarithmic axis.

    reference: a named material, whose eta and k are drawn beside.
    Raises ImportError where matplotlib is not installed, ValueError for an unknown material.
    """
    from matplotlib.figure import Figure

    x = fits.wavelength_um
    with our_style():
        figure = Figure(figsize=(8.2, 10.0), layout="constrained", facecolor="white")
        axes = figure.subplots(4, 1, sharex=True, height_ratios=(3.0, 1.0, 2.0, 2.0))
        draw_data(axes[0], axes[1], fits)
        for on, value, sigma, color, label in (
            (axes[2], fits.eta, fits.sigma_eta, "#0072B2", r"$\eta$"),
            (axes[3], fits.k, fits.sigma_k, "#D55E00", r"$k$"),
        ):
            error = np.where(np.isfinite(sigma), sigma, 0.0)
            on.errorbar(x, value, yerr=error, fmt=".", color=color, markersize=4, elinewidth=1.0)
            on.set_ylabel(label)
        if (fits.k > 0.0).any():
            axes[3].set_yscale("log")
        if reference:
            shown, eta, k = reference_index(reference, np.linspace(x.min(), x.max(), 300))
            axes[2].plot(shown, eta, "--", color=GREY, label=f"{reference} (reference)")
            if (k > 0.0).any():
                axes[3].plot(shown, k, "--", color=GREY)
            axes[2].legend(loc="best", fontsize=9)
        axes[3].set_xlabel("wavelength (\u00b5m)")
        title = fits.measurement.source.replace("$", r"\$")
        axes[0].set_title(title, loc="left", fontweight="bold")
        return figure


def save_point_plot(
    fits: PointFits, path: str | PathLike[str], suffix: str = "", reference: str | None = None
) -> None:
    """Draw the fits to the file ``path`` in the format of ``suffix`` (default: its own)."""
    figure = draw_points(fits, reference)
    with our_style():
        figure.savefig(path, format=(suffix or Path(path).suffix).lower().lstrip("."))
