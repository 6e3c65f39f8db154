"""Surfaces that only reflect: mirror or Trowbridge-Reitz facets under any Fresnel term."""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike

from .._numerics.arguments import float_named, values_shown
from .._numerics.fences import computed_once
from .._numerics.vectors import Vector, dot, once, select
from ..directions import reflect_components
from ..fresnel_terms import FresnelTerm
from ..microfacet import TrowbridgeReitz, bounce, half_vector_of, two_numbers, visible_normal
from .scattering import (
    BSDFSample,
    Lobes,
    ScatteringFlags,
    TransportMode,
    assemble,
    local_direction,
    upward,
    zero_or_nan,
)


class Reflector(eqx.Module):
    """A reflecting surface: `scale` times its Fresnel term, smooth or rough.

    f = scale F D G / (4 |cos_o cos_i|); smooth: the delta distribution scale F / |cos_i|.

    Arguments: `fresnel`, any of the Fresnel terms; `distribution`, the facets, `TrowbridgeReitz` or
    `Beckmann` (None: smooth; also smooth where `distribution.effectively_smooth()`); `scale`, a
    factor for effects outside of the model, usually a colour. Both sides reflect.
    See the module `bsdf` for the methods that all models share.
    Source: PBRT 3rd ed. `SpecularReflection`, 4th ed. `ConductorBxDF`.
    """

    __repr__ = values_shown  # pyright: ignore[reportAssignmentType]

    fresnel: FresnelTerm
    distribution: TrowbridgeReitz | None = None
    scale: Array = eqx.field(converter=float_named("scale"), default=1.0)

    def _is_delta(self) -> Array:
        if self.distribution is None:
            return jnp.asarray(True)
        return self.distribution.effectively_smooth()

    def flags(self) -> ScatteringFlags:
        """Reflection, specular where smooth."""
        delta = self._is_delta()
        return ScatteringFlags(jnp.ones_like(delta), jnp.zeros_like(delta), delta, ~delta)

    def evaluate(
        self, wo: ArrayLike, wi: ArrayLike, mode: TransportMode = TransportMode.RADIANCE
    ) -> Array:
        """f(wo, wi), shape (...); 0 where smooth and across the surface; `mode` changes nothing."""
        o, i, m, possible = self._facet(wo, wi)
        reflected = self.scale * self.fresnel(dot(o, m))
        none = zero_or_nan(*o, *i, *jax.tree.leaves(self.distribution), reflected)
        if self.distribution is None:
            return none
        return jnp.where(possible, reflected * bounce(self.distribution, o, i, m).value, none)

    def density(self, wo: ArrayLike, wi: ArrayLike, lobes: Lobes = Lobes.ALL) -> Array:
        """Density per solid angle with which `sample` draws wi, shape (...); 0 if smooth."""
        o, i, m, possible = self._facet(wo, wi)
        none = zero_or_nan(*o, *i, *jax.tree.leaves(self.distribution))
        if self.distribution is None or Lobes.REFLECTION not in lobes:
            return none
        return jnp.where(possible, bounce(self.distribution, o, i, m).density, none)

    def _facet(self, wo: ArrayLike, wi: ArrayLike) -> tuple[Vector, Vector, Vector, Array]:
        o, o_leaves = local_direction(wo, "wo")
        i, i_leaves = local_direction(wi, "wi")
        possible = o_leaves & i_leaves & (o.z * i.z > 0.0) & ~self._is_delta()
        return o, i, half_vector_of(o, i, jnp.ones_like(o.z)), possible

    def sample(
        self,
        wo: ArrayLike,
        u_lobe: ArrayLike,
        u: ArrayLike,
        lobes: Lobes = Lobes.ALL,
        mode: TransportMode = TransportMode.RADIANCE,
    ) -> BSDFSample:
        """Mirrors wo at a visible facet. `u_lobe` and `mode` change nothing."""
        o, leaves = local_direction(wo, "wo")
        u1, u2 = (a.astype(o.z.dtype) for a in two_numbers(u))
        delta = self._is_delta()
        m = upward(o)
        if self.distribution is not None:
            m = select(delta, m, visible_normal(self.distribution.bounded(), o, u1, u2))
        cosine = computed_once(dot(o, m))
        i = once(reflect_components(o, m, cosine))
        reflected = self.scale * computed_once(self.fresnel(cosine))
        valid = leaves & (o.z * i.z > 0.0) & (Lobes.REFLECTION in lobes)
        value = 1.0 / jnp.where(valid, jnp.abs(i.z), 1.0)
        density = weight = jnp.ones_like(value)
        if self.distribution is not None:
            rough = bounce(self.distribution, o, i, m)
            value = jnp.where(delta, value, rough.value)
            density = jnp.where(delta, density, rough.density)
            weight = jnp.where(delta, weight, rough.weight)
        never = jnp.zeros_like(valid)
        return assemble(
            i, reflected * value, density, reflected * weight, jnp.ones_like(o.z), never,
            delta, valid,
        )  # fmt: skip
