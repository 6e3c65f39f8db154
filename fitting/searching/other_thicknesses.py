"""Other thicknesses of films that have no whole fringe, and starts that were left on their way.

The thickness of a film with less than a fringe follows from the form of a curve alone, and another
index may give the same form with another thickness. Thicknesses around the lowest minima are held
while all else is fitted, and then released. So are those of films that are hardly seen.
"""

from __future__ import annotations

import numpy as np

from fitting.problem.lanes import LANES, STAGE, Ends, best_of, joined
from fitting.problem.problem import Problem
from fitting.searching.film_starts import (
    Film,
    coordinate,
    films_of,
    middle,
    phase_rates,
    thickness_um,
)
from fitting.searching.last_steps import STAGES_ON, gone_on
from fitting.searching.minima import NEAR_CHI2, lowest_ends, scatter_of
from fitting.searching.weak_fringes import weak_fringes

# Thicknesses that are tried, as parts of that of each of so many of the lowest minima.
_FACTORS, _PARENTS = np.geomspace(0.1, 8.0, 24), 2
# Films of more fringes than that are told apart by them; see `fringe_orders`.
_FRINGES = 2.0
# The thinnest film that is tried with a random index, as a part of the thickest.
_THIN = 1e-3


def with_other_thicknesses(fit: Problem, ends: Ends, start: np.ndarray, noise: float) -> Ends:
    """Return the ends, and those at other thicknesses of thin films; starts that were left go on.

    start: (p, S) random starts.

    What fits as well as the best minimum is told, but for what was not looked at: 59 nm of a
    Drude-Lorentz film, of which psi and Delta were measured, was found as 106 +- 6 nm with a chi2
    that was .05 lower, and as nothing else.
    """
    films = films_of(fit.u.spec, fit.u.moving)
    for film in films:
        if best_of(ends) is not None:
            ends = joined([ends, *_at_thicknesses(fit, film, lowest_ends(ends), start, noise)])
            lowest = lowest_ends(ends)
            ends = joined([ends, *weak_fringes(fit, film, lowest, start, noise, _near(fit, ends))])
    if films and best_of(ends) is not None:
        least = float(ends.cost[ends.done].min())
        shown = least + scatter_of(fit, least, noise)[1]
        gone_on(fit, ends, noise, _near(fit, ends), shown, STAGES_ON)
        ends = ends._replace(y=fit.in_order(ends.y))
    return ends


def _at_thicknesses(
    fit: Problem, film: Film, lowest: np.ndarray, random: np.ndarray, noise: float
) -> list[Ends]:
    """Return the ends of starts whose thickness was held at first; none of a thick film.

    They are beside ``lowest`` (p, 8), and thin films of the indices of ``random`` (p, S), of which
    hardly any is thin by itself.
    """
    y = lowest[:, :_PARENTS]
    thickness = thickness_um(fit, film, y)
    thin = thickness * middle(phase_rates(fit, film, y)) < _FRINGES
    bounds, tried = fit.u.moving[film.row], np.outer(thickness, _FACTORS)
    inside = thin[:, None] & (tried > max(1e-3 * bounds.low, 0.0)) & (tried < 1e-3 * bounds.high)
    if not inside.any():
        return []
    parent, _ = np.nonzero(inside)
    start = np.concatenate([y[:, parent], random[:, :LANES]], 1)
    most = np.minimum(_FRINGES / middle(phase_rates(fit, film, random[:, :LANES])), film.high_um)
    least = max(film.low_um, _THIN * float(most.max()))
    thin_um = least * np.maximum(most / least, 1.0) ** np.linspace(0.0, 1.0, len(most))
    start[film.row] = coordinate(fit, film, np.append(tried[inside], thin_um))
    held = fit.pinned(start, film.row, noise, STAGE)
    return [fit.held(held.y, noise, STAGE)]


def _near(fit: Problem, ends: Ends) -> float:
    """Return the cost up to which a start is near the best end, of which there is one."""
    least = float(ends.cost[ends.done].min())
    return least + NEAR_CHI2 * fit.unit(least)
