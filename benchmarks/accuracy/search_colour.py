"""Entries of the accuracy search: colours, and the Fresnel term of a film."""

import functools

import gmpy2
import jax.numpy as jnp
import numpy as np

from benchmarks.accuracy.search_functions import plain_entry
from fresnel_jax import bsdf, colour, materials

_TABLE = materials._data().joinpath("cie_1931_d65.csv").read_text().splitlines()[5:]
_PRIMARIES = ("0.64", "0.33", "0.03"), ("0.30", "0.60", "0.10"), ("0.15", "0.06", "0.79")
_WAVELENGTHS = np.linspace(0.38, 0.78, 81)


@functools.cache
def _rows():
    """Wavelength and S x, S y, S z of every row of the table, by its digits."""
    rows = [[gmpy2.mpfr(x) for x in line.split(",")] for line in _TABLE]
    return [(w, *(x * s for x in xyz)) for w, *xyz, s in rows]


def _sum(R, rows):
    """X, Y, Z of the spectrum R at equal steps."""
    full = sum(row[2] for row in rows)
    return [sum(r * row[i] for r, row in zip(R, rows, strict=True)) / full for i in (1, 2, 3)]


@functools.cache
def _to_rgb():
    """The inverse of the primaries, each times what makes them white together, by cofactors."""
    p = [[gmpy2.mpfr(x) for x in column] for column in _PRIMARIES]

    def cross(a, b):
        return [a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3] for i in range(3)]

    rows = [cross(p[(i + 1) % 3], p[(i + 2) % 3]) for i in range(3)]
    white = _sum([1] * len(_rows()), _rows())
    # (row . white) of each is its strength times the determinant
    return [[x / sum(map(gmpy2.mul, row, white)) for x in row] for row in rows]


def _linear_srgb(*xyz):
    terms = [[a * x for a, x in zip(row, xyz, strict=True)] for row in _to_rgb()]
    return [(sum(x), sum(map(abs, x))) for x in terms]


def _lab(*xyz):
    def root(ratio):
        if ratio > gmpy2.mpq(6, 29) ** 3:
            return gmpy2.cbrt(ratio)
        return ratio * gmpy2.mpq(29, 6) ** 2 / 3 + gmpy2.mpq(4, 29)

    white = _sum([1] * len(_rows()), _rows())
    x, y, z = (root(a / b) for a, b in zip(xyz, white, strict=True))
    scales = (gmpy2.mpfr(s) * max(x, y, z) for s in (116, 500, 200))
    return [*zip((116 * y - 16, 500 * (x - y), 200 * (y - z)), scales, strict=True)]


def _srgb(x):
    digits = "12.92", "0.0031308", "2.4", "1.055", "0.055"
    factor, least, gamma, scale, less = map(gmpy2.mpfr, digits)
    return [(x * factor if x <= least else scale * x ** (1 / gamma) - less, None)]


def _spectrum(mean, swing, period, phase):
    """81 reflectances, of which the search changes four numbers."""
    waves = np.sin(_WAVELENGTHS[:, None] / period + phase)
    return tuple(mean * (1.0 + swing * waves))


def _film(n, k, d, n_t, k_t, c):
    """Linear sRGB every 10 nm by Airy's formula, in air."""
    rows, spectrum = _rows()[::2], []
    N, T = gmpy2.mpc(n, k), gmpy2.mpc(n_t, k_t)
    q, q_t = (gmpy2.sqrt(z * z - (1 - c * c)) for z in (N, T))
    for w, *_ in rows:
        turn = gmpy2.exp(gmpy2.mpc(0, 4) * gmpy2.const_pi() * q * d / w)
        R = 0
        for a, b, e in ((c, q, q_t), (c, q / (N * N), q_t / (T * T))):
            r, below = (a - b) / (a + b), (b - e) / (b + e) * turn
            R += gmpy2.norm((r + below) / (1 + r * below)) / 2
        spectrum.append(R)
    return _linear_srgb(*_sum(spectrum, rows))


def _our_film(n, k, d, n_t, k_t, c):
    return tuple(bsdf.FresnelFilm(n + 1j * k, d[None], n_t + 1j * k_t)(c[None]))


_TRISTIMULUS = ((1e-4, 1.2),) * 3
COLOUR = {
    "xyz": plain_entry(
        ((1e-3, 1.0), (1e-3, 1.0), (0.01, 1.0), (0.01, 6.0)),
        lambda *R: tuple(colour.xyz(jnp.stack(R), _WAVELENGTHS.astype(R[0].dtype))),
        lambda *R: [(x, None) for x in _sum(R, _rows())], 20.0, arguments=_spectrum,
    ),
    "lab": plain_entry(_TRISTIMULUS, lambda *x: tuple(colour.lab(jnp.stack(x))), _lab, 4.0, 8.0),
    "linear_srgb": plain_entry(
        _TRISTIMULUS, lambda *x: tuple(colour.linear_srgb(jnp.stack(x))), _linear_srgb, 16.0, 16.0
    ),
    "srgb_encode": plain_entry(
        ((1e-6, 10.0),), lambda x: (colour.srgb_encode(x),), _srgb, 8.0, 24.0
    ),
    "FresnelFilm": plain_entry(
        ((1.0, 5.0), (1e-9, 5.0), (1e-3, 2.0), (1.0, 5.0), (1e-9, 5.0), (1e-3, 1.0)),
        _our_film, _film, 64.0, 64.0, conditioned=True,
    ),
}  # fmt: skip
