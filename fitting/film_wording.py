"""Sentences of warnings about films; see `sentences`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fitting.wording import listed, num


def shared_not_seen(v: Mapping[str, Any]) -> str:
    return (
        f"{v['parameter']} is not determined: with eta and k free at every wavelength any "
        "thickness in its range fits. Hold it, give the film a dispersion model, or add an angle "
        "or a quantity. The values shown are one of many that fit alike."
    )


def other_thickness(v: Mapping[str, Any]) -> str:
    each = [
        f"{v['parameter']} {num(x)} (chi2 higher by {rise:.2g})"
        for x, rise in zip(v["values"], v["delta_chi2"], strict=True)
    ]
    return f"another thickness fits nearly as well: {listed(each)}; eta and k are others then, too."


def thin_film(v: Mapping[str, Any]) -> str:
    return (
        f"{v['thickness']} ({num(v['value'])} nm) and {listed(v['parameters'])} are seen as one "
        "product: in a film that is much thinner than the wavelength, light sees little but the "
        f"thickness times what the index adds. The thickness alone is known to {v['share']:.0%}, "
        f"with the index held to {v['held_share']:.1%}. Hold one of them, or give it a prior."
    )
