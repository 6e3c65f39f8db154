"""The picture of a fit: data with error bars, fitted curves with bands, residuals, eta and k.

Needs matplotlib (the extra ``plot``), which is imported when a picture is drawn and not before.
"""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Any

import numpy as np

from fitting.data.quantities import ANGLES, TABLE
from fitting.output import facts
from fitting.output.estimates import reach, shown_name, value_text
from fitting.output.numbers import number, size_text
from fitting.output.picture_data import (
    PANELS,
    curves_of,
    draw_line,
    draw_zero,
    lines_of,
    over_wavelength,
    power_label,
)
from fitting.output.picture_parameters import draw_batch, draw_index
from fitting.output.reference import check_reference, reference_text
from fitting.output.style import (
    GREY,
    MANY,
    WARNING_COLOR,
    check_matplotlib,
    our_style,
    plain_title,
    symbol,
)
from fitting.output.text_table import warnings_of
from fitting.process.visible import visible
from fitting.results.result import Fit
from fitting.results.result_parts import CONVERGED

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from fitting.data.measurement import Measurement

# How many warnings stand below a picture, and how many letters of each.
_WARNINGS, _LETTERS = 3, 240


def _subtitle(fit: Fit) -> str:
    """Return in one line what was found."""
    sample = plain_title(str(fit.sample or "your own residual function"))
    if fit.shape or fit.status != CONVERGED:
        return f"{sample}, {facts.converged(fit)}"
    parts = [] if len(fit.names) <= 2 else [sample]
    for name in () if parts else fit.names:
        text = value_text(fit.parameters[name], reach(fit)).replace("+-", r"$\pm$")
        parts.append(f"{symbol(shown_name(fit, name))} = {text}")
    if np.isfinite(fit.chi2_reduced):
        parts.append(rf"$\chi^2$/dof = {number(fit.chi2_reduced, 3)}")
    return "     ".join([*parts, f"rms = {size_text(fit.rms, 2)}"])


def _titles(figure: Figure, axes: Axes, fit: Fit, reference: str) -> None:
    """Write what was fitted and found above ``axes``, and the warnings below the figure.

    reference: text about a reference material, which stands below too; "" for none.
    """
    axes.set_title(plain_title(facts.title_of(fit)), loc="left", fontweight="bold", pad=28)
    axes.annotate(
        _subtitle(fit), (0.0, 1.0), (0.0, 9.0), xycoords="axes fraction",
        textcoords="offset points", va="bottom", ha="left", color="#333333",
    ).set_in_layout(False)  # fmt: skip  # the padding of the title leaves room for it
    texts = [visible(text).replace("$", r"\$") for _, text in warnings_of(fit)]
    if not (texts or reference):
        return
    width = int(13.5 * figure.get_figwidth())
    shown = [
        textwrap.fill(textwrap.shorten(f"Warning: {text}", _LETTERS, placeholder=" ..."), width)
        for text in texts[:_WARNINGS]
    ]
    more = len(texts) - _WARNINGS
    if more > 0:
        shown.append(f"and {facts.counted(more, 'more warning')}: see the table")
    if reference:
        shown.append(textwrap.fill(f"Reference {reference}", width))
    color = WARNING_COLOR if texts else "#333333"
    figure.supxlabel("\n".join(shown), x=0.01, ha="left", fontsize=9, color=color)


def _span(m: Measurement) -> tuple[float, float]:
    """Return the wavelengths; or 0 to 90 degrees, less if the angles span less than 45."""
    if over_wavelength(m):
        return float(np.nanmin(m.wavelength_um)), float(np.nanmax(m.wavelength_um))
    low, high = float(m.angle_deg.min()), float(m.angle_deg.max())
    if high - low >= 45.0:
        return 0.0, 90.0
    margin = max(0.15 * (high - low), 2.0)
    return max(low - margin, 0.0), min(high + margin, 90.0)


def _panels(figure: Figure, kinds: list[str], spectrum: bool) -> tuple[Any, tuple[Any, Any] | None]:
    """Return for each kind of quantity the axes of data and of residuals; and those of eta and k.

    One kind: all below each other. More: one column each, eta and k below the first two.
    """
    if len(kinds) == 1:
        figure.set_size_inches((8.2, 10.0) if spectrum else (7.4, 6.2))
        ratios = (3.0, 1.0, 2.0, 2.0) if spectrum else (3.2, 1.0)
        axes = figure.subplots(len(ratios), 1, sharex=True, height_ratios=ratios)
        return {kinds[0]: (axes[0], axes[1])}, (axes[2], axes[3]) if spectrum else None
    figure.set_size_inches(6.2 * len(kinds), 8.6 if spectrum else 6.0)
    ratios = (3.0, 1.0, 2.4) if spectrum else (3.0, 1.0)
    axes = figure.subplots(len(ratios), len(kinds), sharex=True, height_ratios=ratios)
    pairs = {kind: (axes[0, i], axes[1, i]) for i, kind in enumerate(kinds)}
    for extra in axes[2, 2:] if spectrum else ():
        extra.set_visible(False)
    return pairs, (axes[2, 0], axes[2, 1]) if spectrum else None


def _legend(axes: Axes, banded: bool, outside: bool, few: bool) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles, labels = axes.get_legend_handles_labels()
    fit = Line2D([], [], color=GREY)
    shade = Patch(color=GREY, alpha=0.22, linewidth=0)
    handle, label = ((shade, fit), r"fit with 1$\sigma$ band") if banded else (fit, "fit")
    # "best" is the default; not named, matplotlib warns where finding the place takes a second.
    place: Any = {"loc": "best"}
    if outside:
        place = {"loc": "upper left", "bbox_to_anchor": (1.0, 1.0), "borderpad": 0.0}
    axes.legend(
        [*handles, handle], [*labels, label], handlelength=1.6, markerscale=1.0 if few else 2.0,
        **place,
    )  # fmt: skip


def _draw_data(figure: Figure, fit: Fit, m: Measurement, reference: str | None) -> Axes:
    lines = lines_of(fit, m)
    kinds = [kind for kind in PANELS if any(line.kind == kind for line in lines)]
    spectrum = over_wavelength(m)
    pairs, index = _panels(figure, kinds, spectrum and _has_index(fit))
    low, high = _span(m)
    curves = curves_of(fit, m, lines, low, high)
    residual = fit.residuals
    for kind, (top, bottom) in pairs.items():
        of = [one for one in zip(lines, curves, strict=True) if one[0].kind == kind]
        banded = [draw_line((top, bottom), m, residual, line, curve) for line, curve in of]
        few = all(len(line.rows) <= MANY for line, _ in of)
        _legend(top, any(banded), spectrum and len(kinds) == 1, few)
        unit = r" ($\degree$)" if kind in ANGLES else ""
        top.set_ylabel(power_label(m) if kind == "power" else TABLE[kind].axis)
        if kind == "power":
            y_low, y_high = top.get_ylim()
            top.set_ylim(max(y_low, -0.02), min(y_high, 1.02))
        draw_zero(bottom, unit)
    lowest = [bottom for _, bottom in pairs.values()]
    if not spectrum:
        lowest[0].set_xlim(low, high)  # and so all others
        if high - low == 90.0:
            lowest[0].set_xticks(range(0, 91, 15))
    if index is not None:
        draw_index(*index, fit, reference)
        lowest = [*index, *lowest[2:]] if len(kinds) > 1 else [index[1]]
    for axes in lowest:
        axes.set_xlabel("wavelength (\u00b5m)" if spectrum else "angle of incidence (degrees)")
        axes.tick_params(labelbottom=True)
    return pairs[kinds[0]][0]


def _has_index(fit: Fit) -> bool:
    """Whether there is an index over wavelength to draw."""
    if fit.sample is None or fit.evaluator is None:
        return False
    return not fit.shape or {"eta", "k"} <= set(fit.parameters)


def draw(fit: Fit, reference: str | None = None) -> Figure:
    """Return a matplotlib Figure of a fit.

    It shows data with one-sigma error bars, fitted curves with their one-sigma bands, and below
    them data - fit: powers, psi and Delta each in panels of their own, over the angle, or over the
    wavelength if there are several. Then follow eta and k, with 95 % upper limits, and a tick on
    the axis where the data do not determine them. Of a batch without data the fitted parameters are
    drawn. The warnings stand below.

    reference: a named material, whose eta and k are drawn for comparison; at one wavelength they
    stand below, as numbers.
    Raises ImportError where matplotlib is not installed, ValueError for an unknown material or
    where there is nothing to draw.
    """
    check_matplotlib("plot")
    from matplotlib.figure import Figure

    m, below = fit.measurement, ""
    if reference:
        waves = np.atleast_1d(np.asarray(fit.wavelength_um, float))
        check_reference(reference, waves)
        if m is None or not over_wavelength(m) or not _has_index(fit):
            below = reference_text(reference, waves)
    with our_style():
        figure = Figure(figsize=(8.2, 6.4), layout="constrained", facecolor="white")
        if m is not None:
            first = _draw_data(figure, fit, m, reference)
        elif fit.shape:
            first = draw_batch(figure, fit)
        else:
            raise ValueError(
                "there is nothing to draw: this fit is of one curve and keeps no data. To keep "
                "them, fit a Measurement with fit(...)."
            )
        _titles(figure, first, fit, below)
        figure.align_ylabels()
        return figure
