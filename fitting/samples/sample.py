"""The sample: media in the order in which the light meets them.

A sample has a text form, the same in Python and on the command line. Media are separated by ``|``:

    free                                    one bare surface, eta and k at every wavelength
    cauchy                                  one bare surface with that dispersion
    air | cauchy-urbach 3 mm thick | air    a plate; `thick`: its two faces do not interfere
    air | cauchy 110 nm | Si                a coherent film on a named material
    air | 1.45 2 nm | SiO2 100..150 nm | 3.88+0.016i
    air | rough 3 nm | cauchy 110 nm | film.yml

The index of a medium is a number (``1.45``, ``0.2+3.1i``), a named material
(`fresnel_jax.materials`), a file with an index (`material_files`), a dispersion model with the
number of its terms (``drude-lorentz:2``; the k of a film that is ``constant`` is 0 unless it is
freed), ``free`` (eta and k at every wavelength), ``auto`` (the simplest model that fits; `choose`),
a mixture or a uniaxial medium (`known_media`). ``air`` and ``vacuum`` are exactly 1: indices are
relative to air, as those of glasses.

The thickness of a layer follows its index: ``110 nm`` is fitted from this start, ``110 nm held`` is
not fitted, ``100..150 nm`` is fitted within this range. The data depend on the product of thickness
and k of a thick layer only, so ``3 mm thick`` is fixed and ``2.9..3.1 mm thick`` is fitted. With
``graded`` the index of a film rises or falls linearly with depth: ``cauchy 110 nm graded``.
"""

from __future__ import annotations

import math
import re
from typing import NamedTuple

import numpy as np

from fitting.samples.dispersion import KINDS, Model, parse_model
from fitting.samples.known_media import (
    Known,
    MaterialFile,
    Mixture,
    is_mixture,
    lossless,
    named,
    parse_mixture,
    refuse_misplaced,
)
from fitting.samples.material_files import MaterialFileError
from fitting.samples.parameters import NUMBER, START_OR_RANGE
from fitting.samples.spline_index import NAME as SPLINE
from fitting.samples.spline_index import usual_terms

FREE, AUTO = "free", "auto"
# Lengths in micrometres.
UNITS = {"nm": 1e-3, "um": 1.0, "\u00b5m": 1.0, "mm": 1e3, "cm": 1e4, "angstrom": 1e-4}

_LAYER = re.compile(
    rf"(?P<index>.*?)\s+{START_OR_RANGE}\s*(?P<unit>{'|'.join(UNITS)})"
    r"(?P<words>(?:\s+[A-Za-z]+)*)\s*$"
)
_COMPLEX = re.compile(rf"({NUMBER})(?:\s*([+-]\s*{NUMBER})\s*\*?\s*[ij])?$")


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

    index: complex | Model | Mixture | MaterialFile | str
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
        words = (FREE, AUTO, "above", "below")
        return tuple(p for p in parts if isinstance(p, str | MaterialFile) and p not in words)

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


def _index(text: str) -> complex | Model | Mixture | MaterialFile | str:
    """Return the index that a text names."""
    if is_mixture(text):
        return parse_mixture(text, _index)
    found = _COMPLEX.match(text)
    if found:
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
        return named(text)
    except MaterialFileError:
        raise
    except ValueError as error:
        raise ValueError(
            f"{text!r} is not an index: {error}. A number (1.45 or 0.2+3.1i), free, auto, a "
            f"dispersion model ({', '.join(KINDS)}), a named material, a file (film.yml) or a "
            "mixture (bruggeman(SiO2, water 30 %)) was wanted."
        ) from None


def _layer(text: str) -> Medium:
    found = _LAYER.match(text)
    if not found:
        raise ValueError(
            f"the layer {text!r} has no thickness; write it after the index, with its unit "
            f"({', '.join(dict.fromkeys(u for u in UNITS if u.isascii()))}), for example "
            "'cauchy 110 nm', with a range 'SiO2 100..150 nm', or 'cauchy 3 mm thick'."
        )
    words = found["words"].split()
    strange = [w for w in words if w not in ("thick", "held", "graded")]
    if strange:
        raise ValueError(
            f"the layer {text!r}: {strange[0]!r} came after the thickness, where 'thick' (without "
            "interference), 'held' (not fitted) or 'graded' was wanted."
        )
    unit, coherent = UNITS[found["unit"]], "thick" not in words
    first, last = (float(found["start"] or found[end]) * unit for end in ("low", "high"))
    start, held = 0.5 * (first + last), "held" in words
    if not (1e-6 <= start <= 1e9 and first > 0.0):
        raise ValueError(f"the layer {text!r}: a thickness from 1e-6 to 1e9 um was wanted.")
    if found["start"]:
        first, last, held = 0.0, math.inf, held or not coherent
    elif not first < last:
        raise ValueError(f"the layer {text!r}: the smaller thickness of a range comes first.")
    index, graded = found["index"].strip(), "graded" in words
    if graded and not coherent:
        raise ValueError(f"the layer {text!r}: 'thick' and 'graded' exclude each other.")
    return Medium(_index(index), index, Thickness(start, first, last, held, coherent, graded))


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
        if _LAYER.match(part):
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
    depths = [m.thickness for m in media]
    even = [d is not None and d.coherent and not d.graded for d in depths]
    refuse_misplaced(text, [m.index for m in media], even)
    return Sample(media)
