"""The search of many curves at once: from starts, and from the minima of their neighbours.

A minimum changes little from one wavelength or pixel to the next, and a narrow one that few starts
find in one curve is wide in another.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fitting.problem.curve_lanes import Curves, slopes
from fitting.problem.lanes import MOST, Ends, Limits, joined, run_lanes, with_fixed
from fitting.problem.problem import Problem
from fitting.process.progress import tell
from fitting.residuals.error_model import beyond_chance
from fitting.searching.search import NO_NOISE, NOISE_ROUNDS, NOISE_SETTLED
from fitting.searching.starts import starts
from fitting.uncertainty.likelihood import noise_of

# Rounds in which curves are tried from their neighbours; a round reaches one of them further.
_ROUNDS = 60
# A lane that has not come to rest has to be that much lower to be shown.
_ON_THE_WAY = 1.5
# Without stated errors: a curve is badly described if its scatter is so many times the median.
_FAR = 4.0


class BatchSearch:
    """N fits of one kind and where their lanes ended.

    job: one of them as a pattern for all. best: the lowest end of each, N lanes. lanes: the curves
    (L,) of all lanes and their ends. by_noise: the noise of each curve is to be found (`settle`).
    """

    def __init__(
        self, job: Problem, curves: Curves, limits: Limits | None = None, by_noise: bool = False
    ):
        self.job, self.curves, self.limits = job, curves, limits or job.limits
        if by_noise:  # least squares without priors first, for a first idea of the noise
            self.curves = curves.weighed(np.full(curves.count, NO_NOISE), 0.0 * curves.base.prior)
        n_data, unknowns = curves.n_data, int(job.u.free.sum())
        self.known = n_data > 0
        self.dof = np.maximum(n_data + job.priors - unknowns, 0)
        self.best = Ends.begun(np.zeros((job.u.size, curves.count)))
        self._lanes: list[tuple[np.ndarray, np.ndarray, Ends]] = []

    @property
    def lanes(self) -> tuple[np.ndarray, Ends]:
        """The curve (L,) and the end of every lane that was run."""
        which, _, ends = zip(*self._lanes, strict=True)
        return np.concatenate(which), joined(ends)

    def run(self, start: np.ndarray, which: np.ndarray) -> None:
        """Follow starts (p, L) of the curves ``which``, (L,), and keep where they end."""
        self._keep(which, start, self._followed(start, which, self.limits, MOST))

    def run_random(self, count: int, seed: int, which: np.ndarray) -> None:
        """Follow so many random starts of each of the curves ``which``."""
        points = starts(self.job.u.moving, count, seed)
        self.run(np.tile(points, len(which)), np.repeat(which, count))

    def run_again(self, curves: Curves, of: np.ndarray, from_starts: bool = False) -> None:
        """Follow the lanes of the curves ``of`` from their ends, with other errors or noise.

        from_starts: or all lanes from their starts.
        """
        (which, ends), start = self.lanes, np.concatenate([s for _, s, _ in self._lanes], 1)
        again = np.isin(which, of) | from_starts
        self.curves, self._lanes = curves, []
        self.best = Ends.begun(np.zeros_like(self.best.y))
        self._keep(which[~again], start[:, ~again], Ends(*(a[..., ~again] for a in ends)))
        if not from_starts:
            start, again = ends.y, again & ends.done
        self.run(start[:, again], which[again])

    def settle(self) -> None:
        """Find the noise of each curve where it is asked for, as `search.solved` does."""
        live, job = np.flatnonzero(self.best.done), self.job
        if not (np.ndim(self.curves.noise) and len(live)):
            return
        noise = np.where(self.best.done, self.curves.noise, 1.0)
        for _ in range(NOISE_ROUNDS):
            curves, before = self.curves, self.curves.noise[live]
            off = slopes(job.u.spec, curves, self.best.y[:, live], live).triangle[..., -1]
            off, squares = off * before[:, None], curves.squares[live] * before**2
            new = noise_of(job.u.spec.loss, off, self.dof[live], squares, curves.n_data[live])
            moved = np.abs(new - before) > NOISE_SETTLED * before
            if not moved.any():
                break
            live = live[moved]
            noise[live] = new[moved]
            again = curves.weighed(noise.copy(), job.targets.prior_weight)
            self.run_again(again, live, from_starts=before[0] == NO_NOISE)

    def _keep(self, which: np.ndarray, start: np.ndarray, ends: Ends) -> None:
        self._lanes.append((which, start, ends))
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
            np.maximum(self.dof[which], 1.0) * self.job.sharper, self.curves.squares[which], most,
            self.curves.width, which,
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
        self.settle()
        news = np.isfinite(self.best.cost)
        for _ in range(_ROUNDS):
            # A neighbour that has not changed was tried before.
            side, which = np.nonzero(
                np.append(news, False)[beside] & self.known & (self.missed() | also)
            )
            if not len(which):
                break
            before = self.best.cost.copy()
            self.run(self.best.y[:, beside[side, which]], which)
            news, also = self.best.cost < (1.0 - 1e-3) * before, False
            tell(done=0)
        self.settle()
