"""Which simplifications are safe in a scene? The largest error of each, and the cheapest.

    python -m examples.advisor gold aluminium --wavelength-um 0.38 0.78 --accuracy 0.01

    advice = advise(Scene({"pane": "window glass"}, wavelength_um=(0.4, 0.7), accuracy=1e-3))
    print(advice.table())

A scene is boundaries between one medium that light comes from and one or more materials, a range of
wavelengths, a range of angles and the accuracy wanted of R. Against R_s and R_p by `powers` at
every wavelength, in float64, these simplifications are held, one at a time and combined:
unpolarized R; one wavelength, or three bands, for the spectrum; k = 0; the value at normal
incidence; each approximation of `approximate`; float32. Slabs and films are not among them.

Errors are absolute, and upper bounds: the largest of a dense grid and its refinement (`search`), a
hundredth more for what they miss, and the rounding of the precision. That of float32 is the largest
error at the corners of the box that rounding makes of (cos, eta, k, eta_i), and of the arithmetic.
tests/docs/test_advisor.py holds random scenes against brute force.
"""

import dataclasses
import itertools
from collections.abc import Mapping
from typing import Any, NamedTuple

import jax
import numpy as np

from .boundary import BANDS, LIGHT, Boundary
from .boundary import Model as Model
from .boundary import Worst as Worst
from .forms import EXACT, FORMS, Form
from .forms import measured as measured


@dataclasses.dataclass(frozen=True)
class Scene:
    """What is to be simplified.

    Args:
        materials: name -> medium that light enters: a number or complex number (index at every
            wavelength), a pair (eta, k), three arrays (wavelength_um, eta, k) in ascending order, a
            name that `dispersion.material` knows, or a callable wavelength_um -> (eta, k).
        wavelength_um: shortest and longest wavelength; the same twice for one wavelength.
        angle_deg: smallest and largest angle of incidence, degrees from the normal, in [0, 90].
        accuracy: largest absolute error of R that is acceptable, > 0.
        eta_i: the medium that light comes from, in any of the same forms, with k = 0.
        samples: number of wavelengths of the full spectrum; costs count in it, errors do not.

    Raises:
        ValueError: a range or a number is not as above.
    """

    materials: Mapping[str, Any]
    wavelength_um: tuple[float, float]
    angle_deg: tuple[float, float] = (0.0, 90.0)
    accuracy: float = 0.01
    eta_i: Any = 1.0
    samples: int = 31

    def __post_init__(self):
        if not self.materials:
            raise ValueError("materials is empty; wanted at least one, e.g. {'pane': 1.5}")
        for name, low, high, limit in (
            ("wavelength_um", *self.wavelength_um, np.inf),
            ("angle_deg", *self.angle_deg, 90.0),
        ):
            if not (0.0 <= low <= high <= limit) or (name, low) == ("wavelength_um", 0.0):
                raise ValueError(f"{name} is {low}, {high}; wanted the smaller and the larger end")
        if not self.accuracy > 0.0 or self.samples < 1:
            raise ValueError(
                f"accuracy is {self.accuracy} and samples {self.samples}; "
                "wanted an error > 0 and a number >= 1"
            )


class Finding(NamedTuple):
    """A model, its cost relative to `Model()`, and its largest error of R_s and R_p, and of R.

    `polarized` or `unpolarized` is None in `Advice.cheapest`, where only the other was looked for.
    """

    model: Model
    cost: float
    polarized: Worst | None
    unpolarized: Worst | None


@dataclasses.dataclass(frozen=True)
class Advice:
    """What `advise` found: each simplification alone, and the cheapest model by kind of light."""

    scene: Scene
    findings: dict[str, Finding]
    cheapest: dict[str, Finding]

    def table(self) -> str:
        """Text for a terminal, at most 110 columns wide."""
        scene = self.scene
        lines = [
            f"{', '.join(scene.materials)}; wavelengths {_range(scene.wavelength_um)} um, "
            f"angles {_range(scene.angle_deg)} degrees from the normal",
            f"accuracy wanted of the reflectance R (a fraction, 0 to 1): {scene.accuracy:g}",
            "",
            "Each simplification alone: upper bound of the absolute error of R, and where it is",
            "largest; computing time relative to the exact form. * : within the accuracy wanted.",
            "",
            f"{'simplification':23}{'error of R_s and R_p':33}"
            f"{'error of unpolarized R':33}{'time':>8}",
        ]
        for label, found in self.findings.items():
            worst = (found.polarized, found.unpolarized)
            cells = (_cell(x, scene) for x in worst if x is not None)
            lines.append(f"{label:23}{''.join(f'{x:33}' for x in cells)}{found.cost:8.2g}")
        lines += ["", f"Time 1: {EXACT}, float64, at {scene.samples} wavelengths."]
        for light, found in self.cheapest.items():
            worst = found.polarized or found.unpolarized
            error = 0.0 if worst is None else worst.bound
            lines += [
                "",
                f"Fastest within the accuracy, for {light}: {found.model}",
                f"  error at most {error:.2g}, time {found.cost:.2g}",
                f"  {_call(found.model)}",
            ]
        return "\n".join(lines)


def _call(model: Model) -> str:
    """The line of Python to copy."""
    k = "" if "k = 0" in model.form else ", k"
    name, _, degree = model.form.partition(", degree ")
    if model.form in ("exact, s and p", "k = 0, s and p"):
        call = f"fresnel_jax.powers(cos_theta, eta{k or ', 0.0'}, eta_i=eta_i)"
    elif model.form in ("exact, unpolarized", "k = 0"):
        call = f"fresnel_jax.reflectance(cos_theta, eta{k or ', 0.0'}, eta_i=eta_i)"
    elif name == "normal incidence":
        call = "fresnel_jax.approximate.normal_reflectance(eta, k, eta_i)"
    else:
        more = f", degree={degree}" if degree else ""
        call = f"fresnel_jax.approximate.{name}(cos_theta, eta, k, eta_i{more})"
    bands = {0: "eta, k at each wavelength", 1: "eta, k at the middle of the range"}
    where = bands.get(model.bands, f"eta, k at the middle of each of {model.bands} equal bands")
    return f"{call}  # {where}, in {model.dtype}"


def _range(ends):
    return f"{ends[0]:g}" if ends[0] == ends[1] else f"{ends[0]:g} to {ends[1]:g}"


def _cell(worst: Worst, scene: Scene) -> str:
    mark = "*" if worst.bound <= scene.accuracy else ""
    if worst.error < 7e-15:
        return f"none{mark}"
    name = f"{worst.material[:9]} " if len(scene.materials) > 1 else ""
    number = f"{_rounded_up(worst.bound)}{mark}"
    return f"{number:9}{name}{worst.wavelength_um:.4g} um {worst.angle_deg:.4g}"


def _rounded_up(x: float) -> str:
    """Two digits, not below x."""
    decade = 10.0 ** (np.floor(np.log10(x)) - 1.0)
    return f"{np.ceil(x / decade) * decade:.2g}"


def _worst(boundaries, model, light, enough=np.inf) -> Worst:
    worst = None
    for boundary in boundaries:
        found = boundary.worst(model, light, enough / 1.01)
        worst = found if worst is None else max(worst, found)
        if worst.bound > enough:
            break
    assert worst is not None  # a scene has materials
    return worst


def advise(scene: Scene, forms: Mapping[str, Form] = FORMS) -> Advice:
    """The largest error of every simplification in a scene, and the cheapest model that is enough.

    Args:
        scene: see `Scene`.
        forms: the models of a boundary with their costs; `measured()` has them timed here and now.

    Returns:
        `Advice`: `findings` by simplification, each alone against the exact model, and `cheapest`
        by light ("s and p", "unpolarized"): of all forms combined with spectrum, three bands or one
        wavelength, and float64 or float32, the one of least cost whose error is within the
        accuracy. That error is found as such, not added up. The wavelength in the middle of a band
        stands for the band.

    Raises:
        ValueError: a material is unknown, or its index cannot be evaluated in the range.
    """

    def cost(model):
        share = model.bands / scene.samples if model.bands else 1.0
        return forms[model.form].costs[model.dtype] * min(share, 1.0)

    low, high = scene.wavelength_um
    bands = (0,) if low == high else tuple(BANDS)
    alone = {"unpolarized": Model("exact, unpolarized")}
    alone |= {BANDS[x]: Model(bands=x) for x in bands if x}
    alone |= {"k = 0": Model("k = 0, s and p"), "float32": Model(dtype="float32")}
    alone |= {name: Model(name) for name in list(forms)[4:]}
    with jax.enable_x64(True):
        boundaries = [
            Boundary(name, medium, scene.eta_i, scene.wavelength_um, scene.angle_deg, forms)
            for name, medium in scene.materials.items()
        ]
        findings = {
            label: Finding(model, cost(model), *(_worst(boundaries, model, x) for x in LIGHT))
            for label, model in alone.items()
        }
        models = [Model(*x) for x in itertools.product(forms, bands, ("float64", "float32"))]
        cheapest = {}
        for light in LIGHT:
            hopeless = set()
            for model in sorted(models, key=cost):
                exact = model._replace(dtype="float64")
                if exact in hopeless:
                    continue
                # Rounded arguments only add to the error, but a look at them takes eight times as
                # long: what fails without them fails.
                first = _worst(boundaries, exact, light, scene.accuracy)
                if first.bound > scene.accuracy:
                    hopeless.add(exact)
                    continue
                rounded = model.dtype == "float32"
                worst = _worst(boundaries, model, light, scene.accuracy) if rounded else first
                if worst.bound <= scene.accuracy:
                    both = (worst, None) if light == LIGHT[0] else (None, worst)
                    cheapest[light] = Finding(model, cost(model), *both)
                    break
    return Advice(scene, findings, cheapest)
