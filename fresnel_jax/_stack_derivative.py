"""How what a stack reflects and transmits changes with each of its layers.

Light that crosses the stack from the far side has the fields (u, w) of `_stack_coherent` at every
depth. The functional (a, b) of these fields, with a u + b w = Q_0 u + w at the front the same at
every depth, is carried through the stack the other way, from (Q_0, 1). With B = Q_0 u + w at the
front, zeta = k_0 times the distance from the far side of a layer and beta = Q^2 / g,

    d B = -i int (d beta  b u + d g  a w) d zeta,
    d r = (2 i Q_0 / B^2) int (d beta  u^2 - d g  w^2) d zeta,

the second since (w, -u) obeys the same law as (a, b). The integrals over a layer
are closed forms (`_stack_coefficients`).

All derivatives of R, T, r and t are sums over layers of these coefficients times the changes of
Q^2, g and thickness. A gradient, a Jacobian with any number of columns and a directional derivative
therefore cost two passes through the stack. The integrals are our own.
"""

import functools

import jax
import jax.numpy as jnp

from ._arithmetic import conjugate_times, times
from ._boundary import computed_once
from ._double_word import DoubleWord
from ._stack_absorption import weights
from ._stack_absorption_derivative import Front, absorption_derivative
from ._stack_coefficients import Change, layers_of, of_r, of_through
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
    square,
)
from ._stack_fields import Inside, Solved, over_layers, solve_fields
from ._stack_wave import Pair


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


def _in_layers(change: Change, moved: Change) -> Pair:
    """The coefficients times how much each quantity is moved, for every layer."""
    # Real and imaginary part, and every column of a Jacobian, read them in loops of their own.
    change = jax.tree.map(computed_once, change)
    terms = plus(times(change.q2, moved.q2), times(change.depth, moved.depth))
    return terms if moved.g is None else plus(terms, times(change.g, moved.g))


def _all(terms: Pair) -> Pair:
    return jnp.sum(terms[0], axis=0), jnp.sum(terms[1], axis=0)


def _lossy(front: Ambient, layers: Medium):
    """Q^2 of the layers, to working precision, and their `weights`."""
    re, im = normal_squared(layers, front)
    if im is None:
        return None
    n02 = square((front.n, front.k))
    return (re[0], im[0]), weights(im[0], layers.n2, n02, front.transverse2)


@solve.defjvp
def _solve_jvp(shape, primals, tangents):
    front, layers, far, q_far, x = primals
    d_front, d_layers, d_far, d_q_far, d_x = tangents
    solved, inside, ends = solve_fields(front, layers, far, q_far, x, shape)
    behind, at_front = _from_the_front(front, layers, inside, shape, x[0].shape[0])

    _, (d_re, d_im) = jax.jvp(normal_squared, (layers, front), (d_layers, d_front))
    d_q2 = (d_re[0], None if d_im is None else d_im[0])
    lossy, d_lossy = jax.jvp(_lossy, (front, layers), (d_front, d_layers))
    kappa, d_kappa = (2.0 * jnp.pi) * x[0], ((2.0 * jnp.pi) * d_x[0], None)
    d_z_far = (d_q_far, plus(times(far.per_g, d_q_far), times(d_far.per_g, q_far)))
    d_r, d_through, d_absorbed = [], [], []
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
        d_log_front = scaled(-1.0, times(u_per, d_front.q))
        d_log = minus(d_log_front, times(times(behind[p][1], per), d_z_far[p]))
        d_lost = None if solved.absorbed[p] is None else jnp.zeros_like(solved.absorbed[p])
        if inside is not None:
            layer = layers_of(inside.wave, g, per_g, kappa, inside.u[p], inside.down[p])
            moved = Change(d_q2, d_g, d_kappa)
            a, b, f = at_front[p]
            f_per = times(f, per)
            dr = plus(dr, _all(_in_layers(of_r(layer, times(front.q, times(f_per, f_per))), moved)))
            in_each = _in_layers(of_through(layer, a, b, per), moved)
            d_log = plus(d_log, _all(in_each))
            if lossy is not None and d_lossy is not None:
                d_lost = absorption_derivative(
                    solved.absorbed[p],
                    layer,
                    (lossy[1][p], d_lossy[1][p]),
                    (lossy[0], d_lossy[0]),
                    Front(a, b, f),
                    moved,
                    in_each,
                    d_log_front,
                    scaled(-1.0, times(times(per, per), d_z_far[p])),
                    per,
                    inside.scale[p],
                )
        d_r.append(dr)
        d_through.append(times(through, d_log))
        d_absorbed.append(d_lost)
    d_R_s, d_R_p = (2.0 * conjugate_times(*z)[0] for z in zip(solved.r, d_r, strict=True))
    constant = jnp.zeros(shape, jax.dtypes.float0)
    return solved, Solved(
        tuple(d_r), tuple(d_through), (d_R_s, d_R_p), (constant, constant), tuple(d_absorbed)
    )
