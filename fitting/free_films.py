"""A film whose eta and k are free at every wavelength, with one thickness that all of them share.

For a given thickness every wavelength is a fit by itself (`wavelengths`); the best thickness has
the lowest sum of their costs. This needs more than two numbers at a wavelength: psi and Delta at
one angle give an eta and a k for any thickness. The errors of eta and k include that of the
thickness.

Source: the point-by-point fit with a common thickness of H. G. Tompkins and E. A. Irene (eds.),
Handbook of Ellipsometry (2005), sec. 3.4.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fitting.measurements.measurement import Measurement
from fitting.results.diagnostics import Finding
from fitting.results.result import NONE, QUADRATIC, SHARED, Estimate, Fit
from fitting.samples.parameters import Settings
from fitting.samples.sample import FREE, Sample
from fitting.searching.minima import ALTERNATIVE_CHI2
from fitting.searching.search import Asked
from fitting.wavelengths import One, fit_wavelengths, jobs, solved_each

# The thickness is first scanned in _GRID steps, each wavelength from _STARTS starts. At most
# _CLOSER finer scans of _WITHIN steps follow, each a third as wide, until the cost beside the best
# thickness is higher by less than _FLAT of the scatter: the thickness is then within .03 standard
# errors. (After three scans it is within .1; with exact data within 8.)
_STARTS, _GRID, _CLOSER, _WITHIN = 16, 25, 14, 7
_FLAT = 1e-3


class _Profile(NamedTuple):
    """Cost over thickness, (D,) each, in rising order; scatter: the unit of a rise of the cost."""

    thickness_nm: np.ndarray
    cost: np.ndarray
    scatter: float

    @property
    def best(self) -> int:
        """The place of the best thickness."""
        return int(np.argmin(self.cost))


def free_film(sample: Sample) -> int | None:
    """Return which medium is a film that is free at every wavelength and of free thickness."""
    for i, medium in enumerate(sample.media):
        d = medium.thickness
        if medium.index == FREE and d is not None and d.coherent and not d.held:
            return i
    return None


def check_free_film(measurement: Measurement, sample: Sample, which: int) -> None:
    """Raise ValueError where the data cannot determine the thickness; it says what is missing."""
    d = sample.media[which].thickness
    assert d is not None
    if not d.low_um > 0.0:
        raise ValueError(
            f"the sample {str(sample)!r}: a film whose eta and k are free at every wavelength "
            "needs a range for its thickness, for example "
            f"'{FREE} {500 * d.start_um:g}..{2000 * d.start_um:g} nm'."
        )
    others = [m for i, m in enumerate(sample.layers, 1) if i != which and m.thickness]
    if any(not m.thickness.held for m in others if m.thickness):
        raise ValueError(
            f"the sample {str(sample)!r}: only one thickness can be fitted together with an index "
            "that is free at every wavelength; write 'held' after the others."
        )
    waves = np.unique(measurement.wavelength_um)
    if len(measurement) > 2 * len(waves):
        return
    names = dict.fromkeys(measurement.quantity.tolist())
    each = len(measurement) / len(waves)
    raise ValueError(
        f"{measurement.source}: there are {each:.3g} data at each wavelength "
        f"({', '.join(names)}), with which eta and k can be found for any thickness. Add a second "
        "angle or a third quantity; or write 'held' after a thickness that is known; or give the "
        "film a dispersion model (cauchy, tauc-lorentz)."
    )


def _held(sample: Sample, which: int, thickness_nm: float) -> Sample:
    """Return the sample with the thickness of the film fixed at this value."""
    media = list(sample.media)
    d = media[which].thickness
    assert d is not None
    held = d._replace(start_um=1e-3 * thickness_nm, low_um=0.0, high_um=np.inf, held=True)
    media[which] = media[which]._replace(thickness=held)
    return Sample(tuple(media))


def _cost(ones: Sequence[One], row: int, thickness_nm: float) -> float:
    """Return the sum of the costs of all wavelengths at a thickness."""
    moved = []
    for one in ones:
        job = copy.copy(one.fit)
        held = one.fit.targets.held.copy()
        held[row] = thickness_nm
        job.targets = one.fit.targets._replace(held=held)
        moved.append(one._replace(fit=job))
    total = 0.0
    for _, ends in solved_each(moved, _STARTS):
        total += float(np.min(np.where(np.isfinite(ends.cost), ends.cost, np.inf)))
    return total


def _profile(ones: Sequence[One], row: int, ends: tuple[float, float], scaled: bool) -> _Profile:
    known: dict[float, float] = {}

    def look(places: np.ndarray) -> None:
        for d in places.tolist():
            # A place that differs from the best one by rounding only would become its neighbour,
            # and hide those beyond.
            if all(abs(d - other) > 1e-10 * d for other in known):
                known[d] = _cost(ones, row, d)

    data = sum(one.fit.n_data for one in ones)
    dof = max(data - 2 * len(ones) - 1, 1)
    least = 1e-24 * sum(one.fit.squares for one in ones)

    def scatter() -> float:
        lowest = min(known.values())
        return max(lowest / dof if scaled or not ones[0].fit.seen.stated else 1.0, least)

    look(np.geomspace(*ends, _GRID) if ends[1] > 4.0 * ends[0] else np.linspace(*ends, _GRID))
    for _ in range(_CLOSER):
        order = sorted(known)
        best = min(range(len(order)), key=lambda i: known[order[i]])
        low, high = order[max(best - 1, 0)], order[min(best + 1, len(order) - 1)]
        if max(known[low], known[high]) - known[order[best]] < _FLAT * scatter():
            break
        look(np.linspace(low, high, _WITHIN))
    thickness = np.array(sorted(known))
    return _Profile(thickness, np.array([known[d] for d in thickness.tolist()]), scatter())


def _error(p: _Profile) -> float:
    """Return the standard error of the thickness, over which the cost rises by the scatter."""
    rise = (p.cost - p.cost[p.best]) / p.scatter
    near = rise < 9.0
    if near.sum() < 5:
        near = np.zeros(len(rise), bool)
        near[np.argsort(np.abs(p.thickness_nm - p.thickness_nm[p.best]))[:5]] = True
    away = p.thickness_nm[near] - p.thickness_nm[p.best]
    size = np.abs(away).max()
    bend = np.polyfit(away / size, rise[near], 2)[0]
    return float(size / np.sqrt(bend)) if bend > 0.0 else np.inf


def _others(p: _Profile) -> tuple[tuple[float, float], ...]:
    """Return other thicknesses that fit nearly as well, with the rise of chi2."""
    rise = (p.cost - p.cost[p.best]) / p.scatter
    lower = np.r_[True, rise[1:] <= rise[:-1]] & np.r_[rise[:-1] <= rise[1:], True]
    out = []
    for i in np.flatnonzero(lower & (rise < ALTERNATIVE_CHI2)):
        between = rise[min(i, p.best) : max(i, p.best) + 1]
        if i != p.best and between.max() > rise[i] + 1.0:
            out.append((float(p.thickness_nm[i]), float(rise[i])))
    return tuple(out)


def fit_free_film(
    measurement: Measurement, sample: Sample, settings: Settings, asked: Asked
) -> Fit:
    """Return the fit of batch shape (W,), with the shared thickness among its parameters."""
    which = free_film(sample)
    assert which is not None
    d = sample.media[which].thickness
    assert d is not None
    ends = 1e3 * d.low_um, 1e3 * d.high_um
    ones = jobs(measurement, _held(sample, which, ends[0]), settings, asked)
    name = f"{sample.places[which]}.thickness_nm"
    row = ones[0].fit.u.spec.held.index(name)
    p = _profile(ones, row, ends, asked.scaled)
    best, sigma = float(p.thickness_nm[p.best]), _error(p)
    found = fit_wavelengths(measurement, _held(sample, which, best), settings, asked)
    label = ones[0].fit.u.labels[name]
    wide = sigma > 0.3 * (ends[1] - ends[0]) or not np.isfinite(sigma)
    shift = 0.0 if wide else min(sigma, 0.2 * best)
    moved = fit_wavelengths(measurement, _held(sample, which, best + shift), settings, asked)
    by = {
        n: _slope(e, moved.parameters[n], sigma / shift if shift else 0.0)
        for n, e in found.parameters.items() if n != label and e.free
    }  # fmt: skip
    ranges = {ones[0].fit.u.labels.get(u.parameter.name): (u.low, u.high)
              for u in ones[0].fit.u.moving}  # fmt: skip
    parameters = {
        n: _with_thickness(e, by[n], ranges[n]) if n in by else e
        for n, e in found.parameters.items() if n != label
    }  # fmt: skip
    interval = np.clip(best + 1.96 * sigma * np.array([-1.0, 1.0]), *ends)
    parameters[label] = Estimate(
        name=label, unit="nm", value=best, sigma=np.nan if wide else sigma,
        interval=np.full(2, np.nan) if wide else interval,
        interval_kind=NONE if wide else QUADRATIC, status=SHARED,
    )  # fmt: skip
    findings = list(found.findings)
    everywhere = np.ones(found.shape, bool)
    if wide:
        findings.insert(0, Finding("shared_not_seen", everywhere, {"parameter": label}))
    others = _others(p)
    if others and not wide:
        values = {"parameter": label, "values": tuple(o[0] for o in others),
                  "delta_chi2": tuple(o[1] for o in others)}  # fmt: skip
        findings.insert(0, Finding("other_thickness", everywhere, values))
    columns = np.stack([by[n] for n in found.names], -1)
    errors = [np.asarray(parameters[n].sigma) for n in ("eta", "k")]
    return replace(
        found, sample=sample, parameters=parameters, findings=tuple(findings),
        covariance=found.covariance + columns[..., :, None] * columns[..., None, :],
        evaluator=found.evaluator.with_errors(np.stack(errors, -1)),  # type: ignore
    )  # fmt: skip


def _slope(e: Estimate, moved: Estimate, per_shift: float) -> np.ndarray:
    """Return the change of an estimate (W,) with one standard error of the thickness."""
    by = (np.asarray(moved.value) - np.asarray(e.value)) * per_shift
    return np.where(np.isfinite(by), by, 0.0)


def _with_thickness(e: Estimate, by: np.ndarray, ends: tuple[float, float]) -> Estimate:
    """Return the estimate with the error of the thickness added. ends: those of its range."""
    own = np.asarray(e.sigma)
    sigma = np.hypot(own, by)
    with np.errstate(all="ignore"):
        wider = np.where(own > 0.0, sigma / own, 1.0)
    value = np.asarray(e.value)[..., None]
    interval = np.clip(value + (e.interval - value) * wider[..., None], *ends)
    limit = np.where(np.isfinite(e.upper_limit), interval[..., 1], np.nan)
    return replace(e, sigma=sigma, interval=interval, upper_limit=limit)
