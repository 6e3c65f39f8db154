"""Uniaxial media with the optical axis along the normal of the layers: indices N_o and N_e.

The field of s-polarized light is ordinary: it sees N_o. That of p has a part along the axis; its
tangential fields obey the law of an isotropic layer in `coherent` with g = N_o^2 / N_0^2 and

    Q_p^2 = N_o^2 (1 - K^2 / N_e^2).

It is formed as Q_s^2 + K^2 (N_e^2 - N_o^2) / N_e^2 where the indices are alike, else as
N_o^2 - N_o^2 K^2 / N_e^2, each with an exact first term: of the second one, the smaller of the two,
rounding changes Q_p^2 as little as rounding of the indices does. The mismatch h_p is
(g^2 Q_0^2 - Q_p^2) / (Q_p + g Q_0), in which nothing is subtracted but at Brewster's angle:

    g^2 Q_0^2 - Q_p^2 = g ((N_o^2 - N_0^2) Q_0^2 / N_0^2 - (N_e^2 - N_0^2) K^2 / N_e^2).

The layer absorbs -Im(K^2 / N_e^2) |U|^2 by the field along the axis and Im(N_o^2) |W|^2 / |N_0|^4
across it. Nothing else changes, also in the derivatives: the same pass through the layers is done
with Q of s and with Q of p. Where one of N_o^2 and N_e^2 is negative, Re Q of the wave that carries
power away through the last medium may be, too: it is N_o / N_e times the outgoing root of
N_e^2 - K^2, and not always that of Q_p^2.

Source: R. M. A. Azzam and N. M. Bashara, Ellipsometry and Polarized Light, 1977, sec. 4.7.3.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from .._numerics.complex import (
    Complex,
    Pair,
    inverse,
    minus,
    pair,
    scaled,
    square,
    squared_modulus,
    times,
)
from .._numerics.double_word import DoubleWord, difference_of_squares, total, twice_product
from .._numerics.index import IndexLike
from .coherent import Ambient, Axis, Medium, at, medium, normal_squared, outgoing_root


class Uniaxial(NamedTuple):
    """A uniaxial medium with its optical axis along the normal, an entry of the media of `stack`.

    Columns, chains and sheets that grow along the normal or lie flat, spun polymers, smectic and
    homeotropic liquid crystals, c-cut crystals. An axis that is tilted, or lies in the surface,
    makes p of s, for which `stack` has no formula; pyElli has.

    Args:
        ordinary: index eta + ik of fields across the axis, in the plane of the layer: real,
            complex or an `Index`, of the domain of `stack`; s-polarized light sees it alone.
        extraordinary: likewise, of fields along the axis. Both equal: an isotropic medium.
    """

    ordinary: IndexLike
    extraordinary: IndexLike


class Extraordinary(NamedTuple):
    """N_e of all media of a packet; that of isotropic ones is N_o."""

    n: Array
    k: Array | None


def split(index: Any) -> tuple[Any, list[Any] | None]:
    """The media with ordinary indices alone, and the extraordinary index of each or None."""
    if isinstance(index, Uniaxial):
        raise ValueError(
            "index is a Uniaxial medium; a list of media is wanted, of which each but the first "
            "may be one: [1.0, Uniaxial(1.5, 1.6), 3.88]"
        )
    if not isinstance(index, list | tuple) or not any(isinstance(n, Uniaxial) for n in index):
        return index, None
    if isinstance(index[0], Uniaxial):
        raise ValueError(
            "the first medium of index is Uniaxial, in which s and p have no common angle of "
            "incidence; an isotropic medium is wanted there"
        )
    parts = [n if isinstance(n, Uniaxial) else (n, None) for n in index]
    return [ordinary for ordinary, _ in parts], [extraordinary for _, extraordinary in parts]


def medium_of_p(
    ordinary: Medium, front: Ambient, n: Array, k: Array | None, e: Extraordinary
) -> tuple[Medium, Pair]:
    """The media behind `front` as p sees them, and Q of the wave that leaves through the last.

    n + ik are the ordinary indices, on the leading axis as those of e; the first is of `front`.
    """
    k_o, k_e = (None, None) if k is None or e.k is None else (k[1:], e.k[1:])
    extraordinary, around = medium(e.n[1:], k_e, front.n, front.k), at(None, front)
    along = times(around.transverse2, inverse(extraordinary.n2))
    n2 = difference_of_squares(n[1:], jnp.zeros_like(n[1:]) if k_o is None else k_o)
    axial = scaled(-1.0, times(ordinary.n2, along))
    q2 = _plus((n2, None if k_o is None else twice_product(n[1:], k_o)), axial)
    beside = at(0, medium(e.n[None, 1:], at(None, k_e), n[1:], k_o))
    birefringence = _high(beside.contrast)
    close = squared_modulus(birefringence) < squared_modulus(ordinary.n2)
    nearly_isotropic = _plus(normal_squared(ordinary, around), times(along, birefringence))
    q2 = jax.tree.map(lambda a, b: jnp.where(close, a, b), nearly_isotropic, q2)
    ratio = times(at(-1, (n, k)), inverse(at(-1, (e.n, e.k))))
    across = times(square(around.q), inverse(square((around.n, around.k))))
    gap = minus(
        times(_high(ordinary.contrast), across), times(_high(extraordinary.contrast), along)
    )
    seen = ordinary._replace(
        # For s, which nothing reads, that of a medium with this Q: the pass stays finite.
        contrast=_plus(q2, scaled(-1.0, _high(around.q2))),
        q2=q2,
        axis=Axis(times(ordinary.g, gap), extraordinary.n2),
    )
    q_far = outgoing_root(*normal_squared(at(-1, extraordinary), front))
    return seen, pair(times(ratio, q_far))


def _plus(z: tuple[DoubleWord, DoubleWord | None], w: Complex) -> Any:
    parts = (None if y is None else (y, jnp.zeros_like(y)) for y in w)
    return tuple(
        x if y is None else y if x is None else total(x, y) for x, y in zip(z, parts, strict=True)
    )


def _high(z: tuple[DoubleWord, DoubleWord | None]) -> Complex:
    return z[0][0], None if z[1] is None else z[1][0]
