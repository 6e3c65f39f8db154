"""A rough boundary in a stack: the factor of Nevot and Croce on its reflection coefficient.

Between media i (above) and j the amplitude r is replaced by r w, w = exp(-2 k_0^2 sigma^2 Q_i Q_j),
with the factor 1 / t of the recursion unchanged. In the tangential fields U and W of
`_stack_coherent`, and with z = Q / g, that is a factor on each of them,

    U' = (1 + mu) U,    mu = (w - 1) (z_i - z_j) / (2 z_i),
    W' = (1 + nu) W,    nu = (w - 1) (z_j - z_i) / (2 z_j).

A change of mu and nu changes what the stack does as one in a layer does (`_stack_derivative`): with
(u, w) below the boundary and (a, b) above it,

    d B = a u d mu + b w d nu,      d r = (2 Q_0 D / B^2) u w ((1 + nu) d mu - (1 + mu) d nu),

where D is the product of (1 + mu) (1 + nu) of all boundaries in front of this one. The formulas of
derivatives are our own.

Source: L. Nevot and P. Croce 1980, doi:10.1051/rphysap:01980001503076100.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array

from .._numerics.arithmetic import one_if_zero
from .._numerics.complex import (
    Complex,
    Pair,
    choose,
    inverse,
    minus,
    pair,
    plus,
    scaled,
    squared_modulus,
    times,
)
from .coherent import Fields, at


def _exponential_slope(z: Complex) -> Pair:
    """(exp(z) - 1) / z."""
    re, im = pair(z)
    small = re * re + im * im < 0.0625
    near = (jnp.where(small, re, 0.0), jnp.where(small, im, 0.0))
    series = (jnp.ones_like(re), jnp.zeros_like(re))
    for k in range(12, 1, -1):
        series = plus((jnp.ones_like(re), jnp.zeros_like(re)), scaled(1.0 / k, times(series, near)))
    far = (jnp.where(small, 1.0, re), jnp.where(small, 0.0, im))
    size = jnp.exp(far[0])
    difference = (size * jnp.cos(far[1]) - 1.0, size * jnp.sin(far[1]))
    per = 1.0 / one_if_zero(squared_modulus(far))
    return choose(small, series, times(difference, (far[0] * per, -far[1] * per)))


class Factors(NamedTuple):
    """What boundaries add to U and to W, as fractions of them; for s or p."""

    mu: Pair
    nu: Pair


class BoundaryChange(NamedTuple):
    """What the changes of a boundary's factors do, in units of the fields beside it."""

    log: Pair  # to log(1 / B)
    sent: Pair  # to r, over 2 Q_0 D and f^2 of all layers in front


def boundary_factors(waves_per_roughness: Array, q: Pair, g: Pair) -> tuple[Factors, Factors]:
    """For s and p, of the L + 1 boundaries between L + 2 media of Q and g (of p)."""
    (q_i, q_j), (g_i, g_j) = ((at(slice(-1), z), at(slice(1, None), z)) for z in (q, g))
    tau = (2.0 * jnp.pi * waves_per_roughness) ** 2
    slope = scaled(-tau, _exponential_slope(scaled(-2.0 * tau, times(q_i, q_j))))
    steps = times(slope, q_j), times(slope, q_i)  # (w - 1) / (2 Q)
    s = minus(q_i, q_j)
    p = minus(times(q_i, inverse(g_i)), times(q_j, inverse(g_j)))
    return (
        Factors(times(steps[0], s), scaled(-1.0, times(steps[1], s))),
        Factors(times(times(steps[0], g_i), p), scaled(-1.0, times(times(steps[1], g_j), p))),
    )


def rough_boundary(fields: Fields, factors: tuple[Factors, Factors], q0: Complex) -> Fields:
    """The fields above the boundary from those below."""
    out = []
    for p, (mu, nu) in enumerate(factors):
        u, w, m, f = (z[p] for z in fields)
        du, dw = times(mu, u), times(nu, w)
        out.append((plus(u, du), plus(w, dw), plus(m, minus(times(q0, du), dw)), f))
    return Fields(*zip(*out, strict=True))


def beneath(factors: Factors, a: Pair, b: Pair, det: Pair) -> tuple[Pair, Pair, Pair]:
    """(a, b) and D below a boundary from those above."""
    mu, nu = factors
    det = plus(det, times(mu, det))
    return plus(a, times(mu, a)), plus(b, times(nu, b)), plus(det, times(nu, det))


def determinant(factors: Factors) -> Pair:
    """(1 + mu) (1 + nu)."""
    mu, nu = factors
    product = plus(plus(mu, nu), times(mu, nu))
    return 1.0 + product[0], product[1]


def boundary_change(
    factors: Factors, moved: Factors, above: tuple[Pair, Pair], below: tuple[Pair, Pair], per: Pair
) -> BoundaryChange:
    """above: (a, b); below: (u, w); per: 1 / B."""
    (a, b), (u, w) = above, below
    d_mu, d_nu = moved
    log = plus(times(times(a, u), d_mu), times(times(b, w), d_nu))
    sent = minus(plus(d_mu, times(factors.nu, d_mu)), plus(d_nu, times(factors.mu, d_nu)))
    u_w = times(times(u, per), times(w, per))
    return BoundaryChange(scaled(-1.0, times(log, per)), times(u_w, sent))
