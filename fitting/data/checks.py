"""The ranges that measured values must lie in, and what to do about one that does not."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from fitting.data.errors import MeasurementError, refuse
from fitting.data.quantities import ANGLES, POWER_LETTERS, TABLE, are_powers
from fitting.data.scatter import robust_noise

# A noisy R whose true value is 1 (or 0) lies beyond it half of the time, and dropping or clipping
# those values would bias a fit. 3e-5 of a normal distribution lie beyond 4 standard errors, less
# than one value in a file of 1e4: a value beyond has a wrong scale, and is not noise.
EXCURSION_SIGMAS = 4.0
# Noise that moves a power further than this beyond [0, 1] would have a standard error above 6 %,
# too much to determine an index; a column that is not a power (counts) has such numbers.
EXCURSION = 0.25
# Without stated errors the noise is estimated from the scatter of a curve. Since curvature looks
# like noise too, values may then lie beyond [0, 1] by much less than EXCURSION.
NOISE_EXCURSION = 0.05
# The scatter estimated from 8 to 60 values is right within a factor of two.
_SCATTERS = 2.0 * EXCURSION_SIGMAS
_ROUNDING = 1e-12  # of computed powers
_LEAST_COPIES = 3  # fewer repeats may agree to the last digit by chance


class Data(NamedTuple):
    """The six columns of a Measurement, in its units; row i of each is one datum."""

    angle_deg: np.ndarray
    wavelength_um: np.ndarray
    quantity: np.ndarray
    value: np.ndarray
    sigma: np.ndarray
    polarizer_deg: np.ndarray


def unmasked(array: Any) -> Any:
    """Return numbers with NaN where they are masked (numpy.ma); anything else as it is."""
    if isinstance(array, (list, tuple)) and any(isinstance(x, np.ma.MaskedArray) for x in array):
        array = np.ma.array(array)
    if not isinstance(array, np.ma.MaskedArray):
        return array
    return np.ma.filled(array.astype(np.result_type(array.dtype, np.float64)), np.nan)


def _noise(data: Data) -> np.ndarray:
    """Return for each datum the noise of its curve, estimated from the curve itself."""
    spectral = len(np.unique(data.wavelength_um)) > 1
    axis, other = (data.wavelength_um, data.angle_deg)[:: 1 if spectral else -1]
    polarizer = np.nan_to_num(data.polarizer_deg, nan=-1.0)
    names = np.unique(data.quantity, return_inverse=True)[1]
    curves = np.stack([names, polarizer, np.nan_to_num(other)])
    noise = np.full(len(axis), np.nan)
    which = np.unique(curves, axis=1, return_inverse=True)[1].ravel()
    for curve in range(which.max() + 1):
        rows = np.flatnonzero(which == curve)
        x, first = np.unique(axis[rows], return_index=True)
        noise[rows] = robust_noise(x, data.value[rows[first]])
    return noise


@np.errstate(all="ignore")
def checked(
    data: Data, where: Callable[[int, str], str], hint: Callable[[int], str]
) -> tuple[Data, str]:
    """Return the data without copies of rows, and sentences on these and on noise beyond [0, 1].

    Raises MeasurementError for the first value that is out of its range.

    where(i, role): the place of the angle, wavelength, sigma, polarizer or value of datum i.
    hint(i): what to do about its value.
    """
    if not len(data.value):
        refuse("no measured value came; at least one was wanted.")
    names, which = np.unique(data.quantity, return_inverse=True)
    low, high = np.array([TABLE[name][1:3] for name in names.tolist()])[which].T
    for bad, role, text in _faults(data, low, high, hint):
        for i in np.flatnonzero(bad)[:1].tolist():
            more = f" ({bad.sum() - 1} more like it.)" if bad.sum() > 1 else ""
            raise MeasurementError(f"{where(i, role)}: {text(i).strip()}{more}")
    beyond = ~np.isin(data.quantity, ANGLES) & ((data.value < low) | (data.value > high))
    count = int(beyond.sum())
    what = "1 value lies" if count == 1 else f"{count} values lie"
    text = f"; {what} outside [0, 1] by no more than the noise" if count else ""
    data, copies = _without_copies(data)
    return data, text + copies


def _faults(
    data: Data, low: np.ndarray, high: np.ndarray, hint: Callable[[int], str]
) -> Iterator[tuple[np.ndarray, str, Callable[[int], str]]]:
    """Yield what may be wrong: which data are, in which column, and the sentence on datum i.

    A power may lie outside [0, 1] by no more than ``EXCURSION_SIGMAS`` of its own standard errors
    and no more than ``EXCURSION``; without a standard error, by a multiple of the noise of its
    curve, and no more than ``NOISE_EXCURSION``.
    """
    angle, wavelength, quantity, value, sigma, polarizer = data
    angular, power = np.isin(quantity, ANGLES), are_powers(quantity)
    of_any = np.isin(quantity, POWER_LETTERS)
    yield (
        ~((angle >= 0.0) & (angle <= 90.0)), "angle",
        lambda i: f"angle of incidence {angle[i]:.10g} degrees is outside [0, 90]; it is measured "
        "from the surface normal. If these are other angles, or in another unit, say --angle-unit.",
    )  # fmt: skip
    yield (
        ~(np.isnan(wavelength) | (np.isfinite(wavelength) & (wavelength > 0.0))), "wavelength",
        lambda i: f"wavelength {wavelength[i]:.10g} um is not a positive number. If the row is no "
        "measurement, leave it out with --lines A-B.",
    )  # fmt: skip
    yield (
        np.isnan(wavelength) & np.isfinite(wavelength).any(), "wavelength",
        lambda i: "the wavelength is missing, and other data have one. Give it, or leave the row "
        "out with --lines A-B (in arrays: make its value nan).",
    )  # fmt: skip
    yield (
        ~(np.isnan(sigma) | (np.isfinite(sigma) & (sigma > 0.0))), "sigma",
        lambda i: f"standard error {sigma[i]:.10g} is not a positive number. If 0 stands for 'not "
        "measured', say --missing 0 (in arrays: nan).",
    )  # fmt: skip
    yield (
        sigma**2 < np.finfo(np.float64).tiny, "sigma",
        lambda i: f"standard error {sigma[i]:.10g} is so small that its square underflows to 0. "
        "Give the true one, or leave the standard errors out with --columns.",
    )  # fmt: skip
    yield (
        power & (sigma > 1.0), "sigma",
        lambda i: f"standard error {sigma[i]:.10g} of a power is above 1; a fraction was wanted, "
        "as --sigma 0.002 for 0.2 %. If the column is in percent, say --scale 0.01; if it is "
        "something else, name the columns with --columns.",
    )  # fmt: skip
    yield (
        ~np.isfinite(value), "value",
        lambda i: f"{value[i]} is not a finite number. {hint(i)}",
    )  # fmt: skip
    slack = np.minimum(EXCURSION_SIGMAS * sigma, EXCURSION)
    if (~angular & np.isnan(sigma) & ((value < low) | (value > high))).any():
        scatter = np.minimum(_SCATTERS * _noise(data), NOISE_EXCURSION)
        slack = np.where(np.isnan(sigma), scatter, slack)
    slack = np.where(angular, 0.0, np.fmax(slack, _ROUNDING))
    yield (
        (value < low - slack) | (value > high + slack), "value",
        lambda i: f"{TABLE[str(quantity[i])].axis if power[i] else quantity[i]} {value[i]:.10g}"
        f"{' degrees' * bool(angular[i])} is outside [{low[i]:g}, {high[i]:g}]. {hint(i)}",
    )  # fmt: skip
    yield (
        ~(np.isnan(polarizer) | (of_any & (polarizer > 0.0) & (polarizer < 90.0))), "polarizer",
        lambda i: f"a polarizer angle of {polarizer[i]:.10g} degrees came with {quantity[i]}. "
        f"Only {' and '.join(POWER_LETTERS)} have one, between 0 and 90 degrees from the plane of "
        "incidence; at 0 give R_p instead, at 90 R_s.",
    )  # fmt: skip


def _without_copies(data: Data) -> tuple[Data, str]:
    """Return the data without the copies of rows, and how many were left out, in words.

    Measurements that are repeated scatter, at least in some rows. If all values of every row that
    is repeated are the same to the last digit, and there are three such rows or more, the table was
    stored twice: counted as often, its rows would promise too small errors, and a test for noise
    would find that neighbours agree too well. The order of rows stays.
    """
    place = np.stack([
        np.nan_to_num(data.angle_deg), np.nan_to_num(data.wavelength_um, nan=-1.0),
        np.unique(data.quantity, return_inverse=True)[1], np.nan_to_num(data.polarizer_deg),
    ])  # fmt: skip
    datum = np.vstack([place, data.value, np.nan_to_num(data.sigma, nan=-1.0)])
    first, count = np.unique(datum, axis=1, return_index=True, return_counts=True)[1:]
    several = int((count > 1).sum())
    # Each row of the table, and whether it is repeated at all.
    which, times = np.unique(place, axis=1, return_inverse=True, return_counts=True)[1:]
    all_alike = (times > 1).sum() == several and (times[which.ravel()[first]] == count).all()
    if several < _LEAST_COPIES or not all_alike:
        return data, ""
    kept = np.sort(first)
    left = len(data.value) - len(kept)
    return Data(*(column[kept] for column in data)), f"; {left} exact copies of rows left out"
