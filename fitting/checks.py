"""The ranges that measured values must keep, and what to do about one that does not."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from fitting.errors import MeasurementError
from fitting.noise import within_noise

# A noisy R of a true 1 (or 0) lies beyond it half of the time, and to drop or clip those values
# would pull a fit inwards. Beyond 4 standard errors lies 3e-5 of a normal law: less than one
# value in a file of 1e4, so such a value is an error of scale, not noise.
EXCURSION_SIGMAS = 4.0
# Noise that carries a power further than this beyond [0, 1] would have a standard error above 6 %,
# by which nothing is learnt about an index; a column that is no power (counts) has such numbers.
EXCURSION = 0.25


class Data(NamedTuple):
    """The six columns of a Measurement, in its units; row i of each is one datum."""

    angle_deg: np.ndarray
    wavelength_um: np.ndarray
    quantity: np.ndarray
    value: np.ndarray
    sigma: np.ndarray
    polarizer_deg: np.ndarray


def hint_for(value: float, quantity: str, line: int, scale_given: bool, typical: float) -> str:
    """Return what to do about a value of a file that lies outside its range.

    typical: the median size of the values, which tells percent from counts.
    """
    leave = f"If the row is no measurement, mark line {line} with # or say --lines A-B."
    if quantity in ("psi", "delta"):
        return "If the unit is another, say --psi-unit. " + leave
    near = -EXCURSION <= value <= 1.0 + EXCURSION
    noise = f"If it is noise about {int(value > 0.5)}, say how large with --sigma. " if near else ""
    if value < 0.0:
        return "No power is negative. " + noise + leave
    if scale_given:
        return noise + leave
    if typical <= 110.0:
        return ("If the column is in percent, say --scale 0.01. " + noise).strip()
    direct = "If these are counts or volts, divide them by the direct beam, or say --scale FACTOR. "
    return direct + leave


def _noise_of_its_curve(data: Data, beyond: np.ndarray) -> np.ndarray:
    """Return which of the values ``beyond`` [0, 1] without a standard error are noise, (N,) bool.

    By the neighbours along the angle (at one wavelength), or along the wavelength (at one angle).
    """
    angle, wavelength, quantity, value, sigma, polarizer = data
    excused = np.zeros(len(value), bool)
    unknown = beyond & np.isnan(sigma) & (np.abs(value - 0.5) <= 0.5 + EXCURSION)
    same = np.nan_to_num(wavelength, nan=-1.0), np.nan_to_num(polarizer, nan=-1.0)
    for i in np.flatnonzero(unknown):
        if excused[i]:
            continue
        kind = (quantity == quantity[i]) & (same[1] == same[1][i])
        for along, other in ((angle, same[0]), (same[0], angle)):
            curve = np.flatnonzero(kind & (other == other[i]))
            good = within_noise(along[curve], value[curve])
            excused[curve[good]] = True
    return excused & unknown


@np.errstate(all="ignore")
def check_data(
    source: str, data: Data, where: Callable[[int, str], str], hint: Callable[[int], str]
) -> int:
    """Return how many powers lie beyond [0, 1] by noise, or raise for the first bad value.

    where(i, role): the place of the angle, wavelength, sigma, polarizer or value of datum i.
    hint(i): what to do about its value.
    A power may lie outside [0, 1] by no more than ``EXCURSION_SIGMAS`` of its own standard errors
    and no more than ``EXCURSION``; without a standard error, by the noise that the neighbours of
    its own curve show (`fitting.noise`).
    """
    angle, wavelength, quantity, value, sigma, polarizer = data
    if not len(value):
        raise MeasurementError(f"{source}: no measured value came; at least one was wanted.")

    def refuse(bad: np.ndarray, role: str, text: Callable[[int], str]) -> None:
        found = np.flatnonzero(bad)
        if len(found):
            i = int(found[0])
            more = f" ({len(found) - 1} more like it.)" if len(found) > 1 else ""
            raise MeasurementError(f"{where(i, role)}: {text(i).strip()}{more}")

    refuse(
        ~((angle >= 0.0) & (angle <= 90.0)),
        "angle",
        lambda i: (
            f"angle of incidence {angle[i]:.10g} degrees is outside [0, 90]; it counts from the "
            "normal of the surface. If the unit is another, say --angle-unit."
        ),
    )
    refuse(
        ~(np.isnan(wavelength) | (np.isfinite(wavelength) & (wavelength > 0.0))),
        "wavelength",
        lambda i: (
            f"wavelength {wavelength[i]:.10g} um is not a positive number. If the row is no "
            "measurement, leave it out with --lines A-B."
        ),
    )
    refuse(
        ~(np.isnan(sigma) | (np.isfinite(sigma) & (sigma > 0.0))),
        "sigma",
        lambda i: (
            f"standard error {sigma[i]:.10g} is not a positive number. If 0 stands for 'not "
            "measured', say --missing 0."
        ),
    )
    psi, delta = quantity == "psi", quantity == "delta"
    power = ~(psi | delta)
    refuse(
        power & (sigma > 1.0),
        "sigma",
        lambda i: (
            f"standard error {sigma[i]:.10g} of a power is above 1. If the column is in percent, "
            "say --scale 0.01; if it is something else, name the columns with --columns."
        ),
    )
    refuse(~np.isfinite(value), "value", lambda i: f"{value[i]} is not finite. {hint(i)}")
    refuse(
        psi & ((value < 0.0) | (value > 90.0)),
        "value",
        lambda i: f"psi {value[i]:.10g} degrees is outside [0, 90]. {hint(i)}",
    )
    refuse(
        delta & (np.abs(value) > 360.0),
        "value",
        lambda i: f"delta {value[i]:.10g} degrees is outside [-360, 360]. {hint(i)}",
    )
    slack = np.where(np.isnan(sigma), 0.0, np.minimum(EXCURSION_SIGMAS * sigma, EXCURSION))
    beyond = power & ((value < -slack) | (value > 1.0 + slack))
    refuse(
        beyond & ~_noise_of_its_curve(data, beyond),
        "value",
        lambda i: (
            f"{'transmittance' if quantity[i][0] == 'T' else 'reflectance'} {value[i]:.10g} is "
            f"outside [0, 1]. {hint(i)}"
        ),
    )
    refuse(
        ~(np.isnan(polarizer) | (power & (polarizer > 0.0) & (polarizer < 90.0))),
        "polarizer",
        lambda i: (
            f"polariser angle {polarizer[i]:.10g} came; for R or T alone, one between 0 and 90 "
            "degrees from the plane of incidence was wanted (0 is R_p, 90 is R_s)."
        ),
    )
    return int(np.sum(power & ((value < 0.0) | (value > 1.0))))
