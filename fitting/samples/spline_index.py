"""The free-form index that obeys the Kramers-Kronig relations, as a model that can be fitted.

Its parameters are amplitudes >= 0 of cubic B-splines of the absorption. Their knots are evenly
spaced over the measured photon energies and two steps beyond, and at growing distances up to three
times the highest energy. Absorption farther away is one pole above (``pole_ev2``), free electrons
or a lattice below (``drude_ev2``, 0 unless it is freed), and ``eps_inf``.
"""

from __future__ import annotations

from collections.abc import Mapping

import jax.numpy as jnp
import numpy as np
from jax import Array

from fitting.samples.parameters import Parameter
from fresnel_jax import dispersion

NAME = "kk-spline"


# The largest number of splines above the measured photon energies, and how many times the highest
# energy they reach.
_ABOVE, _REACH = 4, 3.0
# Number of splines by default: one for each measured wavelength, within these limits.
_LEAST, _MOST = 24, 48


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
            f"{NAME}:{terms} is a spline over a spectrum, and the data have one wavelength. Choose "
            "another model, such as constant."
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


def spline_parameters(terms: int, high_ev: float) -> tuple[Parameter, ...]:
    """Return the parameters other than eps_inf."""
    square = high_ev**2
    return (
        Parameter("pole_ev2", "eV^2", (0.0, 20.0 * square), 0.0, 1e4 * square),
        Parameter("drude_ev2", "eV^2", (0.0, 0.0), 0.0, 1e4 * square, held=0.0),
        *(Parameter(f"eps2_{j}", "", (0.0, 8.0), 0.0, 1e4) for j in range(1, terms + 1)),
    )


def spline_model(
    terms: int, knots_ev: tuple[float, ...], v: Mapping[str, Array]
) -> dispersion.DispersionModel:
    """Return the index of these parameters."""
    amplitudes = jnp.stack([v[f"eps2_{j}"] for j in range(1, terms + 1)])
    # a term strength / (0 - E^2) of free electrons lowers Re eps
    strengths = jnp.stack([v["pole_ev2"], v["drude_ev2"]])
    poles = (1.5 * knots_ev[-1], 0.0)
    return dispersion.KramersKronigSpline(amplitudes, knots_ev, v["eps_inf"], strengths, poles)


def without_knots(terms: int, v: Mapping[str, Array]) -> dispersion.DispersionModel:
    """Refuse to evaluate a spline whose knots are not known."""
    raise ValueError(
        f"the knots of {NAME} follow the measured wavelengths: this model can be fitted, and the "
        "fit evaluates it (Fit.predict), but it cannot be simulated without a fit."
    )
