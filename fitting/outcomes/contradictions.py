"""Whether the data contradict what was said of them: their standard errors, and priors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fitting.problem.problem import Problem
from fitting.residuals.error_model import beyond_chance
from fitting.results.result_parts import Estimate
from fitting.uncertainty.covariance import End
from fitting.uncertainty.likelihood import reduced_chi2

# A fit lies between its prior and what the data alone give: by chance it is farther from the prior
# than so many of its standard errors in less than one of 10,000 fits.
PRIOR_ERRORS = 4.0


def contradicted_errors(fit: Problem, end: End, taken: str) -> dict[str, dict[str, Any]]:
    """Return the findings on residuals that contradict the standard errors, values by code.

    taken: how these were used. The caller's own residuals are in units of them, too; where they are
    taken as relative ones ("scaled"), smaller residuals than 1 say nothing.
    """
    loss = fit.u.spec.loss
    reduced = reduced_chi2(loss, end.slopes.residual, fit.dof)
    own = not fit.seen.curve_names
    if not (fit.seen.stated or own) or not np.isfinite(reduced):
        return {}
    large, small = beyond_chance(reduced, fit.dof)
    values = {
        "chi2_reduced": reduced, "factor": float(np.sqrt(reduced)),
        "errors": taken if fit.seen.stated else "scaled", "robust": loss != "squares",
    }  # fmt: skip
    told = {"chi2_large": large, "chi2_small": small and fit.seen.stated}
    return {code: values for code, is_so in told.items() if is_so}


def contradicted_priors(fit: Problem, known: Mapping[str, Estimate]) -> dict[str, dict[str, Any]]:
    """Return the finding on priors from which the fit is far away, by code."""
    away = {}
    for moving in fit.u.moving:
        name = fit.u.labels.get(moving.parameter.name, "")
        if moving.prior is None or name not in known:
            continue
        mean, sigma = moving.prior
        errors = abs(known[name].value - mean) / sigma
        if errors > PRIOR_ERRORS:
            away[name] = (mean, sigma, known[name].value, errors)
    return {"prior_contradicted": {"priors": away}} if away else {}
