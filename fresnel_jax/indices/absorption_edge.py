"""Dispersion near an absorption edge: Cauchy with Urbach's tail, Tauc and Lorentz."""

from __future__ import annotations

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from .._numerics.arguments import float_named
from .formulas import cauchy_series
from .spectral import (
    DispersionModel,
    Index,
    check_lengths,
    index_of_permittivity,
    over_terms,
    parameters_named,
    photon_energy_ev,
)


class CauchyUrbach(DispersionModel):
    """Cauchy's series with the exponential tail of an absorption edge:

    eta = sum_j coefficients_j / wavelength^(2 j),    k = k_edge exp((E - edge_ev) / urbach_ev),

    E the photon energy in eV.

    Arguments:
        coefficients: numbers, in um^(2 j), j = 0, 1, ...
        k_edge: k at the energy `edge_ev`, >= 0.
        urbach_ev: Urbach's energy, > 0, over which k grows by e.
        edge_ev: the energy that k_edge is given at. It is a choice, not a third unknown: another
            one is the same tail with another k_edge.

    Error 2 eps of eta's terms, and of k (4 + 2 E / urbach_ev) eps. Does not obey the
    Kramers-Kronig relations. Source: F. Urbach, Phys. Rev. 92, 1324 (1953),
    doi:10.1103/PhysRev.92.1324.
    """

    coefficients: Array = eqx.field(converter=parameters_named("coefficients"))
    k_edge: Array = eqx.field(converter=float_named("k_edge"))
    urbach_ev: Array = eqx.field(converter=float_named("urbach_ev"))
    edge_ev: Array = eqx.field(converter=float_named("edge_ev"))

    def index(self, wavelength_um: Array) -> Index:
        dtype = wavelength_um.dtype
        k_edge, width, edge = (x.astype(dtype) for x in (self.k_edge, self.urbach_ev, self.edge_ev))
        eta = cauchy_series(wavelength_um, self.coefficients)
        return Index(eta, k_edge * jnp.exp((photon_energy_ev(wavelength_um) - edge) / width))


def _squared_times_log(x: Array) -> Array:
    """x^2 ln|x|, 0 with derivative 0 at x = 0."""
    zero = x == 0.0
    return jnp.where(zero, 0.0, x * x * jnp.log(jnp.abs(jnp.where(zero, 1.0, x))))


def _odd_series(square: Array, sign: float) -> Array:
    """sum_k (sign x^2)^k / (2 k + 1), x^2 <= 0.1: atanh(x) / x, or for sign -1 atan(x) / x."""
    total = jnp.zeros_like(square)
    for k in range(16, -1, -1):
        total = total * (sign * square) + 1.0 / (2 * k + 1)
    return total


def _tauc_lorentz(energy: Array, amplitude, resonance, width, gap):
    """Real and imaginary part of one oscillator's permittivity.

    With P(x) = (x^2 - E_0^2)^2 + (C x)^2 the imaginary part is A E_0 C (E - E_g)^2 / (E P(E)) above
    the gap, and the Kramers-Kronig integral of it, (2 / pi) A E_0 C times that of
    (x - E_g)^2 / (P(x) (x^2 - E^2)) from E_g to infinity, is a sum over the poles x_j of
    -residue_j log(E_g - x_j): those at +-E, and those of P at +-p and +-conj(p),
    p = (alpha + i C) / 2, alpha = sqrt(4 E_0^2 - C^2), where P'(p) = 2 i alpha C p. The residues
    add up to 0, so that all energies may be taken in units of E_0.

    The logarithms of E_g -+ p = (E_g -+ alpha / 2) -+ i C / 2 occur in their sums and, over alpha,
    in their differences alone, which have closed forms that keep their digits where alpha or C is
    small, and are even in alpha: the poles may meet.
    """
    e, c, g = energy / resonance, width / resonance, gap / resonance
    alpha2 = (2.0 - c) * (2.0 + c)
    alpha = jnp.sqrt(alpha2)
    distance, c2 = (e - 1.0) * (e + 1.0), c * c
    per_p = 1.0 / (distance * distance + (c * e) ** 2)  # 1 / P(E)
    above = jnp.maximum(e - g, 0.0)
    im = c * above * above * per_p / e

    beside = (g - 1.0) * (g + 1.0)
    # Far below the gap the two terms cancel: log((g + e) / (g - e)) / (2 e) is then a series.
    low = 10.0 * e * e < g * g
    g_low, e_low = jnp.where(low, g, 1.0), jnp.where(low, e, 0.0)
    high = (_squared_times_log(e + g) - _squared_times_log(e - g)) * (0.5 / e)
    ratio2 = (e_low / g_low) ** 2
    series = (1.0 + ratio2) * _odd_series(ratio2, 1.0)
    product = jnp.log((g_low - e_low) * (g_low + e_low))
    at_energy = per_p * jnp.where(low, g_low * (series + product), high)
    logs = 0.5 * jnp.log(beside * beside + (g * c) ** 2)
    angles = jnp.arctan2(g * c, beside)
    # The differences, log|E_g + p| - log|E_g - p| and the angles' with opposite sign, over alpha
    meeting = (alpha2 >= 0.0) & (alpha2 < 0.1)  # NaN for a width beyond 2 E_0
    near = jnp.where(meeting, alpha2, 0.0)
    far = jnp.where(meeting, 1.0, alpha)
    turned, larger = 0.5 * c2 + beside, 1.0 + g * g
    smaller = (1.0 - g) ** 2 + g * c2 / (2.0 + far)  # 1 + g^2 - g alpha
    log_difference = jnp.where(
        meeting,
        g / larger * _odd_series(near * (g / larger) ** 2, 1.0),
        0.5 * jnp.log1p(2.0 * g * far / smaller) / far,
    )
    near_turned = jnp.where(meeting, turned, 1.0)
    angle_difference = jnp.where(
        meeting,
        0.5 * c / near_turned * _odd_series(near * (0.5 * c / near_turned) ** 2, -1.0),
        jnp.arctan2(0.5 * c * far, turned) / far,
    )
    middle = larger - 0.5 * c2
    top_re = g * logs + middle * log_difference - c * (0.5 * angles - g * angle_difference)
    top_im = middle * angles - g * alpha2 * angle_difference
    top_im = top_im + c * (g * logs + 0.5 * alpha2 * log_difference)
    at_poles = 0.5 * per_p * (top_im * (distance + c2) + c * top_re * (2.0 - c2 - distance))
    # E_0 C, (x - E_g)^2 dx / (P (x^2 - E^2)) in units of E_0: what is left is A / E_0.
    scale = amplitude / resonance
    return (2.0 / jnp.pi) * scale * (c * at_energy - at_poles), scale * im


class TaucLorentz(DispersionModel):
    """Oscillators of an amorphous semiconductor or insulator, without absorption below a gap:

    Im eps = sum_j A_j E_j C_j (E - gap)^2 / {E [(E^2 - E_j^2)^2 + (C_j E)^2]} if E > gap, else 0;
    Re eps = eps_inf + its Kramers-Kronig integral, in closed form;  eta + ik = sqrt(eps).

    Arguments:
        amplitudes_ev: A_j >= 0 in eV.
        resonances_ev: E_j > 0 in eV.
        widths_ev: 0 < C_j < 2 E_j in eV (NaN beyond).
        gap_ev: the gap in eV, >= 0, one for all.
        eps_inf: permittivity far above all resonances.

    Accuracy: each part of the permittivity within 64 eps of max(1, abs(permittivity)), its gradient
    within 1000 eps of the larger of that and its norm, for a gap below the resonance, however
    narrow or wide. For a gap above it, where the oscillator has no peak, digits are lost at photon
    energies beside the resonance: 4e5 eps of the gradient for a width of a hundredth of it. k is
    exactly 0 below the gap while Re eps > 0.
    First derivatives are finite everywhere, the second is infinite at the gap.
    Source: G. E. Jellison and F. A. Modine, Appl. Phys. Lett. 69, 371 (1996), doi:10.1063/1.118064,
    erratum 69, 2137, doi:10.1063/1.118155, whose closed form is another one of the same integral.
    """

    amplitudes_ev: Array = eqx.field(converter=parameters_named("amplitudes_ev"))
    resonances_ev: Array = eqx.field(converter=parameters_named("resonances_ev"))
    widths_ev: Array = eqx.field(converter=parameters_named("widths_ev"))
    gap_ev: Array = eqx.field(converter=float_named("gap_ev"))
    eps_inf: Array = eqx.field(converter=float_named("eps_inf"), default=1.0)

    def __check_init__(self):
        check_lengths(
            amplitudes_ev=self.amplitudes_ev,
            resonances_ev=self.resonances_ev,
            widths_ev=self.widths_ev,
        )

    def index(self, wavelength_um: Array) -> Index:
        dtype = wavelength_um.dtype
        fields = (self.amplitudes_ev, self.resonances_ev, self.widths_ev)
        energy, amplitudes, resonances, widths = over_terms(
            photon_energy_ev(wavelength_um), *fields
        )
        gap = self.gap_ev.astype(dtype)
        re, im = _tauc_lorentz(energy, amplitudes, resonances, widths, gap)
        return index_of_permittivity(
            self.eps_inf.astype(dtype) + jnp.sum(re, axis=-1), jnp.sum(im, axis=-1)
        )
