"""The stages of a search in turn, and what one search leaves for others of the same data.

The first stages find the best minimum of nearly all data: all starts, and further ones beside the
lowest ends as long as these help. `fit` goes on where they may have missed it: where the model does
not describe the data, and at other thicknesses of films. `choose` compares its candidates after the
first stages, and goes on with those that may be taken. A fit that is repeated with other weights
begins from its minima, and goes on at other thicknesses only.

Of three oscillators at random places hardly ever each is next to one of the material's (of 512
starts none, for one material in ten). One alone finds the strongest, the next one what is left.
"""

from __future__ import annotations

from collections.abc import Hashable

import jax
import numpy as np

from fitting.optics.spec import Spec
from fitting.problem.lanes import LANES, Ends, best_of, joined
from fitting.problem.problem import Kept, Problem
from fitting.problem.programs import Targets
from fitting.problem.unknowns import terms_of
from fitting.process.progress import tell
from fitting.searching.fewer_rows import followed_with_all
from fitting.searching.minima import lowest_ends
from fitting.searching.neighbours import with_neighbours
from fitting.searching.oscillators import likely_lines, oscillators, with_far_oscillators
from fitting.searching.other_thicknesses import with_all_orders, with_other_thicknesses
from fitting.searching.starts import start_at
from fitting.uncertainty.likelihood import reduced_chi2

# Number of evaluations before the next term is added.
_GROWING = 40


def grown_starts(fit: Problem, targets: Targets, start: np.ndarray, noise: float) -> np.ndarray:
    """Return starts (p, 2 LANES) that were grown term by term; (p, 0) for one term.

    start: (p, S) random ones. What the search of the model with a term less has found
    (``fit.fewer``) is not grown again.
    """
    terms = terms_of(fit.u.own_names)
    if len(terms) < 2 or start.shape[1] < LANES:
        return start[:, :0]
    low, high = fit.limits
    pools = [start[:, :LANES], start[:, -LANES:]]
    for active in range(1, len(terms)):
        held = low.copy(), high.copy()
        for term in terms[active:]:
            # the strength, the first of a term, at its least
            held[1][term[0]] = low[term[0]]
        least, most = (a[:, None] for a in held)
        if fit.fewer is None:
            ends = [fit.held(y.clip(least, most), noise, _GROWING, held, targets) for y in pools]
            pools = _with_term(fit, lowest_ends(joined(ends)), terms[active:], start)
        elif active == len(terms) - 1:
            pools = _with_term(fit, fit.fewer.clip(least, most), terms[active:], start)
    return np.concatenate(pools, 1)


def _with_term(
    fit: Problem, best: np.ndarray, terms: list[list[int]], start: np.ndarray
) -> list[np.ndarray]:
    """Return two pools of starts (p, LANES): ``best`` (p, 8) with the first of further terms.

    Where it explains most beside the best two, or, of a model whose terms are no oscillators, weak
    and anywhere; and as it comes in ``start`` (p, S) beside all eight.
    """
    lines = oscillators(fit)
    pools = [np.repeat(best[:, :2], LANES // 2, 1), np.repeat(best, LANES // 8, 1)]
    if terms[0] in lines:
        pools[0] = np.concatenate(
            [likely_lines(fit, y, terms[0], LANES // 2) for y in best[:, :2].T], 1
        )
    for term in terms:
        if term not in lines:
            pools[0][term] = _weak_terms(start[term])
        pools[1][term] = start[term, :LANES]
    return pools


def _weak_terms(start: np.ndarray) -> np.ndarray:
    """Return (3, LANES) terms to be added: weak ones, twice all over the spectrum.

    start: (3, L) strength, resonance and width of random starts, whose ranges are taken.
    """
    places = LANES // 2
    grid = (np.arange(places) + 0.5) / places
    # Strength and width go round in other steps than the place.
    rows = [np.quantile(start[0], 0.1 + 0.4 * (grid * 7.0 % 1.0)), np.quantile(start[1], grid)]
    if len(start) > 2:
        rows.append(np.quantile(start[2], 0.2 + 0.5 * (grid * 5.0 % 1.0)))
    return np.tile(np.stack(rows), 2)


# Largest number of rounds in which the noise of a robust loss is estimated, and the relative change
# below which it is final.
NOISE_ROUNDS, NOISE_SETTLED = 6, 1e-3
_NO_NOISE = 1e9  # so large that a robust loss equals least squares


def _grown(fit: Problem, start: np.ndarray, noise: float, priors: bool = True) -> Ends:
    """Return the ends of starts (p, S), and of others that are grown from them term by term."""
    if isinstance(fit.u.spec, Spec):
        grown = grown_starts(fit, fit.targets_at(noise, priors), start, noise)
        start = np.concatenate([grown, start], 1)
    return fit.run(start, noise, priors)


def solved(fit: Problem, start: np.ndarray) -> tuple[Ends, float]:
    """Return the ends of all starts and the noise that they were run at."""
    loss, scaled = fit.u.spec.loss, fit.asked.scaled
    by_noise = loss != "squares" or (fit.priors > 0 and scaled)
    if not by_noise:
        return _grown(fit, start, 1.0), 1.0
    # Least squares without priors first, for a first idea of the noise.
    huge = _NO_NOISE if loss != "squares" else 1.0
    ends, noise = _grown(fit, start, huge, priors=False), 1.0
    if loss != "squares" and not scaled and fit.seen.stated:
        return fit.run(start, 1.0), 1.0
    least = 1e-9 * np.sqrt(fit.squares / max(fit.n_data, 1)) + 1e-300
    for i in range(NOISE_ROUNDS):
        best = best_of(ends)
        if best is None:
            return ends, noise
        before = noise
        residual = fit.slopes(ends.y[:, best]).residual
        noise = max(np.sqrt(reduced_chi2(loss, residual, max(fit.dof, 1))), least)
        if i and abs(noise - before) <= NOISE_SETTLED * before:
            break
        # The first round of the true problem is from all starts, later ones from their ends.
        ends = fit.run(start if i == 0 else ends.y, noise)
    return ends, noise


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
            if again or not same:
                ends = with_neighbours(few, ends, some, noise)
            kept.ends[first] = ends, noise
        ends, noise = kept.ends[first]
        if thorough and not again:
            if same:
                ends = joined([ends, solved(few, points)[0]])
                ends = with_neighbours(few, ends, points, noise)
            ends = with_neighbours(few, ends, points, noise, thorough=True)
        if thorough:
            tell(done=0, stage=f"search beside the best{part}")
            ends = with_other_thicknesses(few, ends, points, noise)
            ends = with_far_oscillators(few, ends, noise)
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
