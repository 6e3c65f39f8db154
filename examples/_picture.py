"""Where the examples' pictures go and how they look, and the colours of light in them.

Needs matplotlib, the extra `plot`.
"""

import argparse
import contextlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike

from fresnel_jax.colour import colour_matching, linear_srgb, srgb_encode

OUTPUT = Path(__file__).resolve().parent / "output"
# Okabe and Ito's colours, told apart by colour-blind readers too ("Color universal design", 2008).
BLUE, ORANGE, GREEN, GREY = "#0072B2", "#D55E00", "#009E73", "#595959"
# The style of the pictures of fits, and room between panels.
_STYLE = Path(__file__).resolve().parents[1] / "fitting" / "output" / "fresnel_fit.mplstyle"
_ROOM = {"figure.constrained_layout.h_pad": 0.1, "figure.constrained_layout.w_pad": 0.12}

VISIBLE_UM = (0.39, 0.73)


def spectral_rgb(wavelength_um: ArrayLike) -> Array:
    """Linear sRGB of monochromatic light, shape (..., 3); components may be negative.

    White-balanced as a camera is: the mean over all visible wavelengths, the light of an
    equal-energy source, is (1, 1, 1).
    """
    low, high = VISIBLE_UM
    middle_of_nm = low + 1e-3 * (jnp.arange(round(1e3 * (high - low))) + 0.5)
    white = jnp.mean(linear_srgb(colour_matching(middle_of_nm)), axis=0)
    return linear_srgb(colour_matching(wavelength_um)) / white


def tone(linear: ArrayLike) -> Array:
    """sRGB pixel values of a scene with highlights: (1 - exp(-x))^1.25, film's shoulder and toe."""
    exposure = jnp.maximum(jnp.asarray(linear), 0.0)
    return srgb_encode((1.0 - jnp.exp(-exposure)) ** 1.25)


def arguments(
    doc: str | None, name: str, size: int, meaning: str, argv: Sequence[str] | None
) -> tuple[Path, int]:
    """The command line of an example: (where the picture goes, its size).

    Arguments: `doc`, the example's docstring, whose first line the help shows; `name`, the
    picture's file name in examples/output where the command line gives none; `size`, the default
    of --size; `meaning`, what --size counts; `argv`, the command line (None: the process's own).
    """
    parser = argparse.ArgumentParser(description=(doc or "").partition("\n")[0])
    parser.add_argument(
        "picture", nargs="?", type=Path, default=OUTPUT / name, help="the PNG file to write"
    )
    parser.add_argument("--size", type=int, default=size, help=f"{meaning} (default {size})")
    given = parser.parse_args(argv)
    return given.picture, given.size


@contextlib.contextmanager
def figure(path: Path, width: float, height: float, **options: Any) -> Iterator[Any]:
    """A matplotlib Figure of width by height inches, written to `path` when the block ends.

    Further options go to `Figure`. ModuleNotFoundError where matplotlib is not installed.
    """
    try:
        from matplotlib import style
        from matplotlib.figure import Figure
    except ModuleNotFoundError:
        raise ModuleNotFoundError(
            "the examples draw with matplotlib, which is not installed: pip install matplotlib"
        ) from None
    with style.context([_STYLE, _ROOM], after_reset=True):
        settings: dict[str, Any] = {"layout": "constrained"} | options
        drawn = Figure(figsize=(width, height), **settings)
        yield drawn
        path.parent.mkdir(parents=True, exist_ok=True)
        drawn.savefig(path, dpi=120)
