"""What an eye in a forest lake sees in `snells_window`: the sky and the trees, and the floor."""

import jax
import jax.numpy as jnp
import numpy as np

SUN = np.array([0.42, 0.34, 0.84]) / np.linalg.norm([0.42, 0.34, 0.84])


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
