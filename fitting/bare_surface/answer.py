"""eta and k of one bare surface from reflectance over angle, of one curve or of many.

    R_j(theta_i; eta, k)  ->  minimise  sum_ij [(R_j(theta_i) - value_ij) / sigma_ij]^2

over eta > 0 and k >= 0, where R_j is R_s, R_p or R = R_p + share (R_s - R_p), from
`fresnel_jax.powers` with its closed derivatives. Every fit starts from a mesh (`starts`), runs in
coordinates in which the problem is nearly linear (`coordinates`) through optimistix with a solver
for batches (`solver`), and a second basin, where the mesh shows one, is followed to its end.

Fits run in float64, whether or not the caller has switched on jax_enable_x64.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from fitting.bare_surface.arrange import Arranged
from fitting.bare_surface.batch import minima
from fitting.bare_surface.coordinates import W_MIN, coordinates_of
from fitting.bare_surface.curve_data import Data, Extent, extent_of, of_rows
from fitting.bare_surface.curves import noise_of_misfits
from fitting.bare_surface.descent import Solved
from fitting.bare_surface.estimate import Estimated, Weighing, estimate, of_radius
from fitting.bare_surface.mirror import like_mirrors, strong_reflectors
from fitting.bare_surface.other_solutions import Others, other_solutions
from fitting.bare_surface.region_intervals import Intervals, intervals, limit_of_k
from fitting.bare_surface.total_reflection import open_to_small_index
from fitting.bare_surface.valley import Lanes, evaluate, open_to_the_other_end
from fitting.residuals.error_model import beyond_chance, misses_without_freedom
from fitting.results.result_parts import CONVERGED, NO_DATA, NOT_CONVERGED, QUADRATIC, UNDETERMINED
from fitting.searching.minima import ASSUMED_SIGMA

# The limits beyond which an index is called undetermined.
CORRELATION_LIMIT = 0.995
VAGUE_LIMIT = 0.1
# Two standard errors reach 0: the value is known to an order of magnitude at best, and the
# quadratic approximation behind the standard error no longer holds.
UNDETERMINED_LIMIT = 0.5
# Errors of eta and k of more than this part of the radius of their circle are not to be believed.
TURN_LIMIT = 0.1
# Change of x = log[(1 + |N|^2) / 2n] along the null direction of the Fisher matrix, over all k.
CIRCLE_LIMIT = 0.1
FLAT_BELOW_DEG = 30.0
# R(0) within 2 exp(-x) = 2.5e-4 of 1: no plain metal reflects so well, or shows it if it does.
MIRROR_LIMIT = 9.0
# exp(x) - 1 = |N - 1|^2 / 2n: R(0) below 5e-17, less than the rounding of any datum.
NOTHING_LIMIT = 1e-16
STATUS = np.array([CONVERGED, UNDETERMINED, NOT_CONVERGED, NO_DATA])
# Two indices fit equally well if their chi2 differs by less than this: two standard errors.
ALIKE_CHI2 = 4.0
# The data do not distinguish them at all if it differs by less than this.
ALIKE_MEMBERS = 0.01
# In a batch the residuals of a curve are looked at only if the squares of the sums of four side by
# side are together so many times the sum of the squares. That is 1 for noise (above 1.7 in .4 % of
# fits of 50 to 100 data) and 2.5 for a smooth misfit as large as the noise.
LEAST_ALIKE = 1.7


def _missed(a: Arranged, s: Solved) -> np.ndarray:
    """Return which fits miss their data by more than their noise."""
    found = np.zeros(len(s.x), bool)
    steps = np.diff(a.angle_deg)
    sorted_ = (steps >= 0.0).all(-1) | (steps <= 0.0).all(-1)
    some = (~sorted_ | (s.together > LEAST_ALIKE * s.cost)).nonzero()[0]
    if len(some):
        angle = a.angle_deg[some] if a.angle_deg.ndim == 2 else a.angle_deg
        noise = noise_of_misfits(a.data.take(some), angle, of_rows(s, some))
        found[some] = np.isfinite(noise)
    return found


def _of_many_the_lossless(
    data: Data, s: Solved, e: Estimated, undetermined: np.ndarray, scatter: np.ndarray
) -> Estimated:
    """Return the index that is shown of many that fit: one with k = 0 and n > eta_i, if it fits.

    Otherwise it is the best fit. On a circle of indices that fit equally well only rounding selects
    the best one, and neighbours in a spectrum would jump from one end of it to the other.
    """
    rows = undetermined.nonzero()[0]
    if not len(rows):
        return e
    x = s.x[rows]
    ends = Lanes(np.arange(len(rows)), x, np.full_like(x, W_MIN), np.ones_like(x))
    part = data.take(rows)
    there = evaluate(part, ends)
    alike = there.cost <= s.cost[rows] + ALIKE_MEMBERS * scatter[rows]
    known = estimate(part, there, Weighing(True, True, np.zeros(len(rows))))
    eta, k, information = e.eta.copy(), e.k.copy(), e.information.copy()
    eta[rows[alike]] = known.eta[alike]
    k[rows[alike]] = 0.0
    information[rows[alike]] = known.information[alike]
    return e._replace(eta=eta, k=k, information=information)


def _codes(
    a: Arranged,
    e: Estimated,
    s: Solved,
    undetermined: np.ndarray,
    mirror: np.ndarray,
    on_circle: np.ndarray,
    dof: np.ndarray,
    extent: Extent,
) -> dict[str, np.ndarray]:
    """Return which curves each warning concerns, except for the warnings that `answer` adds."""
    low, high, channels = extent.low_deg, extent.high_deg, extent.channels
    names = a.data.channels
    at_45 = (low > 44.9) & (high < 45.1) & (channels == 2) & ("R" not in names)
    circle = ~at_45 & (~(e.moved > CIRCLE_LIMIT) | (s.count == 1) | on_circle)
    chi2_large = chi2_small = np.zeros(len(dof), bool)
    if a.stated:
        chi2_large, chi2_small = beyond_chance(s.cost / dof, dof)
    correlated = np.abs(e.covariance) > CORRELATION_LIMIT * e.sigma_eta * e.sigma_k
    nothing = s.x < NOTHING_LIMIT
    clear = ~undetermined & ~nothing
    return {
        "perfect_mirror": mirror,
        "no_reflection": nothing & (s.count > 0),
        "same_at_45_degrees": undetermined & at_45 & ~mirror,
        "circle": undetermined & circle & ~mirror,
        "combination": undetermined & ~at_45 & ~circle & ~mirror,
        "does_not_describe": _missed(a, s),
        "compatible_with_zero": clear & np.isfinite(e.k_upper_limit),
        "poorly_determined": clear & (e.sigma_eta > VAGUE_LIMIT * e.eta),
        "correlated": clear & correlated,
        "chi2_large": chi2_large,
        "chi2_small": chi2_small,
        "flat_curve": clear & (channels == 1) & (high < FLAT_BELOW_DEG),
        "no_degrees_of_freedom": clear & (s.count == 2),
    }


class Answer(NamedTuple):
    """The results for N curves, each array (N, ...), and which curves each warning concerns.

    others: other indices that fit nearly as well, the best of them first.
    """

    solved: Solved
    values: dict[str, np.ndarray]
    known: Intervals
    codes: dict[str, np.ndarray]
    status: np.ndarray
    others: Others
    dof: np.ndarray


# Among many curves some make an operation invalid; its NaN stays within that curve.
@np.errstate(all="ignore")
def answer(a: Arranged, absolute: bool, start: np.ndarray | None, wanted: str) -> Answer:
    """Return the results for all curves. start: (3, N), an additional start of each; or None."""
    extent = extent_of(a.data, a.angle_deg)
    found, data = minima(a.data, extent, start)
    s = Solved(*found.best)
    sin_max = np.sin(np.radians(np.fmax(extent.high_deg, 0.0)))
    how = Weighing(a.stated, absolute, np.full(s.cost.shape, sin_max))
    e = estimate(data, s, how)
    dof = np.maximum(s.count - 2, 0)

    no_data = s.count == 0
    # A fit that moves along an endless valley is undetermined, whether or not it was stopped.
    matched = ~no_data & (s.x < NOTHING_LIMIT)  # no boundary to speak of
    bounded = ~(no_data | matched)
    undetermined = bounded & (e.singular | (e.spread > UNDETERMINED_LIMIT)) & np.isfinite(s.cost)
    # The unit of a difference of chi2: the scatter of the data, or their stated errors if larger.
    stated = 1.0 if a.stated else np.where(dof < 3, ASSUMED_SIGMA**2, 0.0)
    scatter = np.fmax(np.where(dof > 0, s.cost / dof, 0.0), stated)
    inner = (bounded & ~undetermined & (e.eta < data.eta_i)).nonzero()[0]
    if len(inner):
        allowed = (s.cost + ALIKE_CHI2 * scatter)[inner]
        part = Solved(*found.best[:, inner])
        undetermined[inner] = open_to_the_other_end(data.take(inner), part, allowed)
    in_product = np.zeros_like(undetermined)
    strong = strong_reflectors(data, s)
    far = strong[(bounded & ~undetermined & e.linear & (s.done > 0))[strong]]
    if len(far):
        allowed = (s.cost + ALIKE_CHI2 * scatter)[far]
        in_product[far] = open_to_small_index(data.take(far), e.eta[far], e.k[far], allowed)
        undetermined |= in_product
    bound, perfect = like_mirrors(data, s, strong, dof, np.greater(stated, 0.0), scatter)
    undetermined |= bounded & np.isfinite(bound)
    # Where R = 1 does not fit, a best fit that is such a reflector itself (and not a critical angle
    # next to one low datum, of a small R(0)) names its circle.
    on_circle = ~perfect & (1.0 - np.tanh(0.5 * s.x) <= 2.0 * (1.0 - bound))
    bound[~bounded | on_circle] = np.nan
    mirror = np.isfinite(bound) | (undetermined & (s.x > MIRROR_LIMIT))
    undetermined |= mirror
    e = _of_many_the_lossless(data, s, e, undetermined & ~mirror, scatter)
    missed = misses_without_freedom(s.cost, s.plain, s.count, dof, a.stated) & ~undetermined
    failed = missed | (bounded & ~undetermined & ~(s.done > 0))
    matched &= ~missed
    blank = ~bounded | failed | undetermined  # no error is known
    lost = failed | no_data
    estimated = np.where(np.greater(scatter, stated) & (not a.stated), dof, 0)
    others = other_solutions(data, found, scatter, estimated, e, ~blank, how, wanted)
    codes = _codes(a, e, s, undetermined, mirror, on_circle, dof, extent)
    if lost.any():
        codes = {code: at & ~lost for code, at in codes.items()}
    codes = {
        "not_converged": failed & ~missed,
        "misses_without_freedom": missed,
        **codes,
        "other_minima": others.there.any(1),
    }
    nothing = no_data | mirror  # no value either
    known = intervals(
        data, s, e, wanted=wanted, blank=blank, undetermined=undetermined,
        nothing=nothing | failed, matched=matched, in_product=in_product,
    )  # fmt: skip
    bent = (known.kind == QUADRATIC) & (of_radius(s, e, data.eta_i) > TURN_LIMIT)
    codes["quadratic_misleads"] = bent & ~(undetermined | matched | lost)
    # NaN where there is no value, no error, no minimum; else 1.
    for_values, for_errors, for_all = (np.where(w, np.nan, 1.0) for w in (nothing, blank, lost))
    sigma_eta, sigma_k = e.sigma_eta * for_errors, e.sigma_k * for_errors
    covariance = np.empty_like(e.information)
    covariance[:, 0, 0], covariance[:, 1, 1] = sigma_eta**2, sigma_k**2
    covariance[:, 0, 1] = covariance[:, 1, 0] = e.covariance * for_errors
    values = {
        "eta": for_values * np.where(matched, data.eta_i, e.eta),
        "k": for_values * np.where(matched, 0.0, e.k),
        "sigma_eta": sigma_eta, "sigma_k": sigma_k, "covariance": covariance,
        "chi2": np.where(no_data | (not a.stated), np.nan, s.cost),
        "limit": for_errors * limit_of_k(e, known),
        # infinite of exact data
        "information": e.information * (for_all / e.variance)[:, None, None],
        "at_zero": (e.at_zero | matched) & ~(lost | undetermined),
        "factor": np.sqrt(e.variance), "least_reflectance": bound,
    }  # fmt: skip
    status = STATUS[undetermined + 2 * failed + 3 * no_data]
    return Answer(s, values, known, codes, status, others, dof)


def start_points(start: Mapping[str, Any] | None, a: Arranged) -> np.ndarray | None:
    if start is None:
        return None
    try:
        names = dict(start)
        eta, k = names.pop("eta"), names.pop("k")
        if names or np.iscomplexobj(eta) or np.iscomplexobj(k):
            raise TypeError("complex, or more names")
        eta, k = (np.broadcast_to(np.asarray(v, float), a.shape).reshape(-1) for v in (eta, k))
    except (TypeError, ValueError, KeyError) as error:
        raise ValueError(
            f"start is {str(start)[:60]}; {{'eta': ..., 'k': ...}} was wanted, real numbers or "
            f"arrays of shape {a.shape}."
        ) from error
    if not ((eta > 0.0) & (k >= 0.0) & np.isfinite(eta) & np.isfinite(k)).all():
        raise ValueError(
            "start holds an eta or k out of range; eta above 0 and k from 0 were wanted."
        )
    return coordinates_of(eta / a.data.eta_i, k / a.data.eta_i)
