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

from fitting.bare_surface import thresholds as limit
from fitting.bare_surface.arrange import Arranged
from fitting.bare_surface.batch import minima
from fitting.bare_surface.coordinates import W_MIN, coordinates_of
from fitting.bare_surface.curve_data import Data, Extent, extent_of
from fitting.bare_surface.descent import Solved
from fitting.bare_surface.estimate import Estimated, estimate
from fitting.bare_surface.mirror import like_mirrors
from fitting.bare_surface.other_solutions import Other, other_solutions
from fitting.bare_surface.region_intervals import Intervals, intervals, limit_of_k
from fitting.bare_surface.valley import Lanes, evaluate, open_to_the_other_end
from fitting.residuals.error_model import beyond_chance
from fitting.residuals.noise import misses_its_noise
from fitting.results import result

# Two indices fit equally well if their chi2 differs by less than this: two standard errors.
ALIKE_CHI2 = 4.0
# The data do not distinguish them at all if it differs by less than this.
ALIKE_MEMBERS = 0.01
# In a batch a misfit of a smaller rms is not reported, since residuals are not examined one by one.
LEAST_MISS = 0.01
# The assumed error of a reflectance if neither stated errors nor scatter give one (two data).
ASSUMED_SIGMA = 1e-3


def _undetermined(e: Estimated) -> np.ndarray:
    return e.singular | (e.spread > limit.UNDETERMINED_LIMIT)


def _missed(a: Arranged, rms: np.ndarray) -> np.ndarray:
    """Return which fits miss their data by more than their noise, and by enough to matter."""
    found = np.zeros(len(rms), bool)
    some = (rms > LEAST_MISS).nonzero()[0]
    if len(some):
        part = a.data.take(some)
        angle = np.degrees(np.arccos(np.atleast_2d(part.cos_theta)))
        values = tuple(
            np.where(w > 0.0, v, np.nan)
            for v, w in zip(part.values, part.wide_weights, strict=True)
        )
        found[some] = misses_its_noise(angle, values, rms[some])
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
    known = estimate(part, there, stated=True, absolute=True, sin_max=np.zeros(len(rows)))
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
    circle = ~at_45 & (~(e.moved > limit.CIRCLE_LIMIT) | (s.count == 1) | on_circle)
    chi2_large, chi2_small = beyond_chance(s.cost / dof if a.stated else np.nan, dof)
    correlated = np.abs(e.covariance) > limit.CORRELATION_LIMIT * e.sigma_eta * e.sigma_k
    nothing = s.x < limit.NOTHING_LIMIT
    clear = ~undetermined & ~nothing
    return {
        "perfect_mirror": mirror,
        "no_reflection": nothing & (s.count > 0),
        "same_at_45_degrees": undetermined & at_45 & ~mirror,
        "circle": undetermined & circle & ~mirror,
        "combination": undetermined & ~at_45 & ~circle & ~mirror,
        "does_not_describe": _missed(a, np.sqrt(s.plain / s.count)),
        "compatible_with_zero": clear & np.isfinite(e.k_upper_limit),
        "poorly_determined": clear & (e.sigma_eta > limit.VAGUE_LIMIT * e.eta),
        "correlated": clear & correlated,
        "chi2_large": chi2_large,
        "chi2_small": chi2_small,
        "flat_curve": clear & (channels == 1) & (high < limit.FLAT_BELOW_DEG),
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
    others: tuple[Other, ...]
    dof: np.ndarray


# Among many curves some make an operation invalid; its NaN stays within that curve.
@np.errstate(all="ignore")
def answer(a: Arranged, absolute: bool, start: np.ndarray | None, wanted: str) -> Answer:
    """Return the results for all curves. start: (3, N), an additional start of each; or None."""
    data = a.data
    extent = extent_of(data, a.angle_deg)
    found, data = minima(data, extent, start)
    a = a._replace(data=data)
    s = Solved(*found.best)
    sin_max = np.empty_like(s.cost)
    sin_max[:] = np.sin(np.radians(np.fmax(extent.high_deg, 0.0)))
    how = {"stated": a.stated, "absolute": absolute, "sin_max": sin_max}
    e = estimate(data, s, **how)
    dof = np.maximum(s.count - 2, 0)

    no_data = s.count == 0
    # A fit that moves along an endless valley is undetermined, whether or not it was stopped.
    matched = ~no_data & (s.x < limit.NOTHING_LIMIT)  # no boundary to speak of
    bounded = ~(no_data | matched)
    undetermined = bounded & _undetermined(e) & np.isfinite(s.cost)
    # The unit of a difference of chi2: the scatter of the data, or their stated errors if larger.
    stated = 1.0 if a.stated else np.where(dof < 3, ASSUMED_SIGMA**2, 0.0)
    scatter = np.fmax(np.where(dof > 0, s.cost / dof, 0.0), stated)
    inner = (bounded & ~undetermined & (e.eta < data.eta_i)).nonzero()[0]
    if len(inner):
        part = Solved(*found.best[:, inner])
        allowed = part.cost + ALIKE_CHI2 * scatter[inner]
        undetermined[inner] |= open_to_the_other_end(data.take(inner), part, allowed)
    bound, perfect = like_mirrors(data, s, dof, np.greater(stated, 0.0), scatter)
    undetermined |= bounded & np.isfinite(bound)
    # Where R = 1 does not fit, a best fit that is such a reflector itself (and not a critical angle
    # next to one low datum, of a small R(0)) names its circle.
    on_circle = ~perfect & (1.0 - np.tanh(0.5 * s.x) <= 2.0 * (1.0 - bound))
    bound[~bounded | on_circle] = np.nan
    mirror = np.isfinite(bound) | (undetermined & (s.x > limit.MIRROR_LIMIT))
    undetermined |= mirror
    e = _of_many_the_lossless(data, s, e, undetermined & ~mirror, scatter)
    failed = bounded & ~undetermined & ~(s.done > 0)
    blank = ~bounded | failed | undetermined  # no error is known
    estimated = np.where(np.greater(scatter, stated) & (not a.stated), dof, 0)
    others = other_solutions(data, found, scatter, estimated, e, ~blank, how, wanted)
    more = np.logical_or.reduce([other.there for other in others])
    codes = _codes(a, e, s, undetermined, mirror, on_circle, dof, extent)
    lost = failed | no_data
    if lost.any():
        codes = {code: at & ~lost for code, at in codes.items()}
    codes = {"not_converged": failed, **codes, "other_minima": more}
    status = np.full(len(lost), result.CONVERGED, f"<U{len(result.NOT_CONVERGED)}")
    for where, what in (
        (undetermined, result.UNDETERMINED), (failed, result.NOT_CONVERGED),
        (no_data, result.NO_DATA),
    ):  # fmt: skip
        status[where] = what
    nothing = no_data | mirror  # no value either
    known = intervals(
        data, s, e, wanted=wanted, blank=blank, undetermined=undetermined,
        nothing=nothing | failed, matched=matched,
    )  # fmt: skip
    eta, k, information = e.eta.copy(), e.k.copy(), e.information / e.variance[:, None, None]
    eta[matched], k[matched] = data.eta_i, 0.0
    covariance = np.empty_like(information)
    covariance[:, 0, 0], covariance[:, 1, 1] = e.sigma_eta**2, e.sigma_k**2
    covariance[:, 0, 1] = covariance[:, 1, 0] = e.covariance
    sigma_eta, sigma_k, limit_k = e.sigma_eta.copy(), e.sigma_k.copy(), limit_of_k(e, known)
    chi2 = s.cost.copy() if a.stated else np.full_like(s.cost, np.nan)
    for empty, all_of in (
        (nothing, (eta, k)), (blank, (sigma_eta, sigma_k, covariance, limit_k)),
        (no_data, (chi2,)), (lost, (information,)),
    ):  # fmt: skip
        if empty.any():
            for value in all_of:
                value[empty] = np.nan
    values = {
        "eta": eta, "k": k, "sigma_eta": sigma_eta, "sigma_k": sigma_k, "covariance": covariance,
        "chi2": chi2, "limit": limit_k,
        "information": information,  # infinite of exact data
        "at_zero": (e.at_zero | matched) & ~(lost | undetermined),
        "factor": np.sqrt(e.variance), "least_reflectance": bound,
    }  # fmt: skip
    return Answer(
        solved=s, values=values, known=known, codes=codes, status=status, others=others, dof=dof
    )


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
