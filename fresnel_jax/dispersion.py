"""Refractive index against wavelength: eta(lambda) + i k(lambda), differentiable.

    gold = material("gold")
    eta, k = gold(0.55)                                    # micrometres, in vacuum
    R = reflectance(cos_theta, gold(wavelengths))

Models: `Constant`, `Cauchy`, `Sellmeier` (lossless), `CauchyUrbach`, `DrudeLorentz` (also by
`drude` and `lorentz_drude`), `BrendelBormann`, `Gaussian`, `TaucLorentz`, `CodyLorentz`, `Sum` of
such terms, `KramersKronigSpline`, `Tabulated`; `Material` is one of them with a name and a range of
wavelengths. Each is an `equinox.Module` whose parameters are array fields: a pytree, so that
`grad`, `jit` and `vmap` reach every parameter (to jit a model itself take `equinox.filter_jit`).

Calling a model gives `Index(eta, k)` with the shape of the wavelengths and their type (float32 or
float64; Python numbers take that of the parameters). Time dependence exp(-i w t): k >= 0 absorbs.
Derivatives with respect to wavelength and parameters are finite wherever the true ones are. Errors
are a few eps unless a model says otherwise.

Range of validity: a formula has a value at every wavelength; what is known is `Material.range_um`,
and for `Tabulated` its table. A wavelength outside is refused with a ValueError; where it is traced
(under `jit`, `vmap`, `grad`), so that its value is not known when the model is called, eta and k
are NaN there, and so is their derivative with respect to that wavelength, while the derivatives of
what lies inside stay finite. `material("BK7").model` is the formula alone, which extrapolates. A
wavelength that is not a finite number above 0 is refused by every model where it can be read.
"""

from __future__ import annotations

from collections.abc import Sequence

import equinox as eqx
import numpy as np
from jaxtyping import Array, ArrayLike

from . import materials
from ._numerics.index import Index as Index
from .indices.absorption_edge import CauchyUrbach as CauchyUrbach
from .indices.absorption_edge import CodyLorentz as CodyLorentz
from .indices.absorption_edge import TaucLorentz as TaucLorentz
from .indices.formulas import Cauchy as Cauchy
from .indices.formulas import Constant as Constant
from .indices.formulas import Sellmeier as Sellmeier
from .indices.index_files import joined, tabulated, yaml_parts
from .indices.kramers_kronig import KramersKronigSpline as KramersKronigSpline
from .indices.oscillators import BrendelBormann as BrendelBormann
from .indices.oscillators import DrudeLorentz as DrudeLorentz
from .indices.oscillators import Gaussian as Gaussian
from .indices.oscillators import Sum as Sum
from .indices.published_formulas import PublishedFormula as PublishedFormula
from .indices.spectral import HC_EV_UM as HC_EV_UM
from .indices.spectral import DispersionModel as DispersionModel
from .indices.spectral import evaluate_within, in_one_type, parameters
from .indices.tabulated import Tabulated as Tabulated

__all__ = [
    "HC_EV_UM",
    "BrendelBormann",
    "Cauchy",
    "CauchyUrbach",
    "CodyLorentz",
    "Constant",
    "DispersionModel",
    "DrudeLorentz",
    "Gaussian",
    "Index",
    "KramersKronigSpline",
    "Material",
    "PublishedFormula",
    "Sellmeier",
    "Sum",
    "Tabulated",
    "TaucLorentz",
    "drude",
    "lorentz_drude",
    "material",
    "material_from_tables",
    "material_from_yaml",
]


class Material(DispersionModel):
    """A dispersion model with the range of wavelengths in which it is known, and a name.

    Arguments: `model`; `range_um`, the shortest and the longest wavelength (None: no limits);
    `name`, for the texts of errors.
    """

    model: DispersionModel
    range_um: tuple[float, float] | None = eqx.field(static=True)
    name: str = eqx.field(static=True, default="the material")

    def __check_init__(self):
        if self.range_um is not None:
            low, high = self.range_um
            if not 0.0 < low < high < float("inf"):
                raise ValueError(
                    f"range_um is {self.range_um}; wanted two wavelengths in micrometres, the "
                    "shorter one first, or None for a model without limits"
                )

    def index(self, wavelength_um: Array) -> Index:
        return self.model.index(wavelength_um)

    def __call__(self, wavelength_um: ArrayLike) -> Index:
        """`Index(eta, k)` at vacuum wavelengths in micrometres; see the module `dispersion`."""
        if self.range_um is None:
            return self.model(wavelength_um)
        wavelength = in_one_type(wavelength_um, self.model)
        return evaluate_within(self.model, wavelength, *self.range_um, self.name)


def _sellmeier(
    constant=1.0, strengths=(), numerators_um2=(), poles_um2=(), resonances_um=(), **rest
) -> Sellmeier:
    """Sellmeier's formula from any of its published forms."""
    poles = poles_um2 or [r * r for r in resonances_um]
    if numerators_um2:
        # P / (l^2 - C) = (P / C) l^2 / (l^2 - C) - P / C
        strengths = [p / c for p, c in zip(numerators_um2, poles, strict=True)]
        constant = constant - sum(strengths)
    return Sellmeier(strengths, poles, constant, **rest)


def _brendel_bormann(plasma_ev, strengths, widths_ev, resonances_ev, deviations_ev):
    strengths_ev2 = [f * plasma_ev**2 for f in strengths]
    return BrendelBormann(
        strengths_ev2[0],
        widths_ev[0],
        strengths_ev2[1:],
        resonances_ev[1:],
        widths_ev[1:],
        deviations_ev[1:],
    )


def drude(plasma_ev: ArrayLike, width_ev: ArrayLike, eps_inf: ArrayLike = 1.0) -> DrudeLorentz:
    """Free electrons: (eta + ik)^2 = eps_inf - plasma_ev^2 / (E (E + i width_ev)).

    Args: plasma energy and width (hbar over the relaxation time) in eV, eps_inf without unit.
    Source: Born and Wolf, 7th ed., sec. 14.3.
    """
    return DrudeLorentz(parameters(plasma_ev, "plasma_ev") ** 2, 0.0, width_ev, eps_inf)


def lorentz_drude(
    plasma_ev: ArrayLike,
    strengths: ArrayLike,
    widths_ev: ArrayLike,
    resonances_ev: ArrayLike,
    eps_inf: ArrayLike = 1.0,
) -> DrudeLorentz:
    """Oscillators with strengths relative to one plasma energy, as metals are usually published.

    (eta + ik)^2 = eps_inf + sum_j strengths_j plasma_ev^2 / (E_j^2 - E^2 - i E widths_ev_j),
    E_j = resonances_ev_j, 0 for the Drude term.
    Source: A. D. Rakic et al., Appl. Opt. 37, 5271 (1998), doi:10.1364/AO.37.005271, eqs. 1 to 5.
    """
    strengths_ev2 = parameters(strengths, "strengths") * parameters(plasma_ev, "plasma_ev") ** 2
    return DrudeLorentz(strengths_ev2, resonances_ev, widths_ev, eps_inf)


_FORMS = {
    "constant": Constant,
    "cauchy": Cauchy,
    "sellmeier": _sellmeier,
    "lorentz_drude": lorentz_drude,
    "brendel_bormann": _brendel_bormann,
}


def material(name: str) -> Material:
    """The dispersion model of a named material, with the range of wavelengths of its source.

    Args:
        name: as `materials.lookup` takes it; `materials.names()` lists them, and
            `materials.lookup(name)` gives source and DOI. Or an entry of the refractiveindex.info
            database, "ri:main/SiO2/nk/Malitson"; see the module `materials`.

    Raises:
        ValueError: there is no such material (the text lists similar names), the package that
            brings the database is missing, or an entry of it has no index.
    """
    if name.startswith(materials.DATABASE_PREFIX):
        text = materials.database_file(name).read_text(encoding="utf-8")
        try:
            return material_from_yaml(text, name)
        except ValueError as error:
            raise ValueError(f"{name}: {error}") from None
    record = materials.lookup(name)
    if record.form == "table":
        model = Tabulated(*record.table().T)
    else:
        model = _FORMS[record.form](**record.parameters)
    return Material(model, record.range_um, record.name)


def material_from_yaml(text: str, name: str) -> Material:
    """The index that the text of a YAML file of the refractiveindex.info database holds.

    Types "tabulated nk", "tabulated n", "tabulated k" and "formula 1" to "formula 9"; where n and k
    come in two tables the range is the common one. k is 0 if it is missing.

    Args: `text` of the file; `name`, for the texts of errors.

    Raises:
        ValueError: the text is not YAML or holds no index, a formula gives none in its range, or
            PyYAML (extra `yaml`) is missing.
    """
    parts = yaml_parts(text)
    return Material(*joined(parts["n"], parts.get("k")), name)


def material_from_tables(
    n: Sequence[ArrayLike | Sequence[float]],
    k: Sequence[ArrayLike | Sequence[float]] | None,
    name: str,
) -> Material:
    """An index from a table of n and one of k, each interpolated as in `Tabulated`.

    Args:
        n, k: wavelengths in micrometres, in any order, and as many values at them; of repeated
            wavelengths the mean is taken. k None: 0.
        name: for the texts of errors.

    Raises:
        ValueError: a table has fewer than two wavelengths or a value that is no index, or the
            wavelengths of n and k do not overlap.
    """
    n_part = tabulated(np.asarray(n[0]), np.asarray(n[1]), "n")
    k_part = None if k is None else tabulated(np.asarray(k[0]), np.asarray(k[1]), "k")
    return Material(*joined(n_part, k_part), name)
