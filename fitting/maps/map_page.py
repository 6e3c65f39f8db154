"""What is seen of a map: a picture of its parameters, and a page with its worst pixels."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from fitting.data.drawing import GREY, check_matplotlib, style
from fitting.data.measurement import Measurement
from fitting.maps.cube import Cube
from fitting.maps.map_fit import fit_pixels
from fitting.maps.map_start import usable
from fitting.maps.map_store import CODES, MASKED, PENDING, STATUSES, MapStore
from fitting.output.page import document, element, figure, html_table
from fitting.output.pictures import picture_bytes
from fitting.predictions import predict
from fitting.results.result_parts import CONVERGED, MISFIT

# A picture has about so many pixels along an axis, and a scale between these quantiles.
_MOST, _QUANTILES = 1000, (0.02, 0.98)
_WORST = 4
_COLORS = {PENDING: "#ffffff", CONVERGED: "#009E73", "undetermined": "#E69F00",
           MISFIT: "#56B4E9", "not converged": "#D55E00", "no data": "#bbbbbb",
           "refused": "#CC79A7", MASKED: "#595959"}  # fmt: skip


def plot_map(dataset: Any) -> Any:
    """Return a matplotlib Figure of a map that `fit_map` returned.

    Each fitted parameter and its standard error with a scale from the 2 to the 98 % quantile, chi2,
    and the status. Pixels without a fit are grey. Of further axes the middle one is shown, and of
    more than 1,000 pixels along an axis some.
    """
    check_matplotlib("plot_map")
    from matplotlib.colors import ListedColormap
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    names = [name for name in dataset if f"{name}_sigma" in dataset]
    rows = [[n, f"{n}_sigma"] for n in names] + [["chi2", "status"]]
    flat: Any = {"interpolation": "nearest", "aspect": "auto"}
    with style():
        drawn = Figure((9.0, 3.4 * len(rows)), layout="constrained")
        places = drawn.subplots(len(rows), 2, squeeze=False)
        for place, name in zip(places.ravel(), np.ravel(rows), strict=True):
            array = dataset[name]
            array = array[(..., *(n // 2 for n in array.shape[2:]))] if array.ndim > 2 else array
            array = array[tuple(slice(None, None, -(-n // _MOST)) for n in array.shape)]
            values = np.atleast_2d(array.values)
            unit = array.attrs.get("units", "1")
            place.set_title(name if unit == "1" or name == "status" else f"{name} ({unit})")
            place.grid(False)
            place.set_facecolor("#bbbbbb")
            if name == "status":
                colors = ListedColormap([_COLORS[s] for s in STATUSES])
                place.imshow(values, cmap=colors, vmin=-0.5, vmax=len(STATUSES) - 0.5, **flat)
                there = [STATUSES[i] for i in np.unique(values)]
                handles = [Patch(facecolor=_COLORS[s], edgecolor=GREY, label=s) for s in there]
                place.legend(
                    handles=handles, loc="upper center", bbox_to_anchor=(0.5, -0.1), ncols=3
                )
                continue
            known = values[np.isfinite(values)]
            low, high = np.quantile(known, _QUANTILES) if len(known) else (0.0, 1.0)
            shown = place.imshow(values, vmin=low, vmax=high, **flat)
            drawn.colorbar(shown, ax=place)
    return drawn


def _worst(store: MapStore) -> tuple[dict[str, int], dict[str, int], list[tuple[int, ...]]]:
    """Return how many pixels have each status and warning, and where chi2 is largest, block by
    block."""
    statuses, warned = np.zeros(len(STATUSES), int), np.zeros(len(CODES), int)
    worst: list[tuple[float, tuple[int, ...]]] = []
    for place in np.ndindex(*store.blocks):
        index = store.index(place)
        statuses += np.bincount(np.ravel(store.status[index]), minlength=len(STATUSES))
        bits = np.ravel(store.arrays["warnings"][index])
        bits = bits[bits != 0]
        warned += [int(np.count_nonzero(bits & np.uint64(1 << i))) for i in range(len(CODES))]
        chi2 = np.asarray(store.arrays["chi2"][index])
        for flat in np.argsort(-np.nan_to_num(chi2, nan=-1.0), axis=None)[:_WORST]:
            at = np.unravel_index(flat, chi2.shape)
            if np.isfinite(chi2[at]):
                pixel = tuple(int(i) + s.start for i, s in zip(at, index, strict=True))
                worst.append((float(chi2[at]), pixel))
        worst = sorted(worst, reverse=True)[:_WORST]
    counts = {s: int(n) for s, n in zip(STATUSES, statuses, strict=True) if n}
    return (
        counts,
        {c: n for c, n in zip(CODES, warned.tolist(), strict=True) if n},
        [p for _, p in worst],
    )


def status_rows(store: MapStore) -> list[list[str]]:
    """Return a table of how many pixels have each status."""
    return _rows_of(_worst(store)[0])


def _rows_of(counts: dict[str, int]) -> list[list[str]]:
    total = sum(counts.values())
    return [["status", "pixels", "share"],
            *[[s, f"{n:,}", f"{n / total:.2%}"] for s, n in counts.items()]]  # fmt: skip


def _draw_pixel(axes: Any, store: MapStore, cube: Cube, pixel: tuple[int, ...]) -> None:
    """Draw the data of a pixel, and the curve of its fit, from where the map's fit ended."""
    values, sigma, _ = usable(*cube.block(tuple(slice(i, i + 1) for i in pixel)))
    known = store.attributes
    begin = {n: float(store.arrays[n][pixel]) for n in known["begin"]["units"]}
    fit = fit_pixels(known, cube, values, sigma, start=begin, check=0)[(0,) * len(pixel)]
    flat: dict[str, Any] = {q: v.ravel() for q, v in values.items()}
    m = Measurement.from_columns(cube.angle_deg, cube.wavelength, **flat)
    curve = predict(fit, m, "R", None).value
    x = m.wavelength_um if len(np.unique(m.wavelength_um)) > 1 else m.angle_deg
    for quantity in np.unique(m.quantity):
        own = m.quantity == quantity
        (line,) = axes.plot(x[own], m.value[own], ".", label=quantity)
        axes.plot(x[own], curve[own], color=line.get_color())
    axes.set_title(f"pixel {pixel}, chi2/dof {float(store.arrays['chi2'][pixel]):.3g}", fontsize=10)
    axes.legend()


def map_page(store: MapStore, cube: Cube, picture: Any, command: str) -> str:
    """Return one page: what was read, statuses, warnings, the maps, and the worst pixels' fits."""
    from matplotlib.figure import Figure

    counts, warned, worst = _worst(store)
    known = store.attributes
    facts = [["", ""], ["read", known["read"]], ["sample", known["sample"]],
             *[["shared", f"{n} = {v:.6g} +- {s:.2g}"] for n, (v, s) in known["shared"].items()],
             *[["not fitted", text] for text in known["failed_blocks"]]]  # fmt: skip
    parts = [element("h1", known["title"]), html_table("Map", facts)]
    parts.append(html_table("Pixels", _rows_of(counts)))
    if warned:
        rows = [["warning", "pixels"], *[[c, f"{n:,}"] for c, n in warned.items()]]
        parts.append(html_table("Warnings", rows))
    parts.append(
        figure("Parameters, standard errors, chi2 and status.", picture_bytes(picture, ".png"))
    )
    if worst:
        with style():
            drawn = Figure((9.0, 6.0), layout="constrained")
            for axes, pixel in zip(drawn.subplots(2, 2).ravel(), worst, strict=False):
                _draw_pixel(axes, store, cube, pixel)
        caption = "The pixels with the largest chi2: data and fitted curves."
        parts.append(figure(caption, picture_bytes(drawn, ".png")))
    return document(known["title"], parts, command)


def map_file(path: Path, dataset: Any, store: MapStore, cube: Cube, command: str) -> str | bytes:
    """Return a picture of a map or, for a name that ends in .html, its page."""
    drawn = plot_map(dataset)
    if path.suffix.lower() == ".html":
        return map_page(store, cube, drawn, command)
    return picture_bytes(drawn, path.suffix)
