"""The sentences of all warnings and notes, by code: one table, the most serious first.

A sentence is a text in which the values of a warning (`diagnostics.Warning.values`) are put by
their names or, where it depends on them, a function of the values in `wording`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from fitting.results import wording
from fitting.samples.parameters import parse_setting

SENTENCES: dict[str, str | Callable[[Mapping[str, Any]], str]] = {
    "not_converged": lambda v: (
        "the fit did not converge"
        + (f" in {v['evaluations']} evaluations" if "evaluations" in v else " from any start")
        + "; its values mean nothing."
    ),
    "better_minimum_met": (
        "near this minimum there is a fit whose chi2 is lower by {by:.4g} (in units of the "
        "scatter), but its own minimum was not reached. Take more starts, or fewer parameters."
    ),
    "misses_without_freedom": (
        "the fitted curve misses the data by {rms:.2g} (rms), far beyond their errors, although "
        "{n_data} data leave no degree of freedom: no values of the parameters explain them. "
        "Correct the data or their errors, measure at more angles, or name another sample."
    ),
    "refused": "not fitted: {reason}",
    "gain_instead": (
        "{sample} fits as well (BIC {delta_bic:+.1f}) if all measured powers are {scale:.4g} +- "
        "{sigma:.2g} times the true ones: these data do not tell the further layer from an error "
        "of the calibration. Check it with a reference, or measure psi and Delta."
    ),
    "candidates_do_not_describe": wording.does_not_fit,
    "rising_index": lambda v: (
        f"{wording.listed(v['indices'])} {'rises' if len(v['indices']) == 1 else 'rise'} with the "
        "wavelength in a part of the spectrum. Without absorption the index of no material does: "
        "there is absorption, or the formula does not describe the material, or another minimum is "
        "the true one."
    ),
    "low_index": lambda v: (
        f"{wording.listed(v['indices'])} {'is' if len(v['indices']) == 1 else 'are'} at most "
        f"{v['most']:.3g} at the measured wavelengths. Compact solids that transmit light have "
        "1.29 or more, and only porous layers have less. A thinner film of a higher index may fit "
        "nearly as well: compare, with a narrower range of thicknesses or with bounds of the index."
    ),
    "perfect_mirror": wording.mirror,
    "no_reflection": (
        "the data show no reflection, as of no boundary at all: eta is that of the medium outside "
        "({eta_i:.4g}) and k is 0. R grows as (eta - {eta_i:.4g})^2 + k^2 there, so that there are "
        "intervals but no standard errors."
    ),
    "circle": wording.circle,
    "same_at_45_degrees": (
        "eta and k are not determined separately: at 45 degrees R_p = R_s^2 for every material, so "
        "that both give the same information. Measure at one more angle. " + wording.MEMBER
    ),
    "combination": wording.combination,
    "one_value": (
        "eta and k are not determined separately: there is only one datum for the two. The values "
        "shown are one pair of many that fit equally well."
    ),
    "not_seen": wording.not_seen,
    "shared_not_seen": (
        "{parameter} is not determined: with eta and k free at every wavelength any thickness in "
        "its range fits. Fix it, give the film a dispersion model, or measure at another angle or "
        "another quantity. The values shown are one set of many that fit equally well."
    ),
    "other_thickness": wording.other_thickness,
    "fringes_in_noise": wording.fringes_in_noise,
    "thin_film": wording.thin_film,
    "by_the_model_alone": (
        "eta and k are not determined by the data alone: those of no wavelength determine both. "
        "Only the form of the model separates them, also far outside of the measured range; the "
        "curve may fit well while eta and k are wrong by far more than their errors."
    ),
    "other_minima": wording.other_minima,
    "does_not_describe": wording.does_not_describe,
    "explained_by": wording.explained_by,
    "residuals_in_order": wording.residuals_in_order,
    "few_starts_agree": (
        "only {reached} of {starts} starting points led to the best minimum: a better one may "
        "exist."
    ),
    "chi2_large": wording.chi2_large,
    "compatible_with_zero": wording.compatible_with_zero,
    "at_bound": wording.at_bound,
    "no_slope": lambda v: (
        f"{wording.listed(v['parameters'])} {'have' if len(v['parameters']) > 1 else 'has'} no "
        "standard error: at these values the fitted curve changes only with the square of a "
        "change, as the reflectance of an antireflection coating does at its best index. The 95 % "
        "intervals (profile likelihood) hold."
    ),
    "not_quadratic": wording.not_quadratic,
    "quadratic_misleads": (
        "the standard errors of eta and k and the intervals made of them mislead, since the curve "
        "is not linear in eta and k over their range."
    ),
    "open_interval": lambda v: (
        f"the 95 % interval of {wording.listed(v['parameters'])} is unlimited on one "
        "side or both: the data exclude no value there, however far."
    ),
    "poorly_determined": wording.poorly_determined,
    "correlated": wording.correlated,
    "prior_contradicted": lambda v: (
        "; ".join(
            f"the data contradict the prior of {name}, {wording.num(mean)} +- "
            f"{wording.num(sigma)}: the fit is at {wording.num(value)}, {errors:.2g} of these "
            "standard errors away"
            for name, (mean, sigma, value, errors) in v["priors"].items()
        )
        + ". One of them is wrong, or the model is."
    ),
    "chi2_small": wording.chi2_small,
    "errors_floor": (
        "reduced chi2 with the stated errors is {chi2_reduced:.4g}. A standard error of "
        "{added:.2g}, common to all data and added in squares, is likelier than one factor on all "
        "stated errors (log likelihood higher by {gain:.3g}), and is used."
    ),
    "errors_relative": (
        "reduced chi2 with the stated errors is {chi2_reduced:.4g}. A standard error of "
        "{added:.2%} of each fitted value, added in squares, is likelier than one factor on all "
        "stated errors (log likelihood higher by {gain:.3g}), and is used."
    ),
    "errors_differ": wording.errors_differ,
    "errors_cover": lambda v: (
        "the stated errors are too small, and error models (scaled, floor, relative, equal) differ "
        f"by more than their errors: the intervals of {wording.listed(v['parameters'])} cover "
        "those of all of them."
    ),
    "errors_of_each": lambda v: (
        "no errors are stated, and the scatter differs between the quantities, so that each is "
        "weighted by its own (from neighbouring residuals): "
        + wording.listed(
            f"{wording.num(s)} of {name}" for name, s in zip(v["curves"], v["noise"], strict=True)
        )
        + '. Ask for errors "equal" to weight all data alike.'
    ),
    "flat_curve": (
        "all data are one kind of reflectance below {below_deg:.0f} degrees, where the curve is "
        "nearly flat: eta and k follow from its small slope, and a small systematic error changes "
        "both."
    ),
    "implausible_offset": (
        "an angle offset of {value:.4g} degrees is larger than that of an instrument: it probably "
        "compensates for another error of the model or the data."
    ),
    "no_degrees_of_freedom": wording.no_freedom,
    "sigma_missing": (
        "sigma is missing for {missing} of {of} data: all have equal weights, and the errors come "
        "from the scatter."
    ),
    "pseudo_index": (
        "eta and k are the pseudo-index <n>, <k>: that of one bare, smooth boundary, which is "
        "assumed. A film, an oxide or roughness changes it without a sign of that in the fit (2 "
        "nm on a clear crystal look like a k of .03); then it is not the index of a material."
    ),
    "pseudo_index_misfit": wording.pseudo_misfit,
    "residuals_of_files": wording.residuals_of_files,
    "choice_alike": wording.choice_alike,
    "choice_within_errors": (
        'the residuals of "{taken}" are autocorrelated, but smaller than the stated errors '
        "(reduced chi2 {chi2_reduced:.2g}): the data do not ask for a model of more parameters. "
        'With errors "scaled" models are compared by their residuals alone.'
    ),
    "choice_undetermined": (
        "these data determine no candidate completely; the best of them is shown."
    ),
}
"""Every code and its sentence, the most serious first; notes and reasons of `choose` come last."""

_SAMPLE = "'air | cauchy 5..2000 nm | Si'"
# What to try: a question or a reason ("" for none), and an option of the command with its value.
# A function of the values gives () where nothing is to be tried.
TRY: dict[str, wording.Tries | Callable[[Mapping[str, Any]], wording.Tries]] = {
    "not_converged": wording.more_starts,
    "gain_instead": lambda v: (("", f"--sample '{v['sample']}' --free scale"),),
    "circle": (("Glass?", "--fix k=0"),),
    "same_at_45_degrees": (("Glass?", "--fix k=0"),),
    "combination": (("Glass?", "--fix k=0"),),
    "not_seen": lambda v: (("", "--fix {}={:.4g}".format(*v["hold"])),) if v["hold"] else (),
    "one_value": (("Glass?", "--fix k=0"),),
    "thin_film": lambda v: (
        ("If the thickness is known:", f"--fix {v['thickness']}={v['value']:.4g}"),
    ),
    "fringes_in_noise": lambda v: (("", f"--bound {v['parameter']}=..{1.5 * v['without']:.3g}"),),
    "rising_index": lambda v: tuple(
        ("", f"--bound {name.removesuffix('eta')}B=0..") for name in v["indices"]
    ),
    "low_index": lambda v: tuple(
        ("", f"--bound {name}=1.3..")
        for name in v["first"]
        if name.rpartition(".")[2] in ("A", "eta")
    ),
    "other_minima": wording.to_the_other,
    "does_not_describe": wording.instrument_errors,
    "residuals_in_order": wording.drifted,
    "few_starts_agree": wording.more_starts,
    "better_minimum_met": wording.more_starts,
    "chi2_large": lambda v: (
        ()
        if v["no_sample"]
        else (("Errors wrong?", "--errors equal"), *wording.instrument_errors(v))
    ),
    "compatible_with_zero": wording.left_out,
    "quadratic_misleads": (("", "--intervals auto"),),
    "prior_contradicted": lambda v: tuple(
        ("With a wider one:", f"--prior {name}={mean:.6g}+-{2.0 * errors * sigma:.2g}")
        for name, (mean, sigma, _, errors) in v["priors"].items()
    ),
    "chi2_small": lambda v: (("", "--errors scaled"),) if v["errors"] == "stated" else (),
    "implausible_offset": (("In place of --free angle_offset:", "--fix angle_offset=0"),),
    "sigma_missing": (("If you know them, for example:", "--sigma 0.002"),),
    "pseudo_index": (("With a film, for example:", f"--sample {_SAMPLE}"),),
    "choice_within_errors": (("", "--errors scaled"),),
}


def keywords(option: str) -> str:
    """Return the arguments that options stand for: ``--fix k=0`` is ``fixed={"k": 0}``.

    They are those of `fit`; sigma and delta_range are of `read_csv`.
    """
    out = []
    for text in f" {option}".split(" --")[1:]:
        flag, _, value = text.partition(" ")
        if flag in ("fix", "bound", "prior"):
            name, kind, number = parse_setting(value)
            ends = number if isinstance(number, tuple) else (number,)
            each = [f"{x:.10g}".replace("inf", "float('inf')") for x in ends]
            value = each[0] if len(each) == 1 else f"({', '.join(each)})"
            out.append(f'{kind}={{"{name}": {value}}}')
        else:
            text, flag = value.strip("'"), flag.replace("-", "_")
            out.append(f"{flag}={text}" if flag in ("starts", "sigma") else f'{flag}="{text}"')
    return ", ".join(out)


def tries_of(code: str, values: Mapping[str, Any]) -> wording.Tries:
    """Return what to try where a warning is right."""
    tries = TRY.get(code, ())
    return tries if isinstance(tries, tuple) else tries(values)


def advice(code: str, values: Mapping[str, Any]) -> str:
    """Return what to try where a warning is right: ``Glass? Try --fix k=0 (in Python: ...).``"""
    return " ".join(
        f"{why} {'T' if not why or why.endswith('?') else 't'}ry {option} "
        f"(in Python: {keywords(option)}).".lstrip()
        for why, option in tries_of(code, values)
    )
