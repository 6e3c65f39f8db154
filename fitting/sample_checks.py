"""Whether a sample can say what was measured; if not, why, and what to do."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fitting.dispersion import Model
from fitting.known_media import known_medium
from fitting.measurement import Measurement
from fitting.sample import Sample
from fitting.several_files import millimetres_named, refuse_several_thicknesses


def check_quantities(measurements: Sequence[Measurement], sample: Sample) -> None:
    """Raise ValueError where the sample cannot say what was measured."""
    thick = any(not m.thickness.coherent for m in sample.layers if m.thickness)
    for m in measurements:
        quantities = set(m.quantity.tolist())
        behind = sorted(quantities & {"T", "T_s", "T_p", "R_back"})
        if sample.bare and sample.by_wavelength and behind:
            thick_mm = millimetres_named(m.source)
            named = f"; the file name says {thick_mm} mm" if thick_mm else ""
            raise ValueError(
                f"{m.source}: cannot fit {', '.join(behind)} to one bare surface: transmittance "
                "and light from the back are of a plate, whose thickness is needed. "
                f"Give the sample 'air | free {thick_mm or 3} mm thick | air'"
                f'{named}. Or name the columns to be read: columns="angle=1,R_s=2".'
            )
        if sample.bare and "R_back" in quantities:
            raise ValueError(
                f"{m.source}: R_back is light from the other face, which a bare surface does not "
                "have. Fit a plate, 'air | free 3 mm thick | air', or leave the column out."
            )
        if "R_back" in quantities and sample.layers and (sample.films or not thick):
            raise ValueError(f"{m.source}: R_back of films is not fitted; leave the column out.")
        _check_wavelengths(m, sample)
    if thick:
        refuse_several_thicknesses([m.source for m in measurements])


def _check_wavelengths(m: Measurement, sample: Sample) -> None:
    """Raise ValueError where a wavelength is unknown, or beyond what is known of a material."""
    dispersive = [x for x in sample.media if isinstance(x.index, Model) and x.text != "constant"]
    named = [known for x in sample.media for known in x.known]
    if np.isnan(m.wavelength_um).any() and (sample.layers or dispersive or named):
        what = "a layer acts" if sample.layers else f"the index of {(dispersive + named)[0]} varies"
        raise ValueError(
            f"{m.source}: {what} with the wavelength, which is not known here; give it "
            "(wavelength_um)."
        )
    for which in named:
        medium = known_medium(which)
        known = medium.range_um
        low, high = float(np.nanmin(m.wavelength_um)), float(np.nanmax(m.wavelength_um))
        if known is not None and not (known[0] <= low and high <= known[1]):
            raise ValueError(
                f"{m.source}: {medium.name} is known from {known[0]:g} to {known[1]:g} um; data "
                f"from {low:g} to {high:g} um came. Leave the others out, or give a model."
            )
