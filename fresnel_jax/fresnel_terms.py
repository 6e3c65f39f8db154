"""Interchangeable Fresnel terms: each maps the cosine at the (micro)surface to a reflectance.

They are pytrees; `jax.vmap` over their fields or over the cosine and broadcasting both work.
"""

from __future__ import annotations

import functools

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike

from ._numerics.arguments import (
    check_index,
    check_length,
    check_positive,
    extinction,
    float_checked,
    float_named,
    index_named,
    index_parts,
)
from ._numerics.index import IndexLike
from .interface import reflectance
from .layers import stack
from .stacks.stack import with_leading_axis

__all__ = [
    "FresnelConductor",
    "FresnelDielectric",
    "FresnelNone",
    "FresnelStack",
    "FresnelTerm",
]


class FresnelDielectric(eqx.Module):
    """Reflectance between two transparent media; the sign of the cosine picks the side.

    Arguments: `eta` > 0, index inside; `eta_outside` > 0, index outside (1: `eta` is relative).
    Accuracy and derivatives as `interface.reflectance`.
    Source: PBRT 3rd ed. `FresnelDielectric`, 4th ed. sec. 9.3.5.
    """

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


class FresnelNone(eqx.Module):
    """No Fresnel effect: everything is reflected. Source: PBRT 3rd ed. `FresnelNoOp`."""

    def __call__(self, cos_theta: ArrayLike) -> Array:
        """1 for every `cos_theta`, shape (...)."""
        cosine = jnp.asarray(cos_theta)
        known = jnp.where(cosine == cosine, 1.0, jnp.nan)
        return known.astype(jnp.result_type(cosine, 1.0))


FresnelTerm = FresnelDielectric | FresnelConductor | FresnelStack | FresnelNone
