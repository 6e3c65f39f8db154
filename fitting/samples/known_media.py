"""Media that are neither a number nor a dispersion model: a material, a file, a mixture."""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import jax
import numpy as np

from fitting.process.compiled import fit_settings
from fitting.samples.dispersion import Model
from fitting.samples.material_files import read_material
from fresnel_jax import effective_medium, materials
from fresnel_jax.dispersion import Material, material

ABOVE, BELOW = "above", "below"
RULES = {
    "bruggeman": effective_medium.bruggeman,
    "looyenga": effective_medium.looyenga,
    "maxwell-garnett": effective_medium.maxwell_garnett,
    "linear": effective_medium.linear,
}
UNIAXIAL = "uniaxial"


class MaterialFile(NamedTuple):
    """A file with an index. stamp: when it was written, so that a new one is read anew."""

    path: str
    stamp: int


class Share(NamedTuple):
    """Volume fraction of a part of a mixture, a number from 0 to 1; see `sample.Thickness`."""

    start: float
    low: float = 0.0
    high: float = 1.0
    held: bool = False


class Mixture(NamedTuple):
    """An effective medium of two or more parts; shares are those of all but the first.

    A part is a number, a `Model`, a named material or a file; `ABOVE` and `BELOW` are the media on
    both sides of the layer. steps: slices of equal thickness in which the share of the second part
    rises linearly from 0 to 1; 0 for a homogeneous mixture. The rule "uniaxial" is no mixture: its
    parts are the ordinary and the extraordinary index, or the first, and the difference as a share.
    depolarization: the factor of the grains of "bruggeman".
    """

    rule: str
    parts: tuple[Any, ...]  # complex | Model | Known
    shares: tuple[Share, ...]
    steps: int = 0
    depolarization: float = 1.0 / 3.0

    @property
    def absorbs(self) -> bool:
        """Whether a part has a fitted k."""
        return any(isinstance(p, Model) and p.absorbs for p in self.parts)

    @property
    def model(self) -> Model | None:
        """The part that has fitted parameters."""
        return next((p for p in self.parts if isinstance(p, Model)), None)

    @property
    def fractions(self) -> tuple[str, ...]:
        """Names of the shares as parameters."""
        if self.steps:
            return ()
        if self.rule == UNIAXIAL:
            return ("birefringence",) if self.shares else ()
        many = len(self.shares) > 1
        return tuple(f"fraction_{i}" if many else "fraction" for i in range(1, len(self.parts)))


# Eight slices of a graded interface: for a thickness of a sixth of a wavelength R is within 1e-4
# of the limit of many slices.
BETWEEN = {
    "rough": Mixture("bruggeman", (ABOVE, BELOW), (Share(0.5, held=True),)),
    "interface": Mixture("bruggeman", (ABOVE, BELOW), (Share(0.5, held=True),), steps=8),
}
Known = str | MaterialFile


@functools.lru_cache(maxsize=256)
def known_medium(which: Known) -> Material:
    """Return the material of a name or a file, with its range, in float64.

    It is cached, so it must not depend on where it is first used: outside of `jax.enable_x64` its
    tables would be float32 in every later fit, inside a traced function they would be tracers.
    """
    with jax.ensure_compile_time_eval(), fit_settings():
        return read_material(which.path) if isinstance(which, MaterialFile) else material(which)


# Light may come from a medium with such a k, as that of water in the visible, which is taken for 0:
# R then changes by less than this.
LEAST_K = 1e-6


def lossless(index: object) -> bool:
    """Return whether light may come from a medium of this index: it is known and has no k.

    Of a file: at some of its wavelengths; see `sample_checks.check_known`.
    """
    if isinstance(index, str):
        return index not in ("free", "auto") and materials.lookup(index).kind == "dielectric"
    if isinstance(index, MaterialFile):
        table = known_medium(index)
        low, high = table.range_um or (0.5, 0.5)
        return bool(np.min(np.asarray(table(np.linspace(low, high, 1001)).k)) <= LEAST_K)
    return isinstance(index, complex) and index.imag <= LEAST_K
