"""Data and fitted curves of a picture: what is drawn together, and the fitted curve in between."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fitting.data.measurement import Measurement
from fitting.data.quantities import POWERS, TABLE
from fitting.output.estimates import has_several_curves
from fitting.output.style import GREY, band, points
from fitting.process.visible import visible
from fitting.results.result import Fit

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Number of points of a drawn curve over the angle, and over the wavelength.
_ANGLES, _WAVES = 361, 301
# With more angles than that a legend gives their range.
_LINES = 7
# A curve drawn between the data must agree with the fitted values at the data to this accuracy.
_SAME = 1e-6

PANELS = ("power", *(name for name in TABLE if name not in POWERS))


class Line(NamedTuple):
    """Data that one curve runs through.

    rows: of the measurement, in the order of x. kind: one of `PANELS`. look: colour, marker,
    whether it is hollow. label: for the legend; "" for none.
    """

    rows: np.ndarray
    kind: str
    look: tuple[str, str, bool]
    label: str


class Curve(NamedTuple):
    """A fitted curve and its standard error, (A,) each."""

    x: np.ndarray
    value: np.ndarray
    sigma: np.ndarray


def over_wavelength(m: Measurement) -> bool:
    """Whether there is more than one wavelength, and the picture is drawn over it."""
    return len(np.unique(m.wavelength_um[np.isfinite(m.wavelength_um)])) > 1


def _axis(m: Measurement) -> np.ndarray:
    return m.wavelength_um if over_wavelength(m) else m.angle_deg


def _series(fit: Fit, m: Measurement) -> Iterator[tuple[str, str, float, np.ndarray]]:
    """Yield name, quantity, polarizer's angle (-1 for none) and mask of each kind of datum."""
    curve = np.zeros(len(m), int) if fit.curve is None else np.asarray(fit.curve)
    several, polarizer = has_several_curves(fit), np.nan_to_num(m.polarizer_deg, nan=-1.0)
    for i, quantity in dict.fromkeys(zip(curve.tolist(), m.quantity.tolist(), strict=True)):
        of = (curve == i) & (m.quantity == quantity)
        name = fit.curve_names[i].replace("NCS", quantity) if several else ""
        for angle in np.unique(polarizer[of]).tolist():
            yield name, quantity, angle, of & (polarizer == angle)


def _look(quantity: str, polarizer: float, place: int) -> tuple[tuple[str, str, bool], str]:
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


def _shade(color: str, share: float) -> str:
    """Return the colour, paler for a small ``share`` of 1."""
    from matplotlib.colors import to_hex, to_rgb

    paler = 1.0 - (1.0 - np.array(to_rgb(color))) * (0.4 + 0.6 * share)
    return to_hex((paler[0], paler[1], paler[2]))


def lines_of(fit: Fit, m: Measurement) -> list[Line]:
    """Return what is drawn as one line each: a quantity, over the wavelength at one angle."""
    waves, out = over_wavelength(m), []
    seen: dict[str, int] = {}
    for name, quantity, polarizer, of in _series(fit, m):
        look, label = _look(quantity, polarizer, seen.get(quantity, 0) if name else 0)
        seen[quantity] = seen.get(quantity, 0) + 1
        kind = quantity if quantity in PANELS else "power"
        label = f"{label} {visible(name)}".replace("$ ", "$, ") if name else label
        angles = np.unique(m.angle_deg[of]).tolist() if waves else [math.nan]
        for i, angle in enumerate(angles):
            rows = np.flatnonzero(of & (m.angle_deg == angle) if waves else of)
            rows = rows[np.argsort(_axis(m)[rows], kind="stable")]
            share = 1.0 if len(angles) == 1 else i / (len(angles) - 1)
            shade = look if share == 1.0 else (_shade(look[0], share), *look[1:])
            text = label
            if waves and len(angles) > _LINES:
                text = (
                    f"{label}, {angles[0]:g} to {angles[-1]:g}$\\degree$\n(darker: larger)"
                    if i == len(angles) - 1 else ""
                )  # fmt: skip
            elif waves and (len(angles) > 1 or angle > 0.0):
                text = rf"{label}, {angle:g}$\degree$"
            out.append(Line(rows, kind, shade, text))
    return out


def curves_of(fit: Fit, m: Measurement, lines: list[Line], low: float, high: float) -> list[Curve]:
    """Return the fitted curve of each line from ``low`` to ``high``.

    At the data themselves where nothing is known in between (an index that is free at every
    wavelength), and where a curve in between is not that of these data: of a second file with a
    scale of its own.
    """
    at_data, spectrum = fit.predict(), over_wavelength(m)
    axis = _axis(m)
    own = [Curve(axis[li.rows], at_data.value[li.rows], at_data.sigma[li.rows]) for li in lines]
    if (spectrum and fit.shape) or not np.isfinite(at_data.value).any():
        return own
    x = np.linspace(low, high, _WAVES if spectrum else _ANGLES)
    # One question for all lines: fewer programs are compiled.
    asked = [np.concatenate([x, axis[line.rows]]) for line in lines]
    rows = [np.repeat(line.rows[0], len(one)) for line, one in zip(lines, asked, strict=True)]
    over = {"wavelength_um" if spectrum else "angle_deg": np.concatenate(asked)}
    found = fit.predict(replace(m.where(np.concatenate(rows)), **over))
    ends = np.cumsum([len(one) for one in asked])[:-1]
    out = []
    for line, mine, value, sigma in zip(
        lines, own, np.split(found.value, ends), np.split(found.sigma, ends), strict=True
    ):
        off = np.abs(value[len(x) :] - mine.value)
        off = np.minimum(off, 360.0 - off) if line.kind == "delta" else off
        same = np.nanmax(off, initial=0.0) <= _SAME * max(1.0, np.nanmax(np.abs(mine.value)))
        out.append(Curve(x, value[: len(x)], sigma[: len(x)]) if same else mine)
    return out


def _broken(value: np.ndarray, measured: np.ndarray) -> np.ndarray:
    """Return Delta as it was measured, from 0 to 360 or -180 to 180, broken where it goes round."""
    value = (value + 180.0) % 360.0 - 180.0 if (measured < 0.0).any() else value % 360.0
    return np.where(np.abs(np.diff(value, prepend=value[:1])) > 180.0, np.nan, value)


def draw_line(
    panels: tuple[Axes, Axes], m: Measurement, residual: np.ndarray, line: Line, curve: Curve
) -> bool:
    """Draw data, fitted curve and band on the first panel, data - fit on the second.

    residual: (N,), of every datum. Returns whether there is a band.
    """
    top, bottom = panels
    x, measured, sigma = (column[line.rows] for column in (_axis(m), m.value, m.sigma))
    points(top, x, measured, sigma, line.look, line.label)
    points(bottom, x, residual[line.rows], sigma, line.look, "")
    if np.isnan(curve.value).all():
        return False
    value = _broken(curve.value, measured) if line.kind == "delta" else curve.value
    color = line.look[0]
    # What lies on another line, R_back on R for one, leaves it to be seen.
    top.plot(curve.x, value, "--" if line.look[2] else "-", color=color, zorder=2)
    band(top, curve.x, value - curve.sigma, value + curve.sigma, color)
    return bool(np.isfinite(curve.sigma).any())


def power_label(m: Measurement) -> str:
    """Return the label of the axis of powers."""
    return ", ".join(dict.fromkeys(TABLE[name].axis for name in POWERS if name in m.quantity))


def draw_zero(axes: Axes, unit: str) -> None:
    """Make ``axes`` those of data - fit: a line at 0, as much room above it as below."""
    axes.axhline(0.0, color=GREY, linewidth=1.0, zorder=2)
    # Below 1e-4 there is nothing to see in a reflectance but rounding.
    reach = max(1.05 * max(abs(limit) for limit in axes.get_ylim()), 1e-4)
    axes.set_ylim(-reach, reach)
    axes.set_ylabel(f"data \u2212 fit{unit}")
