"""Other indices that fit a curve nearly as well as the best: their values, errors, intervals."""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np

from fitting.bare_surface.curve_data import Data, of_rows, put_rows
from fitting.bare_surface.descent import ROW, Solved
from fitting.bare_surface.estimate import Estimated, Weighing, estimate
from fitting.bare_surface.kept_minima import OTHERS, Minima
from fitting.bare_surface.region_intervals import KIND, Intervals, intervals, limit_of_k
from fitting.results.result_parts import NONE
from fitting.searching.minima import alternative_chi2


class Others(NamedTuple):
    """Up to OTHERS more solutions of N curves, lowest first: arrays (N, OTHERS, ...), NaN for none.

    there: which there are. excess: by how much the chi2 is higher. values: name -> values, as in
    `Answer`. known: the intervals.
    """

    there: np.ndarray
    excess: np.ndarray
    values: dict[str, np.ndarray]
    known: Intervals


def _none(count: int) -> Others:
    """Return no other solution, which most curves have."""
    no, nothing = np.zeros((count, OTHERS), bool), np.full((count, OTHERS), np.nan)
    names = ("eta", "k", "sigma_eta", "sigma_k", "limit")
    values = {**dict.fromkeys(names, nothing), "at_zero": no}
    no_range, kind = np.full((count, OTHERS, 2), np.nan), np.full(no.shape, NONE, KIND)
    return Others(no, nothing, values, Intervals(no_range, no_range, kind))


def _distinct(known: Estimated, other: Estimated) -> np.ndarray:
    """Return which other minima are another index, and not the same one from another start."""
    i_nn, i_nu, i_uu = (known.information[:, i, j] for i, j in ((0, 0), (0, 1), (1, 1)))
    with np.errstate(all="ignore"):
        sigma_u = np.sqrt(known.variance * i_nn / (i_nn * i_uu - i_nu**2))  # u = k^2
        apart_eta, apart_u = np.abs(other.eta - known.eta), np.abs(other.k**2 - known.k**2)
        near = np.fmax(np.nan_to_num(known.sigma_eta), 1e-6 * known.eta)
        near_u = np.fmax(np.nan_to_num(2.0 * sigma_u), 2e-3 * known.k**2 + 1e-12)
        return (apart_eta > near) | (apart_u > near_u)


def other_solutions(
    data: Data,
    found: Minima,
    scatter: np.ndarray,
    dof: np.ndarray,
    best: Estimated,
    possible: np.ndarray,
    how: Weighing,
    wanted: str,
) -> Others:
    """Return the other solutions, each as if its minimum were the best one.

    scatter: (N,), in which the chi2 of the others ``found`` is compared with that of the ``best``.
    dof: (N,), from how many degrees of freedom it was estimated, 0 where it was stated or assumed.
    possible: (N,), where they are looked for. how: what errors follow from. wanted: kind of the
    intervals.
    """
    of, nothing = found.curve, _none(len(possible))
    if not len(of):
        return nothing
    excess = (found.others[:, ROW.cost] - found.best[ROW.cost, of]) / scatter[of]
    near = possible[of] & (excess < alternative_chi2(dof[of])) & (found.others[:, ROW.done] > 0)
    rank, place = near.nonzero()
    if not len(rank):
        return nothing
    curve = of[place]
    s = Solved(*found.others[rank, :, place].T)
    e = estimate(data.take(curve), s, how.take(curve))
    new = _distinct(of_rows(best, curve), e)
    number = np.full((OTHERS, len(possible)), -1)
    number[rank, curve] = np.arange(len(rank))
    for before, after in itertools.combinations(number, 2):
        both = (before >= 0) & (after >= 0)
        i, j = before[both], after[both]
        new[j] &= ~new[i] | _distinct(of_rows(e, i), of_rows(e, j))
    curve, rank, place, s, e = of_rows((curve, rank, place, s, e), new)
    no = np.zeros(len(curve), bool)
    known = intervals(
        data.take(curve), s, e, wanted=wanted, blank=no, undetermined=no, nothing=no, matched=no,
        in_product=no,
    )  # fmt: skip
    values = {
        "eta": e.eta, "k": e.k, "sigma_eta": e.sigma_eta, "sigma_k": e.sigma_k,
        "limit": limit_of_k(e, known), "at_zero": e.at_zero,
    }  # fmt: skip
    return put_rows(nothing, Others(~no, excess[rank, place], values, known), (curve, rank))
