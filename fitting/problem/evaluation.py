"""Evaluation of a fitted sample: at the data, at other points, and eta and k over wavelength."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from fitting.data.measurement import Measurement
from fitting.data.quantities import DELTAS
from fitting.optics.instrument import with_places
from fitting.optics.spec import NCS
from fitting.problem.observations import (
    Observations,
    ncs_directions,
    numbers,
    observations,
    padded,
    points_of,
)
from fitting.problem.programs import Targets, index_slopes
from fitting.problem.slopes import shown_at_y
from fitting.problem.unknowns import Unknowns, index_outside, spec_at
from fitting.process.compiled import fit_settings
from fitting.results.result_parts import IndexBand, Prediction
from fitting.samples.sample import FREE, Sample
from fitting.samples.sample_checks import check_known


class Evaluated(NamedTuple):
    """The minimum of a fit: unknowns, data, solver coordinates y (p,), their covariance (p, p).

    The covariance is NaN in rows of fixed parameters and of those at a bound; along undetermined
    combinations it is 0, since the curve does not change (splines: `uncertainty.spline_errors`).
    inside: (K, p), solver coordinates within the 95 % intervals next to their ends by profile, NaN
    where there is none, and half such an interval in standard errors: where the curve is not linear
    in the parameters, eta and k differ by more than by the covariance. errors: (2,) standard errors
    of eta and k that include that of a thickness shared by all wavelengths; None where there is
    none. rows: the data of one wavelength, of which ``seen`` and ``targets`` have all.
    """

    sample: Sample
    unknowns: Unknowns
    seen: Observations
    targets: Targets
    y: np.ndarray
    covariance: np.ndarray
    measured_um: np.ndarray
    inside: tuple[np.ndarray, float]
    errors: np.ndarray | None = None
    rows: Measurement | None = None

    def predict(self, measurement: Measurement | None = None) -> Prediction:
        """Return the model at every row of a measurement; None: at the fitted data."""
        return Prediction(*_fitted(self, self.rows if measurement is None else measurement))

    def over_angle(self, angle_deg: np.ndarray, quantity: str) -> Prediction:
        """Return the model over angles (A,), at the one wavelength that was measured."""
        wavelength = self.measured_um if len(self.measured_um) == 1 else None
        return self.predict(points_of(angle_deg, quantity, wavelength))

    def index(self, wavelength_um: Any = None, medium: str | None = None) -> IndexBand:
        """Return eta and k of a medium at wavelengths; see `Fit.index`."""
        which = _medium(self.sample, medium)
        if wavelength_um is None:
            known = self.measured_um
            band = _index_band(self, np.where(np.isfinite(known), known, 1.0), which)
            if self.errors is not None and self.sample.media[which + 1].index == FREE:
                band = band._replace(sigma_eta=self.errors[:1], sigma_k=self.errors[1:])
            return band._replace(wavelength_um=known)
        if self.sample.media[which + 1].index == FREE and np.isfinite(self.measured_um).all():
            same = measured_places(self.measured_um[:1], wavelength_um)
            band = self.index(None, medium)
            return IndexBand(*(part[same] for part in band))
        return _index_band(self, wavelength_um, which)

    def at(self, index: tuple[int, ...]) -> Evaluated:
        """Return itself, since it belongs to one fit."""
        return self

    def widened(self, factor: np.ndarray) -> Evaluated:
        """Return the same with all errors times a factor (1,)."""
        errors = None if self.errors is None else self.errors * factor[0]
        places, t = self.inside
        return self._replace(
            covariance=self.covariance * factor[0] ** 2, errors=errors,
            inside=(places, t / factor[0]),
        )  # fmt: skip


def measured_places(measured_um: np.ndarray, wavelength_um: Any) -> list[int]:
    """Return which of the measured wavelengths these are.

    Raises ValueError for others, at which an index that is free at each of them is not known.
    """
    place = {um: i for i, um in enumerate(measured_um.tolist())}
    wanted = np.atleast_1d(numbers("wavelength_um", wavelength_um)).tolist()
    strange = [um for um in wanted if um not in place]
    if strange:
        raise ValueError(
            f"{strange[0]:g} um was not measured, and eta and k that are free at every wavelength "
            "are known at the measured ones only. Give one of these, or fit a dispersion model."
        )
    return [place[um] for um in wanted]


class Alike(Sequence[Evaluated]):
    """N fits of one sample at the same points: one as a pattern, y (N, p), covariance (N, p, p).

    inside: (N, K, p) and (N,), as those of `Evaluated`.
    """

    def __init__(
        self, pattern: Evaluated, y: np.ndarray, covariance: np.ndarray,
        inside: tuple[np.ndarray, np.ndarray],
    ):  # fmt: skip
        self.pattern, self.y, self.covariance, self.inside = pattern, y, covariance, inside

    def __len__(self) -> int:
        return len(self.y)

    def __getitem__(self, i: Any) -> Any:
        places, t = self.inside
        return self.pattern._replace(
            y=self.y[i], covariance=self.covariance[i], inside=(places[i], t[i])
        )


class EachFit(NamedTuple):
    """The evaluators of a batch, one after the other.

    wavelength_um, measurement: of an index that is free at every wavelength, (W,) in rising order,
    and the data of all; None where each fit is one of all wavelengths.
    """

    each: Sequence[Evaluated]
    shape: tuple[int, ...]
    wavelength_um: np.ndarray | None = None
    measurement: Measurement | None = None

    def at(self, index: tuple[int, ...]) -> Evaluated:
        """Return the evaluator of one fit."""
        return self.each[int(np.ravel_multi_index(index, self.shape)) if self.shape else 0]

    def _every(self, kind: Any, of: Any) -> Any:
        parts = (np.stack(part) for part in zip(*map(of, self.each), strict=True))
        return kind(*(part.reshape(*self.shape, *part.shape[1:]) for part in parts))

    def predict(self, measurement: Measurement | None = None) -> Prediction:
        """Return every fit at every row of a measurement, shape + (N,).

        Of wavelengths each row at its own, (N,).
        """
        if self.wavelength_um is None:
            return self._every(Prediction, lambda one: one.predict(measurement))
        m = self.measurement if measurement is None else measurement
        assert m is not None
        value, sigma = np.full(len(m), np.nan), np.full(len(m), np.nan)
        for one, wavelength in zip(self.each, self.wavelength_um, strict=True):
            rows = m.at_wavelength(wavelength)
            if rows.any():
                found = one.predict(None if measurement is None else m.where(rows))
                value[rows], sigma[rows] = found
        return Prediction(value, sigma)

    def over_angle(self, angle_deg: np.ndarray, quantity: str) -> Prediction:
        """Return every fit over angles (A,), shape + (A,)."""
        return self._every(Prediction, lambda one: one.over_angle(angle_deg, quantity))

    def index(self, wavelength_um: Any = None, medium: str | None = None) -> IndexBand:
        """Return eta and k of a medium in every fit, shape + (W,); of wavelengths (W,)."""
        known = self.wavelength_um
        if known is None:
            return self._every(IndexBand, lambda one: one.index(wavelength_um, medium))
        asked = wavelength_um is not None
        chosen = measured_places(known, wavelength_um) if asked else range(len(known))
        bands = [self.each[i].index(None, medium) for i in chosen]
        return IndexBand(*(np.concatenate(part) for part in zip(*bands, strict=True)))

    def widened(self, factor: np.ndarray) -> EachFit:
        """Return the same with the errors of each fit times its factor, (N,)."""
        wide = (e.widened(f[None]) for e, f in zip(self.each, factor, strict=True))
        return self._replace(each=tuple(wide))

    def with_errors(self, errors: np.ndarray) -> EachFit:
        """Return the same with standard errors (W, 2) of eta and k; see `Evaluated`."""
        each = (e._replace(errors=x) for e, x in zip(self.each, errors, strict=True))
        return self._replace(each=tuple(each))


def _medium(sample: Sample, name: str | None) -> int:
    """Return the number of a medium after the first, by its place; None: the first unknown."""
    if name is not None:
        if name not in sample.places[1:]:
            wanted = " or ".join(sample.places[1:])
            raise ValueError(f"there is no medium {name!r}; {wanted} was wanted.")
        return sample.places.index(name) - 1
    return next((i for i, m in enumerate(sample.media[1:]) if m.unknown), 0)


def _error(slopes: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Return the standard error (...) of a quantity with these derivatives (..., p)."""
    known = np.isfinite(np.diagonal(covariance))
    if not known.any():
        return np.full(slopes.shape[:-1], np.nan)
    some = slopes[..., known]
    variance = np.einsum("...i,ij,...j->...", some, covariance[np.ix_(known, known)], some)
    return np.sqrt(np.maximum(variance, 0.0))


def _as_far(
    at: Evaluated, sigma: np.ndarray, away: Callable[[np.ndarray], np.ndarray]
) -> np.ndarray:
    """Return standard errors that reach as far as the intervals by profile; NaN stays.

    away: returns how far each quantity at y (p,) lies from its fitted value.
    """
    places, t = at.inside
    for y in places[np.isfinite(places).all(1)]:
        off = away(y) / t
        sigma = np.where(off > sigma, off, sigma)
    return sigma


def _matched(at: Evaluated, seen: Observations, source: str) -> tuple[tuple[int, ...], ...]:
    """Return the fitted curve to which each channel of other points belongs; -1 for none.

    Among several files it is that of the same name, else the first one.
    """
    first = {c: own[0] for c, own in zip(at.seen.channels, at.seen.curves, strict=True)}
    named = {name: i for i, name in enumerate(at.seen.curve_names)}
    first |= {c: named[f"{source} {c}"] for c in first if f"{source} {c}" in named}
    return tuple((first.get(c, -1),) for c in seen.channels)


def _of_data(seen: Observations, of: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return of every datum (N,) what its row has, (M,) by quantity."""
    out = np.empty(len(seen.row))
    for name, values in of.items():
        here = seen.quantity == name
        out[here] = values[seen.row[here]]
    return out


def at_data(seen: Observations, value: np.ndarray) -> np.ndarray:
    """Return the model at every datum (N,), from the values of each channel (K, M)."""
    of = dict(zip(seen.channels, value, strict=False))
    if NCS in of:
        N, C, S = value[-3:]
        of["psi"] = np.degrees(0.5 * np.arctan2(np.sqrt(C * C + S * S), N))
        of |= dict.fromkeys(DELTAS, np.degrees(np.arctan2(S, C) % (2.0 * np.pi)))
    return _of_data(seen, of)


def _fitted(at: Evaluated, measurement: Measurement | None) -> tuple[np.ndarray, np.ndarray]:
    """Return the model at every datum and its standard error."""
    u, seen, outside = at.unknowns, at.seen, at.targets.eta_i
    if measurement is not None:
        seen = observations([measurement], "equal", compared=False)
        spec = u.spec._replace(
            channels=seen.channels,
            curves=_matched(at, seen, measurement.source),
            loss="squares",
            priors=False,
        )
        outside = index_outside(at.sample, seen.points.wavelength_um)
        spec = spec_at(spec, seen.points.angle_deg)
        spec = with_places(spec, spec.numbers(at.y, u.held), seen.points, float(np.max(outside)))
        u = u._replace(spec=spec)
    shown = functools.partial(shown_at_y, u.spec, seen.points, u.held, outside)
    value, slope = shown(at.y)
    error = _error(slope, at.covariance)
    of = dict(zip(seen.channels, error, strict=False))
    if NCS in of:
        by_angle = _slopes_of_angles(value[-3:], slope[-3:])
        of["psi"], delta = (np.degrees(_error(by, at.covariance)) for by in by_angle)
        of |= dict.fromkeys(DELTAS, delta)
    sigma = _of_data(seen, of)
    fitted = at_data(seen, value)

    def away(y: np.ndarray) -> np.ndarray:
        off = np.abs(at_data(seen, shown(y)[0]) - fitted)
        return np.where(seen.quantity == "delta", np.minimum(off, 360.0 - off), off)

    return fitted, _as_far(at, sigma, away)


def _slopes_of_angles(ncs: np.ndarray, slopes: np.ndarray) -> np.ndarray:
    """Return the derivatives (2, M, p) of psi and Delta in radians, from those (3, M, p) of NCS."""
    sine = np.hypot(ncs[1], ncs[2])
    psi, delta = 0.5 * np.arctan2(sine, ncs[0]), np.arctan2(ncs[2], ncs[1])
    along = np.einsum("ijm,jmp->imp", ncs_directions(*np.degrees([psi, delta]))[:2], slopes)
    with np.errstate(divide="ignore", invalid="ignore"):
        # psi moves the point by 2, Delta by sin 2psi for each radian; the sphere of partially
        # polarized light is smaller.
        return along / np.stack([2.0 * np.hypot(ncs[0], sine), sine])[:, :, None]


def _index_band(at: Evaluated, wavelength_um: Any, medium: int) -> IndexBand:
    wavelength = np.atleast_1d(numbers("wavelength_um", wavelength_um))
    good = wavelength.ndim == 1 and wavelength.size
    if not good or not ((wavelength > 0.0) & np.isfinite(wavelength)).all():
        raise ValueError("wavelength_um must be one number or one axis of them, all above 0.")
    check_known(at.sample, medium + 1, wavelength)
    count = len(wavelength)
    full = np.pad(wavelength, (0, padded(count) - count), mode="edge")
    u, outside = at.unknowns, index_outside(at.sample, full[:, None])
    with fit_settings():

        def index(y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            found = index_slopes(y, u.held, full, outside, spec=u.spec, medium=medium)
            value, slope = (np.asarray(a) for a in found)
            return value, slope

        value, slope = index(at.y)
        error = _as_far(at, _error(slope, at.covariance), lambda y: np.abs(index(y)[0] - value))
    (eta, k), (sigma_eta, sigma_k) = value[:, :count], error[:, :count]
    return IndexBand(wavelength, eta, sigma_eta, k, sigma_k)
