"""Entries of the accuracy search: Mueller matrices, depths, phases, psi and Delta."""

import gmpy2

from benchmarks.accuracy.search_boundary import BOUNDARY, boundary
from benchmarks.accuracy.search_functions import Function, decades, plain_entry
from fresnel_jax import polarization
from tests.truth.exact_fresnel import textbook


def _mueller(c, n, k, m):
    exact = textbook(c, n, k, m)
    if exact is None:
        return None
    R_s, R_p = gmpy2.norm(exact.r_s), gmpy2.norm(exact.r_p)
    w = exact.r_s * exact.r_p.conjugate()
    R, zero = (R_s + R_p) / 2, gmpy2.mpfr(0)
    D = (R_s - R_p) / 2
    rows = (
        R,
        D,
        zero,
        zero,
        D,
        R,
        zero,
        zero,
        zero,
        zero,
        w.real,
        -w.imag,
        zero,
        zero,
        w.imag,
        w.real,
    )
    return [(x, R) for x in rows]


def _mueller_by_amplitudes(*point):
    """With the scale |r| |gradient of r|: near index match the products' derivatives cancel."""
    elements, here = _mueller(*point), textbook(*point)
    if elements is None or here is None:
        return None
    norm2 = gmpy2.mpfr(0)
    for j, x in enumerate(point):
        near = textbook(*point[:j], x * (1 + gmpy2.mpfr(2) ** -250), *point[j + 1 :])
        if near is None:
            return None
        for a, b in ((near.r_s, here.r_s), (near.r_p, here.r_p)):
            norm2 += gmpy2.norm((a - b) * gmpy2.mpfr(2) ** 250)
    scale = gmpy2.sqrt(elements[0][1] * norm2)
    return [(x, max(R, scale)) for x, R in elements]


def _depth(w, c, n, k, m):
    exact = textbook(c, n, k, m)
    return None if exact is None else [(w / (4 * gmpy2.const_pi() * exact.Q.imag), None)]


def _psi_delta(c, n, k, m):
    exact = textbook(c, n, k, m)
    if exact is None or exact.r_s == 0 or exact.r_p == 0:
        return None
    rho = exact.r_p / exact.r_s
    delta = gmpy2.const_pi() - gmpy2.phase(-rho)  # smooth at normal incidence
    return [(gmpy2.atan(abs(rho)), None), (delta, None)]


def _phases(c, n, k, m):
    exact, angles = textbook(c, n, k, m), _psi_delta(c, n, k, m)
    if exact is None or angles is None:
        return None
    phi_s = gmpy2.phase(exact.r_s)
    phi_s = phi_s - 2 * gmpy2.const_pi() if phi_s > 0 else phi_s
    return [(phi_s, None), (phi_s - angles[1][0], None)]


def _refraction(c, n, m):
    """By amplitudes; total reflection is left out, where all elements are 0."""
    if n * n <= m * m * (1 - c * c):
        return None
    q = gmpy2.sqrt(n * n - m * m * (1 - c * c))
    T_s = 4 * m * c * q / (m * c + q) ** 2
    T_p = 4 * m * c * q * n * n / (n * n * c + m * q) ** 2
    T = (T_s + T_p) / 2
    return [(T, None), ((T_s - T_p) / 2, T), (gmpy2.sqrt(T_s * T_p), None)]


def _our_refraction(c, n, m):
    M = polarization.mueller_refraction(c, n, m)
    return M[0, 0], M[0, 1], M[2, 2]


POLARIZATION = {
    "mueller_reflection": Function(
        boundary, BOUNDARY, lambda *a: tuple(polarization.mueller_reflection(*a).ravel()),
        _mueller, 24.0,
    ),
    "gradient of mueller_reflection": Function(
        boundary, BOUNDARY, lambda *a: tuple(polarization.mueller_reflection(*a).ravel()),
        _mueller_by_amplitudes, 24.0, 100.0, shared=True,
    ),
    "penetration_depth": Function(
        lambda r, s, e: (decades(r, s, -1, 1), *boundary(r, s, e)), ((0.1, 10.0), *BOUNDARY),
        lambda um, *a: (polarization.penetration_depth(*a, wavelength_um=um),), _depth, 12.0, 50.0,
    ),
    "phases": Function(
        boundary, BOUNDARY, lambda *a: tuple(polarization.phases(*a)), _phases, 12.0, 50.0,
        conditioned=True,
    ),
    "mueller_refraction": Function(
        lambda *a: (lambda c, n, k, m: (c, n, m))(*boundary(*a)), (BOUNDARY[0], *BOUNDARY[1::2]),
        _our_refraction, _refraction, 12.0, 100.0, shared=True,
    ),
    "absorption_depth": plain_entry(
        ((0.1, 10.0), (1e-12, 1e2)), lambda w, k: (polarization.absorption_depth(w, k),),
        lambda w, k: [(w / (4 * gmpy2.const_pi() * k), None)], 4.0, 8.0,
    ),
    "psi_delta": Function(
        boundary, BOUNDARY, lambda *a: tuple(polarization.psi_delta(*a)), _psi_delta, 12.0, 50.0,
    ),
}  # fmt: skip
