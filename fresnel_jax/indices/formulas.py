"""Dispersion formulas of transparent media: constant, Cauchy, Sellmeier."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from .._numerics.arguments import extinction, float_checked, float_named, not_negative
from .._numerics.arithmetic import real_sqrt, two_square
from .spectral import (
    DispersionModel,
    Index,
    as_powers,
    check_lengths,
    over_terms,
    parameters_named,
)


class Constant(DispersionModel):
    """The same index eta + ik at every wavelength.

    Arguments: `eta` >= 0 and `k` >= 0, numbers.
    """

    eta: Array = eqx.field(converter=float_checked("eta", not_negative))
    k: Array = eqx.field(converter=extinction, default=0.0)

    def index(self, wavelength_um: Array) -> Index:
        like = jnp.zeros_like(wavelength_um)
        return Index(like + self.eta.astype(like.dtype), like + self.k.astype(like.dtype))


class Cauchy(DispersionModel):
    """Cauchy's series, a lossless medium: eta = sum_j coefficients_j wavelength^powers_j.

    Arguments:
        coefficients: numbers, in um^-powers_j.
        powers: as many exponents; left out: 0, -2, -4, ..., which is A + B / l^2 + C / l^4 + ...

    Accuracy 2 eps of the sum of the terms' moduli.
    Source: Born and Wolf, Principles of Optics, 7th ed., sec. 2.3.4.
    """

    coefficients: Array = eqx.field(converter=parameters_named("coefficients"))
    powers: tuple[float, ...] = eqx.field(static=True, converter=as_powers, default=())

    def __check_init__(self):
        if self.powers and (len(self.powers),) != self.coefficients.shape:
            raise ValueError(
                f"{len(self.powers)} powers and coefficients of shape {self.coefficients.shape} "
                "came; wanted as many powers as coefficients"
            )

    def index(self, wavelength_um: Array) -> Index:
        eta = cauchy_series(wavelength_um, self.coefficients, self.powers)
        return Index(eta, jnp.zeros_like(eta))


class Sellmeier(DispersionModel):
    """Sellmeier's formula, a lossless medium:

    eta^2 = constant + sum_j strengths_j l^2 / (l^2 - poles_um2_j)
                     + sum_i coefficients_i l^powers_i,    l: wavelength in um.

    Arguments:
        strengths: numbers.
        poles_um2: as many squared resonance wavelengths in um^2; negative ones are allowed.
        constant: eta^2 far from all poles on their blue side; 1 in Sellmeier's own form.
        coefficients, powers: further terms that some authors add; left out: none.

    A term P / (l^2 - C) is strengths = P / C and -P / C in the constant.

    Accuracy 3 eps, next to a pole too: l^2 - C is taken from the exact square of l. Where eta^2 < 0
    (between a pole and the next zero) eta is 0 and k = sqrt(-eta^2): no wave enters. On a pole
    itself eta is inf and the derivatives are NaN; where eta^2 = 0 the derivative is infinite and 0
    is returned. No published range of validity holds such a point.
    Source: Born and Wolf, 7th ed., sec. 2.3.4; W. Sellmeier, Ann. Phys. 219, 272 (1871),
    doi:10.1002/andp.18712190612.
    """

    strengths: Array = eqx.field(converter=parameters_named("strengths"))
    poles_um2: Array = eqx.field(converter=parameters_named("poles_um2"))
    constant: Array = eqx.field(converter=float_named("constant"), default=1.0)
    coefficients: Array = eqx.field(converter=parameters_named("coefficients"), default=())
    powers: tuple[float, ...] = eqx.field(static=True, converter=as_powers, default=())

    def __check_init__(self):
        check_lengths(strengths=self.strengths, poles_um2=self.poles_um2)
        if (len(self.powers),) != self.coefficients.shape:
            raise ValueError(
                f"{len(self.powers)} powers and coefficients of shape {self.coefficients.shape} "
                "came; wanted as many powers as coefficients"
            )

    def index(self, wavelength_um: Array) -> Index:
        dtype = wavelength_um.dtype
        square, error = two_square(wavelength_um)
        # its derivative is 0: both squares have the derivative 2 l
        error = jax.lax.stop_gradient(error)
        square, strengths, poles = over_terms(square, self.strengths, self.poles_um2)
        terms = strengths * (square / ((square - poles) + error[..., None]))
        permittivity = self.constant.astype(dtype) + jnp.sum(terms, axis=-1)
        permittivity = permittivity + _power_series(wavelength_um, self.coefficients, self.powers)
        return Index(*real_sqrt(permittivity))


def cauchy_series(x: Array, coefficients: Array, powers: tuple[float, ...] = ()) -> Array:
    """sum_j coefficients_j x^powers_j; by default the powers are 0, -2, -4, ..."""
    return _power_series(
        x, coefficients, powers or tuple(-2.0 * j for j in range(len(coefficients)))
    )


def _power_series(x: Array, coefficients: Array, powers: tuple[float, ...]) -> Array:
    total = jnp.zeros_like(x)
    for j, power in enumerate(powers):
        # an integer power is a product, without the logarithm of a real one
        exponent = int(power) if power == int(power) else power
        total = total + coefficients[j].astype(x.dtype) * x**exponent
    return total
