"""Snell's window: the world above the water, seen from below, in one bright disc overhead.

Light from the whole sky, down to the horizon, is refracted into the cone within the critical angle
theta_c = arcsin(1 / eta). For water (eta = 1.333) that is 48.6 degrees, and by solid angle
1 - cos(theta_c) = 0.339 of the hemisphere. Outside of the cone the surface is a perfect mirror and
shows the lake floor.

On the left a fan of rays leaves a lamp under water; each is split by the Fresnel equations into a
refracted and a reflected ray, as opaque as its share of the power. On the right an eye looks
straight up from a forest lake. The projection is Lambert's, which keeps areas: the share of the
picture that the window fills is its share of the hemisphere. Radiance that enters the water is
multiplied by T and, since its cone narrows, by eta^2.
"""

import jax
import jax.numpy as jnp
import numpy as np
from _colour import tone
from _picture import arguments, figure

from fresnel_jax import powers
from fresnel_jax.directions import critical_angle_deg, reflect, refract, snells_window

jax.config.update("jax_enable_x64", True)

ETA = 1.333
UP = np.array([0.0, 0.0, 1.0])
SUN = np.array([0.42, 0.34, 0.84]) / np.linalg.norm([0.42, 0.34, 0.84])


def through_surface(w):
    """What a ray from below does: (refracted, whether there is such a ray, reflected, Powers).

    `w` points from the surface to the eye or lamp, down, shape (..., 3).
    """
    refraction = refract(w, UP, ETA)
    return refraction.direction, refraction.valid, reflect(w, UP), powers(w[..., 2], 1.0, eta_i=ETA)


def trees(direction):
    """Coverage by the conifers around the lake, 0 to 1: 34 jagged cones over the azimuth."""
    rng = np.random.default_rng(8)
    azimuth = 2.0 * np.pi * (np.arange(34) + rng.uniform(-0.35, 0.35, 34)) / 34
    height = rng.uniform(18.0, 54.0, 34)
    width = rng.uniform(0.05, 0.11, 34)
    elevation = jnp.rad2deg(jnp.arcsin(direction[..., 2]))
    phi = jnp.arctan2(direction[..., 1], direction[..., 0])[..., None]
    away = jnp.abs(jnp.angle(jnp.exp(1j * (phi - azimuth))))
    rest = 1.0 - elevation[..., None] / height
    branches = 0.72 + 0.28 * jnp.mod(rest * height / 4.0, 1.0)
    edge = width * rest * branches - away
    ground = 3.0 - elevation
    return jnp.maximum(jnp.max(jax.nn.sigmoid(900.0 * edge), axis=-1), jax.nn.sigmoid(2.0 * ground))


def sky(direction):
    """Linear sRGB radiance from above: blue sky, white horizon, thin cloud, sun, trees."""
    z = direction[..., 2:]
    x, y = direction[..., :1] / (z + 0.15), direction[..., 1:2] / (z + 0.15)
    zenith, horizon = jnp.array([0.05, 0.20, 0.66]), jnp.array([0.95, 0.98, 1.05])
    color = zenith + (horizon - zenith) * jnp.exp(-3.2 * z)
    waves = sum(
        jnp.sin(f * (x * np.cos(a) + y * np.sin(a)) + 1.7 * jnp.sin(0.6 * f * y + a)) / f
        for f, a in ((2.0, 0.3), (3.7, 1.9), (6.1, 0.9), (11.0, 2.6), (17.0, 1.3))
    )
    color = color + 0.9 * jax.nn.sigmoid(6.0 * (waves - 0.62)) * (1.0 - color)
    toward_sun = (direction @ SUN)[..., None]
    glow = jnp.exp(60.0 * (toward_sun - 1.0)) + 30.0 * jax.nn.sigmoid(9e3 * (toward_sun - 0.9994))
    color = color + glow * jnp.array([1.0, 0.86, 0.62])
    leaf = jnp.array([0.018, 0.045, 0.022]) * (1.0 + 2.0 * jnp.maximum(toward_sun, 0.0) ** 8)
    cover = trees(direction)[..., None]
    return color * (1.0 - cover) + leaf * cover


def lake_floor(direction):
    """Radiance from below: a sunlit floor with its net of light, fading into blue with distance."""
    distance = -1.0 / jnp.minimum(direction[..., 2:], -1e-3)
    x, y = direction[..., :1] * distance, direction[..., 1:2] * distance
    ripple = sum(
        jnp.sin(6.3 * (x * np.cos(a) + y * np.sin(a)) + 1.1 * jnp.sin(4.1 * (y * np.cos(a) - x)))
        for a in (0.0, 1.1, 2.2, 3.4, 4.7)
    )
    sand = jnp.array([0.25, 0.33, 0.28]) * (0.35 + 1.5 * jnp.exp(-2.5 * jnp.abs(ripple)))
    water = jnp.array([0.002, 0.045, 0.095])
    clear = jnp.exp(-distance * jnp.array([1.10, 0.50, 0.42]))
    return sand * clear + water * (1.0 - clear)


@jax.jit
def look_up(x, y):
    """(radiance, whether the window is there) at points of the unit disc; r^2 = 1 - cos."""
    r2 = x * x + y * y
    cos_theta = jnp.maximum(1.0 - r2, 1e-6)
    sine_over_r = jnp.sqrt(2.0 - jnp.minimum(r2, 1.0))
    w = -jnp.stack([x * sine_over_r, y * sine_over_r, cos_theta], axis=-1)
    above, valid, below, share = through_surface(w / jnp.linalg.norm(w, axis=-1, keepdims=True))
    radiance = share.T[..., None] * ETA**2 * sky(above) + share.R[..., None] * lake_floor(below)
    return radiance, valid


def photograph(size: int, samples: int = 4):
    """(size x size x 4 sRGB picture, fraction of the hemisphere in which the sky is seen)."""
    fine = (np.arange(size * samples) + 0.5) / (size * samples) * 2.0 - 1.0
    image, seen, inside_count = [], 0, 0
    for rows in np.split(-fine, size):  # a row of the picture at a time, to spare memory
        x, y = np.meshgrid(fine, rows)
        inside = x * x + y * y < 1.0
        radiance, valid = look_up(x, y)
        seen += np.sum(np.asarray(valid) & inside)
        inside_count += np.sum(inside)
        rgba = jnp.concatenate([tone(0.75 * radiance), inside[..., None]], axis=-1)
        image.append(rgba.reshape(samples, size, samples, 4).mean(axis=(0, 2)))
    return np.stack(image), float(seen / inside_count)


def draw_fan(axes, count: int) -> None:
    """Rays from a lamp one unit below the surface, each as opaque as its power is large."""
    for colors, low, high in (
        (((0.02, 0.09, 0.20), (0.10, 0.28, 0.50)), 0.0, 1.25),
        (((0.03, 0.30, 0.38), (0.00, 0.05, 0.09)), -1.15, 0.0),
    ):
        axes.imshow(
            np.linspace(*colors, 64)[:, None], extent=(-2.1, 2.1, low, high), aspect="auto",
            interpolation="bicubic",
        )  # fmt: skip
    theta = np.deg2rad(np.linspace(-76.0, 76.0, count))
    w = -np.stack([np.sin(theta), np.zeros(count), np.cos(theta)], axis=-1)
    above, _, below, share = through_surface(w)
    hit = np.tan(theta)
    for i in range(count):
        axes.plot([0.0, hit[i]], [-1.0, 0.0], color="#ffe9a8", linewidth=1.1)
        for direction, power in ((above[i], float(share.T[i])), (below[i], float(share.R[i]))):
            if power > 1e-3:
                x, z = hit[i] + 4.0 * direction[0], 4.0 * direction[2]
                axes.plot([hit[i], x], [0.0, z], color="#ffe9a8", linewidth=1.1, alpha=power**0.7)
    critical = float(critical_angle_deg(ETA))
    edge = np.tan(np.deg2rad(critical))
    for side in (-edge, edge):
        axes.plot([0.0, side], [-1.0, 0.0], color="#ff7d4d", linewidth=2.0, linestyle="--")
    axes.plot([0.0, 0.0], [-1.0, 0.0], color="white", linewidth=0.9, linestyle=":")
    arc = np.deg2rad(np.linspace(0.0, critical, 40))
    axes.plot(0.36 * np.sin(arc), -1.0 + 0.36 * np.cos(arc), color="#ff7d4d", linewidth=2.0)
    axes.text(
        0.42, -0.74, rf"$\theta_c$ = {critical:.1f}$\degree$", color="white", fontsize=14,
        bbox={"facecolor": "#02202a", "edgecolor": "none", "alpha": 0.75, "pad": 3.0},
    )  # fmt: skip
    axes.plot([-2.1, 2.1], [0.0, 0.0], color="#9fdcec", linewidth=1.6)
    axes.plot([0.0], [-1.0], "o", color="#fff3c9", markersize=11)
    axes.set(xlim=(-2.1, 2.1), ylim=(-1.15, 1.25), aspect="equal")
    axes.axis("off")


def draw(path, size: int) -> float:
    """The fan and the photograph; the fraction of the hemisphere that is window."""
    image, fraction = photograph(size)
    with figure(path, 12.0, 4.7, facecolor="#050b10") as fig:
        fan, window = fig.subplots(1, 2, width_ratios=(1.75, 1.0))
        draw_fan(fan, 41)
        window.imshow(np.clip(image, 0.0, 1.0), interpolation="lanczos")
        window.axis("off")
        fan.set_title("A lamp under water: refracted inside the cone, all reflected outside",
                      color="white")  # fmt: skip
        window.set_title(f"Looking up: {fraction:.1%} of the hemisphere", color="white")
    return fraction


def main(argv=None) -> dict[str, float]:
    """Draws the picture, prints and returns the numbers."""
    picture, size = arguments(__doc__, "snells_window.png", 560, "pixels across", argv)
    results = {
        "half_angle_deg": float(critical_angle_deg(ETA)),
        "window": float(snells_window(ETA)),
        "window_seen": draw(picture, size),
    }
    print("Snell's window: {half_angle_deg:.6f} degrees from the vertical".format(**results))
    print(
        "its share of the hemisphere: {window:.6f}; in the picture {window_seen:.4f}".format(
            **results
        )
    )
    return results


if __name__ == "__main__":
    main()
