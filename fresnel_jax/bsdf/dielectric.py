"""One dielectric interface, smooth or rough: reflection and refraction."""

from __future__ import annotations

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike

from .._numerics.arguments import float_named, index_named, values_shown
from .._numerics.fences import computed_once
from .._numerics.vectors import Vector, dot, once, select
from ..boundary.shares import Shares, shares
from ..directions import reflect_components, refract_components, sides
from ..microfacet import (
    Bounce,
    TrowbridgeReitz,
    bounce,
    half_vector_of,
    per_length_squared,
    two_numbers,
    visible_normal,
)
from .scattering import (
    BSDFSample,
    Lobes,
    ScatteringFlags,
    TransportMode,
    assemble,
    choose_lobe,
    in_lobes,
    local_direction,
    nothing,
    upward,
)


class _Meeting(NamedTuple):
    """Two directions and the facet that takes one into the other."""

    bounce: Bounce  # of reflection or of refraction, without its Fresnel factor
    fresnel: Shares
    reflection: Array
    possible: Array
    nothing: Array  # 0, or NaN where something came that is NaN


def _shares(cosine: Array, eta_t: Array, eta_i: Array, exactly: bool) -> Shares:
    dtype = jnp.result_type(cosine, eta_t)
    found = shares(*(a.astype(dtype) for a in (cosine, eta_t, eta_i)), exactly)
    return Shares(*map(computed_once, found))


def _choose(condition: Array, a: Bounce, b: Bounce) -> Bounce:
    return Bounce(*(jnp.where(condition, x, y) for x, y in zip(a, b, strict=True)))


class Dielectric(eqx.Module):
    """An interface between transparent media that reflects and refracts, smooth or rough.

    Reflection: f = R D G / (4 |cos_o cos_i|). Refraction:
    f = T D G |w_o . m| |w_i . m| eta^2 / (|cos_o cos_i| (eta_o w_o . m + eta_i w_i . m)^2), with
    eta = eta_o for radiance and eta_i for importance; R and T at the facet; G as
    `TrowbridgeReitz.G` for both. Smooth: the delta distributions R / |cos_i| and
    T (eta_o / eta_i)^2 / |cos_i|. Reflection is chosen with probability R / (R + T), of the lobes
    wanted.

    Arguments: `eta` > 0, index inside over outside; `distribution`, the facets (None: smooth; also
    smooth where `distribution.effectively_smooth()`, and where eta is exactly 1, since facets do
    not bend light then: only transmission is left); `reflection_scale`, `transmission_scale`,
    factors for effects outside of the model, which do not change the choice of the lobe; `lobes`,
    the ones that the surface has. See the module `bsdf` for the methods that all models share.
    Source: PBRT 3rd ed. `FresnelSpecular`, 4th ed. sec. 9.5 and 9.7; Walter et al. 2007,
    doi:10.2312/EGWR/EGSR07/195-206.
    """

    __repr__ = values_shown  # pyright: ignore[reportAssignmentType]

    eta: Array = eqx.field(converter=index_named("eta"))
    distribution: TrowbridgeReitz | None = None
    reflection_scale: Array = eqx.field(converter=float_named("reflection_scale"), default=1.0)
    transmission_scale: Array = eqx.field(converter=float_named("transmission_scale"), default=1.0)
    lobes: Lobes = eqx.field(static=True, default=Lobes.ALL)

    def _is_delta(self) -> Array:
        matched = self.eta == 1.0
        if self.distribution is None:
            return jnp.ones_like(matched)
        return matched | self.distribution.effectively_smooth()

    def flags(self) -> ScatteringFlags:
        """What is sampled: transmission alone at eta = 1, specular there and where smooth."""
        delta = self._is_delta()
        everywhere = jnp.ones_like(delta)
        return ScatteringFlags(
            everywhere & (self.eta != 1.0) & (Lobes.REFLECTION in self.lobes),
            everywhere & (Lobes.TRANSMISSION in self.lobes),
            delta,
            ~delta,
        )

    def _refracted(
        self, reflected: Bounce, o: Vector, c_o: Array, c_i: Array, mode: TransportMode
    ) -> Bounce:
        """The bounce turned into one across the surface: see `microfacet`."""
        eta_o, eta_i = sides(o.z < 0.0, self.eta)
        both = 4.0 * c_o * c_i * per_length_squared(o.z < 0.0, c_o, c_i, self.eta)
        spread = eta_o / eta_i if mode is TransportMode.RADIANCE else jnp.ones_like(eta_o)
        spread = spread * spread
        return Bounce(
            reflected.value * both * eta_i * eta_i * spread,
            reflected.density * both * eta_i * eta_i,
            reflected.weight * spread,
        )

    def _meeting(self, wo: ArrayLike, wi: ArrayLike, mode: TransportMode) -> _Meeting:
        assert self.distribution is not None
        o, o_leaves = local_direction(wo, "wo")
        i, i_leaves = local_direction(wi, "wi")
        reflection = o.z * i.z > 0.0
        m = half_vector_of(o, i, self.eta)
        dot_o, dot_i = computed_once(dot(o, m)), computed_once(dot(i, m))
        c_o, c_i = jnp.abs(dot_o), jnp.abs(dot_i)
        eta_o, eta_i = sides(o.z < 0.0, self.eta)
        reflected = bounce(self.distribution, o, i, m)
        refracted = self._refracted(reflected, o, c_o, c_i, mode)
        # A facet seen from its back takes part in nothing (PBRT 4th ed. sec. 9.7.2).
        facing = (dot_o * o.z > 0.0) & (dot_i * i.z > 0.0)
        # T is the same seen from w_i. Seen from the less dense side there is no critical angle, at
        # which the rounding of the cosine would be magnified (by 5e3 among 2e3 table entries).
        from_o = reflection | (eta_o <= eta_i)
        cosine = jnp.where(from_o, c_o, c_i)
        eta_here, eta_there = jnp.where(from_o, eta_o, eta_i), jnp.where(from_o, eta_i, eta_o)
        return _Meeting(
            _choose(reflection, reflected, refracted),
            _shares(cosine, eta_there, eta_here, False),
            reflection,
            o_leaves & i_leaves & facing & ~self._is_delta(),
            nothing(self, o, i),
        )

    def evaluate(
        self, wo: ArrayLike, wi: ArrayLike, mode: TransportMode = TransportMode.RADIANCE
    ) -> Array:
        """f(wo, wi), shape (...); 0 where the surface is specular."""
        if self.distribution is None:
            return nothing(self, local_direction(wo, "wo")[0], local_direction(wi, "wi")[0])
        meeting = self._meeting(wo, wi, mode)
        reflected, transmitted = in_lobes(self.lobes, *meeting.fresnel)
        fresnel = jnp.where(
            meeting.reflection,
            self.reflection_scale * reflected,
            self.transmission_scale * transmitted,
        )
        return jnp.where(meeting.possible, fresnel * meeting.bounce.value, meeting.nothing)

    def density(self, wo: ArrayLike, wi: ArrayLike, lobes: Lobes = Lobes.ALL) -> Array:
        """Density per solid angle with which `sample` draws wi, shape (...); 0 where specular."""
        if self.distribution is None:
            return nothing(self, local_direction(wo, "wo")[0], local_direction(wi, "wi")[0])
        meeting = self._meeting(wo, wi, TransportMode.IMPORTANCE)
        reflected, transmitted = in_lobes(lobes & self.lobes, *meeting.fresnel)
        total = reflected + transmitted
        chosen = jnp.where(meeting.reflection, reflected, transmitted)
        probability = chosen / jnp.where(total > 0.0, total, 1.0)
        return jnp.where(meeting.possible, probability * meeting.bounce.density, meeting.nothing)

    def sample(
        self,
        wo: ArrayLike,
        u_lobe: ArrayLike,
        u: ArrayLike,
        lobes: Lobes = Lobes.ALL,
        mode: TransportMode = TransportMode.RADIANCE,
    ) -> BSDFSample:
        """Reflects wo at a visible facet if u_lobe < R / (R + T), refracts it otherwise."""
        o, leaves = local_direction(wo, "wo")
        u1, u2 = (a.astype(o.z.dtype) for a in two_numbers(u))
        delta = self._is_delta()
        m = upward(o)
        if self.distribution is not None:
            m = select(delta, m, visible_normal(self.distribution.bounded(), o, u1, u2))
        cosine = computed_once(dot(o, m))
        eta_o, eta_i = sides(o.z < 0.0, self.eta)
        fresnel = _shares(cosine, eta_i, eta_o, True)
        reflected, transmitted = in_lobes(lobes & self.lobes, *fresnel)
        reflection, power, probability, possible = choose_lobe(u_lobe, reflected, transmitted)
        mirrored = reflect_components(o, m, cosine)
        bent, cos_t, bends = refract_components(o, m, cosine, eta_o, eta_i)
        i = once(select(reflection, mirrored, bent))
        on_its_side = jnp.where(reflection, o.z * i.z > 0.0, (o.z * i.z < 0.0) & bends)
        valid = leaves & on_its_side & possible

        one = jnp.ones_like(o.z)
        smooth = Bounce(1.0 / jnp.where(valid, jnp.abs(i.z), one), one, one)
        spread = jnp.where(reflection, one, eta_o / eta_i)
        if mode is TransportMode.IMPORTANCE:
            spread = one
        result = Bounce(smooth.value * spread * spread, one, spread * spread)
        if self.distribution is not None:
            same_side = bounce(self.distribution, o, i, m)
            across = self._refracted(same_side, o, jnp.abs(cosine), cos_t, mode)
            result = _choose(delta, result, _choose(reflection, same_side, across))
        scale = jnp.where(reflection, self.reflection_scale, self.transmission_scale)
        return assemble(
            i,
            scale * power * result.value,
            probability * result.density,
            scale * (power / probability) * result.weight,
            jnp.where(reflection, one, eta_i / eta_o),
            ~reflection,
            delta,
            valid,
        )
