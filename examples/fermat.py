"""Snell's law from Fermat's principle: the path of light is found by automatic differentiation.

Light goes from A, in one medium, to B, in another, through the point x of the flat boundary
between them. Its optical path length is

    L(x) = eta_i |A x| + eta_t |x B|,

and Fermat's principle says that the path taken makes L stationary: dL/dx = 0. No law of refraction
is put in. JAX differentiates L, a Newton iteration (optimistix) finds the root of the derivative,
and the angles of the path that comes out obey eta_i sin_i = eta_t sin_t.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from _picture import BLUE, GREY, ORANGE, arguments, figure

from fresnel_jax.directions import refract

jax.config.update("jax_enable_x64", True)

ETA_I, ETA_T = 1.0, 1.5
HEIGHT, DEPTH, SEPARATION = 1.0, 1.0, 1.9


class Paths(NamedTuple):
    """Stationary paths: where they cross the boundary, and their angles in degrees."""

    crossing: jax.Array
    angle_i_deg: jax.Array
    angle_t_deg: jax.Array


def optical_path(x, separation, height, depth, eta_i, eta_t):
    """L(x) from (0, height) through (x, 0) to (separation, -depth)."""
    return eta_i * jnp.hypot(x, height) + eta_t * jnp.hypot(separation - x, depth)


@jax.jit
@jnp.vectorize
def _stationary(separation, height, depth, eta_i, eta_t):
    slope = jax.grad(optical_path)
    # L is convex; Dogleg is Newton's step, shortened where it would overshoot.
    solution = optx.root_find(
        lambda x, given: slope(x, *given),
        optx.Dogleg(rtol=1e-15, atol=1e-15),
        y0=separation * height / (height + depth),
        args=(separation, height, depth, eta_i, eta_t),
        throw=False,
    )
    return solution.value


def fermat(separation, height=HEIGHT, depth=DEPTH, eta_i=ETA_I, eta_t=ETA_T) -> Paths:
    """The paths of stationary optical length; all arguments broadcast."""
    x = _stationary(separation, height, depth, eta_i, eta_t)
    angles = jnp.arctan2(x, height), jnp.arctan2(separation - x, depth)
    return Paths(x, *map(jnp.rad2deg, angles))


def refracted_angle_deg(angle_i_deg, eta):
    """The same from Snell's law, by `fresnel_jax.directions.refract`."""
    theta = jnp.deg2rad(jnp.asarray(angle_i_deg))
    wi = jnp.stack([-jnp.sin(theta), jnp.zeros_like(theta), jnp.cos(theta)], axis=-1)
    direction = refract(wi, jnp.array([0.0, 0.0, 1.0]), eta).direction
    return jnp.rad2deg(jnp.arctan2(direction[..., 0], -direction[..., 2]))


def shades(excess: np.ndarray) -> np.ndarray:
    """Colours for lengths above the shortest: dark for little, pale for much."""
    import matplotlib

    return matplotlib.colormaps["YlOrRd_r"](0.05 + 0.75 * np.sqrt(excess / excess.max()))


def draw(path, paths: Paths, others: Paths) -> None:
    """The candidates from A to B coloured by their length, L(x), and the angles."""
    x_star = float(paths.crossing)
    candidates = np.linspace(-0.15, 2.05, 45)
    length = np.asarray(optical_path(candidates, SEPARATION, HEIGHT, DEPTH, ETA_I, ETA_T))
    shortest = float(optical_path(x_star, SEPARATION, HEIGHT, DEPTH, ETA_I, ETA_T))
    with figure(path, 11.5, 5.4) as fig:
        grid = fig.add_gridspec(2, 2, width_ratios=(1.35, 1.0))
        way, valley, law = (fig.add_subplot(g) for g in (grid[:, 0], grid[0, 1], grid[1, 1]))

        way.axhspan(-1.25, 0.0, color="#d9ecf5")
        way.axhline(0.0, color=GREY, linewidth=1.0)
        colors = shades(length - shortest)
        for x, color in zip(candidates, colors, strict=True):
            way.plot([0, x, SEPARATION], [HEIGHT, 0, -DEPTH], color=color, linewidth=0.9)
        way.plot([0, x_star, SEPARATION], [HEIGHT, 0, -DEPTH], color="black", linewidth=3.0)
        way.plot([x_star, x_star], [-0.55, 0.55], color=GREY, linestyle=":", linewidth=1.2)
        way.plot([0, SEPARATION], [HEIGHT, -DEPTH], "o", color="black", markersize=8)
        way.annotate("A", (0, HEIGHT), (-0.1, 1.06), fontweight="bold", fontsize=14)
        way.annotate("B", (SEPARATION, -DEPTH), (1.95, -1.14), fontweight="bold", fontsize=14)
        way.text(2.15, 1.0, rf"air, $\eta$ = {ETA_I:g}", ha="right", color=GREY, fontsize=13)
        way.text(-0.12, -1.08, rf"glass, $\eta$ = {ETA_T:g}", color=GREY, fontsize=13)
        way.set(xlim=(-0.2, 2.2), ylim=(-1.25, 1.25), aspect="equal", xticks=[], yticks=[])
        way.spines[:].set_visible(False)
        way.set_title("Light takes the path of stationary optical length")

        fine = np.linspace(candidates[0], candidates[-1], 400)
        valley.plot(fine, optical_path(fine, SEPARATION, HEIGHT, DEPTH, ETA_I, ETA_T), color=GREY)
        valley.scatter(candidates, length, c=colors, s=26, zorder=3)
        valley.plot([x_star], [shortest], "o", color="black", markersize=9, zorder=4)
        valley.annotate(
            r"$\mathrm{d}L/\mathrm{d}x = 0$", (x_star, shortest), (0, 14), ha="center",
            textcoords="offset points",
        )  # fmt: skip
        valley.set(xlabel="crossing $x$", ylabel="optical path $L(x)$")

        angles = np.linspace(0.0, 90.0, 181)
        law.plot(angles, refracted_angle_deg(angles, ETA_T), color=BLUE, label="Snell's law")
        law.plot(
            others.angle_i_deg, others.angle_t_deg, "o", color=ORANGE, markersize=5,
            label="stationary paths",
        )  # fmt: skip
        law.set(xlabel="angle in air (degrees)", ylabel="angle in glass (degrees)", xlim=(0, 90))
        law.set_ylim(0, 45)
        law.grid(True)
        law.legend(loc="lower right")


def main(argv=None) -> dict[str, float]:
    """Draws the picture, prints and returns the numbers."""
    picture, size = arguments(__doc__, "fermat.png", 24, "number of paths compared", argv)
    paths = fermat(SEPARATION)
    others = fermat((HEIGHT + DEPTH) * jnp.tan(jnp.deg2rad(jnp.linspace(2.0, 86.0, size))))
    off = jnp.deg2rad(others.angle_t_deg - refracted_angle_deg(others.angle_i_deg, ETA_T))
    draw(picture, paths, others)
    results = {
        "angle_i_deg": float(paths.angle_i_deg),
        "angle_t_deg": float(paths.angle_t_deg),
        "largest_difference_rad": float(jnp.max(jnp.abs(off))),
    }
    print(
        "Fermat: {angle_i_deg:.12f} degrees in air, {angle_t_deg:.12f} in glass".format(**results)
    )
    print("largest difference from Snell's law: {largest_difference_rad:.1e} rad".format(**results))
    return results


if __name__ == "__main__":
    main()
