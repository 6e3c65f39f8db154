"""The stages of a search in turn, and what one search leaves for others of the same data.

The first stages find the best minimum of nearly all data: all starts, and further ones beside the
lowest ends as long as these help. `fit` goes on where they may have missed it: where the model does
not describe the data, and at other thicknesses of films. `choose` compares its candidates after the
first stages, and goes on with those that may be taken. A fit that is repeated with other weights
begins from its minima, and goes on at other thicknesses only.
"""

from __future__ import annotations

from collections.abc import Hashable

import jax
import numpy as np

from fitting.problem.lanes import LANES, Ends, joined
from fitting.problem.problem import Kept, Problem
from fitting.problem.unknowns import terms_of
from fitting.process.progress import tell
from fitting.searching.fewer_rows import FOLLOWED, followed_with_all
from fitting.searching.fringe_orders import with_all_orders
from fitting.searching.minima import lowest_ends
from fitting.searching.neighbours import with_neighbours
from fitting.searching.oscillators import with_far_oscillators
from fitting.searching.other_thicknesses import with_other_thicknesses
from fitting.searching.search import solved
from fitting.searching.starts import start_at

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
    job.lanes = few.lanes = min(some.shape[1], LANES)
    if few is not job:
        job.lanes = FOLLOWED
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
