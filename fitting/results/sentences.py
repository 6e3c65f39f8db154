"""The sentences of all warnings and notes, by code: one table, the most serious first.

Each function takes the values of a warning (`diagnostics.Warning.values`), under the keys that its
code has, and returns the sentence.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from fitting.results import wording
from fitting.results.wording import listed, num


def _shared_not_seen(v: Mapping[str, Any]) -> str:
    return (
        f"{v['parameter']} is not determined: with eta and k free at every wavelength any "
        "thickness in its range fits. Fix it, give the film a dispersion model, or measure at "
        "another angle or another quantity. The values shown are one set of many that fit equally "
        "well."
    )


def _other_thickness(v: Mapping[str, Any]) -> str:
    each = [
        f"{v['parameter']} {num(x)} (chi2 higher by {rise:.2g})"
        for x, rise in zip(v["values"], v["delta_chi2"], strict=True)
    ]
    return f"another thickness fits nearly as well: {listed(each)}; eta and k then differ, too."


def _fringes_in_noise(v: Mapping[str, Any]) -> str:
    name = v["parameter"]
    return (
        f"{name} is not determined: the fringes that it was taken from are no larger than those of "
        f"noise. Without fringes ({name} {num(v['without'])}) chi2 is higher by "
        f"{v['delta_chi2']:.2g}; among {v['count']:.0f} thicknesses that the data can tell apart "
        f"there is one that lowers it by up to {v['by_chance']:.2g} by chance. Other thicknesses "
        "may fit nearly as well, with another eta and k. Narrow the range of the thickness if you "
        "know it, or measure with less noise."
    )


def _thin_film(v: Mapping[str, Any]) -> str:
    thickness = f"{v['thickness']} ({num(v['value'])} nm)"
    return (
        f"the data determine little more than one product of {thickness} and "
        f"{listed(v['parameters'])}, since the film is much thinner than the wavelength. The "
        f"thickness alone is known to {v['share']:.0%}; if the index were known, it would be known "
        f"to {v['held_share']:.1%}. Fix one of them, or give it a prior."
    )


SENTENCES: dict[str, Callable[[Mapping[str, Any]], str]] = {
    "not_converged": lambda v: (
        "the fit did not converge"
        + (f" in {v['evaluations']} evaluations" if "evaluations" in v else " from any start")
        + "; its values mean nothing."
    ),
    "candidates_do_not_describe": wording.does_not_fit,
    "perfect_mirror": wording.mirror,
    "no_reflection": lambda v: (
        "the data show no reflection, as of no boundary at all: eta is that "
        f"of the medium outside ({num(v['eta_i'])}) and k is 0. R grows as "
        f"(eta - {num(v['eta_i'])})^2 + k^2 there, so that there are intervals but no standard "
        "errors."
    ),
    "circle": wording.circle,
    "same_at_45_degrees": lambda v: (
        "eta and k are not determined separately: at 45 degrees R_p = "
        f"R_s^2 for every material, so that both give the same information. Measure at one more "
        "angle. "
        f"{wording.MEMBER}"
    ),
    "combination": wording.combination,
    "one_value": lambda v: (
        "eta and k are not determined separately: there is only one datum for "
        "the two. The values shown are one pair of many that fit equally well."
    ),
    "not_seen": wording.not_seen,
    "shared_not_seen": _shared_not_seen,
    "other_thickness": _other_thickness,
    "fringes_in_noise": _fringes_in_noise,
    "thin_film": _thin_film,
    "by_the_model_alone": lambda v: (
        "eta and k are not determined by the data alone: there is one "
        "reflectance or transmittance at each wavelength, at one angle. Only the form of the "
        "model separates them, also far outside of the measured range; the curve may fit well "
        "while eta and k are wrong by far more than their errors."
    ),
    "rising_index": lambda v: (
        f"{listed(v['indices'])} {'rises' if len(v['indices']) == 1 else 'rise'} with the "
        "wavelength in a part of the spectrum. Without absorption the index of no material does: "
        "there is absorption, or the formula does not describe the material, or another minimum is "
        "the true one."
    ),
    "other_minima": wording.other_minima,
    "does_not_describe": wording.does_not_describe,
    "residuals_in_order": wording.residuals_in_order,
    "few_starts_agree": wording.few_starts_agree,
    "better_minimum_met": lambda v: (
        f"near this minimum there is a fit whose chi2 is lower by {num(v['by'])} (in units of "
        "the scatter), but its own minimum was not reached. Take more starts, or fewer parameters."
    ),
    "compatible_with_zero": wording.compatible_with_zero,
    "at_bound": wording.at_bound,
    "not_quadratic": wording.not_quadratic,
    "open_interval": lambda v: (
        f"the 95 % interval of {listed(v['parameters'])} is unlimited on one "
        "side or both: the data exclude no value there, however far."
    ),
    "poorly_determined": wording.poorly_determined,
    "correlated": wording.correlated,
    "chi2_large": wording.chi2_large,
    "chi2_small": wording.chi2_small,
    "errors_floor": wording.errors_floor,
    "errors_differ": wording.errors_differ,
    "flat_curve": lambda v: (
        f"all data are one kind of reflectance below {v['below_deg']:.0f} "
        "degrees, where the curve is nearly flat: eta and k follow from its small slope, and "
        "a small systematic error changes both."
    ),
    "implausible_offset": lambda v: (
        f"an angle offset of {num(v['value'])} degrees is larger than "
        "that of an instrument: it probably compensates for another error of the model or the data."
    ),
    "no_degrees_of_freedom": wording.no_freedom,
    "sigma_missing": lambda v: (
        f"sigma is missing for {v['missing']} of {v['of']} data: all have "
        "equal weights, and the errors come from the scatter."
    ),
    "pseudo_index": lambda v: (
        "eta and k are the pseudo-index <n>, <k>: that of one bare, smooth "
        "boundary, which is assumed. A film, an oxide or roughness changes it without a sign of "
        "that in the fit (2 nm on a clear crystal look like a k of .03); then it is not the index "
        "of a material."
    ),
    "pseudo_index_misfit": wording.pseudo_misfit,
    "files_exclude": wording.files_exclude,
    "shared_pattern": wording.shared_pattern,
    "choice_alike": wording.choice_alike,
    "choice_within_errors": lambda v: (
        f'the residuals of "{v["taken"]}" are autocorrelated, but smaller than the stated errors '
        f"(reduced chi2 {v['chi2_reduced']:.2g}): the data do not ask for a model of more "
        'parameters. With errors "scaled" models are compared by their residuals alone.'
    ),
    "choice_undetermined": lambda v: (
        "these data determine no candidate completely; the best of them is shown."
    ),
}
"""Every code and its sentence, the most serious first; notes and reasons of `choose` come last."""
