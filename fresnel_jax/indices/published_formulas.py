"""The nine dispersion formulas of the refractiveindex.info database.

With l the vacuum wavelength in micrometres and C_1, C_2, .. the coefficients of a file:

    1   n^2 - 1 = C_1 + sum_i C_2i l^2 / (l^2 - C_(2i+1)^2)                    Sellmeier
    2   n^2 - 1 = C_1 + sum_i C_2i l^2 / (l^2 - C_(2i+1))                      Sellmeier
    3   n^2 = C_1 + sum_i C_2i l^C_(2i+1)                                      polynomial
    4   n^2 = C_1 + C_2 l^C_3 / (l^2 - C_4^C_5) + C_6 l^C_7 / (l^2 - C_8^C_9)
              + C_10 l^C_11 + C_12 l^C_13 + ..
    5   n = C_1 + sum_i C_2i l^C_(2i+1)                                        Cauchy
    6   n - 1 = C_1 + sum_i C_2i / (C_(2i+1) - l^-2)                           gases
    7   n = C_1 + C_2 / (l^2 - 0.028) + C_3 / (l^2 - 0.028)^2
            + C_4 l^2 + C_5 l^4 + C_6 l^6                                      Herzberger
    8   (n^2 - 1) / (n^2 + 2) = C_1 + C_2 l^2 / (l^2 - C_3) + C_4 l^2          retro
    9   n^2 = C_1 + C_2 / (l^2 - C_3) + C_4 (l - C_5) / ((l - C_5)^2 + C_6)    exotic

A coefficient that a file leaves out at the end is 0. Source: M. N. Polyanskiy, "Dispersion
formulas", refractiveindex.info; Sci. Data 11, 94 (2024), doi:10.1038/s41597-023-02898-2.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import equinox as eqx
import jax.numpy as jnp
from jax import Array

from .._numerics.index import Index
from .spectral import DispersionModel

# As many coefficients as the formula names one by one.
_NAMED = {4: 9, 7: 6, 8: 4, 9: 6}


def _index(number: int, c: tuple[float, ...], w: Array) -> Array:
    """Return n at wavelengths in micrometres by a formula of the module."""
    square = w * w

    def plus(start: float | Array, first: int, term: Callable[[float, float], Array]) -> Array:
        """Add a term for each pair of coefficients from C_first on, of which the first is not 0."""
        rest = c[first - 1 :]
        pairs = [(a, b) for a, b in zip(rest[::2], rest[1::2], strict=False) if a != 0.0]
        return sum((term(a, b) for a, b in pairs), jnp.zeros_like(w) + start)

    if number in (1, 2):
        power = 3 - number
        return jnp.sqrt(plus(1.0 + c[0], 2, lambda a, b: a * (square / (square - b**power))))
    if number in (3, 5):
        total = plus(c[0], 2, lambda a, b: a * w**b)
        return jnp.sqrt(total) if number == 3 else total
    if number == 4:
        total = plus(c[0], 10, lambda a, b: a * w**b)
        for j in (1, 5):
            if c[j] != 0.0:
                total = total + c[j] * w ** c[j + 1] / (square - c[j + 2] ** c[j + 3])
        return jnp.sqrt(total)
    if number == 6:
        return 1.0 + plus(c[0], 2, lambda a, b: a / (b - 1.0 / square))
    if number == 7:
        near = 1.0 / (square - 0.028)
        visible = c[0] + c[1] * near + c[2] * near * near
        return visible + square * (c[3] + square * (c[4] + square * c[5]))
    if number == 8:
        ratio = c[0] + c[1] * square / (square - c[2]) + c[3] * square
        return jnp.sqrt((1.0 + 2.0 * ratio) / (1.0 - ratio))
    away = w - c[4]
    return jnp.sqrt(c[0] + c[1] / (square - c[2]) + c[3] * away / (away * away + c[5]))


class PublishedFormula(DispersionModel):
    """A lossless index by one of the formulas of the module; NaN where n^2 would be negative.

    Arguments: `number`, 1 to 9; `coefficients` as in the file, C_1 first. They are numbers of a
    publication, not parameters of a fit.
    """

    number: int = eqx.field(static=True)
    coefficients: tuple[float, ...] = eqx.field(static=True)

    def __check_init__(self):
        if self.number not in range(1, 10):
            raise ValueError(f"formula {self.number} came; one from 1 to 9 was wanted")
        count, named = len(self.coefficients), _NAMED.get(self.number, 1)
        pairs = self.number < 7  # each further term has two coefficients
        whole = (count in (1, 5) or count >= named) and count % 2 if pairs else count <= named
        if not (count and whole):
            wanted = "1, 3, 5, .." if pairs else f"1 to {named}"
            wanted = "1, 5, 9, 11, 13, .." if self.number == 4 else wanted
            raise ValueError(
                f"formula {self.number} with {count} coefficients came; {wanted} were wanted"
            )
        if not all(map(math.isfinite, self.coefficients)):
            raise ValueError("a coefficient is not finite; numbers were wanted")

    def index(self, wavelength_um: Array) -> Index:
        missing = _NAMED.get(self.number, 1) - len(self.coefficients)
        eta = _index(self.number, (*self.coefficients, *([0.0] * missing)), wavelength_um)
        return Index(eta, jnp.zeros_like(eta))
