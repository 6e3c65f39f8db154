"""A glass and a gold sphere under a sky, and the index of the glass recovered from the picture.

One jitted function, `photograph`, traces every ray (see `_spheres.py`). The picture is a function
of the index eta of the glass, and JAX differentiates it: one panel shows d(picture)/d(eta). Given a
picture with noise of one percent, optimistix minimises the squared difference and finds the index
from a wrong start; the curvature there gives the error bar.
"""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from _picture import BLUE, ORANGE, arguments, figure
from _spheres import trace

jax.config.update("jax_enable_x64", True)

TRUE_ETA, WRONG_ETA, NOISE = 1.517, 1.77, 0.01


class Recovery(NamedTuple):
    """The index found, its standard error, chi^2 per datum, and the index after each step."""

    eta: float
    sigma: float
    chi2_reduced: float
    steps: list[float]


@partial(jax.jit, static_argnums=1)
def photograph(eta, width: int):
    """(picture, d picture / d eta), of 4 rays in each pixel."""
    return jax.jvp(lambda eta: trace(eta, width, 2), (eta,), (jnp.ones_like(eta),))


def recover(seen, start: float) -> Recovery:
    """The index of the glass in a picture with noise, by Levenberg and Marquardt's method."""
    steps = []

    def note(**progress):
        _, eta = progress["y_last_accepted_step"]
        jax.debug.callback(lambda eta: steps.append(float(eta)), eta)

    width = seen.shape[1]

    @jax.custom_jvp
    def model(eta):
        return photograph(eta, width)[0]

    @model.defjvp
    def _(eta, change):  # one parameter: the slope comes along with the picture, in one program
        picture, slope = photograph(*eta, width)
        return picture, slope * change[0]

    eta = optx.least_squares(
        lambda eta, _: model(eta) - seen,
        optx.LevenbergMarquardt(rtol=1e-4, atol=1e-4, norm=optx.rms_norm, verbose=note),
        jnp.float64(start),
        max_steps=60,
    ).value
    picture, slope = photograph(eta, width)
    jax.effects_barrier()
    chi2 = jnp.mean(((picture - seen) / NOISE) ** 2)
    return Recovery(float(eta), float(NOISE / jnp.linalg.norm(slope)), float(chi2), steps)


def draw(path, width: int, found: Recovery) -> None:
    """The picture, its derivative, and the way to the right index."""
    picture, slope = photograph(jnp.float64(TRUE_ETA), width)
    with figure(path, 12.6, 5.35) as fig:
        grid = fig.add_gridspec(2, 3, width_ratios=(1.0, 1.0, 0.98))
        photo, change, way = (fig.add_subplot(g) for g in (grid[:, :2], grid[0, 2], grid[1, 2]))
        photo.imshow(picture)
        photo.set_title(rf"glass ($\eta$ = {TRUE_ETA}) and gold, ray traced in one jitted function")
        # The root of the slope keeps faint changes visible beside the caustic's.
        mean = np.asarray(slope) @ np.array([0.2126, 0.7152, 0.0722])
        change.imshow(np.sign(mean) * np.sqrt(np.abs(mean)), cmap="RdBu_r", vmin=-2.0, vmax=2.0)
        change.set_title(r"d(picture) / d$\eta$ (red: brighter)")
        for axes in (photo, change):
            axes.axis("off")
        error = np.abs(np.array([WRONG_ETA, *found.steps]) - TRUE_ETA)
        way.axhspan(1e-12, found.sigma, color=BLUE, alpha=0.15, linewidth=0)
        way.semilogy(error, "o-", color=ORANGE, markersize=5)
        way.text(0.02, found.sigma * 0.8, "standard error", color=BLUE, va="top",
                 transform=way.get_yaxis_transform())  # fmt: skip
        way.set(xlabel="Levenberg-Marquardt step", ylabel=r"$|\eta - \eta_{true}|$")
        way.set_ylim(min(error.min(), found.sigma) / 4.0, 1.0)
        way.set_title(rf"recovered: $\eta$ = {found.eta:.5f} $\pm$ {found.sigma:.5f}")


def main(argv=None) -> dict[str, float]:
    """Draws the picture, prints and returns the numbers."""
    picture, size = arguments(__doc__, "two_spheres.png", 640, "pixels across", argv)
    clean, _ = photograph(jnp.float64(TRUE_ETA), min(64, size))
    noise = NOISE * np.random.default_rng(1).standard_normal(clean.shape)
    found = recover(clean + noise, WRONG_ETA)
    draw(picture, size, found)
    results = found._asdict() | {"steps": len(found.steps), "start": WRONG_ETA, "true": TRUE_ETA}
    print("from {start} in {steps} steps to eta = {eta:.5f} +- {sigma:.5f}".format(**results))
    print("the glass has {true}; chi^2 per datum {chi2_reduced:.3f}".format(**results))
    return results


if __name__ == "__main__":
    main()
