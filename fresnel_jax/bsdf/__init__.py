"""Models of how a surface scatters light: mirrors, dielectric interfaces, thin slabs.

`Reflector`, `Dielectric` and `ThinDielectric` are pytrees with the same four methods (directions
are unit vectors of shape (..., 3) in the local frame, normal +z outside, pointing away from the
surface; wo is the known one, wi the one found; the fields of a model broadcast against the
leading axes of directions; `jit`, `vmap` and `grad` work over a model as over any pytree, so
compile a function of the model, `jax.jit(lambda model, wo: ...)`, not a bound method):

    evaluate(wo, wi, mode)                 f, without the cosine; 0 for delta distributions
    density(wo, wi, lobes)                 density per solid angle of `sample`; 0 likewise
    sample(wo, u_lobe, u, lobes, mode)     BSDFSample, from u_lobe (...) and u (..., 2) in [0, 1]
    flags()                                ScatteringFlags, what `sample` can return

`mode` (TransportMode) and `lobes` (Lobes) are static Python values. A direction that lies in the
surface scatters nothing. For roughness 0 to 1, eta 1/4 to 4 and u in [0, 1] no value is NaN or
infinite in any direction, and no derivative either, but for what float32 cannot hold: derivatives
of `evaluate` and `density` with respect to opposite directions within 1e-8 of the surface, where
the half vector turns at a rate of 1e8. Wrong shapes raise ValueError.

Many points at once. On the CPU a million rough dielectric samples in one call spend most of their
time on fresh memory for intermediate arrays: after `performance.keep_memory` `sample` takes 0.7 of
the time, `evaluate` half of it (docs/benchmarks/bsdf.md).

What the gradient of a sample means. Differentiating `weight * L(direction)` differentiates the
expectation under the same random numbers: the direction moves with the parameters, and the
density with it. The choice of the lobe jumps, so its probability is held constant
(`stop_gradient`); weight is then F / constant and its gradient carries dF. Averages of such
gradients are unbiased for continuous L. Differentiating through the probability would cancel F
against itself and lose the Fresnel term. `value |cos| / density` has the same gradient as `weight`.
`density()`, called on its own, is differentiated in full. Where facets can stand at their critical
angle the mean gradient is still right, but its variance is infinite (dR / d eta grows as
1 / cos_t): there, add up the samples of both lobes for one facet, and expect slow averages.
"""

from __future__ import annotations

from jaxtyping import Array, ArrayLike

from .._numerics.arguments import lossless_index
from .._numerics.index import IndexLike
from ..fresnel_terms import (
    FresnelConductor,
    FresnelDielectric,
    FresnelFilm,
    FresnelNone,
    FresnelStack,
    FresnelTerm,
)
from ..microfacet import Beckmann, TrowbridgeReitz
from .dielectric import Dielectric
from .reflection import Reflector
from .scattering import BSDFSample, Lobes, ScatteringFlags, TransportMode
from .thin import ThinDielectric

__all__ = [
    "BSDF",
    "BSDFSample",
    "Beckmann",
    "Dielectric",
    "FresnelConductor",
    "FresnelDielectric",
    "FresnelFilm",
    "FresnelNone",
    "FresnelStack",
    "FresnelTerm",
    "Lobes",
    "Reflector",
    "ScatteringFlags",
    "ThinDielectric",
    "TransportMode",
    "TrowbridgeReitz",
    "adjoint",
    "conductor",
    "fresnel_specular",
    "specular_reflection",
    "specular_transmission",
]

BSDF = Reflector | Dielectric | ThinDielectric


def conductor(
    eta: ArrayLike,
    k: ArrayLike,
    distribution: TrowbridgeReitz | None = None,
    eta_outside: ArrayLike = 1.0,
) -> Reflector:
    """A metal: a `Reflector` with the Fresnel term of the index eta + ik.

    Arguments: `eta` > 0, `k` >= 0, absolute index of the metal; `distribution`, its facets (None:
    smooth); `eta_outside` > 0, index of the medium around it. All broadcast.
    Source: PBRT 4th ed. `ConductorBxDF`, sec. 9.4 and 9.6.
    """
    return Reflector(FresnelConductor(eta, k, eta_outside), distribution)


def specular_reflection(scale: ArrayLike, fresnel: FresnelTerm) -> Reflector:
    """A smooth mirror of reflectance scale F(cos). Source: PBRT 3rd ed. sec. 8.2.2."""
    return Reflector(fresnel, None, scale)


def specular_transmission(scale: ArrayLike, eta_a: IndexLike, eta_b: IndexLike) -> Dielectric:
    """A smooth interface of which only the refracted part, times `scale`, is kept.

    Arguments: `scale`, usually a colour; `eta_a` > 0, index on the side of the normal; `eta_b` > 0,
    index on the other side. The transport mode is an argument of `sample`.
    Source: PBRT 3rd ed. sec. 8.2.3.
    """
    return Dielectric(
        lossless_index(eta_b, "eta_b") / lossless_index(eta_a, "eta_a"),
        None,
        1.0,
        scale,
        Lobes.TRANSMISSION,
    )


def fresnel_specular(
    scale_reflection: ArrayLike, scale_transmission: ArrayLike, eta_a: IndexLike, eta_b: IndexLike
) -> Dielectric:
    """A smooth interface that reflects and refracts, each lobe with its own scale.

    Arguments: `scale_reflection`, `scale_transmission`, usually colours; `eta_a` > 0, index on the
    side of the normal; `eta_b` > 0, index on the other side. Reflection is chosen with probability
    F. Source: PBRT 3rd ed. sec. 8.2.4 and 14.1.3.
    """
    return Dielectric(
        lossless_index(eta_b, "eta_b") / lossless_index(eta_a, "eta_a"),
        None,
        scale_reflection,
        scale_transmission,
    )


def adjoint(model: BSDF, wo: ArrayLike, wi: ArrayLike) -> Array:
    """f*(wo, wi) = f(wi, wo), shape (...); equals `model.evaluate(wo, wi, IMPORTANCE)`.

    Source: PBRT 4th ed. eq. 9.13.
    """
    return model.evaluate(wi, wo, TransportMode.RADIANCE)
