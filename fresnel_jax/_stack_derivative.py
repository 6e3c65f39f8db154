"""How what a stack reflects and transmits changes with each of its layers.

Light that crosses the stack from the far side has the fields (u, w) of `_stack_coherent` at every
depth. The functional (a, b) of these fields, with a u + b w = Q_0 u + w at the front the same at
every depth, is carried through the stack the other way, from (Q_0, 1). With B = Q_0 u + w at the
front, zeta = k_0 times the distance from the far side of a layer and beta = Q^2 / g,

    d B = -i int (d beta  b u + d g  a w) d zeta,
    d r = (2 i Q_0 / B^2) int (d beta  u^2 - d g  w^2) d zeta,

the second since (w, -u) obeys the same law as (a, b). In a layer the integrals are closed forms of
the waves S = Z u + w and D = Z u - w with Z = Q / g (and likewise of Z b + a and Z b - a). They
cancel where a layer is thin against a wavelength, or at its critical angle; there the entries of
its matrix and a series take their place, both even in Q. Nothing grows with the thickness.

All derivatives of R, T, r and t are sums over layers of these coefficients times the changes of
Q^2, g and thickness. A gradient, a Jacobian with any number of columns and a directional derivative
therefore cost two passes through the stack. The integrals are our own.
"""

import functools
import math
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from ._arithmetic import Complex, conjugate_times, squared_modulus, times
from ._boundary import computed_once
from ._double_word import DoubleWord
from ._stack_coherent import (
    ONE,
    Ambient,
    Medium,
    crossed,
    inverse,
    minus,
    normal_squared,
    plus,
    scaled,
)
from ._stack_fields import Inside, Solved, over_layers, solve_fields
from ._stack_wave import Pair, Wave, choose, polynomial, sine_derivative_series

# (1 - sin(2 z) / (2 z)) / (2 z^2) is the sum of these times z^(2 m).
_SERIES = tuple((-1.0) ** m * 2.0 * 4.0**m / math.factorial(2 * m + 3) for m in range(9))


class _Layers(NamedTuple):
    """What the coefficients of both amplitudes need of every layer, for s or p."""

    wave: Wave
    g: Complex
    per_g: Complex
    z: Pair  # Q / g
    per_twice_q2: Pair
    kappa: Array  # k_0 thickness
    thin: Array
    delta2: Pair  # (kappa Q)^2 where thin
    u: Pair
    w: Pair
    down: Pair  # Z u - w
    up: Pair  # Z u + w


class _Change(NamedTuple):
    """For Q^2, g and k_0 thickness of every layer: what an amplitude gains for a unit of each."""

    q2: Complex
    g: Any  # None: it stays as it is
    depth: Complex


def _times_i(z: Pair) -> Pair:
    return -z[1], z[0]


def _layers(wave: Wave, g: Complex, per_g: Complex, kappa: Array, u: Pair, down: Pair) -> _Layers:
    q2 = times(wave.q, wave.q)
    delta2 = scaled(kappa * kappa, q2)
    thin = squared_modulus(delta2) < 0.0625
    near = jnp.where(thin, delta2[0], 0.0), jnp.where(thin, delta2[1], 0.0)
    z = times(per_g, wave.q)
    w = minus(times(z, u), down)
    twice = scaled(0.5, inverse(q2))
    return _Layers(wave, g, per_g, z, twice, kappa, thin, near, u, w, down, plus(times(z, u), w))


def _of_r(layer: _Layers, per: Pair) -> _Change:
    """Of r; per is Q_0 / B^2 in the units of the fields of the layer."""
    sigma, round_trip, kappa = layer.wave.sine_over_q, layer.wave.round_trip, layer.kappa
    waves2 = plus(times(layer.up, layer.up), times(round_trip, times(layer.down, layer.down)))
    waves2, gain = times(sigma, waves2), times(layer.g, per)
    beat = _times_i(times(round_trip, times(layer.up, layer.down)))
    wide = times(layer.per_twice_q2, minus(scaled(2.0 * kappa, beat), waves2))

    gw = times(layer.g, layer.w)
    both = _times_i(times(sigma, layer.wave.cosine))
    cosine2 = scaled(0.5, plus(scaled(kappa, round_trip), both))
    sine2 = scaled(kappa**3, times(round_trip, polynomial(_SERIES, layer.delta2)))
    thin = minus(times(cosine2, times(layer.u, layer.u)), times(sine2, times(gw, gw)))
    thin = plus(thin, _times_i(times(times(sigma, sigma), times(layer.u, gw))))
    thin = scaled(2.0, _times_i(times(times(layer.per_g, layer.per_g), thin)))
    return _Change(
        q2=times(gain, choose(layer.thin, thin, wide)),
        g=times(per, waves2),
        depth=scaled(2.0, times(gain, beat)),
    )


def _of_through(layer: _Layers, a: Pair, b: Pair, per: Pair) -> _Change:
    """Of log(F / B); (a, b) is at the front of the layer, per is 1 / B in its units."""
    sigma, kappa, wave = layer.wave.sine_over_q, layer.kappa, layer.wave
    zb, gain = times(layer.z, b), scaled(0.5, _times_i(times(layer.g, per)))
    up, down = plus(zb, a), minus(zb, a)
    along = plus(times(up, layer.up), times(wave.round_trip, times(down, layer.down)))
    across = _times_i(times(sigma, plus(times(up, layer.down), times(down, layer.up))))
    wide = times(layer.per_twice_q2, plus(scaled(kappa, along), across))

    cosine2 = plus(scaled(kappa, wave.cosine), _times_i(sigma))
    sine2 = scaled(kappa**3, times(wave.passage, sine_derivative_series(layer.delta2)))
    crossing = plus(times(b, layer.w), times(a, layer.u))
    thin = plus(
        times(layer.per_g, times(cosine2, times(b, layer.u))),
        scaled(kappa, times(sigma, crossing)),
    )
    thin = plus(times(layer.per_g, thin), times(sine2, times(a, layer.w)))
    return _Change(
        q2=times(gain, choose(layer.thin, thin, wide)),
        g=scaled(-1.0, times(times(gain, layer.per_g), across)),
        depth=times(gain, along),
    )


def _from_the_front(front: Ambient, media: Medium, inside: Inside | None, shape, count: int):
    """((a, b, product of all f) for s and p) behind the films, and at the front of each."""
    zero, one = jnp.zeros(shape, front.n.dtype), jnp.ones(shape, front.n.dtype)
    q0 = tuple(zero if z is None else jnp.broadcast_to(z, shape) for z in front.q)

    def step(carry, layer):
        here, wave, scales = layer
        out = []
        for p, (g, per_g) in enumerate(((ONE, ONE), (here.g, here.per_g))):
            a, b, f = carry[p]
            b, a = crossed(b, a, wave, g, per_g)
            moved = tuple(scaled(scales[p], z) for z in (a, b, times(f, wave.passage)))
            out.append(jax.tree.map(computed_once, moved))
        return tuple(out), carry

    start = ((q0, (one, zero), (one, zero)),) * 2
    layers = None if inside is None else (media, inside.wave, inside.scale)
    return over_layers(step, start, layers, count, reverse=False)


@functools.partial(jax.custom_jvp, nondiff_argnums=(5,))
def solve(
    front: Ambient,
    layers: Medium,
    far: Medium,
    q_far: Pair,
    x: DoubleWord,
    shape: tuple[int, ...],
) -> Solved:
    """`solve_fields` of smooth boundaries, with the derivatives of the module's text."""
    return solve_fields(front, layers, far, q_far, x, shape)[0]


def _over_layers(change: _Change, moved: _Change) -> Pair:
    """The sum over layers of the coefficients times how much each quantity is moved."""
    # Real and imaginary part, and every column of a Jacobian, read them in loops of their own.
    change = jax.tree.map(computed_once, change)
    terms = plus(times(change.q2, moved.q2), times(change.depth, moved.depth))
    if moved.g is not None:
        terms = plus(terms, times(change.g, moved.g))
    return jnp.sum(terms[0], axis=0), jnp.sum(terms[1], axis=0)


def _absorbed(shape, front, layers, far, q_far, x):
    solved = solve_fields(front, layers, far, q_far, x, shape)[0]
    return solved.light, solved.losses


@solve.defjvp
def _solve_jvp(shape, primals, tangents):
    front, layers, far, q_far, x = primals
    d_front, d_layers, d_far, d_q_far, d_x = tangents
    solved, inside, ends = solve_fields(front, layers, far, q_far, x, shape)
    behind, at_front = _from_the_front(front, layers, inside, shape, x[0].shape[0])
    # Absorption has no such formula; all of this line is dropped where nobody asks for it.
    in_layers = functools.partial(_absorbed, shape)
    d_light, d_losses = jax.jvp(in_layers, primals, tangents)[1]

    _, (d_re, d_im) = jax.jvp(normal_squared, (layers, front), (d_layers, d_front))
    d_q2 = (d_re[0], None if d_im is None else d_im[0])
    kappa, d_kappa = (2.0 * jnp.pi) * x[0], ((2.0 * jnp.pi) * d_x[0], None)
    d_z_far = (d_q_far, plus(times(far.per_g, d_q_far), times(d_far.per_g, q_far)))
    d_r, d_through = [], []
    for p, (g, per_g, d_g) in enumerate(
        ((ONE, ONE, None), (layers.g, layers.per_g, d_layers.g)),
    ):
        through, u = solved.through[p], ends.u[p]
        per = inverse(plus(times(front.q, u), ends.w[p]))
        u_per = times(u, per)
        dr = minus(
            times(times(u_per, times(ends.w[p], per)), d_front.q),
            times(times(front.q, times(through, through)), d_z_far[p]),
        )
        dr = scaled(2.0, dr)
        d_log = plus(times(u_per, d_front.q), times(times(behind[p][1], per), d_z_far[p]))
        d_log = scaled(-1.0, d_log)
        if inside is not None:
            layer = _layers(inside.wave, g, per_g, kappa, inside.u[p], inside.down[p])
            moved = _Change(d_q2, d_g, d_kappa)
            a, b, f = at_front[p]
            f_per = times(f, per)
            of_r = _of_r(layer, times(front.q, times(f_per, f_per)))
            dr = plus(dr, _over_layers(of_r, moved))
            d_log = plus(d_log, _over_layers(_of_through(layer, a, b, per), moved))
        d_r.append(dr)
        d_through.append(times(through, d_log))
    d_R_s, d_R_p = (2.0 * conjugate_times(*z)[0] for z in zip(solved.r, d_r, strict=True))
    d_r_s, d_r_p = d_r
    d_through_s, d_through_p = d_through
    return solved, Solved(
        (d_r_s, d_r_p), (d_through_s, d_through_p), (d_R_s, d_R_p), d_light, d_losses
    )
