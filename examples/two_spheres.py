"""A glass and a gold sphere under a sky, and the index of the glass recovered from the picture.

One jitted function traces every ray. At each hit the Fresnel equations say how much light is
reflected and how much goes through; gold has a reflectance per colour from its complex index.
Inside a sphere every internal reflection happens at the same angle, and with one polarisation:
the light that passes is (T_s^2 + T_p^2) / 2, s and p summed apart. Sunlight that the glass focuses
on the floor (the caustic) is traced forwards, from the sun.

The picture is a function of the index eta of the glass, and JAX differentiates it: one panel shows
d(picture)/d(eta). Given a photograph, with noise of one percent, optimistix minimises the squared
difference and finds the index from a wrong start; the curvature there gives the error bar.
"""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from _colour import tone
from _picture import BLUE, ORANGE, arguments, figure
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

TRUE_ETA, WRONG_ETA, NOISE = 1.517, 1.77, 0.01
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
        missed, mirrored, through = map(jnp.stack, scatter(Ray(*tree[i]), eta))
        return tree.at[i].set(missed).at[2 * i + 1].set(mirrored).at[2 * i + 2].set(through)

    tree = jax.lax.fori_loop(0, inner, grow, tree)
    leaves = Ray(*jnp.moveaxis(tree, 1, 0))
    return jnp.sum(leaves.share * environment(leaves.origin, leaves.direction, light), axis=0)


@partial(jax.jit, static_argnames=("width", "samples"))
def render(eta, width: int, samples: int):
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


class Recovery(NamedTuple):
    """The index found, its standard error, chi^2 per datum, and the index after each step."""

    eta: float
    sigma: float
    chi2_reduced: float
    steps: list[float]


@partial(jax.jit, static_argnames=("width", "samples"))
def derivative(eta, width: int, samples: int):
    """(picture, d picture / d eta)."""
    return jax.jvp(lambda e: render(e, width, samples), (eta,), (jnp.ones_like(eta),))


def recover(photograph, start: float, samples: int) -> Recovery:
    """The index of the glass in a photograph with noise, by Levenberg and Marquardt's method."""
    steps = []

    def note(**progress):
        jax.debug.callback(
            lambda eta: steps.append(float(eta)), progress["y_last_accepted_step"][1]
        )

    width = photograph.shape[1]

    @jax.custom_jvp
    def model(eta):
        return derivative(eta, width, samples)[0]

    @model.defjvp
    def _(eta, change):  # of one parameter only: the slope comes along with the picture
        picture, slope = derivative(*eta, width, samples)
        return picture, slope * change[0]

    @jax.jit
    def solve(start):
        return optx.least_squares(
            lambda eta, _: model(eta) - photograph,
            optx.LevenbergMarquardt(rtol=1e-4, atol=1e-4, norm=optx.rms_norm, verbose=note),
            start,
            max_steps=60,
        ).value

    eta = solve(jnp.asarray(start))
    picture, slope = derivative(eta, width, samples)
    jax.effects_barrier()
    chi2 = jnp.mean(((picture - photograph) / NOISE) ** 2)
    sigma = NOISE / jnp.linalg.norm(slope)
    return Recovery(float(eta), float(sigma), float(chi2), steps)


def draw(path, width: int, found: Recovery) -> None:
    """The photograph, the first guess, the derivative, and the way to the right index."""
    true = jnp.asarray(TRUE_ETA)
    picture, (_, slope) = render(true, width, 3), derivative(true, width // 2, 2)
    with figure(path, 12.6, 5.35) as fig:
        grid = fig.add_gridspec(2, 3, width_ratios=(1.0, 1.0, 0.98))
        photo, change, way = (fig.add_subplot(g) for g in (grid[:, :2], grid[0, 2], grid[1, 2]))
        photo.imshow(picture)
        photo.set_title(rf"glass ($\eta$ = {TRUE_ETA}) and gold, ray traced in one jitted function")
        # The slope of the square root keeps faint changes visible beside the caustic's.
        mean = np.asarray(slope) @ np.array([0.2126, 0.7152, 0.0722])
        change.imshow(np.sign(mean) * np.sqrt(np.abs(mean)), cmap="RdBu_r", vmin=-2.0, vmax=2.0)
        change.set_title(r"d(picture) / d$\eta$: brighter red, darker blue")
        for axes in (photo, change):
            axes.axis("off")
        error = np.abs(np.array([WRONG_ETA, *found.steps]) - TRUE_ETA)
        way.axhspan(1e-6, found.sigma, color=BLUE, alpha=0.15, linewidth=0)
        way.semilogy(error, "o-", color=ORANGE, markersize=5)
        way.text(0.02, found.sigma * 0.8, "standard error", color=BLUE, va="top",
                 transform=way.get_yaxis_transform())  # fmt: skip
        way.set(xlabel="Levenberg-Marquardt step", ylabel=r"$|\eta - \eta_{true}|$")
        way.set_ylim(min(error.min(), found.sigma) / 4.0, 1.0)
        way.set_title(rf"recovered: $\eta$ = {found.eta:.5f} $\pm$ {found.sigma:.5f}")
        way.grid(True, color="#e6e6e6")


def main(argv=None) -> dict[str, float]:
    """Draws the picture, prints and returns the numbers."""
    picture, size = arguments(__doc__, "two_spheres.png", 640, "pixels across", argv)
    samples, width = 2, min(64, size // 2)
    clean, _ = derivative(jnp.asarray(TRUE_ETA), width, samples)
    noise = NOISE * np.random.default_rng(1).standard_normal(clean.shape)
    found = recover(clean + noise, WRONG_ETA, samples)
    draw(picture, size, found)
    results = found._asdict() | {"steps": len(found.steps), "start": WRONG_ETA, "true": TRUE_ETA}
    print("from {start} in {steps} steps to eta = {eta:.5f} +- {sigma:.5f}".format(**results))
    print("the glass has {true}; chi^2 per datum {chi2_reduced:.3f}".format(**results))
    return results


if __name__ == "__main__":
    main()
