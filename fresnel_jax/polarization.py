"""Polarization after one smooth boundary: phases, psi and Delta, Mueller matrices, depths.

Conventions, as in `interface`: time dependence exp(-i w t), absorbing index eta + ik with k >= 0,
r_p = -r_s at normal incidence. Angles that come out are radians. Every function takes its
arguments as `interface.powers` does (`cos_theta_i` in [-1, 1], its sign ignored; `eta` > 0 and
`k` >= 0 of the medium entered, or the complex index or an `Index` as `eta`; real `eta_i` > 0 of the
medium that the light comes from), broadcasts them, keeps their dtype, raises the same ValueError,
and works under `jit`, `vmap` and `grad`.

Ellipsometers and texts that write exp(+i w t) and eta - ik conjugate every amplitude. Their Delta,
arg(r_p / r_s), is the Delta given here, -arg(r_p / r_s).

Stokes vectors are (I, Q, U, V) = (|E_s|^2 + |E_p|^2, |E_s|^2 - |E_p|^2, 2 Re E_s conj(E_p),
2 Im E_s conj(E_p)), in the frame of s and p of each beam, in which p, s and the direction of
propagation are right-handed. V > 0: the field turns counterclockwise for an observer who looks into
the beam. With Q measured from p instead, as ellipsometers do, Q and U (or V) change sign.

Accuracy over the domain of `interface`: 2 pi eps for phases, 12 eps of Delta, psi and depths
themselves (however small), 8 eps of rho, 24 eps of R for Mueller matrices (their gradients: 100 eps
of the largest element's or of sqrt(R) times the gradient of the amplitudes); gradients of psi and
Delta 50 + 4 (eta_i / |N|)^2 eps of their norm, in relative changes of the arguments as in
`interface` (the second term counts at the critical angle of small indices). At the critical angle
itself derivatives are infinite; 0 is returned.

References: M. Born and E. Wolf, Principles of Optics, 7th ed., secs. 1.5 and 14.2; R. M. A. Azzam
and N. M. Bashara, Ellipsometry and Polarized Light, 1977, sec. 4.2; E. Collett, Polarized Light,
1993, ch. 8.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Complex, Float

from ._numerics.arguments import (
    all_floats,
    as_floats,
    broadcast_shape,
    check_extinction,
    check_positive,
    lossless,
    real,
    structure,
)
from ._numerics.arithmetic import reciprocal_or_zero
from ._numerics.index import IndexLike
from ._numerics.results import exported
from .boundary.boundary import boundary, within_one
from .boundary.phases import phases_kernel, psi_kernel
from .interface import amplitudes, powers

__all__ = [
    "Phases",
    "PsiDelta",
    "absorption_depth",
    "ellipsometric_ratio",
    "mueller_reflection",
    "mueller_refraction",
    "penetration_depth",
    "phases",
    "psi_delta",
]


@exported
class Phases(NamedTuple):
    """Phases of the reflected s and p wave in radians, both of the broadcast shape."""

    phi_s: Float[Array, "..."]
    phi_p: Float[Array, "..."]


@exported
class PsiDelta(NamedTuple):
    """Ellipsometric angles in radians, both of the broadcast shape."""

    psi: Float[Array, "..."]
    delta: Float[Array, "..."]


@jax.custom_jvp
def _angle(y, x):
    """The argument of x + iy for y >= 0, in [0, pi]; pi with derivative 0 where both are 0."""
    return jnp.where((x == 0.0) & (y == 0.0), jnp.pi, jnp.arctan2(y, x))


@_angle.defjvp
def _angle_jvp(primals, tangents):
    (y, x), (dy, dx) = primals, tangents
    # over the larger one: the squares of r_s = 1e-30 at index match leave float32's range
    per_scale = reciprocal_or_zero(jnp.maximum(jnp.abs(x), jnp.abs(y)))
    y_1, x_1 = y * per_scale, x * per_scale
    slope = reciprocal_or_zero(x_1 * x_1 + y_1 * y_1) * per_scale
    return _angle(y, x), (x_1 * slope) * dy - (y_1 * slope) * dx


@jax.jit
def _jit_phases(*arguments):
    f_re, f_im, g_re, g_im = phases_kernel(*all_floats(*arguments))
    phi_s = -_angle(f_im, -f_re)
    return Phases(phi_s, phi_s - _angle(g_im, -g_re))


@jax.jit
def _jit_ratio(*arguments):
    _, _, g_re, g_im = phases_kernel(*all_floats(*arguments))
    return jax.lax.complex(-g_re, -g_im)


@jax.jit
def _jit_psi_delta(*arguments):
    arguments = all_floats(*arguments)
    _, _, g_re, g_im = phases_kernel(*arguments)
    return PsiDelta(psi_kernel(*arguments), _angle(g_im, -g_re))


def _mueller(R_s, R_p, product):
    """The matrix of powers for s and p, and of the s amplitude times the conjugate p amplitude."""
    zero = jnp.zeros_like(R_s)
    even, odd = 0.5 * (R_s + R_p), 0.5 * (R_s - R_p)
    re, im = jnp.real(product), jnp.imag(product)
    rows = [
        [even, odd, zero, zero],
        [odd, even, zero, zero],
        [zero, zero, re, -im],
        [zero, zero, im, re],
    ]
    return jnp.stack([jnp.stack(row, axis=-1) for row in rows], axis=-2)


@jax.jit
def _jit_mueller_reflection(*arguments):
    arguments = all_floats(*arguments)
    R, r = powers(*arguments), amplitudes(*arguments)
    return _mueller(R.R_s, R.R_p, r.r_s * jnp.conj(r.r_p))


@jax.jit
def _jit_mueller_refraction(cos_theta_i, eta, eta_i):
    T = powers(cos_theta_i, eta, 0.0, eta_i)
    c, n, _, m = all_floats(cos_theta_i, eta, None, eta_i)
    # sqrt(T_s T_p) without the root, whose derivative is lost where both vanish; X > 0 always
    X, _ = boundary(within_one(c), n, None, m).x
    return _mueller(T.T_s, T.T_p, T.T_s * (n * m / X))


@jax.jit
def _jit_penetration(wavelength_um, cos_theta_i, eta, k, eta_i):
    c, n, k, m = as_floats(cos_theta_i, eta, k, eta_i)
    _, b = boundary(within_one(c), n, k, m).q
    return _depth(wavelength_um, b)


@jax.jit
def _depth(wavelength_um, k):
    per_k = jnp.where(k == 0.0, jnp.inf, reciprocal_or_zero(4.0 * jnp.pi * k))
    return wavelength_um * per_k


def phases(
    cos_theta_i: ArrayLike, eta: IndexLike, k: ArrayLike = 0.0, eta_i: IndexLike = 1.0
) -> Phases:
    """The phases arg r_s and arg r_p on one continuous branch, `Phases(phi_s, phi_p)`.

    phi_s = arg r_s in [-pi, 0];    phi_p = arg r_p = phi_s - Delta in [-2 pi, 0].

    On this branch both are continuous over all angles and all media, from lossless ones through
    total reflection to metals: phi_s is -pi for reflection at a denser lossless medium, 0 at a
    rarer one, and -2 arctan(sqrt(eta_i^2 sin^2 - eta^2) / (eta_i cos)) in total reflection. The
    principal value, in (-pi, pi], is `jnp.angle(amplitudes(...).r_s)`: it jumps from pi to -pi
    when a k of any size is added to glass.

    Where an amplitude vanishes its phase is undefined: for matched media phi_s is -pi, and its
    derivative 0; at Brewster's angle of a lossless medium phi_p jumps by pi.
    Source: Born and Wolf, 7th ed., sec. 1.5.4, whose phases in total reflection these are.
    """
    return _jit_phases(*structure(cos_theta_i, eta, k, eta_i))


def ellipsometric_ratio(
    cos_theta_i: ArrayLike, eta: IndexLike, k: ArrayLike = 0.0, eta_i: IndexLike = 1.0
) -> Complex[Array, "..."]:
    """The complex ratio rho = r_p / r_s = tan(psi) exp(-i Delta), smooth wherever psi or Delta is not.

    rho = (eta_i^2 sin^2 - Q eta_i cos) / (eta_i^2 sin^2 + Q eta_i cos),  Q = N cos_t.

    -1 at normal incidence, 1 at grazing incidence, 0 at Brewster's angle; Im rho <= 0. For matched
    media it is the limit -cos(2 theta). Error 8 eps of |rho|, also where it vanishes. The numbers
    to fit to ellipsometric data are N = cos 2 psi = (1 - |rho|^2) / (1 + |rho|^2) and
    C - iS = 2 rho / (1 + |rho|^2) with C = sin 2 psi cos Delta, S = sin 2 psi sin Delta.
    Source: Azzam and Bashara, sec. 4.2.
    """  # noqa: E501
    return _jit_ratio(*structure(cos_theta_i, eta, k, eta_i))


def psi_delta(
    cos_theta_i: ArrayLike, eta: IndexLike, k: ArrayLike = 0.0, eta_i: IndexLike = 1.0
) -> PsiDelta:
    """The ellipsometric angles, `PsiDelta(psi, delta)` in radians.

    tan(psi) = |r_p / r_s|,    Delta = -arg(r_p / r_s).

    For one boundary of passive media psi lies in [0, pi/4] and Delta in [0, pi]; Delta is pi at
    normal incidence and 0 at grazing incidence. Delta is the number that an ellipsometer shows.
    At Brewster's angle of a lossless medium Delta jumps from pi to 0 and psi has a kink: at every
    representable angle beside it Delta is exactly pi or 0 with derivative 0 with respect to the
    angle and the real indices, and psi keeps all its digits and its slope. With k > 0 Delta passes
    through pi/2 there, however small k is. Where r_p is exactly 0, Delta is pi and both derivatives
    are 0. The derivative of psi in total reflection (psi = pi/4) is 0 up to rounding.
    """
    return _jit_psi_delta(*structure(cos_theta_i, eta, k, eta_i))


def mueller_reflection(
    cos_theta_i: ArrayLike, eta: IndexLike, k: ArrayLike = 0.0, eta_i: IndexLike = 1.0
) -> Float[Array, "... 4 4"]:
    """The Mueller matrix of one reflection, shape (..., 4, 4): reflected = M @ incident.

        (R_s + R_p)/2   (R_s - R_p)/2    0          0
        (R_s - R_p)/2   (R_s + R_p)/2    0          0
        0               0                Re w      -Im w       w = r_s conj(r_p)
        0               0                Im w       Re w

    Not normalised: M[0, 0] is the reflectance of unpolarized light. At normal incidence it is
    R diag(1, 1, -1, -1), because p and s of the reflected beam are mirrored.
    Stokes vectors as the module's docstring says. Source: Collett, sec. 8.3.
    """
    return _jit_mueller_reflection(*structure(cos_theta_i, eta, k, eta_i))


def mueller_refraction(
    cos_theta_i: ArrayLike, eta: IndexLike, eta_i: IndexLike = 1.0
) -> Float[Array, "... 4 4"]:
    """The Mueller matrix of one refraction into a lossless medium, shape (..., 4, 4).

        (T_s + T_p)/2   (T_s - T_p)/2    0                0
        (T_s - T_p)/2   (T_s + T_p)/2    0                0
        0               0                sqrt(T_s T_p)    0
        0               0                0                sqrt(T_s T_p)

    Normalised to power through the surface: M[0, 0] is the transmittance T of unpolarized light
    (the factor eta cos_t / (eta_i cos_i) is in, the change of radiance by eta^2 / eta_i^2 is not).
    All zeros in total reflection.

    Raises:
        ValueError: eta is complex. The wave in an absorbing medium is inhomogeneous, and its
            s and p powers are projected differently: use `powers` for T_s and T_p there.
    """
    eta = lossless(eta, "eta")
    if jnp.iscomplexobj(eta):
        raise ValueError(
            "eta is complex, but the Mueller matrix of a refraction is defined for a lossless "
            "medium only; give its real index, or use fresnel_jax.powers for T_s and T_p"
        )
    cos_theta_i, eta, _, m = structure(cos_theta_i, eta, 0.0, eta_i)
    return _jit_mueller_refraction(cos_theta_i, eta, 1.0 if m is None else m)


def penetration_depth(
    cos_theta_i: ArrayLike,
    eta: IndexLike,
    k: ArrayLike = 0.0,
    eta_i: IndexLike = 1.0,
    *,
    wavelength_um: ArrayLike,
) -> Array:
    """The depth in micrometres at which the power density behind the boundary has fallen to 1/e.

    wavelength_um / (4 pi Im Q),    Q^2 = (eta + ik)^2 - eta_i^2 sin^2

    for the refracted wave in an absorbing medium and for the evanescent wave of total reflection
    (Im Q = sqrt(eta_i^2 sin^2 - eta^2)) alike. The field falls to 1/e at twice this depth, which is
    what texts on internal reflection call the penetration depth.

    `wavelength_um` is that in vacuum, > 0; the others are as in `powers`. In a lossless medium
    without total reflection the depth is inf, and its derivative is returned as 0.
    Source: Born and Wolf, 7th ed., secs. 1.5.4 and 14.2.
    """
    c, n, kappa, m = structure(cos_theta_i, eta, k, eta_i)
    wavelength_um = real(wavelength_um, "wavelength_um")
    check_positive(wavelength_um, "wavelength_um")
    broadcast_shape(wavelength_um=wavelength_um, cos_theta_i=c, eta=n, k=kappa, eta_i=m)
    return _jit_penetration(wavelength_um, c, n, kappa, m)


def absorption_depth(wavelength_um: ArrayLike, k: ArrayLike) -> Array:
    """The depth in micrometres at which light in a medium has fallen to 1/e of its power.

    wavelength_um / (4 pi k), the reciprocal of the absorption coefficient; inf, with derivative 0,
    for k = 0. About .01 um for metals in the visible: they are opaque at a tenth of a micrometre.
    Source: Born and Wolf, 7th ed., sec. 14.1.
    """
    wavelength_um, k = real(wavelength_um, "wavelength_um"), real(k, "k")
    check_extinction(k)
    check_positive(wavelength_um, "wavelength_um")
    broadcast_shape(wavelength_um=wavelength_um, k=k)
    return _depth(wavelength_um, k)
