"""Interchangeable Fresnel terms: each maps the cosine at the (micro)surface to a reflectance.

They are pytrees; `jax.vmap` over their fields or over the cosine and broadcasting both work.
"""

from __future__ import annotations

import functools

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike

from ._numerics.arguments import (
    as_float,
    check_index,
    check_length,
    check_positive,
    extinction,
    float_checked,
    float_named,
    index_named,
    index_parts,
    values_shown,
)
from ._numerics.index import IndexLike
from .colour import linear_srgb, xyz
from .interface import reflectance
from .layers import stack
from .stacks.stack import with_leading_axis

__all__ = [
    "FresnelConductor",
    "FresnelDielectric",
    "FresnelFilm",
    "FresnelNone",
    "FresnelStack",
    "FresnelTerm",
]

# Of the colours of films: every 10 nm, as the visible part of the table of `colour`.
_VISIBLE_UM = np.linspace(0.38, 0.78, 41)


class FresnelDielectric(eqx.Module):
    """Reflectance between two transparent media; the sign of the cosine picks the side.

    Arguments: `eta` > 0, index inside; `eta_outside` > 0, index outside (1: `eta` is relative).
    Accuracy and derivatives as `interface.reflectance`.
    Source: PBRT 3rd ed. `FresnelDielectric`, 4th ed. sec. 9.3.5.
    """

    __repr__ = values_shown  # pyright: ignore[reportAssignmentType]

    eta: Array = eqx.field(converter=index_named("eta"))
    eta_outside: Array = eqx.field(converter=index_named("eta_outside"), default=1.0)

    def __call__(self, cos_theta: ArrayLike) -> Array:
        """R at `cos_theta` in [-1, 1] (negative: light comes from inside), shape (...)."""
        cosine = jnp.asarray(cos_theta)
        inside = cosine < 0.0
        eta_i = jnp.where(inside, self.eta, self.eta_outside)
        eta_t = jnp.where(inside, self.eta_outside, self.eta)
        return reflectance(cosine, eta_t, eta_i=eta_i)


class FresnelConductor(eqx.Module):
    """Reflectance of an absorbing medium seen from a transparent one, from either side alike.

    Arguments: `eta` > 0 and `k` >= 0, index of the conductor, or its complex index or `Index` as
    `eta` alone; `eta_outside` > 0, index of the
    medium around it. Accuracy and derivatives as `interface.reflectance`.
    Source: PBRT 3rd ed. `FresnelConductor`, 4th ed. sec. 9.3.6.
    """

    __repr__ = values_shown  # pyright: ignore[reportAssignmentType]

    eta: Array = eqx.field(converter=float_named("eta"))
    k: Array = eqx.field(converter=extinction)
    eta_outside: Array = eqx.field(converter=index_named("eta_outside"))

    def __init__(self, eta: IndexLike, k: ArrayLike = 0.0, eta_outside: IndexLike = 1.0):
        eta, k = index_parts(eta, k)
        check_index(eta, k)
        self.eta, self.k = eta, k  # pyright: ignore[reportAttributeAccessIssue]
        self.eta_outside = eta_outside  # pyright: ignore[reportAttributeAccessIssue]

    def __call__(self, cos_theta: ArrayLike) -> Array:
        """R at the absolute value of `cos_theta`, shape (...)."""
        return reflectance(cos_theta, self.eta, self.k, self.eta_outside)


class FresnelStack(eqx.Module):
    """Reflectance of films on a substrate, for unpolarized light, from either side alike.

    Arguments as those of `layers.stack`: `index` of the L + 2 media and `thickness_um` of the L
    layers, each on its leading axis, and `wavelength_um`. What follows the leading axes broadcasts
    with the cosine, so that a colour of three or a spectrum of many wavelengths takes part in the
    axes of the model as any other field does. `exact`, False for the fast tier, is no array and the
    same in all of a batch. Accuracy and derivatives as `layers.stack`.
    ValueError, as that raises it, for an index, a thickness or a wavelength that it refuses.
    Source: `layers.stack`.
    """

    __repr__ = values_shown  # pyright: ignore[reportAssignmentType]

    index: Array = eqx.field(converter=functools.partial(with_leading_axis, name="index", least=2))
    thickness_um: Array = eqx.field(converter=float_checked("thickness_um", check_length))
    wavelength_um: Array = eqx.field(converter=float_checked("wavelength_um", check_positive))
    exact: bool = eqx.field(static=True, default=True)

    def __call__(self, cos_theta: ArrayLike) -> Array:
        """R at the absolute value of `cos_theta`, shape (...)."""
        return stack(
            cos_theta, self.index, thickness_um=self.thickness_um,
            wavelength_um=self.wavelength_um, exact=self.exact,
        ).R  # fmt: skip


class FresnelFilm(eqx.Module):
    """Linear sRGB of daylight (D65) that a film on a substrate reflects: iridescence.

    Arguments: `film`, `substrate` and `outside`, the medium around them, each a model of
    `dispersion` (`material("SiO2")`) or one index of all colours, real, complex or `Index`;
    `thickness_um` of the film, a number, or of a shape that ends in 1 and broadcasts with the
    cosines; `exact`, False for the fast tier of `layers.stack`.

        skin = FresnelFilm(material("SiO2"), 0.3, material("silicon"))
        bsdf.Reflector(skin, TrowbridgeReitz(0.2)).evaluate(wo[..., None, :], wi[..., None, :])

    The colours take the last axis, (..., 3), so that directions have an axis of 1 before their own,
    and the result a colour; 1, 1, 1 is the white of a perfect mirror. Reflectances are taken every
    10 nm: films up to 1 um have the colour by 1 nm steps to 0.14 Delta E. Derivatives as
    `layers.stack`; components below 0 are colours that a screen cannot show.
    ValueError for cosines whose last axis is not 1, and as `layers.stack` raises it.
    Source: `layers.stack`, `colour`; L. Belcour and P. Barla 2017, doi:10.1145/3072959.3073620.
    """

    __repr__ = values_shown  # pyright: ignore[reportAssignmentType]

    spectrum: FresnelStack

    def __init__(self, film, thickness_um: ArrayLike, substrate, outside=1.0, exact: bool = True):
        thickness = as_float(thickness_um, "thickness_um")[None]
        wavelength = jnp.asarray(_VISIBLE_UM, thickness.dtype)
        media = [m(wavelength) if callable(m) else m for m in (outside, film, substrate)]
        self.spectrum = FresnelStack(media, thickness, wavelength, exact)

    def __call__(self, cos_theta: ArrayLike) -> Array:
        """Linear sRGB at the absolute value of `cos_theta`, (..., 1) or a number; (..., 3)."""
        cosine = jnp.asarray(cos_theta)
        if cosine.ndim and cosine.shape[-1] != 1:
            raise ValueError(
                f"cosines of the shape {cosine.shape} met a FresnelFilm; wanted (..., 1), since "
                "its colours are the last axis: give directions an axis of 1, wo[..., None, :]"
            )
        reflected = self.spectrum(cosine)
        return linear_srgb(xyz(reflected, jnp.asarray(_VISIBLE_UM, reflected.dtype)))


class FresnelNone(eqx.Module):
    """No Fresnel effect: everything is reflected. Source: PBRT 3rd ed. `FresnelNoOp`."""

    __repr__ = values_shown  # pyright: ignore[reportAssignmentType]

    def __call__(self, cos_theta: ArrayLike) -> Array:
        """1 for every `cos_theta`, shape (...)."""
        cosine = jnp.asarray(cos_theta)
        known = jnp.where(cosine == cosine, 1.0, jnp.nan)
        return known.astype(jnp.result_type(cosine, 1.0))


FresnelTerm = FresnelDielectric | FresnelConductor | FresnelStack | FresnelFilm | FresnelNone
