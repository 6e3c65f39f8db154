"""Reflection and transmission of coherent films, as cheaply as a fit can use them.

`fresnel_jax.layers.stack` is right to some units in the last place at every thickness. A fit needs
1e-6 and evaluates a film at some ten thousand points a few hundred times, with derivatives: Airy's
recursion on complex numbers, whose errors are 1e-13 of R for films of micrometres, makes such a fit
three times as fast and halves its time to compile. It, too, forms no growing exponential.

Every amplitude is an analytic function of the admittances and phases of the layers, so that one
complex derivative for each of them is all there is to know; the front half of the recursion carries
them from the back half. The derivatives are our own algebra, tested against mpmath.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import Array
from jax.custom_derivatives import SymbolicZero

# What a square of the index along the normal of zero is replaced by: a layer just at its critical
# angle, where the derivatives of the recursion divide by zero although those of R do not.
_SMALL = 1e-30
# Of more layers (the slices of a graded film) the unrolled program takes longer to compile than the
# loop of `stack`: 38 s against 11 s for twelve.
FEW_LAYERS = 6


class Amplitudes(NamedTuple):
    """r and t, complex, of the tangential electric (s) or magnetic (p) field."""

    r: Array
    t: Array


class Films(NamedTuple):
    """Powers of s and p, and the ratios r of the electric (s) and magnetic (p) field."""

    R_s: Array
    R_p: Array
    T_s: Array
    T_p: Array
    r_s: Array
    r_p: Array


def _once(z: Array) -> Array:
    """Return a complex array that XLA does not compute again for everything that reads it.

    Its CPU compiler repeats what is before a loop in every loop behind it, but for divisions; a
    division by one is exact (`fresnel_jax._boundary.computed_once` has the measurements).
    """
    return jax.lax.complex(*(x / jnp.where(x == x, 1.0, 2.0) for x in (z.real, z.imag)))


def _reciprocal(z: Array) -> Array:
    """Return 1 / z of what is neither huge nor tiny, for which XLA's division takes care."""
    size = z.real * z.real + z.imag * z.imag
    return jax.lax.complex(z.real / size, -z.imag / size)


def _root(z: Array) -> Array:
    """Return the root of a complex z with Im >= 0 that is neither huge nor tiny."""
    size = jnp.sqrt(z.real * z.real + z.imag * z.imag)
    large = jnp.sqrt(0.5 * (size + jnp.abs(z.real)))
    small = 0.5 * z.imag / large
    above = z.real >= 0.0
    return jax.lax.complex(jnp.where(above, large, small), jnp.where(above, small, large))


class _Boundary(NamedTuple):
    """A boundary: its own r and 1 / (Y + Y'), what comes back from below, and 1 / (1 + r G)."""

    r: Array
    inverse: Array
    G: Any
    g: Array


def _recursion(
    admittance: Sequence[Array], passage: Sequence[Array]
) -> tuple[Amplitudes, list[_Boundary]]:
    """Return r and t, and the boundaries from the front to the back.

    admittance: of the media. passage: what a layer multiplies the field by, exp(i phase).
    """
    boundaries: list[_Boundary] = []
    below = t = admittance[-1]  # replaced at the last boundary
    for j in reversed(range(len(admittance) - 1)):
        inverse = _reciprocal(admittance[j] + admittance[j + 1])
        r = (admittance[j] - admittance[j + 1]) * inverse
        if j == len(passage):
            boundaries.append(_Boundary(r, inverse, 0.0, jnp.ones_like(r)))
            below, t = r, 1.0 + r
            continue
        G = _once(below * passage[j] * passage[j])
        g = _reciprocal(1.0 + r * G)
        boundaries.append(_Boundary(r, inverse, G, g))
        below, t = (r + G) * g, (1.0 + r) * g * passage[j] * t
    return Amplitudes(_once(below), _once(t)), boundaries[::-1]


@jax.custom_jvp
def amplitudes(admittance: tuple[Array, ...], phase: tuple[Array, ...]) -> Amplitudes:
    """Return r and t of layers between two half-spaces for one polarization.

    admittance: of the media, Q for s and Q / N^2 for p, with Q the index along the normal.
    phase: 2 pi i Q thickness / wavelength of the layers. All complex, broadcasting.
    """
    return _recursion(admittance, tuple(_once(jnp.exp(p)) for p in phase))[0]


def _derivatives(primals: Any, tangents: Any) -> tuple[Amplitudes, Amplitudes]:
    admittance, phase = primals
    passage = tuple(_once(jnp.exp(p)) for p in phase)
    out, boundaries = _recursion(admittance, passage)
    d_admittance, d_phase = tangents
    d_r, d_log_t = jnp.zeros_like(out.r), jnp.zeros_like(out.r)
    # Derivatives of r and log t by what the rest of the stack reflects.
    of_r, of_t = jnp.ones_like(out.r), jnp.zeros_like(out.r)
    for j, (r, inverse, G, g) in enumerate(boundaries):
        own = (1.0 - G * G) * g * g
        # d r of the boundary = 2 (Y' dY - Y dY') / (Y + Y')^2, and Y / (Y + Y') = (1 + r) / 2.
        per_r, per_t = of_r * own, of_t * own - G * g
        for which, other, sign in ((j, j + 1, 1.0), (j + 1, j, -1.0)):
            step = d_admittance[which]
            if not isinstance(step, SymbolicZero):
                share = (2.0 * sign) * admittance[other] * inverse * inverse
                # Of log t beside that: d log (1 + r) = (dY Y' / Y - dY') / (Y + Y').
                more = (
                    admittance[1 + j] * _reciprocal(admittance[j]) * inverse
                    if sign > 0.0
                    else -inverse
                )
                d_r += _once(per_r * share) * step
                d_log_t += _once(per_t * share + more) * step
        if j == len(phase):
            break
        through = (1.0 - r * r) * g * g
        of_r, of_t = of_r * through, of_t * through - r * g
        step = d_phase[j]
        if not isinstance(step, SymbolicZero):
            d_r += _once(2.0 * of_r * G) * step
            d_log_t += _once(2.0 * of_t * G + 1.0) * step
        back = passage[j] * passage[j]
        of_r, of_t = _once(of_r * back), _once(of_t * back)
    return out, Amplitudes(d_r, out.t * d_log_t)


amplitudes.defjvp(_derivatives, symbolic_zeros=True)


def normal_index(z: Array) -> Array:
    """Return the index along the normal, the root of its square with Im >= 0."""
    return _once(_root(jnp.where(z == 0.0, _SMALL, z)))


def admittances(
    c: Array,
    eta_i: Array,
    index: Sequence[Array],
    thickness_um: Sequence[Array],
    wavelength_um: Array,
) -> tuple[tuple[Array, ...], tuple[Array, ...], tuple[Array, ...]]:
    """Return the admittances of all media for s and for p, and the phases, as in `amplitudes`.

    Arguments as of `films`; all that is returned has one shape.
    """
    c = jnp.maximum(c, 1e-15)
    squares = [n * n for n in index]
    # N^2 - sin^2, so that a medium like the first one has exactly its cosine.
    q0 = eta_i * c
    q = [normal_index((n2 - eta_i * eta_i) + q0 * q0) for n2 in squares]
    front = jax.lax.complex(q0, jnp.zeros_like(q0))
    shape = jnp.broadcast_shapes(front.shape, *(z.shape for z in q))
    k0 = 2.0 * jnp.pi / wavelength_um
    phase = [1j * (k0 * d) * z for d, z in zip(thickness_um, q[:-1], strict=True)]
    for_p = [
        front / (eta_i * eta_i),
        *(_once(z * _reciprocal(n2)) for z, n2 in zip(q, squares, strict=True)),
    ]
    whole = [[jnp.broadcast_to(z, shape) for z in each] for each in ([front, *q], for_p, phase)]
    return tuple(whole[0]), tuple(whole[1]), tuple(whole[2])


def films(
    c: Array,
    eta_i: Array,
    index: Sequence[Array],
    thickness_um: Sequence[Array],
    wavelength_um: Array,
    normal: bool = False,
) -> Films:
    """Return R, T and r of coherent layers, at cosines c in a transparent medium eta_i.

    index: complex, of the L layers and the medium behind; thickness_um: of the layers. normal:
    whether all cosines are 1 and r_p is not asked for: then what s shows is that of both. Absolute
    error: 1e-13 times the phase of the films in radians; 1e-8 at a layer's critical angle.
    """
    s, p, phase = admittances(c, eta_i, index, thickness_um, wavelength_um)
    out = []
    for admittance in (s,) if normal else (s, p):
        found = amplitudes(admittance, phase)
        R = found.r.real**2 + found.r.imag**2
        T = (found.t.real**2 + found.t.imag**2) * admittance[-1].real / admittance[0].real
        out.append((R, T, found.r))
    (R_s, T_s, r_s), (R_p, T_p, r_p) = out[0], out[-1]
    return Films(R_s, R_p, T_s, T_p, r_s, r_p)
