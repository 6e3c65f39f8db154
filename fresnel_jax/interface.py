"""One smooth boundary between two media: amplitudes and powers for s and p polarization.

Conventions: time dependence exp(-i w t), so that an index eta + ik with k >= 0 absorbs;
r_p = -r_s at normal incidence; powers are fractions. Every function broadcasts its arguments as
NumPy does, keeps their dtype (float32 or float64; integers become the default float), and works
under `jit`, `vmap` and `grad`. Lists are taken; float16 and bfloat16 are refused.

NaN in is NaN out. A cosine above 1, as the rounded dot product of two unit vectors gives it, counts
as 1, in value and derivative. The values of Python numbers, NumPy arrays and JAX arrays in the
memory of the CPU are checked (of a large array 1,024 of them): a cosine above 1.001, which is an
angle in degrees, and a k < 0 are refused. Arrays on another device and traced ones are not checked:
there |cos| > 1 counts as 1, and the result for k < 0 has no meaning. An index of 0 or below and an
infinite one are refused likewise: a perfect conductor is a large k, 1e8 for example.

Both media absorbing: a complex `eta_i` is refused, because incident and reflected wave interfere
there, so that R and T are no separate powers (R + T is not 1), and because the root for cos_t has
no branch that both decays and carries power forward at every angle. `fresnel_complex(cos, N / N_i)`
is the abs(r)^2 that one gets by dividing the indices, as long as Im(N / N_i) >= 0.
`layers.stack(cos, [N_i, N], thickness_um=[], ...)` takes a first medium that absorbs; its docstring
states what R and T are there, and which of the two roots is taken (Re Q + Im Q >= 0).

Accuracy
--------
Largest error over cosines from 1e-12, indices from 1e-6 to 1e8, k = 0 and from 1e-30 to 1e8,
eta_i from .03 to 30, in float32 and in float64, against 1,000-bit arithmetic at the exact inputs,
as `make accuracy-search` looks for it (random points, most of them beside grazing incidence, index
match, the critical or Brewster's angle; then a hill climb on the error): 9 eps of each R and T of s
and p, 8 eps of `reflectance` and of amplitudes (of an R below eps^2: of eps^2; of a T
below 1e13 times the smallest float: of that).

Gradients are measured by relative changes of the arguments, (cos dR/dcos, |N| dR/deta, |N| dR/dk,
eta_i dR/deta_i): their error is within 50 + 4 (eta_i / |N|)^2 eps of the norm of that, of
`reflectance` within 50 + 100 (eta_i / |N|)^2 eps. The second term counts at Brewster's and the
critical angle of small indices, which are close to the normal (`powers` sums exactly there what
`reflectance` does not). In plain numbers dR/dcos weighs |N| times as much: beside the
pseudo-Brewster angle, where it passes through 0, it is the difference of numbers |N|^2 times as
large as the other derivatives, and its error is a few eps of these numbers.

Derivatives at singular points
------------------------------
At the critical angle itself, and for matched media at cos = 0, derivatives are infinite or
undefined; 0 is returned. `cos_theta_i` = 0 is differentiated from above. For k = 0 the derivative
with respect to k is the one-sided one (k >= 0), which is not 0 in total reflection.

References: M. Born and E. Wolf, Principles of Optics, 7th ed., secs. 1.5 and 14.2; M. Pharr,
W. Jakob and G. Humphreys, Physically Based Rendering, 4th ed., sec. 9.3. The algebra is our own
and stands in the files of `boundary`.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Complex, Float

from ._numerics.arguments import all_floats, as_floats, lossless, real, structure
from ._numerics.index import IndexLike
from ._numerics.results import exported
from .boundary.amplitudes import amplitudes_kernel
from .boundary.powers import plain_powers_kernel, powers_kernel
from .boundary.unpolarized import unpolarized_kernel

__all__ = [
    "Amplitudes",
    "Powers",
    "amplitudes",
    "fresnel_complex",
    "fresnel_conductor",
    "fresnel_dielectric",
    "powers",
    "reflectance",
]


@exported
class Powers(NamedTuple):
    """Reflected and transmitted fractions of the incident power, for s and p polarization.

    All are real, of the broadcast shape of the arguments.
    """

    R_s: Float[Array, "..."]
    R_p: Float[Array, "..."]
    T_s: Float[Array, "..."]
    T_p: Float[Array, "..."]

    @property
    def R(self) -> Array:
        """Reflectance of unpolarized light."""
        return 0.5 * (self.R_s + self.R_p)

    @property
    def T(self) -> Array:
        """Transmittance of unpolarized light."""
        return 0.5 * (self.T_s + self.T_p)


@exported
class Amplitudes(NamedTuple):
    """Reflected and transmitted electric fields over the incident one, for s and p polarization.

    All are complex, of the broadcast shape of the arguments.
    """

    r_s: Complex[Array, "..."]
    r_p: Complex[Array, "..."]
    t_s: Complex[Array, "..."]
    t_p: Complex[Array, "..."]


@functools.partial(jax.jit, static_argnums=4)
def _jit_powers(cos_theta_i, eta, k, eta_i, compensated):
    kernel = powers_kernel if compensated else plain_powers_kernel
    return Powers(*kernel(*as_floats(cos_theta_i, eta, k, eta_i)))


@functools.partial(jax.jit, static_argnums=4)
def _jit_reflectance(cos_theta_i, eta, k, eta_i, compensated):
    return unpolarized_kernel(*as_floats(cos_theta_i, eta, k, eta_i), compensated)


@jax.jit
def _jit_amplitudes(*arguments):
    return Amplitudes(*amplitudes_kernel(*all_floats(*arguments)))


@jax.jit
def _jit_dielectric(cos_theta_i, eta):
    c, eta, _, _ = as_floats(cos_theta_i, eta, None, None)
    inside = c < 0.0
    # 1 and eta change places; 1 / eta would lose the digits that count near the critical angle
    n, m = jnp.where(inside, 1.0, eta), jnp.where(inside, eta, 1.0)
    return unpolarized_kernel(c, n, None, m, True)


def powers(
    cos_theta_i: ArrayLike,
    eta: IndexLike,
    k: ArrayLike = 0.0,
    eta_i: IndexLike = 1.0,
    *,
    compensated: bool = True,
) -> Powers:
    """Power reflectance and transmittance for s and p polarization.

    R = abs(r)^2; T is the power that crosses the boundary, computed without forming 1 - R, so that
    small transmittances (grazing incidence, good metals) keep their digits.

    Args:
        cos_theta_i: cosine of the angle of incidence, in [-1, 1]; its sign is ignored, and what
            rounding leaves above 1 counts as 1.
        eta: real part of the absolute index of the medium that the light enters, > 0; or the
            complex index eta + ik, or an `Index(eta, k)` as a dispersion model gives it.
        k: imaginary part of that index (extinction coefficient), >= 0. Leave it out for a lossless
            medium: a Python 0 is recognised and makes the program smaller.
        eta_i: absolute index of the medium that the light comes from, real, > 0.
        compensated: a Python bool. False is for fits, which need R and its derivatives to the noise
            of data: in real arithmetic without exact sums, with which the normal equations of a
            least-squares fit take half of the time. The error of R and T is then within 16 eps of
            1 and, beside the critical angle, within 40 sqrt(eps) / cos_i, both times
            abs(eta_i / N)^2 where that is above 1; R may exceed 1 by as much.

    Returns:
        `Powers(R_s, R_p, T_s, T_p)` with `.R` and `.T` for unpolarized light. In total reflection
        with k = 0, R is exactly 1 and T exactly 0; matched media have R exactly 0. For accuracy and
        derivatives see the module's docstring.

    Raises:
        ValueError: the shapes do not broadcast; an argument other than eta is complex; one has
            another dtype than float32, float64 or an integer; or, as far as values are checked (see
            the module), a cosine is above 1.001, k below 0 or infinite, or eta or eta_i not a
            finite number above 0 (eta may be 0 beside a k).
    """
    return _jit_powers(*structure(cos_theta_i, eta, k, eta_i), bool(compensated))


def reflectance(
    cos_theta_i: ArrayLike,
    eta: IndexLike,
    k: ArrayLike = 0.0,
    eta_i: IndexLike = 1.0,
    *,
    compensated: bool = True,
) -> Array:
    """Power reflectance for unpolarized light, (R_s + R_p) / 2, at a third of the cost of `powers`.

    Args:
        cos_theta_i, eta, k, eta_i: as in `powers`.
        compensated: a Python bool. False leaves out the compensated sum that the neighbourhood of
            the critical angle needs, which takes .6 (lossless) to .75 of the time. The error is
            within 5 eps away from that angle; near it, within 24 eps / (cos_i abs(N cos_t /
            eta_i)), and at the angle itself within 40 sqrt(eps) / cos_i (6e-7 in float64, .014 in
            float32); both times abs(eta_i / N)^2 where that is above 1.

    Returns:
        R, a fraction, of the broadcast shape; within 8 eps, with `compensated`. For derivatives see
        the module's docstring.

    Raises:
        ValueError: as in `powers`.
    """
    arguments = structure(cos_theta_i, eta, k, eta_i)
    return _jit_reflectance(*arguments, bool(compensated))


def amplitudes(
    cos_theta_i: ArrayLike, eta: IndexLike, k: ArrayLike = 0.0, eta_i: IndexLike = 1.0
) -> Amplitudes:
    """Complex amplitude reflection and transmission coefficients for s and p polarization.

    r_s = (eta_i cos_i - N cos_t) / (eta_i cos_i + N cos_t),      t_s = 1 + r_s,
    r_p = (N cos_i - eta_i cos_t) / (N cos_i + eta_i cos_t),      t_p = (1 + r_p) eta_i / N,
    with N = eta + ik, N sin_t = eta_i sin_i and Im(N cos_t) >= 0.

    Args:
        cos_theta_i, eta, k, eta_i: as in `powers`.

    Returns:
        `Amplitudes(r_s, r_p, t_s, t_p)`; complex64 for float32 arguments, complex128 for float64.
        The error of each is within 8 eps of its modulus, also of r_p next to Brewster's angle.
        In the other sign convention, exp(+i w t) and eta - ik, all four are conjugated.

    Raises:
        ValueError: as in `powers`.
    """
    return _jit_amplitudes(*structure(cos_theta_i, eta, k, eta_i))


def fresnel_dielectric(cos_theta_i: ArrayLike, eta: IndexLike) -> Array:
    """Unpolarized power reflectance of a boundary between two lossless media.

    Args:
        cos_theta_i: cosine of the angle between light and outward normal, in [-1, 1]; negative if
            the light comes from inside.
        eta: relative index, inside over outside, > 0.

    Returns:
        R in [0, 1], of the broadcast shape; exactly 1 in total reflection and exactly 0 for
        eta = 1. Accuracy and derivatives are those of `reflectance`.

    Raises:
        ValueError: as in `powers`, and for a complex eta.

    Source: `FrDielectric`, Physically Based Rendering, 4th ed., sec. 9.3.5. There eta = 1 gives
    R = 1 at cos = 0; here 0.
    """
    cos_theta_i, eta = real(cos_theta_i, "cos_theta_i"), real(lossless(eta, "eta"), "eta")
    structure(cos_theta_i, eta, 0.0, 1.0)
    return _jit_dielectric(cos_theta_i, eta)


def fresnel_conductor(cos_theta_i: ArrayLike, eta: IndexLike, k: ArrayLike = 0.0) -> Array:
    """Unpolarized power reflectance of an absorbing medium; `reflectance` with eta_i = 1.

    Args:
        cos_theta_i: cosine of the angle of incidence, in [-1, 1]; its sign is ignored.
        eta, k: real and imaginary part of the relative index, inside over outside; > 0 and >= 0.

    Returns:
        R in [0, 1], of the broadcast shape, as `reflectance`.

    Raises:
        ValueError: as in `powers`.

    Source: `FrConductor`, Physically Based Rendering, 3rd ed., eq. 8.3, whose printed average of
    squares must be an average of powers.
    """
    return reflectance(cos_theta_i, eta, k)


def fresnel_complex(cos_theta_i: ArrayLike, eta: IndexLike) -> Array:
    """Unpolarized power reflectance for a complex relative index; `reflectance` with eta_i = 1.

    Args:
        cos_theta_i: cosine of the angle of incidence, in [-1, 1]; its sign is ignored.
        eta: complex relative index eta + ik, inside over outside, eta > 0 and k >= 0.

    Returns:
        R in [0, 1], of the broadcast shape, as `reflectance`.

    Raises:
        ValueError: as in `powers`.

    Source: `FrComplex`, Physically Based Rendering, 4th ed., sec. 9.3.6, which clamps a negative
    cosine to 0; here its sign is ignored.
    """
    return reflectance(cos_theta_i, eta)
