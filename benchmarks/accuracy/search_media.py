"""Entries of the accuracy search: Brendel and Bormann's metals, and effective media."""

import gmpy2
import jax.numpy as jnp
import mpmath as mp

from benchmarks.accuracy.search_functions import plain_entry
from benchmarks.accuracy.search_models import WAVELENGTH, energy, of_permittivity
from fresnel_jax import effective_medium
from fresnel_jax.dispersion import BrendelBormann

_J, _SPHERES = gmpy2.mpc(0, 1), gmpy2.mpq(1, 3)


def _to_mpmath(x):
    mantissa, exponent = x.as_mantissa_exp()
    return mp.ldexp(mp.mpf(int(mantissa)), int(exponent))


def _from_mpmath(x):
    sign, mantissa, exponent, _ = x._mpf_
    value = gmpy2.mpfr(-int(mantissa) if sign else int(mantissa))
    return value * gmpy2.mpfr(2) ** exponent


def _faddeeva(z):
    """exp(-z^2) erfc(-iz) to 700 bits for Im z > 0; the asymptotic series from |z|^2 = 500 on."""
    with mp.workprec(1500 if abs(z) ** 2 < 500 else 750):
        z = mp.mpc(_to_mpmath(z.real), _to_mpmath(z.imag))
        if abs(z) ** 2 < 500:
            w = mp.exp(-z * z) * mp.erfc(-1j * z)
        else:
            term = total = mp.mpc(1)
            per, n = 1 / (2 * z * z), 1
            while abs(term) > mp.mpf(2) ** -720:
                term *= (2 * n - 1) * per
                total, n = total + term, n + 1
            w = 1j / (mp.sqrt(mp.pi) * z) * total
        return gmpy2.mpc(*(_from_mpmath(x) for x in (w.real, w.imag)))


def _brendel_bormann(w, plasma2, width_0, strength, resonance, width, deviation):
    E = energy(w)
    a = gmpy2.sqrt(gmpy2.mpc(E * E, E * width))
    unit = gmpy2.sqrt(gmpy2.mpfr(2)) * deviation
    factor = _J * gmpy2.sqrt(gmpy2.const_pi() / 8) * strength / (a * deviation)
    below, above = (factor * _faddeeva((a + x) / unit) for x in (-resonance, resonance))
    free = plasma2 / (E * gmpy2.mpc(E, width_0))
    return of_permittivity(1 - free + below + above, abs(free), abs(below) + abs(above))


def _our_brendel_bormann(w, plasma2, width_0, *oscillator):
    return tuple(BrendelBormann(plasma2, width_0, *(x[None] for x in oscillator))(w))


def _mixture(rule):
    """Truth of a mixture of two media; the index is measured by its modulus, as it is stated."""

    def truth(n0, k0, n1, k1, *f):
        e0, e1 = gmpy2.mpc(n0, k0) ** 2, gmpy2.mpc(n1, k1) ** 2
        N = gmpy2.sqrt(rule(e0, e1, *f))
        return [(N.real, abs(N)), (N.imag, abs(N))]

    return truth


def _bruggeman(e0, e1, f, L=_SPHERES):
    rest = 1 - L
    b = (1 - f) * (rest * e0 - L * e1) + f * (rest * e1 - L * e0)
    root = gmpy2.sqrt(b * b + 4 * rest * L * e0 * e1)
    both = ((b + root) / (2 * rest), (b - root) / (2 * rest))
    # Wiener's bounds leave the root between the directions of both constituents.
    bisector = (gmpy2.sqrt(e0) * gmpy2.sqrt(e1)).conjugate()
    return max(both, key=lambda e: (e * bisector).real)


def _maxwell_garnett(e0, e1, f):
    beta = f * (e1 - e0) / (e1 + 2 * e0)
    return e0 * (1 + 2 * beta) / (1 - beta)


def _cube_root(e):
    return gmpy2.exp(gmpy2.log(e) / 3)


def _looyenga(e0, e1, f):
    return ((1 - f) * _cube_root(e0) + f * _cube_root(e1)) ** 3


def _linear(e0, e1, f):
    return (1 - f) * e0 + f * e1


def _ours(model):
    def function(n0, k0, n1, k1, f, *depolarization):
        both = jnp.stack([n0, n1]), jnp.stack([k0, k1])
        return tuple(model(*both, f[None], *depolarization))

    return function


# Metals in glasses and the reverse, traces of 1e-6, losses of 1e-9.
_MIXED = ((0.1, 5.0), (1e-9, 5.0), (0.1, 5.0), (1e-9, 5.0), (1e-6, 1.0))
_RULES = {
    "bruggeman": _bruggeman,
    "maxwell_garnett": _maxwell_garnett,
    "looyenga": _looyenga,
    "linear": _linear,
}

MEDIA = {
    "BrendelBormann": plain_entry(
        (WAVELENGTH, (1e-2, 100.0), (1e-3, 1.0), (0.1, 100.0), (0.1, 12.0), (1e-3, 3.0),
         (0.05, 3.0)),
        _our_brendel_bormann, _brendel_bormann, 100.0, 300.0, conditioned=True,
    ),
    **{
        name: plain_entry(
            _MIXED, _ours(getattr(effective_medium, name)), _mixture(rule), 16.0, 50.0,
            conditioned=True,
        )
        for name, rule in _RULES.items()
    },
    "bruggeman of grains": plain_entry(
        (*_MIXED, (1e-3, 0.999)), _ours(effective_medium.bruggeman), _mixture(_bruggeman), 16.0,
        300.0, conditioned=True,
    ),
}  # fmt: skip
