"""Models of which others are special cases: `choose` compiles one program for all of these."""

from __future__ import annotations

from fitting.samples.dispersion import Model
from fitting.samples.parameters import Parameter

# The value at which a parameter makes its term vanish; a logarithm needs a number above 0.
_ABSENT = {
    "B": 0.0, "C": 0.0, "k_edge": 0.0, "strength_2": 0.0, "strength_ev2_1": 1e-30,
    "plasma_ev": 1e-30,
}  # fmt: skip


def wider(model: Model) -> Model:
    """Return the model in whose program another one is fitted: itself, or a wider one."""
    if model.name in ("cauchy", "cauchy-urbach"):
        return Model("cauchy-urbach", max(model.terms, 3))
    if model.name == "sellmeier":
        return Model("sellmeier", max(model.terms, 2))
    if model.name in ("drude", "lorentz"):
        return Model("drude-lorentz", model.terms)
    return model


def absent(parameter: Parameter) -> float:
    """Return the value of a parameter of the wider model that a special case does not have."""
    return _ABSENT.get(parameter.name, parameter.start[0])
