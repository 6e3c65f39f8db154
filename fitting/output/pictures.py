"""The picture of a fit: data with error bars, fitted curves with bands, residuals, eta and k.

Needs matplotlib (the extra ``plot``), which is imported when a picture is drawn and not before.
"""

from __future__ import annotations

import importlib.util
import io
import math
import textwrap
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fitting.data.errors import MissingExtra
from fitting.data.measurement import Measurement
from fitting.data.quantities import ANGLES, POWERS, TABLE
from fitting.output.export import has_several_curves
from fitting.output.numbers import number, size_text, value_text, with_unit
from fitting.output.summary import (
    counted,
    index_waves,
    reach,
    reference_index,
    reference_text,
    shown_name,
    status_of,
    title_of,
    varied_of,
    warnings_of,
)
from fitting.predictions import predict
from fitting.process.visible import visible
from fitting.residuals.residuals import residuals
from fitting.results.result import FitData
from fitting.results.result_parts import CONVERGED

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FORMATS = (".png", ".pdf", ".svg")
GREY, DARK = "#595959", "#333333"
ETA_COLOR, K_COLOR, WARNING_COLOR = "#0072B2", "#D55E00", "#A84300"
# Who wrote it. The time of writing is left out, so that two pictures of one fit are the same file.
_PROPERTIES: dict[str, dict[str, Any]] = {
    "png": {"Software": "fresnel-fit"},
    "svg": {"Creator": "fresnel-fit", "Date": None},
    "pdf": {"Creator": "fresnel-fit", "CreationDate": None},
}
# How many warnings stand below a picture, and how many letters of each.
_WARNINGS, _LETTERS = 3, 240
# Beyond this many points a line marks run together and are drawn small.
MANY = 60
# Number of points of a drawn curve over the angle, over the wavelength, and of eta and k.
_ANGLES, _WAVES, _FINE = 361, 301, 300
# With more angles than that a legend gives their range.
_LINES = 7
# A curve drawn between the data must agree with the fitted values at the data to this accuracy.
_SAME = 1e-6
# The axis of k is logarithmic if the largest k is more than _DECADES times the median one (of a
# clear plate k spans decades, of a metal hardly one); it begins at _SEEN times the largest k.
_DECADES, _SEEN = 30.0, 1e-6
# How many parameters of a batch are drawn.
_PARAMETERS = 4
PANELS = ("power", *(name for name in TABLE if name not in POWERS))
# Colour, marker, and whether it is hollow.
Look = tuple[str, str, bool]


class Line(NamedTuple):
    """Data that one curve runs through.

    rows: of the measurement, in the order of x. kind: one of `PANELS`. label: for the legend; ""
    for none.
    """

    rows: np.ndarray
    kind: str
    look: Look
    label: str


# A fitted curve: x, value and standard error, (A,) each.
Curve = tuple[np.ndarray, np.ndarray, np.ndarray]


def style() -> Any:
    """Return the context in which pictures are drawn and written."""
    from matplotlib import style

    return style.context(Path(__file__).with_name("fresnel_fit.mplstyle"), after_reset=True)


def check_matplotlib(asked: str) -> None:
    """Raise ImportError where matplotlib, which ``asked`` needs, is not installed."""
    if importlib.util.find_spec("matplotlib") is None:
        raise MissingExtra(asked, "matplotlib", "plot")


def check_picture(path: str) -> None:
    """Raise ValueError for an unknown kind of picture file, ImportError without matplotlib."""
    if Path(path).suffix.lower() not in FORMATS:
        endings = ", ".join(FORMATS)
        raise ValueError(f"--plot {path}: the name of a picture must end in one of {endings}.")
    check_matplotlib("--plot")


def picture_bytes(figure: Figure, suffix: str) -> bytes:
    """Return the file of a picture, of the kind that ``suffix`` (".png") says.

    The same figure gives the same bytes.
    """
    kind, out = suffix.lower().lstrip("."), io.BytesIO()
    with style():
        figure.savefig(out, format=kind, metadata=_PROPERTIES[kind])
    return out.getvalue()


def _symbol(name: str) -> str:
    """Return a shown name as a picture writes it: the symbol of an index, else as it is."""
    index = {"eta": r"\eta", "k": "k", "<n>": r"\langle n \rangle", "<k>": r"\langle k \rangle"}
    return f"${index[name]}$" if name in index else name


def _plain_title(text: str) -> str:
    """Return ``text`` as a title of one line; the middle of a long text is left out."""
    if len(text) > 78:
        text = f"{text[:37]} ... {text[-36:]}"
    return text.replace("$", r"\$")


def _points(
    axes: Axes, x: Any, y: Any, sigma: Any, look: tuple[str, str, bool], label: str
) -> None:
    """Draw data with one-sigma bars where there is a sigma; many of them as small dots."""
    color, marker, hollow = look
    sigma = np.asarray(sigma)
    error = np.where(np.isfinite(sigma), sigma, 0.0) if np.isfinite(sigma).any() else None
    many = len(x) > MANY
    axes.errorbar(
        x, y, yerr=error, fmt=marker, color=color, label=label,
        markersize=(3.2 if hollow else 2.4) if many else 5.5,
        markerfacecolor="none" if hollow else color,
        markeredgecolor=color if hollow else "white",
        markeredgewidth=(0.6 if hollow else 0.0) if many else (1.0 if hollow else 0.6),
        elinewidth=0.7 if many else 1.4, capsize=0.0, zorder=3,
    )  # fmt: skip


def _band(axes: Axes, x: Any, value: Any, sigma: Any, color: str, least: float = -np.inf) -> None:
    """Draw a one-sigma band, where it is known, no lower than ``least``."""
    if np.isfinite(value - sigma).any():
        low, high = np.maximum(value - sigma, least), value + sigma
        axes.fill_between(x, low, high, color=color, alpha=0.22, linewidth=0, zorder=1)


def over_wavelength(m: Measurement) -> bool:
    """Whether there is more than one wavelength, and the picture is drawn over it."""
    return len(np.unique(m.wavelength_um[np.isfinite(m.wavelength_um)])) > 1


def _axis(m: Measurement) -> np.ndarray:
    return m.wavelength_um if over_wavelength(m) else m.angle_deg


def _look(quantity: str, polarizer: float, place: int) -> tuple[Look, str]:
    """Return how a kind of datum is drawn, and its label; ``place``: of so many of its quantity."""
    color, marker, hollow, label = TABLE[quantity][3:7]
    if polarizer >= 0.0:
        from matplotlib import colormaps
        from matplotlib.colors import to_hex

        color, marker = to_hex(colormaps["cividis"](polarizer / 90.0)), "P"
        label = rf"{label or quantity}, polarizer at {polarizer:g}$\degree$"
    if place:  # a second file with the same quantity
        other = TABLE[POWERS[(place + 2) % len(POWERS)]]
        color, marker = other.color, other.marker
    return (color, marker, hollow), label or quantity


def _lines_of(fit: FitData, m: Measurement) -> list[Line]:
    """Return what is drawn as one line each: a quantity, over the wavelength at one angle."""
    from matplotlib.colors import to_hex, to_rgb

    waves, several, out = over_wavelength(m), has_several_curves(fit), []
    curve = np.zeros(len(m), int) if fit.curve is None else np.asarray(fit.curve)
    polarizers = np.nan_to_num(m.polarizer_deg, nan=-1.0)
    kinds = dict.fromkeys(
        zip(curve.tolist(), m.quantity.tolist(), polarizers.tolist(), strict=True)
    )
    seen: dict[str, int] = {}
    for number_of, quantity, polarizer in kinds:
        of = (curve == number_of) & (m.quantity == quantity) & (polarizers == polarizer)
        name = visible(fit.curve_names[number_of].replace("NCS", quantity)) if several else ""
        look, label = _look(quantity, polarizer, seen.get(quantity, 0) if name else 0)
        seen[quantity] = seen.get(quantity, 0) + 1
        label = f"{label} {name}".replace("$ ", "$, ") if name else label
        angles = np.unique(m.angle_deg[of]).tolist() if waves else [math.nan]
        last = len(angles) - 1
        for i, angle in enumerate(angles):
            rows = np.flatnonzero(of & (m.angle_deg == angle) if waves else of)
            rows = rows[np.argsort(_axis(m)[rows], kind="stable")]
            shade, text = look[0], label
            if i < last:  # paler for a small angle
                paler = 1.0 - (1.0 - np.array(to_rgb(look[0]))) * (0.4 + 0.6 * i / last)
                shade = to_hex(paler.tolist())  # pyright: ignore[reportArgumentType]
            if waves and len(angles) > _LINES:
                text = f"{label}, {angles[0]:g} to {angles[-1]:g}$\\degree$\n(darker: larger)"
                text = text if i == last else ""
            elif waves and (last or angle > 0.0):
                text = rf"{label}, {angle:g}$\degree$"
            kind = quantity if quantity in PANELS else "power"
            out.append(Line(rows, kind, (shade, *look[1:]), text))
    return out


def _curves_of(
    fit: FitData, m: Measurement, lines: list[Line], low: float, high: float
) -> list[Curve]:
    """Return the fitted curve of each line from ``low`` to ``high``.

    At the data themselves where nothing is known in between (an index that is free at every
    wavelength), and where a curve in between is not that of these data: of a second file with a
    scale of its own.
    """
    at_data, spectrum, axis = predict(fit), over_wavelength(m), _axis(m)
    own = [(axis[li.rows], at_data.value[li.rows], at_data.sigma[li.rows]) for li in lines]
    if (spectrum and fit.shape) or not np.isfinite(at_data.value).any():
        return own
    x = np.linspace(low, high, _WAVES if spectrum else _ANGLES)
    # One question for all lines: fewer programs are compiled.
    asked = [np.concatenate([x, axis[line.rows]]) for line in lines]
    rows = np.repeat([line.rows[0] for line in lines], [len(one) for one in asked])
    over = {"wavelength_um" if spectrum else "angle_deg": np.concatenate(asked)}
    found = predict(fit, replace(m.where(rows), **over))
    ends = np.cumsum([len(one) for one in asked])[:-1]
    each = zip(lines, own, np.split(found.value, ends), np.split(found.sigma, ends), strict=True)
    out = []
    for line, mine, value, sigma in each:
        off = np.abs(value[len(x) :] - mine[1])
        off = np.minimum(off, 360.0 - off) if line.kind == "delta" else off
        same = np.nanmax(off, initial=0.0) <= _SAME * max(1.0, np.nanmax(np.abs(mine[1])))
        out.append((x, value[: len(x)], sigma[: len(x)]) if same else mine)
    return out


def _draw_line(
    panels: tuple[Axes, Axes], m: Measurement, residual: np.ndarray, line: Line, curve: Curve
) -> bool:
    """Draw data, fitted curve and band on the first panel, data - fit on the second.

    residual: (N,), of every datum. Returns whether there is a band.
    """
    x, measured, sigma = (column[line.rows] for column in (_axis(m), m.value, m.sigma))
    _points(panels[0], x, measured, sigma, line.look, line.label)
    _points(panels[1], x, residual[line.rows], sigma, line.look, "")
    at, value, error = curve
    if np.isnan(value).all():
        return False
    if (
        line.kind == "delta"
    ):  # from 0 to 360 or -180 to 180, as measured; broken where it goes round
        value = (value + 180.0) % 360.0 - 180.0 if (measured < 0.0).any() else value % 360.0
        value = np.where(np.abs(np.diff(value, prepend=value[:1])) > 180.0, np.nan, value)
    # What lies on another line, R_back on R for one, leaves it to be seen.
    panels[0].plot(at, value, "--" if line.look[2] else "-", color=line.look[0], zorder=2)
    _band(panels[0], at, value, error, line.look[0])
    return bool(np.isfinite(error).any())


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
    n = len(kinds)
    if n == 1:
        size = (8.2, 10.0) if spectrum else (7.4, 6.2)
        ratios = (3.0, 1.0, 2.0, 2.0) if spectrum else (3.2, 1.0)
    else:
        size = (6.2 * n, 8.6 if spectrum else 6.0)
        ratios = (3.0, 1.0, 2.4) if spectrum else (3.0, 1.0)
    figure.set_size_inches(size)
    axes = figure.subplots(len(ratios), n, sharex=True, height_ratios=ratios, squeeze=False)
    for extra in axes[2:, 2:].flat:
        extra.set_visible(False)
    index = (axes[2, 0], axes[3, 0] if n == 1 else axes[2, 1]) if spectrum else None
    return dict(zip(kinds, axes[:2].T, strict=True)), index


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


def _draw_data(
    figure: Figure, fit: FitData, m: Measurement, with_index: bool, reference: str | None
) -> Axes:
    lines = _lines_of(fit, m)
    kinds = [kind for kind in PANELS if any(line.kind == kind for line in lines)]
    spectrum = over_wavelength(m)
    pairs, index = _panels(figure, kinds, with_index)
    low, high = _span(m)
    curves = _curves_of(fit, m, lines, low, high)
    residual = residuals(m, fit.fitted)
    for kind, (top, bottom) in pairs.items():
        of = [one for one in zip(lines, curves, strict=True) if one[0].kind == kind]
        banded = [_draw_line((top, bottom), m, residual, line, curve) for line, curve in of]
        few = all(len(line.rows) <= MANY for line, _ in of)
        _legend(top, any(banded), spectrum and len(kinds) == 1, few)
        top.set_ylabel(TABLE[kind].axis if kind in TABLE else "")
        if kind == "power":
            names = dict.fromkeys(TABLE[name].axis for name in POWERS if name in m.quantity)
            top.set_ylabel(", ".join(names))
            y_low, y_high = top.get_ylim()
            top.set_ylim(max(y_low, -0.02), min(y_high, 1.02))
        bottom.axhline(0.0, color=GREY, linewidth=1.0, zorder=2)
        # Below 1e-4 there is nothing to see in a reflectance but rounding.
        far = max(1.05 * max(abs(limit) for limit in bottom.get_ylim()), 1e-4)
        bottom.set_ylim(-far, far)
        bottom.set_ylabel("data \u2212 fit" + r" ($\degree$)" * (kind in ANGLES))
    lowest = [bottom for _, bottom in pairs.values()]
    if not spectrum:
        lowest[0].set_xlim(low, high)  # and so all others
        if high - low == 90.0:
            lowest[0].set_xticks(range(0, 91, 15))
    if index is not None:
        _draw_index(*index, fit, reference)
        lowest = [*index, *lowest[2:]] if len(kinds) > 1 else [index[1]]
    for axes in lowest:
        axes.set_xlabel("wavelength (\u00b5m)" if spectrum else "angle of incidence (degrees)")
        axes.tick_params(labelbottom=True)
    return pairs[kinds[0]][0]


def _each(axes: Axes, fit: FitData, name: str, color: str, x: np.ndarray, mark: str) -> np.ndarray:
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
        _band(axes, x, gap, sigma, color, 0.0 if name == "k" else -np.inf)
    elif known.any():
        _points(axes, x[known], value[known], sigma[known], (color, "o", False), "")
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
            x[~good], np.zeros(np.sum(~good)), "|", transform=axes.get_xaxis_transform(),
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


def _draw_index(first: Axes, second: Axes, fit: FitData, reference: str | None) -> None:
    """Draw eta and k over wavelength with their errors and limits, each in a panel of its own.

    A tick marks a wavelength at which the data do not determine them. reference: a named material,
    whose eta and k are drawn for comparison; None for none.
    """
    known = index_waves(fit)
    fine = np.linspace(known.min(), known.max(), _FINE)
    if fit.shape:
        x = np.asarray(fit.wavelength_um)
        _each(first, fit, "eta", ETA_COLOR, x, "-")
        k = _each(second, fit, "k", K_COLOR, x, "-")
    else:
        found = fit.index(fine)
        k = found.k
        first.plot(fine, found.eta, color=ETA_COLOR)
        _band(first, fine, found.eta, found.sigma_eta, ETA_COLOR)
        second.plot(fine, k, color=K_COLOR)
        _band(second, fine, k, found.sigma_k, K_COLOR, 0.0)
    if reference:
        at, eta, other = reference_index(reference, fine)
        look: dict[str, Any] = {"color": GREY, "linewidth": 1.2, "linestyle": "--"}
        first.plot(at, eta, label=f"{reference} (reference)", **look)
        second.plot(at, other, **look)
        k = np.concatenate([k, other])
    _scale_of_k(second, k)
    for axes, name in ((first, "eta"), (second, "k")):
        axes.set_ylabel(_symbol(shown_name(fit, name)))
        if axes.get_legend_handles_labels()[0]:
            axes.legend(loc="best")


def _draw_batch(figure: Figure, fit: FitData) -> Axes:
    """Draw the parameters of a batch over its curves, or as maps; return the first axes."""
    names = [name for name in varied_of(fit) if fit.parameters[name].free][:_PARAMETERS]
    labels = [with_unit(_symbol(name), fit.parameters[name].unit) for name in names]
    if len(fit.shape) == 2:  # white where no fit converged
        axes = np.atleast_1d(figure.subplots(1, len(names)))
        good = np.asarray(fit.status) == CONVERGED
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
    sample = _plain_title(str(fit.sample or "your own residual function"))
    if fit.shape or fit.status != CONVERGED:
        return f"{sample}, {status_of(fit)}"
    parts = [] if len(fit.names) <= 2 else [sample]
    for name in () if parts else fit.names:
        text = value_text(fit.parameters[name], reach(fit)).replace("+-", r"$\pm$")
        parts.append(f"{_symbol(shown_name(fit, name))} = {text}")
    if np.isfinite(fit.chi2_reduced):
        parts.append(rf"$\chi^2$/dof = {number(fit.chi2_reduced, 3)}")
    return "     ".join([*parts, f"rms = {size_text(fit.rms, 2)}"])


def _titles(figure: Figure, axes: Axes, fit: FitData, reference: str) -> None:
    """Write what was fitted and found above ``axes``, and the warnings below the figure.

    reference: text about a reference material, which stands below too; "" for none.
    """
    axes.set_title(_plain_title(title_of(fit)), fontweight="bold", pad=28)
    axes.annotate(
        _subtitle(fit), (0.0, 1.0), (0.0, 9.0), xycoords="axes fraction",
        textcoords="offset points", va="bottom", ha="left", color=DARK,
    ).set_in_layout(False)  # fmt: skip  # the padding of the title leaves room for it
    texts = [visible(text).replace("$", r"\$") for _, text in warnings_of(fit)]
    if not (texts or reference):
        return
    shown = [
        textwrap.shorten(f"Warning: {text}", _LETTERS, placeholder=" ...")
        for text in texts[:_WARNINGS]
    ]
    if (more := len(texts) - _WARNINGS) > 0:
        shown.append(f"and {counted(more, 'more warning')}: see the table")
    shown += [f"Reference {reference}"] * bool(reference)
    width = int(13.5 * figure.get_figwidth())
    text = "\n".join(textwrap.fill(one, width) for one in shown)
    color = WARNING_COLOR if texts else DARK
    figure.supxlabel(text, x=0.01, ha="left", fontsize=9, color=color)


def draw(fit: FitData, reference: str | None = None) -> Figure:
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

    m = fit.measurement
    if m is None and not fit.shape:
        raise ValueError(
            "there is nothing to draw: this fit is of one curve and keeps no data. To keep them, "
            "fit a Measurement with fit(...)."
        )
    with_index = m is not None and over_wavelength(m) and len(index_waves(fit)) > 0
    with_index = with_index and (not fit.shape or {"eta", "k"} <= set(fit.parameters))
    below = reference_text(reference, fit.wavelength_um) if reference else ""
    with style():
        figure = Figure(figsize=(8.2, 6.4), layout="constrained", facecolor="white")
        if m is None:
            first = _draw_batch(figure, fit)
        else:
            first = _draw_data(figure, fit, m, with_index, reference)
        _titles(figure, first, fit, "" if with_index else below)
        figure.align_ylabels()
        return figure
