"""Choice among samples: is there a film at all, an oxide, roughness, a gradient?

    choose(m, "Si or air | SiO2 1..50 nm | Si")
    choose(m, "air | cauchy 50..500 nm | Si or air | rough 1..20 nm | cauchy 50..500 nm | Si "
              "or air | cauchy 50..500 nm graded | Si")

Each is fitted, and the one with the fewest parameters whose BIC is within a margin of the lowest is
taken (`candidates`): a further layer needs evidence.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from fitting.choice.candidates import Candidate, Choice, Key, candidate, decide
from fitting.fits import fit
from fitting.measurements.measurement import Measurement
from fitting.process.progress import tell
from fitting.results.diagnostics import Finding
from fitting.results.result import CONVERGED, Fit
from fitting.samples.sample import Sample
from fitting.uncertainty.intervals import QUADRATIC
from fitting.uncertainty.likelihood import corrected_aic

OR = " or "
_NEUTRAL = "angle_offset"


def several_samples(text: Any) -> tuple[Sample, ...]:
    """Return the samples that a text with "or", or a sequence, stands for."""
    parts = text.split(OR) if isinstance(text, str) else text
    if isinstance(parts, Sample):
        parts = (parts,)
    return tuple(Sample.parse(part) for part in parts)


def _is_fixed(which: Sample) -> bool:
    """Whether a sample has nothing to be fitted: numbers, materials and fixed thicknesses."""
    held = all(m.thickness is None or m.thickness.held for m in which.media)
    return held and not any(m.unknown for m in which.media)


def _without_unknowns(which: Sample, fitted: Callable[..., Fit], kind: str) -> Fit:
    """Return a sample without unknowns as a fit: that of an angle offset with bounds next to 0.

    The offset counts neither in the degrees of freedom nor in the information criteria.
    """
    found = fitted(which, kind, bounds={_NEUTRAL: (-1e-9, 1e-9)})
    parameters = {n: e for n, e in found.parameters.items() if n != _NEUTRAL}
    findings = tuple(
        f for f in found.findings if f.values.get("parameter") != _NEUTRAL
        and _NEUTRAL not in (f.values.get("parameters") or ())
    )  # fmt: skip
    n, dof = found.n_data, found.dof + 1
    bic = found.bic - float(np.log(n))
    noise = 0 if found.errors.taken == "stated" else 1  # the only unknown, see `criteria`
    return replace(
        found, parameters=parameters, covariance=found.covariance[:0, :0], findings=findings,
        bic=bic, aicc=corrected_aic(bic, noise, n),
        dof=dof, chi2_reduced=found.chi2_reduced * found.dof / dof, status=CONVERGED,
        evaluations=0, starts=0, reached=0,
    )  # fmt: skip


def _candidate(which: Sample, run: Callable[[Sample, str], Fit], errors: str) -> Candidate:
    found = run(which, QUADRATIC)
    thin = any(f.code == "thin_film" for f in found.findings)
    # If the data determine only the product of thickness and index of a layer, the sample may still
    # be taken: the layer is there, although little is known of it.
    if thin and found.status != CONVERGED:
        found = replace(found, status=CONVERGED)
    return candidate(Key(str(which)), found, errors)


def choose_sample(
    measurement: Measurement | Sequence[Measurement],
    samples: Sequence[Sample],
    *,
    intervals: str = "auto",
    progress: Callable[[str], None] | None = None,
    **options: Any,
) -> Choice:
    """Return the simplest of the samples that the data do not contradict, with the comparison.

    options: those of `fit`, used for every sample; during the comparison `errors` "auto" means
    "scaled", since BIC compares fits with the same weights.
    Raises ValueError as `fit` does, and for samples that cannot be compared.
    """
    for which in samples:
        if which.by_wavelength or which.open:
            raise ValueError(
                f"the sample {str(which)!r} cannot be compared with others, since an index in it "
                "is free at every wavelength or auto. Write numbers, materials or named dispersion "
                "models instead."
            )
    believed: Mapping[str, Any] = {**options}
    errors = options.get("errors", "auto")
    compared = {**believed, "errors": "scaled" if errors == "auto" else errors}

    def fitted(which: Sample, kind: str, **more: Any) -> Fit:
        joined = {**compared, **more}
        if more and compared.get("bounds"):
            joined["bounds"] = {**compared["bounds"], **more["bounds"]}
        return fit(measurement, which, intervals=kind, **joined)

    def run(which: Sample, kind: str) -> Fit:
        (progress or (lambda label: None))(str(which))
        tell(str(which))
        return _without_unknowns(which, fitted, kind) if _is_fixed(which) else fitted(which, kind)

    choice = decide([_candidate(which, run, errors) for which in samples])
    taken = next(s for s in samples if str(s) == choice.taken.label)
    if (intervals != QUADRATIC or errors == "auto") and not _is_fixed(taken):
        choice = choice.with_fit(fit(measurement, taken, intervals=intervals, **believed))
    found = choice.fit
    doubtful = [f for f in found.findings if f.code in ("residuals_in_order", "does_not_describe")]
    if not doubtful:
        return choice
    doubt = Finding(
        "candidates_do_not_describe", doubtful[0].at,
        {"taken": choice.taken.label, "rms": found.rms},
    )  # fmt: skip
    told = replace(found, findings=(doubt, *found.findings))
    return replace(choice.with_fit(told), describes=False)
