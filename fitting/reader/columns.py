"""Which column of a table is the angle, the wavelength, each value and its standard error."""

from __future__ import annotations

import re
from collections import defaultdict
from typing import NamedTuple

from fitting.data.errors import refuse
from fitting.data.quantities import POLARIZED, POWER_LETTERS, QUANTITIES, STOKES
from fitting.data.units import FORM_OF
from fitting.reader.names import Role, role_of
from fitting.reader.options import Options
from fitting.reader.remarks import light_of_cell
from fitting.reader.table import Table, is_missing, is_number, number_or_none, to_numbers

# words by which a column shows that rows are means or deviations of other rows; Accurion EP3 and
# EP4 write the mean of the zones as zone 0, their deviation as zone 5
_STATISTICS = {"mean", "avg", "average", "std", "stdev", "sd", "sigma", "error", "median"}
_ZONES = {"0", "5"}


class Column(NamedTuple):
    """One column in use: its place from 0, its label for messages, and what it means."""

    index: int
    label: str
    role: Role


class Layout(NamedTuple):
    """The columns in use. ``sigmas`` has for each value its standard error, or None.

    unused: labels of the columns that are not read. left_out: what those of them may be, by their
    index, of which the fit may not do without.
    """

    angle: Column | None
    wavelength: Column | None
    polarization: Column | None
    polarizer: Column | None
    values: list[Column]
    sigmas: list[Column | None]
    unused: list[str]
    left_out: dict[int, str]


def _explicit(table: Table, options: Options) -> list[Column]:
    """Return the columns that the option ``columns`` names."""
    found: list[Column] = []
    taken: dict[int, str] = {}
    for name, wanted in options.columns.items():
        index = table.find(wanted)
        kind = "sigma" if name.startswith("sigma_") else "value" if name in QUANTITIES else name
        # one column may be the error of several values
        if index in taken and not (kind == "sigma" and taken[index].startswith("sigma_")):
            refuse(
                f"--columns gives column {wanted} to both {taken[index]} and {name}. Name one "
                "column for each."
            )
        taken[index] = name
        role = role_of(table.names[index], table.units[index])
        if name in ("angle", "wavelength"):
            form = FORM_OF.get(role.unit, "q")
            if (form == "q") == (name == "wavelength") or role.unit in ("", "deg", "rad"):
                form = "incidence" if name == "angle" else "wavelength"
            role = role if role.kind == name else Role(name, form=form, unit=role.unit)
        elif kind == name:
            role = Role(name, unit=role.unit)
        else:
            role = Role(kind, name.removeprefix("sigma_"), unit=role.unit, at=role.at)
        found.append(Column(index, table.label(index), role))
    if not any(column.role.kind == "value" for column in found):
        refuse("--columns names no value; add one such as R=2, R_s=2 or psi=3.")
    return found


def roles_of(table: Table) -> list[Role]:
    """Return what each name in the header says."""
    orso = any("ORSO reflectivity data file" in text for _, text in table.preamble[:3])
    # the prefix by which that format marks errors
    names = [
        "sigma " + name[1:] if orso and name[:1] == "s" and name[1:2].isupper() else name
        for name in table.names
    ]
    roles = [role_of(name, unit) for name, unit in zip(names, table.units, strict=True)]
    if len({*STOKES} & {role.quantity for role in roles}) > 1:
        return roles
    # one letter alone says too little; N is an index in capitals
    alone = {"N": Role("index", "n")} | dict.fromkeys(STOKES[1:], Role(""))
    return [alone.get(role.quantity, role) for role in roles]


def _implicit(table: Table, roles: list[Role], filled: list[int]) -> list[Column]:
    """Return the columns whose names are understood; refuse where none of them is a value."""
    for index in filled:
        role = roles[index]
        if role.kind == "unclear":
            value, named = role.quantity.removeprefix("sigma_"), f"{role.quantity}={index + 1}"
            wanted = named if value == role.quantity else f"{value}=2,{named}"
            if not role.quantity:  # of no use as it is
                wanted = "R=2 without it, or make them absolute"
            table.refuse(
                f"this may be {role.why}. Name all columns to be read, for example --columns "
                f"angle=1,{wanted}.",
                table.names[index],
            )
    if any(roles[index].kind == "value" for index in filled):
        return [Column(i, table.label(i), roles[i]) for i in filled if roles[i].kind]
    listed = []
    for i in table.filled[:8]:
        cells = [cell for cell in table.cells(i) if is_number(cell)]
        numbers, _ = to_numbers(cells, [0] * len(cells), table.decimal, str(i + 1))
        span = f"{numbers.min():.4g} to {numbers.max():.4g}" if cells else "no numbers"
        name = f" {table.names[i]!r}" if table.names[i] else ""
        listed.append(f"{i + 1}{name}: {span}" + (f" ({roles[i].why})" if roles[i].why else ""))
    x, y = table.filled[0] + 1, table.filled[1] + 1
    advice = (
        f"Say what they are, for example --columns angle={x},R={y} --angle-unit deg (or rad; for "
        f"Q 1/angstrom, with --wavelength-um NUMBER) or --columns wavelength={x},R={y} "
        "--wavelength-unit nm, with --scale 0.01 if R is in percent."
    )
    came = "no column is named as a reflectance, transmittance, psi or delta that can be fitted"
    if not table.header:
        came = f"the {len(table.filled)} columns have no names, since no line above them has "
        came += f"{len(table.names)} names"
        advice += " If the comma is the decimal mark too, write the file with semicolons."
    elif all(roles[i].why or roles[i].kind for i in table.filled):
        advice = (
            "A table of R, R_s, R_p, T, psi or delta over the angle of incidence or the wavelength "
            "was wanted. If a column holds one of these under another name, say which with "
            "--columns. A raw signal is read as R or T in this way, if --divide-by names the scan "
            "of the direct beam or a reference."
        )
    table.refuse(f"{came} ({'; '.join(listed)}). {advice}")


def _only(table: Table, columns: list[Column], role: str) -> Column | None:
    if len(columns) > 1:
        a, b = columns[:2]
        table.refuse(
            f"columns {a.index + 1} {a.label!r} and {b.index + 1} {b.label!r} both give {role}. "
            f"Name all columns to be read, for example --columns {role}={a.index + 1},..."
        )
    return columns[0] if columns else None


def _attach(table: Table, values: list[Column], sigmas: list[Column]) -> list[Column | None]:
    """Return the standard error of each value: by its name, or standing right behind the value."""
    attached: list[Column | None] = [None] * len(values)
    nameless = sum(not sigma.role.quantity for sigma in sigmas)
    for sigma in sigmas:
        name, at = sigma.role.quantity, sigma.role.at
        if name:
            fits = [
                i for i, value in enumerate(values) if at in (None, value.role.at)
                and (value.role.quantity == name or (name[0] == "_" and
                     value.role.quantity.endswith(name)))
            ]  # fmt: skip
            if not fits:
                continue
        elif len(values) == 1:
            fits = [0]
        else:
            behind = [i for i, value in enumerate(values) if value.index == sigma.index - 1]
            fits = behind if nameless >= len(values) else []
        if len(fits) != 1 or attached[fits[0]] is not None:
            all_of = ",".join(f"{v.role.quantity}={v.index + 1}" for v in values)
            errors = ",".join(f"sigma_{v.role.quantity}={sigma.index + 1}" for v in values)
            table.refuse(
                f"it is not clear which value the standard errors in column {sigma.index + 1} "
                f"{sigma.label!r} belong to. Name all columns to be read: if they belong to all "
                f"values, --columns angle=1,{all_of},{errors}."
            )
        attached[fits[0]] = sigma
    return attached


def left_out(
    table: Table, columns: dict[int, Role], axes: list[int], constants: bool = True
) -> dict[int, str]:
    """Return what each of the columns may be that are not read but may hold something of use.

    Constant columns, running numbers and what is nothing to be fitted may be left out.
    axes: columns that tell the rows apart. constants: whether numbers that are the same in all
    rows may be left out.
    """
    lost = {}
    for index, role in columns.items():
        cells = table.cells(index)
        numbers, count = [*map(number_or_none, cells)], len(cells)
        if count > 2 and numbers in ([*range(count)], [*range(1, count + 1)]):
            # which is not the axis itself
            harmless = len({tuple(row[i] for i in axes) for row in table.rows}) > 1
        else:
            means = role.quantity or light_of_cell(cells[0]) or role_of(cells[0]).quantity
            same = len({c if x is None else x for c, x in zip(cells, numbers, strict=True)}) == 1
            same = same and (constants or not is_number(cells[0]))
            harmless = role.kind == "aside" or (same and not means)
        if not harmless:
            why = role.why if role.why.startswith("it ") else ""
            lost[index] = re.sub("^it (is|may be) ", "", why) or (
                "an axis, a value or its standard error under a name or in a unit that is not known"
                if all(is_number(cell) or is_missing(cell) for cell in cells)
                else "the polarization, or the name of a sample"
            )
    return lost


def choose_columns(table: Table, options: Options) -> Layout:
    """Return the columns to be read, as the option ``columns`` or else the header says."""
    roles = roles_of(table)
    filled = [
        i for i in table.filled if not {table.names[i].lower(), str(i + 1)} & set(options.ignore)
    ]
    found = _explicit(table, options) if options.columns else _implicit(table, roles, filled)
    of_kind = defaultdict[str, list[Column]](list)
    for column in found:
        of_kind[column.role.kind].append(column)
    values = of_kind["value"]
    names = {value.role.quantity for value in values}
    if not names & {*POWER_LETTERS, *POLARIZED}:
        of_kind["polarization"] = of_kind["polarizer"] = []
    for of in dict.fromkeys((value.role.quantity, value.role.at) for value in values):
        _only(table, [v for v in values if (v.role.quantity, v.role.at) == of], of[0])
    angled = [value for value in values if value.role.at is not None]
    if angled and (len(angled) < len(values) or of_kind["angle"]):
        table.refuse(
            "this name gives an angle of incidence, and other columns give another, or none. Name "
            "all columns to be read with --columns, and the angle with --angle-deg.",
            angled[0].label,
        )
    for letter in POWER_LETTERS:
        if {letter, letter + "_s", letter + "_p"} <= names and not options.columns:
            table.refuse(
                f"{letter} beside {letter}_s and {letter}_p may be their mean, and would count "
                "twice. Name all columns to be read, for example --columns "
                f"angle=1,{letter}_s=2,{letter}_p=3."
            )
    kinds = ("angle", "wavelength", "polarization", "polarizer")
    single = {kind: _only(table, of_kind[kind], kind) for kind in kinds}
    sigmas = _attach(table, values, of_kind["sigma"])
    axes = [column.index for column in single.values() if column is not None]
    used = {*axes, *(c.index for c in [*values, *sigmas] if c is not None)}
    for index in {*range(len(table.names))} - used:  # rows that are computed from others
        cells = [cell.lower() for cell in table.cells(index)]
        words = _ZONES if table.label(index).lower() == "zone" else _STATISTICS
        row = next((i for i, cell in enumerate(cells) if cell in words), -1)
        if row >= 0 and len(set(cells)) > 1:
            refuse(
                f"{table.rows[row][index]!r} says that this row is a mean or a standard deviation "
                "of others. Delete such rows, or choose others with --lines A-B.",
                table.lines[row],
                table.label(index),
            )
    rest = {} if options.columns else {i: roles[i] for i in filled if i not in used}
    unused = [table.label(i) for i in table.filled if i not in used]
    return Layout(**single, values=values, sigmas=sigmas, unused=unused,
                  left_out=left_out(table, rest, axes))  # fmt: skip
