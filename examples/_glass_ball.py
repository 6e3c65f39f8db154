"""The picture of `lobe_choice`: a glass ball in a room, by path tracing with a given sampler."""

from functools import partial

import jax
import jax.numpy as jnp

from fresnel_jax.directions import local_frame, to_local, to_world

BOUNCES = 10
BACKGROUND = (0.03, 0.035, 0.045)


def studio(direction):
    """Radiance around the ball: a room lit softly from above, two windows, a warm floor."""
    x, z = direction[..., :1], direction[..., 2:]
    color = jnp.array([0.30, 0.42, 0.58]) * (0.55 + 0.85 * jax.nn.sigmoid(5.0 * z))
    floor = jax.nn.sigmoid(-16.0 * (z + 0.22))
    color = color * (1.0 - floor) + jnp.array([0.95, 0.50, 0.22]) * floor
    for middle, half_width in ((-0.70, 0.06), (0.42, 0.27)):
        across, up = jnp.abs(x - middle), jnp.abs(z - 0.18)
        pane = jnp.minimum(half_width - across, 0.45 - up)
        pane = jnp.minimum(pane, across - 0.02)
        pane = jnp.minimum(pane, up - 0.02)
        color = color + jax.nn.sigmoid(70.0 * pane) * jnp.array([1.05, 0.95, 0.75])
    return color


@partial(jax.jit, static_argnums=(0, 2, 3))
def ball(sample, key, size: int, paths: int):
    """Radiance of a unit glass ball seen along +y from afar, shape (size, size, 3).

    `sample(wo, u)` gives the direction, in the local frame, and the weight of one path.
    """
    axis = 1.05 * ((jnp.arange(size) + 0.5) / size * 2.0 - 1.0)
    pixel = 2.1 / size

    def path(key):
        keys = jax.random.split(key, BOUNCES + 1)
        shift = pixel * (jax.random.uniform(keys[0], (2, size, size)) - 0.5)
        x, z = jnp.stack(jnp.meshgrid(axis, -axis)) + shift
        r2 = x * x + z * z
        inside = r2 < 1.0
        point = jnp.stack([x, -jnp.sqrt(jnp.where(inside, 1.0 - r2, 1.0)), z], axis=-1)
        point = jnp.where(inside[..., None], point, jnp.array([0.0, -1.0, 0.0]))
        direction = jnp.broadcast_to(jnp.array([0.0, 1.0, 0.0]), point.shape)

        def bounce(state, key):
            point, direction, weight, light = state
            frame = local_frame(point)
            u = jax.random.uniform(key, weight.shape)
            local, factor = sample(to_local(-direction, frame), u)
            direction, weight = to_world(local, frame), weight * factor
            leaves = local[..., 2] > 0.0
            light = light + jnp.where(leaves, weight, 0.0)[..., None] * studio(direction)
            across = -2.0 * jnp.sum(point * direction, axis=-1, keepdims=True) * direction
            point = point + jnp.where(leaves[..., None], 0.0, across)
            return (point, direction, jnp.where(leaves, 0.0, weight), light), None

        start = (point, direction, jnp.ones_like(r2), jnp.zeros_like(point))
        (_, _, _, light), _ = jax.lax.scan(bounce, start, keys[1:])
        return jnp.where(inside[..., None], light, jnp.array(BACKGROUND))

    return jnp.mean(jax.lax.map(path, jax.random.split(key, paths)), axis=0)
