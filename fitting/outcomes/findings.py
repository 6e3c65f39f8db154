"""Which warnings a fit of shared parameters gets: the conditions and their thresholds."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from fitting.data.measurement import Measurement
from fitting.data.quantities import are_powers
from fitting.optics.instrument import INSTRUMENT
from fitting.outcomes.contradictions import contradicted_errors, contradicted_priors
from fitting.outcomes.curvature import without_slope
from fitting.outcomes.implausible_index import implausible_indices
from fitting.problem.evaluation import at_data
from fitting.problem.problem import Problem
from fitting.problem.unknowns import Unknowns
from fitting.residuals.error_model import OUT_OF_MODEL
from fitting.residuals.pattern import pattern
from fitting.results.diagnostics import Finding
from fitting.results.result_parts import AT_LOWER, AT_UPPER, PROFILE, Alternative, Estimate
from fitting.samples.dispersion import CAUCHY_NAMES, Model
from fitting.samples.known_media import Mixture
from fitting.samples.sample import Sample
from fitting.uncertainty.covariance import End
from fitting.uncertainty.intervals import OFF, Intervals

# Parameters of one formula (A, B and C of Cauchy's) are usually correlated, which does no harm. A
# parameter of the instrument that is correlated with the index does (angle offset of the gold scan:
# .79 and .71).
CORRELATED_WITHIN, CORRELATED = 0.999, 0.7
VAGUE = 0.5
# The zero of a goniometer is known better than that.
PLAUSIBLE_OFFSET_DEG = 2.0
FEW_REACHED = 3
_MAY_VANISH = (*(set(INSTRUMENT) - {"scale"}), *"BCDEF")  # and the higher terms of Cauchy's index


class Subject(NamedTuple):
    """What is fitted: all files joined; None for the caller's own residuals."""

    sample: Sample | None
    measurement: Measurement | None

    @property
    def films(self) -> bool:
        """Whether the sample has a layer whose reflections interfere."""
        return self.sample is not None and self.sample.films


class Found(NamedTuple):
    """The best minimum with its intervals, and the others.

    reached: the number of starts that ended there. lower: by how much chi2 is lower at a fit near
    the minimum whose own minimum was not reached; 0 if there is none. fringeless: the values of the
    warning if the fringes of the best minimum are no larger than those of noise.
    """

    end: End
    known: Intervals
    others: tuple[Alternative, ...]
    reached: int
    lower: float
    failed: bool
    fringeless: dict[str, Any] | None


def _finding(code: str, **values: Any) -> Finding:
    return Finding(code, np.True_, values)


def _bare(name: str) -> str:
    return name.partition("[")[0].rpartition(".")[2]


def may_vanish(name: str) -> bool:
    """Whether a value of 0 within its error is usual, so that a large relative error is no news."""
    return _bare(name) in _MAY_VANISH


def is_outer(name: str) -> bool:
    """Whether a parameter is not one of a material: of the instrument, or a thickness."""
    return _bare(name) in INSTRUMENT or _bare(name).startswith("thickness")


def _unseen(names: tuple[str, ...], unseen: np.ndarray) -> Iterator[Finding]:
    """Yield one finding for each combination (P,) that the data do not determine."""
    for direction in unseen.T:
        parts = np.abs(direction) > 0.1 * np.abs(direction).max()
        yield _finding(
            "not_seen", parameters=tuple(n for n, part in zip(names, parts, strict=True) if part)
        )


def _correlated(names: tuple[str, ...], correlation: np.ndarray) -> list[Finding]:
    out = []
    for i, first in enumerate(names):
        for j in range(i):
            second, c = names[j], correlation[i, j]
            outer = is_outer(first) or is_outer(second)
            if np.isfinite(c) and abs(c) > (CORRELATED if outer else CORRELATED_WITHIN):
                out.append((second, first, float(c)))
    out.sort(key=lambda pair: -abs(pair[2]))
    if not out:
        return []
    seconds, firsts, values = zip(*out, strict=True)
    return [_finding("correlated", first=seconds, second=firsts, correlation=values)]


# If a film is thinner than this part of the wavelength, and its thickness and index are correlated
# by more than this, the data determine little more than their product.
_THIN, _ONE_PRODUCT = 0.08, 0.95


def _thin_film(
    known: Mapping[str, Estimate], correlation: np.ndarray, shortest_um: float
) -> Iterator[Finding]:
    """Yield the finding that only the product of thickness and index of a thin film is known."""
    for (name, e), row in zip(known.items(), np.abs(correlation), strict=True):
        if not name.endswith("thickness_nm") or not e.value < _THIN * 1e3 * shortest_um:
            continue
        head = name.removesuffix("thickness_nm")
        own = {
            n: c for n, c in zip(known, row.tolist(), strict=True)
            if n != name and n.startswith(head) and c > _ONE_PRODUCT
        }  # fmt: skip
        if own and np.isfinite(e.sigma):
            share = e.sigma / e.value
            held = float(np.sqrt(max(1.0 - max(own.values()) ** 2, 0.0)))
            yield _finding(
                "thin_film", thickness=name, value=e.value, share=share, parameters=tuple(own),
                held_share=share * held,
            )  # fmt: skip


def _bounds(known: Mapping[str, Estimate]) -> Iterator[Finding]:
    for name, e in known.items():
        others = {n: other for n, other in known.items() if n != name}
        seen = tuple(n for n, other in others.items() if np.isfinite(other.sigma))
        at_bound = e.status in (AT_LOWER, AT_UPPER)
        of_others = {
            "others": seen if at_bound else (), "value": e.value,
            "profile": any(other.interval_kind == PROFILE for other in others.values()),
        }  # fmt: skip
        if np.isfinite(e.upper_limit):
            yield _finding("compatible_with_zero", parameter=name, limit=e.upper_limit, **of_others)
        elif at_bound:
            end = "lower" if e.status == AT_LOWER else "upper"
            yield _finding("at_bound", parameter=name, end=end, **of_others)


def _not_quadratic(known: Mapping[str, Estimate], quadratic: np.ndarray) -> list[Finding]:
    """Return the finding on parameters whose interval does not follow from the standard error."""
    bent = {}
    for (name, e), plain in zip(known.items(), quadratic, strict=True):
        off = np.abs(e.interval - plain).max() > OFF * 0.5 * (e.interval[1] - e.interval[0])
        if e.interval_kind == PROFILE and off and np.isfinite(e.sigma):
            bent[name] = e.interval.tolist(), plain.tolist()
    if not bent:
        return []
    own, by_sigma = map(list, zip(*bent.values(), strict=True))
    return [_finding("not_quadratic", parameters=tuple(bent), intervals=own, by_sigma=by_sigma)]


def _error(e: Estimate) -> float:
    """Return the standard error, or a quarter of an interval by profile if that is less."""
    low, high = e.interval
    return min(e.sigma, 0.25 * (high - low)) if e.interval_kind == PROFILE else e.sigma


def _open_and_poor(known: Mapping[str, Estimate]) -> Iterator[Finding]:
    if bent := without_slope(known):
        yield _finding("no_slope", parameters=bent)
    unlimited = tuple(n for n, e in known.items() if np.isinf(e.interval).any())
    if unlimited:
        yield _finding("open_interval", parameters=unlimited)
    vague = {
        n: _error(e) / abs(e.value) if e.value else np.inf for n, e in known.items()
        if _error(e) > VAGUE * abs(e.value)
        and not may_vanish(n) and not np.isfinite(e.upper_limit)
    }  # fmt: skip
    if vague:
        yield _finding("poorly_determined", parameters=tuple(vague), shares=tuple(vague.values()))


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
    if not _a_k_is_free(u) or not are_powers(m.quantity).all():
        return False
    waves = len(np.unique(m.wavelength_um))
    if waves == 1 and u.free.sum() > 1 and not end.known.unseen.size:
        return False
    columns = m.wavelength_um.tolist(), m.quantity.tolist(), m.angle_deg.tolist()
    normal = not m.angle_deg.any() and len(set(m.quantity.tolist())) == 1
    return normal or len({*zip(*columns, strict=True)}) == waves


def _on_measured(fit: Problem, of: Subject, end: End) -> Iterator[Finding]:
    """Yield what is told of a measurement; rows of the caller's own residuals have no angle."""
    m, sample = of.measurement, of.sample
    if m is None or sample is None:
        return
    if _by_the_model_alone(fit.u, m, end):
        yield _finding("by_the_model_alone")
    rms = float(np.sqrt(np.mean(end.slopes.plain**2)))
    if rms > OUT_OF_MODEL:
        said = "one bare surface" if sample.bare else "this stack" if sample.films else "this plate"
        yield _finding("does_not_describe", rms=rms, sample=said)
    order = pattern(m, at_data(fit.seen, end.slopes.seen), fit.seen.curve, fit.seen.stated)
    if order is not None:
        yield _finding(
            "residuals_in_order", along=order.along, correlation=order.correlation,
            chance=order.chance,
        )  # fmt: skip
    if not end.known.unseen.size:
        for code, values in implausible_indices(fit, end, np.unique(m.wavelength_um)).items():
            yield _finding(code, **values)


def _other_minima(known: Mapping[str, Estimate], others: tuple[Alternative, ...]) -> Finding:
    """Return the finding on other minima: the best, and the range of each thickness in all."""
    every = [known, *(a.parameters for a in others)]
    thicknesses = []
    for name in (n for n in known if "thickness" in n):
        values = [one[name].value for one in every]
        thicknesses.append((name, min(values), max(values)))
    first = {n: e.value for n, e in others[0].parameters.items()}
    return _finding(
        "other_minima", count=len(others), parameters=tuple(first), values=tuple(first.values()),
        delta_chi2=float(others[0].delta_chi2), thicknesses=tuple(thicknesses),
    )  # fmt: skip


def findings(
    fit: Problem, of: Subject, f: Found, known: Mapping[str, Estimate], correlation: np.ndarray,
    taken: str,
) -> tuple[Finding, ...]:  # fmt: skip
    """Return the findings on a finished fit, the most serious first.

    known: the free parameters; correlation: (P, P) of them. taken: how stated errors were used.
    An undetermined combination has a valley of equal chi2, which is one solution: starts end
    anywhere in it.
    """
    names, end, free = tuple(known), f.end, fit.u.free
    unseen = end.known.unseen[free]
    out = [*_unseen(names, unseen)]
    if f.fringeless is not None:
        out.append(_finding("fringes_in_noise", **f.fringeless))
    if of.measurement is not None and of.films:
        out += _thin_film(known, correlation, float(np.nanmin(of.measurement.wavelength_um)))
    out += _on_measured(fit, of, end)
    if f.others and not unseen.size:
        out.append(_other_minima(known, f.others))
    few = fit.starts > FEW_REACHED and f.reached < FEW_REACHED and f.fringeless is None
    if few and not unseen.size:
        out.append(_finding("few_starts_agree", starts=fit.starts, reached=f.reached))
    if f.lower:
        out.append(_finding("better_minimum_met", by=f.lower))
    out += [*_bounds(known), *_not_quadratic(known, f.known.quadratic[free])]
    out += [*_open_and_poor(known), *_correlated(names, correlation)]
    told = {**contradicted_errors(fit, end, taken), **contradicted_priors(fit, known)}
    out += [_finding(code, **values) for code, values in told.items()]
    if "angle_offset" in known and abs(known["angle_offset"].value) > PLAUSIBLE_OFFSET_DEG:
        out.append(_finding("implausible_offset", value=known["angle_offset"].value))
    if fit.dof == 0:
        stated = fit.seen.stated and any(np.isfinite(e.sigma) for e in known.values())
        out.append(_finding(
            "no_degrees_of_freedom", n_data=fit.n_data, unknowns=len(names), stated=stated
        ))  # fmt: skip
    return tuple(out)
