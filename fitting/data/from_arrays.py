"""From arrays to the checked columns of a measurement; see `Measurement.from_columns`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from fitting.data import units
from fitting.data.checks import Data, beyond, check_data, unmasked
from fitting.data.errors import refuse
from fitting.data.quantities import QUANTITIES, are_powers
from fitting.data.ratios import quotient, refuse_no_powers, times_reflectance
from fitting.data.repeats import without_copies

# Where what is no quantity belongs, by the first part of its name.
_PLACES = {
    "wavelength": " (wavelengths are wavelength_um, their unit is wavelength_unit)",
    "angle": " (angles are angle_deg, their unit is angle_unit)",
    "sigma": " (standard errors are sigma, of several quantities {'R_s': .., 'R_p': ..})",
}


def _quotients(
    value: np.ndarray, sigma: np.ndarray, by: np.ndarray, sigma_by: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return values over those of a reference, and their standard errors."""
    bad = ~(by > 0.0) & np.isfinite(value)
    if bad.any() or not (np.isnan(sigma_by) | (sigma_by > 0.0)).all():
        came = f"{by[bad][0]:.6g}" if bad.any() else "a standard error that is not positive"
        refuse(f"divide_by holds {came}; numbers above 0 were wanted.")
    return quotient(value, sigma, np.where(by > 0.0, by, 1.0), sigma_by)


def from_arrays(
    places: Sequence[object],
    values: Mapping[str, object],
    sigma: object,
    source: str,
    *,
    angle_unit: str,
    wavelength_unit: str,
    scale: float,
    divide_by: Mapping[str, object] | None,
    ratio_to: object,
) -> tuple[Data, str]:
    """Return the checked columns, and sentences on how they were understood.

    places: angles, wavelengths and polarizer angles. values: by quantity. divide_by: "R" -> values
    of a reference, "sigma_R" -> their standard errors.
    """
    if not (np.isfinite(scale) and scale > 0.0):
        refuse(f"scale is {scale:g}; a factor above 0 was wanted.")
    for option, unit, known in (
        ("wavelength_unit", wavelength_unit, units.WAVELENGTH_UNITS),
        ("angle_unit", angle_unit, units.ANGLE_UNITS),
    ):
        if unit not in known:
            refuse(f"{option} is {unit!r}; it can be {', '.join(known)}.")
    unknown = [name for name in values if name not in QUANTITIES]
    if unknown or not values:
        came = f"there is no quantity {unknown[0]}" if unknown else "no values came"
        place = _PLACES.get(unknown[0].partition("_")[0], "") if unknown else ""
        refuse(f"{came}{place}; give one or more of {', '.join(QUANTITIES)}.")
    names = list(values)
    sigmas = sigma if isinstance(sigma, Mapping) else dict.fromkeys(names, sigma)
    stray = [name for name in sigmas if name not in values]
    if stray:
        refuse(
            f"sigma has standard errors of {stray[0]}, of which no values came. Give both, or "
            "neither."
        )
    by = divide_by or {}
    if by:
        refuse_no_powers(np.array(names), False, "divide_by")
    odd = [n for n in by if n.removeprefix("sigma_") not in values] + [
        n for n in names if n not in by
    ]
    if by and odd:
        refuse(
            f"divide_by has {', '.join(by)} for values of {', '.join(names)}, which does not "
            f"agree on {odd[0]}. A reference of each of these was wanted, and no other; its "
            "standard errors have sigma_ before the name."
        )
    columns = list(places)
    columns += [sigmas.get(name) for name in names] + [values[name] for name in names]
    columns += [by.get(f"sigma_{name}") for name in names] + [by.get(name, 1.0) for name in names]
    try:
        columns = [np.nan if c is None else unmasked(c) for c in columns]
        arrays = [np.asarray(c, dtype=np.float64) for c in columns]
        length = np.broadcast_shapes((1,), *(a.shape for a in arrays))
        if len(length) != 1:
            raise ValueError(f"{len(length)} dimensions came")
        angle, wavelength, polarizer, *rest = (np.broadcast_to(a, length) for a in arrays)
    except (ValueError, TypeError) as error:
        refuse(f"the columns must be numbers of one length ({error}).")
    wavelength = units.wavelength_um(wavelength, wavelength_unit)
    angle = units.incidence_deg(angle, angle_unit, wavelength)
    count = len(names)
    *ours, sigma_by, value_by = np.reshape(rest, (4, count, -1))
    # Of a quotient the factor cancels.
    factor = np.where(are_powers(names) & (not by), scale, 1.0)
    sigma_all, value_all = (
        np.concatenate([units.scaled(a, f) for a, f in zip(each, factor, strict=True)])
        for each in ours
    )
    if by:
        value_all, sigma_all = _quotients(value_all, sigma_all, value_by.ravel(), sigma_by.ravel())
    kept = np.flatnonzero(~np.isnan(value_all))
    rows = length[0]

    def where(i: int, role: str) -> str:
        name = {"value": "", "sigma": "sigma of "}.get(role, f"{role} of ") + names[kept[i] // rows]
        return f"{source}, {name}[{kept[i] % rows}]"

    data = Data(
        np.tile(angle, count)[kept],
        np.tile(wavelength, count)[kept],
        np.repeat(np.array(names), rows)[kept],
        value_all[kept],
        sigma_all[kept],
        np.tile(polarizer, count)[kept],
    )
    percent = "Powers are fractions: for percent give scale=0.01."
    how = "; divided by a reference" if by else ""
    if ratio_to is not None:
        data, said = times_reflectance(data, ratio_to)
        how += f"; {said}"

    def hint(i: int) -> str:
        return percent if data.value[i] > 1.0 and are_powers(data.quantity[i]) else ""

    outside = check_data(data, where, hint)
    known = np.isfinite(data.wavelength_um).any()
    waves = units.span_of(data.wavelength_um, "um") if known else "no wavelength"
    text = f"took {len(kept)} values of {', '.join(names)} from arrays, "
    text += f"{units.span_of(data.angle_deg, 'degrees')}, {waves}{how}"
    data, copies = without_copies(data)
    return data, text + beyond(outside) + copies
