"""The quantities that can be measured: one table, which the rest of the package goes by."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

# What a quantity is: a fraction of the incident light, on which percent, references, a scale and
# the other parameters of a detector act; an angle in degrees; or a number of the light's form.
POWER, ANGLE, NUMBER = "power", "angle", "number"


class Quantity(NamedTuple):
    """One of the things that a datum can be.

    kind: POWER, ANGLE or NUMBER. low, high: the range of its values; noise may carry a power or a
    number beyond it. color, marker, hollow: how it is drawn. label, axis: of the legend and of the
    axis of a picture.
    """

    kind: str
    low: float
    high: float
    color: str
    marker: str
    hollow: bool
    label: str
    axis: str


def _power(color: str, marker: str, label: str, hollow: bool = False) -> Quantity:
    what = "transmittance" if label.startswith("$T") else "reflectance"
    return Quantity(POWER, 0.0, 1.0, color, marker, hollow, label, what)


# R and T are powers of unpolarized light, unless ``polarizer_deg`` says otherwise; R_back is R with
# the light on the other face (equal to R for a plain slab), hollow because the two lie on each
# other. The colours are Okabe and Ito's, told apart by colour-blind readers too; markers differ as
# well. (M. Okabe and K. Ito, "Color universal design", 2008.)
TABLE = {
    "R_s": _power("#0072B2", "o", r"$R_\mathrm{s}$"),
    "R_p": _power("#D55E00", "s", r"$R_\mathrm{p}$"),
    "R": _power("#009E73", "D", r"$R$"),
    "R_back": _power("#000000", "o", r"$R_\mathrm{back}$", hollow=True),
    "T_s": _power("#56B4E9", "^", r"$T_\mathrm{s}$"),
    "T_p": _power("#E69F00", "v", r"$T_\mathrm{p}$"),
    "T": _power("#CC79A7", "^", r"$T$"),
    "psi": Quantity(ANGLE, 0.0, 90.0, "#0072B2", "o", False, r"$\Psi$", r"$\Psi$ (degrees)"),
    "delta": Quantity(
        ANGLE, -360.0, 360.0, "#D55E00", "s", False, r"$\Delta$", r"$\Delta$ (degrees)"
    ),
}
QUANTITIES = tuple(TABLE)
NAME = f"<U{max(map(len, QUANTITIES))}"  # an array of names
POWERS = tuple(name for name, quantity in TABLE.items() if quantity.kind == POWER)
ANGLES = tuple(name for name, quantity in TABLE.items() if quantity.kind == ANGLE)


def are_powers(names: Any) -> np.ndarray:
    """Return which of the names of quantities are those of powers, of the shape of ``names``."""
    return np.isin(names, POWERS)
