"""One pass through coherent films, from the far side to the front: their fields and amplitudes."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array

from ._arithmetic import conjugate_times, one_if_zero, squared_modulus, times
from ._boundary import computed_once
from ._double_word import DoubleWord
from ._stack_absorption import absorbed, weights
from ._stack_coherent import (
    ONE,
    Ambient,
    Fields,
    Medium,
    far_fields,
    inverse,
    minus,
    mismatches,
    normal_squared,
    outgoing_root,
    plus,
    rescaled,
    square,
    through_layer,
)
from ._stack_roughness import rough_boundary
from ._stack_wave import Pair, Wave, choose, wave

_UNROLLED = 2  # up to so many layers are written out; more run through one loop


class Solved(NamedTuple):
    """What the films do to a wave of unit amplitude, each for s and p."""

    r: tuple[Pair, Pair]
    through: tuple[Pair, Pair]  # F / (Q_0 U + W)
    R: tuple[Array, Array]
    nothing: tuple[Array, Array]  # whether Q_0 U + W is 0: matched media at grazing incidence
    absorbed: Any  # power absorbed by each layer, in units of |Q_0 U + W|^2; None without layers


class Inside(NamedTuple):
    """The wave in each layer and the fields at its far side, for s and p; leading axis: layers."""

    wave: Wave
    u: tuple[Pair, Pair]
    down: tuple[Pair, Pair]  # (Q / g) U - W, what comes back from what lies behind
    scale: tuple[Array, Array]  # one over the size in whose units the fields behind were


class Ends(NamedTuple):
    """Fields at the front of the films, for s and p."""

    u: tuple[Pair, Pair]
    w: tuple[Pair, Pair]


def at(i: Any, tree: Any) -> Any:
    """The entries i of the leading axis of every array of a tree."""
    return jax.tree.map(lambda z: z[i], tree)


def over_layers(step: Any, carry: Any, layers: Any, count: int, reverse: bool) -> tuple[Any, Any]:
    """`lax.scan` over the layers, written out for few of them."""
    if count > _UNROLLED:
        return lax.scan(step, carry, layers, reverse=reverse)
    parts: list[Any] = [None] * count
    for i in reversed(range(count)) if reverse else range(count):
        carry, parts[i] = step(carry, at(i, layers))
    return carry, jax.tree.map(lambda *z: jnp.stack(z), *parts) if parts else None


def solve_fields(
    front: Ambient,
    layers: Medium,
    far: Medium,
    q_far: Pair,
    x: DoubleWord,
    shape: tuple[int, ...],
    roughness: Array | None = None,
) -> tuple[Solved, Inside | None, Ends]:
    """The films between `front` and `far`; x is thickness / wavelength of the layers."""

    def whole(tree):
        return jax.tree.map(lambda z: jnp.broadcast_to(z, shape), tree)

    n02 = square((front.n, front.k))
    count = x[0].shape[0]

    def step(carry, layer):
        fields, below = carry
        here, x, sigma = layer
        one = jnp.ones(shape, front.n.dtype)
        scale = (one, one)
        if count > _UNROLLED:
            fields, scale = rescaled(fields)
        re, im = jax.tree.map(computed_once, normal_squared(here, front))
        inside = wave(re, im, x, squared_modulus(front.q))
        if sigma is not None:
            above = (_with_slope(inside.q, re, im), here.g)
            fields = whole(rough_boundary(fields, sigma, above, below, front.q))
            below = whole(above)
        h = mismatches(here, front, inside.q)
        down = tuple(
            minus(m, times(times(per_g, z), u))
            for m, per_g, z, u in zip(fields.m, (ONE, here.per_g), h, fields.u, strict=True)
        )
        losses = jnp.zeros((2, *shape), one.dtype)
        if im is not None:
            kappa, q2 = (2.0 * jnp.pi) * x[0], (re[0], im[0])
            of_both = zip(
                fields.u, fields.w, down, (ONE, here.g), (ONE, here.per_g),
                weights(im[0], here.n2, n02, front.transverse2), strict=True,
            )  # fmt: skip
            losses = tuple(
                absorbed(weight, inside, kappa, q2, g, per_g, u, w, back)
                for u, w, back, g, per_g, weight in of_both
            )
        passage2 = squared_modulus(inside.passage)
        losses = tuple(
            whole((loss, passage2 * z * z)) for loss, z in zip(losses, scale, strict=True)
        )
        seen = Inside(whole(inside), fields.u, whole(down), scale)
        fields = through_layer(fields, here, inside, front, h)
        if count <= _UNROLLED:  # else they stand in memory as the carry of the loop
            fields = jax.tree.map(computed_once, fields)
        return (whole(fields), below), (losses, seen)

    fields = whole(far_fields(far, front, q_far))
    below = None if roughness is None else whole((q_far, far.g))
    passed = (layers, x, None if roughness is None else roughness[1:])
    (fields, below), seen = over_layers(step, (fields, below), passed, count, reverse=True)
    if roughness is not None:
        one = (jnp.ones_like(front.n), None if front.k is None else jnp.zeros_like(front.n))
        fields = whole(rough_boundary(fields, roughness[0], (front.q, one), below, front.q))
    return _amplitudes(fields, front, None if seen is None else seen[0]), *(
        (None if seen is None else seen[1]),
        Ends(fields.u, fields.w),
    )


def _with_slope(q: Pair, re: DoubleWord, im: DoubleWord | None) -> Pair:
    """Q with its derivative, which `wave` leaves out where Q is small and the matrices are even."""
    known = outgoing_root(re, im)
    same = jnp.where(q[0] * known[0] + q[1] * known[1] < 0.0, -1.0, 1.0)
    return same * known[0], same * known[1]


def _amplitudes(fields: Fields, front: Ambient, losses: Any) -> Solved:
    parts = []
    for p, (u, w, m, f) in enumerate(zip(*fields, strict=True)):
        q0_u = times(front.q, u)
        bottom = plus(q0_u, w)
        per, size = inverse(bottom), one_if_zero(squared_modulus(bottom))
        # Next to |r| = 1 the errors of Q_0 U - W are those of the bottom, and cancel; those of M do
        # not: R of a guided mode at grazing incidence (cosine 1e-6) was off by 590 eps.
        strong = squared_modulus(m) > 0.5 * size
        r = times(choose(strong, minus(q0_u, w), m), per)
        weak = squared_modulus(m) / size
        R = jnp.where(weak > 0.5, 1.0 - 4.0 * (conjugate_times(q0_u, w)[0] / size), weak)
        light = squared_modulus(per)
        lost = None if losses is None else lax.scan(_into_next, light, losses[p])[1]
        parts.append((r, times(f, per), R, light == 0.0, lost))
    return Solved(*zip(*parts, strict=True))


def _into_next(light: Array, layer: tuple[Array, Array]) -> tuple[Array, Array]:
    loss, passed = layer
    return light * passed, light * loss
