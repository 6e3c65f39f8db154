"""The dispersion models that can be fitted: parameters with their ranges, and the index.

The formulas are those of `fresnel_jax.dispersion`. The ranges of starting values follow from the
measured wavelengths: an oscillator is searched for within them and a little beyond.

The free-form index `SPLINE`, which obeys the Kramers-Kronig relations, has amplitudes >= 0 of cubic
B-splines of the absorption. Their knots are evenly spaced over the measured photon energies and two
steps beyond, and at growing distances up to three times the highest energy. Absorption farther away
is one pole above (``pole_ev2``), free electrons or a lattice below (``drude_ev2``, 0 unless it is
freed), and ``eps_inf``.
"""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array

from fitting.samples.parameters import LOG, PLAIN, SQUARE, Parameter
from fresnel_jax import dispersion

SPLINE = "kk-spline"
# The largest number of splines above the measured photon energies, and how many times the highest
# energy they reach; the number of all by default: one for each measured wavelength, within limits.
_ABOVE, _REACH, _LEAST, _MOST = 4, 3.0, 24, 48


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
            # a term strength / (0 - E^2) of free electrons lowers Re eps
            outside = jnp.stack([values["pole_ev2"], values["drude_ev2"]])
            (each,) = _stacked(self.terms, values, "eps2")
            poles = 1.5 * self.knots_ev[-1], 0.0
            return dispersion.KramersKronigSpline(
                each, self.knots_ev, values["eps_inf"], outside, poles
            )(wavelength_um)
        return self.kind.model(self.terms, values)(wavelength_um)


def usual_terms(wavelengths: int, data: int) -> int:
    """Return the number of splines for data at so many wavelengths.

    24 splines over 40 wavelengths round off an absorption edge by several standard errors, so there
    is one for each. One datum at each wavelength does not determine as many amplitudes.
    """
    return min(max(wavelengths, _LEAST), _MOST) if data >= 2 * wavelengths else _LEAST


def knots_over(terms: int, low_ev: float, high_ev: float) -> tuple[float, ...]:
    """Return the knots of ``terms`` splines for photon energies from ``low_ev`` to ``high_ev``.

    A quarter of the splines, four at the most, lie above the measured range, each wider than the
    last: what absorbs there refracts within. With one pole in their place chi2 is a hundred times
    the degrees of freedom for any number of splines (surfaces of one Tauc-Lorentz oscillator).
    """
    above = min(_ABOVE, terms // 4)
    step = (high_ev - low_ev) / max(terms - above - 1, 1)
    if not step > 0.0:
        raise ValueError(
            f"{SPLINE}:{terms} is a spline over a spectrum, and the data have one wavelength. "
            "Choose another model, such as constant."
        )
    first = max(low_ev - 2.0 * step, 0.02 * low_ev)
    even = np.linspace(first, high_ev + 2.0 * step, terms - above + 4)
    beyond = max((_REACH - 1.0) * high_ev, 4.0 * step)
    wider = high_ev + np.geomspace(2.0 * step, beyond, above + 1)[1:]
    return (*even.tolist(), *wider.tolist())


def every_second_left_out(terms: int, knots_ev: tuple[float, ...]) -> np.ndarray:
    """Return the splines on half of the evenly spaced knots as sums of all, (terms, fewer).

    Knots are put back one by one. It is the identity if there are too few.
    """
    even = terms - min(_ABOVE, terms // 4) + 4
    left_out = np.zeros(len(knots_ev), bool)
    left_out[even - 2 : 0 : -2] = True
    back = np.flatnonzero(left_out)
    if terms - len(back) < 2:
        return np.eye(terms)
    from scipy.interpolate import BSpline  # slow to import, seldom needed

    kept, beyond = np.array(knots_ev)[~left_out], np.arange(1.0, 4.0)
    # Three knots beyond each end, and splines there that are 0, complete the range of all.
    knots = np.concatenate([kept[0] - beyond[::-1], kept, kept[-1] + beyond])
    spline = BSpline(knots, np.pad(np.eye(terms - len(back)), ((3, 3), (0, 0))), 3)
    for knot in np.array(knots_ev)[back]:
        spline = spline.insert_knot(knot)
    return spline.c[3:-3]


class Kind(NamedTuple):
    parameters: Callable[[int, Spectrum], tuple[Parameter, ...]]
    model: Callable[[int, Mapping[str, Array]], dispersion.DispersionModel]
    absorbs: bool
    usual: int = 1  # number of terms if none is given; 0: it follows from the data
    most: int = 1


def _positive(
    name: str, unit: str, start: tuple[float, float], low: float, high: float
) -> Parameter:
    """Return a parameter whose logarithm is what the solver moves and starts are spread over."""
    return Parameter(name, unit, start, low, high, LOG, decades=True)


def _absorption(name: str, s: Spectrum, least: float) -> Parameter:
    least, coordinate = (1e-3, SQUARE) if s.even_in_k else (least, PLAIN)
    return Parameter(name, "", (least, 10.0), 0.0, 1e3, coordinate, decades=True)


def _eps_inf(high: float) -> Parameter:
    return Parameter("eps_inf", "", (1.0, high), 1.0, 100.0)


def _numbered(terms: int, *rows: tuple) -> tuple[Parameter, ...]:
    """Return the parameters of each term; rows: arguments of `_positive`, without a number."""
    each = range(1, terms + 1)
    return tuple(_positive(f"{stem}_{j}", *row) for j in each for stem, *row in rows)


def _stacked(terms: int, v: Mapping[str, Array], *stems: str) -> list[Array]:
    """Return the values of numbered parameters, strength_1, strength_2, .., as one array each."""
    return [jnp.stack([v[f"{stem}_{j}"] for j in range(1, terms + 1)]) for stem in stems]


def _constant(terms: int, s: Spectrum) -> tuple[Parameter, ...]:
    m = s.eta_i
    eta = Parameter("eta", "", (0.1 * m, 5.0 * m), 1e-4, 1e3, near=m)
    return eta, _absorption("k", s, 1e-9)


CAUCHY_NAMES = "ABCDEFGH"


def _cauchy(terms: int, s: Spectrum, clear: bool = True) -> tuple[Parameter, ...]:
    # An index below 1 has the reflectance of its inverse (at normal incidence exactly), so that the
    # ranges of formulas for transparent media begin at 1. The eta of these falls with the
    # wavelength (Kramers and Kronig); without lower ends of B and C it rose from 3.4 to 4.6 where
    # noise decides. Of 16 published dielectrics B is positive, and the share of C in eta at the
    # shortest wavelength more than -0.07; of four terms and more the signs alternate, up to -0.4.
    out = [Parameter("A", "", (1.1, 4.5), 1.0, 6.0 if clear else 1e2)]
    for j in range(1, terms):
        scale = s.shortest_um ** (2 * j)  # where their share is 1
        start = (-0.1 * scale / j, 0.4 * scale / j)
        low = 0.0 if j == 1 else -0.1 * scale if terms <= 3 else -math.inf
        unit = f"um^{2 * j}"
        out.append(Parameter(CAUCHY_NAMES[j], unit, start, low if clear else -math.inf))
    return tuple(out)


def _coefficients(terms: int, v: Mapping[str, Array]) -> Array:
    return jnp.stack([v[name] for name in CAUCHY_NAMES[:terms]])


def _cauchy_urbach(terms: int, s: Spectrum) -> tuple[Parameter, ...]:
    high = s.high_ev
    return (
        *_cauchy(terms, s, clear=False),
        _absorption("k_edge", s, 1e-8),
        _positive("urbach_ev", "eV", (0.01 * high, 0.5 * high), s.narrowest_ev, 10.0 * high),
        Parameter("edge_ev", "eV", (high, high), 0.0, 1e3, held=high),
    )


def _sellmeier(terms: int, s: Spectrum) -> tuple[Parameter, ...]:
    short, long = s.shortest_um, s.longest_um
    out = [Parameter("constant", "", (1.0, 2.0), 0.1, 1e2, held=1.0)]
    for j in range(1, terms + 1):
        name = f"resonance_um_{j}"
        out.append(Parameter(f"strength_{j}", "", (0.1, 8.0), 0.0, 1e4))
        # Resonances on the blue side; from the second term on the last one on the red side.
        if j == terms > 1:
            out.append(_positive(name, "um", (1.3 * long, 20.0 * long), 1.001 * long, 1e3 * long))
        else:
            start = 0.1 * short, 0.9 * short
            out.append(Parameter(name, "um", start, 1e-3 * short, 0.999 * short))
    return tuple(out)


def _sellmeier_model(terms: int, v: Mapping[str, Array]) -> dispersion.Sellmeier:
    strengths, resonances = _stacked(terms, v, "strength", "resonance_um")
    return dispersion.Sellmeier(strengths, resonances * resonances, v["constant"])


def _drude(s: Spectrum) -> tuple[Parameter, ...]:
    low, high = s.low_ev, s.high_ev
    return (
        _eps_inf(6.0),
        _positive("plasma_ev", "eV", (0.5 * low, 5.0 * high), 0.01 * low, 20.0 * high),
        _positive("width_ev", "eV", (0.02 * low, high), 1e-4 * low, 10.0 * high),
    )


def _lines(s: Spectrum, *first: Any) -> tuple[tuple, ...]:
    """Return the rows of `_numbered` for absorption lines; first: that of how strong they are."""
    low, high = s.low_ev, s.high_ev
    return (
        first,
        ("resonance_ev", "eV", (0.7 * low, 1.7 * high), 0.2 * low, 5.0 * high),
        ("width_ev", "eV", (0.03 * low, high), s.narrowest_ev, 10.0 * high),
    )


def _lorentz(terms: int, s: Spectrum) -> tuple[Parameter, ...]:
    low, high = s.low_ev, s.high_ev
    start = 0.03 * low * high, 10.0 * high * high
    strength = "strength_ev2", "eV^2", start, 1e-5 * low * low, 1e3 * high * high
    return _eps_inf(6.0), *_numbered(terms, *_lines(s, *strength))


def _drude_lorentz(terms: int, v: Mapping[str, Array]) -> dispersion.DrudeLorentz:
    electrons = v["plasma_ev"] ** 2, 0.0, v["width_ev"]
    both = zip(electrons, _stacked(terms, v, "strength_ev2", *_LINE), strict=True)
    return dispersion.DrudeLorentz(*(jnp.append(*each) for each in both), eps_inf=v["eps_inf"])


def _tauc_lorentz(terms: int, s: Spectrum) -> tuple[Parameter, ...]:
    low, high = s.low_ev, s.high_ev
    return (
        _eps_inf(4.0),
        *_numbered(
            terms,
            ("amplitude_ev", "eV", (high, 100.0 * high), 1e-4 * high, 1e5 * high),
            ("resonance_ev", "eV", (0.7 * high, 2.0 * high), 0.2 * low, 20.0 * high),
            ("width_ev", "eV", (0.1 * high, high), s.narrowest_ev, 40.0 * high),
        ),
        Parameter("gap_ev", "eV", (0.0, high), 0.0, 2.0 * high),
    )


def _cody_lorentz(terms: int, s: Spectrum) -> tuple[Parameter, ...]:
    high = s.high_ev
    # Few data tell of the tail: without a length it vanishes, and its slope says nothing.
    return (
        *_tauc_lorentz(terms, s),
        _positive("cody_ev", "eV", (0.05 * high, high), 1e-3 * high, 1e2 * high),
        Parameter("tail_above_gap_ev", "eV", (0.0, 0.1 * high), 0.0, high, held=0.0),
        Parameter("urbach_ev", "eV", (0.02, 0.2), 1e-3, 2.0, held=0.05),
    )


def _gaussian(terms: int, s: Spectrum) -> tuple[Parameter, ...]:
    lines = _lines(s, "amplitude", "", (0.01, 10.0), 1e-6, 1e3)
    return _eps_inf(4.0), *_numbered(terms, *lines)


def _pole(terms: int, s: Spectrum) -> tuple[Parameter, ...]:
    high = s.high_ev
    return _eps_inf(4.0), *_numbered(
        1,
        ("strength_ev2", "eV^2", (high**2, 1e2 * high**2), 1e-4, 1e6 * high**2),
        ("resonance_ev", "eV", (1.2 * high, 5.0 * high), 1.02 * high, 1e2 * high),
    )


def _spline(terms: int, s: Spectrum) -> tuple[Parameter, ...]:
    square = s.high_ev**2
    return (
        _eps_inf(4.0),
        Parameter("pole_ev2", "eV^2", (0.0, 20.0 * square), 0.0, 1e4 * square),
        Parameter("drude_ev2", "eV^2", (0.0, 0.0), 0.0, 1e4 * square, held=0.0),
        *(Parameter(f"eps2_{j}", "", (0.0, 8.0), 0.0, 1e4) for j in range(1, terms + 1)),
    )


def without_knots(terms: int, v: Mapping[str, Array]) -> dispersion.DispersionModel:
    """Refuse to evaluate a spline whose knots are not known."""
    raise ValueError(
        f"the knots of {SPLINE} follow the measured wavelengths: this model can be fitted, and the "
        "fit evaluates it (Fit.predict), but it cannot be simulated without a fit."
    )


# Models of a permittivity, which can be terms of a sum.
_ADDED = ("drude", "drude-lorentz", "lorentz", "tauc-lorentz", "cody-lorentz", "gaussian", "pole")


@functools.cache
def _sum_of(name: str) -> Kind:
    """Return the kind of a sum such as "tauc-lorentz + gaussian:2"; its terms count through."""
    parts = [parse_model(part) for part in name.split("+")]
    names: list[dict[str, str]] = []  # of each part: its own name of a parameter -> that in the sum
    first = 0
    for part in parts:
        own = [p.name.rpartition("_") for p in part.parameters(Spectrum(0.4, 0.8))]  # of any one
        names.append({
            f"{stem}_{j}": f"{stem}_{int(j) + first if j.isdigit() else j}" for stem, _, j in own
        })  # fmt: skip
        first += part.terms

    def parameters(terms: int, s: Spectrum) -> tuple[Parameter, ...]:
        each = {}  # eps_inf is that of the first
        for part, inside in zip(parts, names, strict=True):
            for p in part.parameters(s):
                each.setdefault(inside[p.name], p._replace(name=inside[p.name]))
        return tuple(each.values())

    def model(terms: int, v: Mapping[str, Array]) -> dispersion.DispersionModel:
        each = [
            part.kind.model(part.terms, {own: v[n] for own, n in inside.items()})
            for part, inside in zip(parts, names, strict=True)
        ]
        return dispersion.Sum(each, v["eps_inf"])  # pyright: ignore[reportArgumentType]

    return Kind(parameters, model, any(p.absorbs for p in parts))


_LINE = "resonance_ev", "width_ev"
KINDS = {
    "constant": Kind(_constant, lambda n, v: dispersion.Constant(v["eta"], v["k"]), True),
    "cauchy": Kind(_cauchy, lambda n, v: dispersion.Cauchy(_coefficients(n, v)), False, 3, 8),
    "cauchy-urbach": Kind(
        _cauchy_urbach,
        lambda n, v: dispersion.CauchyUrbach(
            _coefficients(n, v), v["k_edge"], v["urbach_ev"], v["edge_ev"]
        ),
        True, 3, 8,
    ),
    "sellmeier": Kind(_sellmeier, _sellmeier_model, False, 1, 8),
    "drude": Kind(
        lambda n, s: _drude(s),
        lambda n, v: dispersion.drude(v["plasma_ev"], v["width_ev"], v["eps_inf"]), True,
    ),
    "drude-lorentz": Kind(
        lambda n, s: (*_drude(s), *_lorentz(n, s)[1:]), _drude_lorentz, True, 1, 8
    ),
    "lorentz": Kind(
        _lorentz,
        lambda n, v: dispersion.DrudeLorentz(
            *_stacked(n, v, "strength_ev2", *_LINE), eps_inf=v["eps_inf"]
        ),
        True, 1, 8,
    ),
    "tauc-lorentz": Kind(
        _tauc_lorentz,
        lambda n, v: dispersion.TaucLorentz(
            *_stacked(n, v, "amplitude_ev", *_LINE), gap_ev=v["gap_ev"], eps_inf=v["eps_inf"]
        ),
        True, 1, 8,
    ),
    "cody-lorentz": Kind(
        _cody_lorentz,
        lambda n, v: dispersion.CodyLorentz(
            *_stacked(n, v, "amplitude_ev", *_LINE), gap_ev=v["gap_ev"], cody_ev=v["cody_ev"],
            tail_ev=v["gap_ev"] + v["tail_above_gap_ev"], urbach_ev=v["urbach_ev"],
            eps_inf=v["eps_inf"],
        ),
        True, 1, 8,
    ),
    "gaussian": Kind(
        _gaussian,
        lambda n, v: dispersion.Gaussian(
            *_stacked(n, v, "amplitude", *_LINE), eps_inf=v["eps_inf"]
        ),
        True, 1, 8,
    ),
    "pole": Kind(
        _pole,
        lambda n, v: dispersion.DrudeLorentz(
            v["strength_ev2_1"], v["resonance_ev_1"], 0.0, v["eps_inf"]
        ),
        False,
    ),
    # The terms are amplitudes of B-splines in their order.
    SPLINE: Kind(_spline, without_knots, True, 0, 60),
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
