"""One fit: its starts, rounds in which the noise is estimated, and the last steps."""

from __future__ import annotations

import numpy as np

from fitting.optics.spec import Spec
from fitting.problem.lanes import Ends, best_of
from fitting.problem.problem import Problem
from fitting.searching.grown_starts import grown_starts
from fitting.uncertainty.likelihood import reduced_chi2

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
