"""What a person and a script read of fits wavelength by wavelength (`PointFits`)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from fitting.model.points import PointFits
from fitting.model.result import ModelFit
from fitting.output.export import csv_text, measured_columns
from fitting.output.model_report import range_text
from fitting.output.report import (
    Told,
    how_made,
    labelled,
    number,
    remedy,
    rows_aligned,
    told_once,
    with_error,
    wrapped,
)
from fitting.plain_data import json_object
from fitting.pseudo_index import misses


def names_of(fits: PointFits) -> str:
    """Return what eta and k are: those of a medium, or a pseudo-index."""
    return "pseudo-index <n>, <k>" if fits.pseudo else "eta, k"


def _symbols(fits: PointFits) -> tuple[str, str]:
    return ("<n>", "<k>") if fits.pseudo else ("eta", "k")


def _what(fits: PointFits) -> str:
    d = fits.fits[0].fixed.get("thickness_um")
    slab = f"a slab of {d:.6g} um, both faces" if d is not None else "one bare interface"
    each = ", wavelength by wavelength" if len(fits.fits) > 1 else ""
    return f"{names_of(fits)} of {slab}{each}, light from a medium of index {fits.eta_i:.10g}"


def k_text(fits: PointFits, i: int) -> str:
    """Return k of the i-th wavelength with its error, or with its upper limit in brackets."""
    fit = fits.fits[i]
    limit = fit.upper_limits[fit.names.index("k")]
    if math.isfinite(limit):
        return f"{number(fit.value_of('k'), 2)} (< {number(limit, 2)})"
    return with_error(fit.value_of("k"), fit.sigma_of("k"))


def eta_text(fits: PointFits, i: int) -> str:
    """Return eta of the i-th wavelength with its error."""
    return with_error(fits.fits[i].value_of("eta"), fits.fits[i].sigma_of("eta"))


def one_line(fits: PointFits) -> str:
    """Return the index of the only wavelength in one line."""
    n, k = _symbols(fits)
    return (
        f"{n} = {eta_text(fits, 0)}     {k} = {k_text(fits, 0)}     rms = {number(fits.rms[0], 2)}"
    )


def told_of(fits: PointFits) -> Told:
    """Return the warnings of all wavelengths, each kind once."""
    if len(fits.fits) == 1:
        return Told(list(fits.fits[0].warnings), [""])
    # What `notes_of` says of all wavelengths together.
    texts = []
    for f in fits.fits:
        elsewhere = ["as well"]
        if fits.pseudo and misses(f):
            elsewhere.append("ended at the lower end of its range, 0")
        texts.append(tuple(t for t in f.warnings if not any(words in t for words in elsewhere)))
    return told_once(texts, [f"{w:.6g}" for w in fits.wavelength_um.tolist()])


def _double(fits: PointFits) -> list[str]:
    double = sum(bool(f.others) and f.status == "converged" for f in fits.fits)
    if not double or len(fits.fits) == 1:
        return []
    return [
        f"at {double} wavelengths another index fits as well; shown is the one above 1 (at "
        "normal incidence an index and its inverse reflect alike). All are in the JSON file."
    ]


def notes_of(fits: PointFits) -> list[str]:
    """Return what is said of all wavelengths together."""
    return [*fits.notes, *_double(fits)]


def _errors(fits: PointFits) -> str:
    if not np.isfinite(fits.sigma_eta).any():
        return ""
    return how_made(fits.fits[0].sigma_kind, fits.chi2, [f.dof for f in fits.fits])


def _rms(fit: ModelFit) -> str:
    names = {"NCS": "cos 2psi, sin 2psi cos Delta and sin 2psi sin Delta"}
    each = [(names.get(q, q), number(v, 3)) for q, v in fit.rms_of.items()]
    text = f"of {each[0][0]}, " if len(each) == 1 else ""
    text += "; ".join(f"{name} {v}" for name, v in each) + "; " if len(each) > 1 else ""
    return f"{number(fit.rms, 3)}  ({text}unweighted)"


def _one(fits: PointFits) -> list[tuple[str, str]]:
    """Return label and text of everything that was found at the only wavelength."""
    fit, (n, k) = fits.fits[0], _symbols(fits)
    loose = fit.status == "undetermined"
    aside = "  (one of many that fit alike; see the warning)" if loose else ""
    limit = ", 95 % upper limit in brackets" if math.isfinite(fits.k_upper_limit[0]) else ""
    rows = [(n, eta_text(fits, 0) + aside), (k, k_text(fits, 0) + limit + aside)]
    if fits.interval_kind[0] == "profile":
        ends = range_text(*fits.eta_interval[0]), range_text(*fits.k_interval[0])
        rows.append(("95 % range", f"{n} {ends[0]}, {k} {ends[1]} (by the likelihood itself)"))
    if math.isfinite(fits.correlation[0]):
        rows.append(("correlation", f"{fits.correlation[0]:.3f}"))
    if math.isfinite(fit.chi2):
        each = number(fit.chi2_reduced, 3) if fit.dof else "-"
        rows.append(("chi2/dof", f"{each}  ({number(fit.chi2)} / {fit.dof})"))
    else:
        rows.append(("dof", str(fit.dof)))
    rows.append(("rms", _rms(fit)))
    if errors := _errors(fits):
        rows.append(("errors", errors))
    rows.append(("status", fit.status))
    for other in fit.others[:3]:
        values = ", ".join(f"{name} {number(v)}" for name, v in other["values"].items())
        rows.append(("or else", f"{values}: chi2 {other['delta_chi2']:+.2g}"))
    return rows + remedy(fits.status, False)


def _many(fits: PointFits) -> list[tuple[str, str]]:
    status, count = np.unique(fits.status, return_counts=True)
    total = ", ".join(f"{c} {s}" for s, c in zip(status, count, strict=True))
    rows = [("status", f"{len(fits.fits)} wavelengths: {total}")]
    if errors := _errors(fits):
        rows.append(("errors", errors))
    if np.isfinite(fits.k_upper_limit).any():
        rows.append(("(< k)", "95 % upper limit of k"))
    return rows + remedy(fits.status, True)


def facts(fits: PointFits) -> list[tuple[str, str]]:
    """Return what was read, fitted and found, label and text; of a spectrum what holds for all."""
    read = fits.measurement.understood.removeprefix("read ")
    found = _one(fits) if len(fits.fits) == 1 else _many(fits)
    return [("read", read), ("model", _what(fits)), *found]


def _rows(fits: PointFits, told: Told) -> list[list[str]]:
    stated = bool(np.isfinite(fits.chi2_reduced).any())
    head = ["wavelength_um", *_symbols(fits), *["chi2/dof"] * stated, "rms", "status"]
    rows = [[*head, "notes" * bool(told.texts)]]
    for i, (w, fit) in enumerate(zip(fits.wavelength_um.tolist(), fits.fits, strict=True)):
        # In brackets: one of many that fit alike.
        loose = fit.status == "undetermined"
        index = (f"({t})" if loose else t for t in (eta_text(fits, i), k_text(fits, i)))
        chi2 = [number(fit.chi2_reduced, 3)] * stated
        rows.append([
            f"{w:.6g}", *index, *chi2, number(fit.rms, 3), fit.status, told.marks[i]
        ])  # fmt: skip
    return rows


def table(fits: PointFits, width: int = 80) -> str:
    """Return the fits as lines of at most ``width`` characters (rows of a spectrum are longer).

    A spectrum has a line a wavelength, and warnings of one kind together under a number.
    """
    read, model, *found = [wrapped(label, text, width) for label, text in facts(fits)]
    told = told_of(fits)
    lines = [fits.measurement.source, read, model, ""]
    if len(fits.fits) > 1:
        lines += [*rows_aligned(_rows(fits, told)), ""]
    lines += found
    lines += labelled((("warning", text) for text in notes_of(fits)), width)
    label = "warning" if len(fits.fits) == 1 else "note {}"
    lines += labelled(((label.format(i), t) for i, t in enumerate(told.texts, 1)), width)
    return "\n".join(lines) + "\n"


def json_text(fits: PointFits) -> str:
    """Return the fits as a JSON object, a field a line, with the names of ``PointFits.to_dict``.

    NaN is null. First ``source`` and ``understood``.
    """
    m = fits.measurement
    fields: dict[str, Any] = {"source": m.source, "understood": m.understood, **fits.to_dict()}
    return json_object(fields)


def _comments(fits: PointFits) -> list[str]:
    return [f"{fits.measurement.source}: {fits.measurement.understood}", _what(fits)]


def data_csv(fits: PointFits) -> str:
    """Return the measurement as CSV, a datum a row, with the fitted value and its error beside."""
    return csv_text(_comments(fits), measured_columns(fits.measurement, *fits.fitted()))


def index_csv(fits: PointFits) -> str:
    """Return eta and k as CSV, a wavelength a row; what is not known is empty."""
    names = ("wavelength_um", "eta", "sigma_eta", "k", "sigma_k", "correlation", "k_upper_limit")
    names += ("chi2", "dof", "n_data", "rms", "status")
    columns = {name: getattr(fits, name).tolist() for name in names}
    for name in ("eta", "k"):
        low, high = getattr(fits, f"{name}_interval").T
        columns |= {f"{name}_low": low.tolist(), f"{name}_high": high.tolist()}
    return csv_text(_comments(fits), columns)
