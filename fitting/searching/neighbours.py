"""Further starts near the lowest minima, which often differ from the best one in one thing only.

Another order of the fringes, another place of an oscillator, and some parameters of a random start
are tried at the lowest minima, as long as this leads to lower ones.
"""

from __future__ import annotations

import numpy as np

from fitting.problem.lanes import LANES, SIFT, Ends, best_of, joined
from fitting.problem.problem import Problem
from fitting.samples.parameters import from_parameter, start_range, value_and_slope
from fitting.searching.film_starts import films_of, starts_from_parts
from fitting.searching.last_steps import down_the_valley, followed
from fitting.searching.minima import SAME_MINIMUM, lowest_ends, lowest_lanes
from fitting.searching.oscillators import likely_lines, oscillators
from fitting.searching.other_thicknesses import beside as orders_beside

# Fringe orders beside the best minimum that are tried, and how many of them beside others.
_ORDERS, _FEW = [sign * n for n in range(1, 9) for sign in (1, -1)], 6
# Number of rounds of further starts; how many of them in a row may find nothing lower; and the
# share of parameters that is taken from other starts.
_ROUNDS, _IN_VAIN, _ANEW = 12, 2, 0.4
# Number of evaluations of every start where none has led to residuals that are noise.
_FAR = 300


def with_neighbours(
    fit: Problem, ends: Ends, start: np.ndarray, noise: float, thorough: bool = False
) -> Ends:
    """Return the ends, and those of further starts near the lowest of them, as long as these help.

    start: (p, S) random starts. This is done for films, and for other samples with oscillators if
    the residuals are not noise, until a round finds no lower minimum.

    thorough: after that, if the residuals are still not noise, another round follows (without it, 2
    of 8 fits of a glass plate ended far above the best minimum), and more while these help: for
    films with starts that are not stopped on their way, and before it with all starts followed
    further.
    """
    films = films_of(fit.u.spec, fit.u.moving)
    worth = bool(films) or (fit.lanes == LANES and bool(oscillators(fit)))
    random, tried = np.random.default_rng([fit.asked.seed, thorough]), False
    in_vain = int(thorough)
    moved: list[float] = []
    ends = down_the_valley(fit, ends, noise)
    for _ in range(_ROUNDS if worth else 0):
        best = best_of(ends)
        if best is None:
            break
        least, y = float(ends.cost[best]), ends.y[:, best]
        described = _is_noise(fit, y)
        if (in_vain and not thorough) or ((in_vain or not films) and described):
            break
        if in_vain and films and not tried:
            tried = True
            # A search follows the starts that are lowest after a few evaluations. The one of 832
            # that led to the best minimum of a film was 674th then, and first after _FAR.
            some = [start, *starts_from_parts(fit, films[0], (start, lowest_ends(ends)))]
            far = fit.held(np.concatenate(some, 1), noise, _FAR).lowest(LANES)
            ends = joined([ends, followed(fit, far, noise, least)])
        further = [_other_lines(fit, ends, moved), _crossed(fit, ends, start, random)]
        # Where an oscillator stands for the free electrons, the order of the fringes is another.
        as_electrons = _as_free_electrons(fit, y[:, None], start[:, :1])
        as_electrons = as_electrons[:, (as_electrons != y[:, None]).any(0)]
        for film in films:
            further.append(orders_beside(fit, film, y[:, None], _ORDERS))
            further.append(orders_beside(fit, film, as_electrons, _ORDERS[:_FEW]))
        further = np.concatenate([*further, as_electrons], 1)
        if not fit.asked.thorough:
            # Enough to compare candidates: of 30 starts that led lower 26 were among these.
            further = fit.held(further, noise, SIFT).lowest(LANES)
        # Beside a wrong minimum the right order of the fringes may begin far above it, and none is
        # stopped: of a film of 12 um by 9,000 of chi2, which fell by 15,000 when it was followed.
        known = least if described or not films or not thorough else np.inf
        ends = joined([ends, followed(fit, further, noise, known)])
        ends = down_the_valley(fit, ends, noise)
        in_vain = 0 if ends.cost.min() < least - fit.unit(least) else in_vain + 1
        if in_vain == _IN_VAIN:
            break
    return ends


def _is_noise(fit: Problem, y: np.ndarray) -> bool:
    """Whether the residuals at y look like noise: to three sigma they are not autocorrelated.

    And, if errors are stated, not larger than these.
    """
    r = fit.slopes(y).residual
    square, dof = float(r @ r), max(fit.dof, 1)
    alike = float(r[1:] @ r[:-1]) > 3.0 * square / np.sqrt(len(r))
    large = fit.seen.stated and square > dof + 3.0 * np.sqrt(2.0 * dof)
    return not (alike or large)


def _crossed(fit: Problem, ends: Ends, start: np.ndarray, random: np.random.Generator):
    """Return starts (p, LANES) made of the lowest ends with some parameters of random starts.

    A right thickness with a wrong dispersion, or the other way round, is a minimum of its own.
    """
    parents = np.repeat(lowest_ends(ends), LANES // 8, 1)
    other = start[:, random.integers(start.shape[1], size=LANES)]
    mixed = np.where(random.random(parents.shape) < _ANEW, other, parents)
    mixed[:, ::4] = _as_free_electrons(fit, parents[:, ::4], other[:, ::4])
    return mixed


def _as_free_electrons(fit: Problem, y: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return y (p, L) with the first oscillator of a film as its free electrons, and a weak one.

    An oscillator below the spectrum does the same as free electrons, so that it may take their
    place, and they its own as a background: a minimum of its own, far above the best one.
    """
    row, out = {name: i for i, name in enumerate(fit.u.spec.moving)}, y.copy()
    for place in fit.u.spec.media.places:
        names = [f"{place}.{n}" for n in ("plasma_ev", "width_ev", "strength_ev2_1", "width_ev_1")]
        rows = [row[n] for n in names if n in row]
        if len(rows) < 4 or not all(fit.u.moving[i].free for i in rows):
            continue
        kinds = [fit.u.moving[i].parameter.coordinate for i in rows]
        strength, width = (value_and_slope(kinds[i], y[rows[i]])[0] for i in (2, 3))
        out[rows[0]] = from_parameter(kinds[0], np.sqrt(strength))
        out[rows[1]] = from_parameter(kinds[1], width)
        new = [i for name, i in row.items() if name.startswith(place) and name.endswith("_1")]
        out[new] = other[new]
        out[rows[2]] = from_parameter(kinds[2], start_range(fit.u.moving[rows[2]])[0])
    return out


def _other_lines(fit: Problem, ends: Ends, seen: list[float]) -> np.ndarray:
    """Return starts (p, S): the lowest ends, each oscillator moved to where it explains most.

    seen: costs of the minima whose oscillators have been moved before, in this round too. These
    are left out, since the same starts would lead to the same ends, and the new ones are added.
    """
    terms, out = oscillators(fit), [ends.y[:, :0]]
    for lane in lowest_lanes(ends) if terms else ():
        y, cost = ends.y[:, lane], float(ends.cost[lane])
        if any(abs(cost - other) <= SAME_MINIMUM * cost for other in seen):
            continue
        seen.append(cost)
        for term in terms:
            without = y.copy()
            without[term[0]] = fit.limits[0][term[0]]
            out.append(likely_lines(fit, without, term, LANES // (4 * len(terms))))
    return np.concatenate(out, 1)
