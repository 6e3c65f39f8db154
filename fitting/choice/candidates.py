"""Candidates for a model of the data: how they compare, and which is taken.

    BIC = -2 log(likelihood) + P log(n)

falls by more than log(n) for a parameter that the data ask for (G. Schwarz, Annals of Statistics 6,
461 (1978), doi:10.1214/aos/1176344136). A difference below `MARGIN` is not strong evidence (R. E.
Kass and A. E. Raftery, J. Am. Stat. Assoc. 90, 773 (1995), doi:10.1080/01621459.1995.10476572): of
candidates closer than that the one with the fewest parameters is taken, and the lower BIC decides
between equals. One whose parameters the data do not see ("undetermined"), or that did not converge,
is shown and never taken.

BIC assumes that residuals are independent noise. Residuals that are autocorrelated and smaller than
the stated errors are not noise but systematic deviations within these errors. Of the candidates
that leave only such deviations the smallest is taken, even if others describe part of them. (By
BIC alone R of a diamond film, stated to .3 %, takes four oscillators of 14 parameters, two of them
lines without width, to describe deviations of .2 %.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from fitting.fit_result import Fit
from fitting.residuals.error_model import beyond_chance
from fitting.residuals.pattern import pattern
from fitting.residuals.residuals import weighted_residuals
from fitting.results.diagnostics import Finding, Warning
from fitting.results.result import FitData
from fitting.results.result_parts import DETERMINED, NOT_CONVERGED
from fitting.uncertainty.likelihood import MARGIN

# With a MARGIN of 2 the rate of needless parameters is that of single tests (4 % at 60 data) times
# the number of candidates; with this one it was measured at below 5 % for all of them together.
# Candidates whose BIC is higher than that of the one taken by no more are searched further. One fit
# of an oscillator had rested 20.7 of chi2 above the end of its valley.
FURTHER = 30.0


class Key(NamedTuple):
    """What distinguishes candidates.

    model: of the medium that is `auto`. free: instrument parameters that are fitted. without_k:
    whether k is fixed at 0.
    """

    model: str
    free: tuple[str, ...] = ()
    without_k: bool = False

    @property
    def label(self) -> str:
        """The name in the table."""
        return ", ".join([self.model + (", k = 0" if self.without_k else ""), *self.free])


class Candidate(NamedTuple):
    """A sample that was tried, and its fit.

    enough: whether its residuals are autocorrelated and, beyond chance, smaller than the stated
    errors, and these are used (`errors` is "auto" or "stated").
    """

    key: Key
    fit: Fit
    enough: bool = False

    @property
    def label(self) -> str:
        """The name in the table."""
        return self.key.label

    @property
    def size(self) -> int:
        """The number of fitted parameters."""
        return len(self.fit.names)

    @property
    def good(self) -> bool:
        """Whether it may be taken."""
        return self.fit.status in DETERMINED and bool(np.isfinite(self.fit.bic))


@dataclass(frozen=True, eq=False)
class Choice:
    """The result of `choose`.

    fit: the `Fit` of the sample that was taken.
    taken: its candidate. candidates: all that were tried, by rising BIC.
    reasons: why this one was taken, and which others fit as well.
    describes: whether the residuals of `fit` look like noise; if not, its first warning says so.
    """

    fit: Fit
    taken: Candidate
    candidates: tuple[Candidate, ...]
    reasons: tuple[Warning, ...]
    describes: bool = True

    def table(self) -> list[list[str]]:
        """Return the comparison as rows of texts below a header; ``>`` marks the one taken."""
        rows = [["", "model", "parameters", "BIC", "rms", "status"]]
        models = self.to_dict()["models"]
        least = min(m["bic"] for m in models)
        for m in models:
            rise, rms = f"+{m['bic'] - least:.1f}", f"{m['rms']:.3g}"
            mark = ">" if m["taken"] else ""
            rows.append([mark, m["label"], str(m["parameters"]), rise, rms, m["status"]])
        return rows

    def to_dict(self) -> dict[str, Any]:
        """Return the comparison as plain data.

        ``models``: the candidates by rising BIC. ``describes_data``: `describes`. ``choice``: the
        reasons.
        """
        models = [{
            "label": c.label, "taken": c.label == self.taken.label, "parameters": c.size,
            "bic": c.fit.bic, "rms": c.fit.rms, "status": c.fit.status,
        } for c in self.candidates]  # fmt: skip
        reasons = [reason.to_dict() for reason in self.reasons]
        return {"models": models, "describes_data": self.describes, "choice": reasons}

    def __repr__(self) -> str:
        return f"Choice({self.taken.label!r} of {len(self.candidates)} candidates)"

    def __str__(self) -> str:
        return str(self.fit)

    def _repr_html_(self) -> str:
        return self.fit._repr_html_(self)

    def with_fit(self, found: FitData) -> Choice:
        """Return the choice with another fit of the sample taken."""
        taken = self.taken._replace(fit=Fit.of(found))
        everyone = tuple(taken if c.key == taken.key else c for c in self.candidates)
        return replace(self, fit=taken.fit, taken=taken, candidates=everyone)


def candidate(key: Key, fit: FitData, errors: str) -> Candidate:
    """Return a candidate; errors: how the stated errors are used, as in `fit`."""
    codes = {f.code for f in fit.findings}
    small = errors in ("auto", "stated") and {"chi2_small", "residuals_in_order"} <= codes
    return Candidate(key, Fit.of(fit), small)


def simplest(candidates: Sequence[Candidate]) -> Candidate:
    """Return the smallest candidate whose BIC is within MARGIN of the lowest.

    If the one of lowest BIC is `enough`, return the smallest of all that are.
    """
    good = [c for c in candidates if c.good] or list(candidates)
    least = min(good, key=lambda c: c.fit.bic)
    near = [c for c in good if c.fit.bic <= least.fit.bic + MARGIN]
    if least.enough:
        near = [c for c in good if c.enough]
    return min(near, key=lambda c: (c.size, c.fit.bic))


def contenders(tried: Sequence[Candidate]) -> list[Candidate]:
    """Return the candidates that may be taken if lower minima of them are found."""
    taken = simplest(tried)
    return [c for c in tried if c is taken or (c.good and c.fit.bic <= taken.fit.bic + FURTHER)]


def _near(taken: Candidate, everyone: Sequence[Candidate]) -> list[Warning]:
    """Return the reason to take this one of several of nearly equal BIC; () if it is alone."""
    near = [
        c for c in everyone
        if c.good and c.label != taken.label and abs(c.fit.bic - taken.fit.bic) <= MARGIN
    ]  # fmt: skip
    if not near:
        return []
    as_large = [c for c in near if c.size == taken.size]
    fewest = not any(c.size < taken.size for c in near)
    fewest &= not any(c.fit.bic < taken.fit.bic for c in as_large)
    values = {
        "taken": taken.label, "others": tuple(c.label for c in near), "margin": MARGIN,
        "fewest": fewest, "as_large": len(as_large),
        "other": next((str(c.fit.sample) for c in near if c.key == Key(c.key.model)), ""),
    }  # fmt: skip
    return [Warning("choice_alike", {}, values)]


def decide(tried: Sequence[Candidate]) -> Choice:
    """Return the choice among the candidates."""
    everyone = sorted(tried, key=lambda c: (not c.good, c.fit.bic))
    taken = simplest(everyone)
    reasons = _near(taken, everyone)
    if taken.enough:
        values = {"taken": taken.label, "chi2_reduced": taken.fit.chi2_reduced}
        reasons.append(Warning("choice_within_errors", {}, values))
    if not taken.good:
        reasons.append(Warning("choice_undetermined"))
    return Choice(taken.fit, taken, tuple(everyone), tuple(reasons))


def _in_errors(found: FitData) -> float:
    """Return the size of the residuals in stated errors; outliers of a robust loss do not count."""
    if found.loss == "squares":
        return float(np.sqrt(found.chi2_reduced))
    m = found.measurement
    assert m is not None
    off = np.abs(weighted_residuals(m, found.fitted))
    return 1.4826 * float(np.median(off)) * float(np.sqrt(found.n_data / found.dof))


def explains(found: FitData) -> bool:
    """Whether the residuals of a fit look like noise.

    With stated errors they must not be larger than these; without, they must not be autocorrelated
    (`pattern`).
    """
    if np.isfinite(found.chi2_reduced) and found.dof:
        return not beyond_chance(_in_errors(found) ** 2, found.dof)[0]
    m, curve = found.measurement, found.curve
    assert m is not None and curve is not None
    return pattern(m, found.fitted, curve, stated=False) is None


def with_doubt(choice: Choice) -> Choice:
    """Return the choice, with a first warning if its model does not describe the data."""
    found = choice.fit
    if explains(found):
        return choice
    better = [c for c in choice.candidates if c.fit.status != NOT_CONVERGED and explains(c.fit)]
    values: dict[str, Any] = {"taken": choice.taken.label, "rms": found.rms}
    if better:
        values["better"] = tuple(c.label for c in better)
    elif np.isfinite(found.chi2_reduced):
        values["factor"] = _in_errors(found)
    doubt = Finding("candidates_do_not_describe", np.True_, values)
    told = replace(found, findings=(doubt, *found.findings))
    return replace(choice.with_fit(told), describes=False)
