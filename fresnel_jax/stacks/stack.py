"""The public function `stack` of `layers`: any number of layers between two half-spaces."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, ArrayLike, Complex, Float

from .._numerics.arguments import (
    as_floats,
    broadcast_shape,
    check_cosine,
    check_length,
    check_media,
    check_positive,
    readable,
    real,
    real_or_complex,
)
from .._numerics.complex import inverse, times
from .._numerics.double_word import ratio
from .._numerics.index import Index, IndexLike
from .._numerics.results import exported
from ..boundary.boundary import unsigned
from .coherent import ambient
from .fast import fast_sums
from .packets import mixed, packet
from .uniaxial import Extraordinary, split


@exported
class Stack(NamedTuple):
    """What a stack of layers reflects, transmits and absorbs, for s and p polarization.

    Powers are fractions of the incident power, of the broadcast shape; the absorptions have the
    layers on their leading axis. The amplitudes are complex. cross: r_p r_s*, summed over the
    reflections of incoherent layers. None is what `stack` says that it does not compute.
    """

    R_s: Float[Array, "..."]
    R_p: Float[Array, "..."]
    T_s: Float[Array, "..."]
    T_p: Float[Array, "..."]
    r_s: Complex[Array, "..."] | None
    r_p: Complex[Array, "..."] | None
    t_s: Complex[Array, "..."] | None
    t_p: Complex[Array, "..."] | None
    A_s: Float[Array, "layers ..."] | None
    A_p: Float[Array, "layers ..."] | None
    cross: Complex[Array, "..."] | None

    @property
    def R(self) -> Float[Array, "..."]:
        """Reflectance of unpolarized light."""
        return 0.5 * (self.R_s + self.R_p)

    @property
    def T(self) -> Float[Array, "..."]:
        """Transmittance of unpolarized light."""
        return 0.5 * (self.T_s + self.T_p)

    @property
    def A(self) -> Float[Array, "layers ..."]:
        """Absorptance of every layer for unpolarized light; layers on the leading axis.

        Raises AttributeError for a result of `exact=False`, which has none.
        """
        if self.A_s is None or self.A_p is None:
            raise AttributeError("stack(..., exact=False) computes no absorption of its layers")
        return 0.5 * (self.A_s + self.A_p)


@functools.partial(jax.jit, static_argnums=(6, 7))
def _jit_stack(c, n, k, thickness, wavelength, roughness, coherent, shape, e=None):
    front = ambient(unsigned(c)[0], n[0], None if k is None else k[0])
    x = ratio(thickness, wavelength)
    if not all(coherent):
        R, T, A = mixed(front, n, k, x, coherent, shape, e)
        R, T = ([jnp.broadcast_to(z, shape) for z in power] for power in (R, T))
        return Stack(R[0], R[1], T[0], T[1], None, None, None, None, A[0], A[1], None)
    sigma = None if roughness is None else roughness / wavelength
    whole = packet(front, n, k, x, shape, sigma, e=e)
    n_far = (n[-1], None if k is None else k[-1])
    t_p = times(whole.t[1], times((front.n, front.k), inverse(n_far)))
    amplitudes = (lax.complex(*z) for z in (*whole.r, whole.t[0], t_p))
    R_s, R_p, T_s, T_p, r_s, r_p, t_s, t_p = (
        jnp.broadcast_to(z, shape) for z in (*whole.R, *whole.T, *amplitudes)
    )
    return Stack(R_s, R_p, T_s, T_p, r_s, r_p, t_s, t_p, *whole.absorption, r_p * jnp.conj(r_s))


@functools.partial(jax.jit, static_argnums=(5, 6))
def _jit_fast(c, eta_i, index, thickness, wavelength, coherent, shape, e=None):
    out = fast_sums(unsigned(c)[0], eta_i, index, thickness, wavelength, coherent, e)
    amplitudes = (None,) * 4 if out.r is None or out.t is None else (*out.r, *out.t)
    found = (*out.R, *out.T, *amplitudes, None, None, out.cross)
    return Stack._make(None if z is None else jnp.broadcast_to(z, shape) for z in found)


def _check_uniaxial(of_axis: Sequence[Any], coherent: Sequence[bool], roughness: Any) -> None:
    """Raise ValueError where uniaxial media have no formula."""
    if roughness is not None:
        raise ValueError("roughness_um with Uniaxial media has no formula; leave one of them out")
    for i, interferes in enumerate(coherent):
        if of_axis[i + 1] is not None and not interferes:
            raise ValueError(
                f"layer {i + 1} is Uniaxial and incoherent, which has no formula, since the phases "
                "of s and p differ in it; coherent=True is wanted for it"
            )


def _as_complex(index: Any) -> Any:
    """Media with each `Index` among them, or all of them as one, as complex numbers."""
    if isinstance(index, Index):
        return index.complex
    return [*map(_as_complex, index)] if isinstance(index, (list, tuple)) else index


def with_leading_axis(values: Any, name: str, least: int) -> Array:
    """An array with the media or layers on its leading axis, from an array or a sequence."""
    values = _as_complex(values)
    several = isinstance(values, (list, tuple))
    numbers = []
    for entry in values if several else (values,):
        numbers.append(real_or_complex(entry, name))
        if name == "index":
            check_media(numbers[-1])
        else:
            check_length(numbers[-1], name)
    if several:
        values = numbers
        try:
            values = jnp.stack(jnp.broadcast_arrays(*values)) if values else jnp.full((0,), 0.0)
        except ValueError:
            shapes = ", ".join(str(jnp.shape(z)) for z in values)
            raise ValueError(
                f"the entries of {name} have the shapes {shapes}, which do not broadcast"
            ) from None
    values = jnp.asarray(values)
    if values.ndim == 0 or values.shape[0] < least:
        raise ValueError(
            f"{name} has the shape {values.shape}; its leading axis counts the "
            + ("media: before the stack, each layer, behind it" if least else "layers")
        )
    return values


def read_media(index: Any, thickness_um: Any) -> tuple[Any, Any, Array, Array | None, Array]:
    """The ordinary indices as given, those along the axis, both as arrays, and the thicknesses.

    Both as given may be lists; those along the axis are None where no medium is uniaxial.
    """
    index, of_axis = split(index)
    for medium in index if isinstance(index, list | tuple) and not isinstance(index, Index) else ():
        if isinstance(medium, tuple) and not isinstance(medium, Index):
            raise ValueError(
                f"an entry of index is a tuple of {len(medium)}; wanted a real or a complex index, "
                "an array of them or an Index(eta, k)"
            )
    index, of_axis = _as_complex(index), _as_complex(of_axis)
    media, along = with_leading_axis(index, "index", 2), None
    if of_axis is not None:
        pairs = zip(index, of_axis, strict=True)
        along = with_leading_axis([n if e is None else e for n, e in pairs], "index", 2)
    thickness = with_leading_axis(thickness_um, "thickness_um", 0)
    if jnp.iscomplexobj(thickness):
        raise ValueError("thickness_um is complex, a real number is wanted; only index is complex")
    if media.shape[0] != thickness.shape[0] + 2:
        raise ValueError(
            f"index has {media.shape[0]} media and thickness_um {thickness.shape[0]} layers on "
            "their leading axes; L layers lie between L + 2 media"
        )
    return index, of_axis, media, along, thickness


def behind_leading_axis(z: Array, dimensions: int) -> Array:
    """What follows the leading axis of z with as many axes as the result has."""
    return z.reshape(z.shape[:1] + (1,) * (dimensions - z.ndim + 1) + z.shape[1:])


def lossless_first(index: Any, function: str = "exact=False") -> Any:
    """The real index of the first medium, for the fast tier, which has no other."""
    first = real_or_complex(index[0], "index")
    if not jnp.iscomplexobj(first):
        return first
    if readable(first) and np.any(np.imag(first) != 0.0):
        raise ValueError(
            f"the first medium of index absorbs, for which {function} has no formula; "
            "stack(..., exact=True) has"
        )
    return jnp.where(jnp.imag(first) == 0.0, jnp.real(first), jnp.nan)


def _coherence(coherent: Any, count: int) -> tuple[bool, ...]:
    """One Python bool for each layer."""
    if isinstance(coherent, (bool, np.bool_)):
        return (bool(coherent),) * count
    try:
        flags = tuple(coherent)
    except TypeError:
        flags = ()
    if len(flags) != count or not all(isinstance(z, (bool, np.bool_)) for z in flags):
        raise ValueError(
            f"coherent is {coherent!r}; True, False or one of them for each of the {count} layers "
            "is wanted, as Python values: they decide which program is compiled"
        )
    return tuple(bool(z) for z in flags)


def stack(
    cos_theta_i: ArrayLike,
    index: IndexLike | Sequence[Any],
    *,
    thickness_um: ArrayLike | Sequence[Any],
    wavelength_um: ArrayLike,
    coherent: bool | Sequence[bool] = True,
    roughness_um: ArrayLike | Sequence[Any] | None = None,
    exact: bool = True,
) -> Stack:
    """Reflectance, transmittance and absorption of layers between two half-spaces, for s and p.

    Args:
        cos_theta_i: cosine of the angle of incidence in the first medium, in [-1, 1]; its sign is
            ignored.
        index: absolute indices eta + ik, k >= 0, of the L + 2 media, from the one that the light
            comes from to the one behind, on the leading axis; real (faster), complex or an
            `Index`. What follows the leading axis broadcasts with the other arguments. A list or
            tuple of entries that broadcast with each other is stacked; in it coherent layers and
            the last medium may be `Uniaxial`, where boundaries are smooth.
        thickness_um: micrometres, >= 0, of the L layers, on the leading axis; likewise.
        wavelength_um: vacuum wavelength in micrometres, > 0.
        coherent: whether the light that a layer reflects to and fro interferes: True for films;
            False for a layer whose thickness varies by more than a wavelength, or exceeds what the
            light is coherent over, such as a window or a wafer in white light. Or one Python bool
            for each layer. The compiled program depends on it.
        roughness_um: root-mean-square roughness >= 0 of the L + 1 boundaries on the leading axis,
            micrometres, as a factor of Nevot and Croce on the amplitude that each reflects; for
            coherent stacks. It describes what is reflected specularly by boundaries that are
            smooth over a wavelength along them; light that roughness scatters is in none of the
            results, so that R + T + sum(A) is not 1. None: smooth.
        exact: False for the fast tier: Airy's recursion on complex numbers, for fits and scenes.
            Its errors grow with the phase of the layers, 2 pi |N| thickness / wavelength: of random
            stacks 99.9 % are within 60 eps for each radian, and next to the critical angle of a
            layer half the digits may be lost (worst of 160,000: R 1,600, T 6,800 eps a radian). The
            first medium must be lossless (a traced one that absorbs gives NaN), boundaries smooth.
            In a list or tuple of media or layers those that are not differentiated cost nothing.

    Returns:
        `Stack(R_s, R_p, T_s, T_p, r_s, r_p, t_s, t_p, A_s, A_p, cross)` with `.R`, `.T` and `.A`
        for unpolarized light, of the broadcast shape and the dtype of the arguments; A_s, A_p and A
        have the layers on their leading axis. r and t are ratios of the electric fields at the
        outer boundaries (signs as in `interface.amplitudes`), None where a layer is incoherent;
        in a uniaxial last medium t_p is the ratio of the magnetic fields times N_0 / N_o.
        `cross` is r_p r_s*, from which psi and Delta follow; with incoherent layers, of the fast
        tier alone, summed over their reflections: light that is partly depolarized. The fast tier
        has no A.

        R = abs(r)^2, T is the power along the normal behind the stack over the incident one, and
        R + T + sum(A) = 1. If the first medium absorbs, R and T are the same ratios, but incident
        and reflected wave also carry power together, so that R + T + sum(A) = 1 + 2 Im(r) Im(Y) /
        Re(Y), with Y = Q_0 for s and Q_0 / N_0^2 for p; A is then the power along the normal that
        enters a layer less that which leaves it. Of the two waves in the last medium the one with
        Re Q + Im Q >= 0 leaves the stack there, not the one with Im Q >= 0 (the condition of the
        package tmm): with that a trace of absorption in front would turn the refracted wave round,
        and R into 1 / R (docs/stacks.md).

        Accuracy: 64 eps of each R and T (8 eps for each layer of more than ten), or of what a
        relative change of one eps in each argument does to it, if that is more: the bound is one of
        the conditioning. Of the value alone it holds for nearly all stacks of up to three layers;
        of ten layers one value in a thousand is 65 to 877 eps off. See docs/stacks.md. No angle,
        thickness or index of the domain overflows or gives NaN:
        thicknesses up to 1e30 wavelengths and moduli of the indices from 1e-6 to 1e8 (float32: up
        to 1e20, and from 1e-3 to 1e4). There are two exceptions: the wave that an absorbing first
        medium sends obliquely into a clear incoherent layer grows with the depth, and where the sum
        over its reflections diverges all results are NaN; and Nevot and Croce's factor grows where
        the waves on both sides of a boundary are evanescent, and overflows for a roughness of many
        of their depths. A lossless substrate beyond its critical angle has T = 0.

    Derivatives with respect to every argument are finite and right wherever the truth is finite:
    also for a thickness of 0, k = 0 (one-sided), in total reflection and at the critical angle of
    a layer. At that of the last medium, where they are infinite, 0 is returned for its part. In
    total reflection at grazing incidence, where the gradient of R goes to 0 with the cosine, an
    absolute error of some eps is left.

    Raises:
        ValueError: shapes that do not fit each other; a complex argument other than index; a type
            that is neither float32 nor float64; a `coherent` that is not static; or, where it can
            be read (see the module `interface`), a cosine above 1.001, an index that is 0, infinite
            or has a part below 0, a thickness or roughness that is negative or infinite, a
            wavelength that is not a finite number above 0.
    """
    index, of_axis, media, along, thickness = read_media(index, thickness_um)
    if jnp.iscomplexobj(cos_theta_i):
        raise ValueError(
            "cos_theta_i is complex, a real number is wanted. Then abs(r)^2 in an absorbing first "
            "medium is no ratio of powers; put the lossless medium that the light came from first, "
            "and the absorbing one as a layer"
        )
    cos_theta_i, wavelength_um = (
        real(cos_theta_i, "cos_theta_i"),
        real(wavelength_um, "wavelength_um"),
    )
    check_cosine(cos_theta_i)
    check_positive(wavelength_um, "wavelength_um")
    flags = _coherence(coherent, thickness.shape[0])
    if of_axis is not None:
        _check_uniaxial(of_axis, flags, roughness_um)
    roughness = None if roughness_um is None else with_leading_axis(roughness_um, "roughness_um", 1)
    if roughness is not None and (roughness.shape[0] != media.shape[0] - 1 or not all(flags)):
        raise ValueError(
            f"roughness_um has {roughness.shape[0]} boundaries on its leading axis; a stack of "
            f"{media.shape[0]} media has {media.shape[0] - 1}, and all its layers must be coherent"
        )
    if roughness is not None and not exact:
        raise ValueError("exact=False has no rough boundaries; leave exact=True with roughness_um")
    parts = {"index": media, "extraordinary index": along}
    parts |= {"thickness_um": thickness, "roughness_um": roughness}
    behind = {
        f"{name} behind its leading axis": z.shape[1:] for name, z in parts.items() if z is not None
    }
    shape = broadcast_shape(cos_theta_i=cos_theta_i, wavelength_um=wavelength_um, **behind)
    if not exact:
        reals = jnp.real(media), thickness, cos_theta_i, wavelength_um
        reals = reals if along is None else (*reals, jnp.real(along))
        dtype = jnp.result_type(*reals, 1.0)
        given = lossless_first(index if isinstance(index, (list, tuple)) else media)
        c, eta_i, wavelength = (jnp.asarray(z, dtype) for z in (cos_theta_i, given, wavelength_um))
        layers = [
            tuple(jnp.asarray(z, kind) for z in values)
            if isinstance(values, (list, tuple))
            else behind_leading_axis(array.astype(kind), len(shape))
            for values, array, kind in (
                (index, media, np.result_type(dtype, np.complex64)),
                (thickness_um, thickness, dtype),
            )
        ]
        kind = np.result_type(dtype, np.complex64)
        e = of_axis and tuple(None if z is None else jnp.asarray(z, kind) for z in of_axis[1:])
        return _jit_fast(c, eta_i, layers[0][1:], layers[1], wavelength, flags, shape, e)
    absorbs = any(z is not None and jnp.iscomplexobj(z) for z in (media, along))
    n_e, k_e = (None, None) if along is None else (jnp.real(along), jnp.imag(along))
    c, wavelength, *layers = as_floats(
        cos_theta_i,
        wavelength_um,
        jnp.real(media),
        jnp.imag(media) if absorbs else None,
        thickness,
        roughness,
        n_e,
        k_e if absorbs else None,
    )

    n, k, x, sigma, n_e, k_e = (
        None if z is None else behind_leading_axis(z, len(shape)) for z in layers
    )
    wavelength = behind_leading_axis(wavelength[None], len(shape))
    e = None if n_e is None else Extraordinary(n_e, k_e)
    return _jit_stack(c, n, k, x, wavelength, sigma, flags, shape, e)
