"""From wavelengths to what a screen shows: colour matching, white balance, tone, sRGB."""

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike

VISIBLE_UM = (0.39, 0.73)
# CIE 1931 colour matching functions as sums of Gaussians with two widths: peak, centre, width
# below and above it in nm. C. Wyman, P.-P. Sloan and P. Shirley 2013, Simple analytic
# approximations to the CIE XYZ color matching functions, JCGT 2(2), table 1.
_LOBES = (
    ((0.362, 442.0, 16.0, 26.7), (1.056, 599.8, 37.9, 31.0), (-0.065, 501.1, 20.4, 26.2)),
    ((0.821, 568.8, 46.9, 40.5), (0.286, 530.9, 16.3, 31.1)),
    ((1.217, 437.0, 11.8, 36.0), (0.681, 459.0, 26.0, 13.8)),
)
# Linear sRGB from CIE XYZ, IEC 61966-2-1.
_XYZ_TO_RGB = (
    (3.2404542, -1.5371385, -0.4985314),
    (-0.9692660, 1.8760108, 0.0415560),
    (0.0556434, -0.2040259, 1.0572252),
)


def colour_matching(wavelength_um: ArrayLike) -> Array:
    """CIE 1931 x, y, z of the 2-degree observer, shape (..., 3); within 0.05 of the table."""
    nm = 1e3 * jnp.asarray(wavelength_um)

    def lobe(peak, centre, below, above):
        t = (nm - centre) / jnp.where(nm < centre, below, above)
        return peak * jnp.exp(-0.5 * t * t)

    return jnp.stack([sum(lobe(*row) for row in rows) for rows in _LOBES], axis=-1)


def spectral_rgb(wavelength_um: ArrayLike) -> Array:
    """Linear sRGB of monochromatic light, shape (..., 3); components may be negative.

    White-balanced as a camera is: the mean over all visible wavelengths, the light of an
    equal-energy source, is (1, 1, 1).
    """
    matrix = jnp.asarray(_XYZ_TO_RGB)
    low, high = VISIBLE_UM
    middle_of_nm = low + 1e-3 * (jnp.arange(round(1e3 * (high - low))) + 0.5)
    white = jnp.mean(colour_matching(middle_of_nm) @ matrix.T, axis=0)
    return colour_matching(wavelength_um) @ matrix.T / white


def encode(linear: ArrayLike) -> Array:
    """sRGB pixel values in [0, 1] of linear ones, clipped (IEC 61966-2-1)."""
    x = jnp.clip(jnp.asarray(linear), 0.0, 1.0)
    return jnp.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1.0 / 2.4) - 0.055)


def tone(linear: ArrayLike) -> Array:
    """sRGB pixel values of a scene with highlights: (1 - exp(-x))^1.25, film's shoulder and toe."""
    exposure = jnp.maximum(jnp.asarray(linear), 0.0)
    return encode((1.0 - jnp.exp(-exposure)) ** 1.25)
