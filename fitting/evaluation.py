"""A fitted model as curves: at the data, at points of one's own, and eta and k over wavelength."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import numpy as np

from fitting.measurement import Measurement
from fitting.observations import Observations, observations, padded
from fitting.observe import NCS
from fitting.problem import Targets, index_slopes, linearised, without_data
from fitting.unknowns import Unknowns


class Evaluated(NamedTuple):
    """Where a fit ended: unknowns, what they were compared with, y (p,) and its covariance (p, p).

    The covariance is NaN in rows of what is held or at a bound; along what is not seen it
    is 0 (the fitted curve does not change there).
    """

    unknowns: Unknowns
    seen: Observations
    targets: Targets
    y: np.ndarray
    covariance: np.ndarray


def _error(slopes: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Return the standard error (...) of what has these slopes (..., p)."""
    known = np.isfinite(np.diagonal(covariance))
    if not known.any():
        return np.full(slopes.shape[:-1], np.nan)
    some = slopes[..., known]
    variance = np.einsum("...i,ij,...j->...", some, covariance[np.ix_(known, known)], some)
    return np.sqrt(np.maximum(variance, 0.0))


def _matched(at: Evaluated, seen: Observations) -> tuple[tuple[int, ...], ...]:
    """Return the fitted curve that each channel of other points belongs to; -1 for none."""
    first = {c: own[0] for c, own in zip(at.seen.channels, at.seen.curves, strict=True)}
    return tuple((first.get(c, -1),) for c in seen.channels)


def at_data(seen: Observations, value: np.ndarray) -> np.ndarray:
    """Return the model at every datum (N,), from what each channel shows (K, M)."""
    out = np.empty(len(seen.row))
    for i, channel in enumerate(c for c in seen.channels if c != NCS):
        here = seen.channel == channel
        out[here] = value[i, seen.row[here]]
    if NCS in seen.channels:
        N, C, S = value[-3:]
        angles = 0.5 * np.arctan2(np.sqrt(C * C + S * S), N), np.arctan2(S, C) % (2.0 * np.pi)
        for name, angle in zip(("psi", "delta"), angles, strict=True):
            here = seen.quantity == name
            out[here] = np.degrees(angle[seen.row[here]])
    return out


def fitted(at: Evaluated, measurement: Measurement | None) -> tuple[np.ndarray, np.ndarray]:
    """Return the model at every datum and its standard error; see `ModelFit.fitted`."""
    u, seen, targets = at.unknowns, at.seen, at.targets
    if measurement is not None:
        seen = observations([measurement], "equal")
        spec = u.spec._replace(
            channels=seen.channels, curves=_matched(at, seen), loss="squares", priors=False
        )
        u, targets = u._replace(spec=spec), targets._replace(points=seen.points)
    with jax.enable_x64(True):
        value, slope = (np.asarray(a) for a in linearised(without_data(targets), at.y, spec=u.spec))
    error = _error(slope, at.covariance)
    channels = [c for c in seen.channels if c != NCS]
    sigma = np.empty(len(seen.row))
    for i, channel in enumerate(channels):
        here = seen.channel == channel
        sigma[here] = error[i, seen.row[here]]
    if NCS in seen.channels:
        _errors_of_angles(seen, value[-3:], slope[-3:], at.covariance, sigma)
    return at_data(seen, value), sigma


def _errors_of_angles(seen, value, slope, covariance, sigma) -> None:
    """Fill in those of psi and Delta in degrees, from N, C, S (3, M) and slopes (3, M, p)."""
    N, C, S = value
    sine2 = C * C + S * S
    sine = np.sqrt(sine2)
    total = np.sqrt(N * N + sine2)
    with np.errstate(divide="ignore", invalid="ignore"):
        # d(2 psi) = (N d(sin 2psi) - sin 2psi dN) / total^2
        d_sine = (C[:, None] * slope[1] + S[:, None] * slope[2]) / sine[:, None]
        d_psi = 0.5 * (N[:, None] * d_sine - sine[:, None] * slope[0]) / total[:, None] ** 2
        d_delta = (C[:, None] * slope[2] - S[:, None] * slope[1]) / sine2[:, None]
    for name, by in zip(("psi", "delta"), (d_psi, d_delta), strict=True):
        here = seen.quantity == name
        sigma[here] = np.degrees(_error(by[seen.row[here]], covariance))


def index_band(at: Evaluated, wavelength_um: Any) -> tuple[np.ndarray, ...]:
    """Return wavelengths, eta, its error, k, its error; see `ModelFit.index`."""
    wavelength = np.atleast_1d(np.asarray(wavelength_um, float))
    if wavelength.ndim != 1 or not (wavelength > 0.0).all():
        raise ValueError("wavelength_um must be one number or one axis of them, all above 0.")
    count = len(wavelength)
    full = np.pad(wavelength, (0, padded(count) - count), mode="edge")
    u = at.unknowns
    with jax.enable_x64(True):
        value, slope = (np.asarray(a) for a in index_slopes(at.y, u.held, full, spec=u.spec))
    error = _error(slope, at.covariance)[:, :count]
    return wavelength, value[0, :count], error[0], value[1, :count], error[1]
