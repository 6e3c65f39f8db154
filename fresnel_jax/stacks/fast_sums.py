"""The fast tier of `layers.stack` with thick layers, whose reflections add without interference.

Light that has been k times to the back face comes out with amplitudes r_p,k and r_s,k of its own. A
detector adds the Stokes vectors of all k, and so abs(r_s,k)^2, abs(r_p,k)^2 and r_p,k r_s,k*: a
layer of one index gives s and p the same phase, which drops out of the product, and what is left is
a geometric series (R. Joerger et al., Applied Optics 36, 319, 1997). The sum is partly depolarized
light. Of one thick layer its powers are the mean over the layer's phase of what they would be with
interference; of several, light that took two ways of one length adds without interference too.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import jax.numpy as jnp
from jax import Array

from .fast import FEW_LAYERS, Layers, admittances, amplitudes, as_complex


class _Faces(NamedTuple):
    """What a packet of coherent films does to s or p: r from both sides, t, and t t' of both."""

    front: Array
    back: Array
    t: Array
    there_and_back: Array


def _packet(admittance: Layers, phase: Layers, first: int, last: int) -> tuple[Layers, Layers]:
    """Return the admittances and phases between two media."""
    admittance, phase = admittance[first : last + 1], phase[first : last - 1]
    # A packet of few films in a sample of many.
    return (tuple(admittance), tuple(phase)) if len(phase) <= FEW_LAYERS else (admittance, phase)


def _faces(admittance: Layers, phase: Layers) -> _Faces:
    r, t = amplitudes(admittance, phase)
    back = amplitudes(admittance[::-1], phase[::-1]).r
    # Reciprocity: t' = t Y_behind / Y_front of the tangential fields.
    return _Faces(r, back, t, t * t * (admittance[-1] / admittance[0]))


class _Sums(NamedTuple):
    """Sums over all round trips of r_a r_b* and t_a t_b*, where a and b are s or p."""

    r: Array
    t: Array


def _summed(a: _Faces, b: _Faces, below: _Sums, down: Array) -> _Sums:
    """Return the sums of a packet and of what is below it, through a thick layer.

    down: what is left of intensity after one way through the thick layer.
    """
    r, t = a.front * jnp.conj(b.front), a.t * jnp.conj(b.t)
    back = down * down * below.r
    echoes = 1.0 / (1.0 - a.back * jnp.conj(b.back) * back)
    through = a.there_and_back * jnp.conj(b.there_and_back)
    return _Sums(r + through * back * echoes, t * down * below.t * echoes)


class Seen(NamedTuple):
    """R, T, r and t, each for s and p, and r_p r_s* summed over all round trips in thick layers."""

    R: Sequence[Array]
    T: Sequence[Array]
    r: Sequence[Array] | None
    t: Sequence[Array] | None
    cross: Array


def fast_sums(
    c: Array,
    eta_i: Array,
    index: Layers,
    thickness_um: Layers,
    wavelength_um: Array,
    coherent: Sequence[bool],
) -> Seen:
    """Return what layers reflect and transmit; r and t, of the electric fields, of films alone.

    Arguments as of `admittances`. coherent: of the layers, of which any number may be thick.
    """
    for_s, for_p, phase = admittances(c, eta_i, index, thickness_um, wavelength_um)
    thick = [j + 1 for j, interferes in enumerate(coherent) if not interferes]
    *packets, (first, last) = itertools.pairwise([0, *thick, len(for_s) - 1])
    behind = [amplitudes(*_packet(of, phase, first, last)) for of in (for_s, for_p)]
    ways = ((0, 0), (1, 1), (1, 0))  # s, p, and the product of p and s
    sums = [
        _Sums(*(x * jnp.conj(y) for x, y in zip(behind[a], behind[b], strict=True)))
        for a, b in ways
    ]
    for first, last in reversed(packets):
        found = [_faces(*_packet(of, phase, first, last)) for of in (for_s, for_p)]
        # One way leaves exp(2 Re phase); the phase itself is the same for s and p.
        down = as_complex(jnp.exp(2.0 * phase[last - 1].real))
        sums = [
            _summed(found[a], found[b], below, down)
            for (a, b), below in zip(ways, sums, strict=True)
        ]
    s2, p2, product = sums
    T = [
        both.t.real * admittance[-1].real / admittance[0].real
        for both, admittance in ((s2, for_s), (p2, for_p))
    ]
    r = t = None
    if not thick:
        # the tangential magnetic field of p is N times the electric one
        r = [of.r for of in behind]
        t = [behind[0].t, behind[1].t * (as_complex(eta_i) / index[-1])]
    return Seen([s2.r.real, p2.r.real], T, r, t, product.r)
