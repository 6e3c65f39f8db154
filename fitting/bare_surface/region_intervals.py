"""95 % intervals of eta and k: quadratic where that is accurate, else by profile likelihood.

The quadratic ones are eta +- t sigma_eta, and k from k^2 +- t sigma_u (u = k^2, in which the curve
is nearly linear; in total reflection it is in k), cut at 0. They were compared with
the profile likelihood over 1500 random truths of each class (dielectric, weak absorber,
semiconductor, metal), six sets of angles and channels, noise .01, .1 and .5 %. Distance of an end
from the true one, in half widths of the interval, not exceeded in 95 % of the cases:

    sigma_eta / eta           below .01   .01-.02   .02-.05   .05-.1   .1-.2
    eta, k seen                 .02         .04       .11       .26      .65
    k, seen                     .05         .13       .38 (1.1 for some metals)   1.1 and more
    eta, k compatible with 0   .45-1.4     .57-1.7    .6-1.9    .7-2.2   .9-2.4

Hence the rule of "auto": by profile where k is not seen (k^2 less than three of its standard
errors) or where sigma_eta is more than .02 eta. And in total reflection, where the curve has a kink
that moves with eta: if all angles lie beyond it, ends were off by up to half of their width.

All this was from air. The valley is part of a circle of constant R(0) (`valley`), which is small
where the index is near that of the medium in front: there a sigma_eta of .011 eta was a third of
the radius, and k = .067 was shown as seen by 40 standard errors where k = 0 fits as well. So also
by profile where the errors of eta and k are more than .03 of the radius together. (In total
reflection by an index of k > n `spread` is that of k, if larger.)
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fitting.bare_surface.bounded_k import beside_zero
from fitting.bare_surface.coordinates import w_of_small_k
from fitting.bare_surface.curve_data import Data
from fitting.bare_surface.descent import Solved
from fitting.bare_surface.estimate import Estimated, of_radius
from fitting.bare_surface.region import Region, around_nothing, profile
from fitting.bare_surface.total_reflection import along_the_valley
from fitting.results.result_parts import NONE, PROFILE, QUADRATIC
from fitting.uncertainty.limits import ROUNDING

CURVED_SPREAD = 0.02
# The same of both errors, as a part of the radius of the circle of constant R(0).
CURVED_TURN = 0.03
# A range whose value lies outside by more of its width than that is one of another region.
NEAR_WIDTH = 0.05
KIND = f"<U{len(QUADRATIC)}"


class Intervals(NamedTuple):
    """95 % intervals of N curves: eta, k (N, 2), NaN where unknown; kind (N,) str."""

    eta: np.ndarray
    k: np.ndarray
    kind: np.ndarray


def limit_of_k(e: Estimated, known: Intervals) -> np.ndarray:
    """Return the upper limit of k (N,), NaN where k is seen: the upper end of its interval."""
    limit, by_profile = e.k_upper_limit.copy(), (known.kind == PROFILE).nonzero()[0]
    rows = by_profile[np.isfinite(limit[by_profile])]
    limit[rows] = known.k[rows, 1]
    return limit


def _inside(ends: np.ndarray, value: np.ndarray) -> np.ndarray:
    """Return whether values (N,) lie in or near their ranges (N, 2); not where these are NaN."""
    low, high = ends.T
    near = NEAR_WIDTH * (high - low)
    return (low - near <= value) & (value <= high + near)


def _walk(
    data: Data,
    s: Solved,
    e: Estimated,
    rise: np.ndarray,
    todo: np.ndarray,
    in_product: np.ndarray,
    found: Region,
) -> np.ndarray:
    """Put right what was ``found`` of the curves ``todo`` in total reflection; return where.

    There the region breaks off at critical angles, and another piece of it may have been followed:
    the valley is walked from the value.
    """
    walked = np.zeros(len(todo), bool)
    met = _inside(found.eta, e.eta[todo]) & _inside(found.k, e.k[todo])
    here = np.flatnonzero(in_product[todo] | ~met & (e.eta[todo] < data.eta_i))
    if not len(here):
        return walked
    curve = todo[here]
    found.eta[here], found.k[here] = along_the_valley(
        data.take(curve), e.eta[curve], e.k[curve], (s.cost + rise)[curve]
    )
    # and what is known of k at the best eta
    found.k[here, 0] = np.fmin(found.k[here, 0], e.k_interval[curve, 0])
    found.k[here, 1] = np.fmax(found.k[here, 1], e.k_interval[curve, 1])
    walked[here] = True
    return walked


def intervals(
    data: Data,
    s: Solved,
    e: Estimated,
    *,
    wanted: str,
    blank: np.ndarray,
    undetermined: np.ndarray,
    nothing: np.ndarray,
    matched: np.ndarray,
    in_product: np.ndarray,
) -> Intervals:
    """Return the 95 % intervals at the minima ``s``.

    wanted: one of `uncertainty.intervals.KINDS`. blank: no quadratic interval.
    undetermined: by profile only. nothing: no interval at all. matched: no boundary (x = 0).
    in_product: only the product of eta and k is determined (`total_reflection`).
    Accuracy: the ends of a profile interval to 1e-3 of its width. Coverage by simulation:
    docs/fitting.md; beside k = 0 ends by profile are those of `bounded_k`.
    """
    with np.errstate(all="ignore"):
        half = e.t * e.sigma_eta
        eta, k = np.empty((len(half), 2)), e.k_interval.copy()
        eta[:, 0], eta[:, 1] = np.maximum(e.eta - half, 0.0), e.eta + half
        none = blank | nothing
        eta[none], k[none] = np.nan, np.nan
        ends = eta[:, 0] + eta[:, 1] + k[:, 0] + k[:, 1]
        kind = np.full(len(half), NONE, KIND)
        kind[np.isfinite(ends)] = QUADRATIC
        if wanted == QUADRATIC:
            return Intervals(eta, k, kind)
        rise = e.t**2 * e.variance
        able = (
            ~nothing
            & np.isfinite(rise)
            & ((s.done > 0) | undetermined | matched)
            & np.isfinite(s.cost)
        )
        able &= rise > ROUNDING * s.scale
        unseen = ~np.isfinite(e.sigma_k)  # `estimate` gives none below estimate.SEEN_SIGMAS
        curved = unseen | undetermined | matched | (e.spread > CURVED_SPREAD) | e.linear
        curved |= of_radius(s, e, data.eta_i) > CURVED_TURN
    todo = np.flatnonzero(able if wanted == PROFILE else able & curved)
    if len(todo):
        part = Solved(*np.array(s)[:, todo])
        with np.errstate(all="ignore"):
            first = w_of_small_k(part.x, e.k_interval[todo, 1] / data.eta_i)
        first = np.where(e.linear[todo], first, np.nan)
        found = profile(data.take(todo), part, rise[todo], first)
        corner = np.flatnonzero(matched[todo])
        if len(corner):
            there = todo[corner]
            ends = around_nothing(data.take(there), Solved(*np.array(s)[:, there]), rise[there])
            found.eta[corner], found.k[corner] = ends
        walked = _walk(data, s, e, rise, todo, in_product, found)
        good = np.isfinite(found.eta).all(1) & np.isfinite(found.k).all(1)
        rows = np.flatnonzero(good & ~walked & ~(undetermined | matched)[todo])
        if len(rows):
            at = todo[rows]
            ends = beside_zero(
                data.take(at), Solved(*np.array(s)[:, at]), Estimated(*(of[at] for of in e)),
                rise[at], first[rows], Region(found.eta[rows], found.k[rows]),
            )  # fmt: skip
            found.eta[rows], found.k[rows] = ends
        done = todo[good]
        eta[done], k[done], kind[done] = found.eta[good], found.k[good], PROFILE
        # Along a valley without end the ends are known to a part of its length: a value is never
        # outside of its own range.
        for range_of, value in ((eta, e.eta), (k, e.k)):
            range_of[done, 0] = np.minimum(range_of[done, 0], value[done])
            range_of[done, 1] = np.maximum(range_of[done, 1], value[done])
    return Intervals(eta, k, kind)
