"""The colours of thin films: oxide on silicon, and soap; and a thickness read from a colour.

White light that is reflected by the two faces of a film interferes: a wavelength is missing where
2 n d cos(theta) fits. The chart of oxide on silicon hangs in every clean room, where the colour of
a wafer tells the thickness of its oxide. Here every colour is an integral of the reflectance of the
coherent stack over the visible wavelengths, times the colour matching functions; three wavelengths
would give colours that no eye sees. The last lines go back: Gauss and Newton's method with the
derivative of the colour with respect to the thickness finds the thickness from the colour.
"""

import jax
import jax.numpy as jnp
import numpy as np
from _picture import arguments, figure

from fresnel_jax.colour import linear_srgb, srgb_encode, xyz
from fresnel_jax.dispersion import material
from fresnel_jax.layers import stack

jax.config.update("jax_enable_x64", True)

WAVELENGTH_UM = np.linspace(0.38, 0.78, 161)


def _index(name: str):
    eta, k = material(name)(WAVELENGTH_UM)
    return eta + 1j * np.broadcast_to(k, np.shape(WAVELENGTH_UM))


OXIDE_ON_SILICON = [1.0, _index("fused silica"), _index("silicon")]
SOAP_FILM = [1.0, _index("water"), 1.0]


@jax.jit
def colour(index, thickness_um, cos_theta):
    """Linear sRGB of reflected daylight, for thicknesses and cosines that broadcast."""
    d, c = jnp.asarray(thickness_um)[None, ..., None], jnp.asarray(cos_theta)[..., None]
    R = stack(c, index, thickness_um=d, wavelength_um=WAVELENGTH_UM).R
    return linear_srgb(xyz(R, WAVELENGTH_UM))


def thickness_from_colour(index, rgb, guess_um, rounds: int = 8):
    """The film thickness in micrometres at normal incidence, by Gauss and Newton from a guess."""

    def residual(d):
        return colour(index, d, 1.0) - rgb

    def improve(d, _):
        difference, slope = residual(d), jax.jacfwd(residual)(d)
        return d - jnp.vdot(slope, difference) / jnp.vdot(slope, slope), None

    return jax.lax.scan(improve, jnp.asarray(guess_um), length=rounds)[0]


def draw(path, size: int) -> None:
    """Both charts: colour over thickness and angle."""
    angle = np.linspace(0.0, 80.0, size)
    films = (
        ("Oxide on silicon", OXIDE_ON_SILICON, 1.0, 2.0),
        ("Soap film in air", SOAP_FILM, 1.2, 4.0),
    )
    with figure(path, 12.0, 5.0) as fig:
        for axes, (title, index, thickest, exposure) in zip(fig.subplots(1, 2), films, strict=True):
            thickness = np.linspace(0.0, thickest, 2 * size)
            cosine = np.cos(np.radians(angle))[:, None]
            rgb = srgb_encode(exposure * colour(index, thickness, cosine))
            axes.imshow(
                np.clip(rgb, 0.0, 1.0),
                origin="lower",
                aspect="auto",
                extent=(0.0, 1e3 * thickest, 0.0, angle[-1]),
            )
            axes.grid(False)
            axes.set(title=title, xlabel="thickness (nm)", ylabel="angle of incidence (degrees)")


def main(argv=None) -> dict[str, float]:
    """Draws the charts; returns and prints a thickness found from a colour, in nanometres."""
    path, size = arguments(__doc__, "film_colours.png", 120, "angles in each chart", argv)
    draw(path, size)
    true_um = 0.1013
    found_um = thickness_from_colour(OXIDE_ON_SILICON, colour(OXIDE_ON_SILICON, true_um, 1.0), 0.12)
    results = {"true_nm": 1e3 * true_um, "found_nm": 1e3 * float(found_um)}
    print(
        f"oxide of {results['true_nm']:.4f} nm, from its colour and a guess of 120 nm: "
        f"{results['found_nm']:.4f} nm"
    )
    return results


if __name__ == "__main__":
    main()
