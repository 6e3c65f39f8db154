"""Pictures of measured data: one line a quantity and angle, in panels of few lines.

Needs matplotlib (the extra ``plot``), which is imported when a picture is drawn and not before.
"""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fitting.data.errors import MissingExtra
from fitting.data.quantities import POWERS, TABLE
from fitting.process.visible import visible

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Measurement = Any  # which draws itself by this module

GREY = "#595959"
# Beyond this many points a line marks run together and are drawn small.
MANY = 60
# Curves over the wavelength at more angles than that go to panels of so many each; at more than
# _MOST angles all go to one, and the legend gives their range.
_TOGETHER, _MOST = 3, 12
# Pictures show wavelengths in nm if all are below this.
_NM_BELOW_UM = 10.0
PANELS = ("power", *(name for name in TABLE if name not in POWERS))
# Colour, marker, and whether it is hollow.
Look = tuple[str, str, bool]
# What is drawn together: one of `PANELS`, and which group of angles.
Panel = tuple[str, int]


class Line(NamedTuple):
    """Data that one curve runs through.

    rows: of the measurement, in the order of x. label: for the legend; "" for none.
    """

    rows: np.ndarray
    panel: Panel
    look: Look
    label: str


def style() -> Any:
    """Return the context in which pictures are drawn and written."""
    from matplotlib import style

    file = Path(__file__).parents[1] / "output" / "fresnel_fit.mplstyle"
    return style.context(file, after_reset=True)


def check_matplotlib(asked: str) -> None:
    """Raise ImportError where matplotlib, which ``asked`` needs, is not installed."""
    if importlib.util.find_spec("matplotlib") is None:
        raise MissingExtra(asked, "matplotlib", "plot")


def plain_title(text: str) -> str:
    """Return ``text`` as a title of one line; the middle of a long text is left out."""
    if len(text) > 78:
        text = f"{text[:37]} ... {text[-36:]}"
    return visible(text).replace("$", r"\$")


def points(axes: Axes, x: Any, y: Any, sigma: Any, look: Look, label: str) -> None:
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


def over_wavelength(m: Measurement) -> bool:
    """Whether there is more than one wavelength, and the picture is drawn over it."""
    return len(np.unique(m.wavelength_um[np.isfinite(m.wavelength_um)])) > 1


def axis_of(m: Measurement) -> np.ndarray:
    """Return what the picture is drawn over, (N,): the wavelength or the angle."""
    return m.wavelength_um if over_wavelength(m) else m.angle_deg


def lines_of(m: Measurement, curve: np.ndarray | None = None, names: Any = ()) -> list[Line]:
    """Return what is drawn as one line each: a quantity, over the wavelength at one angle.

    curve: (N,) which of ``names`` (a quantity of a file) each datum is of; None for one file.
    """
    from matplotlib import colormaps
    from matplotlib.colors import to_hex, to_rgb

    waves, out = over_wavelength(m), []
    of_file = np.zeros(len(m), int) if curve is None else np.asarray(curve)
    polarizers = np.nan_to_num(m.polarizer_deg, nan=-1.0)
    kinds = dict.fromkeys(
        zip(of_file.tolist(), m.quantity.tolist(), polarizers.tolist(), strict=True)
    )
    seen: list[str] = []
    for number, quantity, polarizer in kinds:
        of = (of_file == number) & (m.quantity == quantity) & (polarizers == polarizer)
        color, marker, hollow, label = TABLE[quantity][3:7]
        if polarizer >= 0.0:
            color, marker = to_hex(colormaps["cividis"](polarizer / 90.0)), "P"
            label = rf"{label or quantity}, polarizer at {polarizer:g}$\degree$"
        if names:
            name = visible(names[number].replace("NCS", quantity))
            label = f"{label or quantity} {name}".replace("$ ", "$, ")
            if place := seen.count(quantity):  # a second file with the same quantity
                other = TABLE[POWERS[(place + 2) % len(POWERS)]]
                color, marker = other.color, other.marker
        seen.append(quantity)
        angles = np.unique(m.angle_deg[of]).tolist() if waves else [math.nan]
        groups = -(-len(angles) // _TOGETHER) if len(angles) <= _MOST else 1
        each = np.array_split(np.arange(len(angles)), groups)
        for group, some in enumerate(each):
            last = len(some) - 1
            for i, angle in enumerate(angles[j] for j in some):
                rows = np.flatnonzero(of & (m.angle_deg == angle) if waves else of)
                rows = rows[np.argsort(axis_of(m)[rows], kind="stable")]
                shade, text = color, label or quantity
                if i < last:  # paler for a small angle
                    paler = 1.0 - (1.0 - np.array(to_rgb(color))) * (0.4 + 0.6 * i / last)
                    shade = to_hex(paler.tolist())  # pyright: ignore[reportArgumentType]
                if len(angles) > _MOST:
                    text = f"{text}, {angles[0]:g} to {angles[-1]:g}$\\degree$\n(darker: larger)"
                    text = text if i == last else ""
                elif waves and (len(angles) > 1 or angle > 0.0):
                    text = rf"{text}, {angle:g}$\degree$"
                kind = quantity if quantity in PANELS else "power"
                out.append(Line(rows, (kind, group), (shade, marker, hollow), text))
    return out


def span_of(m: Measurement) -> tuple[float, float]:
    """Return the wavelengths; or 0 to 90 degrees, less if the angles span less than 45."""
    if over_wavelength(m):
        return float(np.nanmin(m.wavelength_um)), float(np.nanmax(m.wavelength_um))
    low, high = float(m.angle_deg.min()), float(m.angle_deg.max())
    if high - low >= 45.0:
        return 0.0, 90.0
    margin = max(0.15 * (high - low), 2.0)
    return max(low - margin, 0.0), min(high + margin, 90.0)


def finish_panel(axes: Axes, kind: str, quantity: np.ndarray) -> None:
    """Name the axis of values of a panel, and end that of powers at 0 and 1."""
    axes.set_ylabel(TABLE[kind].axis if kind in TABLE else "")
    if kind == "power":
        names = dict.fromkeys(TABLE[name].axis for name in POWERS if name in quantity)
        axes.set_ylabel(", ".join(names))
        low, high = axes.get_ylim()
        axes.set_ylim(max(low, -0.02), min(high, 1.02))


def finish_x(every: Iterable[Axes], m: Measurement) -> None:
    """Name the axis of wavelengths or angles below the lowest axes of each column.

    Wavelengths are labelled in nm below 10 um, the habit of the field; the axis itself has um.
    """
    low, high = span_of(m)
    for axes in {one.get_subplotspec().colspan.start: one for one in every}.values():  # type: ignore
        axes.tick_params(labelbottom=True)
        if not over_wavelength(m):
            axes.set_xlabel("angle of incidence (degrees)")
            axes.set_xlim(low, high)
            if high - low == 90.0:
                axes.set_xticks(range(0, 91, 15))
        elif high < _NM_BELOW_UM:
            axes.set_xlabel("wavelength (nm)")
            axes.xaxis.set_major_formatter(lambda um, _: f"{1e3 * um:.6g}")
        else:
            axes.set_xlabel("wavelength (\u00b5m)")


def panel_axes(
    figure: Figure, lines: Sequence[Line], heights: Sequence[float], below: Sequence[float] = ()
) -> tuple[dict[Panel, tuple[Axes, ...]], list[Axes]]:
    """Return the axes of each panel, one of each height below the other; and those below all.

    A column is a quantity, of one quantity up to three groups of angles. below: the heights of
    further axes; of several columns they stand side by side. Heights are in inches.
    """
    panels = sorted({line.panel for line in lines}, key=lambda p: (PANELS.index(p[0]), p[1]))
    kinds = list(dict.fromkeys(kind for kind, _ in panels))
    places = {(kind, group): (group, kinds.index(kind)) for kind, group in panels}
    if len(kinds) == 1:
        places = {panel: divmod(i, 3) for i, panel in enumerate(panels)}
    rows, columns = (max(place) + 1 for place in zip(*places.values(), strict=True))
    every = [*list(heights) * rows, *(below if columns == 1 else below[:1])]
    width = 6.0 * columns if columns > 1 else 8.2 if below else 7.4
    figure.set_size_inches(width, 2.0 + sum(every))
    axes = figure.subplots(len(every), columns, sharex=True, height_ratios=every, squeeze=False)
    n = len(heights)
    own = {panel: tuple(axes[n * r : n * (r + 1), c]) for panel, (r, c) in places.items()}
    further = [*axes[n * rows :].flat[: len(below)]]
    for one in {*axes.flat} - {one for several in own.values() for one in several} - {*further}:
        one.remove()
    return own, further


def draw_measurement(m: Measurement) -> Figure:
    """Return a matplotlib Figure of the data with their stated errors."""
    check_matplotlib("plot")
    from matplotlib.figure import Figure

    with style():
        lines = lines_of(m)
        figure = Figure(layout="constrained", facecolor="white")
        own, _ = panel_axes(figure, lines, (3.0,))
        for panel, (axes,) in own.items():
            for line in lines:
                if line.panel == panel:
                    x, value, sigma = (a[line.rows] for a in (axis_of(m), m.value, m.sigma))
                    points(axes, x, value, sigma, line.look, line.label)
            finish_panel(axes, panel[0], m.quantity)
            axes.legend(loc="best")
        finish_x(figure.axes, m)
        figure.axes[0].set_title(plain_title(m.source), fontweight="bold")
        return figure
