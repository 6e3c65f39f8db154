"""Permittivities made of oscillators: Drude, Lorentz, Gauss, Brendel and Bormann, and sums."""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from .._numerics.arguments import float_named
from .._numerics.arithmetic import complex_sqrt, one_if_zero
from .._numerics.faddeeva import faddeeva
from .spectral import (
    DispersionModel,
    Index,
    SumOfLines,
    SumOfTerms,
    check_lengths,
    index_of_permittivity,
    over_terms,
    parameters_named,
    photon_energy_ev,
)


def _lorentz(energy: Array, strengths: Array, resonances: Array, widths: Array):
    """Real and imaginary part of sum_j S_j / (E_j^2 - E^2 - i E G_j), j along the last axis."""
    # factored: the error of E_j - E is then only that of E itself
    distance = (resonances - energy) * (resonances + energy)
    loss = energy * widths
    if energy.dtype == jnp.float32:
        # In units of the larger part: the derivative of a quotient squares its divisor, which
        # leaves the range of float32 for X-rays and for radio waves.
        unit = jax.lax.stop_gradient(one_if_zero(jnp.maximum(jnp.abs(distance), loss)))
        distance, loss, strengths = distance / unit, loss / unit, strengths / unit
    per_modulus = strengths / (distance * distance + loss * loss)
    return jnp.sum(distance * per_modulus, axis=-1), jnp.sum(loss * per_modulus, axis=-1)


class DrudeLorentz(SumOfLines):
    """Free and bound electrons as damped oscillators:

    (eta + ik)^2 = eps_inf + sum_j strengths_ev2_j / (resonances_ev_j^2 - E^2 - i E widths_ev_j),

    E the photon energy in eV. A resonance at 0 is a Drude term, and strength its squared plasma
    energy; `drude` and `lorentz_drude` build this from the parameters that papers print.

    Arguments:
        strengths_ev2: numbers >= 0, in eV^2.
        resonances_ev: as many energies >= 0 in eV.
        widths_ev: as many widths > 0 in eV.
        eps_inf: permittivity far above all resonances.

    The imaginary part of the permittivity is a sum of positive terms and the root does not cancel,
    so that k keeps its digits however small it is. Error 12 eps of eta and k (measured: 6); more
    only where the sum itself is that sensitive: next to a zero of Re eps, and eps E / width on a
    narrow resonance. Derivatives are finite everywhere. Obeys the Kramers-Kronig relations.
    Source: Born and Wolf, 7th ed., secs. 2.3.4 and 14.2; C. F. Bohren and D. R. Huffman, Absorption
    and Scattering of Light by Small Particles, secs. 9.1 and 9.4.
    """

    strengths_ev2: Array = eqx.field(converter=parameters_named("strengths_ev2"))
    resonances_ev: Array = eqx.field(converter=parameters_named("resonances_ev"))
    widths_ev: Array = eqx.field(converter=parameters_named("widths_ev"))
    eps_inf: Array = eqx.field(converter=float_named("eps_inf"), default=1.0)

    def susceptibility(self, energy: Array) -> tuple[Array, Array]:
        return _lorentz(*self.over_lines(energy))


class Gaussian(SumOfLines):
    """Absorption lines of Gaussian shape, as of glasses and organic films:

    Im eps = sum_j A_j {exp[-((E - E_j) / s_j)^2] - exp[-((E + E_j) / s_j)^2]},
    Re eps = eps_inf + sum_j (2 / sqrt(pi)) A_j [D((E + E_j) / s_j) - D((E - E_j) / s_j)],

    s_j = C_j / (2 sqrt(ln 2)), D Dawson's integral, eta + ik = sqrt(eps), E the photon energy, eV.

    Arguments:
        amplitudes: A_j >= 0, the largest Im eps of a line.
        resonances_ev: E_j > 0 in eV.
        widths_ev: C_j > 0, full widths at half maximum in eV.
        eps_inf: permittivity far above all lines.

    Obeys the Kramers-Kronig relations. Error of Re eps (100 + 4 E / C_j) eps of the largest of 1
    and the sum of the amplitudes: that of Faddeeva's function, and the rounding of E and E - E_j in
    widths. Of Im eps, with u = (E - E_j) / s_j, (8 + 4 u^2 + 16 abs(u) E / C_j) eps of itself.
    Derivatives are finite.
    Source: D. De Sousa Meneses, M. Malki and P. Echegut, J. Non-Cryst. Solids 352, 769 (2006);
    Dawson's integral: NIST Digital Library of Mathematical Functions, secs. 7.2 and 7.5.
    """

    amplitudes: Array = eqx.field(converter=parameters_named("amplitudes"))
    resonances_ev: Array = eqx.field(converter=parameters_named("resonances_ev"))
    widths_ev: Array = eqx.field(converter=parameters_named("widths_ev"))
    eps_inf: Array = eqx.field(converter=float_named("eps_inf"), default=1.0)

    def susceptibility(self, energy: Array) -> tuple[Array, Array]:
        energy, amplitudes, resonances, widths = self.over_lines(energy)
        per_s = np.asarray(2.0 * np.sqrt(np.log(2.0)), energy.dtype) / widths
        below, above = (energy - resonances) * per_s, (energy + resonances) * per_s
        # w(x) = exp(-x^2) + 2i D(x) / sqrt(pi); of the two exponentials the second is factored out,
        # since they cancel at low energy
        of_above, of_below = (faddeeva(x, jnp.zeros_like(x))[1] for x in (above, below))
        ratio = -jnp.expm1(-4.0 * (energy * per_s) * (resonances * per_s))
        re, im = amplitudes * (of_above - of_below), amplitudes * jnp.exp(-below * below) * ratio
        return jnp.sum(re, axis=-1), jnp.sum(im, axis=-1)


class Sum(SumOfTerms):
    """The permittivities of several models added: a Tauc-Lorentz edge and Gaussian lines, ...

    eta + ik = sqrt(eps_inf + sum_j (eps_j - eps_inf_j)): the `eps_inf` of the sum takes the place
    of those of its terms.

    Arguments:
        terms: of `DrudeLorentz` (a pole without loss: width 0), `Gaussian`, `TaucLorentz`,
            `CodyLorentz`, `Sum`.
        eps_inf: permittivity far above all resonances.

    Error: the sum of those of the terms. Obeys the Kramers-Kronig relations, as they do.
    """

    terms: tuple[SumOfTerms, ...] = eqx.field(converter=tuple)
    eps_inf: Array = eqx.field(converter=float_named("eps_inf"), default=1.0)

    def susceptibility(self, energy: Array) -> tuple[Array, Array]:
        re, im = zip(*(term.susceptibility(energy) for term in self.terms), strict=True)
        return jnp.sum(jnp.stack(re), axis=0), jnp.sum(jnp.stack(im), axis=0)


class BrendelBormann(DispersionModel):
    """A Drude term and oscillators whose resonances scatter with Gaussian deviations:

    (eta + ik)^2 = eps_inf - drude_strength_ev2 / (E (E + i drude_width_ev)) + sum_j chi_j,
    chi_j = i sqrt(pi / 8) S_j / (a_j d_j) [w((a_j - E_j) / (sqrt(2) d_j))
                                            + w((a_j + E_j) / (sqrt(2) d_j))],

    a_j = sqrt(E^2 + i E G_j), Im a_j > 0, w the Faddeeva function; S_j, E_j, G_j, d_j are
    `strengths_ev2`, `resonances_ev`, `widths_ev`, `deviations_ev` (> 0), E the photon energy in eV.

    Error 100 eps of eta and k, from Faddeeva's function (measured: 6). Closer to the metals of
    Rakic et al. than `DrudeLorentz`, at about ten times its cost; obeys the Kramers-Kronig
    relations only approximately.
    Source: R. Brendel and D. Bormann, J. Appl. Phys. 71, 1 (1992), doi:10.1063/1.350737; A. D.
    Rakic et al., Appl. Opt. 37, 5271 (1998), doi:10.1364/AO.37.005271.
    """

    drude_strength_ev2: Array = eqx.field(converter=float_named("drude_strength_ev2"))
    drude_width_ev: Array = eqx.field(converter=float_named("drude_width_ev"))
    strengths_ev2: Array = eqx.field(converter=parameters_named("strengths_ev2"))
    resonances_ev: Array = eqx.field(converter=parameters_named("resonances_ev"))
    widths_ev: Array = eqx.field(converter=parameters_named("widths_ev"))
    deviations_ev: Array = eqx.field(converter=parameters_named("deviations_ev"))
    eps_inf: Array = eqx.field(converter=float_named("eps_inf"), default=1.0)

    def __check_init__(self):
        check_lengths(
            strengths_ev2=self.strengths_ev2,
            resonances_ev=self.resonances_ev,
            widths_ev=self.widths_ev,
            deviations_ev=self.deviations_ev,
        )

    def index(self, wavelength_um: Array) -> Index:
        energy = photon_energy_ev(wavelength_um)
        electrons = self.drude_strength_ev2, jnp.zeros(()), self.drude_width_ev
        re, im = _lorentz(*over_terms(energy, *map(jnp.atleast_1d, electrons)))
        chi_re, chi_im = self._scattered(energy)
        return index_of_permittivity(self.eps_inf.astype(re.dtype) + re + chi_re, im + chi_im)

    def _scattered(self, energy: Array):
        fields = (self.strengths_ev2, self.resonances_ev, self.widths_ev, self.deviations_ev)
        energy, strengths, resonances, widths, deviations = over_terms(energy, *fields)
        dtype = energy.dtype
        a_re, a_im = complex_sqrt(energy * energy, energy * widths)
        per_width = 1.0 / (np.sqrt(2.0).astype(dtype) * deviations)
        below = faddeeva((a_re - resonances) * per_width, a_im * per_width)
        above = faddeeva((a_re + resonances) * per_width, a_im * per_width)
        w_re, w_im = below[0] + above[0], below[1] + above[1]
        # i w / a = i w conj(a) / |a|^2
        factor = (np.sqrt(np.pi / 8.0).astype(dtype) * strengths / deviations) / (
            a_re * a_re + a_im * a_im
        )
        re = factor * (w_re * a_im - w_im * a_re)
        im = factor * (w_re * a_re + w_im * a_im)
        return jnp.sum(re, axis=-1), jnp.sum(im, axis=-1)
