"""The picture of a fit: data with error bars, fitted curves with bands, residuals, eta and k.

Needs matplotlib (the extra ``plot``), which is imported when a picture is drawn and not before.
"""

from __future__ import annotations

import io
import textwrap
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fitting.data import drawing
from fitting.data.drawing import GREY, MANY, Line, over_wavelength, plain_title, points
from fitting.data.measurement import Measurement
from fitting.data.quantities import ANGLES
from fitting.output import summary
from fitting.output.export import has_several_curves
from fitting.output.numbers import number, size_text, value_text
from fitting.predictions import predict
from fitting.process.visible import visible
from fitting.residuals.residuals import residuals
from fitting.results.result import FitData
from fitting.results.result_parts import CONVERGED, DETERMINED

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FORMATS = (".png", ".pdf", ".svg")
DARK = "#333333"
ETA_COLOR, K_COLOR, WARNING_COLOR = "#0072B2", "#D55E00", "#A84300"
# Who wrote it. The time of writing is left out, so that two pictures of one fit are the same file.
_PROPERTIES: dict[str, dict[str, Any]] = {
    "png": {"Software": "fresnel-fit"},
    "svg": {"Creator": "fresnel-fit", "Date": None},
    "pdf": {"Creator": "fresnel-fit", "CreationDate": None},
}
# How many warnings stand below a picture, and how many letters of each.
_WARNINGS, _LETTERS = 3, 240
# Number of points of a drawn curve over the angle, over the wavelength, and of eta and k.
_ANGLES, _WAVES, _FINE = 361, 301, 300
# A curve drawn between the data must agree with the fitted values at the data to this accuracy.
_SAME = 1e-6
# The axis of k is logarithmic if the largest k is more than _DECADES times the median one (of a
# clear plate k spans decades, of a metal hardly one); it begins at _SEEN times the largest k.
_DECADES, _SEEN = 30.0, 1e-6
# How many parameters of a batch are drawn.
_PARAMETERS = 4
# How the curves of further fits are drawn.
_OTHERS: tuple[dict[str, Any], ...] = (
    {"linestyle": "--", "color": DARK}, {"linestyle": ":", "color": "#AA3377"},
    {"linestyle": "-.", "color": "#228833"},
)  # fmt: skip
# A fitted curve: x, value and standard error, (A,) each.
Curve = tuple[np.ndarray, np.ndarray, np.ndarray]


def check_picture(path: str) -> None:
    """Raise ValueError for an unknown kind of picture file, ImportError without matplotlib."""
    if Path(path).suffix.lower() not in FORMATS:
        endings = ", ".join(FORMATS)
        raise ValueError(f"--plot {path}: the name of a picture must end in one of {endings}.")
    drawing.check_matplotlib("--plot")


def picture_bytes(figure: Figure, suffix: str) -> bytes:
    """Return the file of a picture, of the kind that ``suffix`` (".png") says.

    The same figure gives the same bytes.
    """
    kind, out = suffix.lower().lstrip("."), io.BytesIO()
    with drawing.style():
        figure.savefig(out, format=kind, metadata=_PROPERTIES[kind])
    return out.getvalue()


def _symbol(name: str) -> str:
    """Return a shown name as a picture writes it: the symbol of an index, else as it is."""
    index = {"eta": r"\eta", "k": "k", "<n>": r"\langle n \rangle", "<k>": r"\langle k \rangle"}
    return f"${index[name]}$" if name in index else name


def _band(axes: Axes, x: Any, value: Any, sigma: Any, color: str, least: float = -np.inf) -> None:
    """Draw a one-sigma band, where it is known, no lower than ``least``."""
    if np.isfinite(value - sigma).any():
        low, high = np.maximum(value - sigma, least), value + sigma
        axes.fill_between(x, low, high, color=color, alpha=0.22, linewidth=0, zorder=1)


def _curves_of(fit: FitData, m: Measurement, lines: list[Line]) -> tuple[np.ndarray, list[Curve]]:
    """Return data - fit of every datum, (N,), and the fitted curve of each line.

    It ends at the data themselves where nothing is known in between (an index that is free at every
    wavelength), and where a curve in between is not that of these data: of a second file with a
    scale of its own.
    """
    at_data = predict(fit, m)
    residual = residuals(m, at_data.value)
    spectrum, axis = over_wavelength(m), drawing.axis_of(m)
    at_rows = [(axis[li.rows], at_data.value[li.rows], at_data.sigma[li.rows]) for li in lines]
    if (spectrum and fit.shape) or not np.isfinite(at_data.value).any():
        return residual, at_rows
    x = np.linspace(*drawing.span_of(m), _WAVES if spectrum else _ANGLES)
    # One question for all lines: fewer programs are compiled.
    asked = [np.concatenate([x, axis[line.rows]]) for line in lines]
    rows = np.repeat([line.rows[0] for line in lines], [len(one) for one in asked])
    over = {"wavelength_um" if spectrum else "angle_deg": np.concatenate(asked)}
    found = predict(fit, replace(m.where(rows), **over))
    ends, n, out = np.cumsum([len(one) for one in asked])[:-1], len(x), []
    values, sigmas = np.split(found.value, ends), np.split(found.sigma, ends)
    for line, mine, value, sigma in zip(lines, at_rows, values, sigmas, strict=True):
        off = np.abs(value[n:] - mine[1])
        off = np.minimum(off, 360.0 - off) if line.panel[0] == "delta" else off
        same = np.nanmax(off, initial=0.0) <= _SAME * max(1.0, np.nanmax(np.abs(mine[1])))
        out.append((x, value[:n], sigma[:n]) if same else mine)
    return residual, out


def _draw_line(
    top: Axes, bottom: Axes, m: Measurement, residual: np.ndarray, line: Line, curve: Curve
) -> bool:
    """Draw data, fitted curve and band on ``top``, data - fit (N,) on ``bottom``.

    Returns whether there is a band.
    """
    x, measured, sigma = (a[line.rows] for a in (drawing.axis_of(m), m.value, m.sigma))
    points(top, x, measured, sigma, line.look, line.label)
    points(bottom, x, residual[line.rows], sigma, line.look, "")
    at, value, error = curve
    if np.isnan(value).all():
        return False
    if line.panel[0] == "delta":
        # from 0 to 360 or -180 to 180, as measured; broken where it goes round
        value = (value + 180.0) % 360.0 - 180.0 if (measured < 0.0).any() else value % 360.0
        value = np.where(np.abs(np.diff(value, prepend=value[:1])) > 180.0, np.nan, value)
    # What lies on another line, R_back on R for one, leaves it to be seen.
    top.plot(at, value, "--" if line.look[2] else "-", color=line.look[0], zorder=2)
    _band(top, at, value, error, line.look[0])
    return bool(np.isfinite(error).any())


def _legend(axes: Axes, banded: bool, outside: bool, few: bool) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles, labels = axes.get_legend_handles_labels()
    fit: Any = Line2D([], [], color=GREY)
    if banded:
        fit = (Patch(color=GREY, alpha=0.22, linewidth=0), fit)
    # "best" is the default; not named, matplotlib warns where finding the place takes a second.
    place: Any = {"loc": "best"}
    if outside:
        place = {"loc": "upper left", "bbox_to_anchor": (1.0, 1.0), "borderpad": 0.0}
    labels.append(r"fit with 1$\sigma$ band" if banded else "fit")
    scale = 1.0 if few else 2.0
    axes.legend([*handles, fit], labels, handlelength=1.6, markerscale=scale, **place)


def _legend_of_fits(figure: Figure, fits: Sequence[FitData]) -> None:
    """Name several fits above the picture, each by its sample and how well it fits."""
    from matplotlib.lines import Line2D

    looks = [{"color": GREY}, *(_OTHERS[j % len(_OTHERS)] for j in range(len(fits) - 1))]
    rms = (size_text(float(np.nanmedian(fit.rms)), 2) for fit in fits)
    names = [f"{plain_title(str(f.sample))}, rms {x}" for f, x in zip(fits, rms, strict=True)]
    figure.legend([Line2D([], [], **look) for look in looks], names, loc="outside upper left")


def _fine(fit: FitData) -> np.ndarray:
    """Return the wavelengths at which a curve of the index is drawn."""
    known = summary.index_waves(fit)
    return np.linspace(known.min(), known.max(), _FINE)


def _index_of(fit: FitData) -> tuple[np.ndarray, ...]:
    """Return wavelengths, eta and k of a fit, of a formula between the measured ones, too."""
    if fit.shape:
        return tuple(map(np.asarray, (fit.wavelength_um, fit.eta, fit.k)))
    band = fit.index(_fine(fit))
    return band.wavelength_um, band.eta, band.k


def _has_k(fit: FitData) -> bool:
    """Whether there is a k to be drawn: one above 0, or its upper limit."""
    e = fit.parameters.get("k")
    limited = e is not None and np.isfinite(e.upper_limit).any()
    return bool(limited or (np.nan_to_num(_index_of(fit)[2]) > 0.0).any())


def _draw_data(
    figure: Figure, fit: FitData, m: Measurement, with_index: bool, reference: str | None,
    others: Sequence[FitData],
) -> Axes:  # fmt: skip
    of_files: Any = (None, ())
    if m is fit.measurement:
        of_files = fit.curve, fit.curve_names if has_several_curves(fit) else ()
    lines = drawing.lines_of(m, *of_files)
    with_k = with_index and (reference is not None or any(map(_has_k, (fit, *others))))
    own, index = drawing.panel_axes(figure, lines, (3.0, 1.0), [2.2] * (with_index + with_k))
    residual, curves = _curves_of(fit, m, lines)
    further = [_curves_of(other, m, lines) for other in others]
    for panel, (top, bottom) in own.items():
        of = [i for i, line in enumerate(lines) if line.panel == panel]
        banded = [_draw_line(top, bottom, m, residual, lines[i], curves[i]) for i in of]
        for j, (off, others_curves) in enumerate(further):
            look = _OTHERS[j % len(_OTHERS)]
            for i in of:
                x, value, _ = others_curves[i]
                top.plot(x, value, **look)
                rows = lines[i].rows
                bottom.plot(drawing.axis_of(m)[rows], off[rows], linewidth=1.2, **look)
        few = all(len(lines[i].rows) <= MANY for i in of)
        outside = over_wavelength(m) and len(own) == 1 and len(of) > 3
        _legend(top, any(banded), outside, few)
        drawing.finish_panel(top, panel[0], m.quantity)
        bottom.axhline(0.0, color=GREY, linewidth=1.0, zorder=2)
        # Below 1e-4 there is nothing to see in a reflectance but rounding.
        far = max(1.05 * max(abs(limit) for limit in bottom.get_ylim()), 1e-4)
        bottom.set_ylim(-far, far)
        bottom.set_ylabel("data \u2212 fit" + r" ($\degree$)" * (panel[0] in ANGLES))
    if others:
        _legend_of_fits(figure, [fit, *others])
    if index:
        _draw_index(index, fit, reference, others)
    drawing.finish_x([*(bottom for _, bottom in own.values()), *index], m)
    return next(iter(own.values()))[0]


def _each(axes: Axes, fit: FitData, name: str, color: str, x: np.ndarray, mark: str) -> np.ndarray:
    """Draw a parameter of which each fit of a batch has a value; return the values that are shown.

    mark: how many of them are drawn, "-" as a line or "." as dots.
    """
    e = fit.parameters[name]
    value, sigma, limit = (
        np.broadcast_to(a, fit.shape).ravel() for a in (e.value, e.sigma, e.upper_limit)
    )
    good = np.isin(np.ravel(fit.status), DETERMINED)
    known = good & np.isfinite(sigma) & ~np.isfinite(limit)
    if known.sum() > MANY:
        gap = np.where(known, value, np.nan)
        axes.plot(x, gap, mark, markersize=2.0, color=color, zorder=3, rasterized=mark == ".")
        _band(axes, x, gap, sigma, color, 0.0 if name == "k" else -np.inf)
    elif known.any():
        points(axes, x[known], value[known], sigma[known], (color, "o", False), "")
    bare, limited = good & ~known, good & np.isfinite(limit)
    look: Any = {"markerfacecolor": "white", "zorder": 3}
    if bare.any():
        label = "compatible with 0" if limited.any() else "without a standard error"
        look_bare = {"markersize": 5.0, "markeredgecolor": color, "markeredgewidth": 1.2}
        axes.plot(x[bare], value[bare], "o", label=label, **look, **look_bare)
    if limited.any():
        label = "95 % upper limit"
        axes.plot(x[limited], limit[limited], "v", color=color, markersize=6.0, label=label, **look)
    if not good.all():
        axes.plot(
            x[~good], np.zeros(int(np.sum(~good))), "|", transform=axes.get_xaxis_transform(),
            color=GREY, markersize=9.0, label="not determined",
        )  # fmt: skip
    if not good.any():
        axes.text(
            0.5, 0.5, "not determined by these data", transform=axes.transAxes,
            ha="center", va="center", color=GREY,
        )  # fmt: skip
        axes.set_yticks([])
    return np.concatenate([value[good], limit[limited]])


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


def _draw_index(
    panels: Sequence[Axes], fit: FitData, reference: str | None, others: Sequence[FitData]
) -> None:
    """Draw eta, and k if there are two panels, over wavelength with their errors and limits.

    A tick marks a wavelength at which the data do not determine them. reference: a named material,
    whose eta and k are drawn for comparison; None for none.
    """
    fine = _fine(fit)
    lines = [(_index_of(other), _OTHERS[j % len(_OTHERS)]) for j, other in enumerate(others)]
    if reference:
        look = {"color": GREY, "linewidth": 1.2, "linestyle": "--"}
        look["label"] = f"{reference} (reference)"
        lines.append((summary.reference_index(reference, fine), look))
    found = None if fit.shape else fit.index(fine)
    for i, (axes, name, color) in enumerate(
        zip(panels, ("eta", "k"), (ETA_COLOR, K_COLOR), strict=False)
    ):
        least = 0.0 if name == "k" else -np.inf
        if found is None:
            values = [_each(axes, fit, name, color, np.asarray(fit.wavelength_um), "-")]
        else:
            value = getattr(found, name)
            values = [value]
            axes.plot(fine, value, color=color)
            _band(axes, fine, value, getattr(found, f"sigma_{name}"), color, least)
        for columns, look in lines:
            axes.plot(columns[0], columns[1 + i], **look)
            values.append(np.ravel(columns[1 + i]))
        if name == "k":
            _scale_of_k(axes, np.concatenate(values))
        axes.set_ylabel(_symbol(summary.shown_name(fit, name)))
        if axes.get_legend_handles_labels()[0]:
            axes.legend(loc="best")


def _draw_batch(figure: Figure, fit: FitData) -> Axes:
    """Draw the parameters of a batch over its curves, or as maps; return the first axes."""
    names = [name for name in summary.varied_of(fit) if fit.parameters[name].free][:_PARAMETERS]
    labels = [f"{_symbol(name)} {fit.parameters[name].unit}".rstrip() for name in names]
    if len(fit.shape) == 2:  # white where no fit converged
        axes = np.atleast_1d(figure.subplots(1, len(names)))
        good = np.isin(fit.status, DETERMINED)
        for on, name, label in zip(axes, names, labels, strict=True):
            value = np.where(good, np.asarray(fit.parameters[name].value), np.nan)
            image = on.imshow(value, origin="lower", aspect="auto", interpolation="nearest")
            figure.colorbar(image, ax=on, label=label)
            on.grid(False)
            on.set_xlabel("index on the second axis of the batch")
            on.set_ylabel("index on the first axis of the batch")
        return axes[0]
    axes = np.atleast_1d(figure.subplots(len(names), 1, sharex=True))
    x = np.arange(np.size(fit.status))
    for i, (on, name) in enumerate(zip(axes, names, strict=True)):
        _each(on, fit, name, (ETA_COLOR, K_COLOR)[i % 2], x, ".")
        on.set_ylabel(labels[i])
    axes[-1].set_xlabel("index of the curve")
    axes[-1].set_xlim(-0.5, x.size - 0.5)
    axes[-1].xaxis.get_major_locator().set_params(integer=True)
    return axes[0]


def _subtitle(fit: FitData) -> str:
    """Return in one line what was found."""
    sample = plain_title(str(fit.sample or "your own residual function"))
    if fit.shape or fit.status != CONVERGED:
        return f"{sample}, {summary.status_of(fit)}"
    parts = [] if len(fit.names) <= 2 else [sample]
    for name in () if parts else fit.names:
        text = value_text(fit.parameters[name], summary.reach(fit)).replace("+-", r"$\pm$")
        parts.append(f"{_symbol(summary.shown_name(fit, name))} = {text}")
    if np.isfinite(fit.chi2_reduced):
        parts.append(rf"$\chi^2$/dof = {number(fit.chi2_reduced, 3)}")
    return "     ".join([*parts, f"rms = {size_text(fit.rms, 2)}"])


def _titles(
    figure: Figure, axes: Axes, title: str, fit: FitData, reference: str, warnings: bool
) -> None:
    """Write what was fitted and found above ``axes``, and the warnings below the figure.

    warnings: whether; not where they stand beside it. reference: text about a reference material,
    which stands below too; "" for none.
    """
    axes.set_title(plain_title(title), fontweight="bold", pad=28)
    axes.annotate(
        _subtitle(fit), (0.0, 1.0), (0.0, 9.0), xycoords="axes fraction",
        textcoords="offset points", va="bottom", ha="left", color=DARK,
    ).set_in_layout(False)  # fmt: skip  # the padding of the title leaves room for it
    texts = [visible(text).replace("$", r"\$") for _, text in summary.warnings_of(fit) if warnings]
    if not (texts or reference):
        return
    shown = [
        textwrap.shorten(f"Warning: {text}", _LETTERS, placeholder=" ...")
        for text in texts[:_WARNINGS]
    ]
    if (more := len(texts) - _WARNINGS) > 0:
        shown.append(f"and {summary.counted(more, 'more warning')}: see the table")
    shown += [f"Reference {reference}"] * bool(reference)
    width = int(13.5 * figure.get_figwidth())
    text = "\n".join(textwrap.fill(one, width) for one in shown)
    color = WARNING_COLOR if texts else DARK
    figure.supxlabel(text, x=0.01, ha="left", fontsize=9, color=color)


def draw(
    fit: FitData, reference: str | None = None, others: Sequence[FitData] = (),
    warnings: bool = True, measurement: Measurement | None = None,
) -> Figure:  # fmt: skip
    """Return a matplotlib Figure of a fit; see `Fit.plot`. warnings: whether they stand below."""
    drawing.check_matplotlib("plot")
    from matplotlib.figure import Figure

    m = fit.measurement if measurement is None else measurement
    if fit.shape and fit.measurement is None and measurement is not None:
        raise ValueError(
            "a measurement came, and this fit is a batch. Pick the fit of its curve: "
            "fit[3].plot(measurement=m)."
        )
    if m is None and not fit.shape:
        raise ValueError(
            "there is nothing to draw: this fit is of one curve and keeps no data. Give those of "
            "the curve: fit.plot(measurement=Measurement.from_columns(angles_deg, wavelength_um, "
            "R_s=R_s[3]))."
            if fit.sample is not None
            else "there is nothing to draw: this fit is of your own residuals. Draw your model."
        )
    with_index = m is not None and over_wavelength(m) and len(summary.index_waves(fit)) > 0
    with_index = with_index and (not fit.shape or {"eta", "k"} <= set(fit.parameters))
    below = summary.reference_text(reference, fit.wavelength_um) if reference else ""
    title = summary.title_of(fit) if m is None else visible(m.source)
    with drawing.style():
        figure = Figure(figsize=(8.2, 6.4), layout="constrained", facecolor="white")
        if m is None:
            first = _draw_batch(figure, fit)
        else:
            first = _draw_data(figure, fit, m, with_index, reference, others)
        _titles(figure, first, title, fit, "" if with_index else below, warnings)
        figure.align_ylabels()
        return figure
