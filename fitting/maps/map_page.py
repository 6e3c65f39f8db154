"""What is seen of a map: a picture of its parameters, and a page with its worst pixels."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from fitting.data.drawing import axis_of, check_matplotlib, lines_of, style
from fitting.data.measurement import Measurement
from fitting.maps.cube import Cube
from fitting.maps.map_fit import fit_pixels
from fitting.maps.map_store import BITS, STATUSES, MapStore
from fitting.output.page import document, element, figure, html_table
from fitting.output.pictures import picture_bytes
from fitting.predictions import predict

# A picture has at most so many pixels along an axis; a page has so many fits.
_MOST, _WORST = 1000, 4


def plot_map(dataset: Any) -> Any:
    """Return a matplotlib Figure of a map that `fit_map` returned.

    Each fitted parameter and its standard error with a scale from the 2 to the 98 % quantile, chi2,
    and the status. Pixels without a fit are grey. Of further axes the middle one is shown, and of
    more than 1,000 pixels along an axis some.
    """
    check_matplotlib("plot_map")
    from matplotlib.colors import ListedColormap
    from matplotlib.figure import Figure

    names = [name for name in dataset if f"{name}_sigma" in dataset]
    rows = [[n, f"{n}_sigma"] for n in names] + [["chi2", "status"]]
    of_status = {
        "cmap": ListedColormap([*STATUSES.values()]), "vmin": -0.5, "vmax": len(STATUSES) - 0.5,
        "cbar_kwargs": {"ticks": range(len(STATUSES)), "format": lambda i, _: [*STATUSES][i]},
    }  # fmt: skip
    with style():
        drawn = Figure((9.0, 3.4 * len(rows)), layout="constrained")
        places = drawn.subplots(len(rows), 2, squeeze=False)
        for place, name in zip(places.ravel(), np.ravel(rows), strict=True):
            array = dataset[name].drop_vars(dataset.coords)
            array = array[(..., *(n // 2 for n in array.shape[2:]))] if array.ndim > 2 else array
            array = array[tuple(slice(None, None, -(-n // _MOST)) for n in array.shape)]
            array = array if array.ndim > 1 else array.expand_dims("")
            more = of_status if name == "status" else {"robust": True, "center": False}
            array.plot.imshow(ax=place, yincrease=False, add_labels=False, **more)
            unit = array.attrs.get("units", "1")
            place.set(title=name if unit == "1" else f"{name} ({unit})", aspect="auto")
            place.grid(False)
            place.set_facecolor("#bbbbbb")
    return drawn


def status_rows(store: MapStore) -> list[list[str]]:
    """Return a table of how many pixels have each status."""
    counts = np.zeros(len(STATUSES), int)
    for _, values in store.blocks_of("status"):
        counts += np.bincount(values.ravel(), minlength=len(counts))
    each = [(s, n) for s, n in zip(STATUSES, counts, strict=True) if n]
    rows = [[s, f"{n:,}", f"{n / math.prod(store.shape):.2%}"] for s, n in each]
    return [["status", "pixels", "share"], *rows]


def _warning_rows(store: MapStore) -> list[list[str]]:
    """Return a table of how many pixels have each warning."""
    counts = np.zeros(len(BITS), int)
    for _, bits in store.blocks_of("warnings"):
        counts += [np.count_nonzero(bits & bit) for bit in BITS.values()]
    rows = [[code, f"{n:,}"] for code, n in zip(BITS, counts, strict=True) if n]
    return [["warning", "pixels"], *rows]


def _worst(store: MapStore) -> list[tuple[int, ...]]:
    """Return the pixels of the largest chi2."""
    worst: list[tuple[float, list[int]]] = []
    for index, chi2 in store.blocks_of("chi2"):
        for flat in np.argsort(-np.nan_to_num(chi2, nan=-1.0), axis=None)[:_WORST]:
            inner = np.unravel_index(flat, chi2.shape)
            pixel = [int(i) + s.start for i, s in zip(inner, index, strict=True)]
            worst.append((float(chi2[inner]), pixel))
        worst = sorted((w for w in worst if np.isfinite(w[0])), reverse=True)[:_WORST]
    return [tuple(pixel) for _, pixel in worst]


def _draw_pixel(axes: Any, store: MapStore, cube: Cube, pixel: tuple[int, ...]) -> None:
    """Draw the data of a pixel, and the curve of its fit, from where the map's fit ended."""
    block, known = cube.block(tuple(slice(i, i + 1) for i in pixel)), store.attributes
    begin = {n: float(store.arrays[n][pixel]) for n in known["begin"]["units"]}
    fit = fit_pixels(known, cube, block, start=begin, check=0)[(0,) * len(pixel)]
    flat: dict[str, Any] = {q: v.ravel() for q, v in block[0].items()}
    m = Measurement.from_columns(cube.angle_deg, cube.wavelength_um, **flat)
    curve = predict(fit, m).value
    for line in lines_of(m):
        x, color = axis_of(m)[line.rows], line.look[0]
        axes.plot(x, m.value[line.rows], ".", color=color, label=line.label)
        axes.plot(x, curve[line.rows], color=color)
    axes.set_title(f"pixel {pixel}, chi2/dof {store.arrays['chi2'][pixel]:.3g}", fontsize=10)
    axes.legend()


def map_page(store: MapStore, cube: Cube, picture: Any, command: str) -> str:
    """Return one page: what was read, statuses, warnings, the maps, and the worst pixels' fits."""
    from matplotlib.figure import Figure

    known = store.attributes
    worst = _worst(store)
    facts = [["", ""], ["read", known["read"]], ["sample", known["sample"]],
             *[["shared", f"{n} = {v:.6g} +- {s:.2g}"] for n, (v, s) in known["shared"].items()],
             *[["not fitted", text] for text in known["failed_blocks"]]]  # fmt: skip
    tables = {"Map": facts, "Pixels": status_rows(store), "Warnings": _warning_rows(store)}
    parts = [
        element("h1", known["title"]),
        *[html_table(title, rows) for title, rows in tables.items() if rows[1:]],
        figure("Parameters, standard errors, chi2 and status.", picture_bytes(picture, ".png")),
    ]
    if worst:
        with style():
            drawn = Figure((9.0, 6.0), layout="constrained")
            for axes, pixel in zip(drawn.subplots(2, 2).ravel(), worst, strict=False):
                _draw_pixel(axes, store, cube, pixel)
        caption = "The pixels with the largest chi2: data and fitted curves."
        parts.append(figure(caption, picture_bytes(drawn, ".png")))
    return document(known["title"], parts, command)
