"""Bruggeman's permittivity: the root of sum_j f_j (eps_j - eps) / (L eps_j + (1 - L) eps).

L is the depolarization factor of the grains; the code has own = 3 L and rest = 3 - own, which are
exactly 1 and 2 for spheres. In closed form for two constituents, by iteration for more. See
`effective_medium`.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jaxtyping import Array

# Of three or more constituents Bruggeman's equation is solved by iteration (see `_several`): up to
# so many steps at once; else so many from constituents of one phase, then two for each of so many
# stages in which the phases open; and never more than that.
_STEPS, _ALIKE, _OPENING, _MOST_STEPS = 16, 16, 8, 400
# A root is found when Newton's step is so many eps of it, and lost if it ends with a larger part.
_CONVERGED, _LOST = 64.0, 1e-3


def mixed(
    permittivity: Array, fraction: Array, around: Array, own: Array | float = 1.0
) -> tuple[Array, Array]:
    """The mixture of grains in a medium `around` and q_j: a grain's field over the mean one.

    With u_j = 1 / (L eps_j + (1 - L) around) and B = sum f_j u_j the mixture is
    sum f_j eps_j u_j / B, and q_j = u_j / B.
    """
    fraction = fraction.astype(permittivity.dtype)
    own = jnp.broadcast_to(jnp.asarray(own, permittivity.dtype), around.shape)[None]
    u = 1.0 / (own * permittivity + (3.0 - own) * around[None])
    q = u / (fraction * u).sum(0, keepdims=True)
    return (fraction * permittivity * q).sum(0), q


def _squared(z: Array) -> Array:
    return z.real * z.real + z.imag * z.imag


def loss_of(permittivity: Array, fraction: Array, q: Array) -> tuple[Array, Array]:
    """(D, V): L Im eps = L D + (1 - L) Im(around) V, two sums of positive terms.

    L eps + (1 - L) around is the harmonic mean of L eps_j + (1 - L) around; its imaginary part is
    the sum of f_j |q_j|^2 Im(L eps_j + (1 - L) around), and sum f_j |q_j|^2 - 1 =
    sum f_j |q_j - 1|^2 since sum f_j q_j = 1.
    """
    dissipated = (fraction * _squared(q) * permittivity.imag).sum(0)
    return dissipated, (fraction * _squared(q - 1.0)).sum(0)


def with_loss(permittivity: Array, loss: Array) -> Array:
    """Return the permittivity with another imaginary part."""
    return jax.lax.complex(permittivity.real, loss)


def _two(permittivity: Array, fraction: Array, own: Array) -> Array:
    """Bruggeman's root for two constituents, in units of w = sqrt(eps_0) sqrt(eps_1).

    rest z^2 - b z - own = 0 with b = c_0 sqrt(eps_0 / eps_1) + c_1 sqrt(eps_1 / eps_0) and
    c = 3 f - own. The mixture lies in the cone between eps_0 and eps_1, whose bisector is w; so
    Re z > 0, and the other root, -own / (rest z), lies in the opposite cone. With b = rest z -
    own / z the discriminant is (rest z + own / z)^2, whose principal root has Re > 0 whenever z
    has: no choice is left.
    """
    roots = jnp.sqrt(permittivity)
    ratio = roots[0] / roots[1]
    c = (3.0 * fraction - own[None]).astype(ratio.dtype)
    b = c[0] * ratio + c[1] / ratio
    own = own.astype(ratio.dtype)
    rest = 3.0 - own
    root = jnp.sqrt(b * b + 4.0 * own * rest)
    # b + root cancels where Re b < 0
    left = b.real < 0.0
    small = 2.0 * own / jnp.where(left, root - b, 1.0)
    z = jnp.where(left, small, (root + b) / (2.0 * jnp.where(left, 1.0, rest)))
    return roots[0] * roots[1] * z


def _several(permittivity: Array, fraction: Array, own: Array) -> Array:
    """Bruggeman's root for three or more constituents; NaN where it is not found.

    1 / eps = sum f_j / (L eps_j + (1 - L) eps) maps the cone that the eps_j span into itself, and
    the root is its only fixed point there. Newton's step, in eps or in log eps, is taken where it
    lowers the residual and stays in the cone's half-plane, that of the map elsewhere. Six steps are
    enough for most mixtures, hundreds are not for a metal close to the fraction at which its grains
    touch: that root is followed while the phases open from one of all constituents to their own.
    """
    # a direction within pi / 2 of all constituents: halfway between the least and largest phase
    phase, size = jnp.angle(permittivity), jnp.abs(permittivity)
    share = fraction.astype(permittivity.dtype)
    middle = 0.5 * (phase.max(0) + phase.min(0))
    back = jnp.exp(-1j * middle.astype(permittivity.dtype))
    own = own.astype(permittivity.dtype)
    rest = 3.0 - own
    near = _CONVERGED * jnp.finfo(size.dtype).eps

    def residual(eps, permittivity):
        """The sum that is 0 at the root, and minus its derivative."""
        u = 1.0 / (own[None] * permittivity + (rest * eps)[None])
        value = (share * (permittivity - eps[None]) * u).sum(0)
        return value, 3.0 * (share * permittivity * u * u).sum(0)

    def followed(state, part_of, steps):
        """Take up to so many steps with the phases open by ``part_of`` the step."""

        def step(state):
            i, eps, done = state
            part = part_of(i).astype(phase.dtype)
            angle = middle[None] + part * (phase - middle[None])
            turned = jnp.exp(1j * angle.astype(permittivity.dtype))
            opened = jnp.where(part == 1.0, permittivity, size.astype(turned.dtype) * turned)
            value, slope = residual(eps, opened)
            change = value / slope
            done = done | ((jnp.abs(change) <= near * jnp.abs(eps)) & (part == 1.0))
            turn = change / eps
            by_log = eps * jnp.exp(jax.lax.complex(jnp.clip(turn.real, -2.0, 2.0), turn.imag))
            new, left = eps / (1.0 - own * value), jnp.abs(value)
            for newton in (by_log, eps + change):
                moved = jnp.abs(residual(newton, opened)[0])
                good = (moved < left) & ((newton * back).real > 0.0)
                new, left = jnp.where(good, newton, new), jnp.where(good, moved, left)
            return i + 1, jnp.where(done, eps, new), done

        return jax.lax.while_loop(lambda s: (s[0] < steps) & ~s[2].all(), step, state)

    begin = jnp.sum(share * permittivity ** (1.0 / 3.0), 0) ** 3
    none = jnp.zeros(begin.shape, bool)
    _, eps, done = followed((0, begin, none), lambda i: jnp.ones(()), _STEPS)
    alike = ((fraction * jnp.cbrt(size)).sum(0) ** 3).astype(back.dtype) / back
    state = (0, jnp.where(done, eps, alike), done)
    _, eps, done = followed(
        state, lambda i: jnp.clip((i - _ALIKE) // 2 / _OPENING, 0.0, 1.0), _MOST_STEPS
    )
    value, slope = residual(eps, permittivity)
    change = value / slope
    return jnp.where(done | (jnp.abs(change) < _LOST * jnp.abs(eps)), eps + change, jnp.nan)


@jax.custom_jvp
def bruggeman_root(permittivity: Array, fraction: Array, own: Array) -> Array:
    """The permittivity of constituents (M, ...) with fractions (M, ...) of all, and 3 L (...)."""
    solve = _two if permittivity.shape[0] == 2 else _several
    root = solve(permittivity, fraction, own)
    _, q = mixed(permittivity, fraction, root, own)
    dissipated, spread = loss_of(permittivity, fraction, q)
    # L Im eps = L dissipated + (1 - L) Im eps spread keeps a small loss to its last digits; where a
    # metal carries the current through a lossless host both sides vanish; the root has the digits.
    rest = own - (3.0 - own) * spread
    sure = rest > 0.1 * own
    kept = own * dissipated / jnp.where(sure, rest, 1.0)
    loss = jnp.where(sure, kept, jnp.maximum(root.imag, 0.0))
    return with_loss(root, loss)


@bruggeman_root.defjvp
def _root_jvp(primals, tangents):
    permittivity, d_permittivity = primals[0], tangents[0]
    fraction, d_fraction = (x[1].astype(permittivity.dtype) for x in (primals, tangents))
    own, d_own = (x[2].astype(permittivity.dtype)[None] for x in (primals, tangents))
    root = bruggeman_root(*primals)
    around = root[None]
    u = 1.0 / (own * permittivity + (3.0 - own) * around)
    moved = 3.0 * (fraction * around * u * u * d_permittivity).sum(0)
    apart = (permittivity - around) * u
    moved = moved + (d_fraction * apart - d_own * fraction * apart * apart).sum(0)
    return root, moved / (3.0 * fraction * permittivity * u * u).sum(0)
