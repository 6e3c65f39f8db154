"""Films whose index is nearly that of a medium beside them: their fringes are as weak as noise.

Where the data hardly show that there is a film, one that reflects next to no light at one of its
faces describes them at any thickness, and at some thicknesses a part of the noise as well. Then the
lowest minimum is one of these, and no random index is near enough to it: of 707 films 12 were
fitted with a chi2 that was .3 to 7 above the best one for this reason. The lowest minima known are
then tried at all thicknesses, too: with another index other fringes fit the noise, and of 25 films
that were .06 to 6 above the best minimum this led 18 to it.
"""

from __future__ import annotations

import numpy as np

from fitting.problem.lanes import LANES, STAGE, Ends
from fitting.problem.problem import Problem
from fitting.searching.film_starts import Film, coordinate, phase_rates, scaled_index
from fitting.searching.fringes import phase_rate, thickness_grid

# Evaluations of a film of a given thickness: so many tell whether it may fit; after so many the
# lowest _SOME of all thicknesses are chosen.
_HELD, _FIRST, _SOME = 24, 8, 3 * LANES
# Every other thickness that the data tell apart is tried, of so many of the lowest minima.
_EVERY, _PARENTS = 2, 6


def weak_fringes(
    fit: Problem, film: Film, lowest: np.ndarray, random: np.ndarray, noise: float, below: float
) -> list[Ends]:
    """Return the ends of films like a medium beside them, which had all thicknesses at first.

    None if no such film has a cost below ``below``. lowest: (p, 8) ends, which are then tried at
    all thicknesses. random: (p, S) starts, of which those are taken whose index times a number is
    nearest to that of the medium.
    """
    out = []
    for y in _alike(fit, film, random[:, : 4 * LANES]):
        start = _at_all_thicknesses(fit, film, y)
        some = np.linspace(0, start.shape[1] - 1, LANES // 2).astype(int)
        probe = fit.pinned(start[:, some], film.row, noise, _HELD)
        if probe.cost.min() < below:
            # From a random index, and from one that has been fitted.
            fitted = _at_all_thicknesses(fit, film, probe.lowest(1))
            out.append(_released(fit, film, np.concatenate([start, fitted], 1), noise))
    if out:
        for y in lowest[:, :_PARENTS].T:
            out.append(_released(fit, film, _at_all_thicknesses(fit, film, y[:, None]), noise))
    return out


def _released(fit: Problem, film: Film, start: np.ndarray, noise: float) -> Ends:
    """Return the ends of the best of starts (p, S), whose thickness is held at first."""
    lowest = fit.pinned(start, film.row, noise, _FIRST).lowest(_SOME)
    lowest = fit.pinned(lowest, film.row, noise, _HELD).lowest(LANES)
    return fit.held(lowest, noise, STAGE)


def _alike(fit: Problem, film: Film, y: np.ndarray) -> list[np.ndarray]:
    """Return a film (p, 1) like the medium before it, and one like that behind it.

    y: (p, L), one of which is taken. None of a film whose index is known.
    """
    rows, out = fit.seen.measured, []
    rates = phase_rates(fit, film, y)[:, rows]
    for target in _beside(fit, film, y):
        scaled = scaled_index(fit, film, y, np.median(target[:, rows] / rates, axis=1))
        off = np.abs(phase_rates(fit, film, scaled)[:, rows] / target[:, rows] - 1.0).max(axis=1)
        nearest = int(np.argmin(off))
        if (scaled != y).any():
            out.append(scaled[:, [nearest]])
    return out


def _beside(fit: Problem, film: Film, y: np.ndarray) -> list[np.ndarray]:
    """Return the phase rates (L, M) that a film would have with the index of a medium beside it."""
    points, media = fit.seen.points, fit.u.spec.media
    wavelength, angle = points.wavelength_um[:, 0], points.angle_deg[:, 0]
    outside = np.broadcast_to(fit.targets.eta_i, points.wavelength_um.shape)[:, 0]
    first = np.tile(phase_rate(outside, wavelength, angle, outside), (y.shape[1], 1))
    around = [film.medium - 1, film.medium + 1]
    return [
        first if not 0 <= i < len(media.index) else phase_rates(fit, film._replace(medium=i), y)
        for i in around
    ]


def _at_all_thicknesses(fit: Problem, film: Film, y: np.ndarray) -> np.ndarray:
    """Return y (p, 1) at thicknesses in even steps, (p, S)."""
    rate = phase_rates(fit, film, y)[0, fit.seen.measured]
    thickness = thickness_grid(rate, film.low_um, film.high_um).even[::_EVERY]
    out = np.repeat(y, len(thickness), 1)
    out[film.row] = coordinate(fit, film, thickness)
    return out
