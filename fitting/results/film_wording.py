"""Sentences of warnings about films; see `sentences`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fitting.results.wording import listed, num


def shared_not_seen(v: Mapping[str, Any]) -> str:
    return (
        f"{v['parameter']} is not determined: with eta and k free at every wavelength any "
        "thickness in its range fits. Fix it, give the film a dispersion model, or measure at "
        "another angle or another quantity. The values shown are one set of many that fit equally "
        "well."
    )


def other_thickness(v: Mapping[str, Any]) -> str:
    each = [
        f"{v['parameter']} {num(x)} (chi2 higher by {rise:.2g})"
        for x, rise in zip(v["values"], v["delta_chi2"], strict=True)
    ]
    return f"another thickness fits nearly as well: {listed(each)}; eta and k then differ, too."


def fringes_in_noise(v: Mapping[str, Any]) -> str:
    name = v["parameter"]
    return (
        f"{name} is not determined: the fringes that it was taken from are no larger than those of "
        f"noise. Without fringes ({name} {num(v['without'])}) chi2 is higher by "
        f"{v['delta_chi2']:.2g}; among {v['count']:.0f} thicknesses that the data can tell apart "
        f"there is one that lowers it by up to {v['by_chance']:.2g} by chance. Other thicknesses "
        "may fit nearly as well, with another eta and k. Narrow the range of the thickness if you "
        "know it, or measure with less noise."
    )


def thin_film(v: Mapping[str, Any]) -> str:
    thickness = f"{v['thickness']} ({num(v['value'])} nm)"
    return (
        f"the data determine little more than one product of {thickness} and "
        f"{listed(v['parameters'])}, since the film is much thinner than the wavelength. The "
        f"thickness alone is known to {v['share']:.0%}; if the index were known, it would be known "
        f"to {v['held_share']:.1%}. Fix one of them, or give it a prior."
    )
