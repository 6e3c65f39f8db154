"""The ray tracer of `two_spheres`: a glass and a gold sphere, their light and their shadows.

At each hit the Fresnel equations say how much light is reflected and how much goes through; gold
has a reflectance per colour from its complex index. Light that passes a sphere meets both faces at
one angle and in one polarization: (T_s^2 + T_p^2) / 2 of it comes out, s and p summed apart.
Sunlight that the glass focuses on the floor, the caustic, is traced forwards, from the sun.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from _picture import tone
from _scenery import (
    CAUSTIC_CELLS,
    CAUSTIC_CORNER,
    CAUSTIC_SPAN,
    GLASS,
    GOLD,
    RADIUS,
    SUN,
    UP,
    distance_to,
    dot,
    environment,
    normalized,
)

from fresnel_jax import powers, reflectance
from fresnel_jax.directions import reflect, refract
from fresnel_jax.dispersion import material

jax.config.update("jax_enable_x64", True)

GOLD_INDEX = material("gold")(np.array([0.630, 0.532, 0.467]))  # for red, green and blue, in um
EYE, TARGET = np.array([0.25, -6.2, 1.9]), np.array([0.25, 0.0, 0.92])


class Passage(NamedTuple):
    """Where, in which direction and with which power light leaves a sphere that it has entered."""

    origin: jax.Array
    direction: jax.Array
    power: jax.Array


def passage(center, point, direction, eta) -> Passage:
    """The way of a ray through a sphere that it meets at `point`; inner reflections are lost."""
    normal = (point - center) / RADIUS
    entering = powers(dot(normal, direction), eta)
    inside = refract(-direction, normal, eta).direction
    point = point - 2.0 * RADIUS * dot(normal, inside)[..., None] * inside
    leaving = refract(-inside, (point - center) / RADIUS, eta).direction
    # Both faces are met at the same angle, and T is the same from either side.
    return Passage(point, leaving, 0.5 * (entering.T_s**2 + entering.T_p**2))


def caustic(eta, rays: int = 400):
    """Sunlight on the floor that came through the glass, over the irradiance facing the sun."""
    u = (np.arange(rays) + 0.5) / rays * 2.0 - 1.0
    u, v = (a.ravel() for a in np.meshgrid(u, u))
    u, v = u[(lit := u * u + v * v < 0.999)], v[lit]
    side = normalized(jnp.cross(SUN, UP))
    up = jnp.cross(side, SUN)
    start = GLASS + RADIUS * (u[:, None] * side + v[:, None] * up + 3.0 * SUN)
    direction = jnp.broadcast_to(-SUN, start.shape)
    t, _ = distance_to(GLASS, start, direction)
    light = passage(GLASS, start + t[:, None] * direction, direction, eta)
    falls = light.direction[:, 2] < -0.05
    _, blocked = distance_to(GOLD, light.origin, light.direction)
    t = light.origin[:, 2] / jnp.where(falls, -light.direction[:, 2], 1.0)
    cell = CAUSTIC_SPAN / CAUSTIC_CELLS
    floor = (light.origin[:, :2] + t[:, None] * light.direction[:, :2] - CAUSTIC_CORNER) / cell
    whole = jnp.floor(floor)
    rest = floor - whole
    power = jnp.where(falls & ~blocked, light.power, 0.0) * (2.0 * RADIUS / rays / cell) ** 2
    grid = jnp.zeros((CAUSTIC_CELLS, CAUSTIC_CELLS))
    for i in (0, 1):  # each ray is shared among four cells, so that the map is smooth in eta
        for j in (0, 1):
            share = jnp.abs(1 - i - rest[:, 0]) * jnp.abs(1 - j - rest[:, 1])
            index = whole.astype(int) + jnp.array([i, j])
            index = jnp.where(index < 0, CAUSTIC_CELLS, index)  # -1 would be the last cell
            grid = grid.at[index[:, 0], index[:, 1]].add(power * share, mode="drop")
    blur = jnp.exp(-0.5 * (jnp.arange(-4, 5) / 1.0) ** 2)  # the sun is not a point
    blur = blur / jnp.sum(blur)
    for axis in (0, 1):
        grid = jnp.apply_along_axis(lambda row: jnp.convolve(row, blur, "same"), axis, grid)
    return grid


class Ray(NamedTuple):
    """Rays and the share of their radiance, per colour, that reaches the eye; all (..., 3)."""

    origin: jax.Array
    direction: jax.Array
    share: jax.Array


def scatter(ray: Ray, eta) -> tuple[Ray, Ray, Ray]:
    """What a ray becomes: past the spheres, mirrored, through the glass."""
    t_glass, glass = distance_to(GLASS, ray.origin, ray.direction)
    t_gold, gold = distance_to(GOLD, ray.origin, ray.direction)
    glass, gold = glass & ~(gold & (t_gold < t_glass)), gold & ~(glass & (t_glass < t_gold))
    hit, glass = (glass | gold)[..., None], glass[..., None]
    t = jnp.where(glass, t_glass[..., None], t_gold[..., None])
    center = jnp.where(glass, GLASS, GOLD)
    # Rays that miss are given a point and a direction at which everything is finite.
    point = jnp.where(hit, ray.origin + t * ray.direction, GOLD + RADIUS * UP)
    direction = jnp.where(hit, ray.direction, -UP)
    normal = normalized(point - center)
    cosine = dot(normal, direction)[..., None]
    back = jnp.where(glass, reflectance(cosine, eta), reflectance(cosine, *GOLD_INDEX))
    way = passage(center, point, direction, eta)
    passed = jnp.where(glass, ray.share * way.power[..., None], 0.0)
    mirrored = Ray(point, reflect(-direction, normal), jnp.where(hit, ray.share * back, 0.0))
    through = Ray(way.origin, way.direction, passed)
    return ray._replace(share=jnp.where(hit, 0.0, ray.share)), mirrored, through


def radiance(ray: Ray, eta, light, surfaces: int = 2):
    """Linear sRGB radiance that a ray brings to the eye, through at most so many surfaces.

    The tree of rays lies in one array: ray i is mirrored as ray 2i + 1 and goes on as ray 2i + 2.
    A loop over i keeps the program that XLA compiles small.
    """
    inner = 2**surfaces - 1
    first = jnp.stack(ray)
    tree = jnp.zeros((2 * inner + 1, *first.shape), first.dtype).at[0].set(first)

    def grow(i, tree):
        # The barrier halves the time to compile: what is stacked is not computed anew per part.
        rays = jax.lax.optimization_barrier(scatter(Ray(*tree[i]), eta))
        missed, mirrored, through = map(jnp.stack, rays)
        return tree.at[i].set(missed).at[2 * i + 1].set(mirrored).at[2 * i + 2].set(through)

    tree = jax.lax.fori_loop(0, inner, grow, tree)
    leaves = Ray(*jnp.moveaxis(tree, 1, 0))
    return jnp.sum(leaves.share * environment(leaves.origin, leaves.direction, light), axis=0)


def trace(eta, width: int, samples: int):
    """The picture, sRGB, shape (5/8 width, width, 3), from samples^2 rays in each pixel."""
    height = width * 5 // 8
    forward = normalized(TARGET - EYE)
    right = normalized(jnp.cross(forward, UP))
    up = jnp.cross(right, forward)
    light = caustic(eta)

    def one_row(row):
        across = (jnp.arange(width * samples) + 0.5) / (width * samples) * 2.0 - 1.0
        down = (row + (jnp.arange(samples) + 0.5) / samples) / height * 2.0 - 1.0
        x, y = jnp.meshgrid(0.46 * across, -0.46 * height / width * down)
        direction = normalized(forward + x[..., None] * right + y[..., None] * up)
        eye = jnp.broadcast_to(EYE.astype(direction.dtype), direction.shape)
        seen = radiance(Ray(eye, direction, jnp.ones_like(direction)), eta, light)
        return jnp.mean(seen.reshape(samples, width, samples, 3), axis=(0, 2))

    return tone(1.15 * jax.lax.map(one_row, jnp.arange(height), batch_size=5))
