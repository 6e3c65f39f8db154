"""Coherent films between two half-spaces: their fields, amplitudes and powers for s and p.

Media 0 ... L + 1 of index N_j, of which 0 and L + 1 are half-spaces; K = N_0 sin(theta) is the same
in all. With Q_j^2 = N_j^2 - K^2 and g = 1 for s, g = N_j^2 / N_0^2 for p, a layer maps the
tangential fields (U, W) at its far side to those at its near side, C and sigma as in `wave`:

    U' = C U + sigma g W,        W' = C W + (Q^2 sigma / g) U.

What is reflected is M = Q_0 U - W over Q_0 U + W. Formed by that subtraction, M would lose its
digits wherever little is reflected (X-rays, index match, thick weak absorbers), so it is carried
along, in a form that subtracts nothing that agrees:

    M' = E M + sigma h ((Q / g) U + W),
                                  h_s = -(N^2 - N_0^2) / (Q + Q_0),
                                  h_p = (N^2 - N_0^2)(g Q_0^2 - K^2) / (N_0^2 (Q + g Q_0)).

It starts at the far half-space with U = 1, W = Q / g, M = h / g. The fields are divided by a power
of two in every layer, so that a mirror of a thousand layers overflows as little as one layer.
`solve_fields` is the one pass, from the far side to the front.

A rough boundary: between media i (above) and j the amplitude r is replaced by r w,
w = exp(-2 k_0^2 sigma^2 Q_i Q_j), with the factor 1 / t of the recursion unchanged. With z = Q / g
that is a factor on each of the fields,

    U' = (1 + mu) U,    mu = (w - 1) (z_i - z_j) / (2 z_i),
    W' = (1 + nu) W,    nu = (w - 1) (z_j - z_i) / (2 z_j).

A change of mu and nu changes what the stack does as one in a layer does (`derivative`): with (u, w)
below the boundary and (a, b) above it,

    d B = a u d mu + b w d nu,      d r = (2 Q_0 D / B^2) u w ((1 + nu) d mu - (1 + mu) d nu),

where D is the product of (1 + mu) (1 + nu) of all boundaries in front of this one. The formulas of
derivatives are our own.

Source of the matrices: M. Born and E. Wolf, Principles of Optics, 7th ed., sec. 1.6.2. For the
roughness of a boundary: L. Nevot and P. Croce 1980, doi:10.1051/rphysap:01980001503076100.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import lax
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
from .._numerics.double_word import (
    DoubleWord,
    difference_of_squares,
    negative,
    product_squared,
    total,
    twice_product,
)
from .._numerics.fences import computed_once
from .absorption import absorbed, is_thin, power_at_near_side, thin_layer, weights
from .wave import Wave, root, wave


class Ambient(NamedTuple):
    """The half-space that the light comes from."""

    n: Array
    k: Array | None
    q: Complex  # N_0 cos(theta)
    q2: tuple[DoubleWord, DoubleWord | None]  # its square
    transverse2: Complex  # K^2


class Axis(NamedTuple):
    """A uniaxial medium as p sees it: g^2 Q_0^2 - Q^2, and N_e^2."""

    gap: Complex
    n2: Complex


class Medium(NamedTuple):
    """What a layer or half-space of index N is beside the ambient of index N_0."""

    contrast: tuple[DoubleWord, DoubleWord | None]  # N^2 - N_0^2
    n2: Complex  # N^2
    g: Complex  # N^2 / N_0^2
    per_g: Complex  # N_0^2 / N^2
    q2: Any = None  # Q^2, if it is not to be formed from the contrast and Q_0^2
    axis: Any = None  # `Axis` of a uniaxial medium in the pass of p; n2 and g are the ordinary ones

    @property
    def n2_along(self) -> Complex:
        """N^2 for the field along the normal."""
        return self.n2 if self.axis is None else self.axis.n2


ONE: Any = (1.0, None)  # g of s
ZERO: Any = (0.0, 0.0)


class Fields(NamedTuple):
    """U, W, M and the product of all f, each for s and p, in units of a power of two."""

    u: tuple[Pair, Pair]
    w: tuple[Pair, Pair]
    m: tuple[Pair, Pair]
    f: tuple[Pair, Pair]


def at(i: Any, tree: Any) -> Any:
    """The entries i of the leading axis of every array of a tree; None: a new leading axis."""
    return jax.tree.map(lambda z: z[i], tree)


def ambient(c: Array, n: Array, k: Array | None) -> Ambient:
    s2 = (1.0 - c) * (1.0 + c)
    nc = product_squared(n, c)
    if k is None:
        return Ambient(n, None, (n * c, None), (nc, None), (n * n * s2, None))
    kc = product_squared(k, c)
    cross = twice_product(n * c, k * c)
    n2 = square((n, k))
    return Ambient(n, k, (n * c, k * c), (total(nc, negative(kc)), cross), scaled(s2, n2))


def medium(n: Array, k: Array | None, n0: Array, k0: Array | None) -> Medium:
    """Media on the leading axis beside the ambient, whose index has no such axis."""
    re, im = difference_of_squares(n, n0[None]), None
    if k is not None:
        k_front = jnp.zeros_like(k) if k0 is None else k0[None]
        re = total(re, negative(difference_of_squares(k, k_front)))
        im = twice_product(n, k)
        if k0 is not None:
            im = total(im, negative(at(None, twice_product(n0, k0))))
    n2, n02 = square((n, k)), square((n0, k0))
    return Medium(
        (re, im), n2, times(n2, at(None, inverse(n02))), times(at(None, n02), inverse(n2))
    )


def normal_squared(here: Medium, front: Ambient) -> tuple[DoubleWord, DoubleWord | None]:
    """Q^2 of a medium, (N^2 - N_0^2) + Q_0^2: exact for matched media, and at grazing incidence."""
    if here.q2 is not None:
        return here.q2
    (d_re, d_im), (a_re, a_im) = here.contrast, front.q2
    if d_im is None or a_im is None:
        im = d_im if a_im is None else a_im
    else:
        im = total(d_im, a_im)
    return total(d_re, a_re), im


def mismatches(here: Medium, front: Ambient, q: Pair) -> tuple[Pair, Pair]:
    """h_s = Q_0 - Q and h_p = g Q_0 - Q, without the subtraction.

    But behind an absorbing medium Im Q >= 0 may be the wave that runs backward. Where the two have
    opposite signs, subtracting loses nothing, and the sums below would cancel: next to Brewster's
    angle R_p was 1,355 eps off.
    """
    contrast = (here.contrast[0][0], None if here.contrast[1] is None else here.contrast[1][0])
    n02 = square((front.n, front.k))
    y = minus(times(here.g, square(front.q)), front.transverse2)

    def quotients(q_s: Pair, q_p: Pair) -> tuple[Pair, Pair]:
        h_s = times(scaled(-1.0, contrast), inverse(plus(q_s, front.q)))
        if here.axis is not None:
            return h_s, times(here.axis.gap, inverse(plus(q_p, times(here.g, front.q))))
        below = plus(times(n02, q_p), times(here.n2, front.q))
        return h_s, times(times(contrast, y), inverse(below))

    if front.k is None:
        return quotients(q, q)
    firsts = pair(front.q), times(here.g, front.q)
    backward = [z[0] * q[0] + z[1] * q[1] < 0.0 for z in firsts]
    # The sign of Q is turned where the quotient is not taken: its derivative must be finite, too.
    h = quotients(*(choose(z, scaled(-1.0, q), q) for z in backward))
    h_s, h_p = (choose(b, minus(z, q), x) for b, z, x in zip(backward, firsts, h, strict=True))
    return h_s, h_p


@jax.custom_jvp
def mismatches_of_layer(near: Array, here: Medium, front: Ambient, q: Pair) -> tuple[Pair, Pair]:
    """`mismatches`; near the layer's critical angle with the derivatives of Q_0 - Q and g Q_0 - Q,
    in which that of Q is left out as in `wave`."""
    return mismatches(here, front, q)


@mismatches_of_layer.defjvp
def _mismatches_of_layer_jvp(primals, tangents):
    near, here, front, q = primals
    _, d_here, d_front, dq = tangents
    h, far = jax.jvp(mismatches, (here, front, q), (d_here, d_front, dq))
    gained = plus(times(d_here.g, front.q), times(here.g, d_front.q))
    close = minus(d_front.q, dq), minus(gained, dq)
    return h, (choose(near, close[0], far[0]), choose(near, close[1], far[1]))


@jax.custom_jvp
def _deviation(near, m, up, wave_e, step, u_new, w_new, q0):
    """M' of one layer; near the layer's critical angle its derivative is that of Q_0 U' - W'."""
    return plus(times(wave_e, m), times(step, up))


@_deviation.defjvp
def _deviation_jvp(primals, tangents):
    near, m, up, wave_e, step, u_new, _, q0 = primals
    _, dm, d_up, dwave_e, dstep, du_new, dw_new, dq0 = tangents
    far = plus(
        plus(times(dwave_e, m), times(wave_e, dm)), plus(times(dstep, up), times(step, d_up))
    )
    close = minus(plus(times(q0, du_new), times(dq0, u_new)), dw_new)
    return plus(times(wave_e, m), times(step, up)), choose(near, close, far)


def _power_of_two_below(x: Array) -> Array:
    """1 / 2^e with 2^e <= x < 2^(e + 1), by the bits of the float; x > 0."""
    bits, field = (jnp.int64, 0x7FF) if x.dtype == jnp.float64 else (jnp.int32, 0xFF)
    shift = 52 if bits == jnp.int64 else 23
    exponent = lax.bitcast_convert_type(lax.stop_gradient(x), bits) & bits(field << shift)
    exponent = jnp.clip(exponent, bits(1 << shift), bits((field - 2) << shift))
    return lax.bitcast_convert_type(bits((field - 1) << shift) - exponent, x.dtype)


def rescaled(fields: Fields) -> tuple[Fields, tuple[Array, Array]]:
    """The fields divided by a power of two near their size, and one over it, for s and p.

    Only of fields that stand in memory, as the carry of a loop does: XLA computes a scale once for
    every array that needs it, and rounding differently next to a power of two it gave different
    scales, hence fields wrong by a factor of 2.
    """
    scales = tuple(
        _power_of_two_below(
            jnp.maximum(
                jnp.maximum(jnp.abs(u[0]), jnp.abs(u[1])), jnp.maximum(jnp.abs(w[0]), jnp.abs(w[1]))
            )
        )
        for u, w in zip(fields.u, fields.w, strict=True)
    )
    s, p = scales
    return Fields(*((scaled(s, z_s), scaled(p, z_p)) for z_s, z_p in fields)), (s, p)


def crossed(u: Pair, w: Pair, layer: Wave, g: Complex, per_g: Complex) -> tuple[Pair, Pair]:
    """The fields (U, W) at the other side of a layer; g and 1 / g are 1 for s."""
    over_q, q_sine = times(g, layer.sine_over_q), times(per_g, layer.q_sine)
    return plus(times(layer.cosine, u), times(over_q, w)), plus(
        times(layer.cosine, w), times(q_sine, u)
    )


@jax.custom_jvp
def _crossed_by_sum(u, w, up, round_trip, half, over_q, cosine, q_sine):
    """`crossed` by S = Z U + W: U' = E U + sigma g S and W' = E W + Q sigma S.

    Both have one rounding of S. Behind an absorbing medium the wave of Im Q >= 0 may run backward;
    then S nearly cancels, and by W and U apart r was 580 eps off. The derivative is that of
    `crossed`, in which no dQ occurs.
    """
    return plus(times(round_trip, u), times(over_q, up)), plus(
        times(round_trip, w), times(half, up)
    )


@_crossed_by_sum.defjvp
def _crossed_by_sum_jvp(primals, tangents):
    u, w, _, _, _, over_q, cosine, q_sine = primals
    du, dw, _, _, _, d_over_q, d_cosine, d_q_sine = tangents

    def moved(z, dz, slope, factor, d_factor):
        return plus(
            plus(times(d_cosine, z), times(cosine, dz)),
            plus(times(d_factor, slope[0]), times(factor, slope[1])),
        )

    return _crossed_by_sum(*primals), (
        moved(u, du, (w, dw), over_q, d_over_q), moved(w, dw, (u, du), q_sine, d_q_sine)
    )  # fmt: skip


def through_layer(
    fields: Fields, here: Medium, layer: Wave, front: Ambient, h: tuple[Pair, Pair], up: Any
) -> Fields:
    """The fields at the near side of a layer from those at its far side, where Z U + W is `up`."""
    q0 = pair(front.q)
    out = []
    for p, (g, per_g) in enumerate(((ONE, ONE), (here.g, here.per_g))):
        u, w, m, f = (z[p] for z in fields)
        u_new, w_new = _crossed_by_sum(
            u, w, up[p], layer.round_trip, times(layer.q, layer.sine_over_q),
            times(g, layer.sine_over_q), layer.cosine, times(per_g, layer.q_sine),
        )  # fmt: skip
        m_new = _deviation(
            layer.near_critical, m, up[p], layer.round_trip, times(layer.sine_over_q, h[p]),
            u_new, w_new, q0,
        )  # fmt: skip
        out.append((u_new, w_new, m_new, times(f, layer.passage)))
    return Fields(*zip(*out, strict=True))


@jax.custom_jvp
def decaying_root(re: DoubleWord, im: DoubleWord | None) -> Pair:
    """Q with Im Q >= 0, as in `wave`; derivative 0 at Q = 0."""
    (a, _), (b, _) = root(re, im)
    return a, b


@decaying_root.defjvp
def _decaying_root_jvp(primals, tangents):
    q = decaying_root(*primals)
    (d_re, _), d_im = tangents
    return q, scaled(0.5, times(inverse(q), (d_re, None if d_im is None else d_im[0])))


def outgoing_root(re: DoubleWord, im: DoubleWord | None) -> Pair:
    """Q of the wave that leaves through a half-space: Re Q + Im Q >= 0."""
    a, b = decaying_root(re, im)
    backward = a + b < 0.0
    return jnp.where(backward, -a, a), jnp.where(backward, -b, b)


def far_fields(here: Medium, front: Ambient, q: Pair) -> Fields:
    """The fields of the wave that leaves through the far half-space, with its Q."""
    h_s, h_p = mismatches(here, front, q)
    one = (jnp.ones_like(q[0]), jnp.zeros_like(q[0]))
    return Fields(
        u=(one, one),
        w=(q, times(here.per_g, q)),
        m=(h_s, times(here.per_g, h_p)),
        f=(one, one),
    )


def normal_flux(q: Complex, n2: Complex) -> tuple[Array, Array]:
    """Re Q and Re(Q / N^2): power along the normal of a wave of unit E_s, or unit H_p."""
    p = q[0] * n2[0]
    if q[1] is not None and n2[1] is not None:
        p = p + q[1] * n2[1]
    return q[0], p * reciprocal_or_zero(squared_modulus(n2))


def _exponential_slope(z: Complex) -> Pair:
    """(exp(z) - 1) / z."""
    re, im = pair(z)
    small = re * re + im * im < 0.0625
    near = (jnp.where(small, re, 0.0), jnp.where(small, im, 0.0))
    series = (jnp.ones_like(re), jnp.zeros_like(re))
    for k in range(12, 1, -1):
        series = plus((jnp.ones_like(re), jnp.zeros_like(re)), scaled(1.0 / k, times(series, near)))
    far = (jnp.where(small, 1.0, re), jnp.where(small, 0.0, im))
    size = jnp.exp(far[0])
    difference = (size * jnp.cos(far[1]) - 1.0, size * jnp.sin(far[1]))
    per = 1.0 / one_if_zero(squared_modulus(far))
    return choose(small, series, times(difference, (far[0] * per, -far[1] * per)))


class Factors(NamedTuple):
    """What boundaries add to U and to W, as fractions of them; for s or p."""

    mu: Pair
    nu: Pair


class BoundaryChange(NamedTuple):
    """What the changes of a boundary's factors do, in units of the fields beside it."""

    log: Pair  # to log(1 / B)
    sent: Pair  # to r, over 2 Q_0 D and f^2 of all layers in front


def boundary_factors(waves_per_roughness: Array, q: Pair, g: Pair) -> tuple[Factors, Factors]:
    """For s and p, of the L + 1 boundaries between L + 2 media of Q and g (of p)."""
    (q_i, q_j), (g_i, g_j) = ((at(slice(-1), z), at(slice(1, None), z)) for z in (q, g))
    tau = (2.0 * jnp.pi * waves_per_roughness) ** 2
    slope = scaled(-tau, _exponential_slope(scaled(-2.0 * tau, times(q_i, q_j))))
    steps = times(slope, q_j), times(slope, q_i)  # (w - 1) / (2 Q)
    s = minus(q_i, q_j)
    p = minus(times(q_i, inverse(g_i)), times(q_j, inverse(g_j)))
    return (
        Factors(times(steps[0], s), scaled(-1.0, times(steps[1], s))),
        Factors(times(times(steps[0], g_i), p), scaled(-1.0, times(times(steps[1], g_j), p))),
    )


def rough_boundary(fields: Fields, factors: tuple[Factors, Factors], q0: Complex) -> Fields:
    """The fields above the boundary from those below."""
    out = []
    for p, (mu, nu) in enumerate(factors):
        u, w, m, f = (z[p] for z in fields)
        du, dw = times(mu, u), times(nu, w)
        out.append((plus(u, du), plus(w, dw), plus(m, minus(times(q0, du), dw)), f))
    return Fields(*zip(*out, strict=True))


def beneath(factors: Factors, a: Pair, b: Pair, det: Pair) -> tuple[Pair, Pair, Pair]:
    """(a, b) and D below a boundary from those above."""
    mu, nu = factors
    det = plus(det, times(mu, det))
    return plus(a, times(mu, a)), plus(b, times(nu, b)), plus(det, times(nu, det))


def determinant(factors: Factors) -> Pair:
    """(1 + mu) (1 + nu)."""
    mu, nu = factors
    product = plus(plus(mu, nu), times(mu, nu))
    return 1.0 + product[0], product[1]


def boundary_change(
    factors: Factors, moved: Factors, above: tuple[Pair, Pair], below: tuple[Pair, Pair], per: Pair
) -> BoundaryChange:
    """above: (a, b); below: (u, w); per: 1 / B."""
    (a, b), (u, w) = above, below
    d_mu, d_nu = moved
    log = plus(times(times(a, u), d_mu), times(times(b, w), d_nu))
    sent = minus(plus(d_mu, times(factors.nu, d_mu)), plus(d_nu, times(factors.mu, d_nu)))
    u_w = times(times(u, per), times(w, per))
    return BoundaryChange(scaled(-1.0, times(log, per)), times(u_w, sent))


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
        up = tuple(
            plus(times(times(per_g, inside.q), u), w)
            for u, w, per_g in zip(fields.u, fields.w, (ONE, here.per_g), strict=True)
        )
        up = jax.tree.map(computed_once, up)  # one rounding of Z U + W for all that read it
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
                fields.u, fields.w, up, down, (ONE, here.g), (ONE, here.per_g),
                weights(im[0], here.n2, here.n2_along, n02, front.transverse2), strict=True,
            )  # fmt: skip
            losses = tuple(
                absorbed(weight, inside, kappa, near, thin, g, per_g, u, w, ahead, back)
                for u, w, ahead, back, g, per_g, weight in of_both
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
        fields = through_layer(fields, here, inside, front, h, up)
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
