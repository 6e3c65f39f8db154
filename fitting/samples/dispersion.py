"""The dispersion models that can be fitted: parameters with their ranges, and the index.

The formulas are those of `fresnel_jax.dispersion`. The ranges of starting values follow from the
measured wavelengths: an oscillator is searched for within them and a little beyond.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import jax.numpy as jnp
from jax import Array

from fitting.samples.parameters import LOG, PLAIN, SQUARE, Parameter
from fitting.samples.spline_index import NAME as SPLINE
from fitting.samples.spline_index import knots_over, spline_model, spline_parameters, without_knots
from fresnel_jax import dispersion


class Spectrum(NamedTuple):
    """The properties of the data on which the ranges of starting values depend.

    shortest_um, longest_um: measured wavelengths; eta_i: index of the medium in front.
    even_in_k: whether the data depend on k^2 (powers of a bare interface), and not on k.
    step_ev: the least distance of two photon energies.
    """

    shortest_um: float
    longest_um: float
    eta_i: float = 1.0
    even_in_k: bool = True
    step_ev: float = 0.0

    @property
    def low_ev(self) -> float:
        """The least photon energy."""
        return dispersion.HC_EV_UM / self.longest_um

    @property
    def high_ev(self) -> float:
        """The largest photon energy."""
        return dispersion.HC_EV_UM / self.shortest_um

    @property
    def narrowest_ev(self) -> float:
        """The least width of a line that is looked for.

        One that is narrower than the distance of two data takes up the noise of one of them, at any
        place of the spectrum: minima by the dozen, and none that the data tell.
        """
        return min(max(1e-3 * self.low_ev, self.step_ev), 0.03 * self.low_ev)


class Model(NamedTuple):
    """A dispersion model by name, with its number of terms; hashable, as static arguments of jit.

    terms: 0 for a spline whose number follows from the data. knots_ev: of a spline, once they are
    known; see `over`.
    """

    name: str
    terms: int
    knots_ev: tuple[float, ...] = ()

    def __str__(self) -> str:
        several = self.kind.most > 1 and self.terms
        return f"{self.name}:{self.terms}" if several else self.name

    @property
    def kind(self) -> Kind:
        """What is known of the model by its name."""
        return KINDS[self.name] if self.name in KINDS else _sum_of(self.name)

    @property
    def absorbs(self) -> bool:
        """Whether the model has a k of its own."""
        return self.kind.absorbs

    @property
    def exchangeable(self) -> bool:
        """Whether the terms are interchangeable: not if the last one is beyond the red end."""
        return self.kind.exchangeable

    @property
    def is_sum(self) -> bool:
        """Whether the terms are of several kinds."""
        return self.name not in KINDS

    def parameters(self, spectrum: Spectrum) -> tuple[Parameter, ...]:
        """Return the parameters in the order of the formula."""
        return self.kind.parameters(self.terms, spectrum)

    def over(self, spectrum: Spectrum) -> Model:
        """Return the model with its knots over the measured range and beyond it."""
        if self.name != SPLINE or self.knots_ev:
            return self
        knots = knots_over(self.terms, spectrum.low_ev, spectrum.high_ev)
        return self._replace(knots_ev=knots)

    def index(self, values: Mapping[str, Array], wavelength_um: Array) -> dispersion.Index:
        """Return eta and k at wavelengths, for one value () of every parameter."""
        if self.knots_ev:
            return spline_model(self.terms, self.knots_ev, values)(wavelength_um)
        return self.kind.model(self.terms, values)(wavelength_um)


class Kind(NamedTuple):
    parameters: Callable[[int, Spectrum], tuple[Parameter, ...]]
    model: Callable[[int, Mapping[str, Array]], dispersion.DispersionModel]
    absorbs: bool
    usual: int = 1  # number of terms if none is given; 0: it follows from the data
    most: int = 1
    exchangeable: bool = True


def _positive(
    name: str, unit: str, start: tuple[float, float], low: float, high: float
) -> Parameter:
    """Return a parameter whose logarithm is what the solver moves and starts are spread over."""
    return Parameter(name, unit, start, low, high, LOG, decades=True)


def _absorption(name: str, spectrum: Spectrum, least: float) -> Parameter:
    coordinate = SQUARE if spectrum.even_in_k else PLAIN
    return Parameter(name, "", (least, 10.0), 0.0, 1e3, coordinate, decades=True)


def _constant(terms: int, spectrum: Spectrum) -> tuple[Parameter, ...]:
    m = spectrum.eta_i
    return (
        Parameter("eta", "", (0.1 * m, 5.0 * m), 1e-4, 1e3, near=m),
        _absorption("k", spectrum, 1e-3 if spectrum.even_in_k else 1e-9),
    )


CAUCHY_NAMES = "ABCDEFGH"


def _cauchy(terms: int, spectrum: Spectrum) -> tuple[Parameter, ...]:
    # An index below 1 has the reflectance of its inverse (at normal incidence exactly), so that the
    # ranges of formulas for transparent media begin at 1.
    out = [Parameter("A", "", (1.1, 4.5), 1.0, 1e2)]
    for j in range(1, terms):
        # Their share in eta at the shortest wavelength.
        scale = spectrum.shortest_um ** (2 * j)
        unit = f"um^{2 * j}"
        out.append(Parameter(CAUCHY_NAMES[j], unit, (-0.1 * scale / j, 0.4 * scale / j)))
    return tuple(out)


def _cauchy_coefficients(terms: int, v: Mapping[str, Array]) -> Array:
    return jnp.stack([v[CAUCHY_NAMES[j]] for j in range(terms)])


def _cauchy_urbach(terms: int, spectrum: Spectrum) -> tuple[Parameter, ...]:
    high, narrowest = spectrum.high_ev, spectrum.narrowest_ev
    return (
        *_cauchy(terms, spectrum),
        _absorption("k_edge", spectrum, 1e-3 if spectrum.even_in_k else 1e-8),
        _positive("urbach_ev", "eV", (0.01 * high, 0.5 * high), narrowest, 10.0 * high),
        Parameter("edge_ev", "eV", (high, high), 0.0, 1e3, held=high),
    )


def _sellmeier(terms: int, spectrum: Spectrum) -> tuple[Parameter, ...]:
    short, long = spectrum.shortest_um, spectrum.longest_um
    out = [Parameter("constant", "", (1.0, 2.0), 0.1, 1e2, held=1.0)]
    for j in range(1, terms + 1):
        # Resonances on the blue side; from the second term on the last one on the red side.
        red = terms > 1 and j == terms
        start = (1.3 * long, 20.0 * long) if red else (0.1 * short, 0.9 * short)
        low, high = (1.001 * long, 1e3 * long) if red else (1e-3 * short, 0.999 * short)
        out.append(Parameter(f"strength_{j}", "", (0.1, 8.0), 0.0, 1e4))
        out.append(
            Parameter(f"resonance_um_{j}", "um", start, low, high, LOG if red else PLAIN,
                      decades=red)
        )  # fmt: skip
    return tuple(out)


def _numbered(terms: int, v: Mapping[str, Array], *stems: str) -> list[list[Array]]:
    """Return the values of each numbered parameter, such as strength_1, strength_2, .."""
    return [[v[f"{stem}_{j}"] for j in range(1, terms + 1)] for stem in stems]


def _sellmeier_model(terms: int, v: Mapping[str, Array]) -> dispersion.DispersionModel:
    strengths, resonances = map(jnp.stack, _numbered(terms, v, "strength", "resonance_um"))
    return dispersion.Sellmeier(strengths, resonances * resonances, v["constant"])


def _eps_inf(high: float = 6.0) -> Parameter:
    return Parameter("eps_inf", "", (1.0, high), 1.0, 100.0)


def _free_electrons(spectrum: Spectrum) -> tuple[Parameter, ...]:
    low, high = spectrum.low_ev, spectrum.high_ev
    return (
        _positive("plasma_ev", "eV", (0.5 * low, 5.0 * high), 0.01 * low, 20.0 * high),
        _positive("width_ev", "eV", (0.02 * low, high), 1e-4 * low, 10.0 * high),
    )


def _oscillators(terms: int, spectrum: Spectrum) -> tuple[Parameter, ...]:
    low, high, narrowest = spectrum.low_ev, spectrum.high_ev, spectrum.narrowest_ev
    out = []
    for j in range(1, terms + 1):
        strength = (0.03 * low * high, 10.0 * high * high)
        out += [
            _positive(f"strength_ev2_{j}", "eV^2", strength, 1e-5 * low * low, 1e3 * high * high),
            _positive(f"resonance_ev_{j}", "eV", (0.7 * low, 1.7 * high), 0.2 * low, 5.0 * high),
            _positive(f"width_ev_{j}", "eV", (0.03 * low, high), narrowest, 10.0 * high),
        ]
    return tuple(out)


def _oscillator_model(terms: int, v: Mapping[str, Array]) -> dispersion.DispersionModel:
    """Return the model of oscillators, after free electrons where their parameters are given."""
    parts = _numbered(terms, v, "strength_ev2", "resonance_ev", "width_ev")
    if "plasma_ev" in v:
        electrons = v["plasma_ev"] ** 2, jnp.zeros_like(v["plasma_ev"]), v["width_ev"]
        parts = [[first, *more] for first, more in zip(electrons, parts, strict=True)]
    strengths, resonances, widths = map(jnp.stack, parts)
    return dispersion.DrudeLorentz(strengths, resonances, widths, v["eps_inf"])


def _tauc_lorentz(terms: int, spectrum: Spectrum) -> tuple[Parameter, ...]:
    low, high, narrowest = spectrum.low_ev, spectrum.high_ev, spectrum.narrowest_ev
    out = [_eps_inf(4.0)]
    for j in range(1, terms + 1):
        out += [
            _positive(f"amplitude_ev_{j}", "eV", (high, 100.0 * high), 1e-4 * high, 1e5 * high),
            _positive(f"resonance_ev_{j}", "eV", (0.7 * high, 2.0 * high), 0.2 * low, 20.0 * high),
            _positive(f"width_ev_{j}", "eV", (0.1 * high, high), narrowest, 40.0 * high),
        ]
    return (*out, Parameter("gap_ev", "eV", (0.0, high), 0.0, 2.0 * high))


def _tauc_lorentz_model(terms: int, v: Mapping[str, Array]) -> dispersion.DispersionModel:
    amplitudes, resonances, widths = map(
        jnp.stack, _numbered(terms, v, "amplitude_ev", "resonance_ev", "width_ev")
    )
    if "cody_ev" in v:
        shared = v["gap_ev"], v["cody_ev"], v["gap_ev"] + v["tail_above_gap_ev"], v["urbach_ev"]
        return dispersion.CodyLorentz(amplitudes, resonances, widths, *shared, v["eps_inf"])
    return dispersion.TaucLorentz(amplitudes, resonances, widths, v["gap_ev"], v["eps_inf"])


def _cody_lorentz(terms: int, spectrum: Spectrum) -> tuple[Parameter, ...]:
    high = spectrum.high_ev
    # Few data tell of the tail: without a length it vanishes, and its slope says nothing.
    return (
        *_tauc_lorentz(terms, spectrum),
        _positive("cody_ev", "eV", (0.05 * high, high), 1e-3 * high, 1e2 * high),
        Parameter("tail_above_gap_ev", "eV", (0.0, 0.1 * high), 0.0, high, held=0.0),
        Parameter("urbach_ev", "eV", (0.02, 0.2), 1e-3, 2.0, held=0.05),
    )


def _gaussian(terms: int, spectrum: Spectrum) -> tuple[Parameter, ...]:
    low, high, narrowest = spectrum.low_ev, spectrum.high_ev, spectrum.narrowest_ev
    out = [_eps_inf(4.0)]
    for j in range(1, terms + 1):
        out += [
            _positive(f"amplitude_{j}", "", (0.01, 10.0), 1e-6, 1e3),
            _positive(f"resonance_ev_{j}", "eV", (0.7 * low, 1.7 * high), 0.2 * low, 5.0 * high),
            _positive(f"width_ev_{j}", "eV", (0.03 * low, high), narrowest, 10.0 * high),
        ]
    return tuple(out)


def _gaussian_model(terms: int, v: Mapping[str, Array]) -> dispersion.DispersionModel:
    amplitudes, resonances, widths = map(
        jnp.stack, _numbered(terms, v, "amplitude", "resonance_ev", "width_ev")
    )
    return dispersion.Gaussian(amplitudes, resonances, widths, v["eps_inf"])


def _pole(terms: int, spectrum: Spectrum) -> tuple[Parameter, ...]:
    high = spectrum.high_ev
    strength = _positive("strength_ev2_1", "eV^2", (high**2, 1e2 * high**2), 1e-4, 1e6 * high**2)
    place = _positive("resonance_ev_1", "eV", (1.2 * high, 5.0 * high), 1.02 * high, 1e2 * high)
    return _eps_inf(4.0), strength, place


def _pole_model(terms: int, v: Mapping[str, Array]) -> dispersion.DispersionModel:
    strength, place = v["strength_ev2_1"], v["resonance_ev_1"]
    return dispersion.DrudeLorentz(strength, place, jnp.zeros_like(place), v["eps_inf"])


# Models of a permittivity, which can be terms of a sum.
_ADDED = ("drude", "drude-lorentz", "lorentz", "tauc-lorentz", "cody-lorentz", "gaussian", "pole")


@functools.cache
def _sum_of(name: str) -> Kind:
    """Return the kind of a sum such as "tauc-lorentz + gaussian:2"; its terms count through."""
    parts = [parse_model(part) for part in name.split("+")]
    firsts = [sum(part.terms for part in parts[:i]) for i in range(len(parts))]

    def own(i: int, name: str) -> str:
        stem, _, number = name.rpartition("_")
        return f"{stem}_{int(number) + firsts[i]}" if number.isdigit() else name

    def parameters(terms: int, spectrum: Spectrum) -> tuple[Parameter, ...]:
        each = [(i, p) for i, part in enumerate(parts) for p in part.parameters(spectrum)]
        named = [p._replace(name=own(i, p.name)) for i, p in each if not i or p.name != "eps_inf"]
        return tuple(named)

    def model(terms: int, v: Mapping[str, Array]) -> dispersion.DispersionModel:
        some = Spectrum(0.4, 0.8)  # the names do not depend on it
        values = [{p.name: v[own(i, p.name)] for p in part.parameters(some)}
                  for i, part in enumerate(parts)]  # fmt: skip
        each = [p.kind.model(p.terms, x) for p, x in zip(parts, values, strict=True)]
        return dispersion.Sum(each, v["eps_inf"])  # pyright: ignore[reportArgumentType]

    return Kind(parameters, model, any(p.absorbs for p in parts), 1, 1, exchangeable=False)


KINDS = {
    "constant": Kind(_constant, lambda terms, v: dispersion.Constant(v["eta"], v["k"]), True),
    "cauchy": Kind(
        _cauchy, lambda n, v: dispersion.Cauchy(_cauchy_coefficients(n, v)), False, 3, 8
    ),
    "cauchy-urbach": Kind(
        _cauchy_urbach,
        lambda n, v: dispersion.CauchyUrbach(
            _cauchy_coefficients(n, v), v["k_edge"], v["urbach_ev"], v["edge_ev"]
        ),
        True, 3, 8,
    ),
    "sellmeier": Kind(_sellmeier, _sellmeier_model, False, 1, 8, False),
    "drude": Kind(
        lambda n, spectrum: (_eps_inf(), *_free_electrons(spectrum)),
        lambda n, v: _oscillator_model(0, v), True,
    ),
    "drude-lorentz": Kind(
        lambda n, spectrum: (_eps_inf(), *_free_electrons(spectrum), *_oscillators(n, spectrum)),
        _oscillator_model, True, 1, 8,
    ),
    "lorentz": Kind(
        lambda n, spectrum: (_eps_inf(), *_oscillators(n, spectrum)), _oscillator_model, True, 1, 8
    ),
    "tauc-lorentz": Kind(_tauc_lorentz, _tauc_lorentz_model, True, 1, 8),
    "cody-lorentz": Kind(_cody_lorentz, _tauc_lorentz_model, True, 1, 8),
    "gaussian": Kind(_gaussian, _gaussian_model, True, 1, 8),
    "pole": Kind(_pole, _pole_model, False),
    # The terms are amplitudes of B-splines in their order.
    SPLINE: Kind(
        lambda n, spectrum: (_eps_inf(4.0), *spline_parameters(n, spectrum.high_ev)),
        without_knots, True, 0, 60, exchangeable=False,
    ),
}  # fmt: skip


def model_names() -> tuple[str, ...]:
    """Return the names of the dispersion models that a sample's text may use.

    A model of several terms may be followed by their number: "drude-lorentz:3".
    """
    return tuple(KINDS)


def parse_model(text: Any) -> Model:
    """Return the model that a text names: ``cauchy``, ``drude-lorentz:3``, ``drude + gaussian:2``.

    Raises ValueError for a name or a number of terms that is not known.
    """
    if isinstance(text, Model):
        return text
    if "+" in str(text):
        return _parse_sum(str(text))
    found = re.fullmatch(r"\s*([A-Za-z][-_A-Za-z]*)\s*(?::\s*(\d+)\s*)?", str(text))
    name = found[1].lower().replace("_", "-") if found else ""
    if not found or name not in KINDS:
        raise ValueError(
            f"there is no dispersion model {str(text)!r}; one of {', '.join(KINDS)} was wanted, "
            "followed by its number of terms if it has several: drude-lorentz:3."
        )
    kind = KINDS[name]
    terms = int(found[2]) if found[2] else kind.usual
    if found[2] and not 1 <= terms <= kind.most:
        wanted = f"1 to {kind.most} terms" if kind.most > 1 else "no number of terms"
        raise ValueError(f"{str(text)!r}: {name} takes {wanted}.")
    return Model(name, terms)


def _parse_sum(text: str) -> Model:
    parts = [parse_model(part) for part in text.split("+")]
    names = [part.name for part in parts]
    wrong = [name for name in names if name not in _ADDED]
    if wrong:
        raise ValueError(f"{text!r}: {wrong[0]} is none of what can be added, {', '.join(_ADDED)}.")
    overlapping = {"drude", "drude-lorentz"}, {"tauc-lorentz", "cody-lorentz"}
    if len({*names}) < len(names) or any(both <= {*names} for both in overlapping):
        raise ValueError(
            f"{text!r}: each model was wanted once, with its number of terms: gaussian:2. "
            "drude-lorentz has the free electrons of drude; one gap_ev is that of tauc-lorentz or "
            "of cody-lorentz."
        )
    return Model(" + ".join(map(str, parts)), sum(part.terms for part in parts))


# In whose program a model is fitted where others of the same data share it (`choose` compiles one
# for all of these), with so many terms at the least.
_WIDER = {
    "cauchy": ("cauchy-urbach", 3), "cauchy-urbach": ("cauchy-urbach", 3),
    "sellmeier": ("sellmeier", 2), "drude": ("drude-lorentz", 1), "lorentz": ("drude-lorentz", 1),
}  # fmt: skip
# The value at which a parameter makes its term vanish; a logarithm needs a number above 0.
_ABSENT = {
    "B": 0.0, "C": 0.0, "k_edge": 0.0, "strength_2": 0.0, "strength_ev2_1": 1e-30,
    "plasma_ev": 1e-30,
}  # fmt: skip


def wider(model: Model) -> Model:
    """Return the model of which another one is a special case, and which has its program."""
    name, least = _WIDER.get(model.name, (model.name, model.terms))
    return model._replace(name=name, terms=max(model.terms, least))


def absent(parameter: Parameter) -> float:
    """Return the value of a parameter of the wider model that a special case does not have."""
    return _ABSENT.get(parameter.name, parameter.start[0])
