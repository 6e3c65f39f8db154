"""All warnings and notes: one table from a code to its sentence and to what to try.

The most serious come first, notes and the reasons of `choose` last. A sentence is a text in which
the values of a warning (`diagnostics.Warning.values`) are put by their names or, where it depends
on them, a function of the values. So is what to try: pairs of a question or a reason ("" for none)
and options of the command, with which the fit can be run again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from fitting.samples.parameters import parse_setting

Values = Mapping[str, Any]
Tries = tuple[tuple[str, str], ...]


def listed(names: Iterable[str]) -> str:
    """Return ``a, b and c``."""
    *others, last = names
    return f"{', '.join(others)} and {last}" if others else last


def _quoted(labels: Iterable[str]) -> str:
    return listed(f'"{label}"' for label in labels)  # labels contain commas


def _first(each: Iterable[str]) -> str:
    """Return the first four, and how many there are beyond."""
    each = list(each)
    return "; ".join(each[:4]) + f"; and {len(each) - 4} more" * (len(each) > 4)


def _of_rows(text: str, v: Values, *names: str) -> Iterator[str]:
    """Yield the text for each row of values: its first number is that of the first name."""
    return (text.format(*row) for row in zip(*(v[name] for name in names), strict=True))


_MEMBER = (
    "The values shown are the best fit, one of many that fit equally well; the 95 % intervals are "
    "the range of values that fit."
)
_OPEN = "eta and k are not determined separately: "
_DOUBT = "Do not take its parameters, or their errors, for those of the material."
_OUTLIERS = ", without the outliers,"
_ADDED = (
    "reduced chi2 with the stated errors is {chi2_reduced:.4g}. A standard error of %s in "
    "squares, is likelier than one factor on all stated errors (log likelihood higher by "
    "{gain:.3g}), and is used."
)
_GLASS: Tries = (("Glass?", "--fix k=0"),)
_FILM: Tries = (("With a film, for example:", "--sample 'air | cauchy 5..2000 nm | Si'"),)
_SCALED: Tries = (("", "--errors scaled"),)
_ONE_FACTOR: Tries = (("With a common factor:", "--errors scaled"),)
_ERRORS_WRONG = ("Errors wrong?", "--errors equal")
_LEAK = ("The polarizer may leak:", "--free leak")
_ANGLES = ("The angles may be off:", "--free angle_offset")
_SCALE = ("The scale may be off:", "--free scale")
_FOLDED = ("Delta of a rotating analyzer may be 360 - Delta:", "--delta-range 180")


def _with(*rows: tuple[str, str, str]) -> Callable[[Values], Tries]:
    """Return what to try: rows of a value without which it is not, a reason, and options."""
    return lambda v: tuple(
        (why.format_map(v), option.format_map(v)) for name, why, option in rows if v.get(name)
    )


_more_starts = _with(("more", "", "--starts {more}"))
_absorbing = _with(("absorbing", "If it absorbs:", "--sample '{absorbing}'"))
_to_see_other = _with(("other", "To see the other:", "--sample '{other}'"))
_if_known = _with(("hold", "If {hold[0]} is known, for example:", "--fix {hold[0]}={hold[1]:.4g}"))


def _instrument_errors(v: Values) -> Tries:
    """Return which error of the instrument may be the cause, by what was measured."""
    measured = v.get("measured") or ()
    if "NCS" in measured:
        return (_ANGLES, _FOLDED) if "delta" in measured else (_ANGLES,)
    polarized = {"R_s", "R_p", "T_s", "T_p"} & {*measured}
    return (_LEAK if polarized else _SCALE,) if measured else ()


def _drifted(v: Values) -> Tries:
    advice = _SCALE if v["powers"] and v["along"] != "angle" else _ANGLES
    return (advice,) if v["as_it_is"] else ()


def _with_explanation(v: Values) -> Tries:
    what, quote, sample = v["explanations"][0][0].partition("'")
    return (("", f"--sample '{sample}" if quote else f"--free {what}"),)


def _to_the_other(v: Values) -> Tries:
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


def _mirror(v: Values) -> str:
    said = "the data are those of a perfect mirror, or of one as good within their noise"
    if not v["least_reflectance"] > 0.0:
        return said + ": they do not determine eta and k."
    return (
        f"{said}: every index with the same reflectance at normal incidence fits as well. That is "
        f"at least {v['least_reflectance']:.4f} (95 %); the data determine nothing else of eta and "
        "k."
    )


def _circle(v: Values) -> str:
    m, eta, k = v["eta_i"], v["eta"], v["k"]
    a = (m * m + eta**2 + k**2) / (2.0 * eta)
    circle = f"(eta - {a:.4g})^2 + k^2 = {a * a - m * m:.4g}"
    return f"{_OPEN}the data fix only the circle {circle}. {_MEMBER}"


def _combination(v: Values) -> str:
    slope = v.get("slope", np.nan)
    trade = f" (a change of eta by 1 has the same effect as one of k^2 by {slope:.4g})"
    trade *= bool(np.isfinite(slope))
    return f"{_OPEN}the data fix only one combination of them{trade}. {_MEMBER}"


def _explained_by(v: Values) -> str:
    def value(x: float, s: float, low: float, high: float) -> str:
        if s > 0.0:
            return f"{x:.4g} +- {s:.2g}"
        return f"{low:.4g} to {high:.4g} (95 %)" if low < high else f"{x:.4g}"

    def values(some: Values) -> str:
        return ", ".join(f"{n} {value(*numbers)}" for n, numbers in some.items())

    each = "; or ".join(
        f"{what}: {values(new)}{', ' * bool(new)}rms {rms:.4g}{', still no noise' * (not fits)}, "
        f"and then {values(after)}"
        for what, rms, fits, new, after in v["explanations"]
    )
    return f"the data are described better by {each}. Look for the cause, and fit with it."


def no_solid(values: Mapping[str, float]) -> str:
    """Return that an index is hardly one, if it is: eta^2 - k^2 between 0 and 1.

    In the visible clear solids have eta above 1.29, and metals k above eta.
    """
    eta, k = (values.get(name, np.nan) for name in ("eta", "k"))
    if not (eta < 0.99 and k < eta):
        return ""
    return f"no candidate in the visible, where no solid has an eta of {eta:.4g} with so small a k"


def rise_of_chi2(values: Mapping[str, float], rise: float) -> str:
    """Return by how much chi2 of another minimum is higher, and whether its index is hardly one."""
    doubt = no_solid(values)
    higher = f"chi2 {'higher' if rise >= 0.0 else 'lower'} by {abs(rise):.2g}"
    return f"({higher}{f'; {doubt}' * bool(doubt)})"


def _other_minima(v: Values) -> str:
    each = dict(zip(v["parameters"], v["values"], strict=True))
    values = ", ".join(f"{name} {x:.4g}" for name, x in each.items())
    many = f"{v['count']} other solutions fit" if v["count"] > 1 else "a second solution fits"
    best = "; the best of them has " if v["count"] > 1 else ": "
    ranges = "".join(
        f" Among all of them {name} ranges from {low:.4g} to {high:.4g}."
        for name, (low, high) in zip(v["thicknesses"], v["ranges"], strict=True) if v["count"] > 1
    )  # fmt: skip
    return (
        f"{many} nearly as well{best}{values} {rise_of_chi2(each, v['delta_chi2'])}.{ranges} The "
        "data do not determine which is the true one; the intervals are those of the solution that "
        "is shown."
    )


def _others_hold(v: Values) -> str:
    """Return for which value of a parameter at its end the errors of the others are valid."""
    if not v.get("others"):
        return ""
    text = ", and the standard errors of the others are valid for {parameter} = {value:.4g} only"
    text += "; their 95 % intervals include all values of {parameter}" * bool(v.get("profile"))
    return text.format_map(v)


def _range(low: float, high: float) -> str:
    """Return ``193.99 to 194.14``: to the second digit of the distance, four digits at least."""
    size, width = np.floor(np.log10([max(abs(low), abs(high), 1e-300), high - low or 1.0]))
    digits = int(max(4, 2 + size - width)) if np.isfinite(size) else 4
    return f"{low:.{digits}g} to {high:.{digits}g}"


def _not_quadratic(v: Values) -> str:
    text = "{}: {} (by its standard error {})"
    rows = zip(v["parameters"], v["intervals"], v["by_sigma"], strict=True)
    each = _first(text.format(n, _range(*own), _range(*error)) for n, own, error in rows)
    return (
        "standard errors mislead for these parameters, since the fitted curve is not linear in "
        "them over the range of their errors; their 95 % intervals (profile likelihood) are "
        f"{each}."
    )


def _percent(share: float) -> str:
    return f"{100.0 * share:.2g} %" if share < 0.995 else f"{100.0 * float(f'{share:.2g}'):.0f} %"


def _no_freedom(v: Values) -> str:
    known = "taken from the stated errors, untested" if v["stated"] else "unknown"
    unknowns = {1: "one unknown", 2: "two unknowns"}.get(v["unknowns"], f"{v['unknowns']} unknowns")
    data, leave = ("one datum", "leaves") if v["n_data"] == 1 else (f"{v['n_data']} data", "leave")
    return (
        f"{data} for {unknowns} {leave} no degree of freedom to test the fit; its errors are "
        f"{known}."
    )


def _residuals_of_files(v: Values) -> str:
    each = listed(_of_rows("{:.4g} of {} ({} data)", v, "rms", "files", "n_data"))
    unit = ", in standard errors" * v["stated"]
    apart = "".join(
        f"{one} and {other} contradict each other: where both measured the same ({count} data) "
        f"they differ by {times:.4g} times their noise (rms). "
        for one, other, times, count in v["contradictory"]
    )
    return apart + (
        f"root mean square of the residuals{unit}: {each}. A file that is missed by far more than "
        "its noise is not of the same sample, or has a systematic error: fit each by itself."
    )


def _no_candidate(v: Values) -> str:
    taken = _quoted([v["taken"]])
    if v.get("better"):
        return (
            f"{taken} does not describe these data; {_quoted(v['better'])} would, but the data do "
            f"not support so many parameters. {_DOUBT}"
        )
    if "factor" in v:
        return (
            f"no candidate describes these data to their stated errors: {taken} is the best, and "
            f"its residuals are {v['factor']:.2g} times these. Either they are too small, or the "
            "parameters are not those of the material."
        )
    return (
        f"no candidate describes these data: {taken} is the best, and its residuals are not noise "
        f"(rms {v['rms']:.3g}). {_DOUBT}"
    )


def _choice_alike(v: Values) -> str:
    why = "; the first is taken, since it has the fewest parameters" * v["fewest"]
    if v["fewest"] and v["as_large"]:
        why += f" and, of the {v['as_large'] + 1} with as few, the lowest BIC"
    return (
        f'the data do not distinguish "{v["taken"]}" from {_quoted(v["others"])} (BIC differs by '
        f"less than {v['margin']:g}){why}."
    )


def _pseudo_misfit(v: Values) -> str:
    cause = {
        "k_negative": "psi and Delta ask for a k below 0, which no bare medium has: k is held at "
        "0. There is a film, or Delta has the other sign",
        "film": "no bare boundary has these psi and Delta together: there is a film, or roughness",
    }[v["cause"]]
    count, of, ends = v["count"], v["of"], dict.fromkeys(f"{w:.4g}" for w in v["range_um"])
    at = f"at {count} of {of} wavelengths ({' to '.join(ends)} um) "
    at = f"at all {of} wavelengths " if count == of else at
    return (
        f"{at if of > 1 else ''}{cause}; the misfit (rms of cos 2psi, sin 2psi cos Delta and sin "
        f"2psi sin Delta) is up to {v['misfit']:.2g}."
    )


SENTENCES: dict[str, tuple[str | Callable[[Values], str], Tries | Callable[[Values], Tries]]] = {
    "not_converged": (lambda v: "the fit did not converge {}; its values mean nothing.".format(
        f"in {v['evaluations']} evaluations" if "evaluations" in v else "from any start"
    ), _more_starts),
    "better_minimum_met": (
        "near this minimum there is a fit whose chi2 is lower by {by:.4g} (in units of the "
        "scatter), but its own minimum was not reached. Take more starts, or fewer parameters.",
        _more_starts),
    "misses_without_freedom": (
        "the fitted curve misses the data by {rms:.2g} (rms), far beyond their errors, although "
        "{n_data} data leave no degree of freedom: no values of the parameters explain them. "
        "Correct the data or their errors, measure at more angles, or name another sample.",
        _with(("errors_small", *_ERRORS_WRONG))),
    "refused": ("not fitted: {reason}", ()),
    "gain_instead": (
        "{sample} fits as well (BIC {delta_bic:+.1f}) if all measured powers are {scale:.4g} +- "
        "{sigma:.2g} times the true ones: these data do not tell the further layer from an error "
        "of the calibration. Check it with a reference, or measure psi and Delta.",
        lambda v: (("", f"--sample '{v['sample']}' --free scale"),)),
    "candidates_do_not_describe": (_no_candidate, _with(("factor", *_ERRORS_WRONG))),
    "range_left": (
        lambda v: listed(_of_rows("{} is {:.4g}, beyond the end {:.3g} of its usual range", v,
                                  "parameters", "values", "ends")) + (
            ", since chi2 is lower there by {gain:.3g} (in units of the scatter). No clear solid "
            "has such an index: there is absorption, or the sample is another one.").format_map(v),
        lambda v: tuple(
            ("To stay within it:", f"--bound {name}={'..' * (x > end)}{end:.3g}{'..' * (x < end)}")
            for name, x, end in zip(v["parameters"], v["values"], v["ends"], strict=True))),
    "rising_index": (
        lambda v: f"{listed(v['indices'])} {'rises' if len(v['indices']) == 1 else 'rise'} with "
        "the wavelength in a part of the spectrum. Without absorption the index of no material "
        "does: there is absorption, or the formula does not describe the material, or another "
        "minimum is the true one.",
        lambda v: tuple(("", f"--bound {name.removesuffix('eta')}B=0..") for name in v["indices"])),
    "low_index": (
        lambda v: f"{listed(v['indices'])} {'is' if len(v['indices']) == 1 else 'are'} at most "
        f"{v['most']:.3g} at the measured wavelengths. Compact solids that transmit light have "
        "1.29 or more, and only porous layers have less. A thinner film of a higher index may fit "
        "nearly as well: compare, with a narrower range of thicknesses or with bounds of the "
        "index.",
        lambda v: tuple(("", f"--bound {name}=1.3..") for name in v["first"]
                        if name.rpartition(".")[2] in ("A", "eta"))),
    "perfect_mirror": (_mirror, ()),
    "no_reflection": (
        "the data show no reflection, as of no boundary at all: eta is that of the medium outside "
        "({eta_i:.4g}) and k is 0. R grows as (eta - {eta_i:.4g})^2 + k^2 there, so that there are "
        "intervals but no standard errors.", ()),
    "circle": (_circle, _GLASS),
    "same_at_45_degrees": (
        f"{_OPEN}at 45 degrees R_p = R_s^2 for every material, so that both give the same "
        f"information. Measure at one more angle. {_MEMBER}", _GLASS),
    "combination": (_combination, _GLASS),
    "one_value": (
        f"{_OPEN}there is only one datum for the two. The values shown are one pair of many that "
        "fit equally well.", _GLASS),
    "not_seen": (
        lambda v: "{} is not determined: the data do not change with it.".format(*v["parameters"])
        if len(v["parameters"]) == 1
        else f"{listed(v['parameters'])} are not determined separately: the fitted curve stays the "
        "same if they change together. The values shown are one set of many that fit equally well; "
        "fix one of them at its known value, or give it a prior.",
        _if_known),
    "shared_not_seen": (
        "{parameter} is not determined: with eta and k free at every wavelength any thickness in "
        "its range fits. Fix it, give the film a dispersion model, or measure at another angle or "
        "another quantity. The values shown are one set of many that fit equally well.",
        _with(("held", "If it is known, for example:", "--sample '{held}'"),
              ("formula", "With a dispersion model:", "--sample '{formula}'"))),
    "other_thickness": (
        lambda v: "another thickness fits nearly as well: {}; eta and k then differ, too.".format(
            listed(f"{v['parameter']} {text}" for text in _of_rows(
                "{:.4g} (chi2 higher by {:.2g})", v, "values", "delta_chi2"))),
        _to_see_other),
    "fringes_in_noise": (
        lambda v: ("{parameter} is not determined: chi2 is lowest at {fringed:.4g}, by fringes "
        "that are no larger than those of noise. Without fringes, at {without:.4g}%s, chi2 is "
        "higher by {delta_chi2:.2g}; among {count:.0f} thicknesses that the data can tell apart "
        "there is one that lowers it by up to {by_chance:.2g} by chance. Other thicknesses may fit "
        "as well, with another eta and k. Narrow the range of the thickness if you know it, or "
        "measure with less noise." % (" (what is shown)" * v["shown"])).format_map(v),
        lambda v: (("", f"--bound {v['parameter']}=..{1.5 * v['without']:.3g}"),)),
    "thin_film": (
        lambda v: f"the data determine little more than one product of {v['thickness']} "
        f"({v['value']:.4g} nm) and {listed(v['parameters'])}, since the film is much thinner than "
        f"the wavelength. The thickness alone is known to {v['share']:.0%}; if the index were "
        f"known, it would be known to {v['held_share']:.1%}. Fix one of them, or give it a prior.",
        lambda v: (("If the thickness is known:", f"--fix {v['thickness']}={v['value']:.4g}"),)),
    "by_the_model_alone": (
        "eta and k are not determined by the data alone: those of no wavelength determine both. "
        "Only the form of the model separates them, also far outside of the measured range; the "
        "curve may fit well while eta and k are wrong by far more than their errors.",
        _with(("free", "What the data say:", "--sample '{free}'"),
              ("clear", "If nothing absorbs:", "--sample '{clear}'"))),
    "other_minima": (_other_minima, _to_the_other),
    "does_not_describe": (
        lambda v: f"the fitted curve misses the data by {v['rms']:.4g} (rms)" + (
            f", {v['rms'] / v['noise']:.2g} times the noise estimated from neighbouring points "
            f"({v['noise']:.4g})" if v.get("noise", np.nan) > 0.0 else ""
        ) + f": {v['sample']} does not describe them."
        + " For the cause fit this curve alone (fit)." * v.get("alone", False),
        lambda v: (*_instrument_errors(v), *_absorbing(v))),
    "explained_by": (_explained_by, _with_explanation),
    "residuals_in_order": (
        lambda v: "the residuals are autocorrelated along the {along} (lag-1 correlation "
        "{correlation:.2f}; that of independent noise is below {chance:.2f}): the model is "
        "incomplete or the instrument drifted. The standard errors ".format_map(v) + (
            f"are multiplied by {v['widened']:.2g}, which may not be enough."
            if v.get("widened", 1.0) > 1.0 else "of the parameters are too small."), _drifted),
    "alike": (
        "the residuals of all curves of the batch are alike, and add {rise:.3g} to the chi2 of "
        "each: something that all of them share, of the sample or of the instrument, is not as the "
        "fit has it. The errors do not cover what it does to the values, which may be much more. "
        "For the cause fit some of the curves by themselves (fit).", _instrument_errors),
    "few_starts_agree": (
        "only {reached} of {starts} starting points led to the best minimum: a better one may "
        "exist.", _more_starts),
    "chi2_large": (
        lambda v: f"reduced chi2{_OUTLIERS * bool(v.get('robust'))} is {v['chi2_reduced']:.4g}: "
        f"the residuals are {v['factor']:.2g} times the stated errors, which are too small, or the "
        "sample or the instrument is not described completely; " + {
            "scaled": "the errors of the parameters are scaled up by that factor.",
            "floor": "an error common to all data is added to them in squares.",
            "stated": "the errors of the parameters are taken as stated (absolute), and are too "
            "small.",
        }[v["errors"]],
        lambda v: () if v["no_sample"]
        else (_ERRORS_WRONG, *_instrument_errors(v), *_absorbing(v))),
    "chi2_doubtful": (
        "reduced chi2 is {chi2_reduced:.4g}, which one right fit in {one_in} has by chance: the "
        "stated errors may be a little too small, or something small of the sample or the "
        "instrument is missing. None of the causes that were tried describes the data clearly "
        "better.", (_ERRORS_WRONG,)),
    "compatible_with_zero": (
        lambda v: "{parameter} is compatible with 0 and too small for these data to determine: "
        "{parameter} < {limit:.4g} (95 %)".format_map(v) + f"{_others_hold(v)}."
        + " Where the medium absorbs, a range below 0 (bounds) lets eta rise with the wavelength."
        * (v["parameter"].rpartition(".")[2] == "B"),
        _with(("may_be_0", "To leave it out:", "--fix {parameter}=0"))),
    "at_bound": (
        lambda v: "{parameter} ended at the {end} end of its range, {value:.4g}: it has no "
        "standard error".format_map(v) + f"{_others_hold(v)}. If values beyond it make sense, "
        "widen the range (bounds).", _with(("beyond", "", "--bound {parameter}={beyond}"))),
    "no_slope": (
        lambda v: f"{listed(v['parameters'])} {'have' if len(v['parameters']) > 1 else 'has'} no "
        "standard error: at these values the fitted curve changes only with the square of a "
        "change, as the reflectance of an antireflection coating does at its best index. The 95 % "
        "intervals (profile likelihood) hold.", ()),
    "not_quadratic": (_not_quadratic, ()),
    "quadratic_misleads": (
        "the standard errors of eta and k and the intervals made of them mislead, since the curve "
        "is not linear in eta and k over their range.", (("", "--intervals auto"),)),
    "open_interval": (
        lambda v: f"the 95 % interval of {listed(v['parameters'])} is unlimited on one side or "
        "both: the data exclude no value there, however far.", _if_known),
    "poorly_determined": (
        lambda v: "poorly determined: the standard error is a large part of the value of "
        + listed(f"{name} ({_percent(share)})" for name, share in zip(
            v["parameters"], v["shares"], strict=True)) + ".", _if_known),
    "correlated": (
        lambda v: _first(_of_rows("{} and {} are strongly correlated ({:+.4f})", v, "first",
                                  "second", "correlation"))
        + ": their combination is known far better than either.", _if_known),
    "prior_contradicted": (
        lambda v: "; ".join(
            f"the data contradict the prior of {name}, {mean:.4g} +- {sigma:.4g}: the fit is at "
            f"{value:.4g}, {errors:.2g} of these standard errors away"
            for name, (mean, sigma, value, errors) in v["priors"].items()
        ) + ". One of them is wrong, or the model is.",
        lambda v: tuple(
            ("With a wider one:", f"--prior {name}={mean:.6g}+-{2.0 * errors * sigma:.2g}")
            for name, (mean, sigma, _, errors) in v["priors"].items())),
    "chi2_small": (
        lambda v: f"reduced chi2{_OUTLIERS * bool(v.get('robust'))} is {v['chi2_reduced']:.4g}: "
        f"the residuals are only {v['factor']:.2g} times the stated errors, which look too large"
        + {"scaled": "; the errors of the parameters are scaled down by that",
           "kept": ". Since the residuals are autocorrelated, the errors of the parameters are not "
                   "scaled down"}.get(v["errors"], "") + ".",
        lambda v: _SCALED if v["errors"] == "stated" else ()),
    "errors_floor": (_ADDED % "{added:.2g}, common to all data and added", _ONE_FACTOR),
    "errors_relative": (_ADDED % "{added:.2%} of each fitted value, added", _ONE_FACTOR),
    "errors_differ": (
        lambda v: "the stated errors are too small, and how they are corrected changes the result "
        "by more than its standard errors: " + "; ".join(_of_rows(
            "{} is {:.4g} with a further error added in squares, {:.4g} with a common factor", v,
            "parameters", "added", "factor")) + ".",
        _ONE_FACTOR),
    "errors_cover": (
        lambda v: "the stated errors are too small, and error models (scaled, floor, relative, "
        f"equal) differ by more than their errors: the intervals of {listed(v['parameters'])} "
        "cover those of all of them.", _ONE_FACTOR),
    "errors_of_each": (
        lambda v: "no errors are stated, and the scatter differs between the quantities, so that "
        "each is weighted by its own (from neighbouring residuals): "
        + listed(_of_rows("{:.4g} of {}", v, "noise", "curves")) + ".",
        (("To weight all data alike,", "--errors equal"),)),
    "flat_curve": (
        "all data are one kind of reflectance below {below_deg:.0f} degrees, where the curve is "
        "nearly flat: eta and k follow from its small slope, and a small systematic error changes "
        "both.", _GLASS),
    "implausible_offset": (
        "an angle offset of {value:.4g} degrees is larger than that of an instrument: it probably "
        "compensates for another error of the model or the data.",
        (("In place of --free angle_offset:", "--fix angle_offset=0"),)),
    "no_degrees_of_freedom": (
        _no_freedom, _with(("sigma", "If you know them, for example:", "--sigma {sigma}"))),
    "sigma_missing": (
        "sigma is missing for {missing} of {of} data: all have equal weights, and the errors come "
        "from the scatter.", (("If you know them, for example:", "--sigma 0.002"),)),
    "pseudo_index": (
        "eta and k are the pseudo-index <n>, <k>: that of one bare, smooth boundary, which is "
        "assumed. A film, an oxide or roughness changes it without a sign of that in the fit (2 "
        "nm on a clear crystal look like a k of .03); then it is not the index of a material.",
        lambda v: () if v.get("missed") else _FILM),
    "pseudo_index_misfit": (_pseudo_misfit, lambda v: (_FOLDED,) * v["delta"] + _FILM),
    "residuals_of_files": (_residuals_of_files, (("", "--each"),)),
    "choice_alike": (_choice_alike, _to_see_other),
    "choice_within_errors": (
        'the residuals of "{taken}" are autocorrelated, but smaller than the stated errors '
        "(reduced chi2 {chi2_reduced:.2g}): the data do not ask for a model of more parameters. "
        'With errors "scaled" models are compared by their residuals alone.', _SCALED),
    "choice_undetermined": (
        "these data determine no candidate completely; the best of them is shown.", ()),
}  # fmt: skip


def keywords(option: str) -> str:
    """Return the arguments that options stand for: ``--fix k=0`` is ``fixed={"k": 0}``.

    They are those of `fit`; sigma and delta_range are of `read_csv`, and --each is one call a file.
    """
    out = []
    for text in f" {option}".split(" --")[1:]:
        flag, _, value = text.partition(" ")
        if flag == "each":
            out.append("[fit(m) for m in measurements]")
        elif flag in ("fix", "bound", "prior"):
            name, _, value = value.partition("=")  # the caller's own names may be any
            _, kind, number = parse_setting(f"name={value}")
            ends = number if isinstance(number, tuple) else (number,)
            each = [f"{x:.10g}".replace("inf", "float('inf')") for x in ends]
            value = each[0] if len(each) == 1 else f"({', '.join(each)})"
            out.append(f'{kind}={{"{name}": {value}}}')
        else:
            text, flag = value.strip("'"), flag.replace("-", "_")
            out.append(f"{flag}={text}" if flag in ("starts", "sigma") else f'{flag}="{text}"')
    return ", ".join(out)
