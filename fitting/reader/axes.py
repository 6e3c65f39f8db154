"""Angles of incidence in degrees and wavelengths in micrometres: columns, options, remarks."""

from __future__ import annotations

import re

import numpy as np

from fitting.data.errors import refuse
from fitting.data.quantities import POLARIZED, POWERS
from fitting.data.units import (
    ANGLE_UNITS,
    FORM_OF,
    Q_UNITS,
    WAVELENGTH_UNITS,
    incidence_deg,
    span_of,
    wavelength_um,
)
from fitting.reader.columns import Column
from fitting.reader.reading import Reading

# pi / 2 as files round it, up or down; the largest of them, to one digit, is 1.6
RIGHT_ANGLES = np.array(sorted({round(np.pi / 2.0, digits) for digits in range(1, 16)}))
HALF_PI = 1.5708
_UNITS_OF = {
    "incidence": "deg or rad",
    "grazing": "grazing-deg or grazing-rad",
    "2theta": "2theta-deg",
    "q": "1/angstrom or 1/nm",
}
# names by which a column, though not understood, speaks against normal incidence
_ANGULAR = re.compile(
    "(?i)angle|theta|phi|\u03c6|\u03d5|winkel|incid|aoi|mount|motor|stage|gonio|deg"
)


def _wavelength_unit(reading: Reading, column: Column, numbers: np.ndarray) -> str:
    given, form = reading.options.wavelength_unit, column.role.form
    unit = reading.unit("wavelength unit", column, given, "wavelengths")
    low, high = np.nanmin(numbers, initial=np.inf), np.nanmax(numbers, initial=0.0)
    # no spectrometer counts so; one of the two is misread
    off = (unit == "nm" and high < 5.0) or (unit == "um" and low >= 100.0)
    if not given and (off or FORM_OF.get(unit) != form):
        same = [u for u in WAVELENGTH_UNITS if u != unit and FORM_OF[u] == form]
        choices = [unit] * (unit in WAVELENGTH_UNITS) + (["um", "nm"] if off else same)
        choices = dict.fromkeys(choices if unit else WAVELENGTH_UNITS)
        said = f"the unit {unit}" if unit else "no unit"
        reading.refuse(
            column,
            f"the name says {form} with {said}, and the numbers are {span_of(numbers)}. Say "
            f"--wavelength-unit {' or '.join(choices)}.",
        )
    return unit


def wavelengths(reading: Reading) -> np.ndarray:
    """Return the wavelength of each row in micrometres, NaN where none is known.

    Refuses a file where the unit is open, or the name, the unit and the numbers disagree.
    """
    column, given = reading.layout.wavelength, reading.options.wavelength_um
    if column is None:
        if given is None and (beside := reading.one("wavelength")):
            given = float(beside.value or 0.0)
            reading.notes.append(f"wavelength {given:.6g} um ({beside.where}; --wavelength-um)")
        return np.full(len(reading.table.rows), np.nan if given is None else given)
    if given is not None:
        reading.refuse_both(column, "wavelengths", f"--wavelength-um {given:g}")
    numbers, _ = reading.numbers(column)
    microns = wavelength_um(numbers, _wavelength_unit(reading, column, numbers))
    low, high = np.nanmin(microns, initial=np.inf), np.nanmax(microns, initial=0.0)
    came = f"the wavelengths are {span_of(microns)} um"
    reading.contradicted("wavelength", lambda w: not 0.99 * low <= w <= 1.01 * high, column, came)
    return microns


def _angle_unit(reading: Reading, numbers: np.ndarray, column: Column) -> str:
    form, unit = column.role.form, column.role.unit
    finite = np.abs(numbers[np.isfinite(numbers)])
    high, several = finite.max(initial=0.0), len(np.unique(finite)) > 2
    right = RIGHT_ANGLES[-1] if high in RIGHT_ANGLES else HALF_PI
    if form == "incidence":
        unit = reading.unit("angle unit", column, "", "angles")
    elif unit:
        unit = unit if form == "q" and unit in Q_UNITS else f"{form}-{unit}"
    if unit not in ("", *ANGLE_UNITS):
        wrong = f"an angle in {unit} came"
    elif not unit and form == "incidence" and (high > RIGHT_ANGLES[-1] or high == 0.0):
        return "deg"
    elif not unit:
        wrong = f"{'Q' if form == 'q' else 'the angle'} has no unit"
    elif unit in ("rad", "mrad") and high > right * (1e3 if unit == "mrad" else 1.0):
        wrong = f"the file says {unit}, but the numbers exceed pi/2"
    elif unit == "deg" and several and high <= HALF_PI:
        wrong = "the file says degrees, but the numbers are as small as radians"
    else:
        return unit
    reading.refuse(column, f"{wrong} ({span_of(numbers)}). Say --angle-unit {_UNITS_OF[form]}.")


def _angles_without_column(reading: Reading) -> np.ndarray:
    table, layout, options, _, notes = reading
    rows = len(table.rows)
    if options.angle_deg is not None:
        return np.full(rows, options.angle_deg)
    if any(value.role.at is not None for value in layout.values):
        return np.full(rows, np.nan)  # each column has its own
    beside, counted = reading.one("angle"), reading.one("angle unit")
    if counted and str(counted.value).startswith("grazing"):
        reading.not_understood(counted)
    if beside is not None:
        notes.append(f"angle of incidence {beside.value:g} degrees ({beside.where}; --angle-deg)")
        return np.full(rows, beside.value)
    oblique = (
        layout.polarization
        or layout.polarizer
        or any(v.role.quantity in POLARIZED or v.role.quantity not in POWERS for v in layout.values)
        or any(_ANGULAR.search(label) for label in layout.unused)
    )
    if layout.wavelength and not oblique:
        notes.append("no angle given: normal incidence assumed (--angle-deg)")
        return np.zeros(rows)
    rest = f" (not understood: {', '.join(layout.unused[:6])})" if layout.unused else ""
    refuse(
        f"no column is an angle of incidence{rest}. Say --angle-deg NUMBER, or which column it is "
        "with --columns angle=..."
    )


def angles(reading: Reading, wavelength: np.ndarray) -> np.ndarray:
    """Return the angle of incidence of each row in degrees.

    A spectrum of R or T without an angle is taken at normal incidence, where s and p are one.
    Refuses a file where the unit is open or contradicts the numbers, or no angle is known.
    """
    column, options = reading.layout.angle, reading.options
    if column is None:
        return _angles_without_column(reading)
    if options.angle_deg is not None:
        reading.refuse_both(column, "angles", f"--angle-deg {options.angle_deg:g}")
    numbers, sign = reading.numbers(column)
    if sign == "\u00b0" and not column.role.unit:
        column = column._replace(role=column.role._replace(unit="deg"))
    unit = options.angle_unit or _angle_unit(reading, numbers, column)
    if unit in Q_UNITS and np.isnan(wavelength).all():
        reading.refuse(
            column,
            "the angle follows from Q and the wavelength, which is not known. Say --wavelength-um "
            "NUMBER (5 angstrom are 0.0005).",
        )
    degrees = incidence_deg(numbers, unit, wavelength)
    if unit == "rad":
        degrees = np.where(np.isin(numbers, RIGHT_ANGLES), np.minimum(degrees, 90.0), degrees)
    if unit not in Q_UNITS:  # which stands for an angle only with the wavelength that is given
        came = f"the angles of incidence are {span_of(degrees)} degrees"
        reading.contradicted("angle", lambda a: not (abs(degrees - a) < 0.05).any(), column, came)
    if unit != "deg":
        reading.notes.append(f"angles converted from {unit}")
    return degrees
