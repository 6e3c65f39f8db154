"""Choice among samples: is there a film at all, an oxide, roughness, a gradient?

    choose(m, "Si or air | SiO2 1..50 nm | Si")
    choose(m, "air | cauchy 50..500 nm | Si or air | rough 1..20 nm | cauchy 50..500 nm | Si "
              "or air | cauchy 50..500 nm graded | Si")

The one with the fewest parameters whose BIC is within a margin of the lowest is taken
(`candidates`): a further layer needs evidence.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from fitting.choice.candidates import MARGIN, Choice, Key
from fitting.data.quantities import are_powers
from fitting.problem.problem import FitOptions
from fitting.results.diagnostics import Finding
from fitting.results.result import FitData
from fitting.results.result_parts import CONVERGED
from fitting.samples.parameters import Settings
from fitting.samples.sample import Sample
from fitting.uncertainty.likelihood import corrected_aic

OR = " or "
_NEUTRAL = "angle_offset"
# Calibrations of reflectances are hardly wrong by more.
MOST_GAIN = 0.1
# Returns a fit: of this sample, with these settings and options.
Fitted = Callable[[Sample, Settings, FitOptions], FitData]
# Returns the fit of a candidate with these options.
Run = Callable[[Key, FitOptions], FitData]


def several_samples(text: Any) -> tuple[Sample, ...]:
    """Return the samples that a text with "or", or a sequence, stands for."""
    parts = text.split(OR) if isinstance(text, str) else text
    return tuple(map(Sample.parse, (parts,) if isinstance(parts, Sample) else parts))


def of_samples(samples: Sequence[Sample], base: Settings, fitted: Fitted) -> Run:
    """Return how one of several samples is fitted."""
    for which in samples:
        if which.by_wavelength or which.open:
            raise ValueError(
                f"the sample {str(which)!r} cannot be compared with others, since an index in it "
                "is free at every wavelength or auto. Write numbers, materials or named dispersion "
                "models instead."
            )
    by_label = {str(which): which for which in samples}
    at = base.fixed.get(_NEUTRAL, 0.0)
    nothing = base._replace(
        fixed={n: value for n, value in base.fixed.items() if n != _NEUTRAL},
        bounds={**base.bounds, _NEUTRAL: (at - 1e-9, at + 1e-9)},
    )

    def run(key: Key, asked: FitOptions) -> FitData:
        which = by_label[key.model]
        if key.free:
            return fitted(which, base._replace(free=(*base.free, *key.free)), asked)
        held = all(m.thickness is None or m.thickness.held for m in which.media)
        if held and not any(m.unknown for m in which.media):
            return _without_unknowns(fitted(which, nothing, asked))
        return fitted(which, base, asked)

    return run


def with_gain_instead(choice: Choice, try_gain: Callable[[Key], FitData]) -> Choice:
    """Return the choice, with a warning if a smaller sample fits as well with a free scale.

    Reflectances that are 1 % low at all wavelengths are those of a thin oxide, too.
    """
    smaller = [c for c in choice.candidates if c.size < choice.taken.size]
    if not smaller or not are_powers(choice.fit.measurement.quantity).any():  # type: ignore
        return choice
    least = min(smaller, key=lambda c: c.fit.bic)
    other = try_gain(least.key._replace(free=("scale",)))
    # Of several files each has a scale of its own.
    scales = [e for name, e in other.parameters.items() if name.startswith("scale")]
    scale = max(scales, key=lambda e: abs(e.value - 1.0))
    near = other.bic <= choice.taken.fit.bic + MARGIN and abs(scale.value - 1.0) < MOST_GAIN
    if other.status != CONVERGED or not near:
        return choice
    told = Finding("gain_instead", np.True_, {
        "sample": least.label, "scale": scale.value, "sigma": scale.sigma,
        "delta_bic": other.bic - choice.taken.fit.bic,
    })  # fmt: skip
    return choice.with_fit(replace(choice.fit, findings=(told, *choice.fit.findings)))


def _without_unknowns(found: FitData) -> FitData:
    """Return the fit of a sample without unknowns, from that of an angle offset that hardly moves.

    The offset counts neither in the degrees of freedom nor in the information criteria.
    """
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
