"""The search: starts are followed, and so are proposals beside the lowest minima, while they help.

All starts lead to the first minima. From the lowest of these follow proposals (`proposals`), from
theirs the next generation, until generations gain nothing. `choose` compares its candidates after a
search that is not thorough, and goes on with those that may be taken. A fit that is repeated with
other weights begins from the minima of the first.

Of three oscillators at random places hardly ever each is next to one of the material's (of 512
starts none, for one material in ten). One alone finds the strongest, the next one what is left.
"""

from __future__ import annotations

from collections.abc import Hashable

import jax
import numpy as np

from fitting.optics.spec import Spec
from fitting.problem.lanes import LANES, SIFT, Ends, best_of, joined
from fitting.problem.problem import Kept, Problem
from fitting.problem.unknowns import terms_of
from fitting.process.progress import tell
from fitting.searching.fewer_rows import followed_with_all
from fitting.searching.film_starts import by_fringes, films_of, middle, phase_rates, thickness_um
from fitting.searching.last_steps import down_the_valley, followed
from fitting.searching.minima import NEAR_CHI2, SAME_MINIMUM, lowest_ends, lowest_lanes, scatter_of
from fitting.searching.oscillators import likely_lines, oscillators
from fitting.searching.proposals import PROPOSALS, Generation, beside, hardly_seen
from fitting.searching.starts import start_at
from fitting.uncertainty.likelihood import noise_of

# Number of evaluations before the next term is added.
_GROWING = 40


def grown_starts(fit: Problem, start: np.ndarray, noise: float, priors: bool = True) -> np.ndarray:
    """Return starts (p, 2 LANES) that were grown term by term; (p, 0) for one term.

    start: (p, S) random ones. What the search of the model with a term less has found
    (``fit.fewer``) is not grown again.
    """
    terms = terms_of(fit.u.own_names)
    if len(terms) < 2 or start.shape[1] < LANES:
        return start[:, :0]
    low, high = fit.limits
    pool = np.concatenate([start[:, :LANES], start[:, -LANES:]], 1)
    for active in range(1, len(terms)):
        # the strength, the first of a term, at its least
        most = high.copy()
        weak = [term[0] for term in terms[active:]]
        most[weak] = low[weak]
        if fit.fewer is None:
            pool = np.clip(pool, low[:, None], most[:, None])
            best = lowest_ends(fit.held(pool, noise, _GROWING, (low, most), priors))
        elif active == len(terms) - 1:
            best = np.clip(fit.fewer, low[:, None], most[:, None])
        else:
            continue
        pool = _with_term(fit, best, terms[active:], start)
    return pool


def _with_term(
    fit: Problem, best: np.ndarray, terms: list[list[int]], start: np.ndarray
) -> np.ndarray:
    """Return starts (p, 2 LANES): ``best`` (p, 8) with the first of further terms.

    Beside the best two, of an oscillator where it explains most, and beside all eight, the terms
    are those of random starts (p, S).
    """
    pools = [np.repeat(best[:, :2], LANES // 2, 1), np.repeat(best, LANES // 8, 1)]
    for term in terms:
        for pool, random in zip(pools, (start[:, -LANES:], start[:, :LANES]), strict=True):
            pool[term] = random[term]
    if terms[0] in oscillators(fit):
        lines = [likely_lines(fit, y, terms[0], LANES // 2) for y in best[:, :2].T]
        pools[0] = np.concatenate(lines, 1)
    return np.concatenate(pools, 1)


# The noise of a robust loss or priors is found in at most so many rounds: the fit, the noise of its
# residuals, the fit again, until the noise changes by a smaller part of it than this. 5 rounds are
# usual, 50 some for data with large outliers.
NOISE_ROUNDS, NOISE_SETTLED = 100, 1e-9
NO_NOISE = 1e9  # so large that a robust loss equals least squares


def _grown(fit: Problem, start: np.ndarray, noise: float, priors: bool = True) -> Ends:
    """Return the ends of starts (p, S), and of others that are grown from them term by term."""
    if isinstance(fit.u.spec, Spec):
        start = np.concatenate([grown_starts(fit, start, noise, priors), start], 1)
    return fit.run(start, noise, priors)


def solved(fit: Problem, start: np.ndarray) -> tuple[Ends, float]:
    """Return the ends of all starts and the noise that they were run at."""
    if not fit.by_noise:
        return _grown(fit, start, 1.0), 1.0
    # Least squares without priors first, for a first idea of the noise.
    ends, noise = _grown(fit, start, NO_NOISE, priors=False), NO_NOISE
    for _ in range(NOISE_ROUNDS):
        best, before = best_of(ends), noise
        if best is None:
            break
        residual = fit.slopes(ends.y[:, best]).residual
        noise = noise_of(fit.u.spec.loss, residual, fit.dof, fit.squares, fit.n_data)
        if abs(noise - before) <= NOISE_SETTLED * before:
            break
        # The first round of the true problem is from all starts, later ones from their ends.
        ends = fit.run(start, noise)
        start = ends.y
    return ends, noise if noise < NO_NOISE else 1.0


# Most generations of proposals, and how many in a row may gain nothing where the residuals are not
# noise; without a second one 2 of 8 fits of a glass plate ended far above the best minimum.
_GENERATIONS, _IN_VAIN = 12, 2


def improved(fit: Problem, ends: Ends, start: np.ndarray, noise: float, again: bool) -> Ends:
    """Return the ends, and those of proposals beside the lowest of them while they help.

    start: (p, S) random starts. again: whether the minima are those of other weights. Proposals are
    made for films, and for oscillators whose residuals are not noise.
    """
    films, thorough = films_of(fit.u.spec, fit.u.moving), fit.asked.thorough
    worth = bool(films) or (fit.lanes == LANES and bool(oscillators(fit)))
    random, in_vain = np.random.default_rng(fit.asked.seed), 0
    seen: list[float] = []
    ends = down_the_valley(fit, ends, noise)
    for _ in range(_GENERATIONS if worth else 0):
        best = best_of(ends)
        if best is None:
            break
        least, described = float(ends.cost[best]), _is_noise(fit, ends.y[:, best])
        patience = _IN_VAIN if thorough and not (again or described) else 1
        if in_vain >= patience or (described and not films):
            break
        # From a minimum that had proposals the same ones would lead to the same ends.
        new = []
        for lane in lowest_lanes(ends):
            cost = float(ends.cost[lane])
            if not any(abs(cost - other) <= SAME_MINIMUM * cost for other in seen):
                seen.append(cost)
                new.append(lane)
        of = Generation(ends.y[:, new], ends, start, noise, random)
        further = [y for propose in PROPOSALS for y in propose(fit, of)]
        if films and thorough and (described or in_vain):
            further += hardly_seen(fit, of)
        further = np.concatenate(further, 1)
        if patience == 1:
            # These are enough: of 30 starts that led lower 26 were among them.
            further = fit.held(further, noise, SIFT).lowest(LANES)
        # Beside a wrong minimum the right order of the fringes may begin far above it, and none is
        # stopped: of a film of 12 um by 9,000 of chi2, which fell by 15,000 when it was followed.
        enough = np.inf if films and patience > 1 else least
        ends = joined([ends, followed(fit, further, noise, enough)])
        ends = down_the_valley(fit, ends, noise)
        in_vain = 0 if ends.cost.min() < least - fit.unit(least) else in_vain + 1
    if thorough and films and best_of(ends) is not None:
        # Starts that were left on their way, and may fit as well as the best.
        least = float(ends.cost[ends.done].min())
        left = np.flatnonzero(~ends.done & (ends.cost < least + NEAR_CHI2 * fit.unit(least)))
        if len(left):
            shown = least + scatter_of(fit, least, noise)[1]
            ends.put(left, followed(fit, ends.y[:, left], noise, shown))
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


# Orders on either side of one that fits, and how many starts there are for them at most, of a film.
_STEPS, _MOST_ORDERS = (1, -1, 2, -2), 200
# Thicknesses whose fringes, apart from all else, have a misfit of at most so many times the least.
_LIKELY, _AS_WELL = 12, 4.0
# Two films closer than that in thickness and number of fringes are one, in fringes.
_SAME = 0.4


def with_all_orders(fit: Problem, ends: Ends, noise: float) -> Ends:
    """Return the ends, and those of the orders beside every end that fits as well as the best.

    Where the index may change with the wavelength, dozens of orders can fit within the noise. So do
    thicknesses with the same fringes at the measured points: fringes that are sampled less than
    twice look like others with as many more or fewer periods between two neighbouring points.
    """
    for film in films_of(fit.u.spec, fit.u.moving) if best_of(ends) is not None else ():

        def places(y: np.ndarray, film=film) -> np.ndarray:
            """Return the thickness (um) and the number of fringes, (L, 2), of y (p, L)."""
            thickness = thickness_um(fit, film, y)
            return np.stack([thickness, thickness * middle(phase_rates(fit, film, y))], 1)

        looked_at, known, asked = np.zeros(len(ends.cost), bool), np.empty((0, 2)), 0
        while asked < _MOST_ORDERS:
            least = float(ends.cost[ends.done].min())
            well = ends.cost < least + scatter_of(fit, least, noise)[1]
            new = np.flatnonzero(well & ~looked_at)
            if not len(new):
                break
            looked_at[new] = True
            y, lowest = ends.y[:, new], ends.y[:, new[[np.argmin(ends.cost[new])]]]
            rates = phase_rates(fit, film, lowest)
            alike = by_fringes(fit, film, lowest, rates, _LIKELY, _AS_WELL)
            start = np.concatenate([beside(fit, film, y, _STEPS), alike], 1)
            known, fresh = np.concatenate([known, places(y)]), []
            for i, at in enumerate(places(start)):
                # The step between two orders is one fringe, whatever the index.
                if (np.abs(known - at) > _SAME * np.array([at[0] / at[1], 1.0])).any(1).all():
                    known = np.concatenate([known, at[None]])
                    fresh.append(i)
            if not fresh:
                break
            asked += len(fresh)
            ends = joined([ends, followed(fit, start[:, fresh], noise, least)])
            looked_at = np.append(looked_at, np.zeros(len(fresh), bool))
    return ends


# Number of other starts beside the lowest ends of another search.
_BESIDE = 2 * LANES


def searched(job: Problem, few: Problem, points: np.ndarray) -> tuple[Ends, float]:
    """Return where the starts (p, S) and those beside them ended, and the noise they were run at.

    few: the same fit, or one of some of the data, whose minima are then followed with all data. A
    search that was made before is not repeated.
    """
    kept, thorough = job.asked.kept or Kept({}, {}), job.asked.thorough
    near, few.fewer, some = _near(few, kept), None, points
    same = near is not None and not _lacks_a_term(few, kept)
    if near is not None and same:
        some = np.concatenate([near, points[:, :: max(points.shape[1] // _BESIDE, 1)]], 1)
    else:
        few.fewer = near
    again = same and job.asked.near == job.asked.kept_as
    count = points.shape[1] if thorough and not again else some.shape[1]
    few.lanes = min(some.shape[1], LANES)
    first = _key_of(job, points)
    part = f" in {few.n_data} of {job.n_data} data" * (few is not job)
    tell(done=0, stage=f"search from {points.shape[1]} starts{part}")
    if (first, thorough) not in kept.ends:
        if first not in kept.ends:
            ends, noise = solved(few, some)
            # With a parameter of the instrument more, a search first only asks whether that may
            # help: further starts follow where it is thorough.
            if not thorough and (again or not same):
                ends = improved(few, ends, some, noise, again)
            kept.ends[first] = ends, noise
        ends, noise = kept.ends[first]
        if thorough:
            if same and not again:
                ends = joined([ends, solved(few, points)[0]])
            tell(done=0, stage=f"search beside the best{part}")
            ends = improved(few, ends, points, noise, again)
        lowest = zip(few.u.spec.moving, lowest_ends(ends), few.u.free, strict=True)
        kept.lowest[job.asked.kept_as] = {name: y for name, y, free in lowest if free}
        if few is not job:
            tell(done=0, stage=f"first answer refined with all {job.n_data} data")
            ends = followed_with_all(job, ends)
        if thorough:
            ends = with_all_orders(job, ends, noise)
        kept.ends[first, thorough] = ends, noise
    # those tried beside the lowest minima are starting points, too
    ends, noise = kept.ends[first, thorough]
    job.starts = count + max(len(ends.cost) - min(count, LANES), 0)
    return ends, noise


def _key_of(fit: Problem, start: np.ndarray) -> Hashable:
    """Return everything that the result of a search depends on, as a key."""
    own = [start, *fit.limits, *jax.tree.leaves(fit.targets)]
    asked = fit.asked.loss, fit.asked.scaled, fit.asked.near
    return fit.u.spec, asked, *(np.asarray(a).tobytes() for a in own)


def _near(fit: Problem, kept: Kept) -> np.ndarray | None:
    """Return the lowest ends (p, 8) of another search that are of use here, if there is one.

    A robust loss, and priors, estimate the noise from all starts.
    """
    if fit.asked.near not in kept.lowest or fit.u.spec.loss != "squares" or fit.priors:
        return None
    # What the other fit had fixed begins where it was, so that the minima are no higher.
    parameters = [w.parameter for w in fit.u.moving]
    neutral = {p.name: p.held for p in parameters if p.held is not None}
    y, (low, high) = np.repeat(start_at(fit.u.moving, neutral)[:, None], 8, 1), fit.limits
    for row, name in enumerate(fit.u.spec.moving):
        y[row] = kept.lowest[fit.asked.near].get(name, y[row])
    return np.clip(y, low[:, None], high[:, None])


def _lacks_a_term(fit: Problem, kept: Kept) -> bool:
    """Whether the model of the other search has a term less."""
    known, names = kept.lowest[str(fit.asked.near)], fit.u.spec.moving
    return any(
        fit.u.free[i] and names[i] not in known for t in terms_of(fit.u.own_names) for i in t
    )
