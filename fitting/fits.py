"""`fit`: any sample fitted to any measured quantities.

    minimise over the parameters   sum_i loss[(predicted_i - value_i) / sigma_i] + priors

All fits go the same way from parameters to the result (see the map in CONTRIBUTING.md).

Fits run in float64, whether or not the caller has switched on jax_enable_x64.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from fitting.data.measurement import Measurement, concatenate
from fitting.data.quantities import POWERS
from fitting.fit_result import Fit
from fitting.free_films import check_free_film, fit_free_film, free_film
from fitting.misfit_causes import explained, misses_of_files
from fitting.outcomes.doubtful_index import notes_on
from fitting.outcomes.findings import Subject, with_headline
from fitting.outcomes.of_fit import Ended, fits_of
from fitting.problem.observations import missing_errors
from fitting.problem.problem import FitOptions, Kept
from fitting.residuals.error_model import NEED_STATED, RELATIVE
from fitting.results.diagnostics import Finding, ranked
from fitting.results.result import FitData
from fitting.results.result_parts import AT_LOWER, AT_UPPER, CONVERGED, MISFIT
from fitting.samples.parameters import Settings, check_search, settings_of
from fitting.samples.sample import Sample
from fitting.samples.sample_checks import check_fit
from fitting.searching.fewer_rows import with_fewer_rows
from fitting.searching.film_starts import film_starts, films_of
from fitting.searching.search import searched
from fitting.searching.starts import starts as start_points
from fitting.searching.starts import usual_starts, with_given_start
from fitting.uncertainty.intervals import QUADRATIC, check_choices
from fitting.uncertainty.likelihood import MARGIN
from fitting.uncertainty.stated_errors import covering, of_measurements, with_error_model
from fitting.uncertainty.widening import widened
from fitting.wavelengths import check_wavelengths, fit_wavelengths, problem_of


def measurements_of(measurement: Any) -> tuple[Measurement, ...]:
    """Return the measurements as a tuple, or raise ValueError for anything else."""
    many = isinstance(measurement, list | tuple | Iterator)
    several = tuple(measurement) if many else (measurement,)
    if not several:
        raise ValueError("the list of measurements is empty; one or more were wanted.")
    for m in several:
        if not isinstance(m, Measurement):
            raise ValueError(
                f"{type(m).__name__} came where a Measurement was wanted, or a list of them. "
                "Read files, buffers and data frames first: fit(read_csv(table)); arrays: "
                "fit(Measurement.from_columns(angle_deg, wavelength_um, R=...))."
            )
    return several


def checked_sample(measurements: Sequence[Measurement], sample: Sample) -> Sample:
    """Return the sample with the knots of its splines, or raise ValueError if no data fit it."""
    if sample.open:
        raise ValueError(
            f"the sample {str(sample)!r} leaves its dispersion model open (auto): use choose, or "
            "name a model."
        )
    sample = sample.with_splines(np.concatenate([m.wavelength_um for m in measurements]))
    check_fit(measurements, sample)
    return sample


def _shared(
    measurements: Sequence[Measurement], sample: Sample, settings: Settings, asked: FitOptions
) -> Ended:
    """Return the fit of shared parameters, searched."""
    job = problem_of(measurements, sample, settings, asked)
    u = job.u
    if not u.free.any():
        raise ValueError(
            f"every parameter of the sample {str(sample)!r} is known, fixed or tied. Leave one "
            "free, or give the sample a dispersion model, 'free' or a thickness to be fitted."
        )
    film = bool(films_of(u.spec, u.moving))
    count = usual_starts(int(u.free.sum()), film) if asked.starts is None else asked.starts
    points = start_points(u.moving, count, asked.seed)
    points = with_given_start(points, u.moving, u.labels, asked.start)
    few = with_fewer_rows(job, sample, measurements)
    if asked.starts is None:
        points = np.concatenate([points, film_starts(few, points)], 1)
    ends, noise = searched(job, few, points)
    return Ended(job, ends, noise, Subject(sample, concatenate(*measurements)))


def fit_checked(
    measurements: Sequence[Measurement], sample: Sample, settings: Settings, asked: FitOptions
) -> FitData:
    """Return `fit` for checked arguments."""
    without = sum(int((~np.isfinite(m.sigma)).sum()) for m in measurements)
    if asked.errors in NEED_STATED and without:
        raise ValueError(
            f'errors "{asked.errors}" need a standard error for every datum, and {without} of '
            f"{sum(map(len, measurements))} have none. Give them (sigma), or take errors "
            '"scaled" or "equal".'
        )
    quantities = {q for m in measurements for q in m.quantity.tolist()}
    if asked.errors == RELATIVE and not quantities & set(POWERS):
        raise ValueError(
            f'errors "relative" are in proportion to R and T, and the data are '
            f'{" and ".join(sorted(quantities))}. Take errors "floor" or "scaled".'
        )
    sample = checked_sample(measurements, sample)
    found = _general(measurements, sample, settings, asked)
    run = partial(_general, measurements, sample)
    found, settings = _beyond_ranges(run, found, settings, asked)

    def again(several: Sequence[Measurement], intervals: str) -> FitData:
        # Other weights move the minima little.
        near = asked._replace(intervals=intervals, near=asked.kept_as)
        return _general(several, sample, settings, near)

    if not settings.priors and asked.loss == "squares":
        one = of_measurements(again, measurements, found, asked.intervals)
        found = with_error_model(one, asked.errors)
    missing, misses = (
        missing_errors(measurements, asked.errors),
        misses_of_files(measurements, found),
    )
    notes, pseudo = notes_on(found)
    found = replace(
        found, notes=(*missing, *notes, *misses), findings=ranked([*found.findings, *pseudo])
    )
    if asked.errors != "auto":
        return found
    found = with_headline(widened(found))
    far = np.any(np.equal(found.status, MISFIT)) and found.loss == "squares"
    if far and not missing and not settings.priors and found.errors.stated and asked.thorough:
        return covering(again, measurements, found)
    return found


# Which end of the default ranges of Cauchy's coefficients a fit may leave, and for which range.
_WIDER = {"A": (AT_UPPER, (1.0, 100.0)), **dict.fromkeys("BCDEFGH", (AT_LOWER, (-1e9, np.inf)))}


def _beyond_ranges(
    run: Callable[[Settings, FitOptions], FitData], found: FitData, settings: Settings,
    asked: FitOptions,
) -> tuple[FitData, Settings]:  # fmt: skip
    """Return the fit beyond default ranges, if chi2 is lower there by more than noise decides."""
    bounded, left = {n.rpartition(".")[2] for n in settings.bounds}, {}
    for name, e in () if found.shape else found.parameters.items():
        last = name.rpartition(".")[2]
        end, wide = _WIDER.get(last, ("", None))
        if e.status == end and last not in bounded:
            left[name] = wide
    settings, inside = settings._replace(bounds={**settings.bounds, **left}), settings
    if not left:
        return found, inside
    quick = asked._replace(intervals=QUADRATIC, thorough=False, near=asked.kept_as)
    quick = quick._replace(kept_as=f"{asked.kept_as} beyond its range")
    beyond = with_headline(run(settings, quick))
    # Of a sample that is not the true one an index that no solid has tells nothing.
    if not (gain := found.bic - beyond.bic) > MARGIN or beyond.status != CONVERGED:
        return found, inside
    best = run(settings, asked._replace(near=quick.kept_as))
    values = {"parameters": tuple(left), "gain": gain}
    for key, of in (("values", best), ("ends", found)):
        values[key] = tuple(float(of.parameters[n].value) for n in left)
    told = Finding("range_left", np.True_, values)
    return replace(best, findings=ranked([*best.findings, told])), settings


def _general(
    measurements: Sequence[Measurement], sample: Sample, settings: Settings, asked: FitOptions
) -> FitData:
    """Return the fit of a general sample, with its stated errors or one factor on them."""
    joined, film = concatenate(*measurements), free_film(sample)
    waves = np.unique(joined.wavelength_um)
    if film is not None:
        check_free_film(joined, sample, film, settings)
    # At one wavelength nothing is shared: thickness, eta and k are three unknowns of one fit.
    if not sample.by_wavelength or len(waves) == 1:
        return fits_of([_shared(measurements, sample, settings, asked)])
    if film is not None:
        return fit_free_film(joined, sample, film, settings, asked)
    check_wavelengths(joined, settings)
    return fit_wavelengths(joined, sample, settings, asked)


def fit(
    measurement: Measurement | Sequence[Measurement],
    sample: str | Sample = "free",
    *,
    free: str | Iterable[str] = (),
    fixed: Mapping[str, float] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    priors: Mapping[str, tuple[float, float]] | None = None,
    tie: Mapping[str, str] | None = None,
    loss: str = "squares",
    errors: str = "auto",
    intervals: str = "auto",
    starts: int | None = None,
    start: Mapping[str, Any] | None = None,
    seed: int = 0,
) -> Fit:
    """Return a sample fitted to a measurement: its parameters, and how well they are known.

    Args:
        measurement: one, or several that share all parameters but scale and background.
        sample: a `Sample` or its text: "free" (one bare surface, eta and k at every wavelength),
            "cauchy" (one bare surface with that dispersion), "air | cauchy 3 mm thick | air", ...
            The first medium is that which the light comes from; without it air, index 1.
        free: names of parameters to fit that are fixed by default: of the instrument "scale" and
            "background" (one for each curve), "angle_offset", "wavelength_offset", "leak",
            "divergence", "bandwidth"; "edge_ev"; the thickness of a thick layer.
        fixed, bounds, priors: name -> value; (low, high); (value, standard error). "scale" is all
            scales, "scale[R_s]" that of R_s, in every file.
        tie: name -> another name, or a multiple: {"film_2.A": "film_1.A", "substrate.k": "2 *
            film.k"}.
        loss: "squares"; "huber" for data with outliers, with the noise found from the residuals
            unless errors="stated".
        errors: how the stated errors are used. "stated": as they are. "scaled": multiplied by
            sqrt(chi2 / dof). "floor": one common error is added to them in squares. "relative": an
            error in proportion to each fitted R or T is. "equal": not at all, all data have equal
            weights. "auto": scaled, or where they are far too small the likeliest of scaled, floor
            and relative; without stated errors each of R_s, R_p, R, T, ... has the scatter of its
            own where these differ.
        intervals: how 95 % intervals are found: "quadratic" (from the standard errors), "profile"
            (profile likelihood), or "auto": profile likelihood where the quadratic approximation
            fails.
        starts, seed: number of quasi-random starting points (None: by the number of unknowns), and
            the seed of their sequence. A bare surface starts from a mesh instead.
        start: name -> value of one additional starting point.

    Returns:
        `Fit`, of batch shape () for shared parameters or one wavelength, else (W,).
        From data without noise eta of a bare surface is found to about 1e-14, k above .01 to 3e-11.

    Raises:
        ValueError: for names, values and quantities that are wrong or do not go together.
    """
    measurements = measurements_of(measurement)
    if isinstance(sample, str) and " or " in sample:
        raise ValueError(f"{sample!r} is more than one sample: use choose, or name one of them.")
    which = Sample.parse(sample)
    check_choices(loss, errors, intervals)
    check_search(starts, start, seed)
    settings = settings_of(free, fixed, bounds, priors, tie)
    asked = FitOptions(errors, intervals, loss, seed, Kept({}, {}), starts, start)
    found = fit_checked(measurements, which, settings, asked)
    again = partial(fit_checked, measurements)
    return Fit.of(explained(again, which, settings, asked, with_headline(found)))
