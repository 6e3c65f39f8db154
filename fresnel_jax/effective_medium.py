"""Indices of fine mixtures: Bruggeman, Looyenga, Maxwell Garnett, linear; roughness as a mixture.

Where grains, pores or the bumps of a rough surface are much smaller than the wavelength, a mixture
acts as one medium whose permittivity eps follows from those of its constituents, eps_j, and their
volume fractions f_j (which add up to 1):

    Maxwell Garnett   (eps - eps_0) / (eps + 2 eps_0)
                          = sum_j f_j (eps_j - eps_0) / (eps_j + 2 eps_0)
                      spheres, few and apart, in the host eps_0, the first constituent
    Bruggeman         0 = sum_j f_j (eps_j - eps) / (eps_j + 2 eps)
                      grains of all constituents side by side; the usual one for rough surfaces,
                      as 50 % of the medium below in the medium above
    Looyenga          eps^(1/3) = sum_j f_j eps_j^(1/3)
                      powders and foams of any shape, for moderate contrast
    linear            eps = sum_j f_j eps_j
                      sheets along the field: the upper one of Wiener's bounds

Arguments of all of them: `eta` (> 0) and `k` (>= 0) of two or more constituents on the leading axis
(M); `fraction` of every constituent but the first on the leading axis (M - 1), the first one fills
the rest. All other axes broadcast: wavelengths of the indices against a batch of fractions. The
result is `Index(eta, k)`, float32 or float64 as the arguments.

    silica = material("SiO2")(wavelengths)
    rough = bruggeman([1.0, silica.eta], [0.0, silica.k], [0.5])    # half of it void

Accuracy: the index within 16 eps of its modulus (measured: 4), k within 32 eps of itself however
small it is (measured: 14; of five constituents with metals up to 128, measured 70), since it is a
sum of terms of one sign; at a fraction of 0 or 1, and of equal constituents, the constituent comes
out. First and second derivatives are finite, at k = 0 and
at fractions 0 and 1 too. The exception: of a metal without loss in a dielectric without loss
Bruggeman's equation has branch points, next to which errors and derivatives grow as the inverse
root of the distance.

Sources: D. A. G. Bruggeman, Ann. Phys. 416, 636 (1935), doi:10.1002/andp.19354160705; H. Looyenga,
Physica 31, 401 (1965), doi:10.1016/0031-8914(65)90045-5; J. C. Maxwell Garnett, Phil. Trans. R.
Soc. A 203, 385 (1904), doi:10.1098/rsta.1904.0024; a comparison: D. E. Aspnes, Thin Solid Films 89,
249 (1982), doi:10.1016/0040-6090(82)90590-9.
"""

from __future__ import annotations

from collections.abc import Iterator

import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike

from ._arguments import as_floats, broadcast_shape
from ._arithmetic import complex_sqrt, sum_exactly
from ._compiler import opaque
from ._spectral import Index
from ._vectors import as_float

__all__ = ["bruggeman", "linear", "looyenga", "maxwell_garnett"]

# Of three or more constituents Bruggeman's equation is solved by iteration (see `_several`): up to
# so many steps at once; else so many from constituents of one phase, then two for each of so many
# stages in which the phases open; and never more than that.
_STEPS, _ALIKE, _OPENING, _MOST_STEPS = 16, 16, 8, 400
# A root is found when Newton's step is so many eps of it, and lost if it ends with a larger part.
_CONVERGED, _LOST = 64.0, 1e-3


def _constituents(eta, k, fraction) -> tuple[Array, Array, Array]:
    """eta, k and fractions of all constituents, (M, ...) each, of one type; checked shapes."""
    eta, k, fraction = _arrays(eta=eta, k=k, fraction=fraction)
    count = eta.shape[0] if eta.ndim else 0
    if count < 2 or k.ndim == 0 or k.shape[0] != count:
        raise ValueError(
            f"eta has shape {eta.shape} and k {k.shape}; wanted the constituents, two or more, on "
            "the leading axis of both"
        )
    if fraction.ndim == 0 or fraction.shape[0] != count - 1:
        raise ValueError(
            f"fraction has shape {fraction.shape} for {count} constituents; wanted ({count - 1}, "
            "...): the volume fraction of every constituent but the first, which fills the rest"
        )
    named = {"eta": eta, "k": k, "fraction": fraction}
    shape = broadcast_shape(
        **{f"{name} behind its leading axis": x.shape[1:] for name, x in named.items()}
    )
    eta, k, fraction = (
        jnp.broadcast_to(
            x.reshape(x.shape[:1] + (1,) * (len(shape) + 1 - x.ndim) + x.shape[1:]),
            x.shape[:1] + shape,
        )
        for x in as_floats(eta, k, fraction)
    )
    # Exactly summed: a trace of an absorbing first constituent is a difference of numbers near 1
    one = opaque(jnp.ones(shape, eta.dtype))
    rest, error = sum_exactly([one, *(-opaque(share) for share in fraction)])
    return eta, k, jnp.concatenate([(rest + error)[None], fraction])


def _arrays(**values) -> Iterator[Array]:
    """Arrays of floats; lists of constituents may have shapes of their own (a number beside a
    spectrum)."""
    for name, x in values.items():
        if isinstance(x, list | tuple) and len(x):
            yield jnp.stack(jnp.broadcast_arrays(*(as_float(part, name) for part in x)))
        else:
            yield as_float(x, name)


def _mixed(permittivity: Array, fraction: Array, around: Array) -> tuple[Array, Array]:
    """The mixture of spheres in a medium `around` and q_j: a sphere's field over the mean one.

    With u_j = 1 / (eps_j + 2 around) and B = sum f_j u_j the mixture is sum f_j eps_j u_j / B, and
    q_j = u_j / B.
    """
    u = 1.0 / (permittivity + 2.0 * around)
    q = u / (fraction * u).sum(0)
    return (fraction * permittivity * q).sum(0), q


def _squared(z: Array) -> Array:
    return z.real * z.real + z.imag * z.imag


def _loss(permittivity: Array, fraction: Array, q: Array) -> tuple[Array, Array]:
    """(D, V): Im eps = D + 2 Im(around) V, two sums of positive terms.

    eps + 2 around is the harmonic mean of eps_j + 2 around; the imaginary part of it is
    sum f_j |q_j|^2 Im(eps_j + 2 around), and sum f_j |q_j|^2 - 1 = sum f_j |q_j - 1|^2 since
    sum f_j q_j = 1.
    """
    dissipated = (fraction * _squared(q) * permittivity.imag).sum(0)
    return dissipated, (fraction * _squared(q - 1.0)).sum(0)


def _index(permittivity: Array) -> Index:
    return Index(*complex_sqrt(permittivity.real, permittivity.imag))


def _permittivity(eta: Array, k: Array) -> Array:
    return jax.lax.complex((eta - k) * (eta + k), 2.0 * (eta * k))


def _with_loss(permittivity: Array, loss: Array) -> Array:
    return jax.lax.complex(permittivity.real, loss)


def _two(permittivity: Array, fraction: Array) -> Array:
    """Bruggeman's root for two constituents, in units of w = sqrt(eps_0) sqrt(eps_1).

    2 z^2 - b z - 1 = 0 with b = c_0 sqrt(eps_0 / eps_1) + c_1 sqrt(eps_1 / eps_0), c = 3 f - 1. The
    mixture lies in the cone between eps_0 and eps_1, whose bisector is w; so Re z > 0, and the
    other root, -1 / (2 z), lies in the opposite cone. With b = 2 z - 1 / z the discriminant is
    (2 z + 1 / z)^2, whose principal root has Re > 0 whenever z has: no choice is left.
    """
    roots = jnp.sqrt(permittivity)
    ratio = roots[0] / roots[1]
    b = (3.0 * fraction[0] - 1.0) * ratio + (3.0 * fraction[1] - 1.0) / ratio
    root = jnp.sqrt(b * b + 8.0)
    # b + root cancels where Re b < 0
    left = b.real < 0.0
    z = jnp.where(left, 2.0 / jnp.where(left, root - b, 1.0), 0.25 * (root + b))
    return roots[0] * roots[1] * z


def _several(permittivity: Array, fraction: Array) -> Array:
    """Bruggeman's root for three or more constituents; NaN where it is not found.

    eps = 1 / (3 sum f_j / (eps_j + 2 eps)) maps the cone that the eps_j span into itself, and the
    root is its only fixed point there. Newton's step, in eps or in log eps, is taken where it
    lowers the residual and stays in the cone's half-plane, that of the map elsewhere. Six steps are
    enough for most mixtures, hundreds are not for a metal close to the fraction at which its grains
    touch: that root is followed while the phases open from one of all constituents to their own.
    """
    # a direction within pi / 2 of all constituents: halfway between the least and largest phase
    phase, size = jnp.angle(permittivity), jnp.abs(permittivity)
    middle = 0.5 * (phase.max(0) + phase.min(0))
    back = jnp.exp(-1j * middle.astype(permittivity.dtype))
    near = _CONVERGED * jnp.finfo(size.dtype).eps

    def residual(eps, permittivity):
        """How far the map moves eps, and its derivative."""
        u = 1.0 / (permittivity + 2.0 * eps)
        return (
            3.0 * eps * (fraction * u).sum(0) - 1.0,
            3.0 * (fraction * permittivity * u * u).sum(0),
        )

    def followed(state, part_of, steps):
        """Take up to so many steps with the phases open by ``part_of`` the step."""

        def step(state):
            i, eps, done = state
            part = part_of(i).astype(phase.dtype)
            turned = jnp.exp(1j * (middle + part * (phase - middle)).astype(permittivity.dtype))
            opened = jnp.where(part == 1.0, permittivity, size * turned)
            value, slope = residual(eps, opened)
            change = -value / slope
            done = done | ((jnp.abs(change) <= near * jnp.abs(eps)) & (part == 1.0))
            turn = change / eps
            by_log = eps * jnp.exp(jax.lax.complex(jnp.clip(turn.real, -2.0, 2.0), turn.imag))
            new, left = eps / (1.0 + value), jnp.abs(value)
            for newton in (by_log, eps + change):
                moved = jnp.abs(residual(newton, opened)[0])
                good = (moved < left) & ((newton * back).real > 0.0)
                new, left = jnp.where(good, newton, new), jnp.where(good, moved, left)
            return i + 1, jnp.where(done, eps, new), done

        return jax.lax.while_loop(lambda s: (s[0] < steps) & ~s[2].all(), step, state)

    begin = jnp.sum(fraction * permittivity ** (1.0 / 3.0), 0) ** 3
    none = jnp.zeros(begin.shape, bool)
    _, eps, done = followed((0, begin, none), lambda i: jnp.ones(()), _STEPS)
    alike = (fraction * jnp.cbrt(size)).sum(0) ** 3 / back
    state = (0, jnp.where(done, eps, alike), done)
    _, eps, done = followed(
        state, lambda i: jnp.clip((i - _ALIKE) // 2 / _OPENING, 0.0, 1.0), _MOST_STEPS
    )
    value, slope = residual(eps, permittivity)
    change = -value / slope
    return jnp.where(done | (jnp.abs(change) < _LOST * jnp.abs(eps)), eps + change, jnp.nan)


@jax.custom_jvp
def _bruggeman(permittivity: Array, fraction: Array) -> Array:
    solve = _two if permittivity.shape[0] == 2 else _several
    root = solve(permittivity, fraction)
    _, q = _mixed(permittivity, fraction, root)
    dissipated, spread = _loss(permittivity, fraction, q)
    # Im eps = dissipated + 2 Im eps spread keeps a small loss to its last digits; where a metal
    # carries the current through a lossless host both sides vanish, and the root has the digits.
    rest = 1.0 - 2.0 * spread
    sure = rest > 0.1
    loss = jnp.where(sure, dissipated / jnp.where(sure, rest, 1.0), jnp.maximum(root.imag, 0.0))
    return _with_loss(root, loss)


@_bruggeman.defjvp
def _bruggeman_jvp(primals, tangents):
    permittivity, fraction = primals
    d_permittivity, d_fraction = tangents
    root = _bruggeman(permittivity, fraction)
    u = 1.0 / (permittivity + 2.0 * root)
    moved = (fraction * root * u * u * d_permittivity).sum(0)
    moved = moved + (d_fraction * (permittivity - root) * u).sum(0) / 3.0
    return root, moved / (fraction * permittivity * u * u).sum(0)


@jax.jit
def _jit_bruggeman(eta, k, fraction):
    return _index(_bruggeman(_permittivity(eta, k), fraction))


@jax.jit
def _jit_maxwell_garnett(eta, k, fraction):
    permittivity = _permittivity(eta, k)
    mixture, q = _mixed(permittivity, fraction, permittivity[0])
    dissipated, spread = _loss(permittivity, fraction, q)
    return _index(_with_loss(mixture, dissipated + 2.0 * permittivity[0].imag * spread))


@jax.jit
def _jit_looyenga(eta, k, fraction):
    # eps^(1/3) = N^(2/3), whose phase is within [0, pi / 3): both parts are sums of positive terms
    size, phase = jnp.cbrt(eta * eta + k * k), jnp.arctan2(k, eta) * (2.0 / 3.0)
    re, im = (fraction * size * jnp.cos(phase)).sum(0), (fraction * size * jnp.sin(phase)).sum(0)
    # its power 3/2 by a root and a product
    a, b = complex_sqrt(re, im)
    return Index(re * a - im * b, re * b + im * a)


@jax.jit
def _jit_linear(eta, k, fraction):
    return _index((fraction * _permittivity(eta, k)).sum(0))


def bruggeman(eta: ArrayLike, k: ArrayLike, fraction: ArrayLike) -> Index:
    """`Index(eta, k)` of a mixture by Bruggeman's symmetric formula, for spherical grains.

    0 = sum_j f_j (eps_j - eps) / (eps_j + 2 eps); of its roots the one that obeys Wiener's bounds,
    the only one with Im eps >= 0 that is continuous in the fractions. Two constituents in closed
    form, more of them by Newton's iteration.

    Args, accuracy, derivatives and sources: see the module `effective_medium`.

    Raises:
        ValueError: the shapes are not those of the module's text.
    """
    return _jit_bruggeman(*_constituents(eta, k, fraction))


def maxwell_garnett(eta: ArrayLike, k: ArrayLike, fraction: ArrayLike) -> Index:
    """`Index(eta, k)` of spheres that lie apart in a host, the first constituent.

    (eps - eps_0) / (eps + 2 eps_0) = sum_j f_j (eps_j - eps_0) / (eps_j + 2 eps_0).

    Args, accuracy, derivatives and sources: see the module `effective_medium`.

    Raises:
        ValueError: the shapes are not those of the module's text.
    """
    return _jit_maxwell_garnett(*_constituents(eta, k, fraction))


def looyenga(eta: ArrayLike, k: ArrayLike, fraction: ArrayLike) -> Index:
    """`Index(eta, k)` of a mixture by Looyenga's formula, eps^(1/3) = sum_j f_j eps_j^(1/3).

    Args, accuracy, derivatives and sources: see the module `effective_medium`.

    Raises:
        ValueError: the shapes are not those of the module's text.
    """
    return _jit_looyenga(*_constituents(eta, k, fraction))


def linear(eta: ArrayLike, k: ArrayLike, fraction: ArrayLike) -> Index:
    """`Index(eta, k)` of a mixture with eps = sum_j f_j eps_j.

    Args, accuracy, derivatives and sources: see the module `effective_medium`.

    Raises:
        ValueError: the shapes are not those of the module's text.
    """
    return _jit_linear(*_constituents(eta, k, fraction))
