"""A prism of flint glass spreads white light, and the sampled wavelengths average to white.

The index of the glass (SCHOTT SF11, Sellmeier's formula) falls with the wavelength, so that each
wavelength is refracted by its own angle at both faces. A spectral renderer samples wavelengths, one
in each of N equal parts of the visible range, follows each on its own path and shows it in its own
colour. Before the prism all paths coincide, and the mean of the colours is white. Behind it each
is seen alone. The mean over all that passes is white again, less what the Fresnel equations
reflect at the two faces (s and p apart): a little more of the blue than of the red.

The deviation of a ray that enters at the angle theta by a prism of apex angle A is, in closed form,

    delta = theta - A + arcsin(sin A sqrt(eta^2 - sin^2 theta) - cos A sin theta),

and its spread, the angular dispersion d(delta)/d(lambda), comes from `jax.grad` through the two
refractions and Sellmeier's formula.
"""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from _colour import VISIBLE_UM, spectral_rgb, tone
from _picture import arguments, figure

from fresnel_jax import powers
from fresnel_jax.directions import reflect, refract
from fresnel_jax.dispersion import material

jax.config.update("jax_enable_x64", True)

GLASS = material("SF11")
APEX_DEG, SIDE, MIDDLE_UM = 60.0, 1.6, 0.55
LEFT, RIGHT, BOTTOM, TOP = -1.75, 3.05, -1.75, 0.95  # of the picture
BEAM = 0.013  # standard deviation of the beam's profile


class Beam(NamedTuple):
    """A straight piece of the beam: a point of it, its direction, its width and its power."""

    point: jax.Array
    direction: jax.Array
    width: jax.Array
    power: jax.Array


def prism():
    """Outward normals of the faces that light enters and leaves by; the corners, the top first."""
    half = np.deg2rad(APEX_DEG) / 2.0
    sine, cosine = np.sin(half), np.cos(half)
    top = np.array([0.0, 0.5 * SIDE * cosine, 0.0])
    down = SIDE * np.array([[0.0, 0.0, 0.0], [-sine, -cosine, 0.0], [sine, -cosine, 0.0]])
    return np.array([-cosine, sine, 0.0]), np.array([cosine, sine, 0.0]), top + down


def incidence():
    """Angle, in radians, at which light of the middle wavelength passes symmetrically."""
    return jnp.arcsin(GLASS(MIDDLE_UM).eta * jnp.sin(jnp.deg2rad(APEX_DEG) / 2.0))


def directions(wavelength_um):
    """Directions of travel before, in and behind the prism of one wavelength, and the powers."""
    entry, leaving, _ = prism()
    eta = GLASS(wavelength_um).eta
    theta = incidence()
    along = jnp.array([entry[1], -entry[0], 0.0])
    first = -jnp.cos(theta) * entry + jnp.sin(theta) * along
    inside = refract(-first, entry, eta).direction
    last = refract(-inside, leaving, eta)
    enters = powers(first @ entry, eta)
    leaves = powers(inside @ leaving, 1.0, eta_i=eta)
    return first, inside, last.direction, enters, leaves


def deviation(wavelength_um):
    """The angle between the beams before and behind the prism, in radians."""
    first, _, last, _, _ = directions(wavelength_um)
    return jnp.arctan2(first[1] * last[0] - first[0] * last[1], first @ last)


def trace(wavelength_um) -> Beam:
    """The four pieces of the beam: before, in and behind the prism, and mirrored at its face."""
    entry, leaving, corners = prism()
    first, inside, last, enters, leaves = directions(wavelength_um)
    meets = jnp.asarray(0.5 * (corners[0] + corners[1]))
    exits = meets + ((corners[0] - meets) @ leaving) / (inside @ leaving) * inside
    # A beam that is refracted from cos_i to cos_t changes its width by their ratio.
    width = jnp.asarray(BEAM)
    width_in = width * jnp.abs((inside @ entry) / (first @ entry))
    width_out = width_in * jnp.abs((last @ leaving) / (inside @ leaving))
    passed = 0.5 * (enters.T_s * leaves.T_s + enters.T_p * leaves.T_p)
    pieces = (
        Beam(meets, first, width, jnp.ones_like(passed)),
        Beam(meets, inside, width_in, enters.T),
        Beam(exits, last, width_out, passed),
        Beam(meets, reflect(-first, entry), width, enters.R),
    )
    return jax.tree.map(lambda *parts: jnp.stack(parts), *pieces)


def sampled_wavelengths(count: int, seed: int = 0):
    """One wavelength from each of `count` equal parts of the visible range, in micrometres."""
    low, high = VISIBLE_UM
    u = (np.arange(count) + np.random.default_rng(seed).random(count)) / count
    return jnp.asarray(low + (high - low) * u)


@partial(jax.jit, static_argnames="width")
def render(wavelengths_um, width: int):
    """Linear light on the picture's plane, shape (9/16 width, width, 3): mean of the samples."""
    height = width * 9 // 16
    x, y = jnp.meshgrid(jnp.linspace(LEFT, RIGHT, width), jnp.linspace(TOP, BOTTOM, height))
    points = jnp.stack([x, y, jnp.zeros_like(x)], axis=-1)
    entry, leaving, corners = prism()
    before, behind = ((points - corners[0]) @ n > 0.0 for n in (entry, leaving))
    where = jnp.stack([before, ~before & ~behind, behind, before])

    def add(light, wavelength_um):
        beam = trace(wavelength_um)

        def shine(beam, where):
            aside = jnp.cross(points - beam.point, beam.direction)[..., 2] / beam.width
            return where * beam.power * BEAM / beam.width * jnp.exp(-0.5 * aside**2)

        shone = sum(shine(jax.tree.map(lambda a, i=i: a[i], beam), where[i]) for i in range(4))
        return light + shone[..., None] * spectral_rgb(wavelength_um), None

    light, _ = jax.lax.scan(add, jnp.zeros_like(points), wavelengths_um)
    return light / len(wavelengths_um)


def displayable(light):
    """sRGB pixels. A spectral colour lies outside of sRGB: the least grey that helps is added."""
    return np.asarray(tone(light - jnp.minimum(jnp.min(light, axis=-1, keepdims=True), 0.0)))


def draw(path, wavelengths_um, width: int) -> None:
    """The beams, the glass, the colours of the samples and their mean."""
    _, _, corners = prism()
    colors = spectral_rgb(jnp.sort(wavelengths_um))
    with figure(path, 12.0, 6.75, facecolor="black", layout="none") as fig:
        axes = fig.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.imshow(
            displayable(4.0 * render(wavelengths_um, width)), extent=(LEFT, RIGHT, BOTTOM, TOP),
            interpolation="bicubic",
        )  # fmt: skip
        triangle = np.vstack([corners, corners[:1]])[:, :2]
        axes.fill(*triangle.T, color="#bcd4e6", alpha=0.10, linewidth=0)
        axes.plot(*triangle.T, color="#cfe3f2", alpha=0.75, linewidth=1.6)
        axes.set(xlim=(LEFT, RIGHT), ylim=(BOTTOM, TOP))
        samples, mean = (
            fig.add_axes((0.62, 0.84, 0.25, 0.06)),
            fig.add_axes((0.9, 0.84, 0.06, 0.06)),
        )
        samples.imshow(displayable(0.6 * colors[None]), aspect="auto", interpolation="nearest")
        mean.imshow(displayable(4.0 * jnp.mean(colors, axis=0)[None, None]), aspect="auto")
        samples.set_title(f"{len(colors)} sampled wavelengths", color="white")
        mean.set_title("mean", color="white")
        for panel in (axes, samples, mean):
            panel.axis("off")


def main(argv=None) -> dict[str, float]:
    """Draws the picture, prints and returns the numbers."""
    picture, size = arguments(__doc__, "prism.png", 1280, "pixels across", argv)
    wavelengths = sampled_wavelengths(max(64, size // 4))
    colors = spectral_rgb(wavelengths)
    passed = jax.vmap(lambda w: trace(w).power[2])(wavelengths)
    draw(picture, wavelengths, size)
    results = {
        "deviation_deg": float(jnp.rad2deg(deviation(MIDDLE_UM))),
        "dispersion_deg_per_um": float(jnp.rad2deg(jax.grad(deviation)(MIDDLE_UM))),
        "mean_rgb": tuple(map(float, jnp.mean(colors, axis=0))),
        "passed_rgb": tuple(map(float, jnp.mean(passed[:, None] * colors, axis=0))),
    }
    print(
        "deviation at {middle} um: {deviation_deg:.9f} degrees, {dispersion_deg_per_um:.6f} "
        "degrees per um".format(middle=MIDDLE_UM, **results)
    )
    for text, name in (("all samples", "mean_rgb"), ("passed", "passed_rgb")):
        print(f"mean of {text}, linear sRGB:", *(f"{value:.4f}" for value in results[name]))
    return results


if __name__ == "__main__":
    main()
