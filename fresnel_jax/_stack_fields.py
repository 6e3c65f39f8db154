"""One pass through coherent films, from the far side to the front: their fields and amplitudes."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array

from ._arithmetic import one_if_zero
from ._compiler import computed_once
from ._complex import (
    Pair,
    choose,
    conjugate_times,
    inverse,
    minus,
    plus,
    scaled,
    square,
    squared_modulus,
    times,
)
from ._double_word import DoubleWord
from ._stack_absorption import absorbed, is_thin, power_at_near_side, thin_layer, weights
from ._stack_coherent import (
    ONE,
    ZERO,
    Ambient,
    Fields,
    Medium,
    at,
    far_fields,
    mismatches_of_layer,
    normal_squared,
    rescaled,
    through_layer,
)
from ._stack_roughness import rough_boundary
from ._stack_wave import Wave, wave

# Up to so many layers are written out; more run through one loop. For two that has 25 to 30 % fewer
# instructions, but takes as long to compile and 1.4 times as long to run (docs/stacks.md).
_UNROLLED = 2


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
    q: Pair  # of the wave, in the shape of Q^2
    u: tuple[Pair, Pair]
    down: tuple[Pair, Pair]  # (Q / g) U - W, what comes back from what lies behind
    scale: tuple[Array, Array]  # one over the size in whose units the fields behind were
    beneath: Any  # (u, w) below the boundary behind the layer, where boundaries are rough


class Ends(NamedTuple):
    """Fields at the front of the films, for s and p."""

    u: tuple[Pair, Pair]
    w: tuple[Pair, Pair]
    beneath: Any  # (u, w) below the first boundary, where it is rough


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
    rough: Any,
    shape: tuple[int, ...],
) -> tuple[Solved, Inside | None, Ends]:
    """The films between `front` and `far`; x is thickness / wavelength of the layers.

    rough: `boundary_factors` for s and p, or None.
    """

    def whole(tree):
        return jax.tree.map(lambda z: jnp.broadcast_to(z, shape), tree)

    n02 = square((front.n, front.k))
    count = x[0].shape[0]

    def step(carry, layer):
        (fields, powers), (here, x, factors) = carry, layer
        one = jnp.ones(shape, front.n.dtype)
        scale = (one, one)
        if count > _UNROLLED:
            fields, scale = rescaled(fields)
            powers = tuple(z * z * power for z, power in zip(scale, powers, strict=True))
        re, im = jax.tree.map(computed_once, normal_squared(here, front))
        inside = wave(re, im, x, squared_modulus(front.q))
        below = None
        if factors is not None:
            below = tuple(zip(fields.u, fields.w, strict=True))
            fields = whole(rough_boundary(fields, factors, front.q))
        h = mismatches_of_layer(inside.near_critical, here, front, inside.q)
        down = tuple(
            _coming_back(u, w, m, times(per_g, inside.q), times(per_g, z))
            for u, w, m, per_g, z in zip(*fields[:3], (ONE, here.per_g), h, strict=True)
        )
        losses = jnp.zeros((2, *shape), one.dtype)
        if im is not None:
            kappa, q2 = (2.0 * jnp.pi) * x[0], (re[0], im[0])
            near = is_thin(kappa, q2)
            thin = thin_layer(kappa, choose(near, q2, ZERO))
            of_both = zip(
                fields.u, fields.w, down, (ONE, here.g), (ONE, here.per_g),
                weights(im[0], here.n2, n02, front.transverse2), strict=True,
            )  # fmt: skip
            losses = tuple(
                absorbed(weight, inside, kappa, near, thin, g, per_g, u, w, back)
                for u, w, back, g, per_g, weight in of_both
            )
        passage2 = squared_modulus(inside.passage)
        if im is None:
            powers = tuple(passage2 * power for power in powers)
        elif rough is None:
            of_both = zip((ONE, here.g), (ONE, here.per_g), fields.u, fields.w, powers, strict=True)
            powers = tuple(
                power_at_near_side(inside, kappa, q2, g, per_g, u, w, power)
                for g, per_g, u, w, power in of_both
            )
        losses = tuple(
            whole((loss, passage2 * z * z)) for loss, z in zip(losses, scale, strict=True)
        )
        narrow = tuple(slice(1 if size == 1 else None) for size in re[0].shape)
        seen = Inside(whole(inside), at(narrow, inside.q), fields.u, whole(down), scale, below)
        fields = through_layer(fields, here, inside, front, h)
        if count <= _UNROLLED:  # else they stand in memory as the carry of the loop
            fields, powers = jax.tree.map(computed_once, (fields, powers))
        return whole((fields, powers)), (losses, seen)

    start = far_fields(far, front, q_far), (q_far[0], times(far.per_g, q_far)[0])
    passed = (layers, x, at(slice(1, None), rough))
    (fields, powers), seen = over_layers(step, whole(start), passed, count, reverse=True)
    below = None
    if rough is not None:
        below = tuple(zip(fields.u, fields.w, strict=True))
        fields = whole(rough_boundary(fields, at(0, rough), front.q))
    else:
        fields = _with_known_power(fields, front, powers)
    return _amplitudes(fields, front, None if seen is None else seen[0]), *(
        (None if seen is None else seen[1]),
        Ends(fields.u, fields.w, below),
    )


def _coming_back(u: Pair, w: Pair, m: Pair, z: Pair, mismatch: Pair) -> Pair:
    """Z U - W with Z = Q / g, from mismatch = Q_0 - Z: by the terms that cancel less.

    M - (Q_0 - Z) U is known where little comes back, at X-rays say. In p polarization Z and W of a
    metal of |N| = 150 are 1 / 150 of Q_0, and a derivative by N_0 was off by 5,000 eps by it.
    """
    smaller = squared_modulus(w) < squared_modulus(m)
    return choose(smaller, minus(times(z, u), w), minus(m, times(mismatch, u)))


def _with_known_power(fields: Fields, front: Ambient, powers: tuple[Array, Array]) -> Fields:
    """W and M at the front, so that Re(W conj(U)) is the power that was carried through the films.

    In a mode of the films at grazing incidence W is what remains of terms 1 / Q_0 times as large.
    The part of it that carries power is what is absorbed and transmitted, which is known to its
    last digits, and R + T + sum(A) is 1.
    """
    w_new, m_new = [], []
    for u, w, m, power in zip(fields.u, fields.w, fields.m, powers, strict=True):
        u2 = squared_modulus(u)
        small = 256.0 * power * power < u2 * u2 * jnp.abs(front.transverse2[0])
        excess = jnp.where(small, conjugate_times(u, w)[0] - power, 0.0)
        # The division comes last, so that all that follows reads it instead of forming it anew.
        wrong = excess / one_if_zero(u2)
        # What is wrong is rounding alone: the derivatives of W are not.
        w_known = minus(w, lax.stop_gradient(scaled(wrong, u)))
        q0_u = times(front.q, u)
        m_known = minus(q0_u, w_known)
        doubt2 = (8.0 * float(jnp.finfo(wrong.dtype).eps)) ** 2
        terms = squared_modulus(q0_u) + squared_modulus(w)
        differs = squared_modulus(minus(m, m_known)) > doubt2 * terms
        w_new.append(w_known)
        correction = lax.stop_gradient(minus(m_known, m))
        m_new.append(choose(small & differs, plus(m, correction), m))
    return fields._replace(w=tuple(w_new), m=tuple(m_new))


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
