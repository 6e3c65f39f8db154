"""A search with some of the rows and with thin averages, followed with all of them.

A search takes some hundred evaluations of 64 starts, an end a handful of one. With every fourth of
491 wavelengths of a film of 280 nm the minima are where they are with all, at a quarter of the
time. What is left out tells nothing of the order of the fringes, as long as the phase between two
that are kept changes by less than a quarter of a period for the thickest film that is looked for.

Where the average over a slit or a beam takes 17 to 257 wavelengths or angles, the search takes 5.
The contrast of fringes is then right to .01 as long as a tenth of it is left. Below 17 a second
program to be compiled, for some 6 s, would take longer than what it saves.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fitting.data.measurement import Measurement
from fitting.optics.spec import BEAM, SLIT
from fitting.problem.lanes import Ends, joined
from fitting.problem.observations import observations
from fitting.problem.problem import Problem
from fitting.problem.programs import targets_of
from fitting.problem.unknowns import index_outside
from fitting.samples.sample import Sample
from fitting.searching.film_starts import films_of
from fitting.searching.minima import by_cost

# So many points are kept at least, and no phase between neighbours above that many periods, for an
# index as high as that. Without films, of a curve with next to no noise that has narrow lines, more
# points.
_LEAST, _PHASE, _ETA, _LEAST_OF_BARE = 120, 0.25, 3.0, 500
# Wavelengths in a slit and angles in a beam.
_PLACES = 5
# So many ends of different cost are compared with all data, and the lowest of these followed.
_MOST, FOLLOWED = 128, 16


def _some(m: Measurement, least: int, high_um: float) -> Measurement:
    """Return every n-th wavelength of each angle of a measurement, of all angles by turns.

    least: number of points that are kept. high_um: thickness of the thickest film. Where n is no
    larger than the number of angles each wavelength is seen at one of them, whatever the fringes.
    """
    waves, place = np.unique(m.wavelength_um, return_inverse=True)
    angles, turn = np.unique(m.angle_deg, return_inverse=True)
    if len(waves) < len(angles):
        return m
    phase = np.max(-np.diff(1.0 / waves), initial=0.0) * 2.0 * _ETA * high_um
    most = max(int(_PHASE / max(phase, 1e-9)), len(angles))
    stride = min(len(waves) * len(angles) // least, most)
    return m.where((place + turn) % stride == 0) if stride > 1 else m


def with_fewer_rows(fit: Problem, sample: Sample, measurements: Sequence[Measurement]) -> Problem:
    """Return the fit that a search takes: of a part of the data, with thin averages.

    The same fit where neither is a gain, and but for least squares without priors: else the noise
    is found from all residuals.
    """
    if fit.asked.loss != "squares" or fit.priors:
        return fit
    seen, u = fit.seen, fit.u
    films = films_of(u.spec, u.moving)
    if films or not any(u.spec.media.coherent):
        some = (_LEAST, films[0].high_um) if films else (_LEAST_OF_BARE, 0.0)
        fewer = observations([_some(m, *some) for m in measurements], fit.asked.errors)
        same = (fewer.channels, fewer.curves, fewer.stated)
        if same == (seen.channels, seen.curves, seen.stated):
            seen = fewer
    if max(u.spec.places) > max(SLIT, BEAM):
        u = u._replace(spec=u.spec._replace(places=(_PLACES, _PLACES)))
    if len(seen.row) == len(fit.seen.row) and u is fit.u:
        return fit
    outside = index_outside(sample, seen.points.wavelength_um)
    return Problem(u, seen, targets_of(u, seen, outside), fit.settings, fit.asked, whole=fit)


def followed_with_all(fit: Problem, ends: Ends) -> Ends:
    """Return where the lowest ends of a search with fewer rows lead with all.

    Of ends of the same cost one is followed, and stands for all. The others are not at rest. Where
    the model does not describe the data, the lowest with fewer rows need not be among the lowest
    with all: a narrow line between the rows that were kept costs nothing.
    """
    order, group = by_cost(ends)
    first = ends.y[:, order[np.searchsorted(group, np.arange(group[-1] + 1))]]
    some = np.argsort(fit.held(first[:, :_MOST], 1.0, 1).cost, kind="stable")[:FOLLOWED]
    found = fit.run(first[:, np.resize(some, FOLLOWED)], 1.0)
    place = np.full(first.shape[1], FOLLOWED)
    place[some] = np.arange(len(some))
    return Ends(*(a[..., place[group]] for a in joined([found, Ends.begun(first[:, :1])])))
