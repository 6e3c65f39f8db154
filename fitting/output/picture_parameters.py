"""Panels of parameters: eta and k over the wavelength, and the parameters of a batch of curves."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from fitting.output.estimates import index_waves, shown_name
from fitting.output.numbers import with_unit
from fitting.output.reference import reference_index
from fitting.output.style import ETA_COLOR, GREY, K_COLOR, MANY, band, points, symbol
from fitting.output.text_table import varied_of
from fitting.results.result import Fit
from fitting.results.result_parts import CONVERGED

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# The axis of k is logarithmic if the largest k is more than _DECADES times the median one (of a
# clear plate k spans decades, of a metal hardly one); it begins at _SEEN times the largest k.
_DECADES, _SEEN = 30.0, 1e-6
_FINE = 300
# How many parameters of a batch are drawn.
_PARAMETERS = 4


def _not_determined(axes: Axes, x: np.ndarray, everywhere: bool) -> None:
    axes.plot(
        x, np.zeros(len(x)), "|", transform=axes.get_xaxis_transform(), color=GREY,
        markersize=9.0, label="not determined",
    )  # fmt: skip
    if everywhere:
        axes.text(
            0.5, 0.5, "not determined by these data", transform=axes.transAxes,
            ha="center", va="center", color=GREY,
        )  # fmt: skip
        axes.set_yticks([])


def _each(axes: Axes, fit: Fit, name: str, color: str, x: np.ndarray, mark: str) -> np.ndarray:
    """Draw a parameter of which each fit of a batch has a value; return the values that are shown.

    mark: how many of them are drawn, "-" as a line or "." as dots.
    """
    e = fit.parameters[name]
    value, sigma, limit = (
        np.broadcast_to(a, fit.shape).ravel() for a in (e.value, e.sigma, e.upper_limit)
    )
    good = np.ravel(fit.status) == CONVERGED
    known = good & np.isfinite(sigma) & ~np.isfinite(limit)
    if known.sum() > MANY:
        gap = np.where(known, value, np.nan)
        axes.plot(x, gap, mark, markersize=2.0, color=color, zorder=3, rasterized=mark == ".")
        low = gap - sigma if name != "k" else np.maximum(gap - sigma, 0.0)
        band(axes, x, low, gap + sigma, color)
    elif known.any():
        points(axes, x[known], value[known], sigma[known], (color, "o", False), "")
    bare = good & ~known
    if bare.any():
        limits = np.isfinite(limit[bare]).any()
        label = "compatible with 0" if limits else "without a standard error"
        axes.plot(
            x[bare], value[bare], "o", markersize=5.0, markerfacecolor="white",
            markeredgecolor=color, markeredgewidth=1.2, zorder=3, label=label,
        )  # fmt: skip
    limited = good & np.isfinite(limit)
    if limited.any():
        axes.plot(
            x[limited], limit[limited], "v", color=color, markersize=6.0, zorder=3,
            markerfacecolor="white", label="95 % upper limit",
        )  # fmt: skip
    if not good.all():
        _not_determined(axes, x[~good], not good.any())
    return np.concatenate([value[good], limit[limited]])


def _grid(fit: Fit) -> np.ndarray:
    """Return many wavelengths from the first to the last that was measured."""
    known = index_waves(fit)
    return np.linspace(known.min(), known.max(), _FINE)


def _dispersion(first: Axes, second: Axes, fit: Fit) -> np.ndarray:
    """Draw eta and k of a dispersion model with their bands; return k."""
    fine = _grid(fit)
    found = fit.index(fine)
    first.plot(fine, found.eta, color=ETA_COLOR)
    band(first, fine, found.eta - found.sigma_eta, found.eta + found.sigma_eta, ETA_COLOR)
    second.plot(fine, found.k, color=K_COLOR)
    # k is never below 0.
    least = np.maximum(found.k - found.sigma_k, 0.0)
    band(second, fine, least, found.k + found.sigma_k, K_COLOR)
    return found.k


def _scale_of_k(axes: Axes, k: np.ndarray) -> None:
    """Make the axis of k logarithmic if k spans decades, else let it begin at 0."""
    positive = k[np.isfinite(k) & (k > 0.0)]
    if len(positive) and positive.max() > _DECADES * np.median(positive):
        least = max(positive.min(), _SEEN * positive.max())
        axes.set_yscale("log")
        axes.set_ylim(0.5 * least, 2.5 * positive.max())
        return
    low, high = axes.get_ylim()
    if len(k) and low < 0.3 * high:
        axes.set_ylim(-0.04 * high, high)  # from 0, with room for the points that lie there


def draw_index(first: Axes, second: Axes, fit: Fit, reference: str | None) -> None:
    """Draw eta and k over wavelength with their errors and limits, each in a panel of its own.

    A tick marks a wavelength at which the data do not determine them. reference: a named material,
    whose eta and k are drawn for comparison; None for none.
    """
    if fit.shape:
        x = np.asarray(fit.wavelength_um)
        _each(first, fit, "eta", ETA_COLOR, x, "-")
        k = _each(second, fit, "k", K_COLOR, x, "-")
    else:
        k = _dispersion(first, second, fit)
    if reference:
        at, eta, other = reference_index(reference, _grid(fit))
        look: dict[str, Any] = {"color": GREY, "linewidth": 1.2, "linestyle": "--"}
        first.plot(at, eta, label=f"{reference} (reference)", **look)
        second.plot(at, other, **look)
        k = np.concatenate([k, other])
    _scale_of_k(second, k)
    for axes, name in ((first, "eta"), (second, "k")):
        axes.set_ylabel(symbol(shown_name(fit, name)))
        if axes.get_legend_handles_labels()[0]:
            axes.legend(loc="best")


def _maps(figure: Figure, fit: Fit, labels: dict[str, str]) -> Axes:
    """Draw a map of each parameter over a batch of two axes; white where no fit converged."""
    axes = np.atleast_1d(figure.subplots(1, len(labels)))
    good = np.asarray(fit.status) == CONVERGED
    for on, (name, label) in zip(axes, labels.items(), strict=True):
        value = np.where(good, np.asarray(fit.parameters[name].value), np.nan)
        image = on.imshow(value, origin="lower", aspect="auto", interpolation="nearest")
        figure.colorbar(image, ax=on, label=label)
        on.grid(False)
        on.set_xlabel("index on the second axis of the batch")
        on.set_ylabel("index on the first axis of the batch")
    return axes[0]


def draw_batch(figure: Figure, fit: Fit) -> Axes:
    """Draw the parameters of a batch over its curves, or as maps; return the first axes."""
    names = [name for name in varied_of(fit) if fit.parameters[name].free][:_PARAMETERS]
    labels = {name: with_unit(symbol(name), fit.parameters[name].unit) for name in names}
    if len(fit.shape) == 2:
        return _maps(figure, fit, labels)
    axes = np.atleast_1d(figure.subplots(len(names), 1, sharex=True))
    x = np.arange(np.size(fit.status))
    for i, (on, name) in enumerate(zip(axes, names, strict=True)):
        _each(on, fit, name, (ETA_COLOR, K_COLOR)[i % 2], x, ".")
        on.set_ylabel(labels[name])
    axes[-1].set_xlabel("index of the curve")
    axes[-1].set_xlim(-0.5, x.size - 0.5)
    axes[-1].xaxis.get_major_locator().set_params(integer=True)
    return axes[0]
