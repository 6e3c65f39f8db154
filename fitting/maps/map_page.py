"""What is seen of a map: a picture of its parameters, and a page with its worst pixels."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from fitting.batches import fit_many
from fitting.data.drawing import check_matplotlib, style
from fitting.data.measurement import Measurement
from fitting.maps.cube import Cube
from fitting.maps.map_store import BITS, STATUS, STATUSES
from fitting.output.page import document, element, figure, html_table
from fitting.output.pictures import draw, picture_bytes

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

    fitted = (name for name in dataset if f"{name}_sigma" in dataset)
    names = [*(name + end for name in fitted for end in ("", "_sigma")), "chi2", "status"]
    of_status = {
        "cmap": ListedColormap([*STATUSES.values()]), "vmin": -0.5, "vmax": len(STATUSES) - 0.5,
        "cbar_kwargs": {"ticks": range(len(STATUSES)), "format": lambda i, _: [*STATUSES][i]},
    }  # fmt: skip
    with style():
        drawn = Figure((9.0, 1.7 * len(names)), layout="constrained")
        places = drawn.subplots(len(names) // 2, 2, squeeze=False)
        for place, name in zip(places.ravel(), names, strict=True):
            array = dataset[name].drop_vars(dataset.coords)
            array = array.isel({d: n // 2 for d, n in [*array.sizes.items()][2:]})
            array = array[tuple(slice(None, None, -(-n // _MOST)) for n in array.shape)]
            array = array if array.ndim > 1 else array.expand_dims("")
            more = of_status if name == "status" else {"robust": True, "center": False}
            array.plot.imshow(ax=place, yincrease=False, **more)
            place.set(aspect="auto", facecolor="#bbbbbb")
            place.grid(False)
    return drawn


def _parts(array: Any) -> Iterator[tuple[int, np.ndarray]]:
    """Yield an array of a map in parts: the first row and the values of each."""
    rows = array.encoding["chunks"][0]
    return ((i, array[i : i + rows].values) for i in range(0, len(array), rows))


def counts(maps: Any, name: str) -> list[list[str]]:
    """Return a table of how many pixels have each status, or each of the warnings."""
    flags = STATUS if name == "status" else BITS
    count = np.zeros(len(flags), int)
    for _, part in _parts(maps[name]):
        each = (part == f if name == "status" else part & f for f in flags.values())
        count += [*map(np.count_nonzero, each)]
    rows = [[f, f"{n:,}", f"{n / maps[name].size:.2%}"]
            for f, n in zip(flags, count, strict=True) if n]  # fmt: skip
    return [[name, "pixels", "share"], *rows]


def _worst(chi2: Any) -> list[tuple[int, ...]]:
    """Return the pixels of the largest chi2."""
    worst: list[tuple[float, tuple[int, ...]]] = []
    for row, part in _parts(chi2):
        for flat in np.argsort(-part, axis=None)[:_WORST]:
            first, *others = map(int, np.unravel_index(flat, part.shape))
            worst.append((-float(part.flat[flat]), (row + first, *others)))
        worst = sorted(w for w in worst if np.isfinite(w[0]))[:_WORST]
    return [pixel for _, pixel in worst]


def map_page(maps: Any, cube: Cube, command: str) -> str:
    """Return one page: what was read, statuses, warnings, the maps, and the worst pixels' fits."""
    known, every = maps.attrs, "Parameters, standard errors, chi2 and status."
    facts = [["", ""], ["read", known["read"]], ["sample", known["sample"]],
             *[["shared", f"{n} = {v:.6g} +- {s:.2g}"] for n, (v, s) in known["shared"].items()],
             *[["not fitted", text] for text in known["failed_blocks"]]]  # fmt: skip
    tables = {"Map": facts, "Pixels": counts(maps, "status"), "Warnings": counts(maps, "warnings")}
    parts = [
        element("h1", known["title"]),
        *[html_table(title, rows) for title, rows in tables.items() if rows[1:]],
        figure(every, picture_bytes(plot_map(maps), ".png")),
    ]
    for pixel in _worst(maps["chi2"]):
        curves, _ = cube.block(tuple(slice(i, i + 1) for i in pixel))
        start = {n: float(maps[n][pixel]) for n in maps if f"{n}_sigma" in maps}
        fit = fit_many(**{**known["fit"], **curves, "start": start, "check": 0})[(0,) * len(pixel)]
        flat: dict[str, Any] = {q: curves[q].ravel() for q in cube.quantity}
        m = Measurement.from_columns(
            cube.angle_deg, cube.wavelength_um, source=f"pixel {pixel}", **flat
        )
        caption = f"One of the pixels with the largest chi2, {fit.chi2_reduced:.3g} by dof."
        parts.append(figure(caption, picture_bytes(draw(fit, measurement=m), ".png")))
    return document(known["title"], parts, command)
