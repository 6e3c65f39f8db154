"""Which column of a table is the angle, the wavelength, each value and its standard error."""

from __future__ import annotations

from collections import defaultdict
from typing import NamedTuple, NoReturn

from fitting.errors import MeasurementError, place
from fitting.reader.cells import is_missing, is_number, to_numbers
from fitting.reader.computed_rows import refuse_computed_rows
from fitting.reader.names import Role, role_of
from fitting.reader.options import Options
from fitting.reader.table import Table, find_column, label_of
from fitting.reader.units import FORM_OF, Q_UNITS


class Column(NamedTuple):
    """One column in use: its place from 0, its label for messages, and what it means."""

    index: int
    label: str
    role: Role


class Layout(NamedTuple):
    """The columns in use. ``sigmas`` has for each value its standard error, or None."""

    angle: Column | None
    wavelength: Column | None
    polarization: Column | None
    polarizer: Column | None
    values: list[Column]
    sigmas: list[Column | None]
    unused: list[str]


def _range_of(table: Table, index: int) -> str:
    cells = [row[index] for row in table.rows if is_number(row[index])]
    numbers, _ = to_numbers(cells, [0] * len(cells), table.decimal, table.source, str(index + 1))
    return f"{numbers.min():.4g} to {numbers.max():.4g}" if cells else "no numbers"


def _filled(table: Table) -> list[int]:
    """Return the columns that hold anything at all."""
    width = range(len(table.names))
    return [i for i in width if any(not is_missing(row[i]) for row in table.rows)]


def _refuse_without_values(table: Table, roles: list[Role]) -> NoReturn:
    filled = _filled(table)
    listed = "; ".join(
        f"{i + 1}{' ' + repr(table.names[i]) if table.names[i] else ''}: {_range_of(table, i)}"
        + (f" ({roles[i].why})" if roles[i].why else "")
        for i in filled[:8]
    )
    x, y = filled[0] + 1, filled[1] + 1
    example = (
        f"say what they are, for example --columns angle={x},R={y} --angle-unit deg (or rad; for "
        f"Q 1/angstrom, with --wavelength-um NUMBER) or --columns wavelength={x},R={y} "
        "--wavelength-unit nm, with --scale 0.01 if R is in percent."
    )
    if table.misfit:
        raise MeasurementError(
            f"{table.source}: {table.misfit}. If the comma is the decimal mark as well as the "
            f"delimiter, write the file with semicolons; else count the columns ({listed}) and "
            f"{example}"
        )
    if not table.header:
        raise MeasurementError(
            f"{place(table.source, table.lines[0])}: {len(filled)} columns without names "
            f"({listed}). S{example[1:]}"
        )
    advice = f"If one is, {example}"
    if all(roles[i].why or roles[i].kind for i in filled):
        advice = (
            "A table of an angle or a wavelength and R, R_s, R_p, T, psi or delta was wanted, "
            "powers as a ratio to the direct beam; --columns names other columns."
        )
    raise MeasurementError(
        f"{place(table.source, table.header)}: no column is named as a reflectance, transmittance, "
        f"psi or delta that can be fitted ({listed}). {advice}"
    )


def _explicit(table: Table, options: Options) -> dict[str, list[Column]]:
    found = defaultdict[str, list[Column]](list)
    taken: dict[int, str] = {}
    for name, wanted in options.columns.items():
        index = find_column(table, wanted, "--columns")
        if index in taken:
            raise MeasurementError(
                f"{table.source}: --columns gives column {wanted} to both {taken[index]} and "
                f"{name}."
            )
        taken[index] = name
        role = role_of(table.names[index], table.units[index])
        unit = role.unit
        if name in ("angle", "wavelength"):
            q = unit in Q_UNITS
            if name == "angle":
                form = "q" if q else "incidence"
            else:
                form = "wavelength" if q else FORM_OF.get(unit, "wavelength")
            role = role if role.kind == name else Role(name, "", form, unit)
        elif name in ("polarization", "polarizer"):
            role = Role(name, unit=unit)
        else:
            kind = "sigma" if name.startswith("sigma_") else "value"
            role = Role(kind, name.removeprefix("sigma_"), unit=unit, at=role.at)
        found[role.kind].append(Column(index, label_of(table, index), role))
    if not found["value"]:
        raise MeasurementError(
            f"{table.source}: --columns names no value; add one such as R=2, R_s=2 or psi=3."
        )
    return found


def _implicit(table: Table) -> dict[str, list[Column]]:
    orso = any("ORSO reflectivity data file" in text for _, text in table.preamble[:3])
    found = defaultdict[str, list[Column]](list)
    roles = []
    filled = set(_filled(table))
    for index, name in enumerate(table.names):
        if orso and name[:1] == "s" and name[1:2].isupper():
            name = "sigma " + name[1:]  # the prefix by which that format marks errors
        role = role_of(name, table.units[index])
        roles.append(role)
        if role.kind == "unclear" and index in filled:
            value, named = role.quantity.removeprefix("sigma_"), f"{role.quantity}={index + 1}"
            wanted = named if value == role.quantity else f"{value}=2,{named}"
            if not role.quantity:  # of no use as it is
                wanted = "R=2 without it, or make them absolute"
            raise MeasurementError(
                f"{place(table.source, table.header, name)}: this may be {role.why}. Name all "
                f"columns to be read, for example --columns angle=1,{wanted}."
            )
        if role.kind and index in filled:
            found[role.kind].append(Column(index, label_of(table, index), role))
    if not found["value"]:
        _refuse_without_values(table, roles)
    return found


def _only(table: Table, columns: list[Column], role: str) -> Column | None:
    if len(columns) > 1:
        a, b = columns[0], columns[1]
        raise MeasurementError(
            f"{place(table.source, table.header)}: columns {a.index + 1} {a.label!r} and "
            f"{b.index + 1} {b.label!r} both give {role}. Name all columns to be read, for example "
            f"--columns {role}={a.index + 1},..."
        )
    return columns[0] if columns else None


def _attach(table: Table, values: list[Column], sigmas: list[Column]) -> list[Column | None]:
    """Return the standard error of each value: by its name, or standing right behind the value."""
    attached: list[Column | None] = [None] * len(values)
    nameless = [sigma for sigma in sigmas if not sigma.role.quantity]
    for sigma in sigmas:
        if sigma in nameless:
            fits = [i for i, value in enumerate(values) if value.index == sigma.index - 1]
            if len(nameless) < len(values):
                fits = fits if len(values) == 1 else []
            if not fits and len(values) == 1:
                fits = [0]
        else:
            name, tail = sigma.role.quantity, len(sigma.role.quantity)
            part = -tail if name.startswith("_") else 0
            fits = [i for i, v in enumerate(values) if v.role.quantity[part:] == name]
            if sigma.role.at is not None:
                fits = [i for i in fits if values[i].role.at == sigma.role.at]
            if not fits:
                continue
        if len(fits) != 1 or attached[fits[0]] is not None:
            raise MeasurementError(
                f"{place(table.source, table.header)}: it is not clear which value the standard "
                f"errors in column {sigma.index + 1} {sigma.label!r} belong to. Name all columns "
                f"to be read, for example --columns angle=1,R_s=2,sigma_R_s={sigma.index + 1}."
            )
        attached[fits[0]] = sigma
    return attached


def choose_columns(table: Table, options: Options) -> Layout:
    """Return the columns to be read, as the option ``columns`` or else the header says.

    Raises MeasurementError where two columns claim one role, none holds a value, or rows are
    statistics of other rows.
    """
    found = _explicit(table, options) if options.columns else _implicit(table)
    values = found["value"]
    for of in dict.fromkeys((value.role.quantity, value.role.at) for value in values):
        _only(table, [v for v in values if (v.role.quantity, v.role.at) == of], of[0])
    angled = [value for value in values if value.role.at is not None]
    if angled and (len(angled) < len(values) or found["angle"]):
        raise MeasurementError(
            f"{place(table.source, table.header, angled[0].label)}: this name gives an angle of "
            "incidence, and other columns give another, or none. Name all columns to be read with "
            "--columns, and the angle with --angle-deg."
        )
    names = {value.role.quantity for value in values}
    for letter in "RT":
        if {letter, letter + "_s", letter + "_p"} <= names and not options.columns:
            raise MeasurementError(
                f"{place(table.source, table.header)}: {letter} beside {letter}_s and {letter}_p "
                "may be their mean, and would count twice. Name all columns to be read, for "
                f"example --columns angle=1,{letter}_s=2,{letter}_p=3."
            )
    kinds = ("angle", "wavelength", "polarization", "polarizer")
    single = {kind: _only(table, found[kind], kind) for kind in kinds}
    sigmas = _attach(table, values, found["sigma"])
    used = {c.index for c in [*single.values(), *values, *sigmas] if c is not None}
    refuse_computed_rows(table, used)
    unused = [label_of(table, i) for i in _filled(table) if i not in used]
    return Layout(**single, values=values, sigmas=sigmas, unused=unused)
