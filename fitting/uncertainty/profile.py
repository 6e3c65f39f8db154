"""Profile likelihood: the ends of the interval of a parameter, the others fitted again.

The profile likelihood interval of a parameter is every value c for which the others can be chosen
so that the fit is nearly as good as the best,

    min over the others of cost(y_j = c)  <=  least cost + rise,

as far as it holds together with the minimum: a second solution has an interval of its own. Each end
is looked for in a lane of the program that the starts ran in, whose two bounds of y_j are both c,
so that nothing more is compiled; bounds, priors and a robust loss are in it by themselves. All
lanes take a step at once: to where the root of (cost - least cost) / rise, which is linear in the
distance for a quadratic cost and its root for a minimum on a bound, should be 1.

D. J. Venzon and S. H. Moolgavkar, Applied Statistics 37, 87 (1988), doi:10.2307/2347496.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from fitting.problem.lanes import Ends

# An end is found if the root is this near to 1, or between two places this near to each other.
CLOSE, TIGHT = 1e-3, 1e-4
# Two places so near to each other, in parts of their distance, should not differ by much more.
STEEP = 0.03
# Number of rounds of steps. 2 to 4 are usual; valleys that are curved, or end in a cliff, take 10
# to 20 (after 10 one end in ten of such fits was still off by .1 to .3 half widths).
ROUNDS = 60
# Evaluations in one round, and the number of further rounds of one place: a round takes as long as
# its slowest lane, and lanes that have not converged continue in the next round.
EVALUATIONS, PATIENCE = 15, 8
# A step outwards goes at most this many times as far as the last one.
FARTHER = 4.0
# Beyond this many times the distance of the first place an end is not searched for.
FARTHEST = 1e9


class Base(NamedTuple):
    """A minimum around which the ends of intervals are searched for.

    which: the curve that it is one of. y: (p,). cost: there. along: (p, p), column j: how the
    others go with y_j near it. low, high: bounds (p,). rise: of the cost. All searches add to two
    lists: inside: places where the cost is within that rise, and the unknown that was held there;
    lower: costs below that of the minimum, and where they are.
    """

    which: int
    y: np.ndarray
    cost: float
    along: np.ndarray
    low: np.ndarray
    high: np.ndarray
    rise: float
    inside: list[tuple[int, np.ndarray]]
    lower: list[tuple[float, np.ndarray]]


class Place(NamedTuple):
    """A place to be visited: its distance, the starts of the others there, and how often so far."""

    far: float
    starts: list[np.ndarray]
    visits: int = 0


class Search:
    """The search for one end: from ``base`` along the unknown ``j``, up (sign 1) or down (-1).

    first: distances of the first places. limit_too: whether the end of the range is visited as
    well. height: the rise of the cost at the end. far, root, y:
    distances visited, by rising distance, roots of the rise there in units of ``height``, and all
    unknowns. found: distance of the end, NaN until it is known.
    """

    def __init__(
        self, base: Base, j: int, sign: float, first: Sequence[float], limit_too: bool = False
    ):
        self.base, self.j, self.sign, self.height = base, j, sign, base.rise
        limit = base.high[j] if sign > 0.0 else base.low[j]
        self.room = abs(limit - base.y[j])
        self.far, self.root, self.y = [0.0], [0.0], [base.y]
        self.found = 0.0 if self.room == 0.0 else np.nan
        self.first = list(dict.fromkeys(min(far, self.room) for far in first))
        places = list(dict.fromkeys([*self.first, self.room])) if limit_too else self.first
        self.under_way = [self._place(far) for far in places] if self.room > 0.0 else []
        self.brackets: list[float] = []
        self.again: list[float] = []

    def aim(self, root: float) -> None:
        """Move the end to where the root of the rise is this part of what it was; see `follow`."""
        self.height *= root * root
        self.root = [r / root for r in self.root]
        self.brackets, self.again, self.under_way = [], [], []
        self.found = 0.0 if self.room == 0.0 else np.nan

    @property
    def end(self) -> float:
        """The end in the solver's coordinate; NaN if none was found."""
        return float(self.base.y[self.j] + self.sign * self.found)

    def root_at(self, far: float) -> float:
        """Return the root at a distance that was visited; NaN if the others have not converged."""
        return self.root[self.far.index(far)] if far in self.far else np.nan

    @property
    def out(self) -> int:
        """Which of the places visited is the first one outside, or their number."""
        return next((i for i, r in enumerate(self.root) if r > 1.0), len(self.root))

    def _place(self, far: float) -> Place:
        """Return a place, with several starts of the other parameters there.

        One start is extrapolated from the neighbours. Another is that of the neighbour inside,
        since an extrapolated one may lie where the model has no meaning, or off the floor of a
        curved valley. A third is the nearest place of another search, since valleys have branches.
        """
        i = bisect_left(self.far, far)
        if i == len(self.far) or self.root[i] == np.inf:
            y = self.y[i - 1] + self.sign * (far - self.far[i - 1]) * self._slope(i - 1)
        else:
            share = (far - self.far[i - 1]) / (self.far[i] - self.far[i - 1])
            y = self.y[i - 1] + share * (self.y[i] - self.y[i - 1])
        starts = [self._held(y, far), self._held(self.y[i - 1], far)]
        others = [at for j, at in self.base.inside if j != self.j]
        if others:
            held = starts[0][self.j]
            starts.append(self._held(min(others, key=lambda at: abs(at[self.j] - held)), far))
        return Place(far, starts)

    def _held(self, y: np.ndarray, far: float) -> np.ndarray:
        """Return y with the unknown at this distance; the lanes keep all within their bounds."""
        out = y.copy()
        out[self.j] = self.base.y[self.j] + self.sign * far
        return out

    def _slope(self, i: int) -> np.ndarray:
        if i == 0:
            return self.base.along[:, self.j]
        return self.sign * (self.y[i] - self.y[i - 1]) / (self.far[i] - self.far[i - 1])

    def visited(self, place: Place, y: np.ndarray, cost: float, rested: bool) -> None:
        """Record the cost at a place.

        rested: whether the others have converged there; if not, they go on from y next time,
        unless the place is inside already.
        """
        if cost < self.base.cost:
            self.base.lower.append((cost, y))
        height = (cost - self.base.cost) / self.height
        root = math.sqrt(max(height, 0.0)) if height < np.inf else np.inf
        if root <= 1.0:
            self.base.inside.append((self.j, y))
        if not rested and 1.0 < root < np.inf and place.visits < PATIENCE:
            self.under_way.append(Place(place.far, [y], place.visits + 1))
            return
        i = bisect_left(self.far, place.far)
        if i == len(self.far) or self.far[i] != place.far:
            self.far.insert(i, place.far)
            self.root.insert(i, root)
            self.y.insert(i, y)
        elif root < self.root[i]:
            self.root[i], self.y[i] = root, y

    def choose(self, most: int) -> None:
        """Set the end, or up to ``most`` places to be visited next."""
        if len(self.far) == 1:  # still on the way to the first place
            return
        out = self.out
        near = min(range(1, len(self.root)), key=lambda i: abs(self.root[i] - 1.0))
        if abs(self.root[near] - 1.0) <= CLOSE and near in (out - 1, out):
            self.found = self.far[near]
            return
        if out == len(self.root):
            if self.far[-1] >= self.room:
                self.found = self.room
                return
            if self.far[-1] > FARTHEST * self.first[0]:
                self.found = np.inf
                return
            some = self._ahead(most)
        else:
            low, high = self.far[out - 1], self.far[out]
            if high - low <= TIGHT * high:
                self.found = low
                return
            if self._cliff(out):
                self.again.append(high)
                start = self._held(self.y[out - 1], high)
                self.under_way.append(Place(high, [start], PATIENCE))
            self.under_way = [p for p in self.under_way if low < p.far <= high]
            some = self._between(out, most)
        known = {p.far for p in self.under_way}
        new = [self._place(far) for far in some if far not in known]
        self.under_way = (self.under_way + new)[:most]

    def _cliff(self, out: int) -> bool:
        """Whether the place outside is to be visited once more, from the one inside.

        Either there is a cliff between them, or the other parameters were in another minimum.
        """
        low, high = self.far[out - 1], self.far[out]
        step = self.root[out] - self.root[out - 1]
        return high - low <= STEEP * high and step > 3.0 * STEEP and high not in self.again

    def _ahead(self, most: int) -> list[float]:
        """Return the next places if all visited so far are inside."""
        far, root = self.far[-1], self.root[-1]
        guess = far / root if root > 0.0 else np.inf
        if len(self.far) > 2:
            bent = _through(self.far[-3:], self.root[-3:])
            guess = bent if far < bent < np.inf else guess
        guess = min(max(guess, 1.02 * far), FARTHER * far)
        some = [far + (guess - far) * part for part in (1.0, 1.5, 0.7, 3.0, 6.0)[:most]]
        return list(dict.fromkeys(min(each, self.room) for each in some))

    def _between(self, out: int, most: int) -> list[float]:
        """Return places between the last one inside and the first one outside."""
        low, high = self.far[out - 1], self.far[out]
        a, b = self.root[out - 1], self.root[out]
        self.brackets.append(high - low)
        slow = len(self.brackets) > 2 and high - low > 0.25 * self.brackets[-3]
        if slow or b == np.inf:
            guess = 0.5 * (low + high)
        else:
            edge = 0.02 * (high - low)
            guess = low + (high - low) * (1.0 - a) / (b - a)
            third = out - 2 if out >= 2 else out + 1
            if third < len(self.far):
                order = sorted((third, out - 1, out))
                bent = _through([self.far[i] for i in order], [self.root[i] for i in order])
                guess = bent if low < bent < high else guess
            guess = min(max(guess, low + edge), high - edge)
        more = most - 1 if most < 4 else 3
        parts = (0.5, 0.2, 0.8)[:more] if more < 3 else (0.25, 0.5, 0.75)
        return [guess, *(low + (high - low) * part for part in parts)]


def _through(far: Sequence[float], root: Sequence[float]) -> float:
    """Return the distance where the root is 1, by a parabola of distance over root."""
    (d0, d1, d2), (r0, r1, r2) = far, root
    if not (r0 < r1 < r2 < np.inf):
        return np.nan
    first, second = (d1 - d0) / (r1 - r0), (d2 - d1) / (r2 - r1)
    bend = (second - first) / (r2 - r0)
    return d0 + (1.0 - r0) * (first + (1.0 - r1) * bend)


class Lanes(NamedTuple):
    """The lanes of one fit or of many: ``run`` takes starts (p, L), the coordinate of each that
    stays (L,), its curve (L,), and how many evaluations. count: how many run side by side."""

    run: Callable[[np.ndarray, np.ndarray, np.ndarray, int], Ends]
    count: int


def visit(at: Lanes, searches: Sequence[Search]) -> None:
    """Visit the next places of every search that has no end yet."""
    todo = [s for s in searches if math.isnan(s.found)]
    lanes = [(s, p, y) for s in todo for p in s.under_way for y in p.starts]
    if not lanes:
        return
    start = np.stack([y for _, _, y in lanes], 1)
    row, which = np.array([(s.j, s.base.which) for s, _, _ in lanes]).T
    y, cost, rested, _ = at.run(start, row, which, EVALUATIONS)
    cost, rested, lane = cost.tolist(), rested.tolist(), 0
    for s in todo:
        places, s.under_way = s.under_way, []
        for p in places:
            own = range(lane, lane + len(p.starts))
            lane += len(p.starts)
            best = min(own, key=cost.__getitem__)
            s.visited(p, y[:, best], cost[best], rested[best])


def follow(at: Lanes, searches: Sequence[Search], rounds: int, enough: float) -> None:
    """Continue until every search has its end, or for the given number of rounds.

    An end that was not found by then is the nearest place that is known to lie outside; if none is
    known, or the cost never rises enough, it is the end of the range of the parameter. A cost below
    ``enough`` ends all searches at once, since a lower minimum has other intervals.
    """
    for _ in range(rounds):
        todo = [s for s in searches if math.isnan(s.found)]
        if not todo or any(cost < enough for s in searches for cost, _ in s.base.lower):
            return
        for s in todo:
            # As many places as there are lanes, since an idle lane takes the same time.
            s.choose(max(1, min(4, at.count // (3 * len(todo)))))
        visit(at, todo)
    for s in searches:
        s.choose(1)
        if math.isnan(s.found):
            s.found = (*s.far, s.room)[s.out]
