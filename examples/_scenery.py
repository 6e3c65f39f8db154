"""What stands around in `two_spheres`: a floor, a sky, a sun, and where the spheres are.

Lengths in radii of the spheres; +z is up; colours are linear sRGB.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.ndimage import map_coordinates

UP = np.array([0.0, 0.0, 1.0])
GLASS, GOLD, RADIUS = np.array([-0.72, 0.0, 1.0]), np.array([1.45, 0.75, 1.0]), 1.0
SUN = np.array([-0.42, 0.62, 0.60]) / np.linalg.norm([0.42, 0.62, 0.60])
SUNLIGHT = np.array([2.5, 2.0, 1.4])  # irradiance over pi, facing the sun
SKYLIGHT = np.array([0.46, 0.55, 0.76])  # mean radiance of the sky
CAUSTIC_CELLS, CAUSTIC_SPAN = 120, 5.0  # a square of the floor in front of the glass sphere
CAUSTIC_CORNER = GLASS[:2] - CAUSTIC_SPAN / 2 - SUN[:2] / SUN[2]


def dot(a, b):
    """Inner product over the last axis."""
    return jnp.sum(a * b, axis=-1)


def normalized(v):
    """v at unit length."""
    return v / jnp.linalg.norm(v, axis=-1, keepdims=True)


def distance_to(center, origin, direction):
    """Distance along the ray to a sphere, and whether it is met at all."""
    offset = origin - center
    b = dot(offset, direction)
    discriminant = b * b - dot(offset, offset) + RADIUS**2
    meets = discriminant > 0.0
    t = -b - jnp.sqrt(jnp.where(meets, discriminant, 1.0))
    return t, meets & (t > 1e-3)


def spacing(a):
    """Distance to the next ray of the picture, along rows and columns, for a of shape (..., 2)."""
    steps = [jnp.diff(a, axis=axis, append=jnp.take(a, jnp.array([-1]), axis)) for axis in (-2, -3)]
    return sum(dot(step, step) for step in steps)


def floor_radiance(x, y, light):
    """A checkered floor in sunlight, skylight and the caustic."""
    # Where neighbouring rays land more than a check apart, only the mean of the checks is seen.
    contrast = jnp.exp(-2.0 * spacing(jnp.stack([x, y], axis=-1)))
    checks = jnp.tanh(9.0 * jnp.sin(np.pi * x) * jnp.sin(np.pi * y))
    checks = (0.5 + 0.5 * contrast * checks)[..., None]
    albedo = jnp.array([0.05, 0.11, 0.14]) * (1.0 - checks) + jnp.array([0.58, 0.55, 0.49]) * checks
    point = jnp.stack([x, y, jnp.zeros_like(x)], axis=-1)
    sun, sky = SUN[2], jnp.ones_like(x)[..., None]
    for center, tint in ((GLASS, np.ones(3)), (GOLD, np.array([0.95, 0.75, 0.35]))):
        to_center = center - point
        toward_sun = dot(to_center, SUN)
        away = jnp.linalg.norm(to_center - toward_sun[..., None] * SUN, axis=-1)
        penumbra = 0.02 + 0.02 * jnp.abs(toward_sun)
        shadow = jax.nn.sigmoid(3.0 * (RADIUS - away) / penumbra) * (toward_sun > 0.0)
        sun = sun * (1.0 - shadow)
        # A sphere hides this part of the sky and shows sky and floor in its own colour instead.
        hidden = RADIUS**2 * center[2] / dot(to_center, to_center) ** 1.5
        sky = sky * (1.0 - hidden[..., None] * (1.0 - 0.55 * tint))
    cells = [
        (a - c) * CAUSTIC_CELLS / CAUSTIC_SPAN for a, c in zip((x, y), CAUSTIC_CORNER, strict=True)
    ]
    sun = sun + map_coordinates(light, cells, order=1)
    return albedo * (SUNLIGHT * sun[..., None] + SKYLIGHT * sky)


def sky_radiance(direction):
    """Blue above, pale at the horizon, a sun with its glow."""
    z = jnp.maximum(direction[..., 2:], 0.0)
    pale, blue = jnp.array([1.25, 1.02, 0.80]), jnp.array([0.22, 0.42, 0.78])
    color = blue + (pale - blue) * jnp.exp(-7.0 * z)
    near = (direction @ SUN)[..., None] - 1.0
    return color + SUNLIGHT * (0.20 * jnp.exp(20.0 * near) + 16.0 * jnp.exp(2500.0 * near))


def environment(origin, direction, light):
    """Floor or sky, without the spheres."""
    down = direction[..., 2] < -1e-4
    t = origin[..., 2] / jnp.where(down, -direction[..., 2], 1.0)
    x, y = (origin[..., i] + t * direction[..., i] for i in (0, 1))
    haze = jnp.where(down, jnp.exp(-((t / 26.0) ** 2)), 0.0)[..., None]
    x, y = (jnp.where(down, jnp.clip(a, -60.0, 60.0), 0.0) for a in (x, y))
    sky = sky_radiance(direction)
    return sky + (floor_radiance(x, y, light) - sky) * haze
