"""Other indices that fit a curve nearly as well as the best: their values, errors, intervals."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import numpy as np

from fitting.bare_surface.curve_data import Data, of_rows, put_rows
from fitting.bare_surface.descent import ROW, Solved
from fitting.bare_surface.estimate import Estimated, estimate
from fitting.bare_surface.kept_minima import Minima
from fitting.bare_surface.region_intervals import (
    Intervals,
    intervals,
    limit_of_k,
)
from fitting.results.result_parts import NONE, QUADRATIC
from fitting.searching.minima import alternative_chi2


class Other(NamedTuple):
    """One more solution of N curves, NaN in those that have none.

    there: (N,), which have one. excess: (N,), by how much its chi2 is higher. values: name -> (N,),
    as in `Answer`. known: its intervals.
    """

    there: np.ndarray
    excess: np.ndarray
    values: dict[str, np.ndarray]
    known: Intervals


def _nothing(like: Any, count: int) -> Any:
    """Return as many empty rows: NaN, False, or the interval kind "none"."""

    def empty(a: np.ndarray) -> np.ndarray:
        kind = {"b": False, "U": NONE}.get(a.dtype.kind, np.nan)
        return np.full((count, *a.shape[1:]), kind, a.dtype)

    return jax.tree.map(empty, like)


def _none(count: int) -> Other:
    """Return no other solution, which most curves have."""
    nothing, no_range = np.full(count, np.nan), np.full((count, 2), np.nan)
    names = ("eta", "k", "sigma_eta", "sigma_k", "limit")
    values = {**dict.fromkeys(names, nothing), "at_zero": np.zeros(count, bool)}
    kind = np.full(count, NONE, f"<U{len(QUADRATIC)}")
    return Other(np.zeros(count, bool), nothing, values, Intervals(no_range, no_range, kind))


def _distinct(known: Estimated, other: Estimated) -> np.ndarray:
    """Return which other minima are another index, and not the same one from another start."""
    i_nn, i_nu, i_uu = (known.information[:, i, j] for i, j in ((0, 0), (0, 1), (1, 1)))
    with np.errstate(all="ignore"):
        sigma_u = np.sqrt(known.variance * i_nn / (i_nn * i_uu - i_nu**2))  # u = k^2
        apart_eta, apart_u = np.abs(other.eta - known.eta), np.abs(other.k**2 - known.k**2)
        near = np.fmax(np.nan_to_num(known.sigma_eta), 1e-6 * known.eta)
        near_u = np.fmax(np.nan_to_num(2.0 * sigma_u), 2e-3 * known.k**2 + 1e-12)
        return (apart_eta > near) | (apart_u > near_u) | np.isnan(known.eta)


def _other(data: Data, s: Solved, e: Estimated, excess: np.ndarray, wanted: str) -> Other:
    """Return a solution of all curves of ``data``."""
    no = np.zeros(len(excess), bool)
    known = intervals(
        data, s, e, wanted=wanted, blank=no, undetermined=no, nothing=no, matched=no
    )  # fmt: skip
    values = {
        "eta": e.eta, "k": e.k, "sigma_eta": e.sigma_eta, "sigma_k": e.sigma_k,
        "limit": limit_of_k(e, known), "at_zero": e.at_zero,
    }  # fmt: skip
    return Other(~no, excess, values, known)


def other_solutions(
    data: Data,
    found: Minima,
    scatter: np.ndarray,
    dof: np.ndarray,
    best: Estimated,
    possible: np.ndarray,
    how: dict[str, Any],
    wanted: str,
) -> tuple[Other, ...]:
    """Return the other solutions, lowest first, each as if its minimum were the best one.

    scatter: (N,), in which the chi2 of the others ``found`` is compared with that of the ``best``.
    dof: (N,), from how many degrees of freedom it was estimated, 0 where it was stated or assumed.
    possible: (N,), where they are looked for. how: options of `estimate`. wanted: kind of the
    intervals.
    """
    none = _none(len(possible))
    of = found.curve
    excess = (found.others[:, ROW.cost] - found.best[ROW.cost, of]) / scatter[of]
    near = possible[of] & (excess < alternative_chi2(dof[of])) & (found.others[:, ROW.done] > 0)
    others, earlier = [], [best]
    for s, more, here in zip(found.others, excess, near, strict=True):
        mine = here.nonzero()[0]
        if not len(mine):
            others.append(none)
            continue
        rows, solved, more = of[mine], Solved(*s[:, mine]), more[mine]
        e = estimate(data.take(rows), solved, **{**how, "sin_max": how["sin_max"][rows]})
        new = np.logical_and.reduce([_distinct(of_rows(one, rows), e) for one in earlier])
        rows, e, solved = rows[new], of_rows(e, new), of_rows(solved, new)
        earlier.append(put_rows(_nothing(e, len(possible)), e, rows))
        one = _other(data.take(rows), solved, e, more[new], wanted)
        others.append(put_rows(none, one, rows))
    return tuple(others)
