"""The chart: error across, throughput up, one mark per method and precision, the Pareto front."""

import itertools

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke

from benchmarks import scenes
from benchmarks.contestants import APPROXIMATE, ARRAYS, OURS, PEER, PRINTED, TIER
from benchmarks.picture import figure
from benchmarks.speed.report import run_of, throughput

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
    notes = []
    for dtype in MARKERS:
        ceiling = throughput(run_of(results, dtype, platform), kind, "jax.jit(a + b + c)")
        if ceiling:
            axes.axhline(ceiling, color="0.75", lw=0.8, ls=(0, (5, 3)), zorder=0)
            text, place = f"jit(a + b + c), {dtype}", {"va": "bottom"}
            notes.append(axes.text(1e-11, ceiling, text, **place))
        eps = float(np.finfo(dtype).eps)
        axes.axvline(eps, color="0.75", lw=0.8, zorder=0)
        text, place = f"eps, {dtype}", {"rotation": 90, "ha": "right", "va": "bottom"}
        notes.append(axes.text(eps, 1.3e4, text, **place))
    for note in notes:
        note.set(fontsize="xx-small", color="0.5", zorder=0)
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
    axes.set(xscale="log", yscale="log", xlim=(LEFT, RIGHT), ylim=(1e4, 2e10), title=scene)
    axes.grid(False)
    _label(axes, points, edge, [note.get_window_extent() for note in notes])


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


# Where a label is tried: points from the mark, the nearest first, on sixteen sides of it, to the
# right first. A line leads to one that is LEADER points away, or nearer to another mark.
DISTANCES, LEADER = (5.5, 9.0, 14.0, 20.0, 27.0, 35.0), 14.0
SIDES = np.exp(1j * np.pi / 8 * np.array([0, 8, 2, -2, 6, -6, 4, -4, 1, -1, 7, -7, 3, -3, 5, -5]))
MARK = 3.2  # half its size, points
# What these cost, in points of distance: a label on the front, a line over a mark, a label that is
# nearer to another mark.
ON_FRONT, OVER_MARK, ASTRAY = 15.0, 8.0, 8.0


def _label(axes, points, edge, notes):
    """Names beside their marks, at the nearest free place; boxes are x0, y0, x1, y1 in pixels."""
    point, to_pixels = axes.figure.dpi / 72.0, axes.transData.transform
    at = np.array([to_pixels(p[3:]) for p in points])
    marks_at = np.hstack([at - MARK * point, at + MARK * point])
    texts = np.array([box.extents for box in notes]).reshape(-1, 4)
    corners = to_pixels([p[3:] for p in edge] + [(RIGHT, edge[-1][4])])
    lines = [  # the steps of the front, along and up
        np.hstack([np.minimum(a, b), np.maximum(a, b)])
        for (x0, y0), (x1, y1) in itertools.pairwise(corners)
        for a, b in (((x0, y0), (x1, y0)), ((x1, y0), (x1, y1)))
    ]
    frame = axes.bbox.extents * (-1, -1, 1, 1)
    for chosen in _labelled(points, edge):
        name, family, *_ = chosen
        text = axes.annotate(
            SHORT.get(name, name), chosen[3:], (0, 0), textcoords="offset points", va="center",
            ha="center", fontsize="xx-small", color=COLOURS[family], zorder=5,
            path_effects=[withStroke(linewidth=1.6, foreground="white")],
        )  # fmt: skip
        half, here = 0.5 * np.array(text.get_window_extent().size), to_pixels(chosen[3:])
        others = at[np.hypot(*(at - here).T) > 0.5 * MARK * point]
        best = None
        for distance, side in itertools.product(DISTANCES, SIDES):
            toward = np.array([side.real, side.imag])
            tip = here + distance * point * toward
            centre = tip + half * np.where(abs(toward) > 0.3, np.sign(toward), 0.0)
            box = np.hstack([centre - half, centre + half])
            way = here + np.linspace(0.3, 1.0, 9)[:, None] * (tip - here)
            if (
                (box * (-1, -1, 1, 1) > frame).any()
                or _touched(box, np.vstack([marks_at, texts])).any()
                or any(_touched(np.hstack([xy, xy]), texts).any() for xy in way)
            ):
                continue
            passed = any((np.hypot(*(others - xy).T) < MARK * point).any() for xy in way)
            astray = _away(box, others).min() < _away(box, here[None])[0] - point
            on_front = _touched(box, np.array(lines)).any()
            cost = distance + ON_FRONT * on_front + OVER_MARK * passed + ASTRAY * astray
            if best is None or cost < best[0]:
                best = cost, distance >= LEADER or astray, centre, box, tip
        if best is None:
            text.remove()  # a crowd: the table names them all
            continue
        _, led, centre, box, tip = best
        text.xyann = (centre - here) / point
        texts = np.vstack([texts, box])
        if led:
            axes.plot(
                *axes.transData.inverted().transform([here, tip]).T,
                color=COLOURS[family], lw=0.6, zorder=2,
            )  # fmt: skip


def _away(box, points):
    """The distances of points (N, 2) from a box."""
    return np.hypot(*np.maximum(np.maximum(box[:2] - points, points - box[2:]), 0.0).T)


def _touched(box, boxes):
    """Which of the boxes (N, 4) a box overlaps, (N,)."""
    return (box[:2] < boxes[:, 2:]).all(1) & (boxes[:, :2] < box[2:]).all(1)


def draw(results, folder, platform="cpu"):
    """speed_and_accuracy.png, one panel per class of scene, and speed_by_size.png."""
    suffix = "" if platform == "cpu" else f"_{platform}"
    file = folder / f"speed_and_accuracy{suffix}.png"
    with figure(file, 13.0, 9.0, layout="none") as page:
        _panels(page, results, platform)
    _sizes(results, folder / f"speed_by_size{suffix}.png", platform)


def _panels(page, results, platform):
    grid = page.subplots(2, 3, sharex=True, sharey=True)
    page.subplots_adjust(left=0.06, right=0.985, top=0.875, bottom=0.085, wspace=0.06, hspace=0.16)
    for axes, scene in zip(grid.flat, scenes.CLASSES, strict=True):
        panel(axes, results, scene, platform)
    for axes in grid[:, 0]:
        axes.set_ylabel("points per second, 1e6 points")
    for axes in grid[1]:
        axes.set_xlabel("largest relative error of R")
    handles = [
        Line2D([], [], marker="s", ls="", color=colour, label=family, ms=6)
        for family, colour in COLOURS.items()
    ]
    for dtype, marker in MARKERS.items():
        face = "0.4" if dtype == "float64" else "white"
        handles.append(Line2D([], [], marker=marker, ls="", mec="0.4", mfc=face, label=dtype, ms=6))
    handles.append(Line2D([], [], color="0.35", lw=1.1, label="Pareto front"))
    page.legend(
        handles=handles, loc="upper left", bbox_to_anchor=(0.05, 0.965), ncols=9, fontsize="small",
        handletextpad=0.3, columnspacing=1.4,
    )  # fmt: skip
    page.suptitle(
        "Unpolarized Fresnel reflectance: speed against accuracy. Up and left is better.",
        x=0.06, y=0.99, ha="left",
    )  # fmt: skip
    machine = results["machine"]
    jax = machine["versions"].get("jax", "?")
    conditions = f"{machine['date']}, {machine['processor']}, {machine['cores']} cores, jax {jax}"
    page.text(0.985, 0.01, conditions, ha="right", fontsize="xx-small", color="0.4")


def _sizes(results, file, platform):
    """How throughput grows with the number of points."""
    names = {
        "reflectance": COLOURS[OURS],
        "reflectance, plain sums": COLOURS[TIER],
        "pbrt-v3 FrConductor": COLOURS[PRINTED],
        "pbrt-v4 FrComplex": "#E69F00",
        "numba, real form": COLOURS[ARRAYS],
        "Mitsuba": COLOURS[PEER],
        "jax.jit(a + b + c)": "0.7",
    }
    with figure(file, 10.0, 4.2) as page:
        _curves(page.subplots(1, 2, sharey=True), names, results, platform)


def _curves(grid, names, results, platform):
    from benchmarks.speed.turns import SIZES

    for axes, dtype in zip(grid, MARKERS, strict=True):
        run = run_of(results, dtype, platform)
        for name, colour in names.items():
            cells = run["lossy"].get(name, {})
            sizes = [n for n in SIZES if f"value {n}" in cells and "s" in cells[f"value {n}"]]
            rates = [n / cells[f"value {n}"]["s"] for n in sizes]
            if sizes:
                line = "--" if name.startswith("jax") else "-"
                axes.plot(sizes, rates, line, color=colour, label=SHORT.get(name, name))
        axes.set(xscale="log", yscale="log", xlabel="points in a call", title=dtype)
    grid[0].set_ylabel("points per second (lossy media)")
    handles, labels = grid[1].get_legend_handles_labels()
    first = grid[0].get_legend_handles_labels()
    known = dict(zip(first[1] + labels, first[0] + handles, strict=True))
    grid[1].legend(known.values(), known.keys(), fontsize="small", loc="lower right")
