"""The longer sentences of warnings; the table of all of them is in `sentences`.

Each function takes the values of a warning (`diagnostics.Warning.values`), under the keys that its
code has, and returns the sentence.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np


def num(value: float) -> str:
    return f"{value:.4g}"


def listed(names: Iterable[str]) -> str:
    *others, last = names
    return f"{', '.join(others)} and {last}" if others else last


MEMBER = (
    "The values shown are the best fit, one of many that fit equally well; the 95 % intervals are "
    "the range of values that fit."
)


def mirror(v: Mapping[str, Any]) -> str:
    said = "the data are those of a perfect mirror, or of one as good within their noise"
    if not v["least_reflectance"] > 0.0:
        return said + ": they do not determine eta and k."
    return (
        f"{said}: every index with the same reflectance at normal incidence fits as well. That is "
        f"at least {v['least_reflectance']:.4f} (95 %); the data determine nothing else of eta and "
        "k."
    )


def circle(v: Mapping[str, Any]) -> str:
    m, eta, k = v["eta_i"], v["eta"], v["k"]
    a = (m * m + eta**2 + k**2) / (2.0 * eta)
    return (
        "eta and k are not determined separately: the data fix only the circle "
        f"(eta - {num(a)})^2 + k^2 = {num(a * a - m * m)}. {MEMBER}"
    )


def combination(v: Mapping[str, Any]) -> str:
    slope = v.get("slope", float("nan"))
    trade = f" (a change of eta by 1 has the same effect as one of k^2 by {num(slope)})"
    return (
        "eta and k are not determined separately: the data fix only one combination of them"
        f"{trade if np.isfinite(slope) else ''}. {MEMBER}"
    )


Tries = tuple[tuple[str, str], ...]


def more_starts(v: Mapping[str, Any]) -> Tries:
    return (("", f"--starts {v['more']}"),) if v["more"] else ()


def to_the_other(v: Mapping[str, Any]) -> Tries:
    """Return how the best of the other minima is fitted: within a range that only it is in."""
    if v["spectrum"]:
        return (("One formula for all wavelengths may decide:", "--sample cauchy-urbach"),)
    if not v["own"]:
        return ()
    rows = zip(v["parameters"], v["own"], v["values"], strict=True)
    name, own, other = max(rows, key=lambda row: abs(row[1] - row[2]) / (1e-3 + abs(row[1])))
    half = 0.4 * abs(other - own)
    low = other - half if other < 0.0 else max(other - half, 0.0)
    return (("To see the other:", f"--bound {name}={low:.4g}..{other + half:.4g}"),)


_LEAK = ("The polarizer may leak:", "--free leak")
_ANGLES = ("The angles may be off:", "--free angle_offset")
_SCALE = ("The scale may be off:", "--free scale")
_FOLDED = ("Delta of a rotating analyzer may be 360 - Delta:", "--delta-range 180")


def instrument_errors(v: Mapping[str, Any]) -> Tries:
    """Return which error of the instrument may be the cause, by what was measured."""
    measured = v.get("measured") or ()
    if "NCS" in measured:
        return (_ANGLES, _FOLDED) if "delta" in measured else (_ANGLES,)
    polarized = {"R_s", "R_p", "T_s", "T_p"} & {*measured}
    return (_LEAK if polarized else _SCALE,) if measured else ()


def drifted(v: Mapping[str, Any]) -> Tries:
    if not v["as_it_is"]:
        return ()
    if v["along"] == "angle":
        return (_ANGLES,)
    return (_SCALE,) if v["powers"] else ()


def left_out(v: Mapping[str, Any]) -> Tries:
    """Return how a parameter is left out that is 0 within its error, and may be held at 0."""
    name = v["parameter"]
    may = v["alone"] and name.rpartition(".")[2] in ("k", "leak", "divergence", "bandwidth")
    return (("To leave it out:", f"--fix {name}=0"),) if may else ()


def no_solid(values: Mapping[str, float]) -> str:
    """Return that an index is hardly one, if it is: eta^2 - k^2 between 0 and 1.

    In the visible clear solids have eta above 1.29, and metals k above eta.
    """
    eta, k = (values.get(name, float("nan")) for name in ("eta", "k"))
    if not (eta < 0.99 and k < eta):
        return ""
    return f"no candidate in the visible, where no solid has an eta of {num(eta)} with so small a k"


def not_seen(v: Mapping[str, Any]) -> str:
    if len(v["parameters"]) == 1:
        return f"{v['parameters'][0]} is not determined: the data do not change with it."
    return (
        f"{listed(v['parameters'])} are not determined separately: the fitted curve stays the same "
        "if they change together. The values shown are one set of many that fit equally well; fix "
        "one of them at its known value, or give it a prior."
    )


def does_not_describe(v: Mapping[str, Any]) -> str:
    noise = ""
    if v.get("noise", np.nan) > 0.0:
        noise = (
            f", {v['rms'] / v['noise']:.2g} times the noise estimated from neighbouring points "
            f"({num(v['noise'])})"
        )
    return (
        f"the fitted curve misses the data by {num(v['rms'])} (rms){noise}: {v['sample']} does not "
        "describe them."
    )


def explained_by(v: Mapping[str, Any]) -> str:
    def values(some: Mapping[str, Any]) -> str:
        return ", ".join(
            f"{n} {num(x)} +- {s:.2g}" if s > 0.0 else f"{n} {num(low)} to {num(high)} (95 %)"
            for n, (x, s, low, high) in some.items()
        )

    each = "; or ".join(
        f"{what}: {values(new)}, rms {num(rms)}{'' if fits else ', still no noise'}, and then "
        f"{values(after)}"
        for what, rms, fits, new, after in v["explanations"]
    )
    return f"the data are described better by {each}. Look for the cause, and fit with it."


def residuals_in_order(v: Mapping[str, Any]) -> str:
    widened = v.get("widened", 1.0)
    then = (
        f"The standard errors are multiplied by {widened:.2g}, which may not be enough."
        if widened > 1.0
        else "The standard errors of the parameters are too small."
    )
    return (
        f"the residuals are autocorrelated along the {v['along']} (lag-1 correlation "
        f"{v['correlation']:.2f}; that of independent noise is below {v['chance']:.2f}): the model "
        f"is incomplete or the instrument drifted. {then}"
    )


def residuals_of_files(v: Mapping[str, Any]) -> str:
    rows = zip(v["files"], v["rms"], v["n_data"], strict=True)
    each = listed(f"{num(rms)} of {file} ({n} data)" for file, rms, n in rows)
    unit = ", in standard errors" * v["stated"]
    apart = "".join(
        f"{one} and {other} contradict each other: where both measured the same ({count} data) "
        f"they differ by {num(times)} times their noise (rms). "
        for one, other, times, count in v["contradictory"]
    )
    return apart + (
        f"root mean square of the residuals{unit}: {each}. A file that is missed by far more than "
        "its noise is not of the same sample, or has a systematic error: fit each by itself."
    )


def other_minima(v: Mapping[str, Any]) -> str:
    pairs = zip(v["parameters"], v["values"], strict=True)
    values = ", ".join(f"{name} {num(x)}" for name, x in pairs)
    many = f"{v['count']} other solutions fit" if v["count"] > 1 else "a second solution fits"
    best = "; the best of them has " if v["count"] > 1 else ": "
    doubt = no_solid(dict(zip(v["parameters"], v["values"], strict=True)))
    higher = f"chi2 {'higher' if v['delta_chi2'] >= 0.0 else 'lower'} by {abs(v['delta_chi2']):.2g}"
    ranges = "".join(
        f" Among all of them {name} ranges from {num(low)} to {num(high)}."
        for name, (low, high) in zip(v["thicknesses"], v["ranges"], strict=True) if v["count"] > 1
    )  # fmt: skip
    return (
        f"{many} nearly as well{best}{values} ({higher}{f'; {doubt}' * bool(doubt)}).{ranges} The "
        "data do not determine which is the true one; the intervals are those of the solution that "
        "is shown."
    )


def other_thickness(v: Mapping[str, Any]) -> str:
    each = [
        f"{v['parameter']} {num(x)} (chi2 higher by {rise:.2g})"
        for x, rise in zip(v["values"], v["delta_chi2"], strict=True)
    ]
    return f"another thickness fits nearly as well: {listed(each)}; eta and k then differ, too."


def fringes_in_noise(v: Mapping[str, Any]) -> str:
    what = " (what is shown)" if v["shown"] else ""
    return (
        f"{v['parameter']} is not determined: chi2 is lowest at {num(v['fringed'])}, by fringes "
        f"that are no larger than those of noise. Without fringes, at {num(v['without'])}{what}, "
        f"chi2 is higher by {v['delta_chi2']:.2g}; among {v['count']:.0f} thicknesses that the "
        f"data can tell apart there is one that lowers it by up to {v['by_chance']:.2g} by chance. "
        "Other thicknesses may fit as well, with another eta and k. Narrow the range of the "
        "thickness if you know it, or measure with less noise."
    )


def thin_film(v: Mapping[str, Any]) -> str:
    thickness = f"{v['thickness']} ({num(v['value'])} nm)"
    return (
        f"the data determine little more than one product of {thickness} and "
        f"{listed(v['parameters'])}, since the film is much thinner than the wavelength. The "
        f"thickness alone is known to {v['share']:.0%}; if the index were known, it would be known "
        f"to {v['held_share']:.1%}. Fix one of them, or give it a prior."
    )


def at_bound(v: Mapping[str, Any]) -> str:
    return (
        f"{v['parameter']} ended at the {v['end']} end of its range, {num(v['value'])}: it has no "
        f"standard error{others_hold(v)}. If values beyond it make sense, widen the range (bounds)."
    )


def others_hold(v: Mapping[str, Any]) -> str:
    if not v.get("others"):
        return ""
    name = v["parameter"]
    text = f", and the standard errors of the others are valid for {name} = {num(v['value'])} only"
    return text + f"; their 95 % intervals include all values of {name}" * bool(v.get("profile"))


def compatible_with_zero(v: Mapping[str, Any]) -> str:
    return (
        f"{v['parameter']} is compatible with 0 and too small for these data to determine: "
        f"{v['parameter']} < {num(v['limit'])} (95 %){others_hold(v)}."
    ) + " Where the medium absorbs, a range below 0 (bounds) lets eta rise with the wavelength." * (
        v["parameter"].rpartition(".")[2] == "B"
    )


def not_quadratic(v: Mapping[str, Any]) -> str:
    def ends(pair: Any) -> str:
        return f"{num(pair[0])} to {num(pair[1])}"

    rows = list(zip(v["parameters"], v["intervals"], v["by_sigma"], strict=True))
    each = "; ".join(
        f"{name}: {ends(own)} (by its standard error {ends(by_error)})"
        for name, own, by_error in rows[:4]
    )
    more = f"; and {len(rows) - 4} more" if len(rows) > 4 else ""
    return (
        "standard errors mislead for these parameters, since the fitted curve is not linear in "
        "them over the range of their errors; their 95 % intervals (profile likelihood) are "
        f"{each}{more}."
    )


def correlated(v: Mapping[str, Any]) -> str:
    pairs = list(zip(v["first"], v["second"], v["correlation"], strict=True))
    text = "; ".join(f"{a} and {b} are strongly correlated ({c:+.4f})" for a, b, c in pairs[:4])
    more = f"; and {len(pairs) - 4} more" if len(pairs) > 4 else ""
    return f"{text}{more}: their combination is known far better than either."


def _percent(share: float) -> str:
    return f"{100.0 * share:.2g} %" if share < 0.995 else f"{100.0 * float(f'{share:.2g}'):.0f} %"


def poorly_determined(v: Mapping[str, Any]) -> str:
    pairs = zip(v["parameters"], v["shares"], strict=True)
    each = listed(f"{name} ({_percent(share)})" for name, share in pairs)
    return f"poorly determined: the standard error is a large part of the value of {each}."


def chi2_large(v: Mapping[str, Any]) -> str:
    then = {
        "scaled": "the errors of the parameters are scaled up by that factor",
        "floor": "an error common to all data is added to them in squares",
        "stated": "the errors of the parameters are taken as stated (absolute), and are too small",
    }[v["errors"]]
    outliers = ", without the outliers," * bool(v.get("robust"))
    return (
        f"reduced chi2{outliers} is {num(v['chi2_reduced'])}: the residuals are {v['factor']:.2g} "
        "times the stated errors, which are too small, or the sample or the instrument is not "
        f"described completely; {then}."
    )


def chi2_small(v: Mapping[str, Any]) -> str:
    outliers = ", without the outliers," * bool(v.get("robust"))
    then = {
        "scaled": "; the errors of the parameters are scaled down by that",
        "kept": ". Since the residuals are autocorrelated, the errors of the parameters are not "
        "scaled down",
    }.get(v["errors"], "")
    return (
        f"reduced chi2{outliers} is {num(v['chi2_reduced'])}: the residuals are only "
        f"{v['factor']:.2g} times the stated errors, which look too large{then}."
    )


def no_freedom(v: Mapping[str, Any]) -> str:
    known = "taken from the stated errors, untested" if v["stated"] else "unknown"
    unknowns = {1: "one unknown", 2: "two unknowns"}.get(v["unknowns"], f"{v['unknowns']} unknowns")
    data = "one datum" if v["n_data"] == 1 else f"{v['n_data']} data"
    return (
        f"{data} for {unknowns} leave{'s' * (v['n_data'] == 1)} no degree of freedom to test the "
        f"fit; its errors are {known}."
    )


def errors_differ(v: Mapping[str, Any]) -> str:
    rows = zip(v["parameters"], v["added"], v["factor"], strict=True)
    each = "; ".join(
        f"{name} is {num(a)} with a further error added in squares, {num(b)} with a common factor"
        for name, a, b in rows
    )
    return (
        "the stated errors are too small, and how they are corrected changes the result by more "
        f"than its standard errors: {each}."
    )


def does_not_fit(v: Mapping[str, Any]) -> str:
    doubt = "Do not take its parameters, or their errors, for those of the material."
    if v.get("better"):
        return (
            f"{quoted([v['taken']])} does not describe these data; {quoted(v['better'])} would, "
            f"but the data do not support so many parameters. {doubt}"
        )
    if "factor" in v:
        return (
            "no candidate describes these data to their stated errors: "
            f"{quoted([v['taken']])} is the best, and its residuals are {v['factor']:.2g} times "
            "these. Either they are too small, or the parameters are not those of the material."
        )
    return (
        f"no candidate describes these data: {quoted([v['taken']])} is the best, and its "
        f"residuals are not noise (rms {v['rms']:.3g}). {doubt}"
    )


def quoted(labels: Iterable[str]) -> str:
    """Return a list of labels in quotation marks, since labels contain commas."""
    return listed(f'"{label}"' for label in labels)


def choice_alike(v: Mapping[str, Any]) -> str:
    why = ""
    if v["fewest"]:
        why = "; the first is taken, since it has the fewest parameters"
        count = v["as_large"] + 1
        why += f" and, of the {count} with as few, the lowest BIC" * bool(v["as_large"])
    return (
        f'the data do not distinguish "{v["taken"]}" from {quoted(v["others"])} (BIC differs by '
        f"less than {v['margin']:g}){why}."
    )


def pseudo_misfit(v: Mapping[str, Any]) -> str:
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
