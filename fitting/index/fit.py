"""Fit eta + i k of one bare interface to reflectance over angle: one curve or many, one engine.

    R_j(theta_i; eta, k)  ->  minimise  sum_ij [(R_j(theta_i) - value_ij) / sigma_ij]^2

over eta > 0 and k >= 0, where R_j is R_s, R_p or R = R_p + share (R_s - R_p), from
`fresnel_jax.powers` with its closed derivatives. Every fit starts from a mesh (`starts`), runs in
coordinates in which the problem is nearly linear (`coordinates`) through optimistix with a solver
for batches (`solver`), and a second basin, where the mesh shows one, is followed to its end.

Fits run in float64, whether or not the caller has switched on jax_enable_x64.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fitting.index import identifiability as flag
from fitting.index import result
from fitting.index.arrange import Arranged, of_arrays, of_measurement
from fitting.index.batch import Data, Minima, fitted_curves, minima
from fitting.index.coordinates import coordinates_of
from fitting.index.engine import Solved
from fitting.index.estimate import Estimate, estimate
from fitting.index.intervals import KINDS, PROFILE, intervals
from fitting.index.mirror import allowed_rise, like_mirrors
from fitting.index.misfit import Order, order_of_residuals
from fitting.index.result import NO_DATA, NOT_CONVERGED
from fitting.index.result import FitResult as FitResult
from fitting.index.valley import open_to_the_other_end
from fitting.measurement import Measurement
from fitting.misfit import misses_its_noise
from fitting.pattern import Pooled, pooled_pattern

# A second solution is reported if its chi2 is less than this higher: 5 % of what two parameters do.
ALTERNATIVE_CHI2 = 6.0
# Two indices fit alike if their chi2 differs by less: two standard errors.
ALIKE_CHI2 = 4.0
# What a reflectance is trusted to where neither errors nor scatter tell (two data, no errors).
ASSUMED_SIGMA = 1e-3
# In a batch, where residuals are not looked at one by one, no misfit below that rms is looked for.
LEAST_MISS = 0.01


def _extent(data: Data, angle_deg: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return least and largest angle and number of channels of each curve; (1,) if all alike."""
    used = [np.atleast_2d(w) > 0.0 for w in data.weights]
    some = np.logical_or.reduce(used)
    angle = np.broadcast_to(np.atleast_2d(angle_deg), some.shape)
    low = np.where(some, angle, np.inf).min(1)
    high = np.where(some, angle, -np.inf).max(1)
    return low, high, np.sum([u.any(1) for u in used], axis=0)


def _distinct(best: Estimate, other: Estimate) -> np.ndarray:
    """Where the other minimum is another index, not the same one reached from another side."""
    apart_eta, apart_k = np.abs(other.eta - best.eta), np.abs(other.k - best.k)
    near = np.fmax(np.nan_to_num(best.sigma_eta), 1e-6 * best.eta)
    near_k = np.fmax(np.nan_to_num(best.sigma_k), 1e-3 * best.k + 1e-6)
    return (apart_eta > near) | (apart_k > np.fmax(near_k, np.nan_to_num(best.k_upper_limit)))


def _undetermined(e: Estimate) -> np.ndarray:
    with np.errstate(invalid="ignore"):
        return e.singular | (e.spread > flag.UNDETERMINED_LIMIT)


def _missed(a: Arranged, rms: np.ndarray) -> np.ndarray:
    """Where a fit misses its data by more than the noise that they show, if by enough to matter."""
    found = np.zeros(len(rms), bool)
    some = np.flatnonzero(rms > LEAST_MISS)
    if len(some):
        part = a.data.take(some)
        angle = np.degrees(np.arccos(np.atleast_2d(part.cos_theta)))
        values = tuple(
            np.where(np.broadcast_to(w, v.shape) > 0.0, v, np.nan)
            for v, w in zip(part.values, part.weights, strict=True)
        )
        found[some] = misses_its_noise(angle, values, rms[some])
    return found


def _flags(
    a: Arranged,
    e: Estimate,
    s: Solved,
    undetermined: np.ndarray,
    second: np.ndarray,
    mirror: np.ndarray,
    dof: np.ndarray,
) -> np.ndarray:
    low, high, channels = _extent(a.data, a.angle_deg)
    names = a.data.channels
    with np.errstate(all="ignore"):
        at_45 = (low > 44.9) & (high < 45.1) & (channels == 2) & ("R" not in names)
        circle = ~at_45 & (~(e.moved > flag.CIRCLE_LIMIT) | (s.count == 1))
        alone = channels == 1
        chi2 = flag.chi2_flags(s.cost / dof, dof) if a.stated else np.zeros(len(dof), int)
        rms = np.sqrt(s.plain / s.count)
        nothing = s.x < flag.NOTHING_LIMIT
        clear = ~undetermined & ~nothing
        found = {
            flag.PERFECT_MIRROR: mirror,
            flag.NO_REFLECTION: nothing & (s.count > 0),
            flag.AT_45_DEGREES: undetermined & at_45 & ~mirror,
            flag.CIRCLE: undetermined & circle & ~mirror,
            flag.COMBINATION: undetermined & ~at_45 & ~circle & ~mirror,
            flag.K_BELOW_FLOOR: clear & np.isfinite(e.k_upper_limit),
            flag.SECOND_SOLUTION: second,
            flag.CORRELATED: clear & (np.abs(e.correlation) > flag.CORRELATION_LIMIT),
            flag.VAGUE: clear & (e.sigma_eta > flag.VAGUE_LIMIT * e.eta),
            flag.FLAT_CURVE: clear & alone & (high < flag.FLAT_BELOW_DEG),
            flag.NO_DEGREES: clear & (s.count == 2),
            flag.OUT_OF_MODEL: _missed(a, rms),
        }
    return sum(bit * np.asarray(where).astype(int) for bit, where in found.items()) | chi2


def _fit(a: Arranged, absolute: bool, start: Any, wanted: str) -> tuple[FitResult, Solved]:
    """Return the result, and the solutions that it shows."""
    _check(a, absolute, wanted)
    found, data = minima(a.data, _points(start, a))
    return _result(a._replace(data=data), found, absolute, wanted), found.best


def _check(a: Arranged, absolute: bool, wanted: str) -> None:
    if wanted not in KINDS:
        raise ValueError(f"intervals is {wanted!r}; one of {', '.join(KINDS)} was wanted.")
    if not isinstance(absolute, bool | np.bool_):
        raise ValueError(f"absolute_sigma is {absolute!r}; True or False was wanted.")
    if absolute and not a.stated:
        raise ValueError("absolute_sigma was asked for, but there are no stated errors to take.")


def _result(
    a: Arranged, found: Minima, absolute: bool, wanted: str, order: np.ndarray | None = None
) -> FitResult:
    """Return what the minima say. order: see `estimate`."""
    data, s = a.data, found.best
    _, high, _ = _extent(data, a.angle_deg)
    sin_max = np.sin(np.radians(np.broadcast_to(np.fmax(high, 0.0), s.cost.shape)))
    how = {"stated": a.stated, "absolute": absolute, "sin_max": sin_max, "order": order}
    e = estimate(data, s, **how)
    dof = np.maximum(s.count - 2, 0)

    no_data = s.count == 0
    # A fit that creeps along a valley without end is undetermined, whether or not it was stopped.
    matched = ~no_data & (s.x < flag.NOTHING_LIMIT)  # no boundary to speak of
    undetermined = ~no_data & ~matched & _undetermined(e) & np.isfinite(s.cost)
    # What a difference of chi2 is measured by: the scatter found, or stated if that is more.
    stated = 1.0 if a.stated else np.where(dof < 3, ASSUMED_SIGMA**2, 0.0)
    with np.errstate(all="ignore"):
        scatter = np.fmax(np.where(dof > 0, s.cost / dof, 0.0), stated)
        excess = (found.other.cost - s.cost) / scatter
        inner = np.flatnonzero(~no_data & ~undetermined & ~matched & (e.eta < data.eta_i))
    if len(inner):
        part = Solved(*np.array(s)[:, inner])
        allowed = part.cost + ALIKE_CHI2 * scatter[inner]
        undetermined[inner] |= open_to_the_other_end(data.take(inner), part, allowed)
    with np.errstate(all="ignore"):
        limit = s.cost + allowed_rise(dof) * scatter
        bound, perfect = like_mirrors(data, s.scale, limit, scatter)
        # A best fit that is a mirror itself, and is undetermined as such, names its circle.
        names_circle = undetermined & ~perfect & (np.tanh(0.5 * s.x) >= bound)
    bound = np.where(no_data | matched | names_circle, np.nan, bound)
    mirror = np.isfinite(bound) | (undetermined & (s.x > flag.MIRROR_LIMIT))
    undetermined |= mirror
    failed = ~no_data & ~undetermined & ~matched & ~(s.done > 0)
    second = (
        ~(no_data | failed | undetermined | matched)
        & (found.other.done > 0)
        & (excess < ALTERNATIVE_CHI2)
    )
    if second.any():
        other = estimate(data, found.other, **how)
        second &= _distinct(e, other)
    else:
        other = e
    flags = _flags(a, e, s, undetermined, second, mirror, dof)
    flags = np.where(failed, flag.NOT_CONVERGED, np.where(no_data, 0, flags))
    status = np.select(
        [no_data, failed, undetermined, e.at_zero | matched],
        [result.NO_DATA, result.NOT_CONVERGED, result.UNDETERMINED, result.AT_ZERO],
        result.CONVERGED,
    )
    blank = no_data | failed | undetermined | matched  # no error is known
    nothing = no_data | mirror  # no value either

    known = intervals(
        data, s, e, wanted=wanted, blank=blank, undetermined=undetermined,
        nothing=nothing | failed, matched=matched,
    )  # fmt: skip

    # The limit of k is the upper end of its 95 % interval, from whatever that was found.
    limit = e.k_upper_limit
    limit = np.where(np.isfinite(limit) & (known.kind == PROFILE), known.k[:, 1], limit)

    def but(value: np.ndarray, empty: np.ndarray) -> np.ndarray:
        return np.where(empty.reshape(-1, *(1,) * (value.ndim - 1)), np.nan, value)

    with np.errstate(all="ignore"):
        chi2 = s.cost if a.stated else np.full_like(s.cost, np.nan)
        fields = {
            "eta": but(np.where(matched, data.eta_i, e.eta), nothing),
            "k": but(np.where(matched, 0.0, e.k), nothing),
            "sigma_eta": but(e.sigma_eta, blank), "sigma_k": but(e.sigma_k, blank),
            "covariance": but(e.covariance, blank),
            "correlation": but(e.correlation, blank),
            "chi2": but(chi2, no_data), "chi2_reduced": np.where(dof > 0, chi2 / dof, np.nan),
            "dof": dof.astype(int), "n_data": s.count.astype(int),
            "rms": np.sqrt(s.plain / s.count),
            "k_upper_limit": but(limit, blank),
            "status": status, "iterations": s.evaluations.astype(int),
            "wavelength_um": a.wavelength_um, "flags": flags,
            "information": but(e.information / e.variance[:, None, None], no_data | failed),
            "alternative_eta": but(other.eta, ~second), "alternative_k": but(other.k, ~second),
            "alternative_delta_chi2": but(excess, ~second),
            "eta_interval": known.eta, "k_interval": known.k, "interval_kind": known.kind,
            "residual_correlation": np.full(len(dof), np.nan), "least_reflectance": bound,
            "neighbour_noise": np.full(len(dof), np.nan),
        }  # fmt: skip
    shaped = {n: v.reshape(a.shape + v.shape[1:]) for n, v in fields.items()}
    kind = "absolute" if absolute else "scaled"
    out = FitResult(**shaped, sigma_kind=kind, notes=a.notes, eta_i=data.eta_i)
    return out if a.shape else out.plain()


def _points(start: Any, a: Arranged) -> np.ndarray | None:
    if start is None:
        return None
    try:
        if np.iscomplexobj(start):
            raise TypeError("complex")
        eta, k = (np.broadcast_to(np.asarray(v, float), a.shape).reshape(-1) for v in start)
    except (TypeError, ValueError) as error:
        raise ValueError(
            f"start must be (eta, k), real numbers or arrays of shape {a.shape}."
        ) from error
    if not ((eta > 0.0) & (k >= 0.0) & np.isfinite(eta) & np.isfinite(k)).all():
        raise ValueError("start must have eta above 0 and k of 0 or more.")
    return coordinates_of(eta / a.data.eta_i, k / a.data.eta_i)


def fit(
    measurement: Measurement,
    *,
    eta_i: float = 1.0,
    sigma: str = "given",
    absolute_sigma: bool = False,
    start: tuple[Any, Any] | None = None,
    intervals: str = "auto",
) -> FitResult:
    """Return eta + i k of a bare interface from measured R_s, R_p and R, each wavelength by itself.

    measurement: angles in degrees, reflectances as fractions; see `Measurement`.
    eta_i: index of the lossless medium that the light comes from.
    sigma: "given": weigh by the stated errors if every datum has one; "equal": weigh all alike.
    absolute_sigma: take the stated errors as they are. By default the errors of eta and k are
        multiplied by sqrt(chi2 / dof), so that only the ratios of the stated errors count.
    start: (eta, k) to start from as well, numbers or one for each wavelength; the mesh is always
        tried, and the better minimum wins.
    intervals: how `FitResult.eta_interval` and `k_interval` are found: "quadratic" (from the
        standard errors), "profile" (from the likelihood), or "auto": by profile where the quadratic
        ones are wrong (k near 0; sigma_eta above 2 % of eta, where the valley bends).
    Result: a FitResult, of shape () for one wavelength, else (wavelengths,) in rising order.
    Accuracy: without noise eta comes back to about 1e-14 (metals 7e-14) and k above .01 to 3e-11,
        above .1 to 6e-13; the curve depends on k^2.
    Raises ValueError for quantities that are not reflectances of one interface (psi, delta, T), and
    for arguments that mean nothing.
    """
    if not isinstance(measurement, Measurement):
        raise ValueError(
            f"{type(measurement).__name__} came where a Measurement was wanted: of read_csv(PATH) "
            "or Measurement.from_columns(...); fitting.measurement.concatenate makes one of many."
        )
    a = of_measurement(measurement, eta_i, sigma)
    _check(a, absolute_sigma, intervals)
    found, data = minima(a.data, _points(start, a))
    a = a._replace(data=data)
    result = _result(a, found, absolute_sigma, intervals)
    channel, curve, place = a.rows
    fitted = fitted_curves(a.data, found.best)[channel, curve, place]
    known = ~np.isin(np.atleast_1d(result.status), (NO_DATA, NOT_CONVERGED))
    fitted = np.where(known[curve], fitted, np.nan)
    order = order_of_residuals(measurement, fitted, a.stated)
    if (order.factor > 1.0).any() and not absolute_sigma:
        result = _result(a, found, absolute_sigma, intervals, order.factor)
    return _with_order(result, order, pooled_pattern(measurement, fitted, a.stated))


def _with_order(result: FitResult, order: Order, pooled: Pooled | None) -> FitResult:
    """Return the result with what its residuals say."""
    flags = np.atleast_1d(result.flags) & ~flag.OUT_OF_MODEL & ~flag.NOT_NOISE
    flags = flags | np.where(np.isfinite(order.noise), flag.OUT_OF_MODEL, 0)
    flags = flags | np.where(np.isfinite(order.correlation), flag.NOT_NOISE, 0)
    notes = result.notes
    if pooled is not None:
        notes = (*notes, flag.pooled_sentence(pooled))
    changed = result._replace(
        flags=flags.reshape(result.shape), notes=notes,
        residual_correlation=order.correlation.reshape(result.shape),
        neighbour_noise=order.noise.reshape(result.shape),
    )  # fmt: skip
    return changed if result.shape else changed.plain()


def fit_many(
    angles_deg: Any,
    *,
    R_s: Any = None,
    R_p: Any = None,
    R: Any = None,
    sigma: Any = None,
    eta_i: float = 1.0,
    absolute_sigma: bool = False,
    start: tuple[Any, Any] | None = None,
    intervals: str = "quadratic",
) -> FitResult:
    """Return eta + i k of many curves at once; the same answers, errors and warnings as one by one.

    But for what residuals say one by one: whether they are in order, and errors too small for it,
    is asked by `fit` alone; a misfit is found here from an rms of .01 on.

    angles_deg: (M,) degrees of incidence from the normal, 0 to 90, or (..., M) one set a curve.
    R_s, R_p, R: (..., M) reflectances as fractions (R unpolarised); NaN is a gap. One at least.
    sigma: None, or standard errors above 0 that broadcast to the data: one for all channels, or a
        mapping from channel to errors. NaN leaves the datum out.
    eta_i, absolute_sigma, start, intervals: as in `fit`, but intervals (and so the limit of k) are
        quadratic if nothing is said: one by profile takes 20 times as long as the fit itself.
    Result: a FitResult of the batch shape (...), in float64; scalars for a single curve (M,).
    Speed: about 250,000 curves a second on two cores (60 angles, R_s and R_p, shared angles).
    Raises ValueError for values out of range, shapes that do not fit, or no data at all.
    """
    arrays = {"R_s": R_s, "R_p": R_p, "R": R}
    return _fit(of_arrays(angles_deg, arrays, sigma, eta_i), absolute_sigma, start, intervals)[0]
