"""How what a stack reflects, transmits and absorbs changes with each of its layers.

Light that crosses the stack from the far side has the fields (u, w) of `coherent` at every
depth. The functional (a, b) of these fields, with a u + b w = Q_0 u + w at the front the same at
every depth, is carried through the stack the other way, from (Q_0, 1). With B = Q_0 u + w at the
front, zeta = k_0 times the distance from the far side of a layer and beta = Q^2 / g,

    d B = -i int (d beta  b u + d g  a w) d zeta,
    d r = (2 i Q_0 / B^2) int (d beta  u^2 - d g  w^2) d zeta,

the second since (w, -u) obeys the same law as (a, b). The integrals over a layer
are closed forms (`coefficients`).

All derivatives of R, T, r and t are sums over layers of these coefficients times the changes of
Q^2, g and thickness. A gradient, a Jacobian with any number of columns and a directional derivative
therefore cost two passes through the stack. The integrals are our own.

The power that a layer absorbs changes in three ways, of which each is its own sum here, so that
nothing cancels between them.

A change in front of the layer, or of the first medium, changes the light that comes to it: all
fields from there on change by the factor 1 + d log(1 / B).

A change behind it sends back a field that the front only reflects. That is kappa (b, -a), the same
in all layers in front of the change, but for a factor of each rough boundary, and kappa =
d r / (2 Q_0) at the front. What is absorbed changes by twice the real part of its product with the
field, integrated as the power itself is.

A change in the layer itself changes its integral over |B|^2. With the waves S = Z u + w and
D = Z u - w, of which what lies behind fixes only the ratio u / w,

    2 Z B = S (a + b Z) + E D (a - b Z),      d(D / S) = 2 u w dZ / S^2.

S is held where it is the larger part of B: when the layers behind are near a guided mode S is
small, and d log S would be large and cancel between the integral and B. That, with derivatives of
the fields as a whole in place of these sums, made 933 to 13,000 eps of error in front of guided
modes and opaque films. The formulas are our own.
"""

import functools
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array

from .._numerics.arithmetic import one_if_zero, reciprocal_or_zero
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
    squared_modulus,
    times,
)
from .._numerics.double_word import DoubleWord
from .._numerics.fences import computed_once
from .absorption import (
    Along,
    Thin,
    Weights,
    absorbed_by_waves,
    along,
    is_thin,
    of_waves,
    power_in_thin,
    product_in_thin,
    thin_layer,
    weights,
)
from .coefficients import (
    Change,
    Given,
    Layers,
    Light,
    Moved,
    gained,
    layers_of,
    of_r,
    of_through,
    sums,
)
from .coherent import (
    ONE,
    ZERO,
    Ambient,
    BoundaryChange,
    Factors,
    Inside,
    Medium,
    Solved,
    at,
    beneath,
    boundary_change,
    crossed,
    determinant,
    normal_squared,
    over_layers,
    solve_fields,
)
from .wave import kept


def _sent_back(
    layers: Layers,
    moved: Change,
    per: Pair,
    far: Pair,
    scale: Array,
    rough: tuple[Pair, Pair] | None,
) -> Pair:
    """kappa of all that changes behind each layer, over f^2 and D of all that lies in front."""
    change = of_r(layers, at(None, scaled(0.5, times(per, per))))
    # As `gained`, whose divisions would make 4 % more operations of a gradient of R and A here.
    here = plus(times(change.q2, moved.q2), times(change.depth, moved.depth))
    if moved.g is not None:
        here = plus(here, times(change.g, moved.g))

    def step(behind, layer):
        here, round_trip, scale, boundary = layer
        behind = scaled(scale * scale, behind)
        if boundary is not None:
            det, sent = boundary
            behind = plus(sent, times(det, behind))
        return plus(here, times(round_trip, behind)), behind

    inputs = (here, layers.wave.round_trip, scale, rough)
    return over_layers(step, far, inputs, scale.shape[0], reverse=True)[1]


def _product(layers: Layers, weight: Weights, inside: Along, near: Thin, front: Light) -> Pair:
    """The integral of the field's conjugate and (b, -a), both as `_sent_back` needs them."""
    zb, round_trip, V = times(layers.z, front.b), layers.wave.round_trip, inside.beating
    up, down = minus(zb, front.a), plus(zb, front.a)
    of_own, of_crossed = of_waves(weight, inside.z)
    own = plus(
        times(round_trip, conjugate_times(layers.up, up)),
        scaled(inside.intensity, conjugate_times(layers.down, down)),
    )
    crossed_over = plus(
        conjugate_times(layers.up, down),
        scaled(inside.intensity, conjugate_times(layers.down, up)),
    )
    waves = plus(
        scaled(of_own * inside.decaying, own),
        scaled(of_crossed, times(V, crossed_over)),
    )
    b, a = crossed(front.b, front.a, layers.wave, layers.g, layers.per_g)
    thin = product_in_thin(
        weight, near, layers.g, layers.per_g,
        (layers.u, layers.w), (b, scaled(-1.0, a)),
    )  # fmt: skip
    waves = scaled(0.25 * reciprocal_or_zero(squared_modulus(layers.z)), waves)
    return choose(layers.thin, scaled(inside.intensity, thin), waves)


def _moved_waves(layers: Layers, inside: Along, moved: Change) -> tuple[Pair, Pair, Along]:
    """The changes of Z, of E and of the integrals along the layer; where it is not thin."""
    a, b = layers.wave.q
    kappa, round_trip = layers.kappa, layers.wave.round_trip
    # 0 in a thin layer, in which it is not used and might overflow
    per_twice_q = times(layers.per_twice_q2, layers.wave.q)
    dq = times(choose(layers.thin, ZERO, per_twice_q), moved.q2)
    dz = times(layers.per_g, dq)
    if moved.g is not None:
        dz = minus(dz, times(times(layers.z, layers.per_g), moved.g))
    d_kappa = moved.depth[0]
    d_delta = plus(scaled(kappa, dq), scaled(d_kappa, layers.wave.q))
    d_round_trip = scaled(2.0, times((-d_delta[1], d_delta[0]), round_trip))
    d_intensity = -2.0 * inside.intensity * d_delta[1]
    per_a, per_b = reciprocal_or_zero(a), 1.0 / one_if_zero(b)
    d_decaying = jnp.where(
        b == 0.0, d_kappa, (inside.intensity * d_delta[1] - inside.decaying * dq[1]) * per_b
    )
    d_sine2 = round_trip[1] * d_delta[0] - 2.0 * layers.wave.sine2 * d_delta[1]
    beat_re = (0.5 * d_round_trip[1] - inside.beating[0] * dq[0]) * per_a
    beat_im = (d_sine2 - inside.beating[1] * dq[0]) * per_a
    return dz, d_round_trip, Along(dz, d_intensity, d_decaying, (beat_re, beat_im))


def _of_itself(
    layers: Layers,
    weight: tuple[Weights, Weights],
    inside: Along,
    near: tuple[Thin, Thin],
    front: Light,
    moved: Change,
    per: Pair,
) -> tuple[Array, Pair]:
    """What a layer's own change adds to its integral, and to log(1 / B) in a layer not thin."""

    def thin_integral(weight, near, g=layers.g):
        per_g = g if moved.g is None else inverse(g)
        return power_in_thin(weight, near, g, per_g, layers.u, layers.w)

    here, there = zip(weight, near, strict=True)
    if moved.g is not None:
        here, there = (*here, layers.g), (*there, moved.g)
    thin = jax.jvp(thin_integral, here, there)[1]

    dz, d_round_trip, d_inside = _moved_waves(layers, inside, moved)
    returned = times(layers.wave.round_trip, layers.down)
    forward = squared_modulus(layers.up) >= squared_modulus(returned)
    per_up = inverse(choose(forward, layers.up, (jnp.ones_like(returned[0]), returned[1])))
    turned = scaled(2.0, times(times(times(layers.u, layers.w), per_up), dz))
    du = times(dz, layers.u)
    d_up, d_down = choose(forward, ZERO, du), choose(forward, turned, du)
    far = jax.jvp(
        absorbed_by_waves,
        (weight[0], inside, layers.up, layers.down),
        (weight[1], d_inside, d_up, d_down),
    )[1]
    far = 0.25 * far * reciprocal_or_zero(squared_modulus(layers.z))

    zb = times(layers.z, front.b)
    d_returned = plus(times(d_round_trip, layers.down), times(layers.wave.round_trip, d_down))
    bottom = plus(times(d_up, plus(front.a, zb)), times(d_returned, minus(front.a, zb)))
    bottom = plus(bottom, times(minus(layers.up, returned), times(front.b, dz)))
    d_log = scaled(-0.5, times(times(bottom, at(None, per)), inverse(layers.z)))
    return jnp.where(layers.thin, inside.intensity * thin, far), d_log


def _before(front: Pair, layers: Pair) -> Pair:
    """The sum of what the first medium and all layers in front of each one add."""
    re, im = (
        jnp.cumsum(jnp.concatenate([x[None], z[:-1]]), axis=0)
        for x, z in zip(front, layers, strict=True)
    )
    return re, im


def absorption_derivative(
    absorbed: Array,
    layers: Layers,
    weight: tuple[Weights, Weights],
    near: tuple[Thin, Thin],
    front: Light,
    moved: Change,
    d_log: Pair,
    d_log_front: Pair,
    far: Pair,
    per: Pair,
    scale: Array,
    rough: tuple[Pair, BoundaryChange] | None,
) -> Array:
    """The change of `absorbed` in each layer, in units of |B|^2, for s or p.

    weight, near (`thin_layer`) with their changes; front is the light that comes to each layer;
    d_log is what each layer's change adds to log(1 / B), d_log_front what the first medium's does;
    far is kappa of the last medium; per is 1 / B; scale that of the fields in each layer; rough the
    determinants of the boundaries behind the layers and what their changes do, None where they are
    smooth.
    """
    inside = along(layers.wave, layers.z, layers.kappa)
    sent_back = None if rough is None else (rough[0], rough[1].sent)
    behind = _sent_back(layers, moved, per, far, scale, sent_back)
    product = _product(layers, weight[0], inside, near[0], front)
    d_integral, d_log_waves = _of_itself(layers, weight, inside, near, front, moved, per)

    # The boundary behind a layer changes the light of those behind it, but in the layer itself only
    # what is sent back: counted as the layer's own, too, it made 1e14 eps in thin rough films.
    passed_on = d_log if rough is None else plus(d_log, rough[1].log)
    own = choose(layers.thin, d_log, d_log_waves)
    light = plus(_before(d_log_front, passed_on), own)
    sent = 2.0 * conjugate_times(at(None, per), times(product, behind))[0]
    passed = squared_modulus(front.f)
    return 2.0 * absorbed * light[0] + passed * (squared_modulus(per)[None] * d_integral + sent)


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
    return thin, weights(im[0], layers.n2, layers.n2_along, n02, transverse2)


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
