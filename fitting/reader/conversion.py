"""From the columns of a table to long columns: one datum per row, with its place in the file.

What is said in a header, beside the table and by options is compared, and whatever stays open or
contradicts itself is refused.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import numpy as np

from fitting.data.checks import Data
from fitting.data.errors import refuse
from fitting.data.quantities import NAME, POLARIZED, POWER_LETTERS, POWERS, are_powers, letter_of
from fitting.data.units import (
    FORM_OF,
    Q_UNITS,
    WAVELENGTH_UNITS,
    incidence_deg,
    is_doubtful,
    scaled,
    span_of,
    wavelength_um,
)
from fitting.reader import instruments
from fitting.reader.columns import Column, Layout, choose_columns
from fitting.reader.names import Role
from fitting.reader.options import Options
from fitting.reader.remarks import (
    FULL_NAME,
    OPTION,
    Said,
    evidence,
    light_of_cell,
    statements,
    without,
)
from fitting.reader.table import (
    Table,
    is_missing,
    is_number,
    number_or_none,
    read_table,
    to_numbers,
)
from fitting.reader.text import STDIN, Lines, read_lines

# What makes a file of an instrument a plain table; each returns None for a file of another kind.
FORMATS: tuple[Callable, ...] = (
    instruments.film_sense, instruments.jcamp, instruments.perkin_elmer, instruments.spectraray,
)  # fmt: skip


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

    def refuse_both(self, column: Column, what: str, option: str) -> NoReturn:
        """Raise because an option gives what a column gives."""
        text = f"the file gives {what}, and {option} came too. Drop the option, or name the columns"
        self.refuse(column, f"{text} to be read with --columns.")

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
        """Return the one thing that is said of ``kind`` beside the table, None where nothing is."""
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
                came += f", but {said.where} ({said.text!r}) states {gives} differently. If the"
                advice = " column is right, name all columns to be read with --columns; else say "
                self.refuse(column, f"{came}{advice}{option}.")

    def unit(self, kind: str, column: Column, option: str, what: str) -> str:
        """Return the unit of a column: of the option, the header, or a line beside; else "".

        kind: the kind of statement. what: the numbers, for the sentence on how they were read.
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


def wavelengths(reading: Reading) -> np.ndarray:
    """Return the wavelength of each row in micrometres, NaN where none is known."""
    column, given = reading.layout.wavelength, reading.options.wavelength_um
    if column is None:
        if given is None and (beside := reading.one("wavelength")):
            given = float(beside.value or 0.0)
            reading.notes.append(f"wavelength {given:.6g} um ({beside.where}; --wavelength-um)")
        return np.full(len(reading.table.rows), np.nan if given is None else given)
    if given is not None:
        reading.refuse_both(column, "wavelengths", f"--wavelength-um {given:g}")
    numbers, _ = reading.numbers(column)
    option, form = reading.options.wavelength_unit, column.role.form
    unit = reading.unit("wavelength unit", column, option, "wavelengths")
    off = is_doubtful(numbers, unit)
    if not option and (off or FORM_OF.get(unit) != form):
        others = ["um", "nm"] if off else [u for u in WAVELENGTH_UNITS if FORM_OF[u] == form]
        choices = dict.fromkeys(u for u in [unit, *others] if u in WAVELENGTH_UNITS)
        came = f"the name says {form} with {f'the unit {unit}' if unit else 'no unit'}, and the "
        came += f"numbers are {span_of(numbers)}. Say --wavelength-unit "
        reading.refuse(column, f"{came}{' or '.join(choices if unit else WAVELENGTH_UNITS)}.")
    microns = wavelength_um(numbers, unit)
    low, high = np.nanmin(microns, initial=np.inf), np.nanmax(microns, initial=0.0)
    came = f"the wavelengths are {span_of(microns)} um"
    reading.contradicted("wavelength", lambda w: not 0.99 * low <= w <= 1.01 * high, column, came)
    return microns


def _angles_without_column(reading: Reading) -> np.ndarray:
    """Return one angle for all rows, normal incidence where nothing speaks of another."""
    table, layout, options, _, notes = reading
    own = any(value.role.at is not None for value in layout.values)
    angle = np.nan if options.angle_deg is None and own else options.angle_deg
    if angle is None and (beside := reading.one("angle")):
        angle = float(beside.value or 0.0)
        notes.append(f"angle of incidence {angle:g} degrees ({beside.where}; --angle-deg)")
    if angle is None:
        names = {value.role.quantity for value in layout.values}
        oblique = layout.polarization or layout.polarizer or not names <= {*POWERS} - {*POLARIZED}
        if oblique or not layout.wavelength or any(map(_ANGULAR.search, layout.unused)):
            rest = f" (not understood: {', '.join(layout.unused[:6])})" if layout.unused else ""
            refuse(
                f"no column is an angle of incidence{rest}. Say --angle-deg NUMBER, or which "
                "column it is with --columns angle=..."
            )
        angle = 0.0
        notes.append("no angle given: normal incidence assumed (--angle-deg)")
    return np.full(len(table.rows), angle)


def angles(reading: Reading, wavelength: np.ndarray) -> np.ndarray:
    """Return the angle of incidence of each row in degrees.

    A spectrum of R or T without an angle is taken at normal incidence, where s and p are one.
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


# Angles of the field from the plane of incidence. Half p and half s is what unpolarized light is.
FIELD_DEG = {"p": 0.0, "s": 90.0, "u": 45.0}


def _fields(reading: Reading, column: Column) -> np.ndarray:
    """Return the field of each row from the angles, or the words and codes, of a column."""
    if reading.options.polarizer:
        numbers, _ = reading.numbers(column)
        unit = column.role.unit or "deg"
        if unit not in ("deg", "rad"):
            text = f"a polarizer angle in {unit} came. Convert it to degrees or radians."
            reading.refuse(column, text)
        degrees = np.degrees(numbers) if unit == "rad" else numbers
        degrees = degrees + (90.0 if reading.options.polarizer == "angle-from-s" else 0.0)
        # a linear polarizer looks the same after half a turn, and so does the power
        turned = np.mod(degrees, 180.0)
        return np.where(turned > 90.0, 180.0 - turned, turned)
    cells, codes = reading.table.cells(column.index), reading.options.codes
    coded = {number_or_none(code): letter for code, letter in codes.items()} | {None: ""}
    known = {
        cell: (codes.get(cell.lower()) or coded.get(number_or_none(cell), ""))
        if codes
        else light_of_cell(cell)
        for cell in set(cells)
    }
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
    _refuse_other_light(reading, set(known.values()) - {""}, column)
    return np.array([FIELD_DEG.get(known[cell], np.nan) for cell in cells])


def _refuse_other_light(reading: Reading, letters: set[str], column: Column) -> None:
    """Raise where another light than that of the columns or rows, s, p or u, is said."""
    came = f"the light is {' and '.join(sorted(letters))}-polarized"
    reading.contradicted("light", lambda letter: letter not in letters, column, came)


def light_of_rows(reading: Reading, oblique: bool) -> np.ndarray:
    """Return the polarization of each row as far as it is not said by the columns' own names.

    It is the angle of the field from the plane of incidence, as in `FIELD_DEG`; NaN: not said.
    oblique: whether any angle is not 0, where s and p are one.
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
        return _fields(reading, column)
    if options.codes or options.polarizer:
        refuse(
            "--polarization gives a meaning to a column, but none is named as the polarization. "
            "Say which it is with --columns polarization=..., or --polarization s or p."
        )
    if letter and letters - {letter}:
        text = f"the column is named {named[0].role.quantity}, but --polarization says otherwise. "
        reading.refuse(named[0], text + "Name the columns to be read with --columns.")
    if named and not letter:
        _refuse_other_light(reading, letters, named[0])
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


# Wavelengths of a curve at the least that show a fold of Delta; how many times smaller the kinks
# are where the curve goes on beyond 180 (or 0) instead; and how many times larger than elsewhere.
_FEWEST, _STRAIGHTER, _SHARPER = 20, 3.0, 5.0


def _has_folds(delta: np.ndarray) -> bool:
    """Return whether a curve of Delta from 0 to 180 degrees turns at an end as if it went on."""
    if len(delta) < _FEWEST:
        return False
    bend = np.abs(np.diff(delta, 2))
    kink = np.hypot(bend[:-1], bend[1:])  # of four neighbours, if it folds between the middle ones
    near = np.minimum(delta[1:-2], delta[2:-1]) > 90.0
    a, b, c, d = (delta[i : len(delta) - 3 + i] for i in range(4))
    c, d = (np.where(near, 360.0 - x, -x) for x in (c, d))
    beyond = np.hypot(c - 2.0 * b + a, d - 2.0 * c + b)
    sharp = kink > np.maximum(_SHARPER * np.median(bend), 1.0)
    return bool((sharp & (kink > _STRAIGHTER * beyond)).any())


def _folded(data: Data, wanted: str) -> Data:
    """Return the data with Delta as `delta_folded`, if it is so by its curves or by the option."""
    of, value = data.quantity == "delta", data.value
    if wanted and not of.any():
        refuse("--delta-range is for Delta, of which there is no column. Leave it out.")
    if not wanted and ((value[of] >= 0.0) & (value[of] <= 180.0)).all():
        curves = [np.flatnonzero(of & (data.angle_deg == a)) for a in np.unique(data.angle_deg[of])]
        order = [rows[np.argsort(data.wavelength_um[rows], kind="stable")] for rows in curves]
        wanted = "180" if any(_has_folds(value[rows]) for rows in order) else ""
    if wanted != "180":
        return data
    around = value % 360.0
    return data._replace(
        quantity=np.where(of, "delta_folded", data.quantity),
        value=np.where(of, np.minimum(around, 360.0 - around), value),
    )


class LongColumns(NamedTuple):
    """The data of a file, and where each datum stands.

    places: (line, column of the value, column of its standard error) of each datum.
    labels: columns of the angle, the wavelength and the polarizer.
    understood: how the file was read. reference: the column of a reference at each datum.
    """

    data: Data
    places: list[tuple[int, str, str]]
    labels: dict[str, str]
    understood: str
    reference: np.ndarray | None = None

    def by(self, converted: tuple[Data, str]) -> LongColumns:
        """Return the columns with other data, row by row, and how they were made."""
        data, how = converted
        return self._replace(data=data, understood=f"{self.understood}; {how}")


def _refuse_code(reading: Reading, value: Column, row: int, code: str, came: str) -> None:
    """Raise because a number may stand for 'not measured'."""
    flag = f"--missing{'=' if code[0] == '-' else ' '}{code}"
    text = f"{came}. Say {flag} if that stands for 'not measured', --missing none if it was "
    reading.refuse(value, text + "measured.", row)


def _refuse_placeholders(reading: Reading, numbers: dict[int, np.ndarray]) -> None:
    """Raise where Delta repeats psi, or both are 0 in some rows, as for what was not measured."""
    by_name = {value.role.quantity: value for value in reading.layout.values}
    if not {"psi", "delta"} <= set(by_name):
        return
    psi, delta = (numbers[by_name[name].index] for name in ("psi", "delta"))
    if np.isfinite(psi).sum() > 1 and np.array_equal(psi, delta, equal_nan=True):
        text = "every number equals that of psi, which no surface gives. Name the right column with"
        reading.refuse(by_name["delta"], text + " --columns delta=..., or correct the file.")
    dark = np.flatnonzero((psi == 0.0) & (delta == 0.0))
    if len(dark) and np.nan_to_num(psi).any() and "none" not in reading.options.missing:
        _refuse_code(reading, by_name["psi"], int(dark[0]), "0", "psi and Delta are both 0")


def _refuse_zeros(reading: Reading, value: Column, numbers: np.ndarray, name: np.ndarray) -> None:
    """Raise where codes or zeros among larger powers may stand for values never measured."""
    for i in np.flatnonzero(np.isin(numbers, (-1.0, -9.0, -99.0, -999.0, -9999.0)))[:1]:
        if np.nanmax(numbers, initial=0.0) > 1.0:
            _refuse_code(reading, value, i, f"{numbers[i]:g}", f"{numbers[i]:g} came")
    for quantity in np.unique(name):
        chosen = np.flatnonzero((name == quantity) & np.isfinite(numbers))
        zeros = chosen[numbers[chosen] == 0.0]
        others = np.abs(numbers[chosen][numbers[chosen] != 0.0])
        # a true zero (Brewster's angle, a fringe) is approached by its neighbours
        if len(zeros) and len(others) and others.min() > max(0.02 * others.max(), 1e-2):
            came = f"0 came, where the smallest other value is {others.min():.6g}"
            _refuse_code(reading, value, int(zeros[0]), "0", came)


def _refuse_left_out(reading: Reading) -> None:
    """Refuse a column that is not read, but may hold something of use."""
    table, layout = reading.table, reading.layout
    for index, what in layout.left_out.items():
        read = layout.angle, layout.wavelength, layout.polarization, layout.polarizer
        columns = [
            f"{c.role.quantity or c.role.kind}={c.index + 1}" for c in (*read, *layout.values) if c
        ]
        role = "wavelength" if layout.wavelength is None else "ROLE"
        role = "polarization" if what.startswith("the polarization") else role
        names = [table.label(i) for i in layout.left_out]
        if any(re.search(r"[\s,;]", name) for name in names):
            names = [str(i + 1) for i in layout.left_out]
        table.refuse(
            f"this column ({table.came_in(index)}) is not read, but it may be {what}. If the fit "
            f"may do without it, say --ignore {','.join(names)}; else name all columns to be read: "
            f"--columns {','.join(columns)},{role}={index + 1}.",
            table.label(index),
        )


def _understood(reading: Reading, data: Data, factor: float) -> str:
    """Return the line "read": what came, in which units, and all that was decided on the way."""
    table, layout, options, _, notes = reading
    angle, wavelength, quantity = data.angle_deg, data.wavelength_um, data.quantity
    spectral = len(np.unique(wavelength)) > 1
    axis, what, unit = (wavelength, "wavelength", "um") if spectral else (angle, "angle", "degrees")
    count = len(np.unique(axis))
    text = f"read {count} {what}{'s' * (count != 1)} ({span_of(axis, unit)}), "
    plain = " (unpolarized)" if angle.any() and np.isnan(data.polarizer_deg).all() else ""
    names = list(dict.fromkeys(quantity.tolist()))
    counts = [f"{np.sum(quantity == n)} {n}{plain * (n in POWER_LETTERS)}" for n in names]
    text += ", ".join(counts[:-1]) + " and " * (len(counts) > 1) + counts[-1]
    if are_powers(names).any():
        scale = " in percent" if factor == 0.01 else " as fractions" * (not options.divided)
        text += scale if options.scale is None else f", multiplied by {options.scale:g}"
    text += f", with{'' if np.isfinite(data.sigma).any() else 'out'} standard errors"
    if spectral:
        several = len(np.unique(angle))
        if several > 1 or layout.angle is not None or options.angle_deg is not None:
            text += f"; {several} angles" if several > 1 else f"; angle {angle[0]:g} degrees"
    elif np.isnan(wavelength).all():
        text += "; no wavelength given"
    elif layout.wavelength is not None or options.wavelength_um is not None:
        text += f"; wavelength {wavelength[0]:.6g} um"
    gaps = len(table.rows) * len(layout.values) - len(quantity)
    notes += [f"{gaps} gap{'s' * (gaps != 1)}"] * bool(gaps)
    notes += ["columns not used: " + ", ".join(layout.unused[:12])] * bool(layout.unused)
    return "; ".join([text, *dict.fromkeys(notes)])


def _table_of(lines: Lines, options: Options) -> Table:
    """Return the table in the lines of a file of any known format."""
    texts, plain = lines.texts, None
    if lines.tabbed:
        if options.delimiter:
            refuse("--delimiter is for text, and the cells of a table are known. Leave it out.")
        options = options._replace(delimiter="\t")
    else:
        plain = instruments.woollam(texts, options.ignore)
        for as_plain_table in FORMATS:
            plain = plain or as_plain_table(texts)
    numbered, notes = plain or (list(enumerate(texts, start=1)), [])
    table = read_table(numbered, options)
    return table._replace(notes=table.notes + notes + lines.notes)


def _with_reference(table: Table, name: str) -> tuple[Table, Column | None]:
    """Return the table without the column of a reference, and this column, None if not there."""
    low = name.strip().lower()
    which = [i for i in table.filled if low and table.names[i].lower() == low]
    exists = name == STDIN or bool(name and Path(name).exists())
    if name and not (which or exists):
        names = ", ".join(filter(None, table.names))
        refuse(f"--divide-by {name} names neither a file nor a column; the columns are {names}.")
    if len(which) != 1:
        return table, None
    if exists:
        refuse(f"--divide-by {name} names a column and a file. If it is the file, say ./{name}.")
    rest = table._replace(filled=[i for i in table.filled if i not in which])
    return rest, Column(which[0], table.label(which[0]), Role("value"))


@np.errstate(all="ignore")  # what overflows or is NaN is refused by the checks of the Measurement
def long_columns(source: Any, options: Options) -> LongColumns:
    """Return the data of a file, a buffer or a table, column after column, gaps left out.

    Refuses what is ambiguous or contradicts itself; ranges are not checked.
    """
    lines = read_lines(source, options.encoding, options.sheet)
    table, by = _with_reference(_table_of(lines, options), options.reference)
    layout = choose_columns(table, options)
    said = evidence(lines.name, table.preamble, table.decimal)
    ats = dict.fromkeys(v.role.at for v in layout.values if v.role.at is not None)
    notes = [*table.notes, *(f"angle {at:g} degrees by the column name" for at in ats)]
    for value in [v for v in layout.values if options.columns and v.role.at is None]:
        said += (s for s in statements(table.header, value.label) if s.kind == "angle")
    reading = Reading(table, layout, options, without(said, options), notes)
    first, letters = layout.values[0], {letter_of(v.role.quantity) for v in layout.values}
    letters &= {*POWER_LETTERS}
    if letters and not letters & {said.value for said in reading.said if said.kind == "quantity"}:
        came = f"the name says {first.role.quantity}"
        reading.contradicted("quantity", lambda letter: letter not in letters, first, came)
    wavelength = wavelengths(reading)
    angle = angles(reading, wavelength)
    read = {v.index: reading.numbers(v, gaps=True) for v in layout.values}
    numbers = {index: pair[0] for index, pair in read.items()}
    _refuse_placeholders(reading, numbers)
    field = light_of_rows(reading, bool(np.nan_to_num(angle).any() or any(ats)))
    _refuse_left_out(reading)
    factor = power_scale(reading, numbers, {index: pair[1] for index, pair in read.items()})
    psi_units = psi_delta_unit(reading, numbers)
    light = layout.polarizer or layout.polarization
    reference = np.full(len(angle), np.nan) if by is None else reading.numbers(by, gaps=True)[0]
    parts: list[tuple[np.ndarray, ...]] = []
    places: list[tuple[int, str, str]] = []
    for value, error in zip(layout.values, layout.sigmas, strict=True):
        raw, quantity = numbers[value.index], value.role.quantity
        power, unit = quantity in POWERS, psi_units.get(value.index, "")
        converted = np.degrees(raw) if unit == "rad" else scaled(raw, factor if power else 1.0)
        if value.role.at is not None and options.angle_deg is None:
            angle = np.full(len(raw), value.role.at)
        sigma = standard_errors(reading, value, error, unit, factor)
        if options.sigma is not None:
            sigma = np.where(np.isnan(sigma), options.sigma, sigma)
        name = np.full(len(raw), quantity, dtype=NAME)
        polarizer = np.full(len(raw), np.nan)
        needed = [(error, sigma, "standard error"), (layout.angle, angle, "angle"),
                  (layout.wavelength, wavelength, "wavelength")]  # fmt: skip
        if quantity in POWER_LETTERS:
            needed.append((light, field, "polarization"))
            for letter in "sp":
                name[field == FIELD_DEG[letter]] = f"{quantity}_{letter}"
            polarizer = np.where(np.isin(field, [*FIELD_DEG.values()]), np.nan, field)
        for column, known, what in needed:
            gone = ~np.isnan(raw) & np.isnan(known)
            if column is not None and gone.any():
                i = int(np.argmax(gone))
                cell = table.rows[i][column.index]
                came = f"the {what} is missing in a row that has a value"
                if not is_missing(cell):
                    came = f"{cell[:30]!r} is no Q between 0 and 4 pi / wavelength "
                    came += "(--wavelength-um)"
                advice = ". Correct it, or leave the line out with --lines A-B."
                reading.refuse(column, came + advice, i)
        if power and "none" not in options.missing:
            _refuse_zeros(reading, value, raw, name)
        kept = np.flatnonzero(~np.isnan(raw))
        columns = (angle, wavelength, name, converted, sigma, polarizer, reference)
        parts.append(tuple(column[kept] for column in columns))
        places += [(table.lines[i], value.label, error.label if error else "") for i in kept]
    if not places:
        came = f"the {len(table.rows)} rows hold gaps only"
        refuse(f"{came}; at least one measured value was wanted.", table.lines[0])
    *columns, reference = (np.concatenate(column) for column in zip(*parts, strict=True))
    data = _folded(Data(*columns), options.delta_range)
    if (data.quantity == "delta_folded").any():
        notes.append("Delta from 0 to 180 degrees, of unknown sign (--delta-range)")
    axes = [layout.angle, layout.wavelength, layout.polarizer]
    labels = {column.role.kind: column.label for column in axes if column is not None}
    understood = _understood(reading, data, factor)
    return LongColumns(data, places, labels, understood, None if by is None else reference)
