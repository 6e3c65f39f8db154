"""The chart of docs/comparison.md: the speed of eight methods against their errors, two panels.

On the left the errors are those for metals, where everybody is right; on the right the largest ones
over the classes of scenes in which the method takes part. All methods and classes are in `chart`.
"""

import numpy as np

from benchmarks import scenes
from benchmarks.picture import figure
from benchmarks.speed.chart import COLOURS, LEFT, MARKERS, RIGHT, marks

# Name, precision, label, and where that stands beside the mark in the left and the right panel.
SHOWN = (
    ("reflectance", "float64", "fresnel-jax, float64", "below right", "right"),
    ("reflectance", "float32", "fresnel-jax, float32", "right", "above"),
    ("Mitsuba", "float32", "Mitsuba, float32", "right", "left"),
    ("pbrt-v4 FrComplex", "float64", "pbrt-v4's form in JAX", "right", "right"),
    ("numba, real form", "float64", "printed form in numba", "above right", "below"),
    ("Tmmax", "float64", "tmmax", "right", "left"),
    ("Tmm", "float64", "tmm", "right", "right"),
    ("F82", "float32", "F82 approximation", "above", "left"),
)
OFFSETS = {
    "right": ((7, 0), "left", "center"),
    "left": ((-7, 0), "right", "center"),
    "above": ((0, 6), "center", "bottom"),
    "below": ((0, -6), "center", "top"),
    "above right": ((5, 3), "left", "bottom"),
    "below right": ((5, -3), "left", "top"),
}


def worst(results, platform):
    """(metals, worst class): {(name, dtype): (error, points per second)} for lossy media."""
    metals = {(m[0], m[2]): (m[3], m[4]) for m in marks(results, "metal", platform)}
    hardest = {}
    for scene in scenes.CLASSES:
        for name, _, dtype, error, _ in marks(results, scene, platform):
            if (name, dtype) in metals:
                old = hardest.get((name, dtype), (0.0, 0.0))[0]
                hardest[name, dtype] = (max(old, error), metals[name, dtype][1])
    return metals, hardest


def draw_overview(results, file, platform):
    """Writes the picture."""
    with figure(file, 10.5, 4.8) as page:
        _panels(page.subplots(1, 2, sharex=True, sharey=True), results, platform)


def _panels(panels, results, platform):
    titles = ("metals", "hardest of six classes of scenes")
    for side, (axes, points, title) in enumerate(
        zip(panels, worst(results, platform), titles, strict=True)
    ):
        for name, dtype, label, *places in SHOWN:
            if (name, dtype) not in points:
                continue
            error, rate = points[name, dtype]
            colour = COLOURS[results["families"][name]]
            face = colour if dtype == "float64" else "white"
            axes.plot(error, rate, MARKERS[dtype], ms=8, mfc=face, mec=colour, mew=1.4)
            offset, across, up = OFFSETS[places[side]]
            axes.annotate(
                label, (error, rate), offset, textcoords="offset points", ha=across, va=up,
                fontsize="small", color=colour,
            )  # fmt: skip
        for dtype in MARKERS:
            axes.axvline(float(np.finfo(dtype).eps), color="0.85", lw=0.8, zorder=0)
            axes.text(
                float(np.finfo(dtype).eps), 1.3e6, f" eps, {dtype}", fontsize="x-small", color="0.5"
            )
        axes.set(xscale="log", yscale="log", xlim=(LEFT, 10 * RIGHT), ylim=(1e6, 3e10))
        axes.set_title(title)
        axes.set_xlabel("largest relative error of R")
    panels[0].set_ylabel("points per second, 1e6 points")
