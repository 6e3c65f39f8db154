"""The picture of `prism`: beams of light with a soft profile, and the glass that they cross."""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from _picture import spectral_rgb

APEX_DEG, SIDE = 60.0, 1.6
LEFT, RIGHT, BOTTOM, TOP = -1.75, 3.05, -1.75, 0.95  # of the picture
WIDTH = 0.013  # standard deviation of the beam's profile
_HALF = np.deg2rad(APEX_DEG) / 2.0
# Outward normals of the faces that light enters and leaves by; the corners, the top first.
ENTRY = np.array([-np.cos(_HALF), np.sin(_HALF), 0.0])
EXIT = np.array([np.cos(_HALF), np.sin(_HALF), 0.0])
CORNERS = SIDE * np.array(
    [
        [0.0, 0.5 * np.cos(_HALF), 0.0],
        [-np.sin(_HALF), -0.5 * np.cos(_HALF), 0.0],
        [np.sin(_HALF), -0.5 * np.cos(_HALF), 0.0],
    ]
)
MEETS = 0.5 * (CORNERS[0] + CORNERS[1])  # where the beam enters


class Passage(NamedTuple):
    """Directions of travel before, in and behind the prism; powers in, behind and mirrored."""

    first: jax.Array
    inside: jax.Array
    last: jax.Array
    entered: jax.Array
    passed: jax.Array
    mirrored: jax.Array


@partial(jax.jit, static_argnums=(0, 2))
def render(passage, wavelengths_um, width: int):
    """Linear light on the picture's plane, shape (9/16 width, width, 3): mean of the wavelengths.

    `passage(wavelength_um)` gives the `Passage` of one wavelength.
    """
    height = width * 9 // 16
    x, y = jnp.meshgrid(jnp.linspace(LEFT, RIGHT, width), jnp.linspace(TOP, BOTTOM, height))
    points = jnp.stack([x, y, jnp.zeros_like(x)], axis=-1)
    before, behind = ((points - CORNERS[0]) @ n > 0.0 for n in (ENTRY, EXIT))

    def shine(where, point, direction, spread, power):
        aside = jnp.cross(points - point, direction)[..., 2] / (spread * WIDTH)
        return where * power / spread * jnp.exp(-0.5 * aside**2)

    def add(light, wavelength_um):
        way = passage(wavelength_um)
        leaves = MEETS + ((CORNERS[0] - MEETS) @ EXIT) / (way.inside @ EXIT) * way.inside
        # A beam that is refracted from cos_i to cos_t changes its width by their ratio.
        in_glass = jnp.abs((way.inside @ ENTRY) / (way.first @ ENTRY))
        behind_it = in_glass * jnp.abs((way.last @ EXIT) / (way.inside @ EXIT))
        back = way.first - 2.0 * (way.first @ ENTRY) * ENTRY
        shone = (
            shine(before, MEETS, way.first, 1.0, 1.0)
            + shine(before, MEETS, back, 1.0, way.mirrored)
            + shine(~before & ~behind, MEETS, way.inside, in_glass, way.entered)
            + shine(behind, leaves, way.last, behind_it, way.passed)
        )
        return light + shone[..., None] * spectral_rgb(wavelength_um), None

    light, _ = jax.lax.scan(add, jnp.zeros_like(points), wavelengths_um)
    return light / len(wavelengths_um)
