"""The page of a fitted dispersion model, in one HTML file."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fitting.candidates import Choice, choice_table
from fitting.output.model_report import (
    errors_text,
    k_text,
    other_text,
    others_of,
    range_text,
    rms_text,
    status_text,
    unseen_k,
)
from fitting.output.page import Table, page
from fitting.output.report import number, with_error
from fitting.output.report_page import data_table

if TYPE_CHECKING:
    from fitting.model.result import ModelFit


def _facts(fit: ModelFit) -> list[tuple[str, str]]:
    rows = [
        ("read", fit.measurement.understood.removeprefix("read ")),
        ("model", f"{fit.model}, {fit.structure}, light from a medium of index {fit.eta_i:.10g}"),
        ("status", status_text(fit)),
        ("data", f"{fit.n_data}, degrees of freedom {fit.dof}"),
    ]
    if np.isfinite(fit.chi2_reduced):
        rows.append(("chi2/dof", f"{number(fit.chi2_reduced, 3)}  ({number(fit.chi2)})"))
    rows.append(("rms", rms_text(fit)))
    rows.append(("criteria", f"BIC {fit.bic:.2f}, AICc {fit.aicc:.2f}"))
    if fit.loss != "squares":
        rows.append(("loss", f"{fit.loss}, at a noise of {number(fit.noise, 3)}"))
    if errors := errors_text(fit):
        rows.append(("errors", errors))
    if "profile" in fit.interval_kinds:
        rows.append(("95 % range", "with *: by the likelihood itself, all other parameters free"))
    for other in others_of(fit):
        rows.append(("or else", other_text(other)))
    return rows


def _correlations(fit: ModelFit) -> Table:
    rows = [
        [name, *(("-" if np.isnan(c) else f"{c:+.3f}") for c in row)]
        for name, row in zip(fit.names, fit.correlation.tolist(), strict=True)
    ]
    return Table("Correlations", ["", *fit.names], rows)


def _parameters(fit: ModelFit) -> Table:
    rows = []
    for i, name in enumerate(fit.names):
        limit = fit.upper_limits[i]
        end = {"low": "at its lower bound", "high": "at its upper bound"}.get(fit.at_bound[i], "")
        within = range_text(*fit.intervals[i].tolist())
        if fit.interval_kinds[i] == "profile":
            within += " *"
        rows.append([
            name, with_error(float(fit.values[i]), float(fit.sigmas[i])), fit.units[i], within,
            f"< {number(float(limit), 2)}" if np.isfinite(limit) else "", end,
        ])  # fmt: skip
    rows += [[name, f"{value:.8g}", "", "", "", "held"] for name, value in fit.fixed.items()]
    return Table("Parameters", ["", "value", "unit", "95 % range", "95 % limit", ""], rows)


def _index(fit: ModelFit) -> list[Table]:
    waves = np.unique(fit.measurement.wavelength_um[np.isfinite(fit.measurement.wavelength_um)])
    if not len(waves):
        return []
    rows = [
        [f"{w:.6g}", with_error(n, s), k_text(k, t, unseen_k(fit))]
        for w, n, s, k, t in zip(*(a.tolist() for a in fit.index(waves)), strict=True)
    ]
    return [Table("Index over wavelength", ["wavelength, um", "eta", "k"], rows)]


def model_page(fit: ModelFit, png: bytes, command: str, choice: Choice | None = None) -> str:
    """Return the page of a model fit.

    png: the picture (`plot_model`). command: how the fit was asked for, for the foot.
    choice: the comparison of models, if one was made.
    """
    tables = [_parameters(fit)]
    if len(fit.names) > 1:
        tables.append(_correlations(fit))
    reasons: tuple[str, ...] = ()
    if choice is not None:
        head, *rows = choice_table(choice)
        tables.append(Table("Models compared", head, rows))
        reasons = choice.reasons
    m = fit.measurement
    fitted, _ = fit.fitted()
    caption = "Data with one standard error and the model with its one-sigma band, data - fit; "
    return page(
        m.source,
        _facts(fit),
        fit.warnings,
        [*reasons, *fit.notes],
        [(caption + "of a spectrum also eta and k over wavelength.", png)],
        [*tables, *_index(fit), data_table(m, fitted)],
        command,
    )
