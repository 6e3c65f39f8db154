"""The pictures of the stability map: error over angle and index, one panel per method.

Both axes run in decades towards the hard places: right to grazing incidence, up and down from the
middle away from matched media. The critical angle is the rising edge in the lower half, Brewster's
angle of nearly matched media the vertical line at 45 degrees.
"""

from pathlib import Path

import mpmath as mp
import numpy as np
from matplotlib import colormaps
from matplotlib.colors import BoundaryNorm

from benchmarks.picture import figure
from tests.truth import oracle

COLUMNS, ROWS = 72, 60  # pixels of a panel
CONTRASTS = (-6.9, -0.3)  # decades of abs(eta - 1), float32: from an eps to half the index
COSINES = (0.0, -6.0)  # decades of the cosine
DIGITS = 40
LEVELS = (0, 1, 2, 3, 4, 5, 6, 7)  # decades of the error in eps
NEAR_TICKS = (-6, -4, -2)
ANGLE_TICKS = (0, 60, 89, 89.9, 89.99, 89.999)


def plane(dtype) -> tuple[np.ndarray, np.ndarray]:
    """cos and eta of the picture, of shape (ROWS, COLUMNS), rows from below."""
    cosine = 10.0 ** np.linspace(*COSINES, COLUMNS)
    above = 10.0 ** np.linspace(*CONTRASTS, ROWS // 2)
    eta = np.concatenate([1 - above[::-1], 1 + above])
    c, eta = np.meshgrid(cosine, eta)
    return np.asarray(c, dtype), np.asarray(eta, dtype)


def truth(c, eta, with_gradient) -> tuple[np.ndarray, np.ndarray | None]:
    """R and its gradient with respect to (cos, eta, k) at k = 0, as mpmath numbers."""
    values, gradients = [], []
    before, oracle.DIGITS = oracle.DIGITS, DIGITS
    try:
        for point in zip(c.ravel(), eta.ravel(), strict=True):
            values.append(oracle.reflectance(*point, 0.0, 1.0))
            if with_gradient:
                both = oracle.reflectance_gradients(*point, 0.0, 1.0)
                gradients.append(both and [(s + p) / 2 for s, p in zip(*both, strict=True)][:3])
    finally:
        oracle.DIGITS = before
    return values, gradients


def errors(found, true, eps) -> np.ndarray:
    """Error in eps relative to the norm of the truth; NaN where `found` is not finite."""
    result = np.full(found.shape[1], np.nan)
    for i, (column, vector) in enumerate(zip(found.T, true, strict=True)):
        if vector is None:
            result[i] = 0.0  # nothing is right there
        elif np.isfinite(column).all():
            vector = vector[: len(column)]
            difference = mp.norm(
                [mp.mpf(float(x)) - t for x, t in zip(column, vector, strict=True)]
            )
            result[i] = float(difference / max(mp.norm(vector), eps**2)) / eps
    return result


def picture(maps: dict[str, np.ndarray], title: str, path: Path):
    across = 6
    down = -(-len(maps) // across)
    with figure(path, 2.3 * across, 2.25 * down + 1.1) as page:
        _panels(page, page.subplots(down, across, squeeze=False), maps, title)


def _panels(page, axes, maps, title):
    across = axes.shape[1]
    colours = colormaps["cividis"].resampled(len(LEVELS))
    norm = BoundaryNorm(LEVELS, colours.N, extend="max")
    for axis in axes.flat[len(maps) :]:
        axis.set_axis_off()
    for i, (axis, (name, error)) in enumerate(zip(axes.flat, maps.items(), strict=False)):
        image = np.log10(np.maximum(error.reshape(ROWS, COLUMNS), 1.0))
        missing = np.isnan(image)
        drawn = axis.imshow(
            np.ma.masked_array(image, missing),
            origin="lower",
            aspect="auto",
            cmap=colours,
            norm=norm,
            interpolation="nearest",
        )
        if missing.any():
            axis.contourf(missing, levels=[0.5, 1.5], colors=["white"], hatches=["xxxx"])
        axis.set_title(name, fontsize="small")
        axis.grid(False)
        scale = (COLUMNS - 1) / (COSINES[1] - COSINES[0])
        ticks = [np.log10(np.cos(np.radians(x))) * scale for x in ANGLE_TICKS]
        axis.set_xticks(ticks, [])
        if i >= len(maps) - across:
            axis.set_xticks(ticks, [f"{x:g}" for x in ANGLE_TICKS], rotation=60, fontsize="x-small")
        half = ROWS // 2
        steps = [
            (x - CONTRASTS[0]) * (half - 1) / (CONTRASTS[1] - CONTRASTS[0]) for x in NEAR_TICKS
        ]
        places = [half - 1 - x for x in steps[::-1]] + [half + x for x in steps]
        labels = [f"1 - 1e{x}" for x in NEAR_TICKS[::-1]] + [f"1 + 1e{x}" for x in NEAR_TICKS]
        axis.set_yticks(places, labels if i % across == 0 else [], fontsize="x-small")
    page.supxlabel("angle of incidence, degrees")
    page.supylabel("relative index")
    page.suptitle(title)
    bar = page.colorbar(drawn, ax=axes, shrink=0.6, ticks=LEVELS)
    bar.ax.set_yticklabels([f"1e{x}" for x in LEVELS])
    bar.set_label("relative error, eps; hatched: not finite")


def draw(methods, dtype: str, folder: Path):
    """stability_value.png and stability_gradient.png, of those that take lossless media."""
    c, eta = plane(dtype)
    points = c.ravel(), eta.ravel(), np.zeros(c.size, dtype)
    eps = float(np.finfo(dtype).eps)
    values, gradients = truth(c, eta, with_gradient=True)
    lossless = [x for x in methods if x.lossless]
    maps = {x.name: errors(x.value(*points)[None], [[v] for v in values], eps) for x in lossless}
    note = f"{dtype}, k = 0; 1 eps = {eps:.0e}"
    picture(maps, f"Error of R ({note})", folder / "stability_value.png")
    maps = {
        x.name: errors(x.gradient(*points), gradients, eps)
        for x in lossless
        if x.gradient is not None
    }
    picture(maps, f"Error of the gradient of R ({note})", folder / "stability_gradient.png")
