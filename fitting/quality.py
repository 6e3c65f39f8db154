"""How well a fit describes the data, and which errors it used."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from fitting.diagnostics import Warning
from fitting.dispersion import Model
from fitting.evaluation import at_data
from fitting.findings import Quality
from fitting.known_media import Mixture
from fitting.measurement import Measurement, concatenate
from fitting.pattern import pattern
from fitting.quantities import are_powers
from fitting.result import ErrorModel
from fitting.sample import Sample
from fitting.search import End, Solving
from fitting.uncertainty.covariance import Slopes
from fitting.uncertainty.likelihood import reduced_chi2


class Subject(NamedTuple):
    """What is fitted, and the notes on it that do not depend on the result."""

    sample: Sample | None
    measurements: tuple[Measurement, ...]
    notes: tuple[Warning, ...] = ()


def _one_power_a_wavelength(measurements: Sequence[Measurement]) -> bool:
    """Whether every wavelength has a single value, and that one of R or T."""
    wavelength = np.concatenate([m.wavelength_um for m in measurements])
    quantity = np.concatenate([m.quantity for m in measurements])
    angle = np.concatenate([m.angle_deg for m in measurements])
    if not are_powers(quantity).all():
        return False
    points = {*zip(wavelength.tolist(), quantity.tolist(), angle.tolist(), strict=True)}
    normal = bool((angle == 0.0).all()) and len(set(quantity.tolist())) == 1
    return normal or len(points) == len(np.unique(wavelength))


def rms_of_residuals(s: Slopes) -> tuple[float, dict[str, float]]:
    of = {k: float(np.sqrt(np.mean(s.plain[s.kind == k] ** 2))) for k in dict.fromkeys(s.kind)}
    return float(np.sqrt(np.mean(s.plain**2))), {str(k): v for k, v in of.items()}


def error_model_of(fit: Solving, end: End) -> ErrorModel:
    """Return which errors of the data the fit used."""
    taken = fit.asked.errors
    if taken != "stated":
        # Without a degree of freedom only the stated errors are available.
        alone = "scaled" if fit.dof else "stated"
        taken = alone if fit.seen.stated else "equal"
    with np.errstate(invalid="ignore"):
        factor = float(np.sqrt(end.known.variance))
    return ErrorModel(taken, factor, 0.0, fit.seen.stated)


def own_quality(
    fit: Solving, end: End, scatter_of: tuple[int, float], others: Sequence[Any]
) -> Quality:
    """Return the quality for the caller's own residuals, whose rows have no angle or wavelength."""
    s, robust = end.slopes, fit.u.spec.loss != "squares"
    size = reduced_chi2(fit.u.spec.loss, s.residual, fit.dof) if fit.seen.stated else np.nan
    return Quality(
        chi2_reduced=size, dof=fit.dof, n_data=fit.n_data, stated=fit.seen.stated,
        errors=error_model_of(fit, end).taken, rms=0.0, robust=robust, starts=fit.starts,
        reached=scatter_of[0], lower=scatter_of[1], pattern=None, by_the_model_alone=False,
        sample="your model",
        others=tuple({n: e.value for n, e in a.parameters.items()} for a in others),
        delta_chi2=float(others[0].delta_chi2) if others else np.nan,
    )  # fmt: skip


def quality(
    fit: Solving, of: Subject, end: End, scatter_of: tuple[int, float], others: Sequence[Any]
) -> Quality:
    """Return how well the fit describes the data. scatter_of: reached, and the lower chi2 met."""
    u, seen, s = fit.u, fit.seen, end.slopes
    robust = u.spec.loss != "squares"
    size = reduced_chi2(u.spec.loss, s.residual, fit.dof) if seen.stated else np.nan
    wavelengths = len(np.unique(np.concatenate([m.wavelength_um for m in of.measurements])))
    free = int(u.free.sum())
    alone = wavelengths == 1 and free > 1 and not end.known.unseen.size
    absorbs = any(m.absorbs for m in u.spec.media.index if isinstance(m, Model | Mixture))
    joined = concatenate(*of.measurements)
    fitted = at_data(seen, s.seen)
    return Quality(
        chi2_reduced=size, dof=fit.dof, n_data=fit.n_data, stated=seen.stated,
        errors=error_model_of(fit, end).taken, rms=rms_of_residuals(s)[0], robust=robust,
        starts=fit.starts,
        reached=scatter_of[0], lower=scatter_of[1],
        pattern=pattern(joined, fitted, seen.curve, seen.stated),
        by_the_model_alone=_one_power_a_wavelength(of.measurements) and absorbs and not alone,
        sample=describes(of.sample) if of.sample else "your model",
        others=tuple({n: e.value for n, e in a.parameters.items()} for a in others),
        delta_chi2=float(others[0].delta_chi2) if others else np.nan,
        shortest_nm=_shortest_nm(of, joined),
    )  # fmt: skip


def _shortest_nm(of: Subject, joined: Measurement) -> float:
    """Return the shortest wavelength for a sample with films; infinite for others."""
    films = of.sample is not None and of.sample.films
    return 1e3 * float(np.nanmin(joined.wavelength_um)) if films else np.inf


def describes(sample: Sample) -> str:
    """Return a description of the sample in words."""
    if sample.bare:
        return "one bare surface"
    return "this plate" if not any(m.coherent for m in _layers(sample)) else "this stack"


def _layers(sample: Sample) -> list[Any]:
    return [m.thickness for m in sample.layers]
