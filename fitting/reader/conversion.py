"""From the columns of a table to angles, wavelengths, polarization, values and standard errors.

What is said in a header, beside the table and by options is compared, and whatever stays open or
contradicts itself is refused.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any, NamedTuple, NoReturn

import numpy as np

from fitting.data.checks import number_or_none
from fitting.data.errors import refuse
from fitting.data.quantities import POLARIZED, POWER_LETTERS, POWERS
from fitting.data.units import (
    FORM_OF,
    Q_UNITS,
    WAVELENGTH_UNITS,
    incidence_deg,
    scaled,
    span_of,
    wavelength_um,
)
from fitting.reader.cells import is_missing, is_number, to_numbers
from fitting.reader.columns import Column, Layout
from fitting.reader.options import Options
from fitting.reader.remarks import FULL_NAME, OPTION, Said
from fitting.reader.table import Table
from fitting.reader.vocabulary import light_of_cell


class Reading(NamedTuple):
    """A table, its columns in use, the options, what is said beside, and notes, which grow."""

    table: Table
    layout: Layout
    options: Options
    said: list[Said]
    notes: list[str]

    def refuse(self, column: Column, text: str, row: int | None = None) -> NoReturn:
        """Refuse at a column's name, or at its cell in a row."""
        line = self.table.top if row is None else self.table.lines[row]
        refuse(text, line, column.label)

    def refuse_left_out(self) -> None:
        """Refuse a column that is not read, but may hold something of use."""
        table, layout = self.table, self.layout
        if not layout.left_out:
            return
        index, what = next(iter(layout.left_out.items()))
        read = [column for column in (*layout.axes, *layout.values) if column is not None]
        columns = [f"{c.role.quantity or c.role.kind}={c.index + 1}" for c in read]
        role = "wavelength" if layout.wavelength is None else "ROLE"
        role = "polarization" if what.startswith("the polarization") else role
        names = [table.label(i) for i in layout.left_out]
        if any(re.search(r"[\s,;]", name) for name in names):
            names = [str(i + 1) for i in layout.left_out]
        refuse(
            f"this column ({table.came_in(index)}) is not read, but it may be {what}. If the fit "
            f"may do without it, say --ignore {','.join(names)}; else name all columns to be read: "
            f"--columns {','.join(columns)},{role}={index + 1}.",
            table.top,
            table.label(index),
        )

    def refuse_both(self, column: Column, what: str, option: str) -> NoReturn:
        """Raise because an option gives what a column gives."""
        text = f"the file gives {what}, and {option} came too. Drop the option, or name the columns"
        self.refuse(column, f"{text} to be read with --columns.")

    def refuse_gaps(self, column: Column, gone: np.ndarray, what: str) -> None:
        """Raise for the first row in ``gone``, which has a value but no ``what``."""
        for i in np.flatnonzero(gone)[:1].tolist():
            cell = self.table.rows[i][column.index]
            came = f"the {what} is missing in a row that has a value"
            if not is_missing(cell):
                came = f"{cell[:30]!r} is no Q between 0 and 4 pi / wavelength (--wavelength-um)"
            self.refuse(column, f"{came}. Correct it, or leave the line out with --lines A-B.", i)

    def numbers(self, column: Column, gaps: bool = False) -> tuple[np.ndarray, str]:
        """Return the numbers of a column, NaN for missing ones, and the sign (% or degree) on them.

        gaps: whether the words of the option ``missing`` count as missing too.
        """
        table, missing = self.table, self.options.missing if gaps else ()
        words = {gap.lower() for gap in missing}
        cells = table.cells(column.index)
        cells = ["" if cell.lower() in words else cell for cell in cells] if words else cells
        numbers, sign = to_numbers(cells, table.lines, table.decimal, column.label)
        values = [number for gap in missing if (number := number_or_none(gap)) is not None]
        return np.where(np.isin(numbers, values), np.nan, numbers), sign

    def one(self, kind: str) -> Said | None:
        """Return the one thing that is said of ``kind`` beside the table, None where nothing is.

        Refuses a file where it is not understood, or two places contradict one another.
        """
        chosen = [said for said in self.said if said.kind == kind]
        clear = [said for said in chosen if said.value is not None]
        gives, option, _ = OPTION[kind]
        for said in chosen:
            if said.value is None:
                if said.where == FULL_NAME and clear and clear[0].value in said.numbers:
                    continue  # gold_60deg.csv, and a line that gives 60 degrees
                came = f"may state {gives}, but is not understood. Say {option}."
                for number in said.numbers if said.where == FULL_NAME else ():
                    came = f"may state {gives}. If so, say --angle-deg {number:g}; else {option}."
                refuse(f"{said.where} ({said.text!r}) {came}")
            if said.value != clear[0].value:
                refuse(
                    f"{clear[0].where} ({clear[0].text!r}) and {said.where} ({said.text!r}) "
                    f"contradict each other on {gives}. Say {option}."
                )
        return clear[0] if clear else None

    def contradicted(
        self, kind: str, is_other: Callable[[Any], bool], column: Column, came: str
    ) -> None:
        """Raise where what is said of ``kind`` is other than what ``column`` shows (``came``).

        Columns that an option names hold against all that is said.
        """
        for said in [] if self.options.columns else self.said:
            values = said.numbers if said.value is None else (said.value,)
            if said.kind == kind and any(map(is_other, values)):
                gives, option, _ = OPTION[kind]
                self.refuse(
                    column,
                    f"{came}, but {said.where} ({said.text!r}) states {gives} differently. If the "
                    f"column is right, name all columns to be read with --columns; else say "
                    f"{option}.",
                )

    def refuse_other_light(self, letters: set[str], column: Column) -> None:
        """Raise where another light than that of the columns or rows, s, p or u, is said."""
        came = f"the light is {' and '.join(sorted(letters))}-polarized"
        self.contradicted("light", lambda letter: letter not in letters, column, came)

    def unit(self, kind: str, column: Column, option: str, what: str) -> str:
        """Return the unit of a column: of the option, the header, or a line beside; else "".

        kind: the kind of statement. what: the numbers, for the sentence on how they were read.
        Refuses a file where the header and a line say different things.
        """
        if option:
            return option
        own = column.role.unit
        if own:  # by which the name of the file is of no matter
            lines = self._replace(said=[said for said in self.said if said.where != FULL_NAME])
            lines.one(kind)
            lines.contradicted(kind, lambda u: u != own, column, f"the header says {own}")
            return own
        if (beside := self.one(kind)) is None:
            return ""
        flag = OPTION[kind][1].split(" ")[0]
        self.notes.append(f"{what} in {beside.value} ({beside.where}; {flag})")
        return str(beside.value)


# pi / 2 as files round it, up or down; the largest of them, to one digit, is 1.6
RIGHT_ANGLES = np.array(sorted({round(np.pi / 2.0, digits) for digits in range(1, 16)}))
HALF_PI = 1.5708
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
        other = ["um", "nm"] if off else [u for u in WAVELENGTH_UNITS if FORM_OF[u] == form]
        choices = dict.fromkeys([u for u in [unit, *other] if u in WAVELENGTH_UNITS])
        came = f"the name says {form} with {f'the unit {unit}' if unit else 'no unit'}, and the "
        came += f"numbers are {span_of(numbers)}. Say --wavelength-unit "
        reading.refuse(column, f"{came}{' or '.join(choices if unit else WAVELENGTH_UNITS)}.")
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
    """Return the unit of angles; raise where it is open or contradicts the numbers."""
    form, unit = column.role.form, column.role.unit
    finite = np.abs(numbers[np.isfinite(numbers)])
    high = finite.max(initial=0.0)
    if form == "incidence":
        unit = reading.unit("angle unit", column, "", "angles")
        if not unit and (high > RIGHT_ANGLES[-1] or high == 0.0):
            return "deg"
    known = {"q": Q_UNITS, "grazing": ("deg",)}.get(form, ("deg", "rad"))
    if not unit:
        wrong = f"{'Q' if form == 'q' else 'the angle'} has no unit"
    elif unit not in known:
        wrong = f"{'grazing ' * (form == 'grazing')}angles in {unit} came"
    elif unit == "rad" and high > (RIGHT_ANGLES[-1] if high in RIGHT_ANGLES else HALF_PI):
        wrong = "the file says rad, but the numbers exceed pi/2"
    elif form + unit == "incidencedeg" and len(np.unique(finite)) > 2 and high <= HALF_PI:
        wrong = "the file says degrees, but the numbers are as small as radians"
    else:
        return "grazing-deg" if form == "grazing" else unit
    options = "grazing-deg" if form == "grazing" else " or ".join(known)
    reading.refuse(column, f"{wrong} ({span_of(numbers)}). Say --angle-unit {options}.")


def _angles_without_column(reading: Reading) -> np.ndarray:
    table, layout, options, _, notes = reading
    rows = len(table.rows)
    if options.angle_deg is not None:
        return np.full(rows, options.angle_deg)
    if any(value.role.at is not None for value in layout.values):
        return np.full(rows, np.nan)  # each column has its own
    if (beside := reading.one("angle")) is not None:
        notes.append(f"angle of incidence {beside.value:g} degrees ({beside.where}; --angle-deg)")
        return np.full(rows, beside.value)
    names = {value.role.quantity for value in layout.values}
    oblique = layout.polarization or layout.polarizer or not names <= {*POWERS} - {*POLARIZED}
    if layout.wavelength and not oblique and not any(map(_ANGULAR.search, layout.unused)):
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
        text = "the angle follows from Q and the wavelength, which is not known. Say "
        reading.refuse(column, text + "--wavelength-um NUMBER (5 angstrom are 0.0005).")
    degrees = incidence_deg(numbers, unit, wavelength)
    if unit == "rad":
        degrees = np.where(np.isin(numbers, RIGHT_ANGLES), np.minimum(degrees, 90.0), degrees)
    if unit not in Q_UNITS:  # which stands for an angle only with the wavelength that is given
        came = f"the angles of incidence are {span_of(degrees)} degrees"
        reading.contradicted("angle", lambda a: not (abs(degrees - a) < 0.05).any(), column, came)
    if unit != "deg":
        reading.notes.append(f"angles converted from {unit}")
    return degrees


# Angles of the field from the plane of incidence. Half p and half s is what unpolarized light is.
FIELD_DEG = {"p": 0.0, "s": 90.0, "u": 45.0}


def _from_angles(reading: Reading, column: Column) -> np.ndarray:
    numbers, _ = reading.numbers(column)
    unit = column.role.unit or "deg"
    if unit not in ("deg", "rad"):
        text = f"a polarizer angle in {unit} came. Convert it to degrees or radians."
        reading.refuse(column, text)
    degrees = np.degrees(numbers) if unit == "rad" else numbers
    # a linear polarizer looks the same after half a turn, and the power after a reflection too
    turned = np.mod(degrees + (90.0 if reading.options.polarizer == "angle-from-s" else 0.0), 180.0)
    return np.where(turned > 90.0, 180.0 - turned, turned)


def _from_cells(reading: Reading, column: Column) -> np.ndarray:
    cells, codes = reading.table.cells(column.index), reading.options.codes
    numbers = {number_or_none(code): letter for code, letter in codes.items()}
    numbers.pop(None, "")

    def light(cell: str) -> str:
        coded = codes.get(cell.lower()) or numbers.get(number_or_none(cell), "")
        return coded if codes else light_of_cell(cell)

    known = {cell: light(cell) for cell in set(cells)}
    lost = [i for i, cell in enumerate(cells) if not known[cell] and not is_missing(cell)]
    if lost:
        values = sorted({cells[i] for i in lost})[:4]
        first = cells[lost[0]][:30]
        came = f"{first!r} came where s, p, TE, TM or unpolarized was wanted"
        option = f"{first}=s"
        if all(map(is_number, values)):
            came = f"{', '.join(values)} may be codes or angles of a polarizer"
            option = ",".join(v + "=" + "sp"[n % 2] for n, v in enumerate(values[:2]))
            option += " (or the other way round), or angle-from-p or angle-from-s if they "
            option += "are degrees"
        reading.refuse(column, f"{came}. Say what is meant with --polarization {option}.", lost[0])
    reading.refuse_other_light(set(known.values()) - {""}, column)
    return np.array([FIELD_DEG.get(known[cell], np.nan) for cell in cells])


def light_of_rows(reading: Reading, oblique: bool) -> np.ndarray:
    """Return the polarization of each row as far as it is not said by the columns' own names.

    It is the angle of the field from the plane of incidence, as in `FIELD_DEG`; NaN: not said.
    oblique: whether any angle is not 0, where s and p are one.
    Refuses a file where two facts disagree, or a code has two readings.
    """
    layout, options = reading.layout, reading.options
    column, letter = layout.polarizer or layout.polarization, options.light
    named = [v for v in layout.values if v.role.quantity in POLARIZED]
    letters = {POLARIZED[v.role.quantity] for v in named}
    if column is not None:
        other = layout.polarization if layout.polarizer else named[0] if named else None
        if other:
            text = f"this column gives the polarization, and so does column {other.label!r}. "
            reading.refuse(column, text + "Name the columns to be read with --columns.")
        if letter:
            reading.refuse_both(column, "the polarization", "--polarization")
        if layout.polarizer and not (options.codes or options.polarizer):
            reading.refuse(
                column,
                "a polarizer's angle can count from the plane of incidence (0 is p) or from its "
                "normal (0 is s). Say --polarization angle-from-p or angle-from-s.",
            )
        return (_from_angles if options.polarizer else _from_cells)(reading, column)
    if options.codes or options.polarizer:
        refuse(
            "--polarization gives a meaning to a column, but none is named as the polarization. "
            "Say which it is with --columns polarization=..., or --polarization s or p."
        )
    if letter and letters - {letter}:
        text = f"the column is named {named[0].role.quantity}, but --polarization says otherwise. "
        reading.refuse(named[0], text + "Name the columns to be read with --columns.")
    if named and not letter:
        reading.refuse_other_light(letters, named[0])
    bare = any(v.role.quantity in POWER_LETTERS for v in layout.values)
    if bare and oblique and not (letter or named) and (beside := reading.one("light")):
        letter = str(beside.value)
        what = {"s": "s-polarized", "p": "p-polarized", "u": "unpolarized"}[letter]
        reading.notes.append(f"{what} light ({beside.where}; --polarization)")
    return np.full(len(reading.table.rows), FIELD_DEG[letter or "u"])


# of radians
_LIMITS = {"psi": HALF_PI, "delta": 4.0 * HALF_PI, "delta_folded": 2.0 * HALF_PI}


def psi_delta_unit(reading: Reading, columns: dict[int, np.ndarray]) -> dict[int, str]:
    """Return deg or rad for each column of psi and delta, by the option, the header, or the range.

    columns: numbers by the index of the column.
    Refuses a file where the header contradicts the numbers, or neither tells.
    """
    given = reading.options.psi_unit
    chosen = [v for v in reading.layout.values if v.role.quantity in _LIMITS]
    units = {v.index: reading.unit("psi unit", v, given, "psi and delta") for v in chosen}
    high = {v.index: np.nanmax(np.abs(columns[v.index]), initial=0.0) for v in chosen}
    small = {v.index: high[v.index] <= _LIMITS[v.role.quantity] for v in chosen}
    for value in [] if given else chosen:
        unit, as_radians = units[value.index], small[value.index]
        doubtful = {
            "": as_radians and high[value.index] > 0.0,
            "rad": not as_radians,
            "deg": len(chosen) > 1 and all(small.values()),
        }
        if doubtful.get(unit, True):
            reading.refuse(
                value,
                f"the file {f'says {unit}' if unit else 'gives no unit'}, and the numbers are "
                f"{span_of(columns[value.index])}; in radians {value.role.quantity} is at most "
                f"{_LIMITS[value.role.quantity]:.4f}. Say --psi-unit deg or --psi-unit rad.",
            )
        units[value.index] = unit or "deg"
    return units


def power_scale(reading: Reading, columns: dict[int, np.ndarray], signs: dict[int, str]) -> float:
    """Return the factor that makes all powers of the file fractions; raise where it is open."""
    if reading.options.scale is not None:
        return reading.options.scale
    units: list[tuple[Column, str]] = []
    for value in reading.layout.values:
        if value.role.quantity in POWERS:
            own = "percent" if signs[value.index] == "%" else value.role.unit
            signed = value._replace(role=value.role._replace(unit=own))
            units.append((value, reading.unit("power unit", signed, "", "values")))
    percent = [value for value, unit in units if unit == "percent"]
    for value, unit in units:
        if unit not in ("", "1", "percent") and not (reading.options.divided and unit == "arb"):
            reading.refuse(
                value,
                f"numbers in {'arbitrary units' if unit == 'arb' else unit} came where a fraction "
                "of the incident light was wanted. Divide them by the direct beam (--divide-by), "
                "or say --scale 1/(signal of the direct beam), as a number.",
            )
        if percent and unit != "percent":
            reading.refuse(
                value,
                f"column {percent[0].label!r} is in percent, but this one does not say so. Say "
                "--scale 0.01 if all are in percent.",
            )
    if percent and max(np.nanmax(columns[v.index], initial=-np.inf) for v in percent) <= 1.0:
        span = span_of(columns[percent[0].index])
        reading.refuse(
            percent[0],
            f"the header says percent, but no number is above 1 ({span}). Say --scale 1 if they "
            "are fractions, --scale 0.01 if they are percent.",
        )
    return 0.01 if percent else 1.0


def standard_errors(
    reading: Reading, value: Column, column: Column | None, unit: str, factor: float
) -> np.ndarray:
    """Return the standard errors of one value in the unit of the result, NaN without a column.

    unit: of psi and delta. factor: what makes the values fractions.
    Refuses a file where the unit is another than that of the values, or may be.
    """
    if column is None:
        return np.full(len(reading.table.rows), np.nan)
    options = reading.options
    reading.one("errors")
    numbers, sign = reading.numbers(column, gaps=True)
    own = "percent" if sign == "%" else column.role.unit
    own = "" if own == "arb" and options.divided else own
    if value.role.quantity in _LIMITS:
        own = options.psi_unit or own or unit
        if own not in ("deg", "rad"):
            text = f"standard errors in {own} came where degrees were wanted. Convert them."
            reading.refuse(column, text)
        return np.degrees(numbers) if own == "rad" else numbers
    if value.role.quantity not in POWERS:
        return numbers
    values = "percent" if factor == 0.01 else "1"
    if options.scale is None and own not in (values, "" if values == "1" else values):
        came = f"are in {own}" if own else "have no unit"
        reading.refuse(
            column,
            f"these standard errors ({span_of(numbers)}) {came}, but the values are "
            f"{'fractions' if values == '1' else 'in percent'}: the errors may be relative, or in "
            "another unit. Say --scale 0.01 if all are in percent; else convert them, or leave "
            "them out by naming the columns to be read with --columns.",
        )
    return scaled(numbers, factor)
