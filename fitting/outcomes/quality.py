"""How well a fit describes the data, and which errors it used."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fitting.measurements.measurement import Measurement, concatenate
from fitting.measurements.quantities import are_powers
from fitting.outcomes.findings import Quality
from fitting.outcomes.normal_dispersion import rising_indices
from fitting.problem.evaluation import at_data
from fitting.problem.unknowns import Unknowns
from fitting.residuals.pattern import pattern
from fitting.results.diagnostics import Warning
from fitting.results.result import Alternative, ErrorModel
from fitting.samples.dispersion import CAUCHY_NAMES, Model
from fitting.samples.known_media import Mixture
from fitting.samples.sample import Sample
from fitting.searching.search import End, Solving
from fitting.uncertainty.covariance import Slopes
from fitting.uncertainty.likelihood import reduced_chi2


class Subject(NamedTuple):
    """What is fitted, and the notes on it that do not depend on the result."""

    sample: Sample | None
    measurements: tuple[Measurement, ...]
    notes: tuple[Warning, ...] = ()


def _a_k_is_free(u: Unknowns) -> bool:
    """Whether the fit determines the k of a medium; numbers are held, with k too."""
    free = {name for name, w in zip(u.spec.moving, u.moving, strict=True) if w.free}
    return any(
        index.absorbs and any(_acts_on_k(name, place) for name in free)
        for place, index in zip(u.spec.media.places, u.spec.media.index, strict=True)
        if isinstance(index, Model | Mixture)
    )


def _acts_on_k(name: str, place: str) -> bool:
    of, _, parameter = name.rpartition(".")
    # Cauchy's terms are of eta, and k beside them is that of an Urbach tail.
    others = ("eta", *CAUCHY_NAMES, "thickness_nm", "thickness_um", "grade")
    return of == place and parameter not in others and not parameter.startswith("fraction")


def _by_the_model_alone(u: Unknowns, m: Measurement, end: End) -> bool:
    """Whether k comes from the model: every wavelength has a single value, and that one of R or T.

    At one wavelength two unknowns that the data determine are k too.
    """
    if not _a_k_is_free(u):
        return False
    waves = len(np.unique(m.wavelength_um))
    if not are_powers(m.quantity).all() or (
        waves == 1 and u.free.sum() > 1 and not end.known.unseen.size
    ):
        return False
    columns = m.wavelength_um.tolist(), m.quantity.tolist(), m.angle_deg.tolist()
    normal = not m.angle_deg.any() and len(set(m.quantity.tolist())) == 1
    return normal or len({*zip(*columns, strict=True)}) == waves


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


def quality(
    fit: Solving, of: Subject, end: End, reached: int, lower: float, others: Sequence[Alternative]
) -> Quality:
    """Return how well the fit describes the data; reached, lower: see `Quality`.

    The rows of the caller's own residuals have no angle or wavelength.
    """
    u, seen, s = fit.u, fit.seen, end.slopes
    joined = concatenate(*of.measurements) if of.measurements else None
    films = of.sample is not None and of.sample.films
    return Quality(
        chi2_reduced=reduced_chi2(u.spec.loss, s.residual, fit.dof) if seen.stated else np.nan,
        dof=fit.dof, n_data=fit.n_data, stated=seen.stated, errors=error_model_of(fit, end).taken,
        rms=0.0 if joined is None else rms_of_residuals(s)[0], robust=u.spec.loss != "squares",
        starts=fit.starts, reached=reached, lower=lower,
        pattern=None if joined is None
        else pattern(joined, at_data(seen, s.seen), seen.curve, seen.stated),
        by_the_model_alone=joined is not None and _by_the_model_alone(u, joined, end),
        sample="your model" if of.sample is None else describes(of.sample),
        others=tuple({n: e.value for n, e in a.parameters.items()} for a in others),
        delta_chi2=float(others[0].delta_chi2) if others else np.nan,
        shortest_nm=1e3 * float(np.nanmin(joined.wavelength_um)) if joined and films else np.inf,
        rising=() if joined is None else rising_indices(u, end, np.unique(joined.wavelength_um)),
    )  # fmt: skip


def describes(sample: Sample) -> str:
    """Return a description of the sample in words."""
    if sample.bare:
        return "one bare surface"
    return "this stack" if sample.films else "this plate"
