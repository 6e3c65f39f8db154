"""Whether files that are fitted together contradict each other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from scipy.special import betainc, stdtr

from fitting.problem.evaluation import Evaluated
from fitting.problem.model_at import Shown
from fitting.problem.observations import labels_of
from fitting.problem.slopes import slopes_at
from fitting.results.diagnostics import Warning
from fitting.results.result import FitData
from fitting.uncertainty.covariance import UNSEEN

# Two files contradict each other if the probability of such a difference of their indices is below
# this: four standard errors of the difference, more if few data determine these errors.
EXCLUDING = 6e-5
# Separate fits, which take time, are made only if the probability to first order is below this.
PERHAPS = 1e-3
# An index over wavelength is compared at this many wavelengths that both files cover.
_WAVES = 5
# name, (values of the two), (standard errors of the two)
_Pair = tuple[str, tuple[float, float], tuple[float, float]]


def may_disagree(found: FitData) -> bool:
    """Whether two files may contradict each other, so that separate fits are worth their time.

    This is an F test of the decrease of chi2 if each file took a least-squares step of its own
    from the common minimum.
    """
    at = found.evaluator
    if not isinstance(at, Evaluated):
        return True
    s = slopes_at(at.seen, Shown(at.unknowns.spec, at.targets), at.y)
    file = at.seen.points.file[s.row]
    along = [_along(s.jacobian[file == f], s.residual[file == f]) for f in np.unique(file)]
    taken, used = sum(a @ a for a in along), sum(map(len, along))
    more = used - len(_along(s.jacobian, s.residual))
    freedom = len(s.residual) - used
    if more < 1 or freedom < 1:
        return False
    square = s.residual @ s.residual  # 0 of exact data
    left = max(1.0 - taken / square, 0.0) if square else 1.0
    return bool(betainc(0.5 * freedom, 0.5 * more, left) < PERHAPS)


def _along(slopes: np.ndarray, residual: np.ndarray) -> np.ndarray:
    """Return the part of the residuals along each direction in which the parameters move them."""
    size = np.linalg.norm(slopes, axis=0)
    u, spread, _ = np.linalg.svd(slopes / np.where(size > 0.0, size, 1.0), full_matrices=False)
    return u[:, spread > UNSEEN * spread.max()].T @ residual


def disagreement(results: Sequence[FitData]) -> tuple[Warning, ...]:
    """Return a warning where the separate fits of two files contradict each other; else nothing.

    It compares the parameters that files share (all but scale and background), and eta and k: those
    of a model over the wavelengths that both files cover, those of an index that is free at every
    wavelength at the common ones. Only what has a standard error in both is compared.
    """
    labels = labels_of([f.measurement.source if f.measurement else "" for f in results])
    every = [
        (chance, {**values, "files": (labels[j], labels[i])})
        for i, first in enumerate(results) for j, second in enumerate(results[:i])
        for pair in _alike(second, first) for chance, values in _differences(*pair)
    ]  # fmt: skip
    least, said = min(every, key=lambda one: one[0], default=(1.0, {}))
    return (Warning("files_exclude", {}, said),) if least < EXCLUDING else ()


def _alike(first: FitData, second: FitData) -> Iterator[tuple[FitData, FitData]]:
    """Yield the fits of two files that can be compared: of one wavelength, or of a model."""
    if first.sample is not None and not first.sample.by_wavelength:
        yield first, second
        return
    waves = [np.atleast_1d(f.wavelength_um).tolist() for f in (first, second)]
    for a, x in enumerate(waves[0]):
        for b, y in enumerate(waves[1]):
            if x == y or (np.isnan(x) and np.isnan(y)):
                yield first[a] if first.shape else first, second[b] if second.shape else second


def _pairs(first: FitData, second: FitData) -> Iterator[_Pair]:
    for name in first.names:
        if name in second.names and name.partition("[")[0] not in ("scale", "background"):
            a, b = first.parameters[name], second.parameters[name]
            yield name, (a.value, b.value), (a.sigma, b.sigma)
    if first.sample is None or first.sample.by_wavelength:
        return
    waves = [np.atleast_1d(f.wavelength_um) for f in (first, second)]
    low, high = max(w.min() for w in waves), min(w.max() for w in waves)
    if not low <= high:
        return
    at = np.unique(np.linspace(low, high, _WAVES))
    one, other = first.index(at), second.index(at)
    for i, wavelength in enumerate(at.tolist()):
        for name in ("eta", "k"):
            sigma = f"sigma_{name}"
            values = float(getattr(one, name)[i]), float(getattr(other, name)[i])
            sigmas = float(getattr(one, sigma)[i]), float(getattr(other, sigma)[i])
            yield f"{name} at {wavelength:.4g} um", values, sigmas


def _differences(first: FitData, second: FitData) -> Iterator[tuple[float, dict[str, Any]]]:
    """Yield the probability by chance of each difference, and the numbers of the sentence."""
    counted = [f.dof for f in (first, second) if f.errors.taken != "stated"]
    for name, values, sigmas in _pairs(first, second):
        together = float(np.hypot(*sigmas))
        if np.isfinite(together) and together > 0.0:
            apart = abs(values[0] - values[1]) / together
            chance = 2.0 * float(stdtr(max(min(counted, default=1e9), 1), -apart))
            yield chance, {"parameter": name, "values": values, "sigmas": sigmas, "apart": apart}
