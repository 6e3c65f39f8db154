"""Entries of the accuracy search: the approximations, against their own formulas in many digits.

How far an approximation is from the exact reflectance is another question: see its docstring.
"""

import gmpy2
import numpy as np

from benchmarks.accuracy.search_boundary import BOUNDARY, boundary
from benchmarks.accuracy.search_functions import Function, plain_entry
from fresnel_jax import approximate
from tests.truth.exact_fresnel import unpolarized

_ONE = gmpy2.mpfr(1)
_GAUSS = tuple(zip(*np.polynomial.legendre.leggauss(16), strict=True))
_DEGREE = 8


def _normal(n, k, m):
    return ((n - m) ** 2 + k * k) / ((n + m) ** 2 + k * k)


def _schlick_from(c, R_0):
    return R_0 + (1 - R_0) * (1 - c) ** 5


def _schlick(c, n, k, m):
    return [(_schlick_from(c, _normal(n, k, m)), None)]


# What follows subtracts: errors are in eps of a full reflectance.
def _f82_from(c, R_0, R_82):
    at = gmpy2.mpfr(1) / 7
    a = (_schlick_from(at, R_0) - R_82) / (at * (1 - at) ** 6)
    return [(_schlick_from(c, R_0) - a * c * (1 - c) ** 6, _ONE)]


def _f82(c, n, k, m):
    return _f82_from(c, _normal(n, k, m), unpolarized(gmpy2.mpfr(1) / 7, n, k, m))


def _lazanyi(c, n, k, m):
    R_0, top, bottom = _normal(n, k, m), gmpy2.mpfr(0), gmpy2.mpfr(0)
    for node, weight in _GAUSS:
        x, weight = (1 + gmpy2.mpfr(float(node))) / 2, gmpy2.mpfr(float(weight))
        shape = x * (1 - x) ** 6
        top += weight * shape * (_schlick_from(x, R_0) - unpolarized(x, n, k, m))
        bottom += weight * shape * shape
    return [(_schlick_from(c, R_0) - top / bottom * c * (1 - c) ** 6, _ONE)]


def _large_index(c, n, k, m):
    n, M = n / m, (n * n + k * k) / m**2
    R_s = (M - 2 * n * c + c * c) / (M + 2 * n * c + c * c)
    R_p = (M * c * c - 2 * n * c + 1) / (M * c * c + 2 * n * c + 1)
    return [((R_s + R_p) / 2, _ONE)]


def _polynomial(c, n, k, m):
    """Lagrange's form through the zeros of the Chebyshev polynomial."""
    count, total = _DEGREE + 1, gmpy2.mpfr(0)
    nodes = [
        (1 + gmpy2.cos(gmpy2.const_pi() * (2 * i + 1) / (2 * count))) / 2 for i in range(count)
    ]
    for node in nodes:
        basis = _ONE
        for other in nodes:
            basis *= 1 if other is node else (c - other) / (node - other)
        total += basis * unpolarized(node, n, k, m)
    return [(total, _ONE)]


def _real_index(R_0, m):
    return [(m * (1 + gmpy2.sqrt(R_0)) / (1 - gmpy2.sqrt(R_0)), None)]


def _gulbrandsen(r, g):
    """As printed."""
    root = gmpy2.sqrt(r)
    eta = g * (1 - r) / (1 + r) + (1 - g) * (1 + root) / (1 - root)
    k = gmpy2.sqrt((r * (eta + 1) ** 2 - (eta - 1) ** 2) / (1 - r))
    return [(eta, None), (k, None)]


def _parameters(n, k):
    r = _normal(n, k, _ONE)
    root = gmpy2.sqrt(r)
    high, low = (1 + root) / (1 - root), (1 - r) / (1 + r)
    g = (high - n) / (high - low)
    return [(r, None), (g, g / min(1, abs(gmpy2.log(n))))]


def _on_boundary(function, truth, *bounds):
    """Within the domain that the approximations state: entering a denser medium or a metal."""

    def within(c, n, k, m):
        return truth(c, n, k, m) if n >= m or k >= m else None

    return Function(boundary, BOUNDARY, lambda *a: (function(*a),), within, *bounds)


APPROXIMATIONS = {
    "approximate.schlick": _on_boundary(approximate.schlick, _schlick, 8.0, 50.0),
    "approximate.f82": _on_boundary(approximate.f82, _f82, 24.0, 100.0),
    "approximate.lazanyi_szirmay_kalos": _on_boundary(
        approximate.lazanyi_szirmay_kalos, _lazanyi, 24.0, 100.0
    ),
    "approximate.large_index": _on_boundary(approximate.large_index, _large_index, 8.0, 50.0),
    # The slope at cosine 1 changes by 207 eps if each of the nine reflectances at the nodes does by
    # one: the sum of |l_i'| of Lagrange's polynomials. Each is within the 8 eps of `reflectance`,
    # and the recurrence adds up to 104: 8 * 207 + 104 < 1,800.
    "approximate.polynomial": _on_boundary(approximate.polynomial, _polynomial, 24.0, 1800.0),
    "approximate.f82_from_reflectances": plain_entry(
        ((1e-9, 1.0), (1e-6, 1.0), (1e-6, 1.0)),
        lambda *a: (approximate.f82_from_reflectances(*a),), _f82_from, 24.0, 50.0,
    ),
    "approximate.normal_reflectance": Function(
        lambda *a: boundary(*a)[1:], BOUNDARY[1:],
        lambda *a: (approximate.normal_reflectance(*a),),
        lambda n, k, m: [(_normal(n, k, m), None)], 5.0, 50.0,
    ),
    "approximate.real_index": plain_entry(
        ((1e-9, 1 - 1e-6), (0.25, 4.0)), lambda *a: (approximate.real_index(*a),), _real_index,
        5.0, 24.0,
    ),
    "approximate.gulbrandsen_index": plain_entry(
        ((1e-6, 1 - 1e-6), (1e-9, 1.0)), lambda *a: tuple(approximate.gulbrandsen_index(*a)),
        _gulbrandsen, 16.0, 50.0,
    ),
    "approximate.gulbrandsen_parameters": plain_entry(
        ((1e-2, 1e2), (1e-6, 1e2)), lambda *a: tuple(approximate.gulbrandsen_parameters(*a)),
        _parameters, 16.0, None,
    ),
}  # fmt: skip
