"""No more model than the data need: `--model auto`.

Candidates come in stages, each only if the one before gives reason to: without k and with the
simplest k; more oscillators, where light is absorbed or nothing so far describes the data, and
while they help; then each nuisance parameter. `candidates` says how
they compare and which is taken.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from fitting.bare_surface.region_intervals import QUADRATIC
from fitting.candidates import (
    MARGIN,
    Candidate,
    Choice,
    Key,
    decide,
    quoted,
    simplest,
    with_fit,
)
from fitting.measurement import Measurement, concatenate
from fitting.model.fit import fit_model
from fitting.model.result import NOT_CONVERGED, ModelFit
from fitting.observe import NUISANCES
from fitting.parameters import names_of, plain_name
from fitting.pattern import pattern
from fitting.residuals import weighted_residuals
from fitting.uncertainty.intervals import check_intervals

MOST_TERMS = 4


def _first_stage(wavelengths: int) -> list[str]:
    """Return the models that so many wavelengths can tell apart."""
    models = ["constant"]
    for least, name in (
        (3, "cauchy:2"), (3, "sellmeier:1"), (5, "cauchy:3"), (5, "drude"), (5, "cauchy-urbach:2"),
        (6, "lorentz:1"), (8, "sellmeier:2"),
    ):  # fmt: skip
        if wavelengths >= least:
            models.append(name)
    return models


def _absorbs(c: Candidate) -> bool:
    return not c.key.without_k and not c.key.model.startswith(("cauchy:", "sellmeier"))


def _good(c: Candidate | None) -> bool:
    return c is not None and c.good


def _only_shared(names: Iterable[str]) -> None:
    """Refuse settings of parameters that only some of the models have."""
    for name in names:
        if plain_name(name).split("[")[0] not in (*NUISANCES, "thickness_um"):
            raise ValueError(
                f"{name} is a parameter of some models only; with the model left open ('auto'), "
                f"{', '.join(NUISANCES)} and thickness_um can be set. Name the model to set others."
            )


def _in_errors(fit: ModelFit) -> float:
    """Return the size of the residuals in stated errors; with a robust loss without outliers."""
    if fit.loss == "squares":
        return float(np.sqrt(fit.chi2_reduced))
    off = np.abs(weighted_residuals(fit.measurement, fit.fitted()[0]))
    return 1.4826 * float(np.median(off)) * float(np.sqrt(fit.n_data / fit.dof))


def explains(fit: ModelFit) -> bool:
    """Whether what a fit leaves looks like noise: in size where errors are stated, else in order.

    In order: as `pattern` tells.
    """
    if np.isfinite(fit.chi2_reduced) and fit.dof:
        return _in_errors(fit) ** 2 < max(1.5, 1.0 + 5.0 * np.sqrt(2.0 / fit.dof))
    return pattern(fit.measurement, fit.fitted()[0], fit.curve, stated=False) is None


def _with_doubt(choice: Choice) -> Choice:
    """Return the choice, with a warning first of all where its model does not describe the data."""
    if explains(choice.fit):
        return choice
    better = [c for c in choice.candidates if c.fit.status != NOT_CONVERGED and explains(c.fit)]
    taken = quoted(choice.taken)
    doubt = "Do not take its parameters, or their errors, for those of the material."
    if better:
        text = (
            f"{taken} does not describe these data; {quoted(*better)} would, but the data do not "
            f"support so many parameters. {doubt}"
        )
    elif np.isfinite(choice.fit.chi2_reduced):
        text = (
            f"no candidate describes these data to their stated errors: {taken} is the best, and "
            f"what it leaves is {_in_errors(choice.fit):.2g} times these. Either they are too "
            "small, or the parameters are not those of the material."
        )
    else:
        text = (
            f"no candidate describes these data: {taken} is the best, and what it leaves is not "
            f"noise (rms {choice.fit.rms:.3g}). {doubt}"
        )
    fit = replace(choice.fit, warnings=(text, *choice.fit.warnings))
    return replace(with_fit(choice, fit), describes=False)


def _nuisances(m: Measurement) -> list[str]:
    """Return the nuisance parameters that are worth a try with such data."""
    power = ~np.isin(m.quantity, ("psi", "delta"))
    oblique = m.angle_deg[m.angle_deg > 0.0]
    names = []
    # At one angle a scale is an index.
    if power.any() and len(np.unique(m.angle_deg)) > 2:
        names.append("scale")
    if len(np.unique(oblique)) > 2 or (len(oblique) and not power.all()):
        names.append("angle_offset")
    return names


def choose(
    measurement: Measurement | Sequence[Measurement],
    structure: str = "interface",
    *,
    free: Iterable[str] = (),
    fixed: Mapping[str, float] | None = None,
    nuisances: bool = True,
    intervals: str = "auto",
    step: Callable[[str], None] = lambda doing: None,
    **options: Any,
) -> Choice:
    """Return the smallest dispersion model that the data do not contradict, with the comparison.

    measurement, structure, free, fixed, options: as for `fit_model` (thickness_um, bounds, priors,
    loss, eta_i, sigma, absolute_sigma, seed), and used for every candidate.
    intervals: of the model that is taken, as for `fit_model`.
    nuisances: whether a free scale and angle offset are tried.
    step: called with the name of each candidate before it is tried.
    Result: a `Choice`. Accuracy: how often the true model of simulated spectra is found, and how
    seldom a parameter too many, is in docs/fitting.md. Time: ten to twenty fits; the first ones
    of a kind, whose programs are compiled then, up to two minutes.
    Raises ValueError as `fit_model` does.
    """
    measurements = [measurement] if isinstance(measurement, Measurement) else list(measurement)
    joined = concatenate(*measurements)
    wavelengths = len(np.unique(joined.wavelength_um[np.isfinite(joined.wavelength_um)]))
    check_intervals(intervals)
    held, given = dict(fixed or {}), names_of(free)
    _only_shared([*held, *given, *(options.get("bounds") or {}), *(options.get("priors") or {})])
    tried: dict[Key, Candidate] = {}

    def run(key: Key, data: Sequence[Measurement] = measurements, **more: Any) -> ModelFit:
        values = held | ({"k": 0.0} if key.without_k else {})
        extra = (*given, *key.free)
        how: dict[str, Any] = {"intervals": QUADRATIC} | options | more
        return fit_model(list(data), key.model, structure, free=extra, fixed=values, **how)

    def attempt(model: str, extra: tuple[str, ...] = (), without_k: bool = False) -> Candidate:
        key = Key(model, extra, without_k)
        if key not in tried:
            step(key.label)
            tried[key] = Candidate(key, run(key))
        return tried[key]

    def best() -> Candidate:
        return simplest(list(tried.values()))

    attempt("constant", without_k=True)
    for name in _first_stage(wavelengths):
        attempt(name)
    if wavelengths >= 6 and (_absorbs(best()) or not explains(best().fit)):
        attempt("drude-lorentz:1")
        attempt("tauc-lorentz:1")
        for terms in range(2, MOST_TERMS + 1):
            before = best().fit.bic
            grown = [
                attempt(f"{kind}:{terms}")
                for kind in ("lorentz", "drude-lorentz")
                if wavelengths >= 4 * terms and _good(tried.get(Key(f"{kind}:{terms - 1}")))
            ]
            helped = any(c.good and c.fit.bic < before - MARGIN for c in grown)
            if not helped and explains(best().fit):
                break
    if nuisances:
        wanted = [n for n in _nuisances(joined) if n not in given]
        # A scale can look like absorption: what is without k is tried as well.
        clear = [c for c in tried.values() if not _absorbs(c)]
        bases = [best()]
        bases += [c for c in [simplest(clear)] if c.key != bases[0].key]
        for base in bases:
            extra: tuple[str, ...] = ()
            for name in wanted:
                grown = attempt(base.key.model, (*extra, name), base.key.without_k)
                if grown.good and grown.fit.bic < base.fit.bic - MARGIN:
                    base, extra = grown, (*extra, name)
    choice = decide(list(tried.values()), run, measurements, joined)
    if intervals != QUADRATIC:
        choice = with_fit(choice, run(choice.taken.key, intervals=intervals))
    return _with_doubt(choice)
