"""Snell's law from Fermat's principle: the path of light is found by automatic differentiation.

Light goes from A, in one medium, to B, in another, through the point x of the flat boundary
between them. Its optical path length is

    L(x) = eta_i |A x| + eta_t |x B|,

and Fermat's principle says that the path taken makes L stationary: dL/dx = 0. No law of refraction
is put in. JAX differentiates L, a Newton iteration (optimistix) finds the root of the derivative,
and the angles of the path that comes out obey eta_i sin_i = eta_t sin_t.
"""

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from _picture import BLUE, GREY, ORANGE, arguments, figure

from fresnel_jax.directions import refract

jax.config.update("jax_enable_x64", True)

ETA_I, ETA_T = 1.0, 1.5
HEIGHT, DEPTH, SEPARATION = 1.0, 1.0, 1.9


def optical_path(x, separation, height=HEIGHT, depth=DEPTH, eta_i=ETA_I, eta_t=ETA_T):
    """L(x) from (0, height) through (x, 0) to (separation, -depth)."""
    return eta_i * jnp.hypot(x, height) + eta_t * jnp.hypot(separation - x, depth)


@jax.jit
@jnp.vectorize
def crossing(separation, height, depth, eta_i, eta_t):
    """Where the path of stationary optical length crosses the boundary, found from L alone."""
    slope = jax.grad(optical_path)
    return optx.root_find(
        lambda x, given: slope(x, *given),
        optx.Newton(rtol=1e-15, atol=1e-15),
        y0=separation * height / (height + depth),
        args=(separation, height, depth, eta_i, eta_t),
        options={"lower": jnp.zeros_like(separation), "upper": separation},
        throw=False,
    ).value


def fermat(separation, height=HEIGHT, depth=DEPTH, eta_i=ETA_I, eta_t=ETA_T):
    """(crossing, angles in degrees on both sides) of the stationary paths; arguments broadcast."""
    x = np.asarray(crossing(separation, height, depth, eta_i, eta_t))
    angles = np.arctan2(x, height), np.arctan2(separation - x, depth)
    return x, *map(np.rad2deg, angles)


@jax.jit
def refracted_angle_deg(angle_i_deg, eta):
    """The same from Snell's law, by `fresnel_jax.directions.refract`."""
    theta = jnp.deg2rad(angle_i_deg)
    wi = jnp.stack([-jnp.sin(theta), jnp.zeros_like(theta), jnp.cos(theta)], axis=-1)
    direction = refract(wi, jnp.array([0.0, 0.0, 1.0]), eta).direction
    return jnp.rad2deg(jnp.arctan2(direction[..., 0], -direction[..., 2]))


def draw(path, found: float, angle_i_deg, angle_t_deg) -> None:
    """The candidates from A to B coloured by their length, L(x), and the angles."""
    import matplotlib

    x = np.linspace(-0.15, 2.05, 45)
    length, shortest = (np.asarray(optical_path(at, SEPARATION)) for at in (x, found))
    excess = (length - shortest) / np.max(length - shortest)
    colors = matplotlib.colormaps["YlOrRd_r"](0.05 + 0.75 * np.sqrt(excess))
    with figure(path, 11.5, 5.0) as fig:
        grid = fig.add_gridspec(2, 2, width_ratios=(1.2, 1.0))
        way, valley, law = (fig.add_subplot(g) for g in (grid[:, 0], grid[0, 1], grid[1, 1]))
        way.axhspan(-1.25, 0.0, color="#d9ecf5")
        way.axhline(0.0, color=GREY, linewidth=1.0)
        for at, color in zip(x, colors, strict=True):
            way.plot([0, at, SEPARATION], [HEIGHT, 0, -DEPTH], color=color, linewidth=0.9)
        way.plot([0, found, SEPARATION], [HEIGHT, 0, -DEPTH], "o-", color="black", linewidth=3.0)
        way.plot([found, found], [-0.55, 0.55], color=GREY, linestyle=":", linewidth=1.2)
        for text, at, weight in (
            ("A", (-0.1, 1.06), "bold"),
            ("B", (1.95, -1.14), "bold"),
            (rf"air, $\eta$ = {ETA_I:g}", (1.55, 1.0), "normal"),
            (rf"glass, $\eta$ = {ETA_T:g}", (-0.12, -1.08), "normal"),
        ):
            way.text(*at, text, fontweight=weight, fontsize=13)  # fmt: skip
        way.set(xlim=(-0.2, 2.2), ylim=(-1.25, 1.25), aspect="equal")
        way.set_title("Light takes the path of stationary optical length")
        way.axis("off")
        valley.plot(x, length, color=GREY)
        valley.scatter(x, length, c=colors, s=26, zorder=3)
        valley.plot([found], [shortest], "o", color="black", markersize=9, zorder=4)
        valley.annotate(r"$\mathrm{d}L/\mathrm{d}x = 0$", (found, shortest), (0, 14), ha="center",
                        textcoords="offset points")  # fmt: skip
        valley.set(xlabel="crossing $x$", ylabel="optical path $L(x)$")
        angles = np.linspace(0.0, 90.0, 181)
        law.plot(angles, refracted_angle_deg(angles, ETA_T), color=BLUE, label="Snell's law")
        law.plot(angle_i_deg, angle_t_deg, "o", color=ORANGE, label="stationary paths")
        law.set(xlabel="angle in air (degrees)", ylabel="angle in glass (degrees)")
        law.set(xlim=(0, 90), ylim=(0, 45))
        law.legend(loc="lower right")


def main(argv=None) -> dict[str, float]:
    """Draws the picture, prints and returns the numbers."""
    picture, size = arguments(__doc__, "fermat.png", 24, "number of paths compared", argv)
    steps = (HEIGHT + DEPTH) * np.tan(np.deg2rad(np.linspace(2.0, 86.0, size)))
    x, angle_i, angle_t = fermat(np.append(SEPARATION, steps))
    off = np.deg2rad(angle_t - refracted_angle_deg(angle_i, ETA_T))
    draw(picture, x[0], angle_i[1:], angle_t[1:])
    results = {"angle_i_deg": angle_i[0], "angle_t_deg": angle_t[0]}
    print("Fermat: {:.12f} degrees in air, {:.12f} in glass".format(*results.values()))
    results["largest_difference_rad"] = np.max(np.abs(off))
    print(f"largest difference from Snell's law: {results['largest_difference_rad']:.1e} rad")
    return results


if __name__ == "__main__":
    main()
