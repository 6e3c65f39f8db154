"""Ratios to a reference: values divided by a second scan, or multiplied by its reflectance.

A spectrometer compares a sample with a mirror or a bare wafer. Either it writes the ratio, or there
are two scans; the known reflectance of the reference turns the ratio into R. `read_csv` does both
before values are checked, since counts and ratios are no powers.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fitting.data.checks import Data
from fitting.data.errors import refuse
from fitting.data.quantities import POWERS, letter_of
from fitting.data.units import span_of
from fitting.predictions import simulate
from fitting.samples.sample import Sample

# Angles and wavelengths that differ by less are the same: they were converted from other units.
_SAME = 1e-6
# A scan as fractions has a median below 1.5, one in percent or counts above 20.
_FRACTION, _NO_FRACTION = 1.5, 20.0


def _refuse_others(quantities: np.ndarray, wanted: str, of: Sequence[str], what: str) -> None:
    """Refuse quantities that are none ``of`` those wanted; what: the option, as it was given."""
    for strange in [str(q) for q in np.unique(quantities) if q not in of][:1]:
        refuse(
            f"{strange} came with {what}, which is for {wanted} alone. Name the columns to be "
            f"read with it (--columns angle=1,R=2), and read {strange} without it."
        )


def _interpolated(at: np.ndarray, x: np.ndarray, value: np.ndarray, sigma: np.ndarray):
    """Return the reference at ``at`` by straight lines, its error, and what lies between two x.

    NaN beyond the range of x. Values at the same x are repeats, and are averaged.
    """
    place, first, count = np.unique(x, return_inverse=True, return_counts=True)
    mean = np.bincount(first, value) / count
    variance = np.bincount(first, sigma**2) / count**2
    slack = _SAME * np.abs(place)
    inside = (at >= place[0] - slack[0]) & (at <= place[-1] + slack[-1])
    right = np.clip(np.searchsorted(place, at), min(1, len(place) - 1), len(place) - 1)
    left = np.maximum(right - 1, 0)
    step = np.where(right > left, place[right] - place[left], 1.0)
    share = np.clip((at - place[left]) / step, 0.0, 1.0)
    between = (share * step > slack[left]) & ((1.0 - share) * step > slack[right])
    line = (1.0 - share) * mean[left] + share * mean[right]
    error = (1.0 - share) ** 2 * variance[left] + share**2 * variance[right]
    return np.where(inside, line, np.nan), np.sqrt(error), between


def _reference_at(data: Data, name: str, reference: Data) -> np.ndarray:
    """Return the reference at the rows of the data: value, error, and whether interpolated."""
    out = np.full((3, len(data.value)), np.nan)
    light, light_there = (np.nan_to_num(d.polarizer_deg, nan=-1.0) for d in (data, reference))
    for quantity, polarizer in dict.fromkeys(zip(data.quantity, light, strict=True)):
        rows = np.flatnonzero((data.quantity == quantity) & (light == polarizer))
        chosen = (reference.quantity == quantity) & (light_there == polarizer)
        if not chosen.any():
            came = ", ".join(dict.fromkeys(reference.quantity.tolist()))
            refuse(
                f"{quantity} came, which {name} does not have; it has {came}. Both scans must be "
                "of one quantity and polarization: name the columns with --columns, or say "
                "--polarization, which holds for both."
            )
        ours = np.nan_to_num(data.wavelength_um[rows]), data.angle_deg[rows]
        theirs = np.nan_to_num(reference.wavelength_um[chosen]), reference.angle_deg[chosen]
        value, sigma = reference.value[chosen], reference.sigma[chosen]
        for common, along in ((1, 0), (0, 1)):  # at the same angle, else at the same wavelength
            for place in np.unique(ours[common]):
                here = np.flatnonzero(np.isnan(out[0, rows]) & (ours[common] == place))
                there = np.abs(theirs[common] - place) <= _SAME * max(1.0, abs(place))
                if there.any() and len(here):
                    out[:, rows[here]] = _interpolated(
                        ours[along][here], theirs[along][there], value[there], sigma[there]
                    )
        for i in np.flatnonzero(np.isnan(out[0, rows]))[:1]:
            um = ours[0][i]
            came = f"{ours[1][i]:.6g} degrees" + (f" and {um:.6g} um" if um else "")
            theirs_um = span_of(theirs[0], "um") if theirs[0].any() else "no wavelength"
            refuse(
                f"{quantity} at {came} has no counterpart in {name} "
                f"({span_of(theirs[1], 'degrees')}, {theirs_um}). The same angles and wavelengths "
                "were wanted, or a range that encloses them at the same angle or the same "
                "wavelength: measure the reference there, or leave these rows out with --lines "
                "A-B."
            )
    return out


def divided(
    data: Data, name: str, reference: Data | np.ndarray, same_unit: bool
) -> tuple[Data, str]:
    """Return the data divided by a reference scan, and a sentence on how.

    The reference has a value for each of the data, (N,), or is a scan of its own. This one has the
    angles and wavelengths of the data, or, at the same angle (else at the same wavelength), a range
    that encloses them, in which it is interpolated by straight lines.
    name: of the reference scan. same_unit: whether an option states that both are in one unit.
    """
    _refuse_others(data.quantity, "powers", POWERS, f"--divide-by {name}")
    rows = not isinstance(reference, Data)
    reference = data._replace(value=reference, sigma=data.sigma * np.nan) if rows else reference
    for what, came in (("value", reference.value), ("standard error", reference.sigma)):
        unknown = np.isnan(came) & (what != "value")
        for i in np.flatnonzero(~((np.isfinite(came) & (came > 0.0)) | unknown))[:1]:
            um = reference.wavelength_um[i]
            at_um = "" if np.isnan(um) else f", {um:.6g} um"
            refuse(
                f"the {what} of {reference.quantity[i]} at {reference.angle_deg[i]:.6g} "
                f"degrees{at_um} is {came[i]:.6g}; a number above 0 was wanted, by which a scan "
                "can be divided. Leave the row out with --lines A-B, or say --missing 0 if it "
                "stands for 'not measured'."
            )
    beside = np.stack([reference.value, reference.sigma, np.zeros(len(reference.value))])
    by, sigma_by, between = beside if rows else _reference_at(data, name, reference)
    low, high = sorted(float(np.median(np.abs(x))) for x in (data.value, by))
    if low <= _FRACTION and high >= _NO_FRACTION and not same_unit:
        refuse(
            f"its values are {span_of(data.value)} and those of {name} {span_of(by)}: one "
            "of them may be a fraction, the other percent or counts. Write both in one unit; if "
            "they are, say --scale 1."
        )
    value = data.value / by
    # (sigma / value)^2 are added, but not by dividing by a value, which may be 0. A sigma that is
    # not positive stays so, and is refused with all other bad ones.
    both = np.hypot(data.sigma, value * np.nan_to_num(sigma_by))
    sigma = np.where(data.sigma <= 0.0, data.sigma, both) / by
    text = f"divided by {name}" + ", interpolated" * bool(between.any())
    if np.isfinite(sigma_by).any() and np.isfinite(data.sigma).any():
        text += ", with its standard errors"
    return data._replace(value=value, sigma=sigma), text


def times_reflectance(data: Data, ratio_to: object) -> tuple[Data, str]:
    """Return ratios to the reflectance of a known sample times this reflectance, and a sentence.

    ratio_to: the text of a sample without anything to be fitted. The reflectance is that at the
    angle, wavelength and polarization of each datum; for R_back the reference is in its place, too.
    """
    reflectances = [q for q in POWERS if letter_of(q) == "R"]
    _refuse_others(data.quantity, "reflectances", reflectances, f"--ratio-to {str(ratio_to)!r}")
    known = (data.angle_deg >= 0.0) & (data.angle_deg <= 90.0)
    known &= ~(data.wavelength_um <= 0.0) & ~np.isinf(data.wavelength_um)
    R = np.full(len(data.value), np.nan)  # the rest is refused with all other bad angles
    if known.any():
        R[known] = _reflectance(ratio_to, Data(*(column[known] for column in data)))
    some = R[known]
    if not (some > 0.0).all():
        refuse(
            f"the reference {ratio_to} reflects nothing at "
            f"{data.angle_deg[known][some <= 0.0][0]:.6g} degrees, so that a ratio to it is "
            "undefined. Name another reference."
        )
    text = f"ratios to {ratio_to}, multiplied by its reflectance"
    text += f" {span_of(some)}" * bool(some.size)
    return data._replace(value=data.value * R, sigma=data.sigma * R), text


def _reflectance(ratio_to: object, data: Data) -> np.ndarray:
    """Return the reflectance (N,) of the reference at each datum."""
    try:
        sample = ratio_to if isinstance(ratio_to, Sample) else Sample.parse(str(ratio_to))
        for m in sample.media:
            if m.unknown or (m.thickness and not m.thickness.held):
                raise ValueError(
                    f"{str(m)!r} would have to be fitted; a reference with known indices and "
                    "thicknesses was wanted, as Si or 'air | SiO2 2 nm held | Si'"
                )

        def of(names: np.ndarray) -> np.ndarray:
            return simulate(sample, {}, data.angle_deg, data.wavelength_um, names)

        polarized = np.isfinite(data.polarizer_deg)
        plain = np.where(data.quantity == "R_back", "R", data.quantity)
        s, p = of(np.where(polarized, "R_s", plain)), of(np.where(polarized, "R_p", plain))
        share = np.where(polarized, np.sin(np.radians(data.polarizer_deg)) ** 2, 0.5)
        return share * s + (1.0 - share) * p
    except ValueError as error:
        reason = str(error).removeprefix("points: ").rstrip(".")
        refuse(f"--ratio-to {str(ratio_to)!r}: {reason}.")
