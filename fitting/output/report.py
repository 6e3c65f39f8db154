"""What a person reads of a fit: the table on the terminal."""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from fitting.index.fit import FitResult
    from fitting.measurement import Measurement

# An rms of R below that is rounding: eps times some units.
ROUNDING = 1e-15
_LABEL = 13
_NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def number(value: float, digits: int = 4) -> str:
    """Return ``value`` with that many significant digits, trailing zeros kept; "-" for NaN."""
    if math.isnan(value):
        return "-"
    text = f"{value:#.{digits}g}"
    return text.removesuffix(".")


def with_error(value: float, sigma: float) -> str:
    """Return ``0.344 +- 0.031``: the error with two digits, the value to the same place.

    Without an error (NaN) six digits of the value; an error below 1e-12 of the value is shown by
    its magnitude, since the value has no more digits to show.
    """
    if math.isnan(value):
        return "-"
    if not (math.isfinite(sigma) and sigma > 0.0):
        return f"{value:.6g}"
    if sigma < 1e-12 * abs(value):
        return f"{value:.13g} +- {sigma:.0e}"
    exponent = math.floor(math.log10(float(f"{sigma:.1e}")))
    decimals = 1 - exponent
    if 0 <= decimals <= 9 and max(abs(value), sigma) >= 1e-3:
        return f"{value:.{decimals}f} +- {sigma:.{decimals}f}"
    # Far from 1: one power of ten for both, that of the larger.
    power = math.floor(math.log10(max(abs(value), sigma)))
    decimals = max(power - exponent + 1, 1)
    scale = 10.0**power
    return f"({value / scale:.{decimals}f} +- {sigma / scale:.{decimals}f})e{power:+03d}"


def between(low: float, high: float) -> str:
    """Return ``1.4959 to 1.5030``: both ends to the second digit of the distance between them."""
    if not high > low:
        return f"{low:.6g} to {high:.6g}"
    exponent = math.floor(math.log10(high - low))
    decimals = 1 - exponent
    if not 0 <= decimals <= 9:
        # As many digits as tell the ends apart, of a very narrow interval too.
        size = math.floor(math.log10(max(abs(low), abs(high))))
        digits = min(max(6, size - exponent + 2), 17)
        return f"{low:.{digits}g} to {high:.{digits}g}"
    return f"{low:.{decimals}f} to {high:.{decimals}f}" if low else f"0 to {high:.{decimals}f}"


def _k_text(k: float, sigma_k: float, upper: float, status: str) -> str:
    limit = f" (< {number(upper, 2)})" if math.isfinite(upper) else ""
    if k == 0.0 or status == "converged at k = 0":
        return "0" + limit
    return (with_error(k, sigma_k) if math.isfinite(sigma_k) or not limit else number(k, 2)) + limit


def wrapped(label: str, text: str, width: int) -> str:
    """Return a label and a text beside it, in lines of at most ``width`` characters."""
    indent = " " * (2 + _LABEL)
    first = f"  {label:<{_LABEL}}"
    return textwrap.fill(
        text,
        max(width, 40),
        initial_indent=first,
        subsequent_indent=indent,
        break_long_words=False,
        break_on_hyphens=False,
    )


def how_made(sigma_kind: str, chi2: Any, dof: Any) -> str:
    """Return how standard errors of one fit or many were made; chi2 is NaN without stated ones."""
    stated = np.isfinite(np.asarray(chi2))
    if sigma_kind == "absolute" or np.all(stated & (np.asarray(dof) == 0)):
        return "one standard error, from the stated errors as they are"
    if not stated.any():
        return "one standard error, from the scatter about the fit (equal weights)"
    return "one standard error, from the stated errors times sqrt(chi2/dof)"


def _errors_text(result: FitResult) -> str:
    """Return how the standard errors were made; "" where there are none."""
    if not np.any(np.isfinite(np.asarray(result.sigma_eta))):
        return ""
    return how_made(result.sigma_kind, result.chi2, result.dof)


def _head(result: FitResult, measurement: Measurement) -> list[tuple[str, str]]:
    incident = f"light from a medium of index {result.eta_i:.10g}"
    return [
        ("read", measurement.understood.removeprefix("read ")),
        ("model", f"one bare interface, {incident}"),
    ]


def remedy(status: Iterable[str], spectrum: bool) -> list[tuple[str, str]]:
    """Return the row that says what to do where most curves are undetermined; none elsewhere."""
    status = list(status)
    if 2 * status.count("undetermined") <= len(status):
        return []
    text = "measure s and p at several angles, some of them beyond 60 degrees"
    also = "; or fit a model to the whole spectrum: --model auto" if spectrum else ""
    return [("what to do", text + also)]


def _one_curve(result: FitResult) -> list[tuple[str, str]]:
    undetermined = result.status == "undetermined"
    aside = "  (one of many that fit alike; see the warning)" if undetermined else ""
    limit = ", 95 % upper limit in brackets" if math.isfinite(result.k_upper_limit) else ""
    k = _k_text(result.k, result.sigma_k, result.k_upper_limit, result.status)
    rows = [("eta", with_error(result.eta, result.sigma_eta) + aside), ("k", k + limit + aside)]
    if result.interval_kind == "profile":
        ends = f"eta {between(*result.eta_interval)}, k {between(*result.k_interval)}"
        rows.append(("95 % range", f"{ends} (by the likelihood itself)"))
    if not math.isnan(result.correlation):
        rows.append(("correlation", f"{result.correlation:.3f}"))
    if not math.isnan(result.chi2):
        each = f"{number(result.chi2_reduced, 3)}" if result.dof else "-"
        rows.append(("chi2/dof", f"{each}  ({number(result.chi2)} / {result.dof})"))
    else:
        rows.append(("dof", str(result.dof)))
    rms = f"{number(result.rms, 3)}  (of R, unweighted)"
    rows.append(("rms", "0, to the rounding of the data" if result.rms < ROUNDING else rms))
    if errors := _errors_text(result):
        rows.append(("errors", errors))
    rows.append(("status", f"{result.status}, {result.iterations} evaluations"))
    for other in result.alternatives:
        text = f"eta {number(other['eta'])}, k {number(other['k'])} fits nearly as well: "
        rows.append(("or else", text + f"chi2 + {number(other['delta_chi2'], 2)}"))
    return rows + remedy([result.status], False)


def _spectrum(result: FitResult) -> list[tuple[str, str]]:
    status = np.asarray(result.status).tolist()
    counts = ", ".join(f"{status.count(one)} {one}" for one in dict.fromkeys(status))
    rows = [("status", f"{len(status)} wavelengths: {counts}")]
    if errors := _errors_text(result):
        rows.append(("errors", errors))
    if np.isfinite(result.k_upper_limit).any():
        rows.append(("(< k)", "95 % upper limit of k"))
    return rows + remedy(status, True)


def facts(result: FitResult, measurement: Measurement) -> list[tuple[str, str]]:
    """Return what was read, fitted and found, label and text; of a spectrum what holds for all."""
    found = _one_curve(result) if np.ndim(result.eta) == 0 else _spectrum(result)
    return [*_head(result, measurement), *found]


def labelled(texts: Iterable[tuple[str, str]], width: int) -> list[str]:
    """Return labels and texts as lines below an empty one; no line at all without a text."""
    lines = [wrapped(label, text, width) for label, text in texts]
    return ["", *lines] if lines else []


class Told(NamedTuple):
    """The warnings of many curves, each kind of them once.

    texts: the first of each kind, and where. marks: for each curve the numbers of its kinds.
    """

    texts: list[str]
    marks: list[str]


def told_once(warnings: Sequence[Sequence[str]], names: Sequence[str]) -> Told:
    """Return the warnings of the curves ``names``; two are of one kind if only numbers differ."""
    kinds: dict[str, list[int]] = {}
    firsts: dict[str, str] = {}
    marks = []
    for i, texts in enumerate(warnings):
        own = {_NUMBER.sub("#", text): text for text in texts}
        for kind, text in own.items():
            firsts.setdefault(kind, text)
            kinds.setdefault(kind, []).append(i)
        marks.append(own)
    told = []
    for kind, members in kinds.items():
        where = f"at {names[members[0]]} um"
        if len(members) > 1:
            own = "and, with figures of their own," if "#" in kind else "and"
            where += f" {own} {len(members) - 1} more"
        told.append(f"{firsts[kind]} ({where})")
    return Told(told, [
        " ".join(str(i) for i, kind in enumerate(kinds, 1) if kind in own) for own in marks
    ])  # fmt: skip


def _told(result: FitResult) -> Told:
    names = [f"{w:.6g}" for w in np.asarray(result.wavelength_um).tolist()]
    return told_once([tuple(texts) for texts in result.warnings], names)


def grouped_warnings(result: FitResult) -> list[str]:
    """Return the warnings; of a spectrum each kind once, with where it holds."""
    return list(result.warnings) if np.ndim(result.eta) == 0 else _told(result).texts


def rows_aligned(rows: list[list[str]]) -> list[str]:
    """Return rows of cells as lines with the columns below each other."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    return [
        "  " + "  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip()
        for row in rows
    ]


def _many_curves(result: FitResult, width: int) -> list[str]:
    told = _told(result)
    rows = [["wavelength_um", "eta", "k", "chi2/dof", "rms", "status", "notes" * bool(told.texts)]]
    for i, mark in enumerate(told.marks):
        curve = result.at(i)
        index = (
            with_error(curve.eta, curve.sigma_eta),
            _k_text(curve.k, curve.sigma_k, curve.k_upper_limit, curve.status),
        )
        # In brackets: one of many that fit alike.
        loose = curve.status == "undetermined"
        rows.append([
            f"{curve.wavelength_um:.6g}",
            *(f"({text})" if loose else text for text in index),
            number(curve.chi2_reduced, 3),
            number(curve.rms, 3),
            curve.status,
            mark,
        ])  # fmt: skip
    lines = rows_aligned(rows)
    lines += ["", *(wrapped(label, text, width) for label, text in _spectrum(result))]
    return lines + labelled(((f"note {i}", text) for i, text in enumerate(told.texts, 1)), width)


def table(result: FitResult, measurement: Measurement, width: int = 80) -> str:
    """Return the fit as lines of at most ``width`` characters (rows of a spectrum are longer).

    result: of `fitting.fit` on ``measurement``; one curve, or one a wavelength.
    One curve: what was read, eta and k with one standard error, how they are correlated, chi2, rms,
    status, second solutions and warnings. A spectrum: one line a wavelength, warnings of one kind
    together under a number.
    """
    one = np.ndim(result.eta) == 0
    head = [wrapped(label, text, width) for label, text in _head(result, measurement)]
    lines = [measurement.source, *head, ""]
    if one:
        lines += [wrapped(label, text, width) for label, text in _one_curve(result)]
        lines += labelled((("warning", text) for text in result.warnings), width)
    else:
        lines += _many_curves(result, width)
    if result.notes:
        lines += labelled((("note", text) for text in result.notes), width)
    return "\n".join(lines) + "\n"
