"""A film whose eta and k are free at every wavelength, with one thickness that all of them share.

For a given thickness every wavelength is a fit by itself (`wavelengths`); the best thickness has
the lowest sum of their costs. This needs more than two numbers at a wavelength: psi and Delta at
one angle give an eta and a k for any thickness. The errors of eta and k include that of the
thickness.

Source: the point-by-point fit with a common thickness of H. G. Tompkins and E. A. Irene (eds.),
Handbook of Ellipsometry (2005), sec. 3.4.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from fitting.data.measurement import Measurement
from fitting.problem.lanes import LANES, Limits
from fitting.problem.problem import FitOptions
from fitting.results.diagnostics import Finding
from fitting.results.result import FitData
from fitting.results.result_parts import NONE, QUADRATIC, SHARED, Estimate
from fitting.samples.parameters import Settings
from fitting.samples.sample import FREE, Sample
from fitting.searching.batch_search import BatchSearch
from fitting.searching.fringes import local_minima
from fitting.searching.minima import alternative_chi2
from fitting.searching.starts import starts as start_points
from fitting.uncertainty.limits import student_quantile
from fitting.uncertainty.widening import ranges, wider
from fitting.wavelengths import Wavelengths, check_wavelengths, each_wavelength, fit_wavelengths

# The thickness is first scanned in _GRID steps, each wavelength from _STARTS starts. At most
# _CLOSER finer scans of _WITHIN steps follow, each a third as wide, until the cost beside the best
# thickness is higher by less than _NEAR of the scatter, which is within two standard errors. A
# second scan there, with k of either sign, ends at less than _FLAT: within .03 standard errors.
_STARTS, _GRID, _CLOSER, _WITHIN = 16, 25, 14, 7
# Before these, one finer scan in each of so many valleys: the lowest one may be narrow.
_VALLEYS = (3, 2)
_NEAR, _FLAT = 4.0, 1e-3
# So many thicknesses of the scan follow one another, each from the solutions at the one before it.
_CHAIN = 5
# Of the starts those from so many wavelengths on either side, at the nearest thickness known.
_BESIDE = 3
# With k >= 0 at every wavelength a transparent film would seem too thick, by two standard errors
# for 30 wavelengths: there k can follow a larger thickness, but not a smaller one. So the thickness
# is determined with the k that the data ask for, down to this one.
_LEAST_K = -0.1


def free_film(sample: Sample) -> int | None:
    """Return which medium is a film that is free at every wavelength and of free thickness."""
    for i, medium in enumerate(sample.media):
        d = medium.thickness
        if medium.index == FREE and d is not None and d.coherent and not d.held:
            return i
    return None


def check_free_film(
    measurement: Measurement, sample: Sample, which: int, settings: Settings
) -> None:
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
    known = {*settings.fixed, *settings.tie}
    wanted = [
        f"{prefix}{n}"
        for prefix, place, m in zip(sample.prefixes, sample.places, sample.media, strict=True)
        for n in ("eta", "k") if m.index == FREE and not {f"{prefix}{n}", f"{place}.{n}"} & known
    ]  # fmt: skip
    waves = np.unique(measurement.wavelength_um)
    if len(measurement) > len(wanted) * len(waves):
        return
    names = dict.fromkeys(measurement.quantity.tolist())
    each = len(measurement) / len(waves)
    raise ValueError(
        f"{measurement.source}: there are {each:.3g} data at each wavelength "
        f"({', '.join(names)}), with which {' and '.join(wanted)} can be found for any thickness. "
        "Add a second angle or a further quantity; or write 'held' after a thickness that is "
        "known; or give the film a dispersion model (cauchy, tauc-lorentz)."
    )


def _check_settings(
    measurement: Measurement, sample: Sample, which: int, settings: Settings, asked: FitOptions
) -> None:
    """Raise ValueError for settings that would be without effect, or act on each wavelength alone.

    The thickness is scanned and not fitted, so that only the sample says what is known of it. The
    fits at one thickness do not estimate the noise, which a prior and a robust loss are compared
    with: without stated errors the one would outweigh all data and the other act on none.
    """
    shown, full = (f"{x}thickness_nm" for x in (sample.prefixes[which], f"{sample.places[which]}."))
    if {shown, full} & {*settings.fixed, *settings.bounds, *settings.priors, *settings.tie}:
        raise ValueError(
            f"the sample {str(sample)!r} says what is known of {shown}, since its eta and k are "
            f"free at every wavelength: write '{FREE} 100..200 nm' for bounds, or "
            f"'{FREE} 150 nm held' for a thickness that is known."
        )
    check_wavelengths(measurement, settings)
    stated = asked.errors != "equal" and np.isfinite(measurement.sigma).all()
    if not stated and (settings.priors or asked.loss != "squares"):
        what = "a prior" if settings.priors else f"the loss {asked.loss!r}"
        raise ValueError(
            f"{what} needs a standard error for every datum where the thickness and an index that "
            "is free at every wavelength are fitted together. Give the errors (sigma) and use "
            "them, or write 'held' after a thickness that is known."
        )


class _Profile(NamedTuple):
    """The sum of the lowest costs of all wavelengths over thickness, (D,) each, in rising order.

    scatter: the unit of a rise of the cost. dof: degrees of freedom from which it was estimated, 0
    where it was stated. y: (p, D, W) where the wavelengths ended.
    """

    thickness_nm: np.ndarray
    cost: np.ndarray
    scatter: float
    dof: int
    y: np.ndarray

    @property
    def best(self) -> int:
        """The place of the best thickness."""
        return int(np.argmin(self.cost))


def _costs(
    waves: Wavelengths, row: int, limits: Limits, thickness_nm: np.ndarray, near: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the lowest costs of all wavelengths at thicknesses (D,), and where they are.

    row: of the thickness among the constants of the fits. near: (p, D, W) starts of each
    wavelength and those beside it, or (p, D, 0).
    """
    job, count, many = waves.job, waves.curves.count, len(thickness_nm)
    curves = waves.curves.at(np.tile(np.arange(count), many))
    curves.own["held"][row] = np.repeat(thickness_nm, count)
    usual = start_points(job.u.moving, LANES, job.asked.seed)[:, None, None]
    start = np.broadcast_to(usual, (len(usual), many, count, LANES))
    if near.shape[2]:
        beside = np.arange(count)[:, None] + np.arange(-_BESIDE, _BESIDE + 1)
        start = np.concatenate([near[:, :, beside.clip(0, count - 1)], start], 3)
    search = BatchSearch(job, curves, limits)
    start = start[..., :_STARTS].reshape(len(start), -1)
    search.run(start, np.repeat(np.arange(curves.count), _STARTS))
    y = search.best.y.reshape(len(start), many, count)
    return search.best.cost.reshape(many, count).sum(1), y


def _profile(
    waves: Wavelengths, row: int, limits: Limits, places: np.ndarray, flat: float,
    near: np.ndarray | None = None,
) -> _Profile:  # fmt: skip
    """Return the costs at thicknesses (D,), and at others ever closer to the best one.

    Until the cost beside the best one is higher by less than ``flat`` of the scatter. near: (p, W),
    starts at the first thickness.
    """
    job, count = waves.job, waves.curves.count
    dof = max(int(BatchSearch(job, waves.curves).dof.sum()) - 1, 1)
    estimated = job.asked.scaled or not waves.curves.stated.all()
    p = _Profile(np.empty(0), np.empty(0), 1.0, dof * estimated, np.empty((job.u.size, 0, count)))

    def look(places: np.ndarray) -> None:
        nonlocal p
        off = np.abs(places[:, None] - p.thickness_nm)
        # A place that differs from the best one by rounding only would become its neighbour, and
        # hide those beyond.
        new = (off > 1e-10 * places[:, None]).all(1)
        if not new.any():
            return
        begun = np.empty((job.u.size, int(new.sum()), 0))
        if len(p.cost):
            begun = p.y[:, off[new].argmin(1)]
        elif near is not None:
            begun = np.repeat(near[:, None], new.sum(), 1)
        cost, y = _costs(waves, row, limits, places[new], begun)
        thickness = np.append(p.thickness_nm, places[new])
        order = np.argsort(thickness)
        cost, y = np.append(p.cost, cost)[order], np.concatenate([p.y, y], 1)[:, order]
        scatter = max(cost.min() / dof if estimated else 1.0, 1e-24 * job.squares)
        p = _Profile(thickness[order], cost, scatter, p.dof, y)

    # Each from the one before it, _CHAIN in a row; all at once where a start is known.
    chain = _CHAIN if near is None else 1
    for first in range(chain):
        look(places[first::chain])
    for several in (*_VALLEYS, *[1] * _CLOSER):
        low = np.flatnonzero(local_minima(p.cost))
        low = low[np.argsort(p.cost[low], kind="stable")][:several]
        ends = np.clip([low - 1, low + 1], 0, len(p.cost) - 1)
        if p.cost[ends[:, 0]].max() - p.cost[low[0]] < flat * p.scatter:
            break
        for first, last in p.thickness_nm[ends].T:
            look(np.linspace(first, last, _WITHIN))
    return p


def _error(p: _Profile) -> float:
    """Return the standard error of the thickness, over which the cost rises by the scatter.

    A parabola through the valley of the best one: another valley may be as low.
    """
    rise = (p.cost - p.cost[p.best]) / p.scatter
    valley = np.cumsum(rise >= 9.0)
    near = (valley == valley[p.best]) & (rise < 9.0)
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
    out = []
    for i in np.flatnonzero(local_minima(rise) & (rise < alternative_chi2(p.dof))):
        between = rise[min(i, p.best) : max(i, p.best) + 1]
        if i != p.best and between.max() > rise[i] + 1.0:
            out.append((float(p.thickness_nm[i]), float(rise[i])))
    return tuple(out)


def _shared_thickness(
    waves: Wavelengths, row: int, k: str, ends: tuple[float, float]
) -> tuple[_Profile, float]:
    """Return the costs around the thickness between two that fits best, and its standard error.

    k: name of that of the film.
    """
    grid = np.geomspace if ends[1] > 4.0 * ends[0] else np.linspace
    p = _profile(waves, row, waves.job.limits, grid(*ends, _GRID), _NEAR)
    best, sigma = p.thickness_nm[p.best], _error(p)
    if not np.isfinite(sigma):
        return p, sigma
    around = np.clip(best + sigma * np.linspace(-6.0, 6.0, _WITHIN), *ends)
    around = np.append(around[np.argsort(np.abs(around - best))], ends)
    low, high = waves.job.limits
    own = np.array([name == k for name in waves.job.u.spec.moving])
    # Unless it is fixed at 0.
    either_sign = np.where(own & (low == 0.0) & (high > 0.0), _LEAST_K, low), high
    p = _profile(waves, row, either_sign, around, _FLAT, p.y[:, p.best])
    return p, _error(p)


def _held(sample: Sample, which: int, thickness_nm: float) -> Sample:
    """Return the sample with the thickness of the film fixed at this value."""
    media = list(sample.media)
    d = media[which].thickness
    assert d is not None
    held = d._replace(start_um=1e-3 * thickness_nm, low_um=0.0, high_um=np.inf, held=True)
    media[which] = media[which]._replace(thickness=held)
    return Sample(tuple(media))


def fit_free_film(
    measurement: Measurement, sample: Sample, which: int, settings: Settings, asked: FitOptions
) -> FitData:
    """Return the fit of batch shape (W,), with the shared thickness among its parameters.

    which: of the media is the film; see `free_film`.
    """
    _check_settings(measurement, sample, which, settings, asked)
    d, place = sample.media[which].thickness, sample.places[which]
    assert d is not None
    ends = 1e3 * d.low_um, 1e3 * d.high_um
    waves = each_wavelength(measurement, _held(sample, which, ends[0]), settings, asked)
    u = waves.job.u
    label, row = u.labels[f"{place}.thickness_nm"], u.spec.held.index(f"{place}.thickness_nm")
    p, sigma = _shared_thickness(waves, row, f"{place}.k", ends)
    lowest = best = float(p.thickness_nm[p.best])
    # The noise is that of the stated errors, see `_check_settings`.
    fit_held = partial(fit_wavelengths, by_noise=False)
    found = fit_held(measurement, _held(sample, which, best), settings, asked)
    wide = sigma > 0.3 * (ends[1] - ends[0]) or not np.isfinite(sigma)
    if not wide and any(f.code == "chi2_large" for f in found.findings):
        # No index with k >= 0 may describe the data at a thickness that is too small by its error.
        places = np.append(best, best + sigma * np.linspace(-1.0, 1.0, _WITHIN - 1)).clip(*ends)
        none = np.empty((u.size, len(places), 0))
        cost, _ = _costs(waves, row, waves.job.limits, places, none)
        if cost.min() < cost[0] - _NEAR:
            best = float(places[np.argmin(cost)])
            found = fit_held(measurement, _held(sample, which, best), settings, asked)
    if not wide:
        shift = min(sigma, 0.2 * best)
        beside = _held(sample, which, best + shift)
        plain = asked._replace(intervals=QUADRATIC)
        moved = fit_held(measurement, beside, settings, plain, near=found)
        found = _with_thickness(found, moved, sigma / shift)
    parameters = {n: e for n, e in found.parameters.items() if n != label}
    of_film = [u.labels[f"{place}.{n}"] for n in ("eta", "k")]
    errors = [np.broadcast_to(parameters[n].sigma, found.shape) for n in of_film]
    half = student_quantile(p.dof) * sigma * np.array([-1.0, 1.0])
    parameters[label] = Estimate(
        name=label, unit="nm", value=best, sigma=np.nan if wide else sigma,
        interval=np.full(2, np.nan) if wide else np.clip(lowest + half, *ends),
        interval_kind=NONE if wide else QUADRATIC, status=SHARED,
    )  # fmt: skip
    findings, everywhere = found.findings, np.ones(found.shape, bool)
    text, film = str(sample), str(sample.media[which])
    if wide:
        held = f"{FREE} {best:.4g} nm held"
        values = {"parameter": label, "held": text.replace(film, held),
                  "formula": str(sample.with_model("cauchy-urbach", FREE))}  # fmt: skip
        findings = (Finding("shared_not_seen", everywhere, values), *findings)
    elif several := _others(p):
        others, rises = zip(*several, strict=True)
        other = others[np.argmin(rises)]
        half = 0.4 * abs(other - best)
        around = f"{FREE} {max(other - half, ends[0]):.4g}..{other + half:.4g} nm"
        values = {"parameter": label, "values": others, "delta_chi2": rises,
                  "other": text.replace(film, around)}  # fmt: skip
        findings = (Finding("other_thickness", everywhere, values), *findings)
    return replace(
        found, sample=sample, parameters=parameters, findings=findings,
        evaluator=found.evaluator.with_errors(np.stack(errors, -1)),  # type: ignore
    )  # fmt: skip


def _with_thickness(found: FitData, moved: FitData, per_shift: float) -> FitData:
    """Return the fit (W,) with the error of the thickness in all errors.

    moved: the fit at another thickness. per_shift: the standard error over that difference.
    """
    parameters, ends, columns = dict(found.parameters), ranges(found), []
    for n, e in found.parameters.items():
        if not np.ndim(e.value):
            continue
        by = np.nan_to_num((moved.parameters[n].value - e.value) * per_shift, posinf=0, neginf=0)
        with np.errstate(all="ignore"):
            factor = np.where(e.sigma > 0.0, np.hypot(e.sigma, by) / e.sigma, 1.0)
        parameters[n] = wider(e, factor, ends.get(n, (-np.inf, np.inf)))
        if e.free:
            columns.append(by)
    by_all = np.stack(columns, -1)
    covariance = found.covariance + by_all[..., :, None] * by_all[..., None, :]
    return replace(found, parameters=parameters, covariance=covariance)
