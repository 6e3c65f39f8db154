"""A permittivity without a formula: absorption as a spline, refraction by Kramers and Kronig.

On each interval between two knots the cubic spline is a sum of Legendre polynomials P_n(u) of
u = (x - middle) / half, and its share of the principal value of the integral of f(x) / (x - E) is

    sum_n a_n P int P_n(u) / (u - z) du = -2 sum_n a_n Q_n(z),    z = (E - middle) / half,

with Legendre's functions of the second kind, Q_0 = ln|(1 + z) / (1 - z)| / 2 and so on: a closed
form for every interval. Where z is large the terms of Q_n cancel, and Gauss and Legendre's rule,
exact to rounding there, stands in its place.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from .._numerics.arguments import float_named
from .spectral import (
    DispersionModel,
    Index,
    as_powers,
    check_lengths,
    index_of_permittivity,
    over_terms,
    parameters_named,
    photon_energy_ev,
)

DEGREE = 3
# Beyond |z| = 2 the rule of 16 nodes has an error of 3.7^-32; below, Q_3 loses a factor of 10.
_FAR = 2.0
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)
# (16, 4): weight times P_n at the nodes
_RULE = np.polynomial.legendre.legvander(_NODES, DEGREE) * _WEIGHTS[:, None]
_FEW_NODES, _FEW_WEIGHTS = np.polynomial.legendre.leggauss(DEGREE + 1)
# (4, 4): Legendre coefficients of a cubic from its values at four nodes
_PROJECTION = (
    np.polynomial.legendre.legvander(_FEW_NODES, DEGREE)
    * _FEW_WEIGHTS[:, None]
    * (np.arange(DEGREE + 1) + 0.5)
)


def b_splines(x: Array, knots: np.ndarray) -> Array:
    """All cubic B-splines on the knots at x, (..., len(knots) - 4); sums of positive terms."""
    x, at = over_terms(x, jnp.asarray(knots, x.dtype))
    basis = ((x >= at[..., :-1]) & (x < at[..., 1:])).astype(x.dtype)
    for degree in range(1, DEGREE + 1):
        width = at[..., degree:] - at[..., :-degree]
        rising = (x - at[..., : -degree - 1]) / width[..., :-1] * basis[..., :-1]
        falling = (at[..., degree + 1 :] - x) / width[..., 1:] * basis[..., 1:]
        basis = rising + falling
    return basis


def _legendre_table(knots: np.ndarray) -> np.ndarray:
    """(intervals, 4, splines): Legendre coefficients of every spline on every interval."""
    half = 0.5 * np.diff(knots)
    x = knots[:-1, None] + half[:, None] * (1.0 + _FEW_NODES)
    with jax.ensure_compile_time_eval(), jax.enable_x64(True):
        values = np.asarray(b_splines(jnp.asarray(x), knots))
    return np.einsum("in,kij->knj", _PROJECTION, values)


def _log_or_zero(x: Array) -> Array:
    """ln|x|, and 0 at 0: what it is multiplied by there is 0 in the sum over both intervals."""
    zero = x == 0.0
    return jnp.where(zero, 0.0, jnp.log(jnp.abs(jnp.where(zero, 1.0, x))))


def _second_kind(energy: Array, knots: Array) -> Array:
    """-2 Q_n(z) for every interval, (..., intervals, 4)."""
    energy, knots = over_terms(energy, knots)
    left, right = knots[..., :-1], knots[..., 1:]
    half = 0.5 * (right - left)
    z = ((energy - left) + (energy - right)) / (2.0 * half)
    far = jnp.abs(z) > _FAR
    # The logarithms of distances in eV, not in half intervals: neighbours then share those of their
    # knot, and what is infinite at the knot cancels.
    logs = _log_or_zero(energy - knots)
    q_0 = 0.5 * (logs[..., :-1] - logs[..., 1:])
    near = jnp.where(far, 0.0, z)
    square = near * near
    closed = [
        q_0,
        near * q_0 - 1.0,
        (1.5 * square - 0.5) * q_0 - 1.5 * near,
        near * (2.5 * square - 1.5) * q_0 - (2.5 * square - 2.0 / 3.0),
    ]
    away, nodes = over_terms(jnp.where(far, z, 2.0 * _FAR), jnp.asarray(_NODES, z.dtype))
    rule = 1.0 / (nodes - away) @ jnp.asarray(_RULE, z.dtype)
    return jnp.where(far[..., None], rule, -2.0 * jnp.stack(closed, axis=-1))


def _slope(coefficients: Array, knots: Array) -> Array:
    """Legendre coefficients of the derivative of the spline."""
    half = (0.5 * jnp.diff(knots))[:, None]
    _, a_1, a_2, a_3 = jnp.moveaxis(coefficients, -1, 0)
    return jnp.stack([a_1 + a_3, 3.0 * a_2, 5.0 * a_3, jnp.zeros_like(a_3)], axis=-1) / half


def _transformed(energy: Array, coefficients: Array, knots: Array) -> Array:
    _, of_terms = over_terms(energy, coefficients)
    return jnp.sum(_second_kind(energy, knots) * of_terms, axis=(-2, -1))


@jax.custom_jvp
def _principal_value(energy: Array, coefficients: Array, knots: Array) -> Array:
    """P int f(x) / (x - E) dx of the spline with these Legendre coefficients, (intervals, 4)."""
    return _transformed(energy, coefficients, knots)


@_principal_value.defjvp
def _principal_value_jvp(primals, tangents):
    # The transform of the derivative is the derivative of the transform, since the spline is 0 at
    # its ends; the derivative of the formula would be a difference of infinite terms at a knot.
    energy, coefficients, knots = primals
    d_energy, d_coefficients, _ = tangents
    by_energy = _principal_value(energy, _slope(coefficients, knots), knots)
    by_coefficients = _transformed(energy, d_coefficients, knots)
    return _principal_value(*primals), by_energy * d_energy + by_coefficients


class KramersKronigSpline(DispersionModel):
    """A free-form permittivity that obeys the Kramers-Kronig relations by construction:

    Im eps = sum_j amplitudes_j B_j(E),
    Re eps = eps_inf + (2 / pi) P int x Im eps(x) / (x^2 - E^2) dx
                     + sum_i pole_strengths_ev2_i / (poles_ev_i^2 - E^2),    eta + ik = sqrt(eps),

    B_j the cubic B-spline on knots j to j + 4, E the photon energy in eV. The integral is a closed
    form. Absorption that lies outside of the knots enters by the poles (one at 0 eV for free
    electrons or lattice vibrations, one above the knots) and by eps_inf; Im eps and its first two
    derivatives are 0 at the first and the last knot and beyond.

    Arguments:
        amplitudes: numbers >= 0, four fewer than knots.
        knots_ev: photon energies >= 0 in eV, ascending, at least five; where the absorption has
            details they lie close. They are structure, not parameters, and have no derivatives.
        eps_inf: permittivity far above all absorption.
        pole_strengths_ev2, poles_ev: numbers, and as many energies outside of the measured range.

    Accuracy: each part of the permittivity within 200 eps of the larger of 1 and the largest
    amplitude, at the knots too; k to its own digits (8 eps) where Re eps > 0. First and second
    derivatives are finite (the third is infinite at a knot).
    Source: B. Johs and J. S. Hale, Phys. Status Solidi A 205, 715 (2008),
    doi:10.1002/pssa.200777754; Legendre's functions: NIST Digital Library of Mathematical
    Functions, secs. 14.7 and 14.12.

    Raises:
        ValueError: knots do not ascend, or the numbers of knots and amplitudes do not agree.
    """

    amplitudes: Array = eqx.field(converter=parameters_named("amplitudes"))
    knots_ev: tuple[float, ...] = eqx.field(static=True, converter=as_powers)
    eps_inf: Array = eqx.field(converter=float_named("eps_inf"), default=1.0)
    pole_strengths_ev2: Array = eqx.field(
        converter=parameters_named("pole_strengths_ev2"), default=()
    )
    poles_ev: Array = eqx.field(converter=parameters_named("poles_ev"), default=())

    def __check_init__(self):
        knots = np.array(self.knots_ev)
        if len(knots) < DEGREE + 2 or knots[0] < 0.0 or not (np.diff(knots) > 0.0).all():
            raise ValueError(
                f"knots_ev is {self.knots_ev}; wanted five or more photon energies >= 0 in eV, "
                "each above the one before"
            )
        wanted = len(knots) - DEGREE - 1
        if self.amplitudes.shape != (wanted,):
            raise ValueError(
                f"{len(knots)} knots and amplitudes of shape {self.amplitudes.shape} came; wanted "
                f"{wanted} amplitudes, four fewer than knots"
            )
        check_lengths(pole_strengths_ev2=self.pole_strengths_ev2, poles_ev=self.poles_ev)

    def index(self, wavelength_um: Array) -> Index:
        energy = photon_energy_ev(wavelength_um)
        dtype = energy.dtype
        knots = np.array(self.knots_ev)
        amplitudes = self.amplitudes.astype(dtype)
        im = b_splines(energy, knots) @ amplitudes
        table = jnp.asarray(_legendre_table(knots), dtype)
        coefficients, at = table @ amplitudes, jnp.asarray(knots, dtype)
        re = _principal_value(energy, coefficients, at) + _principal_value(
            -energy, coefficients, at
        )
        at_terms, strengths, poles = over_terms(energy, self.pole_strengths_ev2, self.poles_ev)
        tails = jnp.sum(strengths / ((poles - at_terms) * (poles + at_terms)), axis=-1)
        return index_of_permittivity(self.eps_inf.astype(dtype) + re / jnp.pi + tails, im)
