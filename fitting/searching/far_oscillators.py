"""Oscillators above the spectrum, whose resonance the data hardly tell.

Below its resonance an oscillator adds S / (E0^2 - E^2) to eps. The data see the value and the slope
of that, and the value alone may also come from eps_inf: resonances from just above the spectrum to
far in the ultraviolet describe them nearly as well, along a valley so narrow and curved that a
solver rests on its way. One fit rested 20.7 of chi2 above the end of the valley. Other resonances
are therefore tried beside the lowest minima, each with the strength, and the eps_inf, that keep the
slope and the value.
"""

from __future__ import annotations

import numpy as np

from fitting.problem.lanes import LANES, STAGE, Ends, best_of, joined
from fitting.problem.problem import Problem
from fitting.samples.parameters import from_parameter, value_and_slope
from fitting.searching.last_steps import STAGES_ON, gone_on
from fitting.searching.minima import lowest_ends, scatter_of
from fitting.searching.next_term import oscillators
from fresnel_jax.dispersion import HC_EV_UM

# Resonances that are tried, in units of that of each of so many of the lowest minima.
_FACTORS, _PARENTS = (0.5, 0.65, 0.8, 0.9, 1.12, 1.25, 1.6, 2.2), 4
# Resonances nearer to the spectrum, as a factor on its largest energy, are not far above it.
_FAR = 1.02
# Number of rounds, and the fall of chi2 from which on another one follows.
_ROUNDS, _FALL = 3, 1e-3


def with_far_oscillators(fit: Problem, ends: Ends, noise: float) -> Ends:
    """Return the ends, and those with other resonances of the oscillators above the spectrum."""
    if fit.lanes < LANES or not oscillators(fit):
        return ends
    for _ in range(_ROUNDS if best_of(ends) is not None else 0):
        least = float(ends.cost.min())
        start = _other_resonances(fit, lowest_ends(ends)[:, :_PARENTS])
        if not start.shape[1]:
            break
        new = fit.held(start, noise, STAGE)
        gone_on(fit, new, noise, least + scatter_of(fit, least, noise)[1], least, STAGES_ON)
        ends = joined([ends, new._replace(y=fit.in_order(new.y))])
        if not ends.cost.min() < least - _FALL * fit.unit(least):
            break
    return ends


def _other_resonances(fit: Problem, y: np.ndarray) -> np.ndarray:
    """Return y (p, L) with each oscillator above the spectrum at other resonances, (p, S)."""
    energy = HC_EV_UM / fit.seen.points.wavelength_um[fit.seen.measured, 0]
    amid = float(np.median(energy))
    row = {name: i for i, name in enumerate(fit.u.spec.moving)}
    out = [y[:, :0]]
    for strength, resonance, _ in oscillators(fit):
        place = fit.u.spec.moving[strength].rpartition(".")[0]
        background = row.get(f"{place}.eps_inf")
        for factor in _FACTORS:
            S, E0 = np.exp(y[[strength, resonance]])
            far = np.minimum(E0, factor * E0) > _FAR * energy.max()
            S, E0, moved = S[far], E0[far], y[:, far]
            before, after = E0**2 - amid**2, (factor * E0) ** 2 - amid**2
            moved[resonance] = np.log(factor * E0)
            moved[strength] = np.log(S * (after / before) ** 2)
            if background is not None:
                kind = fit.u.moving[background].parameter.coordinate
                eps, _ = value_and_slope(kind, moved[background])
                eps = eps + S / before - S * after / before**2
                moved[background] = from_parameter(kind, eps)
            out.append(moved)
    low, high = (a[:, None] for a in fit.limits)
    return np.clip(np.concatenate(out, 1), low, high)
