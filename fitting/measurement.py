"""A checked measurement: every value of a file or of arrays is tested here, once.

Angles are degrees of incidence from the normal, wavelengths micrometres, powers
fractions; psi and Delta are degrees in the ellipsometer's convention
(Delta = -arg(r_p / r_s) for indices eta + i k; R. M. A. Azzam and N. M. Bashara,
*Ellipsometry and Polarized Light*, 1977, section 4.2).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from fitting.errors import MeasurementError as MeasurementError

QUANTITIES = ("R_s", "R_p", "R", "R_back", "T_s", "T_p", "T", "psi", "delta")
"""What a datum can be. R and T are powers of unpolarised light, unless ``polarizer_deg``
says otherwise; R_back is R with the light on the other face (equal to R for a plain slab)."""

# A noisy R of a true 1 (or 0) lies beyond it half of the time, and to drop or clip those values
# would pull a fit inwards. Beyond 4 standard errors lies 3e-5 of a normal law: less than one
# value in a file of 1e4, so such a value is an error of scale, not noise.
EXCURSION_SIGMAS = 4.0


@dataclass(frozen=True, eq=False)
class Measurement:
    """Measured values in long form: row i of every array is one datum.

    Build it with :func:`read_csv` or :meth:`from_columns`; both check every value. The arrays
    cannot be written to. Gaps of the file are left out, rows keep the order of the file within
    one quantity, and repeats are kept.

    angle_deg: (N,) float64, degrees from the normal, 0 to 90.
    wavelength_um: (N,) float64, vacuum wavelength in micrometres; NaN where none is known.
    quantity: (N,) strings out of ``QUANTITIES``.
    value: (N,) float64; fractions for R and T, degrees for psi (0 to 90) and delta.
    sigma: (N,) float64, one standard error in the unit of the value; NaN where none is known.
    polarizer_deg: (N,) float64, for R and T alone: angle of a linear polariser from the plane of
        incidence, so that R = R_p cos^2 + R_s sin^2; NaN (the usual case) means that ``quantity``
        says all. 0 and 90 never appear: they are R_p and R_s.
    source: name of the file, or of the arrays.
    understood: sentences that say how the numbers were read.
    """

    angle_deg: np.ndarray
    wavelength_um: np.ndarray
    quantity: np.ndarray
    value: np.ndarray
    sigma: np.ndarray
    polarizer_deg: np.ndarray
    source: str
    understood: str

    def __len__(self) -> int:
        """Return the number of values."""
        return len(self.value)

    def where(self, keep: np.ndarray) -> Measurement:
        """Return the rows that the boolean mask or index array ``keep`` picks."""
        columns = [_frozen(column[keep]) for column in _arrays(self)]
        return Measurement(*columns, source=self.source, understood=self.understood)

    @staticmethod
    def from_columns(
        angle_deg: object,
        wavelength_um: object = None,
        *,
        sigma: object = None,
        polarizer_deg: object = None,
        source: str = "arrays",
        **values: object,
    ) -> Measurement:
        """Return the checked measurement held by arrays of one length (or scalars).

        angle_deg: degrees of incidence, 0 to 90.
        wavelength_um: micrometres, above 0; None where unknown.
        sigma: standard errors above 0: one number or array for all quantities, or a mapping
            from quantity to one; None where unknown.
        polarizer_deg: see :class:`Measurement`.
        values: one array per quantity, named as in ``QUANTITIES``: ``R_s=..., R_p=...``. NaN is a
            gap and leaves the datum out.
        Raises MeasurementError for an unknown name, unequal lengths, or a value out of its range.
        """
        unknown = [name for name in values if name not in QUANTITIES]
        if unknown or not values:
            came = f"there is no quantity {unknown[0]}" if unknown else "no values came"
            raise MeasurementError(f"{source}: {came}; give one or more of {', '.join(QUANTITIES)}.")
        names = list(values)
        sigmas = sigma if isinstance(sigma, Mapping) else dict.fromkeys(names, sigma)
        stray = [name for name in sigmas if name not in values]
        if stray:
            raise MeasurementError(f"{source}: sigma has {stray[0]}, the values do not.")
        columns = [angle_deg, wavelength_um, polarizer_deg]
        columns += [sigmas.get(name) for name in names] + [values[name] for name in names]
        try:
            arrays = [np.asarray(np.nan if c is None else c, dtype=np.float64) for c in columns]
            length = np.broadcast_shapes((1,), *(a.shape for a in arrays))
            if len(length) != 1:
                raise ValueError(f"{len(length)} dimensions came")
            angle, wavelength, polarizer, *rest = (np.broadcast_to(a, length) for a in arrays)
        except (ValueError, TypeError) as error:
            raise MeasurementError(
                f"{source}: the columns must be numbers of one length ({error})."
            ) from error
        count = len(names)
        sigma_all, value_all = np.concatenate(rest[:count]), np.concatenate(rest[count:])
        kept = np.flatnonzero(~np.isnan(value_all))
        rows = length[0]

        def where(i: int) -> str:
            return f"{source}, {names[kept[i] // rows]}[{kept[i] % rows}]"

        return checked(
            np.tile(angle, count)[kept],
            np.tile(wavelength, count)[kept],
            np.repeat(np.array(names), rows)[kept],
            value_all[kept],
            sigma_all[kept],
            np.tile(polarizer, count)[kept],
            source=source,
            understood=f"took {len(kept)} values of {', '.join(names)} from arrays",
            where=where,
        )


def _arrays(m: Measurement) -> tuple[np.ndarray, ...]:
    return m.angle_deg, m.wavelength_um, m.quantity, m.value, m.sigma, m.polarizer_deg


def _frozen(column: np.ndarray) -> np.ndarray:
    column = np.array(column)
    column.flags.writeable = False
    return column


def _refuse_first(bad: np.ndarray, where: Callable[[int], str], text: Callable[[int], str]) -> None:
    found = np.flatnonzero(bad)
    if len(found):
        first = int(found[0])
        more = f" So are {len(found) - 1} more values." if len(found) > 1 else ""
        raise MeasurementError(f"{where(first)}: {text(first)}{more}")


def checked(
    angle_deg: np.ndarray,
    wavelength_um: np.ndarray,
    quantity: np.ndarray,
    value: np.ndarray,
    sigma: np.ndarray,
    polarizer_deg: np.ndarray,
    *,
    source: str,
    understood: str,
    where: Callable[[int], str],
) -> Measurement:
    """Return the Measurement of these columns, or raise for the first value that cannot be meant.

    ``where(i)`` names the place of datum i in a refusal. A power may lie outside [0, 1] by no more
    than ``EXCURSION_SIGMAS`` of its own standard errors; without one, not at all.
    """
    if not len(value):
        raise MeasurementError(f"{source}: no measured value came.")
    with np.errstate(invalid="ignore"):
        _refuse_first(
            ~((angle_deg >= 0.0) & (angle_deg <= 90.0)),
            where,
            lambda i: f"angle of incidence {angle_deg[i]:.10g} degrees is outside [0, 90].",
        )
        _refuse_first(
            ~(np.isnan(wavelength_um) | (np.isfinite(wavelength_um) & (wavelength_um > 0.0))),
            where,
            lambda i: f"wavelength {wavelength_um[i]:.10g} um is not a positive number.",
        )
        _refuse_first(
            ~(np.isnan(sigma) | (np.isfinite(sigma) & (sigma > 0.0))),
            where,
            lambda i: f"standard error {sigma[i]:.10g} is not a positive number. If it stands for "
            "'not measured', say --missing 0.",
        )
        _refuse_first(~np.isfinite(value), where, lambda i: f"value {value[i]} is not finite.")
        slack = np.where(np.isnan(sigma), 0.0, EXCURSION_SIGMAS * sigma)
        psi, delta = quantity == "psi", quantity == "delta"
        _refuse_first(
            psi & ((value < 0.0) | (value > 90.0)),
            where,
            lambda i: f"psi {value[i]:.10g} degrees is outside [0, 90].",
        )
        _refuse_first(
            delta & (np.abs(value) > 360.0),
            where,
            lambda i: f"delta {value[i]:.10g} degrees is outside [-360, 360].",
        )
        power = ~(psi | delta)
        _refuse_first(
            power & ((value < -slack) | (value > 1.0 + slack)),
            where,
            lambda i: f"{quantity[i]} {value[i]:.10g} is outside [0, 1].",
        )
        _refuse_first(
            ~power & ~np.isnan(polarizer_deg),
            where,
            lambda i: "psi and delta have no polariser angle.",
        )
    columns = (angle_deg, wavelength_um, quantity, value, sigma, polarizer_deg)
    return Measurement(
        *(_frozen(column) for column in columns), source=source, understood=understood
    )
