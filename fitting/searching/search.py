"""The ends of all starts, some of them grown term by term, and rounds that estimate the noise.

Of three oscillators at random places hardly ever each is next to one of the material's (of 512
starts none, for one material in ten). One alone finds the strongest, the next one what is left.
"""

from __future__ import annotations

import numpy as np

from fitting.optics.spec import Spec
from fitting.problem.lanes import LANES, Ends, best_of, joined
from fitting.problem.problem import Problem
from fitting.problem.programs import Targets
from fitting.problem.unknowns import terms_of
from fitting.searching.minima import lowest_ends
from fitting.searching.oscillators import likely_lines, oscillators
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
