"""Whether the model of a sample predicts what was measured; if not, why, and what to do."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import PurePath

import numpy as np

from fitting.data.measurement import Measurement, MeasurementError
from fitting.data.quantities import TABLE
from fitting.process.compiled import fit_settings
from fitting.samples.dispersion import Model
from fitting.samples.known_media import LEAST_K, MaterialFile, known_medium
from fitting.samples.sample import Sample

# Films from that thickness on are looked at, with the least index that they may have and so many
# fringes between two wavelengths.
_PLATE_UM, _ETA, _FRINGES = 50.0, 1.3, 2.0
# "glass_3mm.csv", "CLEAR_0.7 mm.dat"
_MILLIMETRES = re.compile(r"(?<![\d.])(\d+(?:\.\d+)?) ?mm(?![a-z])", re.IGNORECASE)


def check_fit(measurements: Sequence[Measurement], sample: Sample) -> None:
    """Raise ValueError where the sample cannot be fitted to what was measured."""
    for m in measurements:
        check_points(m, sample)
        # A curve through two faces can often be fitted with one, and an index that is wrong.
        behind = sorted(q for q in set(m.quantity.tolist()) if TABLE[q].of_layer)
        if sample.bare and behind:
            raise ValueError(
                f"{m.source}: {', '.join(behind)} cannot be fitted with one bare surface, since "
                "the light leaves or enters through a second one. Give the sample as a plate with "
                f"its thickness, 'air | {sample.media[-1]} 3 mm thick | air'. Or name the columns "
                "to be read without it (columns, --columns: angle=1,R_s=2)."
            )
        _refuse_unseen_fringes(m, sample)
    if any(not layer.thickness.coherent for layer in sample.layers if layer.thickness):
        names = [(_MILLIMETRES.search(PurePath(m.source).name), m.source) for m in measurements]
        named = {float(found[1]): source for found, source in names if found}
        if len(named) > 1:
            each = " and ".join(f"{mm:g} mm ({source})" for mm, source in sorted(named.items()))
            raise MeasurementError(
                f"the files name plates of {each}; one thickness was given for all of them. Fit "
                "plates of different thickness one by one, each with its own thickness."
            )


def _refuse_unseen_fringes(m: Measurement, sample: Sample) -> None:
    """Raise ValueError for a plate whose faces interfere although no fringe could be measured."""
    waves = np.unique(m.wavelength_um[np.isfinite(m.wavelength_um)])
    step = float(np.median(-np.diff(1.0 / waves))) if len(waves) > 1 else 0.0
    for layer in sample.layers:
        d = layer.thickness
        least = (d.low_um or d.start_um) if d and d.coherent else 0.0
        between = 2.0 * _ETA * least * step
        if d and least >= _PLATE_UM and between > _FRINGES:
            plain = layer._replace(thickness=d._replace(graded=False))
            without = " and not 'graded'" if d.graded else ""
            raise ValueError(
                f"{m.source}: the faces of the layer '{layer}' interfere, and about {between:.2g} "
                "of its fringes would lie between two measured wavelengths, where none is seen. "
                f"Write '{plain} thick'{without}, and its reflections add without interference."
            )


def check_points(m: Measurement, sample: Sample) -> None:
    """Raise ValueError where a sample has no prediction at some of the points, or a wrong one."""
    # The same from both sides: one thick layer between the same media.
    alike = sample.media[0].index == sample.media[-1].index and len(sample.layers) == 1
    if "R_back" in m.quantity and (sample.films or not alike):
        raise ValueError(
            f"{m.source}: R_back is the reflectance from the other face, which is not computed for "
            f"the sample '{sample}', but only for one thick layer with the same medium on both "
            "sides, as 'air | free 3 mm thick | air'. Leave the column out."
        )
    dispersive = [x for x in sample.media if isinstance(x.index, Model) and x.text != "constant"]
    named = [known for x in sample.media for known in x.known]
    if np.isnan(m.wavelength_um).any() and (sample.layers or dispersive or named):
        layer = "the reflectance of a layer"
        what = layer if sample.layers else f"the index of {(dispersive + named)[0]}"
        raise ValueError(
            f"{m.source}: the wavelength is not known, but {what} depends on it; give it "
            "(wavelength_um, --wavelength-um)."
        )
    for medium in range(len(sample.media)):
        check_known(sample, medium, m.wavelength_um, m.source)


def check_known(sample: Sample, medium: int, wavelength_um: np.ndarray, source: str = "") -> None:
    """Raise ValueError for wavelengths beyond the range of the materials of a medium.

    Also where the medium that the light comes from absorbs at one of them.
    """
    for which in sample.media[medium].known:
        known = known_medium(which).range_um
        if known is None or np.isnan(wavelength_um).all():
            continue
        low, high = float(np.nanmin(wavelength_um)), float(np.nanmax(wavelength_um))
        if not (known[0] <= low and high <= known[1]):
            raise ValueError(
                f"{source or 'points'}: the index of {known_medium(which).name} is known from "
                f"{known[0]:g} to {known[1]:g} um, and wavelengths from {low:g} to {high:g} um "
                "came. Leave those outside out, or write a dispersion model instead."
            )
        if medium == 0 and isinstance(which, MaterialFile):
            at = wavelength_um[np.isfinite(wavelength_um)]
            with fit_settings():
                k = np.asarray(known_medium(which)(at).k)
            worst = int(np.argmax(k))
            if k[worst] > LEAST_K:
                raise ValueError(
                    f"{source or 'points'}: light comes from {known_medium(which).name}, whose k "
                    f"is {k[worst]:.2g} at {at[worst]:g} um; {LEAST_K:g} or less was wanted. Leave "
                    "out the wavelengths at which it absorbs."
                )
