"""Entries of the accuracy search: dispersion models."""

import gmpy2
import jax.numpy as jnp

from benchmarks.accuracy.search_functions import plain_entry
from fresnel_jax.dispersion import (
    HC_EV_UM,
    Cauchy,
    CauchyUrbach,
    DrudeLorentz,
    Sellmeier,
    TaucLorentz,
    drude,
)

WAVELENGTH = (0.1, 20.0)


def energy(w):
    return gmpy2.mpfr(HC_EV_UM) / w


def of_permittivity(eps, *also):
    """eta and k; the scale of both errors is that of the permittivity's through the root, which
    is the part itself away from a zero of Re eps and of the resonances."""
    N = gmpy2.sqrt(eps)
    scale = max([abs(eps), *also])
    return [(N.real, max(N.real, scale / abs(N))), (N.imag, max(N.imag, scale / abs(N)))]


def _cauchy(w, a, b, c):
    terms = (a, b / w**2, c / w**4)
    return [(sum(terms), sum(map(abs, terms)))]


def _sellmeier(w, b1, c1, b2, c2):
    terms = (b1 * w * w / (w * w - c1), b2 * w * w / (w * w - c2))
    eps = 1 + sum(terms)
    # the root halves relative errors; terms of both signs cancel
    return None if eps <= 0 else [
        (gmpy2.sqrt(eps), (1 + sum(map(abs, terms))) / gmpy2.sqrt(eps))
    ]  # fmt: skip


def _urbach(w, a, b, edge_k, width, edge):
    E = energy(w)
    k = edge_k * gmpy2.exp((E - edge) / width)
    return [(a + b / w**2, None), (k, k * (1 + (E + edge) / (2 * width)))]


def _drude(w, plasma, width):
    E = energy(w)
    chi = plasma**2 / (E * gmpy2.mpc(E, width))
    return of_permittivity(1 - chi, abs(chi))


def _lorentz(w, strength, resonance, width):
    E = energy(w)
    bottom = gmpy2.mpc(resonance**2 - E**2, -E * width)
    chi = strength / bottom
    return of_permittivity(1 + chi, abs(chi) * (1 + 2 * E * E / abs(bottom)))


def _tauc_lorentz(w, A, E_0, C, gap, eps_inf):
    """Jellison and Modine's closed form with its erratum (doi:10.1063/1.118155).

    alpha occurs as its square and in two quotients that are even in it, so that the form goes on
    where C > 2 E_0 and alpha is imaginary.
    """
    if C == 2 * E_0 or gap > E_0:
        return None  # quotients of zeros; no peak, and no bound is stated
    E, pi, atan, log = energy(w), gmpy2.const_pi(), gmpy2.atan, gmpy2.log
    alpha2, gamma2 = 4 * E_0**2 - C**2, E_0**2 - C**2 / 2
    zeta4 = (E**2 - gamma2) ** 2 + alpha2 * C**2 / 4
    a_ln = (gap**2 - E_0**2) * E**2 + gap**2 * C**2 - E_0**2 * (E_0**2 + 3 * gap**2)
    a_atan = (E**2 - E_0**2) * (E_0**2 + gap**2) + gap**2 * C**2
    edge, turned = E_0**2 + gap**2, 2 * (gap**2 - gamma2) / C
    # pi less the angles of 2 E_g -+ alpha over C, together
    angles = gmpy2.atan2(gap * C, gap**2 - E_0**2)
    alpha = gmpy2.sqrt(abs(alpha2))
    if alpha2 > 0:
        ln = log((edge + alpha * gap) / (edge - alpha * gap)) / alpha
        other = (pi - 2 * atan(turned / alpha)) / alpha
    else:
        ln = 2 * atan(alpha * gap / edge) / alpha
        other = log((turned + alpha) / (turned - alpha)) / alpha
    ratio = abs(E - gap) * (E + gap) / gmpy2.sqrt((E_0**2 - gap**2) ** 2 + gap**2 * C**2)
    re = eps_inf + (
        A * C * a_ln / (2 * pi * zeta4 * E_0) * ln
        - A * a_atan / (pi * zeta4 * E_0) * angles
        + 2 * A * E_0 * gap * (E**2 - gamma2) / (pi * zeta4) * other
        - A * E_0 * C * (E**2 + gap**2) / (pi * zeta4 * E) * log(abs(E - gap) / (E + gap))
        + 2 * A * E_0 * C * gap / (pi * zeta4) * log(ratio)
    )
    im = gmpy2.mpfr(0)
    if gap < E:
        im = A * E_0 * C * (E - gap) ** 2 / (((E * E - E_0**2) ** 2 + C**2 * E * E) * E)
    scale = max(1, abs(gmpy2.mpc(re, im)))
    # the permittivity, as the class states its bound
    return [(re, scale), (im, scale)]


def _permittivity(index):
    return (index.eta - index.k) * (index.eta + index.k), 2.0 * index.eta * index.k


MODELS = {
    "Cauchy": plain_entry(
        (WAVELENGTH, (1.0, 4.0), (1e-6, 0.1), (1e-9, 0.01)),
        lambda w, a, b, c: (Cauchy(jnp.stack([a, b, c]))(w).eta,), _cauchy, 4.0, 8.0,
    ),
    "Sellmeier": plain_entry(
        (WAVELENGTH, (0.01, 10.0), (1e-4, 0.05), (0.01, 10.0), (50.0, 1e3)),
        lambda w, b1, c1, b2, c2: (Sellmeier(jnp.stack([b1, b2]), jnp.stack([c1, c2]))(w).eta,),
        _sellmeier, 4.0, 16.0,
    ),
    "CauchyUrbach": plain_entry(
        # From .15 eV on: of .05 eV, far above the edge, k leaves the range of float32.
        (WAVELENGTH, (1.0, 4.0), (1e-6, 0.1), (1e-6, 1.0), (0.15, 1.0), (1.0, 6.0)),
        lambda w, a, b, k, u, e: tuple(CauchyUrbach(jnp.stack([a, b]), k, u, e)(w)),
        _urbach, 4.0, 16.0, amplified=True,
    ),
    "drude": plain_entry(
        (WAVELENGTH, (0.1, 20.0), (1e-3, 1.0)),
        lambda w, p, g: tuple(drude(p, g)(w)), _drude, 12.0, 24.0,
    ),
    "DrudeLorentz": plain_entry(
        (WAVELENGTH, (0.1, 300.0), (0.1, 12.0), (1e-3, 3.0)),
        lambda w, s, e, g: tuple(DrudeLorentz(s, e, g)(w)), _lorentz, 12.0, 48.0,
    ),
    "TaucLorentz": plain_entry(
        (WAVELENGTH, (1.0, 200.0), (0.5, 12.0), (1e-3, 20.0), (0.1, 10.0), (1.0, 5.0)),
        lambda w, a, e, c, g, x: _permittivity(TaucLorentz(a, e, c, g, x)(w)),
        _tauc_lorentz, 64.0, 1000.0, conditioned=True,
    ),
}  # fmt: skip
