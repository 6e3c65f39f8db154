"""The sentences of all warnings and notes, by code: one table, the gravest first.

Each function takes the values of the finding (`diagnostics.Warning.values`) and returns what a
person reads; the keys that it looks up are the values that the code has.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np


def _n(value: float) -> str:
    return f"{value:.4g}"


def _list(names: Iterable[str]) -> str:
    *others, last = names
    return f"{', '.join(others)} and {last}" if others else last


_MEMBER = (
    "The values shown are the best fit, one of many that fit alike; the 95 % intervals are what "
    "the data leave."
)


def _mirror(v: Mapping[str, Any]) -> str:
    said = "the data are those of a strong mirror and do not determine eta and k"
    if not v["least_reflectance"] > 0.0:
        return said + ": R = 1 at every angle fits as well."
    return (
        f"{said}: every index with the same reflectance at normal incidence fits as well. That is "
        f"at least {v['least_reflectance']:.4f} (95 %); nothing else is known."
    )


def _circle(v: Mapping[str, Any]) -> str:
    m, eta, k = v["eta_i"], v["eta"], v["k"]
    a = (m * m + eta**2 + k**2) / (2.0 * eta)
    return (
        "eta and k are not determined separately: the data fix only the circle "
        f"(eta - {_n(a)})^2 + k^2 = {_n(a * a - m * m)}. {_MEMBER}"
    )


def _combination(v: Mapping[str, Any]) -> str:
    slope = v.get("slope", float("nan"))
    trade = f" (a change of eta by 1 is the same as one of k^2 by {_n(slope)})"
    return (
        "eta and k are not determined separately: the data fix only one combination of them"
        f"{trade if np.isfinite(slope) else ''}. {_MEMBER}"
    )


def _not_seen(v: Mapping[str, Any]) -> str:
    if len(v["parameters"]) == 1:
        return f"{v['parameters'][0]} is not determined: the data do not change with it."
    return (
        f"{_list(v['parameters'])} are not determined separately: a common change of them leaves "
        "the fitted curve as it is. The values shown are one of many that fit alike; fix one of "
        "them, or give it a prior."
    )


def _does_not_describe(v: Mapping[str, Any]) -> str:
    return (
        f"the fitted curve misses the data by {_n(v['rms'])} (rms): {v['sample']} does not "
        "describe them."
    )


def _residuals_in_order(v: Mapping[str, Any]) -> str:
    widened = v.get("widened", 1.0)
    then = (
        f"The standard errors are multiplied by {widened:.2g} for that, which may not be enough."
        if widened > 1.0
        else "The standard errors of the parameters are too small."
    )
    return (
        f"the residuals are autocorrelated along the {v['along']}, which noise is not (lag-1 "
        f"correlation {v['correlation']:.2f}; of noise below {v['chance']:.2f}): the model is "
        f"incomplete or the instrument drifted. {then}"
    )


def _other_minima(v: Mapping[str, Any]) -> str:
    pairs = zip(v["parameters"], v["values"], strict=True)
    values = ", ".join(f"{name} {_n(x)}" for name, x in pairs)
    many = f"{v['count']} other solutions fit" if v["count"] > 1 else "a second solution fits"
    best = "; the best of them has " if v["count"] > 1 else ": "
    return f"{many} nearly as well{best}{values} (chi2 higher by {v['delta_chi2']:.2g})."


def _at_bound(v: Mapping[str, Any]) -> str:
    return (
        f"{v['parameter']} ended at the {v['end']} end of its range, {_n(v['value'])}: it has no "
        f"standard error{_others_hold(v)}."
    )


def _others_hold(v: Mapping[str, Any]) -> str:
    if not v.get("others"):
        return ""
    text = f", and the standard errors of the others hold for {v['parameter']} = {_n(v['value'])}"
    return text + ", their 95 % intervals for all that it may be" * bool(v.get("profile"))


def _compatible_with_zero(v: Mapping[str, Any]) -> str:
    text = (
        f"{v['parameter']} is compatible with 0 and below what these data can show: "
        f"{v['parameter']} < {_n(v['limit'])} (95 %){_others_hold(v)}."
    )
    return text + " External reflectance depends on k^2 there." * bool(v.get("even"))


def _not_quadratic(v: Mapping[str, Any]) -> str:
    def ends(pair: Any) -> str:
        return f"{_n(pair[0])} to {_n(pair[1])}"

    rows = list(zip(v["parameters"], v["intervals"], v["by_sigma"], strict=True))
    each = "; ".join(
        f"{name}: {ends(own)}, by its standard error {ends(by_error)}"
        for name, own, by_error in rows[:4]
    )
    more = f"; and {len(rows) - 4} more" if len(rows) > 4 else ""
    return (
        "standard errors do not tell how far these parameters may be off, since the fit is not "
        f"linear enough; their 95 % intervals (profile likelihood) are {each}{more}."
    )


def _correlated(v: Mapping[str, Any]) -> str:
    pairs = list(zip(v["first"], v["second"], v["correlation"], strict=True))
    text = "; ".join(f"{a} and {b} are strongly correlated ({c:+.4f})" for a, b, c in pairs[:4])
    more = f"; and {len(pairs) - 4} more" if len(pairs) > 4 else ""
    return f"{text}{more}: their combination is known far better than either."


def _poorly_determined(v: Mapping[str, Any]) -> str:
    pairs = zip(v["parameters"], v["shares"], strict=True)
    each = _list(f"{name} ({100.0 * share:.2g} %)" for name, share in pairs)
    return f"poorly determined: the standard error is a large part of the value of {each}."


def _chi2_large(v: Mapping[str, Any]) -> str:
    then = {
        "scaled": "the errors of the parameters are scaled up by that factor",
        "floor": "an error common to all data is added to them in squares",
        "stated": "the errors of the parameters are taken as stated (absolute), and are too small",
    }[v["errors"]]
    outliers = ", without the outliers," * bool(v.get("robust"))
    return (
        f"reduced chi2{outliers} is {_n(v['chi2_reduced'])}: the residuals are {v['factor']:.2g} "
        "times the stated errors, which are too small, or the sample or the instrument is not "
        f"described completely; {then}."
    )


def _chi2_small(v: Mapping[str, Any]) -> str:
    outliers = ", without the outliers," * bool(v.get("robust"))
    then = "; the errors of the parameters are scaled down by that" * (v["errors"] == "scaled")
    return (
        f"reduced chi2{outliers} is {_n(v['chi2_reduced'])}: the residuals are only "
        f"{v['factor']:.2g} times the stated errors, which look too large{then}."
    )


def _few_starts_agree(v: Mapping[str, Any]) -> str:
    return (
        f"only {v['reached']} of {v['starts']} starts ended in the best minimum: a better one may "
        "exist. Take more starts, or fewer parameters."
    )


def _no_freedom(v: Mapping[str, Any]) -> str:
    known = "as stated and unchecked" if v["stated"] else "unknown"
    unknowns = {1: "one unknown", 2: "two unknowns"}.get(v["unknowns"], f"{v['unknowns']} unknowns")
    return (
        f"{v['n_data']} data for {unknowns} leave no degree of freedom to test the fit; its errors "
        f"are {known}."
    )


def _errors_floor(v: Mapping[str, Any]) -> str:
    return (
        f"reduced chi2 with the stated errors is {_n(v['chi2_reduced'])}. A standard error of "
        f"{v['floor']:.2g}, common to all data and added in squares, is likelier than one factor "
        f"on all stated errors (log likelihood higher by {v['gain']:.3g}), and is taken."
    )


def _errors_differ(v: Mapping[str, Any]) -> str:
    rows = zip(v["parameters"], v["floor"], v["factor"], strict=True)
    each = ", ".join(f"{name} {_n(a)} (floor) or {_n(b)} (factor)" for name, a, b in rows)
    return (
        "what is assumed of errors that are not met changes the result by more than its standard "
        f"errors: {each}."
    )


def _does_not_fit(v: Mapping[str, Any]) -> str:
    doubt = "Do not take its parameters, or their errors, for those of the material."
    if v.get("better"):
        return (
            f"{_quoted([v['taken']])} does not describe these data; {_quoted(v['better'])} would, "
            f"but the data do not support so many parameters. {doubt}"
        )
    if "factor" in v:
        return (
            "no candidate describes these data to their stated errors: "
            f"{_quoted([v['taken']])} is the best, and its residuals are {v['factor']:.2g} times "
            "these. Either they are too small, or the parameters are not those of the material."
        )
    return (
        f"no candidate describes these data: {_quoted([v['taken']])} is the best, and its "
        f"residuals are not noise (rms {v['rms']:.3g}). {doubt}"
    )


def _quoted(labels: Iterable[str]) -> str:
    """Return labels, which hold commas."""
    return _list(f'"{label}"' for label in labels)


def _choice_alike(v: Mapping[str, Any]) -> str:
    why = ""
    if v["fewest"]:
        why = "; it has the fewest parameters"
        why += f" and, of {v['as_large'] + 1} that have, the lowest BIC" * bool(v["as_large"])
    return (
        f'the data do not tell "{v["taken"]}" from {_quoted(v["others"])} (BIC closer than '
        f"{v['margin']:g}){why}."
    )


def _pseudo_misfit(v: Mapping[str, Any]) -> str:
    cause = {
        "k_negative": "psi and Delta ask for a k below 0, which no bare medium has: k is held at "
        "0. There is a film, or Delta has the other sign",
        "film": "no bare boundary has these psi and Delta together: there is a film, or roughness",
    }[v["cause"]]
    count, of = v["count"], v["of"]
    low, high = v["range_um"]
    at = f"at all {of} wavelengths " if count == of else ""
    if not at:
        place = f"{low:.4g} um" if low == high else f"{low:.4g} to {high:.4g} um"
        at = f"at {count} of {of} wavelengths ({place}) "
    return (
        f"{at if of > 1 else ''}{cause}; the misfit (rms of cos 2psi, sin 2psi cos Delta and sin "
        f"2psi sin Delta) is up to {v['misfit']:.2g}."
    )


Sentence = Callable[[Mapping[str, Any]], str]

SENTENCES: dict[str, Sentence] = {
    "not_converged": lambda v: (
        "the fit did not converge"
        + (f" in {v['evaluations']} evaluations" if "evaluations" in v else " from any start")
        + "; its values mean nothing."
    ),
    "candidates_do_not_describe": _does_not_fit,
    "perfect_mirror": _mirror,
    "no_reflection": lambda v: (
        "the data show no reflection, as of no boundary at all: eta is that "
        f"of the medium outside ({_n(v['eta_i'])}) and k is 0. R grows as "
        f"(eta - {_n(v['eta_i'])})^2 + k^2 there, so that intervals, and no standard errors, tell "
        "how certain that is."
    ),
    "circle": _circle,
    "same_at_45_degrees": lambda v: (
        "eta and k are not determined separately: at 45 degrees R_p = "
        f"R_s^2 for every material, so that the two say the same. Measure at one more angle. "
        f"{_MEMBER}"
    ),
    "combination": _combination,
    "one_value": lambda v: (
        "eta and k are not determined separately: there is one value for the "
        "two of them. The values shown are one pair of many that fit alike."
    ),
    "not_seen": _not_seen,
    "by_the_model_alone": lambda v: (
        "eta and k are not determined by the data alone: there is one "
        "reflectance or transmittance at each wavelength, at one angle. What separates them is the "
        "form of the model, far outside of the measured range too; the curve may fit well while "
        "eta and k are off by far more than their errors."
    ),
    "other_minima": _other_minima,
    "does_not_describe": _does_not_describe,
    "residuals_in_order": _residuals_in_order,
    "few_starts_agree": _few_starts_agree,
    "better_minimum_met": lambda v: (
        f"a fit that is better by {_n(v['by'])} in chi2 (in units of "
        "the scatter) was met beside this minimum, but its own minimum was not reached. Take more "
        "starts, or fewer parameters."
    ),
    "compatible_with_zero": _compatible_with_zero,
    "at_bound": _at_bound,
    "not_quadratic": _not_quadratic,
    "open_interval": lambda v: (
        f"the 95 % interval of {_list(v['parameters'])} has no end on one "
        "side or both: the data exclude no value there, however far."
    ),
    "poorly_determined": _poorly_determined,
    "correlated": _correlated,
    "chi2_large": _chi2_large,
    "chi2_small": _chi2_small,
    "errors_floor": _errors_floor,
    "errors_differ": _errors_differ,
    "flat_curve": lambda v: (
        f"all data are one kind of reflectance below {v['below_deg']:.0f} "
        "degrees, where the curve is nearly flat: eta and k rest on its small slope; a small "
        "systematic error moves both."
    ),
    "implausible_offset": lambda v: (
        f"an angle offset of {_n(v['value'])} degrees is more than an "
        "instrument has: it stands in for something else."
    ),
    "no_degrees_of_freedom": _no_freedom,
    "sigma_missing": lambda v: (
        f"sigma is missing for {v['missing']} of {v['of']} data: all are "
        "weighted alike, and the errors come from the scatter."
    ),
    "pseudo_index": lambda v: (
        "eta and k are the pseudo-index <n>, <k>: that of one bare, smooth "
        "boundary, which is assumed. A film, an oxide or roughness changes it unseen (2 nm on a "
        "clear crystal look like a k of .03); then it is the index of no material."
    ),
    "pseudo_index_misfit": _pseudo_misfit,
    "choice_alike": _choice_alike,
    "choice_undetermined": lambda v: (
        "no candidate is determined by these data; the best of them is shown."
    ),
}
"""Every code, the gravest first, and how its sentence is made; last notes, reasons of `choose`."""
