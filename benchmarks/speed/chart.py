"""The chart: error across, throughput up, one mark per method and precision, the Pareto front."""

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.patheffects import withStroke

from benchmarks import scenes
from benchmarks.contestants import APPROXIMATE, ARRAYS, OURS, PEER, PRINTED, TIER
from benchmarks.speed.report import run_of, throughput

# Okabe and Ito's colours, told apart by all common kinds of colour vision
COLOURS = {
    OURS: "#0072B2",
    TIER: "#56B4E9",
    PRINTED: "#D55E00",
    APPROXIMATE: "#009E73",
    ARRAYS: "#000000",
    PEER: "#CC79A7",
}
MARKERS = {"float64": "o", "float32": "^"}
SHORT = {
    "powers (R and T)": "powers",
    "pbrt-v4 FrDielectric": "FrDielectric",
    "pbrt-v4 FrComplex": "FrComplex",
    "pbrt-v3 FrConductor": "FrConductor",
    "reflectance, plain sums": "plain sums",
    "fewest divisions, lossless": "fewest divisions",
    "NumPy, real form": "NumPy",
    "numba, real form": "numba",
    "numba, all cores": "numba, all cores",
    "JaxLayerLumos": "jaxlayerlumos",
    "TmmFast": "tmm_fast",
    "Tmm": "tmm",
    "Tmmax": "tmmax",
}
LEFT, RIGHT = 3e-17, 30.0  # errors beyond are drawn at the edge: the value is simply wrong
ERROR = "largest_relative"


def marks(results, scene, platform="cpu"):
    """(name, family, dtype, error, points per second) of one class of scene."""
    kind = "lossless" if scene in scenes.LOSSLESS else "lossy"
    found = []
    for dtype in MARKERS:
        run = run_of(results, dtype, platform)
        for name, classes in run["errors"].items():
            rate = throughput(run, kind, name)
            error = classes.get(scene, {})
            if rate is None or ERROR not in error:
                continue
            across = np.inf if error["not_finite"] else error[ERROR]
            across = float(np.clip(across, 10 * LEFT, RIGHT / 3))
            found.append((name, results["families"][name], dtype, across, rate))
    return found


def front(points):
    """The points that no other beats in both error and speed, from the most exact on."""
    best, kept = 0.0, []
    for point in sorted(points, key=lambda p: (p[3], -p[4])):
        if point[4] > best:
            best = point[4]
            kept.append(point)
    return kept


def panel(axes, results, scene, platform):
    points = marks(results, scene, platform)
    kind = "lossless" if scene in scenes.LOSSLESS else "lossy"
    for dtype in MARKERS:
        ceiling = throughput(run_of(results, dtype, platform), kind, "jax.jit(a + b + c)")
        if ceiling:
            axes.axhline(ceiling, color="0.75", lw=0.8, ls=(0, (5, 3)), zorder=0)
            text = f"jit(a + b + c), {dtype}"
            axes.text(1.3 * LEFT, ceiling, text, fontsize=5.5, color="0.5", va="bottom")
        eps = float(np.finfo(dtype).eps)
        axes.axvline(eps, color="0.85", lw=0.8, zorder=0)
        label = f"eps, {dtype}"
        axes.text(eps, 1.3e4, label, fontsize=5.5, color="0.5", rotation=90, ha="right")
    edge = front(points)
    steps_x = [p[3] for p in edge] + [RIGHT]
    steps_y = [p[4] for p in edge] + [edge[-1][4]]
    axes.step(steps_x, steps_y, where="post", color="0.35", lw=1.1, zorder=1)
    for name, family, dtype, error, rate in points:
        on_front = any(p[0] == name and p[2] == dtype for p in edge)
        axes.plot(
            error,
            rate,
            MARKERS[dtype],
            ms=6.5 if on_front or family == OURS else 4.5,
            mfc=COLOURS[family] if dtype == "float64" else "white",
            mec=COLOURS[family],
            mew=1.1,
            zorder=4 if family == OURS else 3,
            clip_on=False,
        )
    axes.set(xscale="log", yscale="log", xlim=(LEFT, RIGHT), ylim=(1e4, 2e10))
    axes.set_title(scene, fontsize=9, loc="left", fontweight="bold")
    axes.tick_params(labelsize=7)
    axes.spines[["top", "right"]].set_visible(False)
    _label(axes, points, edge)


def _labelled(points, edge):
    """One mark per method: the one on the front, or else the float64 one, or else the other.

    Approximations are named only where they approximate, and the front everywhere.
    """
    chosen = {}
    for point in sorted(points, key=lambda p: (p not in edge, p[2] != "float64")):
        name, family, _, error, _ = point
        if family == APPROXIMATE and error > 1.0 and point not in edge:
            continue
        chosen.setdefault(name, point)
    return sorted(chosen.values(), key=lambda p: (p not in edge, p[1] != OURS, -p[4]))


def _label(axes, points, edge):
    """Names beside the marks, moved apart up and down where they would overlap."""
    to_pixels = axes.transData.transform
    scale = axes.figure.dpi / 72.0
    radius = 3.2 * scale
    marks_at = [to_pixels((p[3], p[4])) for p in points]
    taken = [(x - radius, y - radius, x + radius, y + radius) for x, y in marks_at]
    for name, family, _, error, rate in _labelled(points, edge):
        x, y = to_pixels((error, rate))
        text = SHORT.get(name, name)
        width, height = (3.05 * len(text) + 1) * scale, 6.6 * scale
        places = []
        for shift in (0, 1, -1, 2, -2, 3, -3, 4):
            for start in (x + 5 * scale, x - 5 * scale - width):
                places.append((start, y - height / 2 + shift * height * 0.8))
        if error > 1e-3:  # towards the middle of the panel first
            places = [places[i ^ 1] for i in range(len(places))]
        free = (p for p in places if not _hits((*p, p[0] + width, p[1] + height), taken, axes))
        place = next(free, None)
        if place is None:
            continue  # a crowd: the table names them all
        taken.append((*place, place[0] + width, place[1] + height))
        at = axes.transData.inverted().transform((place[0], place[1] + height / 2))
        written = axes.text(*at, text, fontsize=6, color=COLOURS[family], va="center", ha="left")
        written.set_path_effects([withStroke(linewidth=1.8, foreground="white")])


def _hits(box, others, axes):
    x0, y0, x1, y1 = box
    frame = axes.bbox
    if x0 < frame.x0 or x1 > frame.x1 or y0 < frame.y0 or y1 > frame.y1:
        return True
    return any(x0 < b[2] and b[0] < x1 and y0 < b[3] and b[1] < y1 for b in others)


def draw(results, folder, platform="cpu"):
    """speed_and_accuracy.png, one panel per class of scene, and speed_by_size.png."""
    figure, grid = plt.subplots(2, 3, figsize=(11.5, 7.6), sharex=True, sharey=True, dpi=160)
    figure.subplots_adjust(
        left=0.06, right=0.985, top=0.885, bottom=0.075, wspace=0.07, hspace=0.14
    )
    figure.canvas.draw()
    for axes, scene in zip(grid.flat, scenes.CLASSES, strict=True):
        panel(axes, results, scene, platform)
    for axes in grid[:, 0]:
        axes.set_ylabel("points per second, 1e6 points", fontsize=8)
    for axes in grid[1]:
        axes.set_xlabel("largest relative error of R", fontsize=8)
    handles = [
        plt.Line2D([], [], marker="s", ls="", color=colour, label=family, ms=6)
        for family, colour in COLOURS.items()
    ]
    for dtype, marker in MARKERS.items():
        face = "0.4" if dtype == "float64" else "white"
        handles.append(
            plt.Line2D([], [], marker=marker, ls="", mec="0.4", mfc=face, label=dtype, ms=6)
        )
    handles.append(plt.Line2D([], [], color="0.35", lw=1.1, label="Pareto front"))
    figure.legend(
        handles=handles,
        loc="upper left",
        bbox_to_anchor=(0.055, 0.965),
        ncols=9,
        fontsize=7,
        frameon=False,
        handletextpad=0.3,
        columnspacing=1.4,
    )
    machine = results["machine"]
    figure.suptitle(
        "Unpolarized Fresnel reflectance: speed against accuracy. Up and left is better.",
        x=0.06,
        ha="left",
        fontsize=10.5,
        fontweight="bold",
        y=0.985,
    )
    jax = machine["versions"].get("jax", "?")
    figure.text(
        0.985,
        0.012,
        f"{machine['date']}, {machine['processor']}, {machine['cores']} cores, jax {jax}",
        ha="right",
        fontsize=6,
        color="0.4",
    )
    suffix = "" if platform == "cpu" else f"_{platform}"
    figure.savefig(folder / f"speed_and_accuracy{suffix}.png")
    plt.close(figure)
    _sizes(results, folder / f"speed_by_size{suffix}.png", platform)


def _sizes(results, file, platform):
    """How throughput grows with the number of points."""
    from benchmarks.speed.turns import SIZES

    names = {
        "reflectance": COLOURS[OURS],
        "reflectance, plain sums": COLOURS[TIER],
        "pbrt-v3 FrConductor": COLOURS[PRINTED],
        "pbrt-v4 FrComplex": "#E69F00",
        "numba, real form": COLOURS[ARRAYS],
        "Mitsuba": COLOURS[PEER],
        "jax.jit(a + b + c)": "0.7",
    }
    figure, grid = plt.subplots(1, 2, figsize=(9, 3.6), sharey=True, dpi=160)
    for axes, dtype in zip(grid, MARKERS, strict=True):
        run = run_of(results, dtype, platform)
        for name, colour in names.items():
            cells = run["lossy"].get(name, {})
            sizes = [n for n in SIZES if f"value {n}" in cells and "s" in cells[f"value {n}"]]
            rates = [n / cells[f"value {n}"]["s"] for n in sizes]
            if sizes:
                line = "--" if name.startswith("jax") else "-"
                axes.plot(sizes, rates, line, color=colour, lw=1.6, label=SHORT.get(name, name))
        axes.set(xscale="log", yscale="log", xlabel="points in a call", title=dtype)
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(color="0.92", lw=0.6)
    grid[0].set_ylabel("points per second (lossy media)")
    handles, labels = grid[1].get_legend_handles_labels()
    first = grid[0].get_legend_handles_labels()
    known = dict(zip(first[1] + labels, first[0] + handles, strict=True))
    grid[1].legend(known.values(), known.keys(), fontsize=7, frameon=False, loc="lower right")
    figure.tight_layout()
    figure.savefig(file)
    plt.close(figure)
