"""psi and Delta of a sample with a thick layer, whose reflections add without interference.

Light that has been k times to the back face comes out with amplitudes r_p,k and r_s,k of its own. A
detector adds the Stokes vectors of all k, and so the products r_p,k r_s,k*: a layer of one index
gives s and p the same phase, which drops out of the product, and what is left is a geometric series
(R. Joerger et al., Applied Optics 36, 319, 1997). The sum is partly depolarized light.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import jax.numpy as jnp
from jax import Array

from fitting.coherent_films import admittances, amplitudes


class _Faces(NamedTuple):
    """What a packet of coherent films does to s or p: r from both sides, and t t' through it."""

    front: Array
    back: Array
    through: Array


def _faces(admittance: tuple[Array, ...], phase: tuple[Array, ...]) -> _Faces:
    r, t = amplitudes(admittance, phase)
    back = amplitudes(admittance[::-1], phase[::-1]).r
    # Reciprocity: t' = t Y_behind / Y_front of the tangential fields.
    return _Faces(r, back, t * t * (admittance[-1] / admittance[0]))


def _returned(a: _Faces, b: _Faces, below: Array | None, passage: Array) -> Array:
    """Return the sum of r_a r_b* of a packet and of what is below it, through a thick layer.

    below: that sum of what is below; None of the last packet. passage: what is left of intensity
    after the way down through the thick layer and up again.
    """
    out = a.front * jnp.conj(b.front)
    if below is None:
        return out
    back = passage * below
    return out + a.through * jnp.conj(b.through) * back / (1.0 - a.back * jnp.conj(b.back) * back)


class Incoherent(NamedTuple):
    """Sums over all round trips: of abs(r_s)^2, abs(r_p)^2, and r_p r_s* (complex)."""

    R_s: Array
    R_p: Array
    product: Array


def incoherent(
    c: Array,
    eta_i: Array,
    index: Sequence[Array],
    thickness_um: Sequence[Array],
    wavelength_um: Array,
    coherent: Sequence[bool],
) -> Incoherent:
    """Return what a sample with thick layers reflects.

    c: cosines in a transparent medium eta_i. index: complex, of the L layers and the medium behind.
    thickness_um, coherent: of the layers, of which any number may be thick.
    """
    for_s, for_p, phase = admittances(c, eta_i, index, thickness_um, wavelength_um)
    thick = [j + 1 for j, interferes in enumerate(coherent) if not interferes]
    sums: tuple[Array | None, ...] = (None, None, None)
    for start, end in reversed(list(zip([0, *thick], [*thick, len(for_s) - 1], strict=True))):
        s, p = (_faces(of[start : end + 1], phase[start : end - 1]) for of in (for_s, for_p))
        # One passage leaves exp(2 Re phase); the phase itself is the same for s and p.
        passage = jnp.exp(4.0 * phase[end - 1].real) if end <= len(phase) else jnp.ones(())
        sums = tuple(
            _returned(a, b, below, passage)
            for (a, b), below in zip(((s, s), (p, p), (p, s)), sums, strict=True)
        )
    R_s, R_p, product = sums
    assert R_s is not None and R_p is not None and product is not None
    return Incoherent(R_s.real, R_p.real, product)
