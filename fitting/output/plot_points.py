"""The picture of fits wavelength by wavelength: data and fit, residuals, eta and k as points."""

from __future__ import annotations

from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np

from fitting.model.points import PointFits
from fitting.output.plot_model import MANY, draw_data
from fitting.output.plot_parts import GREY, our_style, points, save
from fitting.output.point_report import names_of, one_line
from fitting.output.reference import reference_index

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# k of a clear plate runs over decades; that of a metal hardly over one.
_DECADES = 30.0


def _draw_index(eta_axes: Any, k_axes: Any, fits: PointFits, reference: str | None) -> None:
    x = fits.wavelength_um
    loose = fits.status != "converged"
    labels = [r"$\langle n \rangle$", r"$\langle k \rangle$"] if fits.pseudo else [r"$\eta$", "$k$"]
    for on, value, sigma, color, label in (
        (eta_axes, fits.eta, fits.sigma_eta, "#0072B2", labels[0]),
        (k_axes, fits.k, fits.sigma_k, "#D55E00", labels[1]),
    ):
        good = ~loose
        if good.sum() > MANY:
            on.plot(x[good], value[good], ".", color=color, markersize=4)
            low, high = value - sigma, value + sigma
            on.fill_between(x, low, high, where=good, color=color, alpha=0.22, linewidth=0)
        elif good.any():
            points(on, x[good], value[good], sigma[good], color, "o", "")
        if loose.any():
            on.plot(
                x[loose], np.zeros(loose.sum()), "|", transform=on.get_xaxis_transform(),
                color=GREY, markersize=9.0, label="not determined",
            )  # fmt: skip
        on.set_ylabel(label)
    k = fits.k[fits.k > 0.0]
    if len(k) and k.max() > _DECADES * np.median(k):
        k_axes.set_yscale("log")
    if reference:
        shown, eta, k = reference_index(reference, np.linspace(x.min(), x.max(), 300))
        eta_axes.plot(shown, eta, "--", color=GREY, label=f"{reference} (reference)")
        if (k > 0.0).any():
            k_axes.plot(shown, k, "--", color=GREY)
    for on in (eta_axes, k_axes):
        if on.get_legend_handles_labels()[0]:
            on.legend(loc="best", fontsize=9)
    k_axes.set_xlabel("wavelength (\u00b5m)")


def draw_points(fits: PointFits, reference: str | None = None) -> Figure:
    """Return a matplotlib Figure: data with the fit, data - fit, and over wavelength eta and k.

    Data at one wavelength are drawn over the angle. reference: a named material, whose eta and k
    are drawn beside.
    Raises ImportError where matplotlib is not installed, ValueError for an unknown material.
    """
    from matplotlib.figure import Figure

    spectrum = len(fits.fits) > 1
    with our_style():
        size, ratios = ((8.2, 10.0), (3, 1, 2, 2)) if spectrum else ((8.2, 6.4), (3, 1))
        figure = Figure(figsize=size, layout="constrained", facecolor="white")
        axes = figure.subplots(len(ratios), 1, sharex=True, height_ratios=ratios)
        draw_data(axes[0], axes[1], fits)
        if spectrum:
            _draw_index(axes[2], axes[3], fits, reference)
        else:
            axes[1].set_xlabel("angle of incidence (degrees)")
        title = fits.measurement.source.replace("$", r"\$")
        axes[0].set_title(title, loc="left", fontweight="bold", pad=24)
        what = one_line(fits) if not spectrum else f"{names_of(fits)}, wavelength by wavelength"
        axes[0].annotate(
            what.replace("+-", r"$\pm$"), (0.0, 1.0), (0.0, 6.0), xycoords="axes fraction",
            textcoords="offset points", va="bottom", ha="left", fontsize=10, color=GREY,
        ).set_in_layout(False)  # fmt: skip
        return figure


def save_point_plot(
    fits: PointFits, path: str | PathLike[str], suffix: str = "", reference: str | None = None
) -> None:
    """Draw the fits to the file ``path`` in the format of ``suffix`` (default: its own)."""
    save(draw_points(fits, reference), path, suffix)
