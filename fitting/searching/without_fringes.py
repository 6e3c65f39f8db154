"""The best film without fringes, beside which the fringes of a solution stand out of the noise.

Of hundreds of thicknesses there is always one whose fringes look like a part of the noise: where
the film is thinner than a fringe, or its fringes are weaker than the noise, this one has the lowest
chi2, and an error of a thousandth of its value. The film without fringes is shown then: of 103
random films for which this was so, 92 were thinner than 100 nm.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from fitting.problem.lanes import LANES, SIFT, STAGE, Ends
from fitting.problem.problem import Problem
from fitting.searching.film_starts import Film, coordinate, films_of, phase_rates, thickness_um
from fitting.searching.minima import lowest_ends
from fitting.searching.starts import starts

# In one measurement of so many noise alone gives fringes that lower chi2 by more.
_ONE_OF = 1000.0
# A film whose phase changes by less than a period over the data is taken to have no fringes.
FRINGES = 1.0


class Fringeless(NamedTuple):
    """The best film without fringes.

    name: of its thickness. thickness_nm, cost: of the best film of less than a fringe. ends: the
    minimum next to it, one lane. count: of thicknesses that the data can tell apart.
    """

    name: str
    thickness_nm: float
    cost: float
    ends: Ends
    count: float

    @property
    def by_chance(self) -> float:
        """By how much the best of all thicknesses may lower chi2 from noise alone."""
        return gain_by_chance(self.count)

    def told(
        self, fit: Problem, shown: np.ndarray, lowest: np.ndarray, rise: float
    ) -> dict[str, Any]:
        """Return the values of the warning.

        shown, lowest: (p,) the solution that is shown, and that of the lowest chi2. rise: by how
        much chi2 is higher without fringes.
        """
        plain = fringes_of(fit, shown) < FRINGES
        film = films_of(fit.u.spec, fit.u.moving)[0]
        at = 1e3 * thickness_um(fit, film, np.stack([shown, lowest], 1))
        return {
            "parameter": self.name, "without": float(at[0]) if plain else self.thickness_nm,
            "fringed": float(at[1]), "shown": plain, "delta_chi2": rise, "count": self.count,
            "by_chance": self.by_chance,
        }  # fmt: skip


def gain_by_chance(count: float) -> float:
    """Return by how much the best of ``count`` independent fringes lowers chi2, from noise alone.

    One of `_ONE_OF` measurements has more: the upper bound of R. V. Baluev, Mon. Not. R. Astron.
    Soc. 385, 1279 (2008), doi:10.1111/j.1365-2966.2008.12689.x, for an amplitude and a phase.
    """
    many = np.log(_ONE_OF * max(count, 1.0))
    return float(2.0 * many + np.log(many))


def fringes_of(fit: Problem, y: np.ndarray) -> float:
    """Return how many fringes the film that may be thickest has in the data, at y (p,)."""
    film = films_of(fit.u.spec, fit.u.moving)[0]
    return float(thickness_um(fit, film, y[:, None])[0]) * _spread(fit, film, y)


def _spread(fit: Problem, film: Film, y: np.ndarray) -> float:
    """Return how many fringes a micrometre of the film has in the data, at y (p,)."""
    return float(np.ptp(phase_rates(fit, film, y[:, None])[0, fit.seen.measured]))


def without_fringes(fit: Problem, y: np.ndarray, noise: float) -> Fringeless | None:
    """Return the best film without fringes; None if that at y (p,) is one, or none is allowed."""
    films = films_of(fit.u.spec, fit.u.moving)
    if not films:
        return None
    film, unknown = films[0], fit.u.moving[films[0].row]
    spread = _spread(fit, film, y)
    fringes = float(thickness_um(fit, film, y[:, None])[0]) * spread
    if fringes < FRINGES or 1e-3 * unknown.low * spread >= FRINGES:
        return None
    most = FRINGES / spread
    start = np.append(starts(fit.u.moving, LANES - 1, fit.asked.seed), y[:, None], 1)
    least = max(1e-3 * unknown.low, 1e-4 * most)
    start[film.row] = coordinate(fit, film, np.geomspace(least, most, LANES))
    low, thin = fit.limits[0], fit.limits[1].copy()
    thin[film.row] = coordinate(fit, film, np.array(most))
    few = fit.held(np.clip(start, low[:, None], thin[:, None]), noise, SIFT, (low, thin))
    few = fit.held(lowest_ends(few), noise, 2 * STAGE, (low, thin))
    best = few.lowest(1)
    ends = fit.held(best, noise, 2 * STAGE)
    return Fringeless(
        name=fit.u.labels[fit.u.spec.moving[film.row]],
        thickness_nm=1e3 * float(thickness_um(fit, film, best)[0]),
        cost=float(few.cost.min()), ends=ends,
        count=min(film.high_um * spread, 0.5 * fit.n_data),
    )  # fmt: skip
