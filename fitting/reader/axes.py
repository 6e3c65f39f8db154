"""Angles of incidence in degrees and wavelengths in micrometres: columns, options, remarks."""

from __future__ import annotations

import re

import numpy as np

from fitting.errors import MeasurementError
from fitting.reader.columns import Column
from fitting.reader.reading import Reading
from fitting.reader.rows import numbers_of, span_of
from fitting.reader.units import (
    ANGLE_UNITS,
    FORM_OF,
    Q_UNITS,
    WAVELENGTH_UNITS,
    incidence_deg,
    wavelength_um,
)

# pi / 2 as files round it, up or down; the largest of them, to one digit, is 1.6
RIGHT_ANGLES = np.array(sorted({round(np.pi / 2.0, digits) for digits in range(1, 16)}))
HALF_PI = 1.5708
_UNITS_OF = {
    "incidence": "deg or rad",
    "grazing": "grazing-deg or grazing-rad",
    "2theta": "2theta-deg",
}
# names by which a column, though not understood, speaks against normal incidence
_ANGULAR = re.compile("(?i)angle|theta|winkel|incid|aoi|mount|motor|stage|gonio|deg")


def _wavelength_unit(reading: Reading, column: Column) -> str:
    options, form = reading.options, column.role.form
    numbers = reading.numbers(column)
    finite = numbers[np.isfinite(numbers)]
    low, high = finite.min(initial=np.inf), finite.max(initial=-np.inf)
    unit = reading.unit("wavelength unit", column, options.wavelength_unit, "wavelengths")
    if options.wavelength_unit:
        return unit
    if not unit:
        # 190 to 3300 is the range of spectrometers in nm; as angstrom it would begin below 190 nm
        # in the far ultraviolet, as um lie beyond the far infrared
        if form != "wavelength" or not (190.0 <= low < 1900.0 and high <= 3300.0):
            reading.refuse(
                column,
                f"the {form} has no unit, and its numbers ({span_of(numbers)}) do not tell. Say "
                f"--wavelength-unit {', '.join(WAVELENGTH_UNITS[:6])}.",
            )
        reading.notes.append("wavelengths taken as nm by their range (--wavelength-unit)")
        return "nm"
    if FORM_OF.get(unit) != form:
        reading.refuse(
            column,
            f"the name says {form}, the unit says {unit}. Say --wavelength-unit {unit} if the unit "
            "is right.",
        )
    # X-rays and neutrons are measured at grazing angles, in nm below 5
    angle = reading.layout.angle
    grazing = options.angle_unit.startswith(("grazing", "2theta", "1/"))
    optical = not grazing and (angle is None or angle.role.form == "incidence")
    if optical and ((unit == "nm" and high < 5.0) or (unit == "um" and low >= 100.0)):
        other = "um" if unit == "nm" else "nm"
        reading.refuse(
            column,
            f"the file says {unit}, the numbers are {span_of(numbers)}, as wavelengths in "
            f"{other} are. Say --wavelength-unit {unit} or --wavelength-unit {other}.",
        )
    return unit


def wavelengths(reading: Reading) -> np.ndarray:
    """Return the wavelength of each row in micrometres, NaN where none is known.

    Raises MeasurementError where the unit is open, or the name, the unit and the numbers disagree.
    """
    column, given = reading.layout.wavelength, reading.options.wavelength_um
    if column is None:
        if given is None and (beside := reading.said.one("wavelength")):
            given = float(beside.value or 0.0)
            reading.notes.append(f"wavelength {given:.6g} um ({beside.where}; --wavelength-um)")
        return np.full(len(reading.table.rows), np.nan if given is None else given)
    if given is not None:
        reading.refuse_both(column, "wavelengths", f"--wavelength-um {given:g}")
    unit = _wavelength_unit(reading, column)
    microns = wavelength_um(reading.numbers(column), unit)
    if not reading.options.columns and np.isfinite(microns).any():
        low, high = np.nanmin(microns) * 0.99, np.nanmax(microns) * 1.01
        came = f"the wavelengths are {span_of(microns)} um"
        reading.contradicted("wavelength", lambda w: not low <= w <= high, column, came)
    return microns


def _angle_unit(reading: Reading, numbers: np.ndarray, column: Column) -> str:
    form, unit, given = column.role.form, column.role.unit, reading.options.angle_unit
    if given:
        return given
    finite = np.abs(numbers[np.isfinite(numbers)])
    high, several = finite.max(initial=0.0), len(np.unique(finite)) > 2
    if form == "incidence":
        unit = reading.unit("angle unit", column, "", "angles")
        if unit.startswith("grazing"):
            return unit
    if form == "q":
        if unit not in Q_UNITS:
            reading.refuse(column, "Q has no unit. Say --angle-unit 1/angstrom or 1/nm.")
        return unit
    whole = unit if form == "incidence" or not unit else f"{form}-{unit}"
    if whole not in ("", *ANGLE_UNITS):
        reading.refuse(column, f"an angle in {whole} came. Say --angle-unit {_UNITS_OF[form]}.")
    if form != "incidence" and unit:
        return whole
    if not unit:
        if form == "incidence" and (high > RIGHT_ANGLES[-1] or high == 0.0):
            return "deg"
        reading.refuse(
            column,
            f"the angle has no unit; its numbers ({span_of(numbers)}) may be radians or degrees. "
            f"Say --angle-unit {_UNITS_OF[form]}.",
        )
    right = RIGHT_ANGLES[-1] if high in RIGHT_ANGLES else HALF_PI
    if unit != "deg" and high > right * (1e3 if unit == "mrad" else 1.0):
        reading.refuse(
            column,
            f"the file says {unit}, the numbers are {span_of(numbers)}, more than pi/2. Say "
            "--angle-unit deg if they are degrees.",
        )
    if unit == "deg" and several and high <= HALF_PI:
        reading.refuse(
            column,
            f"the file says degrees, the numbers are {span_of(numbers)}, as radians are. Say "
            "--angle-unit rad, or --angle-unit deg if they are degrees.",
        )
    return unit


def angles(reading: Reading, wavelength: np.ndarray) -> np.ndarray:
    """Return the angle of incidence of each row in degrees.

    A spectrum of R or T without an angle is taken at normal incidence, where s and p are one.
    Raises MeasurementError where the unit is open or contradicts the numbers, or no angle is known.
    """
    table, layout, options, said, notes = reading
    column, given = layout.angle, options.angle_deg
    rows = len(table.rows)
    if column is None:
        if given is not None:
            return np.full(rows, given)
        if any(value.role.at is not None for value in layout.values):
            return np.full(rows, np.nan)  # each column has its own
        beside, counted = said.one("angle"), said.one("angle unit")
        if counted and str(counted.value).startswith("grazing"):
            said.refuse(counted)
        if beside is not None:
            notes.append(
                f"angle of incidence {beside.value:g} degrees ({beside.where}; --angle-deg)"
            )
            return np.full(rows, beside.value)
        oblique = (
            layout.polarization
            or layout.polarizer
            or any(value.role.quantity not in ("R", "T", "R_back") for value in layout.values)
            or any(_ANGULAR.search(label) for label in layout.unused)
        )
        if layout.wavelength and not oblique:
            notes.append("no angle given: normal incidence assumed (--angle-deg)")
            return np.zeros(rows)
        rest = f" (not understood: {', '.join(layout.unused[:6])})" if layout.unused else ""
        raise MeasurementError(
            f"{table.source}: no column is an angle of incidence{rest}. Say --angle-deg NUMBER, or "
            "which column it is with --columns angle=..."
        )
    if given is not None:
        reading.refuse_both(column, "angles", f"--angle-deg {given:g}")
    numbers, sign = numbers_of(table, column, [])
    if sign == "\u00b0" and not column.role.unit:
        column = column._replace(role=column.role._replace(unit="deg"))
    unit = options.angle_unit or _angle_unit(reading, numbers, column)
    if unit in Q_UNITS and np.isnan(wavelength).all():
        reading.refuse(
            column,
            "Q becomes an angle through the wavelength, which is not known. Say "
            "--wavelength-um NUMBER (5 angstrom are 0.0005).",
        )
    degrees = incidence_deg(numbers, unit, wavelength)
    if unit == "rad":
        degrees = np.where(np.isin(numbers, RIGHT_ANGLES), np.minimum(degrees, 90.0), degrees)
    if not options.columns and np.isfinite(degrees).any():
        low, high = np.nanmin(degrees) - 0.05, np.nanmax(degrees) + 0.05
        came = f"the angles of incidence are {span_of(degrees)} degrees"
        reading.contradicted("angle", lambda a: not low <= a <= high, column, came)
    if unit == "deg.arcmin":
        minutes = np.abs(numbers - np.trunc(numbers)) * 100.0
        wrong = np.flatnonzero(minutes > 59.999999)
        text = "{} has more than 59 minutes of arc behind the point. Say --angle-unit deg."
    else:
        wrong = np.flatnonzero(np.isnan(degrees) & ~np.isnan(numbers))
        text = (
            "Q {} is negative or beyond 4 pi / wavelength. Check --wavelength-um and --angle-unit."
        )
    if len(wrong):
        i = int(wrong[0])
        reading.refuse(column, text.format(table.rows[i][column.index]), i)
    if unit not in ("deg",):
        notes.append(f"angles converted from {unit}")
    return degrees
