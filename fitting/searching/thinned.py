"""A search with some of the wavelengths and with thin averages, continued with all of them.

A search takes some hundred evaluations of 64 starts, an end a handful of one. With every fourth of
491 wavelengths of a film of 280 nm the minima are where they are with all, at a quarter of the
time. What is left out tells nothing of the order of the fringes, as long as the phase between two
that are kept changes by less than a quarter of a period for the thickest film that is looked for.

Where programs have one shape for all numbers of rows (`programs_in_parts`), so that a part of them
needs no program of its own, a surface of thousands of wavelengths is thinned too (a first `choose`
of wood, 6,898 of them, took a quarter of the time), and of a measurement at several angles each
wavelength is taken at some of them only.

Where the average over a slit or a beam takes 17 to 257 wavelengths or angles, the search takes 5.
The contrast of fringes is then right to .01 as long as a tenth of it is left. A film of 1.3 um and
a beam of .4 degrees took 46 s before, and takes 14 s. Below 17 a second program to be compiled, for
some 6 s, would take longer than what it saves.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fitting.data.measurement import Measurement
from fitting.optics.instrument import BEAM, SLIT
from fitting.problem.lanes import Ends
from fitting.problem.observations import Observations, observations
from fitting.problem.problem import Problem
from fitting.problem.programs import targets_of
from fitting.problem.programs_in_parts import in_parts
from fitting.problem.row_blocks import ROWS
from fitting.problem.unknowns import index_outside
from fitting.samples.sample import Sample
from fitting.searching.film_starts import films_of
from fitting.searching.last_steps import polished
from fitting.searching.minima import ALTERNATIVE_CHI2, NEAR_CHI2, SAME_CHI2
from fitting.uncertainty.covariance import uncertainty_at

# So many wavelengths are kept at least, and no phase between neighbours above that many periods,
# for an index as high as that; but for the few gaps of `_whole_blocks`, of twice as many.
_LEAST, _PHASE, _ETA = 120, 0.25, 3.0
# Without films, of a curve with next to no noise that has narrow lines, so many.
_LEAST_OF_BARE = 500
# A block of 64 rows is not begun for so many or fewer. (Of 41 wavelengths at seven angles, 128 rows
# instead of 143 take two thirds of the time.)
_FEW = 24
# Wavelengths in a slit and angles in a beam.
_PLACES = 5
# Places of the lowest ends at which all data are compared, and how many of these are followed.
# Each end is compared with so many of the places before it.
_MOST, FOLLOWED, _BESIDE = 128, 16, 32
# Ends closer than SAME_CHI2 and, in every coordinate, than that are one.
_SAME_PLACE = 1e-3
# An end has converged if a step is expected to lower chi2 by less than this.
_AT_REST = 1e-4


def _kept(waves: np.ndarray, least: int, high_um: float) -> np.ndarray:
    """Return which of the wavelengths (W,), rising, the search takes: ``least`` or more.

    high_um: thickness of the thickest film that is looked for.
    """
    stride = len(waves) // least
    while stride > 1:
        some = waves[::stride]
        phases = -np.diff(1.0 / some) * 2.0 * _ETA * high_um
        if np.ptp(1.0 / some) and phases.max() <= _PHASE:
            # Where one is left out its neighbours are at most half a period apart: enough to tell
            # the order of the fringes, since all others are closer.
            return some[_whole_blocks(len(some))]
        stride -= 1
    return waves


def _whole_blocks(count: int) -> np.ndarray:
    """Return which of so many rows are taken: all, or as many as fill whole blocks.

    What exceeds these, if that is _FEW or less, is left out evenly.
    """
    over = count % ROWS
    if over > _FEW:
        return np.arange(count)
    return np.linspace(0, count - 1, count - over).round().astype(int)


def _shared_out(m: Measurement) -> Measurement:
    """Return a measurement at several angles with each wavelength at some of them, by turns."""
    waves, place = np.unique(m.wavelength_um, return_inverse=True)
    angles, turn = np.unique(m.angle_deg, return_inverse=True)
    stride = min(len(waves) * len(angles) // _LEAST, len(angles))
    if stride < 2 or len(waves) < len(angles) or len(m) < len(waves) * len(angles):
        return m
    # Several quantities may be measured at one point.
    point = place * len(angles) + turn
    some = np.unique(point[(place + turn) % stride == 0])
    return m.where(np.isin(point, some[_whole_blocks(len(some))]))


def thinned(fit: Problem, sample: Sample, measurements: Sequence[Measurement]) -> Problem:
    """Return the fit that a search takes: of a part of the wavelengths, with thin averages.

    The same fit where neither is a gain, and but for least squares without priors: else the noise
    is found from all residuals.
    """
    if fit.asked.loss != "squares" or fit.priors:
        return fit
    seen = _some_of(fit, measurements)
    u = fit.u
    if max(u.spec.places) > max(SLIT, BEAM):
        u = u._replace(spec=u.spec._replace(places=(_PLACES, _PLACES)))
    if seen is fit.seen and u is fit.u:
        return fit
    outside = index_outside(sample, seen.points.wavelength_um)
    return Problem(u, seen, targets_of(u, seen, outside), fit.settings, fit.asked, whole=fit)


def _some_of(fit: Problem, measurements: Sequence[Measurement]) -> Observations:
    """Return the observations of a part of the wavelengths, or of all."""
    films, cut = films_of(fit.u.spec, fit.u.moving), in_parts(fit.u.spec, fit.targets)
    if not films and (any(fit.u.spec.media.coherent) or not cut):
        return fit.seen
    least, high_um = (_LEAST, films[0].high_um) if films else (_LEAST_OF_BARE, 0.0)
    parts = []
    for m in measurements:
        if not np.isfinite(m.wavelength_um).all():
            return fit.seen
        some = _kept(np.unique(m.wavelength_um), least, high_um)
        less = m.where(np.isin(m.wavelength_um, some))
        parts.append(_shared_out(m) if cut and len(less) == len(m) else less)
    if sum(map(len, parts)) == sum(map(len, measurements)):
        return fit.seen
    seen = observations(parts, fit.asked.errors)
    kind = (seen.channels, seen.curves, seen.stated)
    return seen if kind == (fit.seen.channels, fit.seen.curves, fit.seen.stated) else fit.seen


def _at_rest(fit: Problem, y: np.ndarray) -> tuple[np.ndarray, float, bool]:
    """Return y (p,) at the minimum of all data beside it, the cost there, and whether it rests."""
    y, s = polished(fit, y, 1.0, valley=False)
    cost = fit.cost(s, y, 1.0)
    if not (np.isfinite(cost) and np.isfinite(s.jacobian).all()):
        return y, np.inf, False
    step = np.clip(y + uncertainty_at(fit, s, y, 1.0).step, *fit.limits) - y
    promised = float(s.residual @ s.residual - ((s.residual + s.jacobian @ step) ** 2).sum())
    return y, cost, promised <= _AT_REST * cost / max(fit.dof, 1)


def followed_with_all(fit: Problem, few: Problem, ends: Ends) -> Ends:
    """Return ``ends`` of the fit ``few``, the lowest for all data at the minima of these.

    By undamped steps; where one that might be shown comes to no rest, by the solver. The other ends
    keep their place, and are not at rest. Where the model does not describe the data, the lowest of
    few data need not be among the lowest of all: a narrow line between those kept costs nothing.
    """
    if not np.isfinite(ends.cost).any():
        return ends
    unit = few.unit(float(ends.cost.min()))
    groups = _places(ends, unit)
    here = fit.held(ends.y[:, [group[0] for group in groups]], 1.0, 1).cost
    y, cost, done = ends.y.copy(), np.full_like(ends.cost, np.inf), np.zeros_like(ends.done)
    for group, value in zip(groups, here, strict=True):
        cost[group] = value
    groups = [groups[i] for i in np.argsort(here, kind="stable")[:FOLLOWED]]
    found = [_at_rest(fit, ends.y[:, group[0]]) for group in groups]
    lowest = min(one[1] for one in found)
    if not all(rests for _, least, rests in found if least <= lowest + ALTERNATIVE_CHI2 * unit):
        near = [i for i, one in enumerate(found) if one[1] <= lowest + NEAR_CHI2 * unit]
        # outside programs in parts all lanes of a program are run
        lanes = near if in_parts(fit.u.spec, fit.targets) else np.resize(near, FOLLOWED)
        more = fit.run(np.stack([found[i][0] for i in lanes], 1), 1.0)
        ended = zip(more.y.T, more.cost.tolist(), more.done.tolist(), strict=True)
        for i, end in zip(near, ended, strict=False):
            found[i] = end
    for group, (place, least, rests) in zip(groups, found, strict=False):
        y[:, group], cost[group], done[group] = place[:, None], least, rests
    return Ends(fit.in_order(y), cost, done, ends.evaluations)


def _places(ends: Ends, unit: float) -> list[list[int]]:
    """Return the lanes of each place among the lowest ends, by rising cost; _MOST at most."""
    groups: list[list[int]] = []
    for lane in np.argsort(ends.cost, kind="stable").tolist():
        near = [g for g in groups[-_BESIDE:] if _same(ends, g[0], lane, unit)]
        if near:
            near[0].append(lane)
        elif len(groups) < _MOST and np.isfinite(ends.cost[lane]):
            groups.append([lane])
        else:
            break
    return groups


def _same(ends: Ends, a: int, b: int, unit: float) -> bool:
    if ends.cost[b] - ends.cost[a] > SAME_CHI2 * unit:
        return False
    off = np.abs(ends.y[:, b] - ends.y[:, a])
    return bool((off <= _SAME_PLACE * (1.0 + np.abs(ends.y[:, b]))).all())
