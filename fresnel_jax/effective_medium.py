"""Indices of fine mixtures: Bruggeman, Looyenga, Maxwell Garnett, linear; roughness as a mixture.

Where grains, pores or the bumps of a rough surface are much smaller than the wavelength, a mixture
acts as one medium whose permittivity eps follows from those of its constituents, eps_j, and their
volume fractions f_j (which add up to 1):

    Maxwell Garnett   (eps - eps_0) / (eps + 2 eps_0)
                          = sum_j f_j (eps_j - eps_0) / (eps_j + 2 eps_0)
                      spheres, few and apart, in the host eps_0, the first constituent
    Bruggeman         0 = sum_j f_j (eps_j - eps) / (eps_j + 2 eps)
                      grains of all constituents side by side; the usual one for rough surfaces,
                      as 50 % of the medium below in the medium above; for spheres, other grains
                      have L eps_j + (1 - L) eps there (`depolarization`)
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

Accuracy: the index within 16 eps of the larger of its modulus and of what a relative change of one
eps in each argument does to it. Where permittivities do not cancel, that is the modulus (measured:
4). Where they do, as those of a metal and a dielectric may, it is the conditioning: there `linear`
was 1,753 and `maxwell_garnett` 57 eps of the modulus off. Away from there k is within 32 eps of
itself however small it is (measured: 14; of five constituents with metals up to 128, measured 70),
since it is a sum of terms of one sign. At a fraction of 0 or 1, and of equal constituents, the
constituent comes out. First and second derivatives are finite, at k = 0 and at fractions 0 and 1
too. The exception: of a metal without loss in a dielectric without loss Bruggeman's equation has
branch points, next to which errors and derivatives grow as the inverse root of the distance.
The same holds at any depolarization factor, by which the derivative is within 300 eps.

Sources: D. A. G. Bruggeman, Ann. Phys. 416, 636 (1935), doi:10.1002/andp.19354160705; H. Looyenga,
Physica 31, 401 (1965), doi:10.1016/0031-8914(65)90045-5; J. C. Maxwell Garnett, Phil. Trans. R.
Soc. A 203, 385 (1904), doi:10.1098/rsta.1904.0024; a comparison: D. E. Aspnes, Thin Solid Films 89,
249 (1982), doi:10.1016/0040-6090(82)90590-9.
"""

from __future__ import annotations

from collections.abc import Iterator

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike

from ._numerics.arguments import (
    as_floats,
    broadcast_shape,
    extinction,
    float_checked,
    not_negative,
    readable,
)
from ._numerics.arithmetic import complex_sqrt, sum_exactly
from ._numerics.fences import opaque
from ._numerics.index import Index
from .indices.bruggeman import bruggeman_root, loss_of, mixed, with_loss

__all__ = ["bruggeman", "linear", "looyenga", "maxwell_garnett"]


def _check_factor(x, name: str):
    not_negative(x, name)
    if readable(x) and np.any(np.asarray(x) > 1.0):
        raise ValueError(f"{name} is {np.max(np.asarray(x))}; wanted a number from 0 to 1")


def _check_sum(fraction):
    several = isinstance(fraction, list | tuple) or np.ndim(fraction) > 0
    if several and all(map(readable, jax.tree.leaves(fraction))):
        total = np.max(sum(np.asarray(x, float) for x in fraction), initial=0.0)
        if total > 1.0 + 1e-6:  # the rounding of float32
            raise ValueError(
                f"fraction adds up to {total:g}; wanted 1 or less, since the first constituent "
                "fills the rest"
            )


_CONVERTERS = {
    "depolarization": float_checked("depolarization", _check_factor),
    "eta": float_checked("eta", not_negative),
    "k": extinction,
    "fraction": float_checked("fraction", _check_factor),
}


def _constituents(eta, k, fraction) -> tuple[Array, Array, Array]:
    """eta, k and fractions of all constituents, (M, ...) each, of one type; checked shapes."""
    given = fraction
    eta, k, fraction = _arrays(eta=eta, k=k, fraction=fraction)
    _check_sum(given)
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
            yield jnp.stack(jnp.broadcast_arrays(*map(_CONVERTERS[name], x)))
        else:
            yield _CONVERTERS[name](x)


def _index(permittivity: Array) -> Index:
    return Index(*complex_sqrt(permittivity.real, permittivity.imag))


def _permittivity(eta: Array, k: Array) -> Array:
    return jax.lax.complex((eta - k) * (eta + k), 2.0 * (eta * k))


@jax.jit
def _jit_bruggeman(eta, k, fraction, depolarization):
    own = jnp.broadcast_to(3.0 * depolarization.astype(eta.dtype), eta.shape[1:])
    return _index(bruggeman_root(_permittivity(eta, k), fraction, own))


@jax.jit
def _jit_maxwell_garnett(eta, k, fraction):
    permittivity = _permittivity(eta, k)
    mixture, q = mixed(permittivity, fraction, permittivity[0])
    dissipated, spread = loss_of(permittivity, fraction, q)
    return _index(with_loss(mixture, dissipated + 2.0 * permittivity[0].imag * spread))


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
    permittivity = _permittivity(eta, k)
    return _index((fraction.astype(permittivity.dtype) * permittivity).sum(0))


def bruggeman(
    eta: ArrayLike, k: ArrayLike, fraction: ArrayLike, depolarization: ArrayLike = 1.0 / 3.0
) -> Index:
    """`Index(eta, k)` of a mixture by Bruggeman's symmetric formula.

    0 = sum_j f_j (eps_j - eps) / (L eps_j + (1 - L) eps) with the depolarization factor L of the
    grains along the field, from 0 to 1: 1/3 for spheres, 1/2 across long columns, 0 along them (the
    upper one of Wiener's bounds, `linear`), 1 across sheets (the lower one). Of its roots the one
    that obeys these bounds, the only one with Im eps >= 0 that is continuous in the fractions. Two
    constituents in closed form, more of them by Newton's iteration.

    Args: `depolarization`, L, a number or of a shape that broadcasts to that of the result. The
    others, accuracy, derivatives and sources: see the module `effective_medium`; L of other grains:
    Aspnes 1982.

    Raises:
        ValueError: the shapes are not those of the module's text, a known eta or k is below 0, or a
            known L, a fraction or the sum of the fractions is not within 0 and 1.
    """
    parts = _constituents(eta, k, fraction)
    return _jit_bruggeman(*parts, _CONVERTERS["depolarization"](depolarization))


def maxwell_garnett(eta: ArrayLike, k: ArrayLike, fraction: ArrayLike) -> Index:
    """`Index(eta, k)` of spheres that lie apart in a host, the first constituent.

    (eps - eps_0) / (eps + 2 eps_0) = sum_j f_j (eps_j - eps_0) / (eps_j + 2 eps_0).

    Args, accuracy, derivatives and sources: see the module `effective_medium`.

    Raises:
        ValueError: the shapes are not those of the module's text, a known eta or k is below 0, or a
            known fraction or their sum is not within 0 and 1.
    """
    return _jit_maxwell_garnett(*_constituents(eta, k, fraction))


def looyenga(eta: ArrayLike, k: ArrayLike, fraction: ArrayLike) -> Index:
    """`Index(eta, k)` of a mixture by Looyenga's formula, eps^(1/3) = sum_j f_j eps_j^(1/3).

    Args, accuracy, derivatives and sources: see the module `effective_medium`.

    Raises:
        ValueError: the shapes are not those of the module's text, a known eta or k is below 0, or a
            known fraction or their sum is not within 0 and 1.
    """
    return _jit_looyenga(*_constituents(eta, k, fraction))


def linear(eta: ArrayLike, k: ArrayLike, fraction: ArrayLike) -> Index:
    """`Index(eta, k)` of a mixture with eps = sum_j f_j eps_j.

    Args, accuracy, derivatives and sources: see the module `effective_medium`.

    Raises:
        ValueError: the shapes are not those of the module's text, a known eta or k is below 0, or a
            known fraction or their sum is not within 0 and 1.
    """
    return _jit_linear(*_constituents(eta, k, fraction))
