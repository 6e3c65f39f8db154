"""Entries of the accuracy search: slabs, and stacks of one, two and three layers."""

import itertools

import gmpy2
import jax.numpy as jnp
import numpy as np

from benchmarks.accuracy.search_boundary import BOUNDARY, boundary
from benchmarks.accuracy.search_functions import Function, decades
from fresnel_jax import layers
from tests.truth.exact_fresnel import textbook

_ONE = gmpy2.mpfr(1)


def _our_slab(c, n, k, m, d, w):
    return tuple(layers.slab(c, n, k, thickness_um=d, wavelength_um=w, eta_i=m))


def _slab(c, n, k, m, d, w):
    exact = textbook(c, n, k, m)
    if exact is None:
        return None
    A = gmpy2.exp(-4 * gmpy2.const_pi() * d / w * exact.Q.imag)
    values = []
    for R in (gmpy2.norm(exact.r_s), gmpy2.norm(exact.r_p)):
        T = (1 - R) ** 2 * A / (1 - (R * A) ** 2)
        reflected = R + R * A * T
        values.append([(reflected, None), (T, T * (1 - gmpy2.log(A) / 6) if A else T)])
    return [values[0][0], values[1][0], values[0][1], values[1][1]]


def split(c, n0, *rest):
    """(c, index of every medium as (n, k), thicknesses, wavelength) of a stack's columns.

    n0: the first index, or its (n, k).
    """
    count = (len(rest) - 3) // 3
    first = n0 if isinstance(n0, tuple) else (n0, None)
    media = [first, *zip(rest[: 2 * count + 2 : 2], rest[1 : 2 * count + 2 : 2], strict=True)]
    return c, media, rest[2 * count + 2 : -1], rest[-1]


def normal_wavevectors(c, media):
    """Every N, and its Q = N cos(theta) of the wave that leaves."""
    N = [gmpy2.mpc(n, 0 if k is None else k) for n, k in media]
    Q = [N[0] * c]
    for z in N[1:]:
        q = gmpy2.sqrt(z * z - N[0] ** 2 * (1 - c * c))
        Q.append(-q if q.real + q.imag < 0 else q)
    return N, Q


def fields(Y, Q, thicknesses, w):
    """Tangential fields behind each boundary, by Abeles' matrices, with 1 and Y behind the last."""
    U, V = gmpy2.mpc(1), Y[-1]
    found = [(U, V)]
    for y, q, d in reversed(list(zip(Y[1:-1], Q[1:-1], thicknesses, strict=True))):
        delta = 2 * gmpy2.const_pi() * q * d / w
        U, V = (
            gmpy2.cos(delta) * U - gmpy2.mpc(0, 1) * gmpy2.sin(delta) / y * V,
            gmpy2.cos(delta) * V - gmpy2.mpc(0, 1) * y * gmpy2.sin(delta) * U,
        )
        found.insert(0, (U, V))
    return found


def stack(*columns, of_p=None):
    """Truth of `layers.stack`; of_p: (K, N, Q of s) -> Q of p, which is the same if it is None."""
    c, media, thicknesses, w = split(*columns)
    # an opaque layer of 600 bits each may cancel
    with gmpy2.context(gmpy2.get_context(), precision=500 + 650 * len(thicknesses)):
        N, Q = normal_wavevectors(c, media)
        Q_p = Q if of_p is None else of_p(N[0] ** 2 * (1 - c * c), N, Q)
        found = []
        Y_p = [q / (z * z) for q, z in zip(Q_p, N, strict=True)]
        for along_z, Y in ((Q, Q), (Q_p, Y_p)):
            inside = fields(Y, along_z, thicknesses, w)
            U, V = inside[0]
            fluxes = [(v * u.conjugate()).real for u, v in inside]
            r, t = (Y[0] * U - V) / (Y[0] * U + V), 2 * Y[0] / (Y[0] * U + V)
            share = gmpy2.norm(t) / Y[0].real
            losses = [(a - b) * share for a, b in itertools.pairwise(fluxes)]
            found.append((gmpy2.norm(r), share * Y[-1].real, r, t, losses))
        (R_s, T_s, r_s, t_s, A_s), (R_p, T_p, r_p, t_p, A_p) = found
        t_p = t_p * N[0] / N[-1]  # of E, where the matrices have H
        # an R below .01 counts as a tenth of its root, as docs/stacks.md states
        return [
            *((R, max(R, gmpy2.sqrt(R) / 10)) for R in (R_s, R_p)),
            (T_s, None),
            (T_p, None),
            *((z, max(_ONE, abs(z))) for z in (r_s, r_p, t_s, t_p)),
            *((A, None) for A in (*A_s, *A_p)),
        ]


def _our_stack(*columns):
    c, media, thicknesses, w = split(*columns)
    index = [n + (0j if k is None else 1j * k) for n, k in media]
    out = layers.stack(c, jnp.stack(index), thickness_um=jnp.stack(thicknesses), wavelength_um=w)
    return *out[:8], *out.A_s, *out.A_p


def drawn_stack(random, size, count):
    columns = [
        np.choose(
            random.integers(0, 3, size),
            [random.uniform(0, 1, size), decades(random, size, -6, 0), np.ones(size)],
        ),
        random.uniform(1, 2, size),
    ]
    for _ in range(count + 1):
        columns.append(
            np.choose(
                random.integers(0, 2, size),
                [random.uniform(1, 4, size), decades(random, size, -1, 0.7)],
            )
        )
        columns.append(decades(random, size, -9, 0.7))
    columns += [decades(random, size, -4, 0.3) for _ in range(count)]
    return [*columns, random.uniform(0.3, 2, size)]


def stack_limits(thicknesses):
    media = ((0.1, 5.0), (1e-9, 5.0)) * (len(thicknesses) + 1)
    return (1e-6, 1.0), (1.0, 2.0), *media, *thicknesses, (0.3, 2.0)


def _stack_entries(name, count):
    limits = stack_limits([(1e-4, 2.0)] * count)
    value = Function(
        lambda random, size, eps: drawn_stack(random, size, count),
        limits, _our_stack, stack, 64.0, conditioned=True,
        # In total reflection R hardly changes while r turns fast: R has the rounding of r.
        coupled=((0, 4), (1, 5)),
    )  # fmt: skip
    gradient = value._replace(bound=None, gradient_bound=64.0)
    return {f"stack of {name}": value, f"gradient of stack of {name}": gradient}


def behind_an_absorbing_medium(name, value):
    """The entries of a stack with an extinction of the first medium, behind its index."""

    def drawn(random, size, eps):
        c, n0, *rest = value.draw(random, size, eps)
        return [c, n0, decades(random, size, -9, 0.7), *rest]

    def with_k(function):
        return lambda c, n0, k0, *rest: function(c, (n0, k0), *rest)

    c, n0, *rest = value.limits
    behind = value._replace(
        draw=drawn, limits=(c, n0, (1e-9, 5.0), *rest), function=with_k(value.function),
        truth=with_k(value.truth),
    )  # fmt: skip
    # Of films that hardly absorb; the largest that a search has found is 11,300 (docs/stacks.md).
    gradient = behind._replace(bound=None, gradient_bound=2e4)
    name = f"stack {name} behind an absorbing medium"
    return {name: behind, f"gradient of {name}": gradient}


_FILMS = _stack_entries("one layer", 1) | _stack_entries("two layers", 2)
LAYERS = {
    "slab": Function(
        lambda r, s, e: (*boundary(r, s, e), decades(r, s, -4, 3), decades(r, s, -1, 1)),
        (*BOUNDARY, (1e-4, 1e3), (0.1, 10.0)),
        _our_slab, _slab, 24.0, 100.0,
        amplified=True,
    ),
    **_FILMS,
    **_stack_entries("three layers", 3),
    **{
        name: entry
        for count in ("one layer", "two layers")
        for name, entry in behind_an_absorbing_medium(
            f"of {count}", _FILMS[f"stack of {count}"]
        ).items()
    },
}  # fmt: skip
