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
from _lake import lake_floor, sky
from _picture import arguments, figure, tone

from fresnel_jax import powers
from fresnel_jax.directions import critical_angle_deg, reflect, refract, snells_window

jax.config.update("jax_enable_x64", True)

ETA = 1.333
UP = np.array([0.0, 0.0, 1.0])


@jax.jit
def through_surface(w):
    """What a ray from below does: (refracted, whether there is such a ray, reflected, Powers).

    `w` points from the surface to the eye or lamp, down, shape (..., 3).
    """
    refraction = refract(w, UP, ETA)
    return refraction.direction, refraction.valid, reflect(w, UP), powers(w[..., 2], 1.0, eta_i=ETA)


@jax.jit
def look_up(x, y):
    """(sRGB with opacity, whether it is window) at points of the disc, where r^2 = 1 - cos."""
    r2 = x * x + y * y
    sine_over_r = jnp.sqrt(2.0 - jnp.minimum(r2, 1.0))
    w = -jnp.stack([x * sine_over_r, y * sine_over_r, jnp.maximum(1.0 - r2, 1e-6)], axis=-1)
    above, valid, below, share = through_surface(w / jnp.linalg.norm(w, axis=-1, keepdims=True))
    light = share.T[..., None] * ETA**2 * sky(above) + share.R[..., None] * lake_floor(below)
    return jnp.concatenate([tone(0.75 * light), (r2 < 1.0)[..., None]], axis=-1), valid & (r2 < 1.0)


def photograph(size: int, samples: int = 4):
    """(picture of size x size x 4, fraction of the hemisphere in which the sky is seen)."""
    fine = (np.arange(size * samples) + 0.5) / (size * samples) * 2.0 - 1.0
    image, window = [], 0
    for rows in np.split(-fine, size):  # a row of the picture at a time, to spare memory
        rgba, seen = look_up(*np.meshgrid(fine, rows))
        image.append(np.reshape(rgba, (samples, size, samples, 4)).mean(axis=(0, 2)))
        window += np.sum(seen)
    return np.stack(image), float(window / (np.sum(np.stack(image)[..., 3]) * samples**2))


def draw_fan(axes, count: int) -> None:
    """Rays from a lamp one unit below the surface, each as opaque as its power is large."""
    air, water = ((0.02, 0.09, 0.20), (0.10, 0.28, 0.50)), ((0.03, 0.30, 0.38), (0.00, 0.05, 0.09))
    for colors, low, high in ((air, 0.0, 1.25), (water, -1.15, 0.0)):
        axes.imshow(np.linspace(*colors, 64)[:, None], extent=(-2.1, 2.1, low, high), aspect="auto",
                    interpolation="bicubic")  # fmt: skip
    theta = np.deg2rad(np.linspace(-76.0, 76.0, count))
    w = -np.stack([np.sin(theta), np.zeros(count), np.cos(theta)], axis=-1)
    above, _, below, share = jax.device_get(through_surface(w))
    for i, hit in enumerate(np.tan(theta)):
        axes.plot([0.0, hit], [-1.0, 0.0], color="#ffe9a8", linewidth=1.1)
        for direction, power in ((above[i], share.T[i]), (below[i], share.R[i])):
            x, z = hit + 4.0 * direction[0], 4.0 * direction[2]
            axes.plot([hit, x], [0.0, z], color="#ffe9a8", linewidth=1.1, alpha=power**0.7)
    critical = float(critical_angle_deg(ETA))
    arc = np.deg2rad(np.linspace(0.0, critical, 40))
    for side in (-1.0, 1.0):
        axes.plot([0.0, side * np.tan(arc[-1])], [-1.0, 0.0], "--", color="#ff7d4d", linewidth=2.0)
    axes.plot(0.36 * np.sin(arc), -1.0 + 0.36 * np.cos(arc), color="#ff7d4d", linewidth=2.0)
    box = {"facecolor": "#02202a", "edgecolor": "none", "alpha": 0.75, "pad": 3.0}
    axes.text(0.42, -0.74, rf"$\theta_c$ = {critical:.1f}$\degree$", color="white", fontsize=14,
              bbox=box)  # fmt: skip
    axes.plot([-2.1, 2.1], [0.0, 0.0], color="#9fdcec", linewidth=1.6)
    axes.plot([0.0], [-1.0], "o", color="#fff3c9", markersize=11)
    axes.set(xlim=(-2.1, 2.1), ylim=(-1.15, 1.25), aspect="equal")


def draw(path, size: int) -> float:
    """The fan and the photograph; the fraction of the hemisphere that is window."""
    image, fraction = photograph(size)
    with figure(path, 12.4, 4.8, facecolor="#050b10") as fig:
        fan, window = fig.subplots(1, 2, width_ratios=(1.75, 1.0))
        draw_fan(fan, 41)
        window.imshow(np.clip(image, 0.0, 1.0), interpolation="lanczos")
        fan.set_title("A lamp under water: refracted inside the cone, all reflected outside",
                      color="white")  # fmt: skip
        window.set_title(f"Looking up: {fraction:.1%} of the hemisphere", color="white")
        for axes in (fan, window):
            axes.axis("off")
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
    print("share of the hemisphere: {window:.6f}; seen: {window_seen:.4f}".format(**results))
    return results


if __name__ == "__main__":
    main()
