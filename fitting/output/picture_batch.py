"""The picture of a batch that keeps no data: its parameters over the curves, or as maps."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fitting.output.numbers import with_unit
from fitting.output.style import ETA_COLOR, K_COLOR, MANY, band, points, symbol
from fitting.output.text_table import varied_of
from fitting.results.result import CONVERGED, Fit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_PARAMETERS = 4


def _label(fit: Fit, name: str) -> str:
    return with_unit(symbol(name), fit.parameters[name].unit)


def _maps(figure: Figure, fit: Fit, names: list[str]) -> Axes:
    """Draw a map of each parameter over a batch of two axes; white where no fit converged."""
    axes = np.atleast_1d(figure.subplots(1, len(names)))
    good = np.asarray(fit.status) == CONVERGED
    for on, name in zip(axes, names, strict=True):
        value = np.where(good, np.asarray(fit.parameters[name].value), np.nan)
        image = on.imshow(value, origin="lower", aspect="auto", interpolation="nearest")
        figure.colorbar(image, ax=on, label=_label(fit, name))
        on.grid(False)
        on.set_xlabel("index on the second axis of the batch")
        on.set_ylabel("index on the first axis of the batch")
    return axes[0]


def _lines(figure: Figure, fit: Fit, names: list[str]) -> Axes:
    axes = np.atleast_1d(figure.subplots(len(names), 1, sharex=True))
    good = np.ravel(np.asarray(fit.status) == CONVERGED)
    x = np.arange(good.size)
    for i, (on, name) in enumerate(zip(axes, names, strict=True)):
        value = np.where(good, np.ravel(fit.parameters[name].value), np.nan)
        sigma = np.ravel(fit.parameters[name].sigma)
        color = (ETA_COLOR, K_COLOR)[i % 2]
        if good.size > MANY:
            on.plot(x, value, ".", markersize=2.0, color=color, rasterized=True)
            low = value - sigma if name != "k" else np.maximum(value - sigma, 0.0)
            band(on, x, low, value + sigma, color)
        else:
            points(on, x, value, sigma, (color, "o", False, ""), "")
        on.set_ylabel(_label(fit, name))
    axes[-1].set_xlabel("index of the curve")
    axes[-1].set_xlim(-0.5, good.size - 0.5)
    axes[-1].xaxis.get_major_locator().set_params(integer=True)
    return axes[0]


def draw_batch(figure: Figure, fit: Fit) -> Axes:
    """Draw the fitted parameters of a batch into the empty ``figure``; return the first axes."""
    names = [name for name in varied_of(fit) if fit.parameters[name].free][:_PARAMETERS]
    return (_maps if len(fit.shape) == 2 else _lines)(figure, fit, names)
