"""What every dispersion model shares: its call, its range of wavelengths, its numbers' type."""

from __future__ import annotations

import abc
import dataclasses
import functools
from collections.abc import Iterable, Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, ArrayLike

from .._numerics.arguments import as_float, check_positive, real
from .._numerics.arithmetic import complex_sqrt
from .._numerics.index import Index
from .._numerics.transposable import transposable

# h c / e in eV um; exact by the definition of the SI units
HC_EV_UM = 1.2398419843320025

# A range that its source gives in nm, eV or 1/cm ends a rounding error or two beside the wavelength
# in um that someone else computes from it, or rounds to float32.
_SLACK_IN_EPS = 4


class DispersionModel(eqx.Module):
    """An index as a function of the vacuum wavelength; see the module `dispersion`."""

    @abc.abstractmethod
    def index(self, wavelength_um: Array) -> Index:
        """The index at floating-point wavelengths, in their type and without any check."""

    def __call__(self, wavelength_um: ArrayLike) -> Index:
        """`Index(eta, k)` at vacuum wavelengths in micrometres; see the module `dispersion`."""
        return _evaluate(self, in_one_type(wavelength_um, self))


class SumOfTerms(DispersionModel):
    """A permittivity `eps_inf` + susceptibility, eta + ik its square root."""

    @abc.abstractmethod
    def susceptibility(self, energy: Array) -> tuple[Array, Array]:
        """Real and imaginary part of the sum of all terms at photon energies in eV."""

    def index(self, wavelength_um: Array) -> Index:
        re, im = self.susceptibility(photon_energy_ev(wavelength_um))
        eps_inf: Array = self.eps_inf  # pyright: ignore[reportAttributeAccessIssue]
        return index_of_permittivity(eps_inf.astype(re.dtype) + re, im)


class SumOfLines(SumOfTerms):
    """The same of absorption lines: the first three fields are their strengths, places, widths."""

    def __check_init__(self):
        check_lengths(**{f.name: getattr(self, f.name) for f in dataclasses.fields(self)[:3]})

    def over_lines(self, energy: Array) -> tuple[Array, ...]:
        """Photon energies with a last axis for the lines, and these fields; see `over_terms`."""
        return over_terms(energy, *(getattr(self, f.name) for f in dataclasses.fields(self)[:3]))


def in_one_type(wavelength_um: ArrayLike, model) -> Array:
    """Wavelengths in their own floating-point type; Python numbers in that of the model.

    ValueError for a readable one that is not a finite number above 0.
    """
    wavelength_um = real(wavelength_um, "wavelength_um")
    check_positive(wavelength_um, "wavelength_um")
    dtype = getattr(wavelength_um, "dtype", None)
    if dtype is not None and jnp.issubdtype(dtype, jnp.floating):
        # No dtype is named: where float64 is off, NumPy's arrays become float32 without a warning.
        return jnp.asarray(wavelength_um)
    return jnp.asarray(wavelength_um, jnp.result_type(*jax.tree.leaves(model), 1.0))


def evaluate_within(
    model: DispersionModel, wavelength: Array, low: ArrayLike, high: ArrayLike, name: str
) -> Index:
    """The index inside of low to high; outside a ValueError, or NaN if anything is traced."""
    slack = _SLACK_IN_EPS * float(np.finfo(wavelength.dtype).eps)
    low_limit, high_limit = low * (1.0 - slack), high * (1.0 + slack)
    if not any(isinstance(x, Tracer) for x in (wavelength, low, high)):
        values = np.asarray(wavelength)
        outside = ~((values >= low_limit) & (values <= high_limit))
        if outside.any():
            raise ValueError(_refusal(float(values[outside].flat[0]), low, high, name))
    return _evaluate_within(model, wavelength, low_limit, high_limit)


def _refusal(wavelength: float, low, high, name: str) -> str:
    text = (
        f"{name} is known from {low:g} to {high:g} um, but a wavelength of {wavelength:.6g} um "
        "came; leave out what lies outside."
    )
    if low <= wavelength / 1000.0 <= high:
        text += f" Wavelengths are in micrometres: {wavelength:g} nm is {wavelength / 1000.0:g}."
    return text


@jax.jit
def _evaluate(model: DispersionModel, wavelength: Array) -> Index:
    return Index(*(jnp.broadcast_to(x, wavelength.shape) for x in model.index(wavelength)))


@jax.jit
def _evaluate_within(model: DispersionModel, wavelength: Array, low, high) -> Index:
    low, high = (jnp.asarray(x, wavelength.dtype) for x in (low, high))
    inside = (wavelength >= low) & (wavelength <= high)
    # A pole outside must not put a NaN into the derivatives inside
    eta, k = _evaluate(model, jnp.where(inside, wavelength, low))
    unknown = transposable(_nan_outside, _nan_outside, inside, wavelength)
    return Index(jnp.where(inside, eta, jnp.nan) + unknown, jnp.where(inside, k, jnp.nan) + unknown)


def _nan_outside(inside: Array, x: Array) -> Array:
    """0, and NaN outside unless x is 0: also the derivative is unknown there.

    As a linear function of x with itself as its transpose it leaves the derivative of what is not
    asked for alone: NaN times a cotangent of 0 would be NaN.
    """
    return jnp.where(inside | (x == 0.0), 0.0, jnp.nan).astype(x.dtype)


def over_terms(x: Array, *parameters: Array) -> tuple[Array, ...]:
    """x with a last axis for the terms of a sum, and the terms in its type and rank."""
    leading = (1,) * x.ndim
    return x[..., None], *(p.astype(x.dtype).reshape(leading + p.shape) for p in parameters)


def index_of_permittivity(re: Array, im: Array) -> Index:
    """The index eta + ik = sqrt(re + i im), for im >= 0, each part without cancellation."""
    return Index(*complex_sqrt(re, im))


def photon_energy_ev(wavelength_um: Array) -> Array:
    """Photon energy in electronvolts."""
    return HC_EV_UM / wavelength_um


def parameters(x: ArrayLike | Sequence[float], name: str) -> Array:
    """x as a one-dimensional array of floats."""
    return jnp.atleast_1d(as_float(x, name))


def parameters_named(name: str):
    """`parameters` as the converter of the field of that name."""
    return functools.partial(parameters, name=name)


def as_powers(x: Iterable[float]) -> tuple[float, ...]:
    """x as a tuple of exponents: a converter for fields."""
    return tuple(float(power) for power in x)


def check_lengths(**arrays: Array):
    """ValueError, with the names, unless all arrays have one axis of one length."""
    if len({x.shape for x in arrays.values()}) > 1 or any(x.ndim != 1 for x in arrays.values()):
        shapes = ", ".join(f"{name} {x.shape}" for name, x in arrays.items())
        raise ValueError(f"the shapes are {shapes}; wanted one axis of one length for all of them")
