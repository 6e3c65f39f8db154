"""Dispersion near an absorption edge: Cauchy and Urbach, Tauc and Lorentz, Cody and Lorentz."""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from .._numerics.arguments import float_named
from .formulas import cauchy_series
from .spectral import (
    DispersionModel,
    Index,
    SumOfLines,
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


def _less_its_limit(u: Array) -> Array:
    """F(u E_g^2) / E_g - 1 - 2 log E_g, F as in `_tauc_lorentz`, for abs(u) <= 0.1.

    It is log(1 + u) - 1 + (1 - u) arctan(sqrt(u)) / sqrt(u), whose two numbers near 1 cancel.
    """
    total = jnp.zeros_like(u)
    for k in range(16, -1, -1):
        total = 1.0 / (2 * k + 1) + 1.0 / (2 * k + 3) - u * total
    return jnp.log1p(u) - u * total


def _differences(c: Array, g: Array) -> tuple[Array, Array]:
    """log|E_g + p| - log|E_g - p|, and the angle of E_g - p and E_g + p together, over alpha.

    p = (alpha + i C) / 2 and alpha = sqrt(4 - C^2), in units of E_0. Both quotients are even in
    alpha. Where C > 2 it is imaginary, and the logarithm is an angle, the angle a logarithm.
    """
    alpha2, c2 = (2.0 - c) * (2.0 + c), c * c
    meeting, wide = jnp.abs(alpha2) < 0.1, alpha2 < 0.0
    near = jnp.where(meeting, alpha2, 0.0)
    far = jnp.sqrt(jnp.where(meeting, 1.0, jnp.abs(alpha2)))
    turned, larger = 0.5 * c2 + (g - 1.0) * (g + 1.0), 1.0 + g * g
    half = 0.5 * c * far
    by_larger, by_turned = g / larger, 0.5 * c / jnp.where(meeting, turned, 1.0)
    # 1 + g^2 - g alpha, and (turned - half) (turned + half) where alpha is imaginary
    smaller = (1.0 - g) ** 2 + g * c2 / (2.0 + far)
    product = jnp.where(wide, 1.0 + g * g * (c2 - 2.0 + g * g), 1.0)
    log_difference = jnp.where(
        wide, jnp.arctan2(g * far, larger), 0.5 * jnp.log1p(2.0 * g * far / smaller)
    )
    angle_difference = jnp.where(
        wide, 0.5 * jnp.log1p(2.0 * half * (turned + half) / product), jnp.arctan2(half, turned)
    )
    return (
        jnp.where(meeting, by_larger * _odd_series(near * by_larger**2, 1.0), log_difference / far),
        jnp.where(
            meeting, by_turned * _odd_series(near * by_turned**2, -1.0), angle_difference / far
        ),
    )


def _tauc_lorentz(energy: Array, amplitude, resonance, width, gap):
    """Real and imaginary part of one oscillator's permittivity.

    With P(x) = (x^2 - E_0^2)^2 + (C x)^2 = (x^2 + a) (x^2 + b) the imaginary part is
    A E_0 C (E - E_g)^2 / (E P(E)) above the gap, and the Kramers-Kronig integral of it, (2 / pi) A
    E_0 C times that of (x - E_g)^2 / (P(x) (x^2 - E^2)) from E_g to infinity, is the second divided
    difference at -E^2, a and b of

        F(s) = (E_g^2 - s) arctan(sqrt(s) / E_g) / sqrt(s) + E_g log(E_g^2 + s):

    F(-E^2) less the straight line through F(a) and F(b), over P(E). All is in units of E_0. The
    square roots of a and b are (C -+ sqrt(C^2 - 4)) / 2, complex for C < 2, where the oscillator is
    a resonance, and real above. The line has closed forms in what is even in alpha = sqrt(4 - C^2).
    """
    e, c, g = energy / resonance, width / resonance, gap / resonance
    # Differences first: the error of E - E_0 is then only that of E itself.
    distance = (energy - resonance) / resonance * (e + 1.0)
    over_gap, below_resonance = (energy - gap) / resonance, (resonance - gap) / resonance
    per_p = 1.0 / (distance * distance + (c * e) ** 2)  # 1 / P(E)
    above = jnp.maximum(over_gap, 0.0)
    im = c * above * above * per_p / e

    # Far below the gap the two terms of F(-E^2) cancel.
    low = 10.0 * e * e < g * g
    g_low = jnp.where(low, g, 1.0)
    of_limit = g_low * (1.0 + 2.0 * jnp.log(g_low))
    below = g_low * _less_its_limit(-((jnp.where(low, e, 0.0) / g_low) ** 2))
    high = (_squared_times_log(e + g) - _squared_times_log(over_gap)) * (0.5 / e)
    at_energy = jnp.where(low, below + of_limit, high)

    beside, larger = -below_resonance * (g + 1.0), 1.0 + g * g
    logs = 0.5 * jnp.log(beside * beside + (g * c) ** 2)
    angles = jnp.arctan2(g * c, beside)
    log_difference, angle_difference = _differences(c, g)
    # The line: its slope times C, and a point of it, half way between a and b at C < 3. For a large
    # C, where a is about 1 / C^2 and b about C^2, what is left would be a small difference of large
    # numbers, and the point is (a, F(a)).
    # In the slope the angles of a narrow resonance, nearly pi each, leave (1 - E_g)^2 of their sum.
    narrow = (c < 1.0) & (g < 1.0)
    alpha2 = jnp.where(narrow, (2.0 - c) * (2.0 + c), 1.0)
    alpha = jnp.sqrt(alpha2)
    from_pi = jnp.arctan2(g * c, -beside) - jnp.arctan2(0.5 * c * alpha, -0.5 * c * c - beside) * (
        2.0 / alpha
    )
    turn = jnp.where(
        narrow,
        jnp.pi * (c * c) / (2.0 * alpha + alpha2) + from_pi,
        2.0 * angle_difference - angles,
    )
    slope = 0.5 * (beside * c * log_difference - below_resonance**2 * angles) + g * turn
    half_way = (
        0.5 * (g * g * c) * angles
        + (larger - 0.5 * (g * c) ** 2) * log_difference
        + g * (logs - c * angle_difference)
    )
    large = c > 3.0
    c_large = jnp.where(large, c, 3.0)
    root = 2.0 / (c_large + jnp.sqrt((c_large - 2.0) * (c_large + 2.0)))
    a = root * root
    both_low = low & (10.0 * a < g * g)
    u = jnp.where(both_low, a, 0.0) / (g_low * g_low)
    at_a = (g * g - a) * jnp.arctan2(root, g) / root + g * jnp.log(g * g + a)
    from_a = jnp.where(both_low, below - g_low * _less_its_limit(u), at_energy - at_a)
    difference = jnp.where(large, from_a, at_energy - half_way)
    arm = jnp.where(large, e * e + a, distance)
    # E_0 C, (x - E_g)^2 dx / (P (x^2 - E^2)) in units of E_0: what is left is A / E_0.
    scale = amplitude / resonance
    return (2.0 / jnp.pi) * scale * per_p * (c * difference + slope * arm), scale * im


class TaucLorentz(SumOfLines):
    """Oscillators of an amorphous semiconductor or insulator, without absorption below a gap:

    Im eps = sum_j A_j E_j C_j (E - gap)^2 / {E [(E^2 - E_j^2)^2 + (C_j E)^2]} if E > gap, else 0;
    Re eps = eps_inf + its Kramers-Kronig integral, in closed form;  eta + ik = sqrt(eps).

    Arguments:
        amplitudes_ev: A_j >= 0 in eV.
        resonances_ev: E_j > 0 in eV.
        widths_ev: C_j > 0 in eV. Beyond C_j = 2 E_j the oscillator is overdamped: the imaginary
            part is the same formula, and that of the real part goes on analytically.
        gap_ev: the gap in eV, >= 0, one for all.
        eps_inf: permittivity far above all resonances.

    Accuracy, for a gap below the resonance and any width: each part of the permittivity within 64
    eps, and its gradient (in relative changes of the arguments) within 1000 eps, of the largest of
    1, the permittivity, the norm of that gradient, and what a relative change of one eps in each
    argument does to the true one. The last is a bound of the conditioning, not of the value: the
    photon energy itself is rounded, which at A = 40, E_0 = 3, C = 1e-3, gap 2 and 3.000003 eV moves
    the permittivity by 445 eps of itself (float32: 2,280). For a gap above the resonance, where the
    oscillator has no peak, no bound is stated: there 4e5 eps of the gradient were lost for a width
    of a hundredth of it, at photon energies beside the resonance. k is exactly 0 below the gap
    while Re eps > 0.
    First derivatives are finite everywhere, the second is infinite at the gap.
    Source: G. E. Jellison and F. A. Modine, Appl. Phys. Lett. 69, 371 (1996), doi:10.1063/1.118064,
    erratum 69, 2137, doi:10.1063/1.118155, whose closed form is another one of the same integral.
    """

    amplitudes_ev: Array = eqx.field(converter=parameters_named("amplitudes_ev"))
    resonances_ev: Array = eqx.field(converter=parameters_named("resonances_ev"))
    widths_ev: Array = eqx.field(converter=parameters_named("widths_ev"))
    gap_ev: Array = eqx.field(converter=float_named("gap_ev"))
    eps_inf: Array = eqx.field(converter=float_named("eps_inf"), default=1.0)

    def susceptibility(self, energy: Array) -> tuple[Array, Array]:
        energy, amplitudes, resonances, widths = self.over_lines(energy)
        gap = self.gap_ev.astype(energy.dtype)
        re, im = _tauc_lorentz(energy, amplitudes, resonances, widths, gap)
        return jnp.sum(re, axis=-1), jnp.sum(im, axis=-1)


_EI_TERMS = 110


@jax.custom_jvp
def _scaled_ei(x: Array) -> Array:
    """exp(-x) Ei(x) for x of either sign, within 16 eps of the larger of its value and 0.1.

    Below -1 by the continued fraction, up to 40 by the power series, whose terms are positive for
    x > 0, and above by the asymptotic series, whose 36th term is below eps there: so many steps of
    each that the largest is enough. (Without the factor, Ei overflows in float32 beyond 90.)
    """
    left, far = x < -1.0, x > 40.0
    series_x, fraction_x = jnp.where(left | far, 1.0, x), jnp.where(left, -x, 1.0)
    per_x = 1.0 / jnp.where(far, x, 40.0)

    def step(i, sums):
        k = jnp.asarray(_EI_TERMS - i, x.dtype)
        series, fraction, asymptotic = sums
        series = 1.0 + series * series_x * k / (k + 1.0) ** 2
        fraction = fraction_x + 2.0 * k - 1.0 - k * k / fraction
        return series, fraction, jnp.where(k > 36.0, 1.0, 1.0 + k * per_x * asymptotic)

    first = jnp.ones_like(x), fraction_x + 2.0 * _EI_TERMS + 1.0, jnp.ones_like(x)
    series, fraction, asymptotic = jax.lax.fori_loop(0, _EI_TERMS, step, first)
    near = jnp.euler_gamma + jnp.log(jnp.abs(series_x)) + series_x * series
    return jnp.where(
        left, -1.0 / fraction, jnp.where(far, per_x * asymptotic, jnp.exp(-series_x) * near)
    )


@_scaled_ei.defjvp
def _scaled_ei_jvp(primals, tangents):
    (x,), (dx,) = primals, tangents
    value = _scaled_ei(x)
    return value, (1.0 / x - value) * dx


def _cody_lorentz(energy: Array, distance: Array, amplitude, resonance, width, gap, cody, tail):
    """(2 / pi) P int x G(x) L(x) / (x^2 - E^2) dx from E_t to infinity, of one oscillator.

    The integrand is rational: the integral is the sum of - residue log(E_t - pole) over its poles.
    They are -E and E, E_g + i E_p, the zeros z of Q(z) = z^2 - i C z - E_0^2, and the conjugates.
    The two zeros meet at C = 2 E_0, so that their residues alone are of no use. What is needed of
    them is a divided difference, which is b if a function at the zeros is a + b (z - i C / 2): such
    pairs (a, b) multiply by (z - i C / 2)^2 = E_0^2 - C^2 / 4. All is in units of E_0.
    """
    e, c, g, w, t = (x / resonance for x in (energy, width, gap, cody, tail))
    beside = (energy - resonance) / resonance * (e + 1.0)
    per_p = 1.0 / (beside * beside + (c * e) ** 2)
    above, below = ((x * x / (x * x + w * w)) for x in ((energy - gap) / resonance, e + g))
    at_energy = c * e * per_p * (
        above * jnp.log(jnp.abs(distance) / resonance) - below * jnp.log(t + e)
    )  # fmt: skip
    # of the conjugate, so that its imaginary part 0 at E_t = 0 has the right side of the branch cut
    mean_log = 0.5 * jnp.conj(jnp.log(jax.lax.complex(t * t - 1.0, c * t)))
    pole = jax.lax.complex(*jnp.broadcast_arrays(g, w))
    below_pole = jax.lax.complex(*jnp.broadcast_arrays((gap - energy) / resonance, w))
    log_pole = jnp.log(jax.lax.complex(*jnp.broadcast_arrays((tail - gap) / resonance, -w)))
    middle, half_square = jax.lax.complex(jnp.zeros_like(c), 0.5 * c), (1 - 0.5 * c) * (1 + 0.5 * c)
    e, c, g, w, t, beside, per_p, half_square = (
        jax.lax.complex(x, jnp.zeros_like(x)) for x in (e, c, g, w, t, beside, per_p, half_square)
    )

    def product(x, y):
        return x[0] * y[0] + x[1] * y[1] * half_square, x[0] * y[1] + x[1] * y[0]

    of_pole, of_conjugate = (z * z - 2.0 * middle * z - 1.0 for z in (pole, jnp.conj(pole)))
    share = w * w / (of_pole * of_conjugate)
    per_distance = -middle * (1.0 + e * e) * per_p, -beside * per_p  # z / (z^2 - E^2)
    sides = 1.0 + g * g + w * w - 0.5 * c * c - 2.0 * middle * g
    onset = 1.0 - share * sides, share * (2.0 * middle - 2.0 * g)  # G(z)
    from_middle = t - middle
    ratio = half_square / (from_middle * from_middle)
    meeting = jnp.abs(ratio) < 0.1
    half = jnp.sqrt(jnp.where(meeting, 1.0, half_square))
    apart = (jnp.log(from_middle - half) - jnp.log(from_middle + half)) / (2.0 * half)
    together = -_odd_series(jnp.where(meeting, ratio, 0.0), 1.0) / from_middle
    logs = mean_log, jnp.where(meeting, together, apart)
    # The factor 1 / 2i of the residues at the zeros, and i / 2 at E_g + i E_p, leave what is imag.
    at_zeros = jnp.imag(product(product(per_distance, onset), logs)[1])
    square = (pole + e) * below_pole
    residue = c * w * pole * pole * log_pole / (of_pole * jnp.conj(of_conjugate) * square)
    total = 0.5 * at_energy + at_zeros - jnp.imag(residue)
    return (-2.0 / jnp.pi) * (amplitude / resonance) * total


class CodyLorentz(SumOfLines):
    """Oscillators of an amorphous semiconductor with Cody's onset and Urbach's exponential tail:

    Im eps = G(E) L(E) if E > tail_ev, else (E_1 / E) exp((E - tail_ev) / urbach_ev),
    G = (E - gap)^2 / [(E - gap)^2 + cody^2],
    L = sum_j A_j E_j C_j E / [(E^2 - E_j^2)^2 + (C_j E)^2],    E_1 = tail_ev G(tail_ev) L(tail_ev),
    Re eps = eps_inf + its Kramers-Kronig integral, in closed form;  eta + ik = sqrt(eps).

    Arguments:
        amplitudes_ev: A_j >= 0 in eV.
        resonances_ev: E_j > 0 in eV.
        widths_ev: C_j > 0 in eV, also beyond 2 E_j.
        gap_ev: E_g, the gap in eV, >= 0, one for all.
        cody_ev: E_p > 0 in eV: how far above the gap the onset gives way to the oscillators.
        tail_ev: E_t >= gap_ev in eV, where the tail ends; at the gap it vanishes.
        urbach_ev: E_u > 0 in eV.
        eps_inf: permittivity far above all resonances.

    Accuracy: Re eps within 64 eps of the largest of 1, the permittivity, and the norm of its
    gradient in relative changes of the arguments; Im eps within (16 + 2 (E_t - E) / E_u) eps of
    itself. No bound is stated where E_g + i E_p meets sqrt(E_j^2 - C_j^2 / 4) + i C_j / 2, a pole
    of an oscillator: residues cancel there, 38 eps a fortieth of E_j beside it, and the very point
    gives NaN. Derivatives are finite; those of Re eps at E_t, which are infinite, come out finite.
    Source: A. S. Ferlauto et al., J. Appl. Phys. 92, 2424 (2002), doi:10.1063/1.1497462; Ei: NIST
    Digital Library of Mathematical Functions, secs. 6.2 and 6.12.
    """

    amplitudes_ev: Array = eqx.field(converter=parameters_named("amplitudes_ev"))
    resonances_ev: Array = eqx.field(converter=parameters_named("resonances_ev"))
    widths_ev: Array = eqx.field(converter=parameters_named("widths_ev"))
    gap_ev: Array = eqx.field(converter=float_named("gap_ev"))
    cody_ev: Array = eqx.field(converter=float_named("cody_ev"))
    tail_ev: Array = eqx.field(converter=float_named("tail_ev"))
    urbach_ev: Array = eqx.field(converter=float_named("urbach_ev"))
    eps_inf: Array = eqx.field(converter=float_named("eps_inf"), default=1.0)

    def susceptibility(self, energy: Array) -> tuple[Array, Array]:
        shared = (self.gap_ev, self.cody_ev, self.tail_ev, self.urbach_ev)
        gap, cody, tail, urbach = (x.astype(energy.dtype) for x in shared)

        def absorption(x):
            at, amplitudes, resonances, widths = self.over_lines(x)
            beside = (at - resonances) * (at + resonances) / resonances**2
            loss = at / resonances * (widths / resonances)
            terms = amplitudes / resonances * loss / (beside * beside + loss * loss)
            return (x - gap) ** 2 / ((x - gap) ** 2 + cody**2) * jnp.sum(terms, axis=-1)

        # The logarithms of both parts are infinite at E_t, where their factors cancel.
        distance = jnp.where(energy == tail, jnp.finfo(tail.dtype).eps * tail, tail - energy)
        at, amplitudes, resonances, widths = self.over_lines(energy)
        above = _cody_lorentz(
            at, distance[..., None], amplitudes, resonances, widths, gap, cody, tail
        )
        of_tail = tail * absorption(tail) / energy
        steps = jnp.stack([distance, tail + energy, -energy, energy]) / urbach
        ends = _scaled_ei(steps)
        below = ends[0] - ends[1] - jnp.exp(-tail / urbach) * (ends[2] - ends[3])
        re = jnp.sum(above, axis=-1) + of_tail * below / jnp.pi
        decay = jnp.exp(jnp.minimum(energy - tail, 0.0) / urbach)
        return re, jnp.where(energy > tail, absorption(energy), of_tail * decay)
