"""A film whose eta and k are free at every wavelength, with one thickness that all of them share.

For a given thickness every wavelength is a fit by itself (`wavelengths`); the best thickness has
the lowest sum of their costs (`thickness_profile`). This needs more than two numbers at a
wavelength: psi and Delta at one angle give an eta and a k for any thickness. The errors of eta and
k include that of the thickness.

Source: the point-by-point fit with a common thickness of H. G. Tompkins and E. A. Irene (eds.),
Handbook of Ellipsometry (2005), sec. 3.4.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fitting.data.measurement import Measurement
from fitting.problem.problem import FitOptions
from fitting.results.diagnostics import Finding
from fitting.results.result import FitData
from fitting.results.result_parts import NONE, QUADRATIC, SHARED, Estimate
from fitting.samples.parameters import Settings
from fitting.samples.sample import FREE, Sample
from fitting.thickness_profile import best_within_error, shared_thickness
from fitting.uncertainty.widening import ranges, wider
from fitting.wavelengths import check_wavelengths, each_wavelength, fit_wavelengths


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
    d = sample.media[which].thickness
    assert d is not None
    ends = 1e3 * d.low_um, 1e3 * d.high_um
    waves = each_wavelength(measurement, _held(sample, which, ends[0]), settings, asked)
    name, u = f"{sample.places[which]}.thickness_nm", waves.job.u
    row = u.spec.held.index(name)
    shared = shared_thickness(waves, row, sample.places[which], ends)
    best, sigma = shared.nm, shared.sigma
    found = fit_wavelengths(measurement, _held(sample, which, best), settings, asked)
    label = u.labels[name]
    wide = sigma > 0.3 * (ends[1] - ends[0]) or not np.isfinite(sigma)
    if not wide and any(f.code == "chi2_large" for f in found.findings):
        # No index with k >= 0 may describe the data at a thickness that is too small by its error.
        best = best_within_error(waves, row, shared.nm, sigma, ends)
        if best != shared.nm:
            found = fit_wavelengths(measurement, _held(sample, which, best), settings, asked)
    if not wide:
        shift = min(sigma, 0.2 * best)
        beside = _held(sample, which, best + shift)
        plain = asked._replace(intervals=QUADRATIC)
        moved = fit_wavelengths(measurement, beside, settings, plain, near=found)
        found = _with_thickness(found, moved, sigma / shift)
    parameters = {n: e for n, e in found.parameters.items() if n != label}
    of_film = [u.labels[f"{sample.places[which]}.{n}"] for n in ("eta", "k")]
    errors = [np.broadcast_to(parameters[n].sigma, found.shape) for n in of_film]
    parameters[label] = Estimate(
        name=label, unit="nm", value=best, sigma=np.nan if wide else sigma,
        interval=np.full(2, np.nan) if wide else np.clip(shared.interval, *ends),
        interval_kind=NONE if wide else QUADRATIC, status=SHARED,
    )  # fmt: skip
    findings, everywhere = found.findings, np.ones(found.shape, bool)
    if wide:
        findings = (Finding("shared_not_seen", everywhere, {"parameter": label}), *findings)
    elif shared.others:
        others, rises = zip(*shared.others, strict=True)
        values = {"parameter": label, "values": others, "delta_chi2": rises}
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
