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
from typing import Any

import jax
import jax.numpy as jnp

from .._numerics.complex import (
    Complex,
    Pair,
    choose,
    conjugate_times,
    inverse,
    minus,
    pair,
    plus,
    scaled,
    square,
    times,
)
from .._numerics.double_word import DoubleWord
from .._numerics.fences import computed_once
from .absorption import is_thin, thin_layer, weights
from .absorption_derivative import absorption_derivative
from .coefficients import Change, Light, gained, layers_of, of_r, of_through
from .coherent import ONE, ZERO, Ambient, Medium, at, crossed, normal_squared
from .fields import Inside, Solved, over_layers, solve_fields
from .roughness import Factors, beneath, boundary_change, determinant
from .sums import Given, Moved, sums
from .wave import kept


def _below(factors: Factors | None, light: Light) -> Light:
    """Below a boundary, from above it."""
    if factors is None:
        return light
    a, b, det = beneath(factors, light.a, light.b, light.det)
    return Light(a, b, light.f, det)


def _from_the_front(
    front: Ambient, media: Medium, inside: Inside | None, rough: Any, shape: Any, count: int
) -> tuple[Any, Any, Any]:
    """`Light` for s and p: behind the films; at the front of each; above the boundary behind it."""
    zero, one = jnp.zeros(shape, front.n.dtype), jnp.ones(shape, front.n.dtype)
    q0 = (front.q[0] + zero, zero if front.q[1] is None else front.q[1] + zero)

    def step(carry, layer):
        here, wave, scales, factors = layer
        out, above = [], []
        for p, (g, per_g) in enumerate(((ONE, ONE), (here.g, here.per_g))):
            a, b, f, det = carry[p]
            b, a = crossed(b, a, wave, g, per_g)
            above.append(Light(a, b, times(f, wave.passage), det))
            light = _below(None if factors is None else factors[p], above[p])
            a, b, f = (scaled(scales[p], z) for z in light[:3])
            out.append(jax.tree.map(computed_once, Light(a, b, f, light.det)))
        return tuple(out), (carry, None if factors is None else tuple(above))

    start = Light(q0, (one, zero), (one, zero), None if rough is None else (one, zero))
    first = tuple(_below(None if rough is None else at(0, rough[p]), start) for p in range(2))
    factors = at(slice(1, None), rough)
    layers = None if inside is None else (media, inside.wave, inside.scale, factors)
    behind, seen = over_layers(step, first, layers, count, reverse=False)
    at_front, above = (None, None) if seen is None else seen
    return behind, at_front, above


@functools.partial(jax.custom_jvp, nondiff_argnums=(6,))
def solve(
    front: Ambient,
    layers: Medium,
    far: Medium,
    q_far: Pair,
    x: DoubleWord,
    rough: Any,
    shape: tuple[int, ...],
) -> Solved:
    """`solve_fields`, with the derivatives of the module's text."""
    return solve_fields(front, layers, far, q_far, x, rough, shape)[0]


def _with_det(light: Light, z: Complex) -> Complex:
    return z if light.det is None else times(light.det, z)


def _all(terms: Pair) -> Pair:
    return jnp.sum(terms[0], axis=0), jnp.sum(terms[1], axis=0)


def _lossy(front: Ambient, layers: Medium, x: DoubleWord):
    """`thin_layer` of the layers, and their `weights`."""
    re, im = normal_squared(layers, at(None, front))
    if im is None:
        return None
    n02, transverse2 = at(None, (square((front.n, front.k)), front.transverse2))
    q2, kappa = (re[0], im[0]), (2.0 * jnp.pi) * x[0]
    thin = thin_layer(kappa, choose(is_thin(kappa, q2), q2, ZERO))
    return thin, weights(im[0], layers.n2, n02, transverse2)


@solve.defjvp
def _solve_jvp(shape, primals, tangents):
    front, layers, far, q_far, x, rough = primals
    d_front, d_layers, d_far, d_q_far, d_x, d_rough = tangents
    solved, inside, ends = solve_fields(front, layers, far, q_far, x, rough, shape)
    behind, at_front, above = _from_the_front(front, layers, inside, rough, shape, x[0].shape[0])

    around, d_around = at(None, front), at(None, d_front)
    (re, im), (d_re, d_im) = jax.jvp(normal_squared, (layers, around), (d_layers, d_around))
    d_q2 = (d_re[0], None if d_im is None else d_im[0])
    q2 = pair((re[0], None if im is None else im[0]))
    lossy, d_lossy = jax.jvp(_lossy, (front, layers, x), (d_front, d_layers, d_x))
    kappa, d_kappa = (2.0 * jnp.pi) * x[0], ((2.0 * jnp.pi) * d_x[0], None)
    d_z_far = (d_q_far, plus(times(far.per_g, d_q_far), times(d_far.per_g, q_far)))
    d_r, d_through, d_absorbed = [], [], []
    per_s, per_p = (
        inverse(plus(times(front.q, u), w)) for u, w in zip(ends.u, ends.w, strict=True)
    )
    of_all: Any = None
    if inside is not None and rough is None:
        given = Given(
            q0=front.q,
            per=(per_s, per_p),
            wave=kept(inside.wave, inside.q),
            u=inside.u,
            down=inside.down,
            scale=inside.scale,
            q2=q2,
            g=layers.g,
            per_g=layers.per_g,
            kappa=kappa,
        )
        of_all = sums(given, Moved(Change(d_q2, d_layers.g, d_kappa), d_z_far), shape)
    for p, (g, per_g, d_g, per) in enumerate(
        ((ONE, ONE, None, per_s), (layers.g, layers.per_g, d_layers.g, per_p)),
    ):
        through, u = solved.through[p], ends.u[p]
        u_per = times(u, per)
        dr = minus(
            times(times(u_per, times(ends.w[p], per)), d_front.q),
            times(_with_det(behind[p], times(front.q, times(through, through))), d_z_far[p]),
        )
        d_log_front, boundaries = scaled(-1.0, times(u_per, d_front.q)), None
        if rough is not None:
            start = (front.q, (jnp.ones_like(u[0]), jnp.zeros_like(u[0])))
            outer = boundary_change(at(0, rough[p]), at(0, d_rough[p]), start, ends.beneath[p], per)
            dr = plus(dr, times(front.q, outer.sent))
            d_log_front = plus(d_log_front, outer.log)
        dr = scaled(2.0, dr)
        if of_all is not None:
            dr, d_log = plus(dr, of_all[p][0]), plus(d_log_front, of_all[p][1])
        else:
            d_log = minus(d_log_front, times(times(behind[p].b, per), d_z_far[p]))
        d_lost = None if solved.absorbed[p] is None else jnp.zeros_like(solved.absorbed[p])
        if inside is not None:
            layer = layers_of(inside.wave, q2, g, per_g, kappa, inside.u[p], inside.down[p])
            q0_layers, per_layers = at(None, (front.q, per))
            moved = Change(d_q2, d_g, d_kappa)
            light = at_front[p]
            if of_all is None:
                f_per = times(light.f, per_layers)
                q0_f2 = times(q0_layers, times(f_per, f_per))
                dr = plus(dr, _all(gained(of_r(layer, _with_det(light, q0_f2)), moved)))
            in_each = gained(of_through(layer, light.a, light.b, per_layers), moved)
            if rough is not None:
                here, there = (at(slice(1, None), z[p]) for z in (rough, d_rough))
                a, b, f, _ = above[p]
                inner = boundary_change(here, there, (a, b), inside.beneath[p], per_layers)
                q0_f2 = scaled(2.0, times(q0_layers, times(f, f)))
                dr = plus(dr, _all(times(_with_det(above[p], q0_f2), inner.sent)))
                d_log, boundaries = plus(d_log, _all(inner.log)), (determinant(here), inner)
            if of_all is None:
                d_log = plus(d_log, _all(in_each))
            if lossy is not None and d_lossy is not None:
                d_lost = absorption_derivative(
                    solved.absorbed[p],
                    layer,
                    (lossy[1][p], d_lossy[1][p]),
                    (lossy[0], d_lossy[0]),
                    light,
                    moved,
                    in_each,
                    d_log_front,
                    scaled(-1.0, times(times(per, per), d_z_far[p])),
                    per,
                    inside.scale[p],
                    boundaries,
                )
        d_r.append(dr)
        d_through.append(times(through, d_log))
        d_absorbed.append(d_lost)
    d_R_s, d_R_p = (2.0 * conjugate_times(*z)[0] for z in zip(solved.r, d_r, strict=True))
    constant = jnp.zeros(shape, jax.dtypes.float0)
    return solved, Solved(
        tuple(d_r), tuple(d_through), (d_R_s, d_R_p), (constant, constant), tuple(d_absorbed)
    )
