"""What a person and a script read of a fitted model: table, JSON and CSV."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from fitting.model.result import UNDETERMINED, ModelFit
from fitting.observe import NUISANCES
from fitting.output.export import csv_text, measured_columns
from fitting.output.report import between, how_made, number, with_error, wrapped
from fitting.plain_data import json_object

# Second solutions, and pairs of parameters, that are shown.
_OTHERS, _PAIRS = 3, 6


def _what(fit: ModelFit) -> str:
    name = "a thick slab, both faces" if fit.structure == "slab" else "one bare interface"
    return f"{fit.model}, {name}, light from a medium of index {fit.eta_i:.10g}"


def _value(fit: ModelFit, i: int) -> str:
    unit = f" {fit.units[i]}" if fit.units[i] else ""
    limit = fit.upper_limits[i]
    if math.isfinite(limit):
        return f"{number(fit.values[i], 2)}{unit} (< {number(limit, 2)}, 95 % upper limit)"
    text = with_error(float(fit.values[i]), float(fit.sigmas[i])) + unit
    end = {"low": "lower", "high": "upper"}.get(fit.at_bound[i])
    return f"{text}  (at its {end} bound)" if end else text


def range_text(low: float, high: float) -> str:
    """Return an interval as text; "" for none, "any" end that is infinitely far."""
    if math.isnan(low) or math.isnan(high):
        return ""
    if math.isinf(low) and math.isinf(high):
        return "any"
    if math.isinf(low):
        return f"below {number(high)}"
    if math.isinf(high):
        return f"above {number(low)}"
    # Digits of the distance would leave none of a low end that is far below the high one.
    apart = 0.0 < 3.0 * low < high or 0.0 < max(abs(low), abs(high)) < 1e-2
    if apart:
        return f"{number(low, 3) if low else '0'} to {number(high, 3)}"
    return between(low, high)


def other_text(other: dict[str, Any]) -> str:
    """Return a second solution: its values with their errors, and how much worse it fits."""
    values = ", ".join(
        f"{name} {with_error(value, other['sigmas'][name])}"
        for name, value in other["values"].items()
    )
    return f"{values}: chi2 {other['delta_chi2']:+.2g}"


def _ranges(fit: ModelFit) -> str:
    """Return the intervals that are not the quadratic ones."""
    return ", ".join(
        f"{name} {range_text(*ends)}"
        for name, ends, kind in zip(
            fit.names, fit.intervals.tolist(), fit.interval_kinds, strict=True
        )
        if kind == "profile"
    )


def errors_text(fit: ModelFit) -> str:
    """Return how the standard errors were made; "" where there are none."""
    if not np.isfinite(fit.sigmas).any():
        return ""
    if fit.loss != "squares":
        noise = "the stated errors" if fit.sigma_kind == "absolute" else "that noise"
        return (
            f"one standard error, from {noise} and the scatter as the {fit.loss} loss counts it "
            "(Huber's estimate)"
        )
    return how_made(fit.sigma_kind, fit.chi2, fit.dof)


def rms_text(fit: ModelFit) -> str:
    """Return the root mean square of the residuals, of all and of each quantity."""
    each = ", ".join(f"{kind} {number(v, 3)}" for kind, v in fit.rms_of.items())
    what = " of cos 2psi, sin 2psi cos Delta, sin 2psi sin Delta" if "NCS" in fit.rms_of else ""
    if len(fit.rms_of) > 1:
        return f"{number(fit.rms, 3)}  ({each.replace('NCS', 'psi and Delta')}{what}; unweighted)"
    return f"{number(fit.rms, 3)}  ({what.strip() or each}; unweighted)"


def status_text(fit: ModelFit) -> str:
    """Return the status, and how many starts agree; in a valley they end all along it."""
    agree = f"; {fit.reached} of {fit.starts} starts agree"
    return fit.status + ("" if fit.status == UNDETERMINED else agree)


def others_of(fit: ModelFit) -> tuple[dict[str, Any], ...]:
    """Return the second solutions that are shown: none of a valley, which is all one."""
    return () if fit.status == UNDETERMINED else fit.others[:_OTHERS]


def _correlations(fit: ModelFit) -> str:
    """Return all correlations, or the largest of many."""
    pairs = [
        (fit.correlation[i, j], f"{fit.names[j]} and {fit.names[i]} ")
        for i in range(len(fit.names))
        for j in range(i)
        if np.isfinite(fit.correlation[i, j])
    ]
    many = len(pairs) > _PAIRS
    if many:
        pairs = sorted(pairs, key=lambda pair: -abs(pair[0]))
    text = ", ".join(f"{names}{c:+.3f}" for c, names in pairs[:_PAIRS])
    return f"{text} (the largest of {len(pairs)})" if many else text


def unseen_k(fit: ModelFit) -> bool:
    """Whether a parameter of the material is only known to be below a limit."""
    return any(
        np.isfinite(limit) and name.partition("[")[0] not in (*NUISANCES, "thickness_um")
        for name, limit in zip(fit.names, fit.upper_limits, strict=True)
    )


def k_text(k: float, sigma: float, unseen: bool) -> str:
    """Return k with its error; without one where it was not seen, see `unseen_k`."""
    # k^2 is what the data see: three of its errors are six of those of k.
    if unseen and 0.0 < k < 6.0 * sigma:
        return f"{number(k, 2)} (compatible with 0)"
    return with_error(k, sigma) if k else "0"


def _index_rows(fit: ModelFit) -> list[tuple[str, str]]:
    """Return eta and k at the ends and in the middle of a spectrum."""
    known = fit.measurement.wavelength_um
    known = np.unique(known[np.isfinite(known)])
    if len(known) < 2 or fit.model == "constant":
        return []
    at = known[[0, len(known) // 2, -1]]
    band, unseen = fit.index(at), unseen_k(fit)
    return [
        (f"at {w:.4g} um", f"eta {with_error(n, s)}, k {k_text(k, t, unseen)}")
        for w, n, s, k, t in zip(*(a.tolist() for a in band), strict=True)
    ]


def table(fit: ModelFit, width: int = 80) -> str:
    """Return the fit as lines of at most ``width`` characters.

    What was read; every parameter with one standard error; eta and k at three wavelengths; 95 %
    ranges that the errors do not tell; chi2, rms, correlations, how many starts agree, status and
    warnings.
    """
    m = fit.measurement
    lines = [m.source, wrapped("read", m.understood.removeprefix("read "), width)]
    lines += [wrapped("model", _what(fit), width), ""]
    values = [(name, _value(fit, i)) for i, name in enumerate(fit.names)]
    values += [(name, f"{value:.8g}  (held)") for name, value in fit.fixed.items()]
    # Long names push their value aside.
    lines += [wrapped(f"{name} ", text, width) for name, text in values]
    rows = _index_rows(fit)
    if not math.isnan(fit.chi2):
        each = number(fit.chi2_reduced, 3) if fit.dof else "-"
        rows.append(("chi2/dof", f"{each}  ({number(fit.chi2)} / {fit.dof})"))
    else:
        rows.append(("dof", str(fit.dof)))
    rows.append(("rms", rms_text(fit)))
    if fit.loss != "squares":
        rows.append(("loss", f"{fit.loss}, at a noise of {number(fit.noise, 3)}"))
    if errors := errors_text(fit):
        rows.append(("errors", errors))
    if ranges := _ranges(fit):
        rows.append(("95 % range", f"{ranges} (by the likelihood itself)"))
    if correlations := _correlations(fit):
        rows.append(("correlation", correlations))
    rows.append(("criteria", f"BIC {fit.bic:.2f}, AICc {fit.aicc:.2f}"))
    rows.append(("status", status_text(fit)))
    lines += ["", *(wrapped(label, text, width) for label, text in rows)]
    for other in others_of(fit):
        lines.append(wrapped("or else", other_text(other), width))
    texts = [("warning", w) for w in fit.warnings] + [("note", n) for n in fit.notes]
    if texts:
        lines += ["", *(wrapped(label, text, width) for label, text in texts)]
    return "\n".join(lines) + "\n"


def _spectrum(fit: ModelFit) -> dict[str, list[float]]:
    known = fit.measurement.wavelength_um
    known = np.unique(known[np.isfinite(known)])
    if not len(known):
        return {}
    return {n: a.tolist() for n, a in fit.index(known)._asdict().items()}


def json_text(fit: ModelFit, more: dict[str, Any] | None = None) -> str:
    """Return the fit as a JSON object, a field a line: ``ModelFit.to_dict`` and eta and k.

    First ``source`` and ``understood``; last ``index``: eta and k at the measured wavelengths; and
    what is in ``more``.
    """
    m = fit.measurement
    fields: dict[str, Any] = {"source": m.source, "understood": m.understood, **fit.to_dict()}
    fields |= {"index": _spectrum(fit), **(more or {})}
    return json_object(fields)


def _comments(fit: ModelFit) -> list[str]:
    values = ", ".join(f"{n} {v!r}" for n, v in fit.parameters.items())
    return [f"{fit.measurement.source}: {fit.measurement.understood}",
            f"{_what(fit)}: {values}, {fit.status}"]  # fmt: skip


def data_csv(fit: ModelFit) -> str:
    """Return the measurement as CSV, a datum a row, with the fitted value and its error beside."""
    curves = [fit.curve_names[i].replace(",", " ") for i in fit.curve]
    columns = {"curve": curves, **measured_columns(fit.measurement, *fit.fitted())}
    return csv_text(_comments(fit), columns)


def index_csv(fit: ModelFit) -> str:
    """Return eta and k at the measured wavelengths as CSV, a wavelength a row."""
    return csv_text(_comments(fit), dict(_spectrum(fit)))
