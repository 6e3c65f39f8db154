"""Samples with thick layers, whose reflections add without interference: powers, psi and Delta.

Light that has been k times to the back face comes out with amplitudes r_p,k and r_s,k of its own. A
detector adds the Stokes vectors of all k, and so abs(r_s,k)^2, abs(r_p,k)^2 and r_p,k r_s,k*: a
layer of one index gives s and p the same phase, which drops out of the product, and what is left is
a geometric series (R. Joerger et al., Applied Optics 36, 319, 1997). The sum is partly depolarized
light. Of one thick layer its powers are the mean over the layer's phase of what they would be with
interference; of several, light that took two ways of one length adds without interference too.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import jax.numpy as jnp
from jax import Array

from fitting.optics.coherent_films import FEW_LAYERS, Layers, admittances, amplitudes


class _Faces(NamedTuple):
    """What a packet of coherent films does to s or p: r from both sides, t, and t t' of both."""

    front: Array
    back: Array
    t: Array
    there_and_back: Array


def _faces(admittance: Layers, phase: Layers) -> _Faces:
    if len(phase) <= FEW_LAYERS:  # a packet of few films in a sample of many
        admittance, phase = tuple(admittance), tuple(phase)
    r, t = amplitudes(admittance, phase)
    back = amplitudes(admittance[::-1], phase[::-1]).r
    # Reciprocity: t' = t Y_behind / Y_front of the tangential fields.
    return _Faces(r, back, t, t * t * (admittance[-1] / admittance[0]))


class _Sums(NamedTuple):
    """Sums over all round trips of r_a r_b* and t_a t_b*, where a and b are s or p."""

    r: Array
    t: Array


def _summed(a: _Faces, b: _Faces, below: _Sums | None, down: Array) -> _Sums:
    """Return the sums of a packet and of what is below it, through a thick layer.

    below: those of what is below; None of the last packet. down: what is left of intensity after
    one way through the thick layer.
    """
    r, t = a.front * jnp.conj(b.front), a.t * jnp.conj(b.t)
    if below is None:
        return _Sums(r, t)
    back = down * down * below.r
    echoes = 1.0 / (1.0 - a.back * jnp.conj(b.back) * back)
    through = a.there_and_back * jnp.conj(b.there_and_back)
    return _Sums(r + through * back * echoes, t * down * below.t * echoes)


class Incoherent(NamedTuple):
    """Powers of s and p, and the sum of r_p r_s* (complex) over all round trips."""

    R_s: Array
    R_p: Array
    T_s: Array
    T_p: Array
    product: Array


def incoherent(
    c: Array,
    eta_i: Array,
    index: Sequence[Array],
    thickness_um: Sequence[Array],
    wavelength_um: Array,
    coherent: Sequence[bool],
    normal: bool = False,
) -> Incoherent:
    """Return what a sample with thick layers reflects and transmits.

    c: cosines in a transparent medium eta_i. index: complex, of the L layers and the medium behind.
    thickness_um, coherent: of the layers, of which any number may be thick. normal: as of `films`.
    """
    for_s, for_p, phase = admittances(c, eta_i, index, thickness_um, wavelength_um)
    thick = [j + 1 for j, interferes in enumerate(coherent) if not interferes]
    polarized = (for_s,) if normal else (for_s, for_p)
    below: list[_Sums | None] = [None, None, None]  # s, p, and the product of p and s
    for start, end in reversed(list(zip([0, *thick], [*thick, len(for_s) - 1], strict=True))):
        found = [_faces(of[start : end + 1], phase[start : end - 1]) for of in polarized]
        s, p = found[0], found[-1]
        # One way leaves exp(2 Re phase); the phase itself is the same for s and p.
        down = jnp.exp(2.0 * phase[end - 1].real) if end <= len(phase) else jnp.ones(())
        ways = ((s, s),) if normal else ((s, s), (p, p), (p, s))
        below = [_summed(*way, under, down) for way, under in zip(ways, below, strict=False)]
    s2, p2, product = below * 3 if normal else below
    assert s2 is not None and p2 is not None and product is not None
    T_s, T_p = (
        sums.t.real * admittance[-1].real / admittance[0].real
        for sums, admittance in ((s2, for_s), (p2, polarized[-1]))
    )
    return Incoherent(s2.r.real, p2.r.real, T_s, T_p, product.r)
