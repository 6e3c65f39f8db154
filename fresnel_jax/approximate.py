"""Approximations of the reflectance of one boundary, each with its known largest error.

All of them give the power reflectance of unpolarized light, for light that enters the denser medium
or a metal; none knows total reflection, Brewster's angle of one polarization, or phase. They
broadcast as NumPy does, keep the dtype, and work under `jit`, `vmap` and `grad`; their derivatives
are finite everywhere. The sign of the cosine is ignored, as in `interface`.

Largest absolute error of R over all angles, measured densely (test_approximate.py), and cost
per point for one material and many angles, in instructions after fusion (an exact `reflectance`
takes 60 to 90, of which 3 to 5 are divisions and square roots; an approximation of the list none,
but `large_index` one):

                            dielectrics,        metals,                    instructions
                            eta 1.3 to 2.5      eta .04 to 4, k 2.4 to 7   per point
    schlick                 .083                .26                        8
    lazanyi_szirmay_kalos   .030                .065                       11
    f82                     .034                .064                       11
    large_index             .16                 .0075                      17
    polynomial, degree 6    .0048               .023                       21
    polynomial, degree 8    .00061              .0036                      27
    polynomial, degree 10   .000075             .0019                      33

Colours and indices, `gulbrandsen_index` and its kin, are exact; they stand in `boundary.colours`.

The coefficients (R at normal incidence, R at 82 degrees, the polynomial) depend on the material
only. They are computed once for a scalar `eta` and `k`, whatever the number of angles; with a
different material at every point only `schlick` and `large_index` cost less than the exact form.
"""

from __future__ import annotations

import functools

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike

from ._numerics.arguments import looked_at, named_floats
from ._numerics.index import IndexLike
from .boundary.boundary import within_one
from .boundary.colours import gulbrandsen_index as gulbrandsen_index
from .boundary.colours import gulbrandsen_parameters as gulbrandsen_parameters
from .boundary.colours import normal_reflectance as normal_reflectance
from .boundary.colours import real_index as real_index
from .boundary.colours import reflectance_at_normal
from .interface import reflectance

__all__ = [
    "f82",
    "f82_from_reflectances",
    "gulbrandsen_index",
    "gulbrandsen_parameters",
    "large_index",
    "lazanyi_szirmay_kalos",
    "normal_reflectance",
    "polynomial",
    "real_index",
    "schlick",
]

# F82 is fixed at the cosine 1/7 (81.8 degrees), where c (1 - c)^6 is largest.
_COSINE_82 = 1.0 / 7.0
_LARGEST_CORRECTION = _COSINE_82 * (1.0 - _COSINE_82) ** 6


def _with_correction(c, R_0, coefficient):
    """Schlick's curve minus coefficient c (1 - c)^6."""
    x = 1.0 - c
    x2 = x * x
    x5 = x2 * x2 * x
    return R_0 + x5 * ((1.0 - R_0) - coefficient * (c * x))


def _schlick(c, R_0):
    x = 1.0 - c
    x2 = x * x
    return R_0 + (1.0 - R_0) * (x2 * x2 * x)


@functools.cache
def _gauss_legendre(order: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights on [0, 1]."""
    nodes, weights = np.polynomial.legendre.leggauss(order)
    return 0.5 * (nodes + 1.0), 0.5 * weights


@functools.cache
def _chebyshev_transform(degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Cosines in [0, 1] and the matrix from R at them to the Chebyshev coefficients.

    Angles are whole parts of a turn, reduced as integers: with cosines of their rounded products
    the slope at normal incidence was off by 570 eps, with these by 104.
    """
    size = degree + 1
    node = np.arange(size)
    parts = np.outer(node, 2 * node + 1) % (4 * size)
    parts = np.minimum(parts, 4 * size - parts)
    matrix = 2.0 / size * np.sin(np.pi * (size - parts) / (2 * size))
    matrix[0] *= 0.5
    return np.sin(np.pi * (2 * (size - node) - 1) / (4 * size)) ** 2, matrix


def _exact_at(cosines: np.ndarray, eta, k, eta_i):
    """The cosines on a new leading axis, and the exact R at them."""
    eta, k, eta_i = jnp.broadcast_arrays(eta, k, eta_i)
    leading = jnp.asarray(cosines, eta.dtype).reshape(-1, *[1] * eta.ndim)
    return leading, reflectance(leading, *(x[None] for x in (eta, k, eta_i)))


@looked_at
@jax.jit
def schlick(
    cos_theta_i: ArrayLike, eta: IndexLike, k: ArrayLike = 0.0, eta_i: IndexLike = 1.0
) -> Array:
    """R_0 + (1 - R_0) (1 - c)^5 with R_0 of normal incidence.

    Light that leaves the denser medium must bring the cosine on the thin side instead, and R = 1
    beyond the critical angle; with the inner cosine the error reaches .96 for glass.

    Args:
        cos_theta_i: cosine of the angle of incidence, in [-1, 1]; its sign is ignored.
        eta, k: real and imaginary part of the absolute index of the medium entered, > 0 and >= 0;
            or as `eta` alone its complex index or an `Index`.
        eta_i: absolute index of the medium that the light comes from, real, > 0.

    Returns:
        R in [0, 1]. For the error see the module's docstring; the worst angle is 84 to 86 degrees.

    Source: C. Schlick, An inexpensive BRDF model for physically-based rendering, Computer Graphics
    Forum 13(3), 1994, doi:10.1111/1467-8659.1330233.
    """
    c, eta, k, eta_i = named_floats(cos_theta_i=cos_theta_i, eta=eta, k=k, eta_i=eta_i)
    return _schlick(within_one(c), reflectance_at_normal(eta, k, eta_i))


@looked_at
@jax.jit
def lazanyi_szirmay_kalos(
    cos_theta_i: ArrayLike, eta: IndexLike, k: ArrayLike = 0.0, eta_i: IndexLike = 1.0
) -> Array:
    """Schlick's curve minus a c (1 - c)^6, a by least squares over the cosine.

    The exponent of the correction is 6 for every material; a is the quotient of two integrals over
    c of the exact curve, by Gauss-Legendre quadrature with 16 nodes.

    Arguments as in `schlick`. The result may leave [0, 1] by as much as its error.

    Source: I. Lazanyi and L. Szirmay-Kalos, Fresnel term approximations for metals, WSCG 2005.
    """
    c, eta, k, eta_i = named_floats(cos_theta_i=cos_theta_i, eta=eta, k=k, eta_i=eta_i)
    R_0 = reflectance_at_normal(eta, k, eta_i)
    nodes, weights = _gauss_legendre(16)
    shape = nodes * (1.0 - nodes) ** 6
    cosines, exact = _exact_at(nodes, eta, k, eta_i)
    moments = weights * shape / np.sum(weights * shape * shape)
    excess = _schlick(cosines, R_0[None]) - exact
    coefficient = jnp.tensordot(jnp.asarray(moments, c.dtype), excess, 1)
    return _with_correction(within_one(c), R_0, coefficient)


@looked_at
@jax.jit
def f82(
    cos_theta_i: ArrayLike, eta: IndexLike, k: ArrayLike = 0.0, eta_i: IndexLike = 1.0
) -> Array:
    """Schlick's curve minus a c (1 - c)^6, exact at normal incidence and at c = 1/7 (82 degrees).

    Arguments as in `schlick`. The result may leave [0, 1] by as much as its error.

    Source: N. Hoffman, Fresnel equations considered harmful, Eurographics workshop on material
    appearance modeling, 2019; C. Kutz, M. Hasan and M. Edmondson, Novel aspects of the Adobe
    Standard Material, 2021.
    """
    c, eta, k, eta_i = named_floats(cos_theta_i=cos_theta_i, eta=eta, k=k, eta_i=eta_i)
    R_82 = reflectance(jnp.full_like(eta, _COSINE_82), eta, k, eta_i)
    return f82_from_reflectances(c, reflectance_at_normal(eta, k, eta_i), R_82)


@looked_at
@jax.jit
def f82_from_reflectances(cos_theta_i: ArrayLike, R_0: ArrayLike, R_82: ArrayLike) -> Array:
    """`f82` from two reflectances, an artist's colours for example, instead of an index.

    Args:
        cos_theta_i: cosine of the angle of incidence, in [-1, 1]; its sign is ignored.
        R_0: reflectance at normal incidence, in [0, 1].
        R_82: reflectance at cosine 1/7, in [0, 1]; the model's tint times Schlick's value there.

    Source: as `f82`.
    """
    c, R_0, R_82 = named_floats(cos_theta_i=cos_theta_i, R_0=R_0, R_82=R_82)
    coefficient = (_schlick(_COSINE_82, R_0) - R_82) * (1.0 / _LARGEST_CORRECTION)
    return _with_correction(within_one(c), R_0, coefficient)


@looked_at
@jax.jit
def large_index(
    cos_theta_i: ArrayLike, eta: IndexLike, k: ArrayLike = 0.0, eta_i: IndexLike = 1.0
) -> Array:
    """R for an index so large that the refracted ray runs along the normal: metals.

    R_s = (M - 2 n c + c^2) / (M + 2 n c + c^2),  R_p = (M c^2 - 2 n c + 1) / (M c^2 + 2 n c + 1),
    M = n^2 + k^2, n and k relative to eta_i; computed as 1 - 2 n c (1 / D_s + 1 / D_p) with one
    division and no square root. No dielectric: the error for glass is .1.

    Arguments as in `schlick`.

    Source: M. Born and E. Wolf, Principles of Optics, 7th ed., sec. 14.2; used for rendering by
    R. L. Cook and K. E. Torrance 1982 and by Gulbrandsen 2014.
    """
    c, eta, k, eta_i = named_floats(cos_theta_i=cos_theta_i, eta=eta, k=k, eta_i=eta_i)
    c = within_one(c)
    n, k = eta / eta_i, k / eta_i
    modulus2, c2, twice = n * n + k * k, c * c, 2.0 * (n * c)
    D_s, D_p = (modulus2 + c2) + twice, (modulus2 * c2 + 1.0) + twice
    return 1.0 - twice * ((D_s + D_p) / (D_s * D_p))


@looked_at
@functools.partial(jax.jit, static_argnames="degree")
def polynomial(
    cos_theta_i: ArrayLike,
    eta: IndexLike,
    k: ArrayLike = 0.0,
    eta_i: IndexLike = 1.0,
    degree: int = 8,
) -> Array:
    """The polynomial in the cosine that meets the exact R at degree + 1 Chebyshev nodes.

    Its coefficients take degree + 1 exact evaluations per material, its value two operations per
    degree and point (Clenshaw's recurrence). The error falls tenfold with every 2 degrees for
    dielectrics, threefold for metals, whose curve bends sharply near grazing incidence.

    Args:
        cos_theta_i, eta, k, eta_i: as in `schlick`.
        degree: a Python int from 1 to 40.

    Returns:
        R; it may leave [0, 1] by as much as its error.

    Raises:
        ValueError: `degree` is not an int from 1 to 40.

    Source: L. N. Trefethen, Approximation Theory and Approximation Practice, ch. 2 to 4.
    """
    if not isinstance(degree, int) or not 1 <= degree <= 40:
        raise ValueError(f"degree is {degree!r}, an int from 1 to 40 is wanted; 8 is a good one")
    c, eta, k, eta_i = named_floats(cos_theta_i=cos_theta_i, eta=eta, k=k, eta_i=eta_i)
    nodes, matrix = _chebyshev_transform(degree)
    _, exact = _exact_at(nodes, eta, k, eta_i)
    coefficients = jnp.tensordot(jnp.asarray(matrix, c.dtype), exact, 1)
    twice = 4.0 * within_one(c) - 2.0
    later, latest = jnp.zeros_like(twice), coefficients[degree]
    for j in range(degree - 1, 0, -1):
        later, latest = latest, twice * latest - later + coefficients[j]
    return 0.5 * twice * latest - later + coefficients[0]
