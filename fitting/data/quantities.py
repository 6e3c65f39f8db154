"""The quantities that can be measured: one table, which all other modules use."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

# The kinds of quantities: a fraction of the incident power, to which percent, references, a scale
# and the other parameters of a detector apply; an angle in degrees; or a number that describes the
# polarization state.
POWER, ANGLE, NUMBER = "power", "angle", "number"


class Quantity(NamedTuple):
    """A quantity that can be measured.

    kind: POWER, ANGLE or NUMBER. low, high: the range of its values, beyond which noise may move a
    power or a number. color, marker, hollow: how it is drawn. label, axis: its text in the legend
    and at the axis of a picture; ``axis`` is also what messages call a power. of_layer: whether
    the light has passed, or comes from, a second face, which one bare surface does not have.
    """

    kind: str
    low: float
    high: float
    color: str
    marker: str
    hollow: bool
    label: str
    axis: str
    of_layer: bool = False


def _power(
    axis: str, color: str, marker: str, label: str, hollow: bool = False, of_layer: bool = False
) -> Quantity:
    return Quantity(POWER, 0.0, 1.0, color, marker, hollow, label, axis, of_layer)


# The name of a power begins with its letter, which says what it is a fraction of. R and T are
# powers of unpolarized light, unless ``polarizer_deg`` says otherwise; R_back is R with the light
# on the other face. For a plain slab it equals R, so its marker is hollow. The colours are those of
# Okabe and Ito, which colour-blind readers can distinguish; markers differ as well. (M. Okabe and
# K. Ito, "Color universal design", 2008.)
TABLE = {
    "R_s": _power("reflectance", "#0072B2", "o", r"$R_\mathrm{s}$"),
    "R_p": _power("reflectance", "#D55E00", "s", r"$R_\mathrm{p}$"),
    "R": _power("reflectance", "#009E73", "D", r"$R$"),
    "R_back": _power("reflectance", "#000000", "o", r"$R_\mathrm{back}$", True, of_layer=True),
    "T_s": _power("transmittance", "#56B4E9", "^", r"$T_\mathrm{s}$", of_layer=True),
    "T_p": _power("transmittance", "#E69F00", "v", r"$T_\mathrm{p}$", of_layer=True),
    "T": _power("transmittance", "#CC79A7", "^", r"$T$", of_layer=True),
    "psi": Quantity(ANGLE, 0.0, 90.0, "#0072B2", "o", False, r"$\Psi$", r"$\Psi$ (degrees)"),
    "delta": Quantity(
        ANGLE, -360.0, 360.0, "#D55E00", "s", False, r"$\Delta$", r"$\Delta$ (degrees)"
    ),
    # Of a rotating analyzer, which measures cos Delta: Delta or 360 - Delta, what is below 180.
    "delta_folded": Quantity(
        ANGLE, 0.0, 180.0, "#D55E00", "s", True, r"$\Delta$ (folded)", r"$\Delta$ (degrees)"
    ),
    "N": Quantity(NUMBER, -1.0, 1.0, "#0072B2", "P", False, "$N$", "$N$, $C$, $S$"),
    "C": Quantity(NUMBER, -1.0, 1.0, "#D55E00", "X", False, "$C$", "$N$, $C$, $S$"),
    "S": Quantity(NUMBER, -1.0, 1.0, "#009E73", "P", False, "$S$", "$N$, $C$, $S$"),
}
QUANTITIES = tuple(TABLE)
NAME = f"<U{max(map(len, QUANTITIES))}"  # an array of names
POWERS = tuple(name for name, quantity in TABLE.items() if quantity.kind == POWER)
# Those that one bare surface shows.
REFLECTED = tuple(name for name in POWERS if not TABLE[name].of_layer)
# cos 2psi, sin 2psi cos Delta and sin 2psi sin Delta: shorter than 1 where light is depolarized.
STOKES = ("N", "C", "S")
DELTAS = ("delta", "delta_folded")
ANGLES = tuple(name for name, quantity in TABLE.items() if quantity.kind == ANGLE)
# Powers of light of any polarization, R and T; and those of s- and p-polarized light, R_s to T_p.
POWER_LETTERS = tuple(name for name in POWERS if {f"{name}_s", f"{name}_p"} <= set(POWERS))
POLARIZED = {f"{name}_{light}": light for name in POWER_LETTERS for light in "sp"}


def are_powers(names: Any) -> np.ndarray:
    """Return which of the names of quantities are powers, in the shape of ``names``."""
    return np.isin(names, POWERS)


def letter_of(name: str) -> str:
    """Return the letter of a power: R of R, R_s, R_p and R_back."""
    return name.partition("_")[0]
