"""Which warnings a fit of shared parameters gets: the conditions and their thresholds."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from fitting.optics.instrument import INSTRUMENT
from fitting.residuals.error_model import CHI2_LARGE, CHI2_SMALL, chi2_flags
from fitting.residuals.pattern import Pattern
from fitting.results.diagnostics import Finding
from fitting.results.result import PROFILE
from fitting.uncertainty.intervals import OFF

# Parameters of one formula (A, B and C of Cauchy's) are usually correlated, which does no harm. A
# parameter of the instrument that is correlated with the index does (angle offset of the gold scan:
# .79 and .71).
CORRELATED_WITHIN, CORRELATED = 0.999, 0.7
VAGUE = 0.5
# The zero of a goniometer is known better than that.
PLAUSIBLE_OFFSET_DEG = 2.0
FEW_REACHED = 3
OUT_OF_MODEL = 0.1
_MAY_VANISH = (*(set(INSTRUMENT) - {"scale"}), *"BCDEF")  # and the higher terms of Cauchy's index


class Seen(NamedTuple):
    """How well the free parameters are known; arrays over them.

    intervals, quadratic: (P, 2), those of the result and the quadratic ones. unseen: (P, U),
    combinations that the data do not determine.
    """

    names: tuple[str, ...]
    values: np.ndarray
    sigmas: np.ndarray
    correlation: np.ndarray
    at_bound: tuple[str, ...]
    upper_limits: np.ndarray
    unseen: np.ndarray
    intervals: np.ndarray
    quadratic: np.ndarray
    kinds: tuple[str, ...]


class Quality(NamedTuple):
    """How well the fit describes the data, and how it was found.

    lower: by how much chi2 is lower at a fit near the minimum whose own minimum was not reached; 0
    if there is none. robust: whether chi2_reduced leaves outliers out. errors: how they were used.
    others: values of the best other minimum and by how much its chi2 is higher. fringeless: values
    of the warning that the fringes of a film are no larger than those of noise; None: they are.
    rising: names of the indices that rise with the wavelength although nothing absorbs.
    """

    chi2_reduced: float
    dof: int
    n_data: int
    stated: bool
    errors: str
    rms: float
    robust: bool
    starts: int
    reached: int
    lower: float
    pattern: Pattern | None
    by_the_model_alone: bool
    sample: str
    others: tuple[dict[str, float], ...]
    delta_chi2: float
    shortest_nm: float = np.inf
    fringeless: dict[str, Any] | None = None
    rising: tuple[str, ...] = ()


def _finding(code: str, **values: Any) -> Finding:
    return Finding(code, np.True_, values)


def _bare(name: str) -> str:
    return name.partition("[")[0].rpartition(".")[2]


def is_outer(name: str) -> bool:
    """Whether a parameter is not one of a material: of the instrument, or a thickness."""
    return _bare(name) in INSTRUMENT or _bare(name).startswith("thickness")


def _unseen(f: Seen) -> list[Finding]:
    """Return one finding for each combination that the data do not determine."""
    out = []
    for direction in f.unseen.T:
        parts = np.abs(direction) > 0.1 * np.abs(direction).max()
        names = tuple(n for n, part in zip(f.names, parts, strict=True) if part)
        out.append(_finding("not_seen", parameters=names))
    return out


def _correlated(f: Seen) -> list[Finding]:
    out = []
    for i, first in enumerate(f.names):
        for j in range(i):
            second, c = f.names[j], f.correlation[i, j]
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


def _thin_film(f: Seen, shortest_nm: float) -> list[Finding]:
    """Return the finding that only the product of thickness and index of a thin film is known."""
    out = []
    for i, name in enumerate(f.names):
        if not name.endswith("thickness_nm") or not f.values[i] < _THIN * shortest_nm:
            continue
        head = name.removesuffix("thickness_nm")
        own = [
            j for j, n in enumerate(f.names)
            if j != i and n.startswith(head) and abs(f.correlation[i, j]) > _ONE_PRODUCT
        ]  # fmt: skip
        if not own or not np.isfinite(f.sigmas[i]):
            continue
        share = float(f.sigmas[i] / f.values[i])
        most = float(max(abs(f.correlation[i, j]) for j in own))
        out.append(_finding(
            "thin_film", thickness=name, value=float(f.values[i]), share=share,
            parameters=tuple(f.names[j] for j in own),
            held_share=share * float(np.sqrt(max(1.0 - most**2, 0.0))),
        ))  # fmt: skip
    return out


def _bounds(f: Seen) -> list[Finding]:
    out = []
    for i, (name, end) in enumerate(zip(f.names, f.at_bound, strict=True)):
        value = float(f.values[i])
        others = [n for n, s in zip(f.names, f.sigmas, strict=True) if n != name and s == s]
        kinds = [k for n, k in zip(f.names, f.kinds, strict=True) if n != name]
        of_others = {
            "others": tuple(others) if end else (), "profile": PROFILE in kinds, "value": value
        }  # fmt: skip
        if np.isfinite(f.upper_limits[i]):
            limit = float(f.upper_limits[i])
            out.append(_finding("compatible_with_zero", parameter=name, limit=limit, **of_others))
        elif end:
            side = "lower" if end == "low" else "upper"
            out.append(_finding("at_bound", parameter=name, end=side, **of_others))
    return out


def _not_quadratic(f: Seen) -> list[Finding]:
    """Return the finding on parameters whose interval does not follow from the standard error."""
    half = 0.5 * (f.intervals[:, 1] - f.intervals[:, 0])
    off = np.abs(f.intervals - f.quadratic).max(axis=1) > OFF * half
    bent = [
        i for i, kind in enumerate(f.kinds)
        if kind == PROFILE and off[i] and np.isfinite(f.sigmas[i])
    ]  # fmt: skip
    if not bent:
        return []
    names = tuple(f.names[i] for i in bent)
    return [_finding("not_quadratic", parameters=names, intervals=f.intervals[bent].tolist(),
                     by_sigma=f.quadratic[bent].tolist())]  # fmt: skip


def _open_and_poor(f: Seen) -> list[Finding]:
    ends = zip(f.names, f.intervals, strict=True)
    unlimited = tuple(n for n, pair in ends if np.isinf(pair).any())
    out = [_finding("open_interval", parameters=unlimited)] if unlimited else []
    with np.errstate(all="ignore"):
        share = f.sigmas / np.abs(f.values)
    vague = tuple(
        (n, float(s))
        for n, s, limit in zip(f.names, share, f.upper_limits, strict=True)
        if s > VAGUE and _bare(n) not in _MAY_VANISH and not np.isfinite(limit)
    )
    if not vague:
        return out
    names, shares = zip(*vague, strict=True)
    return [*out, _finding("poorly_determined", parameters=names, shares=shares)]


def _chi2(q: Quality) -> list[Finding]:
    if not np.isfinite(q.chi2_reduced):
        return []
    flags = int(chi2_flags(np.array(q.chi2_reduced), np.array(q.dof)))
    values = {
        "chi2_reduced": q.chi2_reduced, "factor": float(np.sqrt(q.chi2_reduced)),
        "errors": q.errors, "robust": q.robust,
    }  # fmt: skip
    large = [_finding("chi2_large", **values)] if flags & CHI2_LARGE else []
    return large + ([_finding("chi2_small", **values)] if flags & CHI2_SMALL else [])


def order_of_residuals(p: Pattern) -> Finding:
    """Return the finding on autocorrelated residuals."""
    return _finding("residuals_in_order", along=p.along, correlation=p.correlation, chance=p.chance)


def _thicknesses(f: Seen, q: Quality) -> tuple[tuple[str, float, float], ...]:
    """Return the name of each thickness with its least and its largest value of all solutions."""
    shown = dict(zip(f.names, f.values.tolist(), strict=True))
    out = []
    for name in (n for n in shown if "thickness" in n):
        values = [shown[name], *(other[name] for other in q.others)]
        out.append((name, min(values), max(values)))
    return tuple(out)


def findings(f: Seen, q: Quality) -> tuple[Finding, ...]:
    """Return the findings on a finished fit, the most serious first.

    An undetermined combination has a valley of equal chi2, which is one solution: starts end
    anywhere in it.
    """
    out = _unseen(f)
    if q.fringeless is not None:
        out.append(_finding("fringes_in_noise", **q.fringeless))
    out += _thin_film(f, q.shortest_nm)
    if q.by_the_model_alone:
        out.append(_finding("by_the_model_alone"))
    if q.rms > OUT_OF_MODEL:
        out.append(_finding("does_not_describe", rms=q.rms, sample=q.sample))
    if q.pattern is not None:
        out.append(order_of_residuals(q.pattern))
    if q.rising:
        out.append(_finding("rising_index", indices=q.rising))
    if q.others and not f.unseen.size:
        out.append(_finding(
            "other_minima", count=len(q.others), parameters=tuple(q.others[0]),
            values=tuple(q.others[0].values()), delta_chi2=q.delta_chi2,
            thicknesses=_thicknesses(f, q),
        ))  # fmt: skip
    if q.starts > FEW_REACHED and q.reached < FEW_REACHED and not f.unseen.size:
        out.append(_finding("few_starts_agree", starts=q.starts, reached=q.reached))
    if q.lower:
        out.append(_finding("better_minimum_met", by=q.lower))
    out += _bounds(f) + _not_quadratic(f) + _open_and_poor(f) + _correlated(f) + _chi2(q)
    offset = float(dict(zip(f.names, f.values, strict=True)).get("angle_offset", 0.0))
    if abs(offset) > PLAUSIBLE_OFFSET_DEG:
        out.append(_finding("implausible_offset", value=offset))
    if q.dof == 0:
        stated = q.stated and bool(np.isfinite(f.sigmas).any())
        out.append(_finding(
            "no_degrees_of_freedom", n_data=q.n_data, unknowns=len(f.names), stated=stated
        ))  # fmt: skip
    return tuple(out)
