"""The search of many curves at once: from starts, and from the minima of their neighbours.

A minimum changes little from one wavelength or pixel to the next, and a narrow one that few starts
find in one curve is wide in another.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from fitting.problem.curve_lanes import Curves
from fitting.problem.lanes import MOST, Ends, Limits, joined, run_lanes, with_fixed
from fitting.problem.problem import Problem
from fitting.process.progress import tell
from fitting.residuals.error_model import beyond_chance

# Rounds in which curves are tried from their neighbours; a round reaches one of them further.
_ROUNDS = 60
# A lane that has not come to rest has to be that much lower to be shown.
_ON_THE_WAY = 1.5
# Without stated errors: a curve is badly described if its scatter is so many times the median.
_FAR = 4.0


class BatchSearch:
    """N fits of one kind and where their lanes ended.

    job: one of them as a pattern for all. best: the lowest end of each, N lanes. which, ends: the
    curves and the ends of all lanes.
    """

    def __init__(self, job: Problem, curves: Curves, limits: Limits | None = None):
        self.job, self.curves, self.limits = job, curves, limits or job.limits
        n_data, unknowns = curves.n_data, int(job.u.free.sum())
        self.known = n_data > 0
        self.dof = np.maximum(n_data + job.priors - unknowns, 0)
        self.best = Ends.begun(np.zeros((job.u.size, curves.count)))
        self._lanes: list[tuple[np.ndarray, Ends]] = []

    @property
    def starts(self) -> np.ndarray:
        """How many starts each curve had, (N,)."""
        return np.bincount(self.lanes[0], minlength=self.curves.count)

    @property
    def lanes(self) -> tuple[np.ndarray, Ends]:
        """The curve (L,) and the end of every lane that was run."""
        which, ends = zip(*self._lanes, strict=True)
        return np.concatenate(which), joined(ends)

    def run(self, start: np.ndarray, which: np.ndarray) -> None:
        """Follow starts (p, L) of the curves ``which``, (L,), and keep where they end."""
        self._keep(which, self._followed(start, which, self.limits, MOST))

    def with_errors(self, sigma: Mapping[str, np.ndarray], of: np.ndarray) -> BatchSearch:
        """Return the search with other errors, those of the curves ``of``, followed again."""
        there = BatchSearch(self.job, replace(self.curves, sigma=sigma), self.limits)
        which, ends = self.lanes
        again = np.isin(which, of)
        there._keep(which[~again], Ends(*(a[..., ~again] for a in ends)))
        again &= ends.done
        there.run(ends.y[:, again], which[again])
        return there

    def _keep(self, which: np.ndarray, ends: Ends) -> None:
        self._lanes.append((which, ends))
        best = self.best
        np.add.at(best.evaluations, which, ends.evaluations)
        # The lowest lane of each curve comes first.
        cost = ends.cost * np.where(ends.done, 1.0, _ON_THE_WAY)
        order = np.lexsort((cost, which))
        some, first = np.unique(which[order], return_index=True)
        lane = order[first]
        before = best.cost[some] * np.where(best.done[some], 1.0, _ON_THE_WAY)
        better = cost[lane] < (1.0 - 1e-6) * before
        for mine, other in zip(best[:3], ends[:3], strict=True):
            mine[..., some[better]] = other[..., lane[better]]

    def pinned(self, start: np.ndarray, row: np.ndarray, which: np.ndarray, steps: int) -> Ends:
        """Return where starts (p, L) of curves (L,) are after so many evaluations.

        Of each of them one coordinate stays, ``row`` (L,).
        """
        return self._followed(start, which, with_fixed(self.limits, start, row), steps)

    def _followed(self, start: np.ndarray, which: np.ndarray, limits: Limits, most: int) -> Ends:
        """Return where starts (p, L) of curves (L,) are after ``most`` evaluations at most."""
        return run_lanes(
            self.job.u.spec, lambda lanes: self.curves.targets(which[lanes]), start, limits,
            np.maximum(self.dof[which], 1.0), self.curves.squares[which], most, self.curves.width,
            which,
        )  # fmt: skip

    def missed(self) -> np.ndarray:
        """Return which curves are not described, (N,).

        Without a degree of freedom: of which the misfit is more than rounding.
        """
        best, stated = self.best, self.curves.stated
        reduced = best.cost / np.maximum(self.dof, 1)
        usual = np.median(reduced[best.done]) if best.done.any() else 0.0
        far = np.where(stated, beyond_chance(reduced, self.dof)[0], reduced > _FAR * usual)
        return ~best.done | np.where(self.dof > 0, far, best.cost > np.where(stated, 1.0, 1e-6))

    def from_neighbours(self, beside: np.ndarray, also: Any = False) -> None:
        """Try the curves that are not described from the minima beside them, while it helps.

        beside: (K, N) numbers of their neighbours, -1 for none. also: (N,) other curves to try.
        """
        news = np.isfinite(self.best.cost)
        for _ in range(_ROUNDS):
            # A neighbour that has not changed was tried before.
            side, which = np.nonzero(
                np.append(news, False)[beside] & self.known & (self.missed() | also)
            )
            if not len(which):
                return
            before = self.best.cost.copy()
            self.run(self.best.y[:, beside[side, which]], which)
            news, also = self.best.cost < (1.0 - 1e-3) * before, False
            tell(done=0)
