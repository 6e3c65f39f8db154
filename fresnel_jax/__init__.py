"""Fresnel optics that is accurate everywhere and differentiable everywhere, in JAX.

The names below are those of one smooth boundary. Submodules are attributes, imported when they are
first used: `approximate`, `bsdf`, `colour`, `directions`, `dispersion`, `effective_medium`,
`fresnel_terms`, `interface`, `layers`, `materials`, `microfacet`, `performance`, `polarization`.
"""

import importlib
from typing import Any

from ._environment import warn_of_environment
from .directions import faceforward, reflect, refract
from .interface import (
    Amplitudes,
    Powers,
    amplitudes,
    fresnel_complex,
    fresnel_conductor,
    fresnel_dielectric,
    powers,
    reflectance,
)

_SUBMODULES = (
    "approximate",
    "bsdf",
    "colour",
    "directions",
    "dispersion",
    "effective_medium",
    "fresnel_terms",
    "interface",
    "layers",
    "materials",
    "microfacet",
    "performance",
    "polarization",
)

__all__ = [
    "Amplitudes",
    "Powers",
    "amplitudes",
    "faceforward",
    "fresnel_complex",
    "fresnel_conductor",
    "fresnel_dielectric",
    "powers",
    "reflect",
    "reflectance",
    "refract",
]

warn_of_environment()


def __getattr__(name: str) -> Any:
    if name in _SUBMODULES:
        return importlib.import_module(f".{name}", __name__)
    if name == "__version__":
        from importlib.metadata import version

        return version("fresnel-jax")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*globals(), *_SUBMODULES, "__version__"])
