"""Several fits of one kind as one `Fit` of a batch: every number becomes an array."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from fitting.data.measurement import Measurement
from fitting.problem.evaluation import EachFit
from fitting.results.diagnostics import Finding
from fitting.results.result import FitData
from fitting.results.result_parts import NONE, TIED, Alternative, ErrorModel, Estimate
from fitting.results.sentences import SENTENCES

_EACH = (
    "covariance", "wavelength_um", "chi2", "chi2_reduced", "dof", "n_data", "rms", "status",
    "evaluations", "starts", "reached", "noise", "cost", "bic", "aicc",
)  # fmt: skip


def _stack(values: Sequence[Any]) -> np.ndarray:
    return np.stack([np.asarray(v) for v in values])


def _estimate(each: Sequence[Estimate]) -> Estimate:
    first = each[0]
    tied = np.ndim(first.status) == 0 and first.status == TIED
    if not first.free and not tied:
        return first
    names = ["value", "sigma", "interval", "interval_kind", "upper_limit"]
    if not tied:  # of which that is all that the status says
        names.append("status")
    return replace(first, **{n: _stack([getattr(e, n) for e in each]) for n in names})


def _alternatives(fits: Sequence[FitData]) -> tuple[Alternative, ...]:
    """Return the alternatives of all fits, the first of each, the second of each, ..."""
    out = []
    for i in range(max(len(f.others) for f in fits)):
        some = next(f.others[i] for f in fits if len(f.others) > i)
        nothing = {
            n: replace(e, value=np.nan, sigma=np.nan, interval=np.full(2, np.nan),
                       interval_kind=NONE, upper_limit=np.nan)
            for n, e in some.parameters.items()
        }  # fmt: skip
        none = Alternative(parameters=nothing, delta_chi2=np.nan)
        each = [f.others[i] if len(f.others) > i else none for f in fits]
        parameters = {n: _estimate([a.parameters[n] for a in each]) for n in nothing}
        out.append(Alternative(
            parameters=parameters, delta_chi2=_stack([a.delta_chi2 for a in each]),
            reached=_stack([a.reached for a in each]),
        ))  # fmt: skip
    return tuple(out)


# What may be tried on one fit and not on one of many, which take one value for all.
_OF_ONE: dict[str, Any] = {
    "alone": False, "own": (), "measured": (), "as_it_is": False, "hold": None,
}  # fmt: skip


def stacked_findings(fits: Sequence[Sequence[Finding]]) -> tuple[Finding, ...]:
    """Return the findings on each of many fits as those on all, the most serious first."""
    out = []
    for code in SENTENCES:
        # A code may come more than once (a limit for each of two parameters).
        each = [[x for x in own if x.code == code] for own in fits]
        for i in range(max(map(len, each))):
            at = np.array([len(own) > i for own in each])
            names = {name for own in each if len(own) > i for name in own[i].values}
            values: dict[str, Any] = {}
            for name in sorted(names):
                if name in _OF_ONE:
                    values[name] = _OF_ONE[name]
                    continue
                column = np.empty(len(fits), dtype=object)
                for j, own in enumerate(each):
                    column[j] = own[i].values.get(name) if len(own) > i else None
                values[name] = column
            out.append(Finding(code, at, values))
    return tuple(out)


def stacked_fits(fits: Sequence[FitData]) -> FitData:
    """Return fits of one kind, without a measurement, as one of batch shape (S,)."""
    first = fits[0]
    return replace(
        first,
        **{n: _stack([getattr(f, n) for f in fits]) for n in _EACH},
        parameters={n: _estimate([f.parameters[n] for f in fits]) for n in first.parameters},
        errors=ErrorModel._make(map(_stack, zip(*(f.errors for f in fits), strict=True)))._replace(
            stated=first.errors.stated
        ),
        findings=stacked_findings([f.findings for f in fits]), others=_alternatives(fits),
    )  # fmt: skip


def of_measurement(found: FitData, measurement: Measurement) -> FitData:
    """Return the fits of all wavelengths with the data, whose curves are their quantities."""
    quantities = tuple(dict.fromkeys(measurement.quantity.tolist()))
    curve = np.array([quantities.index(q) for q in measurement.quantity.tolist()])
    return replace(found, measurement=measurement, curve=curve, curve_names=quantities)


def stacked(fits: Sequence[FitData], measurement: Measurement) -> FitData:
    """Return the fits of single wavelengths as one of batch shape (W,)."""
    kinds = dict.fromkeys(kind for f in fits for kind in f.rms_of)
    each: Any = tuple(f.evaluator for f in fits)
    return replace(
        of_measurement(stacked_fits(fits), measurement),
        rms_of={k: _stack([f.rms_of.get(k, np.nan) for f in fits]) for k in kinds},
        n_of={k: _stack([f.n_of.get(k, 0) for f in fits]) for k in kinds},
        evaluator=EachFit(each, (len(each),), _stack([f.wavelength_um for f in fits]), measurement),
    )
