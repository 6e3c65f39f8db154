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

import jax
import jax.numpy as jnp
import numpy as np
from _beams import APEX_DEG, BOTTOM, CORNERS, ENTRY, EXIT, LEFT, RIGHT, TOP, Passage, render
from _picture import VISIBLE_UM, arguments, figure, spectral_rgb, tone

from fresnel_jax import powers
from fresnel_jax.directions import refract
from fresnel_jax.dispersion import material

jax.config.update("jax_enable_x64", True)

GLASS, MIDDLE_UM = material("SF11"), 0.55


def passage(wavelength_um) -> Passage:
    """The way of one wavelength through the prism, which the middle one passes symmetrically."""
    eta = GLASS(wavelength_um).eta
    theta = jnp.arcsin(GLASS(MIDDLE_UM).eta * jnp.sin(jnp.deg2rad(APEX_DEG) / 2.0))
    along = np.array([ENTRY[1], -ENTRY[0], 0.0])
    first = jnp.sin(theta) * along - jnp.cos(theta) * ENTRY
    inside = refract(-first, ENTRY, eta).direction
    last = refract(-inside, EXIT, eta).direction
    enters, leaves = powers(first @ ENTRY, eta), powers(inside @ EXIT, 1.0, eta_i=eta)
    passed = 0.5 * (enters.T_s * leaves.T_s + enters.T_p * leaves.T_p)
    return Passage(first, inside, last, enters.T, passed, enters.R)


@jax.jit
def deviation(wavelength_um):
    """The angle between the beams before and behind the prism, in radians."""
    way = passage(wavelength_um)
    turned = way.first[1] * way.last[0] - way.first[0] * way.last[1]
    return jnp.arctan2(turned, way.first @ way.last)


def sampled_wavelengths(count: int, seed: int = 0):
    """One wavelength from each of `count` equal parts of the visible range, in micrometres."""
    low, high = VISIBLE_UM
    u = (np.arange(count) + np.random.default_rng(seed).random(count)) / count
    return low + (high - low) * u


def draw(path, wavelengths_um, width: int) -> None:
    """The beams, the glass, the colours of the samples and their mean."""
    colors = np.asarray(spectral_rgb(wavelengths_um))
    with figure(path, 12.0, 6.75, facecolor="black", layout="none") as fig:
        axes = fig.add_axes((0.0, 0.0, 1.0, 1.0))
        light = tone(4.0 * render(passage, wavelengths_um, width))
        axes.imshow(light, extent=(LEFT, RIGHT, BOTTOM, TOP), interpolation="bicubic")
        triangle = np.vstack([CORNERS, CORNERS[:1]])[:, :2]
        axes.fill(*triangle.T, color="#bcd4e6", alpha=0.10, linewidth=0)
        axes.plot(*triangle.T, color="#cfe3f2", alpha=0.75, linewidth=1.6)
        axes.set(xlim=(LEFT, RIGHT), ylim=(BOTTOM, TOP))
        samples, mean = (fig.add_axes((x, 0.84, w, 0.06)) for x, w in ((0.62, 0.25), (0.9, 0.06)))
        samples.imshow(tone(0.6 * colors[None]), aspect="auto", interpolation="nearest")
        mean.imshow(tone(4.0 * np.mean(colors, axis=0)[None, None]), aspect="auto")
        samples.set_title(f"{len(colors)} sampled wavelengths", color="white")
        mean.set_title("mean", color="white")
        axes.text(0.0, -0.62, "flint glass SF11", color="#cfe3f2", ha="center")
        for panel in (axes, samples, mean):
            panel.axis("off")


def main(argv=None) -> dict[str, float]:
    """Draws the picture, prints and returns the numbers."""
    picture, size = arguments(__doc__, "prism.png", 1280, "pixels across", argv)
    wavelengths = sampled_wavelengths(max(64, size // 4))
    colors = np.asarray(spectral_rgb(wavelengths))
    passed = np.asarray(jax.jit(jax.vmap(passage))(wavelengths).passed)
    draw(picture, wavelengths, size)
    results = {
        "deviation_deg": float(np.rad2deg(deviation(MIDDLE_UM))),
        "dispersion_deg_per_um": float(np.rad2deg(jax.grad(deviation)(MIDDLE_UM))),
        "mean_rgb": tuple(np.mean(colors, axis=0)),
        "passed_rgb": tuple(np.mean(passed[:, None] * colors, axis=0)),
    }
    angle, spread, *means = results.values()
    print(f"deviation at {MIDDLE_UM} um: {angle:.9f} degrees, {spread:.6f} degrees per um")
    for text, rgb in zip(("all samples", "what passes"), means, strict=True):
        print(f"mean of {text}, linear sRGB:", *(f"{value:.4f}" for value in rgb))
    return results


if __name__ == "__main__":
    main()
