"""Candidates for a model of the data: how they compare, and which is taken.

    BIC = -2 log(likelihood) + P log(n)

falls by more than log(n) for a parameter that the data ask for (G. Schwarz, Annals of Statistics 6,
461 (1978), doi:10.1214/aos/1176344136). A difference below `MARGIN` is not strong evidence (R. E.
Kass and A. E. Raftery, J. Am. Stat. Assoc. 90, 773 (1995), doi:10.1080/01621459.1995.10476572): of
candidates closer than that the one with the fewest parameters is taken, and the lower BIC decides
between equals. One whose parameters the data do not see ("undetermined"), or that did not converge,
is shown and never taken.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from fitting.measurement import Measurement
from fitting.model.result import CONVERGED, ModelFit
from fitting.residuals import weighted_residuals
from fitting.uncertainty.covariance import loss_of

# "Positive" evidence ends and "strong" begins at a difference of 6 (Kass and Raftery). With the
# first the rate of needless parameters is that of single tests (4 % at 60 data) times the number
# of candidates; with this one it was measured at below 5 % for all of them together.
MARGIN = 6.0
# Every fifth point is held out, by a standard error that leaves it no weight.
FOLD, NO_WEIGHT = 5, 1e8
# Points held out that are missed by so many times what those shown are: no prediction.
WORSE = 2.0


class Key(NamedTuple):
    """What tells candidates apart; see `Candidate`."""

    model: str
    free: tuple[str, ...] = ()
    without_k: bool = False

    @property
    def label(self) -> str:
        """What the table calls it."""
        return ", ".join([self.model + (", k = 0" if self.without_k else ""), *self.free])


class Candidate(NamedTuple):
    """A model that was tried.

    key: .model, its name; .free, nuisance parameters switched on; .without_k, k was held at 0;
    .label, what the table calls it. fit: what came of it. held_out: root mean square, in standard
    errors where they are stated (see `residuals.weighted_residuals`), of the points held out (NaN
    where that was not tried); shown: of the others, then.
    """

    key: Key
    fit: ModelFit
    held_out: float = np.nan
    shown: float = np.nan

    @property
    def label(self) -> str:
        """What the table calls it."""
        return self.key.label

    @property
    def size(self) -> int:
        """The number of free parameters."""
        return len(self.fit.names)

    @property
    def good(self) -> bool:
        """Whether it may be taken."""
        return self.fit.status == CONVERGED and bool(np.isfinite(self.fit.bic))


@dataclass(frozen=True)
class Choice:
    """What `select.choose` found.

    fit: of the model taken. taken: its candidate. candidates: all that were tried, by rising BIC.
    reasons: sentences: why this one, and what else fits as well. describes: whether what the one
    taken leaves looks like noise; if not, its first warning says so.
    """

    fit: ModelFit
    taken: Candidate
    candidates: tuple[Candidate, ...]
    reasons: tuple[str, ...]
    describes: bool = True


def simplest(candidates: Sequence[Candidate]) -> Candidate:
    """Return the smallest candidate whose BIC is within MARGIN of the lowest."""
    good = [c for c in candidates if c.good] or list(candidates)
    least = min(c.fit.bic for c in good)
    near = [c for c in good if c.fit.bic <= least + MARGIN]
    return min(near, key=lambda c: (c.size, c.fit.bic))


def _without_some(m: Measurement, stated: bool = True) -> tuple[Measurement, np.ndarray]:
    """Return the measurement with every fifth point without weight, and which these are."""
    points = np.stack([m.wavelength_um, m.angle_deg])
    _, where = np.unique(points, axis=1, return_inverse=True)
    out = np.reshape(where, -1) % FOLD == FOLD // 2
    sigma = np.where(stated and np.isfinite(m.sigma).all(), m.sigma, 1.0)
    return replace(m, sigma=np.where(out, NO_WEIGHT * sigma, sigma)), out


def _size(fit: ModelFit, off: np.ndarray, noise: float) -> float:
    """Return the root mean square; of a robust loss that of the loss, as BIC takes it."""
    if fit.loss == "squares":
        return float(np.sqrt(np.mean(off**2)))
    return noise * float(np.sqrt(loss_of("student", off / noise) / len(off)))


def _held_out(
    candidates: Sequence[Candidate],
    run: Callable[..., ModelFit],
    measurements: Sequence[Measurement],
    joined: Measurement,
) -> list[Candidate]:
    """Return the candidates fitted without every fifth point, and how well they tell these.

    All are measured by the noise of the first one.
    """
    first = candidates[0].fit
    stated = bool(np.isfinite(first.chi2_reduced))
    masked = [_without_some(m, stated) for m in measurements]
    out = np.concatenate([where for _, where in masked])
    found = []
    for c in candidates:
        fit = run(c.key, [m for m, _ in masked], sigma="given", absolute_sigma=False)
        off = weighted_residuals(joined, fit.fitted()[0], stated)
        held_out, shown = (_size(fit, off[part], first.noise) for part in (out, ~out))
        found.append(c._replace(held_out=held_out, shown=shown))
    return found


def _unit(fit: ModelFit) -> str:
    """Return what the sizes of residuals are."""
    size = "rms" if fit.loss == "squares" else "rms without outliers"
    if np.isfinite(fit.chi2_reduced):
        return f"{size}, in standard errors"
    kinds = {*fit.measurement.quantity.tolist()}
    angles = "2 psi and sin(2 psi) Delta in radians" if kinds & {"psi", "delta"} else ""
    powers = " and of ".join(k for k in ("R", "T") if any(q.startswith(k) for q in kinds))
    return f"{size}, of {' and of '.join(filter(None, (powers, angles)))}"


def quoted(*candidates: Candidate) -> str:
    """Return their labels, which hold commas."""
    *others, last = (f'"{c.label}"' for c in candidates)
    return f"{', '.join(others)} and {last}" if others else last


def _why(taken: Candidate, near: Sequence[Candidate]) -> str:
    """Return why this one is taken of those that fit alike."""
    as_large = [c for c in near if c.size == taken.size]
    if any(c.size < taken.size for c in near) or any(c.fit.bic < taken.fit.bic for c in as_large):
        return ""
    fewest = "; it has the fewest parameters"
    return f"{fewest} and, of {len(as_large) + 1} that have, the lowest BIC" if as_large else fewest


def _reasons(taken: Candidate, less: Candidate | None, everyone: Sequence[Candidate]) -> list[str]:
    reasons = []
    if np.isfinite(taken.held_out):
        text = (
            f"points held out are missed by {taken.held_out:.3g}, those shown by {taken.shown:.3g} "
            f"({_unit(taken.fit)})"
        )
        reasons.append(text + (f"; by {quoted(less)}: {less.held_out:.3g}." if less else "."))
        if taken.held_out > WORSE * taken.shown:
            reasons.append(
                f"that is more than {WORSE:g} times as much: {quoted(taken)} does not predict "
                "what it was not shown; do not trust it between or beyond the data."
            )
    near = [
        c for c in everyone
        if c.good and c.label != taken.label and abs(c.fit.bic - taken.fit.bic) <= MARGIN
    ]  # fmt: skip
    if near:
        reasons.append(
            f"the data do not tell {quoted(taken)} from {quoted(*near)} (BIC closer than "
            f"{MARGIN:g}){_why(taken, near)}."
        )
    if not taken.good:
        reasons.append("no candidate is determined by these data; the best of them is shown.")
    return reasons


def decide(
    tried: Sequence[Candidate],
    run: Callable[..., ModelFit],
    measurements: Sequence[Measurement],
    joined: Measurement,
) -> Choice:
    """Return the choice, after the winner has been asked for points that it was not shown."""
    everyone = sorted(tried, key=lambda c: (not c.good, c.fit.bic))
    taken, less = simplest(everyone), None
    overruled = []
    if len(joined) >= 4 * FOLD and taken.good:
        smaller = [c for c in everyone if c.good and c.size < taken.size][:1]
        pair = _held_out([taken, *smaller], run, measurements, joined)
        everyone = [next((p for p in pair if p.label == c.label), c) for c in everyone]
        taken, less = pair[0], pair[1] if smaller else None
        if less is not None and less.held_out < taken.held_out:
            overruled.append(
                f"{quoted(less)} is taken although its BIC is higher, because {quoted(taken)} "
                "misses the points held out by more."
            )
            taken, less = less, taken
    reasons = overruled + _reasons(taken, less, everyone)
    return Choice(taken.fit, taken, tuple(everyone), tuple(reasons))


def with_fit(choice: Choice, fit: ModelFit) -> Choice:
    """Return the choice with another fit of the model taken."""
    taken = choice.taken._replace(fit=fit)
    everyone = tuple(taken if c.key == taken.key else c for c in choice.candidates)
    return replace(choice, fit=fit, taken=taken, candidates=everyone)


def choice_table(choice: Choice) -> list[list[str]]:
    """Return the comparison as rows of texts, heads first, the model taken marked with ``>``."""
    rows = [["", "model", "parameters", "BIC", "rms", "held out", "status"]]
    least = min(c.fit.bic for c in choice.candidates)
    for c in choice.candidates:
        rows.append([
            ">" if c.label == choice.taken.label else "", c.label, str(c.size),
            f"+{c.fit.bic - least:.1f}", f"{c.fit.rms:.3g}",
            f"{c.held_out:.3g}" if np.isfinite(c.held_out) else "", c.fit.status,
        ])  # fmt: skip
    return rows


def choice_dict(choice: Choice) -> dict[str, Any]:
    """Return the comparison as plain data.

    ``models``, by rising BIC; ``describes_data``, of the one taken; ``choice``, sentences.
    """
    models = [
        {
            "label": c.label, "taken": c.label == choice.taken.label, "parameters": c.size,
            "bic": c.fit.bic, "rms": c.fit.rms, "held_out": c.held_out, "status": c.fit.status,
        }
        for c in choice.candidates
    ]  # fmt: skip
    told = {"describes_data": choice.describes, "choice": list(choice.reasons)}
    return {"models": models, **told}
