"""Colours of spectra: CIE XYZ of the 2-degree observer of 1931, sRGB and CIE Lab.

    R = stack(1.0, index, thickness_um=d, wavelength_um=wavelength_um).R    # (..., n)
    lab(xyz(R, wavelength_um)); srgb_encode(linear_srgb(xyz(R, wavelength_um)))

    (X, Y, Z) = integral R S (x, y, z) d lambda / integral S y d lambda

with the spectral power S of the illuminant: Y is 1 for a perfect white. All functions broadcast,
keep float32 or float64 and are differentiable; nothing is clipped, so that a colour which a screen
cannot show has components outside of [0, 1] and a gradient.

Accuracy: the integral is a sum over the wavelengths given, each for the interval around it, with x,
y, z and S interpolated linearly in the table of 5 nm. A spectrum from 0.38 to 0.78 um every 5 nm
gives the sum that CIE 15 recommends. Of oxides up to 1 um on silicon colours by steps of 5, 10 and
20 nm were within 0.06, 0.14 and 0.8 Delta E of those by 1 nm.

Sources: CIE 15:2004, tables T.1 and T.4 and secs. 7 and 8.2.1 (`data/cie_1931_d65.csv` has the
numbers and their licence); IEC 61966-2-1:1999 for sRGB.
"""

from __future__ import annotations

import functools
from importlib import resources

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from ._numerics.arguments import as_float, as_floats, readable

__all__ = ["colour_matching", "lab", "linear_srgb", "srgb_encode", "xyz"]

# Chromaticities (x, y, z) of the primaries of sRGB, as columns: red, green, blue.
_PRIMARIES = np.array([[0.64, 0.30, 0.15], [0.33, 0.60, 0.06], [0.03, 0.10, 0.79]])


@functools.cache
def _table() -> np.ndarray:
    """Rows of wavelength_um, x, y, z and S of D65, every 5 nm from 0.38 to 0.78 um."""
    file = resources.files("fresnel_jax").joinpath("data", "cie_1931_d65.csv")
    lines = [s for s in file.read_text(encoding="ascii").splitlines() if not s.startswith("#")]
    return np.loadtxt(lines[1:], delimiter=",")


@functools.cache
def _white() -> np.ndarray:
    """X, Y, Z of a perfect white in D65: 0.9505, 1, 1.0888."""
    sums = _table()[:, 4] @ _table()[:, 1:4]
    return sums / sums[1]


def _interpolated(wavelength: Array, column: int) -> Array:
    grid, values = _table()[:, 0], _table()[:, column]
    grid, values = (jnp.asarray(x, wavelength.dtype) for x in (grid, values))
    return jnp.interp(wavelength, grid, values, left=0.0, right=0.0)


def colour_matching(wavelength_um: ArrayLike) -> Float[Array, "... 3"]:
    """x, y, z of the CIE 1931 observer at `wavelength_um` (...); 0 outside of 0.38 to 0.78 um.

    Interpolated linearly between values every 5 nm, whose six decimals are the CIE's.
    """
    wavelength = as_float(wavelength_um, "wavelength_um")
    return jnp.stack([_interpolated(wavelength, i) for i in (1, 2, 3)], -1)


def _check_wavelengths(wavelength: ArrayLike, shape: tuple[int, ...]):
    if np.ndim(wavelength) != 1 or len(shape) == 0 or np.shape(wavelength)[0] != shape[-1]:
        raise ValueError(
            f"wavelength_um has the shape {np.shape(wavelength)} and the spectrum {shape}; wanted "
            "(n,) and (..., n), the wavelengths on the last axis"
        )
    if not readable(wavelength):
        return
    steps, ends = np.diff(np.asarray(wavelength)), np.sort(np.asarray(wavelength)[[0, -1]])
    if not (np.all(steps > 0.0) or np.all(steps < 0.0)):
        raise ValueError("wavelength_um neither rises nor falls throughout; sort the spectrum")
    if not (ends[0] <= 0.4001 and ends[1] >= 0.6999 and np.abs(steps).max() <= 0.0201):
        raise ValueError(
            f"wavelength_um is {ends[0]:g} to {ends[1]:g} with steps up to {np.abs(steps).max():g};"
            " wanted 0.4 to 0.7 micrometres at least, with steps up to 0.02: add wavelengths"
        )


@functools.partial(jax.jit, static_argnums=3)
def _jit_xyz(spectrum, wavelength, power, daylight):
    if daylight:
        power = _interpolated(wavelength, 4)
    step = jnp.asarray(jnp.gradient(wavelength))
    weights = (step * power)[:, None] * colour_matching(wavelength)
    return jnp.matmul(spectrum, weights / weights[:, 1].sum(), precision="highest")


def xyz(
    spectrum: ArrayLike, wavelength_um: ArrayLike, illuminant: ArrayLike | None = None
) -> Float[Array, "... 3"]:
    """CIE X, Y, Z of light that a surface reflects or transmits; Y = 1 for a perfect white.

    Args:
        spectrum: R or T, (..., n).
        wavelength_um: wavelengths in vacuum, (n,), in rising or falling order, from 0.4 or less to
            0.7 um or more in steps of up to 20 nm; those outside of 0.38 to 0.78 um count nothing.
        illuminant: spectral power of the light at these wavelengths in any unit, (n,) or a number
            for equal energy; None: daylight D65.

    Raises:
        ValueError: shapes that do not fit, or known wavelengths that are not those above.
    """
    daylight = illuminant is None
    R, wavelength, power = as_floats(spectrum, wavelength_um, 1.0 if daylight else illuminant)
    _check_wavelengths(wavelength_um, R.shape)
    return _jit_xyz(R, wavelength, power, daylight)


def lab(tristimulus: ArrayLike, white: ArrayLike | None = None) -> Float[Array, "... 3"]:
    """CIE L*, a*, b* (..., 3) of X, Y, Z (..., 3); `white` is X, Y, Z of the white (None: D65).

    L* is 100 for the white; the distance of two colours is Delta E (CIE 1976), where 1 can just be
    seen. A few eps of 116, 500 and 200; the first derivative is continuous, at black too.
    """
    color = as_float(tristimulus, "tristimulus")
    full = jnp.asarray(_white() if white is None else white, color.dtype)

    def root(i):
        ratio = color[..., i] / full[..., i]
        bright = ratio > (6.0 / 29.0) ** 3
        dark = ratio * ((29.0 / 6.0) ** 2 / 3.0) + 4.0 / 29.0
        return jnp.where(bright, jnp.cbrt(jnp.where(bright, ratio, 1.0)), dark)

    x, y, z = root(0), root(1), root(2)
    return jnp.stack([116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)], -1)


def linear_srgb(tristimulus: ArrayLike) -> Float[Array, "... 3"]:
    """Linear sRGB (..., 3) of X, Y, Z (..., 3): 1, 1, 1 for the white of D65; not clipped.

    The matrix follows from the primaries of IEC 61966-2-1 and the white of the table, and agrees
    with the four decimals printed there to 2e-4. Within 16 eps of the sum of its terms' moduli.
    """
    to_xyz = _PRIMARIES * np.linalg.solve(_PRIMARIES, _white())
    color = as_float(tristimulus, "tristimulus")
    matrix = jnp.asarray(np.linalg.inv(to_xyz).T, color.dtype)
    return jnp.matmul(color, matrix, precision="highest")


def srgb_encode(linear: ArrayLike) -> Array:
    """sRGB pixel values of linear ones, (...): 0 to 1 becomes 0 to 1, others are not clipped.

    Below 0 the curve is its mirror image. Source: IEC 61966-2-1, sec. 5.2.
    """
    value = as_float(linear, "linear")
    size = jnp.abs(value)
    bright = size > 0.0031308
    curve = 1.055 * jnp.where(bright, size, 1.0) ** (1.0 / 2.4) - 0.055
    return jnp.where(bright, jnp.sign(value) * curve, 12.92 * value)
