"""Entries of the accuracy search: stacks with incoherent layers, and with rough boundaries.

Incoherent layers: the powers that go down and up in each of them solve a system of linear
equations, with R of each packet of films from both sides and its T by characteristic matrices.
Rough boundaries: the recursion of reflected amplitudes, each times Nevot and Croce's factor.
"""

import itertools

import gmpy2
import jax.numpy as jnp

from benchmarks.accuracy.search_functions import Function, decades
from benchmarks.accuracy.search_layers import (
    behind_an_absorbing_medium,
    drawn_stack,
    fields,
    normal_wavevectors,
    split,
    stack_limits,
)
from fresnel_jax import layers

_ONE, _ZERO = gmpy2.mpfr(1), gmpy2.mpfr(0)


def _half_space(Y, U, V):
    """r, |Y U + V|^2 and what a unit of power is in these units, from the side of Y."""
    bottom = gmpy2.norm(Y * U + V)
    return (Y * U - V) / (Y * U + V), 4 * Y.real / bottom


def _packet(Y, Q, thicknesses, w):
    """(R, absorptions, what the first medium itself loses) from this side, and T."""
    found = fields(Y, Q, thicknesses, w)
    r, share = _half_space(Y[0], *found[0])
    fluxes = [(V * U.conjugate()).real * share for U, V in found]
    losses = [a - b for a, b in itertools.pairwise(fluxes)]
    # T as of a lossless medium, which makes it the same from both sides
    R, T = gmpy2.norm(r), Y[-1].real * share
    return R, T, losses, 1 - R - T - sum(losses)


def _solved(rows, right):
    """Gaussian elimination with pivots."""
    rows = [[*row, b] for row, b in zip(rows, right, strict=True)]
    for i in range(len(rows)):
        pivot = max(range(i, len(rows)), key=lambda j: abs(rows[j][i]))
        rows[i], rows[pivot] = rows[pivot], rows[i]
        for j in range(len(rows)):
            if j != i:
                factor = rows[j][i] / rows[i][i]
                rows[j] = [a - factor * b for a, b in zip(rows[j], rows[i], strict=True)]
    return [row[-1] / row[i] for i, row in enumerate(rows)]


def incoherent(coherent):
    """`stack` of layers of which some are incoherent, and its truth, both of single numbers."""
    cuts = [i + 1 for i, with_phase in enumerate(coherent) if not with_phase]
    edges = [0, *cuts, len(coherent) + 1]

    def one(Y, Q, thicknesses, w):
        fronts, backs = [], []
        for first, last in itertools.pairwise(edges):
            part = slice(first, last + 1)
            d = thicknesses[first : last - 1]
            fronts.append(_packet(Y[part], Q[part], d, w))
            backs.append(_packet(Y[part][::-1], Q[part][::-1], d[::-1], w))
        P = [gmpy2.exp(-4 * gmpy2.const_pi() * thicknesses[i - 1] / w * Q[i].imag) for i in cuts]
        # Unknown: the power that goes down at the top of each incoherent layer, then up at its end.
        count = len(cuts)
        rows = [[_ZERO + (i == j) for j in range(2 * count)] for i in range(2 * count)]
        for i in range(count):
            rows[i][count + i] -= backs[i][0] * P[i]
            rows[count + i][i] -= fronts[i + 1][0] * P[i]
            if i:
                rows[i][i - 1] -= fronts[i][1] * P[i - 1]
            if i + 1 < count:
                rows[count + i][count + i + 1] -= fronts[i + 1][1] * P[i + 1]
        solved = _solved(rows, [fronts[0][1], *[_ZERO] * (2 * count - 1)])
        if min(solved) < 0:
            return None  # the sum over the reflections diverges
        down, up = solved[:count], solved[count:]
        absorbed = []
        for i in range(count + 1):
            above = P[i - 1] * down[i - 1] if i else _ONE
            below = P[i] * up[i] if i < count else _ZERO
            reversed_losses = backs[i][2][::-1]
            absorbed += [
                above * a + below * b for a, b in zip(fronts[i][2], reversed_losses, strict=True)
            ]
            if i < count:
                inside = (1 - P[i]) * (down[i] + up[i]) + below * backs[i][3]
                absorbed.append(inside + P[i] * down[i] * fronts[i + 1][3])
        R = fronts[0][0] + fronts[0][1] * P[0] * up[0]
        return R, fronts[-1][1] * P[-1] * down[-1], absorbed

    def truth(*columns):
        c, media, thicknesses, w = split(*columns)
        with gmpy2.context(gmpy2.get_context(), precision=500 + 650 * len(thicknesses)):
            N, Q = normal_wavevectors(c, media)
            both = [
                one(Y, Q, thicknesses, w)
                for Y in (Q, [q / (z * z) for q, z in zip(Q, N, strict=True)])
            ]
            if None in both:
                return None
            (R_s, T_s, A_s), (R_p, T_p, A_p) = both
            return [(x, None) for x in (R_s, R_p, T_s, T_p, *A_s, *A_p)]

    def ours(*columns):
        c, media, thicknesses, w = split(*columns)
        index = [n + (0j if k is None else 1j * k) for n, k in media]
        out = layers.stack(
            c,
            jnp.stack(index),
            thickness_um=jnp.stack(thicknesses),
            wavelength_um=w,
            coherent=coherent,
        )
        return *out[:4], *out.A_s, *out.A_p

    return ours, truth


def _rough(*columns):
    *columns, w, outer, inner = columns
    c, media, thicknesses, w = split(*columns, w)
    with gmpy2.context(gmpy2.get_context(), precision=1200):
        N, Q = normal_wavevectors(c, media)
        k0 = 2 * gmpy2.const_pi() / w
        phase = gmpy2.exp(gmpy2.mpc(0, 1) * k0 * thicknesses[0] * Q[1])
        found = []
        for Y in (Q, [q / (z * z) for q, z in zip(Q, N, strict=True)]):
            r, t = [], []
            for i, sigma in enumerate((outer, inner)):
                bottom = Y[i] + Y[i + 1]
                factor = gmpy2.exp(-2 * (k0 * sigma) ** 2 * Q[i] * Q[i + 1])
                r.append((Y[i] - Y[i + 1]) / bottom * factor)
                t.append(2 * Y[i] / bottom)
            bottom = 1 + r[0] * r[1] * phase**2
            forward = t[0] / bottom
            near = forward * (1 + r[1] * phase**2), Y[1] * forward * (1 - r[1] * phase**2)
            far = forward * phase * (1 + r[1]), Y[1] * forward * phase * (1 - r[1])
            fluxes = [(V * U.conjugate()).real / Y[0].real for U, V in (near, far)]
            t = t[0] * t[1] * phase / bottom
            T = gmpy2.norm(t) * Y[2].real / Y[0].real
            found.append(((r[0] + r[1] * phase**2) / bottom, t, T, fluxes[0] - fluxes[1]))
        (r_s, t_s, T_s, A_s), (r_p, t_p, T_p, A_p) = found
        t_p = t_p * N[0] / N[-1]
        R = [gmpy2.norm(r) for r in (r_s, r_p)]
        return [
            *((x, max(x, gmpy2.sqrt(x) / 10)) for x in R),
            (T_s, None),
            (T_p, None),
            *((z, max(_ONE, abs(z))) for z in (r_s, r_p, t_s, t_p)),
            (A_s, None),
            (A_p, None),
        ]


def _our_rough(*columns):
    *columns, outer, inner = columns
    c, media, thicknesses, w = split(*columns)
    index = [n + (0j if k is None else 1j * k) for n, k in media]
    roughness = jnp.stack([outer, inner])
    out = layers.stack(
        c,
        jnp.stack(index),
        thickness_um=jnp.stack(thicknesses),
        wavelength_um=w,
        roughness_um=roughness,
    )
    return *out[:8], *out.A_s, *out.A_p


def _drawn_incoherent(random, size, coherent):
    columns = drawn_stack(random, size, len(coherent))
    for i, with_phase in enumerate(coherent):
        if not with_phase:
            columns[i - len(coherent) - 1] = decades(random, size, -1, 4)
    return columns


def _drawn_rough(random, size):
    return [*drawn_stack(random, size, 1), *(decades(random, size, -5, -2.3) for _ in range(2))]


def _pair(name, draw, limits, ours, truth, **options):
    value = Function(
        lambda random, size, eps: draw(random, size),
        limits, ours, truth, 64.0, conditioned=True, **options,
    )  # fmt: skip
    gradient = value._replace(bound=None, gradient_bound=64.0)
    return {f"stack {name}": value, f"gradient of stack {name}": gradient}


def _incoherent_entries(name, coherent):
    thick = [(0.1, 1e4) if not with_phase else (1e-4, 2.0) for with_phase in coherent]
    limits = stack_limits(thick)
    return _pair(
        name, lambda r, s: _drawn_incoherent(r, s, coherent), limits, *incoherent(coherent)
    )


_ROUGH = _pair(
    "with rough boundaries", _drawn_rough, (*stack_limits([(1e-4, 2.0)]), *((1e-5, 5e-3),) * 2),
    _our_rough, _rough, coupled=((0, 4), (1, 5)),
)  # fmt: skip
MIXED = {
    **_incoherent_entries("of a thick layer", (False,)),
    **_incoherent_entries("of a thick layer, both sides coated", (True, False, True)),
    **_incoherent_entries("of two thick layers around a film", (False, True, False)),
    **_ROUGH,
    **behind_an_absorbing_medium("with rough boundaries", _ROUGH["stack with rough boundaries"]),
}  # fmt: skip
