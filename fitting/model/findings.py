"""What a person must know about a fitted model: sentences, the gravest first."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fitting.index.identifiability import CHI2_LARGE, CHI2_SMALL, chi2_flags
from fitting.index.intervals import PROFILE
from fitting.model.intervals import OFF
from fitting.model.structures import INTERFACE, NUISANCES
from fitting.pattern import Pattern

# Of parameters of one formula (A, B and C of Cauchy's) correlation is the rule and does no harm. A
# nuisance that trades with what is looked for does (the offset of the gold scan: .79 and .71).
CORRELATED_WITHIN, CORRELATED = 0.999, 0.7
VAGUE = 0.5
# A goniometer's zero is known better than that.
PLAUSIBLE_OFFSET_DEG = 2.0
FEW_REACHED = 3
OUT_OF_MODEL = 0.1


class Findings(NamedTuple):
    """What the sentences are made of; arrays over the free parameters.

    intervals, quadratic: (P, 2), those that are given and the quadratic ones. lower: chi2 by which
    a fit was better that was met beside the minimum and not reached; 0 for none. robust: whether
    chi2_reduced leaves outliers out.
    """

    names: tuple[str, ...]
    values: np.ndarray
    sigmas: np.ndarray
    correlation: np.ndarray
    at_bound: tuple[str, ...]
    upper_limits: np.ndarray
    unseen: np.ndarray
    chi2_reduced: float
    dof: int
    scaled: bool
    rms: float
    starts: int
    reached: int
    others: int
    structure: str
    absorbs: bool
    one_power_a_wavelength: bool
    wavelengths: int
    intervals: np.ndarray
    quadratic: np.ndarray
    interval_kinds: tuple[str, ...]
    lower: float
    pattern: Pattern | None
    robust: bool


def _number(value: float) -> str:
    return f"{value:.4g}"


def _is_nuisance(name: str) -> bool:
    return name.partition("[")[0] in (*NUISANCES, "thickness_um")


def _unseen(f: Findings) -> list[str]:
    """One sentence for each combination that the data do not see."""
    out = []
    for direction in f.unseen.T:
        parts = np.abs(direction) > 0.1 * np.abs(direction).max()
        names = [n for n, part in zip(f.names, parts, strict=True) if part]
        if len(names) == 1:
            out.append(f"{names[0]} is not determined: the data do not change with it.")
        else:
            joined = f"{', '.join(names[:-1])} and {names[-1]}"
            out.append(
                f"{joined} are not determined separately: some change of them together leaves the "
                "fit as it is. The values shown are one of many that fit alike; hold one of them, "
                "or give it a prior."
            )
    return out


def _correlated(f: Findings) -> list[str]:
    out = []
    for i, first in enumerate(f.names):
        for j in range(i):
            second, c = f.names[j], f.correlation[i, j]
            outer = _is_nuisance(first) or _is_nuisance(second)
            if np.isfinite(c) and abs(c) > (CORRELATED if outer else CORRELATED_WITHIN):
                out.append((abs(c), f"{second} and {first} are strongly correlated ({c:+.4f})"))
    if not out:
        return []
    out.sort(reverse=True)
    text = "; ".join(sentence for _, sentence in out[:4])
    pairs = "pair" if len(out) == 5 else "pairs"
    more = f"; and {len(out) - 4} more {pairs}" if len(out) > 4 else ""
    return [f"{text}{more}: their combination is known far better than either."]


def _of_the_others(f: Findings, name: str, value: float) -> str:
    """Return what the errors of the others mean, where ``name`` lies on a bound."""
    if not any(n != name and np.isfinite(s) for n, s in zip(f.names, f.sigmas, strict=True)):
        return ""
    text = f"the standard errors of the others hold for {name} = {_number(value)}"
    others = [k for n, k in zip(f.names, f.interval_kinds, strict=True) if n != name]
    return f"{text}, their 95 % ranges for all that it may be" if PROFILE in others else text


def _bounds(f: Findings) -> list[str]:
    out = []
    for i, (name, value, end) in enumerate(zip(f.names, f.values, f.at_bound, strict=True)):
        others = _of_the_others(f, name, value) if end else ""
        if np.isfinite(f.upper_limits[i]):
            text = (
                f"{name} is compatible with 0 and below what these data can show: {name} < "
                f"{_number(f.upper_limits[i])} (95 %)"
            )
            out.append(f"{text}; {others}." if others else f"{text}.")
        elif end:
            side = "lower" if end == "low" else "upper"
            text = f"{name} ended at the {side} end of its range, {_number(value)}: it has no "
            text += "standard error"
            out.append(f"{text}, and {others}." if others else f"{text}.")
    return out


def _range(ends: np.ndarray) -> str:
    return f"{_number(ends[0])} to {_number(ends[1])}"


def _not_quadratic(f: Findings) -> list[str]:
    """Say of which parameters the standard error does not tell the range."""
    half = 0.5 * (f.intervals[:, 1] - f.intervals[:, 0])
    off = np.abs(f.intervals - f.quadratic).max(axis=1) > OFF * half
    found = [
        f"{name}: {_range(ends)}, by its standard error {_range(quadratic)}"
        for name, ends, quadratic, kind, apart, sigma in zip(
            f.names, f.intervals, f.quadratic, f.interval_kinds, off, f.sigmas, strict=True
        )
        if kind == PROFILE and apart and np.isfinite(sigma)
    ]
    if not found:
        return []
    more = f"; and {len(found) - 4} more" if len(found) > 4 else ""
    why = " enough, or another one lies on a bound" if any(f.at_bound) else " in them"
    return [
        "standard errors do not tell how far these parameters may be off, since the fit is not "
        f"linear{why}; 95 % ranges by the likelihood itself are {'; '.join(found[:4])}{more}."
    ]


def _open(f: Findings) -> list[str]:
    """Name the parameters whose interval has no end."""
    names = [n for n, ends in zip(f.names, f.intervals, strict=True) if np.isinf(ends).any()]
    if not names:
        return []
    return [f"of {', '.join(names)} the data exclude no value, however far, on one side or both."]


def _vague(f: Findings) -> list[str]:
    with np.errstate(all="ignore"):
        share = f.sigmas / np.abs(f.values)
    may_vanish = ("background", "angle_offset", "leak", "divergence", "B", "C", "D", "E", "F")
    names = [
        n
        for n, s, limit in zip(f.names, share, f.upper_limits, strict=True)
        if s > VAGUE and n.partition("[")[0] not in may_vanish and not np.isfinite(limit)
    ]
    if not names:
        return []
    verb = "is" if len(names) == 1 else "are"
    return [
        f"{', '.join(names)} {verb} hardly determined: the standard error is more than half of the "
        "value."
    ]


def _chi2(f: Findings) -> list[str]:
    if not np.isfinite(f.chi2_reduced):
        return []
    flags = int(chi2_flags(np.array(f.chi2_reduced), np.array(f.dof)))
    factor, what = np.sqrt(f.chi2_reduced), "reduced chi2"
    what += ", without the outliers," * f.robust
    if flags & CHI2_LARGE:
        then = "scaled up by that factor" if f.scaled else "taken as stated, and so too small"
        return [
            f"{what} is {_number(f.chi2_reduced)}: the residuals are {factor:.2g} times the "
            f"stated errors, which are too small, or the model misses something; the errors of the "
            f"parameters are {then}."
        ]
    if flags & CHI2_SMALL:
        then = "; the errors of the parameters are scaled down by that" if f.scaled else ""
        if then and f.pattern is not None:
            then = ", yet they are in order: the errors of the parameters are too small"
        return [
            f"{what} is {_number(f.chi2_reduced)}: the residuals are only {factor:.2g} times "
            f"the stated errors, which look too large{then}."
        ]
    return []


def _by_the_model_alone(f: Findings) -> list[str]:
    if not (f.one_power_a_wavelength and f.absorbs):
        return []
    if f.wavelengths == 1 and len(f.names) > 1 and not f.unseen.size:
        return []
    return [
        "eta and k are not determined by the data alone: there is one reflectance or transmittance "
        "at each wavelength, at one angle. What separates them is the form of the model, far "
        "outside of the measured range too; the curve may fit well while eta and k are off by far "
        "more than their errors."
    ]


def not_noise(p: Pattern) -> str:
    """Return the sentence on residuals with a pattern."""
    return (
        f"what the fit leaves of the data is not noise: its neighbours along the {p.along} are "
        f"alike (correlation {p.correlation:.2f}, by chance below {p.chance:.2f}). The model does "
        "not describe the data, or they drift; the errors of the parameters are too small."
    )


def sentences(f: Findings) -> tuple[str, ...]:
    """Return the warnings of a fit that has ended, the gravest first.

    Where the data do not see some combination its valley is one solution: starts end all along it.
    """
    out = _unseen(f)
    out += _by_the_model_alone(f)
    if f.rms > OUT_OF_MODEL:
        what = "a bare interface" if f.structure == INTERFACE else "a slab"
        out.append(
            f"the fitted curve misses the data by {_number(f.rms)} (rms): this model of {what} "
            "does not describe them."
        )
    if f.pattern is not None:
        out.append(not_noise(f.pattern))
    if f.others and not f.unseen.size:
        out.append(
            f"{f.others} other minim{'um fits' if f.others == 1 else 'a fit'} as well (chi2 higher "
            'by less than 6); see "others".'
        )
    if f.starts > FEW_REACHED and f.reached < FEW_REACHED and not f.unseen.size:
        out.append(
            f"only {f.reached} of {f.starts} starts ended in the best minimum: a better one may "
            "exist. Take more starts, or fewer parameters."
        )
    if f.lower:
        out.append(
            f"a fit that is better by {_number(f.lower)} in chi2 (in units of the scatter) was met "
            "beside this minimum, but its own minimum was not reached. Take more starts, or fewer "
            "parameters."
        )
    out += _bounds(f) + _not_quadratic(f) + _open(f) + _vague(f) + _correlated(f) + _chi2(f)
    offset = dict(zip(f.names, f.values, strict=True)).get("angle_offset", 0.0)
    if abs(offset) > PLAUSIBLE_OFFSET_DEG:
        out.append(
            f"an angle offset of {_number(offset)} degrees is more than an instrument has: it "
            "stands in for something else."
        )
    if f.dof == 0:
        out.append("there are no more data than unknowns: nothing tests the fit.")
    return tuple(out)
