"""The index of a material from a file.

    read_material("SiO2/nk/Malitson.yml")      a file of the refractiveindex.info database
    read_material("film.csv")                  a table of wavelength, n and, if wanted, k

In the text of a sample the name of a file may stand for that of a material:
``air | film.yml 110 nm | Si``. What YAML says is read by `fresnel_jax.dispersion`; tables are read
as measurements are: headers, units and cells.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from fitting.data.errors import MeasurementError, for_command, named, refuse
from fitting.data.units import span_of
from fitting.reader.columns import Column, Layout, left_out, roles_of
from fitting.reader.conversion import Reading, wavelengths
from fitting.reader.names import role_of
from fitting.reader.options import Options
from fitting.reader.remarks import evidence
from fitting.reader.table import Table, looks_like_data, read_table, split_cells, uncomment
from fitting.reader.text import read_lines
from fresnel_jax.dispersion import Material, material_from_tables, material_from_yaml

ENDINGS = (".yml", ".yaml", ".csv", ".txt", ".dat", ".nk")
# Wavelengths without a unit are in micrometres below 100, as refractiveindex.info exports them;
# from there to 2000 they are in nanometres, above it they may be in angstrom.
_NANOMETRES = (100.0, 2000.0)
_WANTED = (
    "A header such as wavelength_um,n,k was wanted (or wavelength_nm, energy_eV, wavenumber_cm-1, "
    "frequency_THz), with each of them once and k where it is not 0"
)
_Column = tuple[np.ndarray, np.ndarray]  # wavelengths in micrometres, and n or k at them


class MaterialFileError(ValueError):
    """An index cannot be read from a file; the text says where, what came, and what was wanted."""


def is_material_file(text: str) -> bool:
    """Return whether a text names a file (by its ending) and not a material."""
    return text.strip().lower().endswith(ENDINGS)


def read_material(path: str | os.PathLike[str]) -> Material:
    """Return the index in a file, over the wavelengths that it covers.

    A ``.yml`` of the refractiveindex.info database: types "tabulated nk", "tabulated n",
    "tabulated k" and "formula 1" to "formula 9"; where n and k come in two tables the range is
    the common one; k is 0 if it is missing. Any other file is a table, read as measurements are: n
    and, if wanted, k over a wavelength, photon energy, wavenumber or frequency in the unit that
    its name says. Standard errors of n and k are left out, any other column is refused.

    Raises MaterialFileError for a file that cannot be read or holds no index.
    """
    file = Path(path)
    try:
        if file.suffix.lower() in (".yml", ".yaml"):
            with named(file.name):
                text = "\n".join(read_lines(file).texts)
            return material_from_yaml(text, file.stem)
        columns = index_in_table(file)
        return material_from_tables(columns["n"], columns.get("k"), file.stem)
    except MeasurementError as error:
        text = for_command(error)
        advice = " The file of a material takes no options: write it so." * ("--" in text)
        raise MaterialFileError(text + advice) from None
    except ValueError as error:
        raise MaterialFileError(f"{file.name}: {error}.") from None


def _blocks(texts: list[str]) -> list[list[tuple[int, str]]]:
    """Return the numbered lines of each table: one, or one of n and one of k."""
    blocks: list[list[tuple[int, str]]] = [[]]
    rows = 0
    for line, text in enumerate(texts, start=1):
        if rows and _is_header(text):
            blocks.append([])
            rows = 0
        rows += looks_like_data(_cells(uncomment(text)))[0]
        blocks[-1].append((line, text))
    return [*map(_without_empty_column, blocks)]


def _cells(text: str) -> list[str]:
    return split_cells(text, next((mark for mark in "\t;," if mark in text), " "))


def _is_header(text: str) -> bool:
    return {"wavelength", "index"} <= {role_of(cell).kind for cell in _cells(uncomment(text))}


def _without_empty_column(lines: list[tuple[int, str]]) -> list[tuple[int, str]]:
    """Return lines where a last column that is named and never filled has empty cells."""
    rows = {line: cells for line, text in lines if looks_like_data(cells := _cells(text))[0]}
    header = next((text for _, text in lines if _is_header(text)), "")
    if {len(cells) for cells in rows.values()} != {len(_cells(header)) - 1}:
        return lines
    first = next(text for line, text in lines if line in rows)
    mark = next((mark for mark in "\t;," if mark in first), ",")
    return [(line, text + mark * (line in rows)) for line, text in lines]


def _index_of(table: Table, source: str) -> dict[str, _Column]:
    """Return the wavelengths in micrometres and the numbers of n, of k, or of both in a table.

    A fit has no use for the standard errors of n and k, which are left out, as are running numbers
    and words that are the same in all rows; any other column is refused.
    """
    columns: dict[str, list[Column]] = {"wavelength": [], "n": [], "k": []}
    rest = {}
    for i, role in enumerate(roles_of(table)):
        name = role.quantity if role.kind == "index" else role.kind
        if i in table.filled and name in columns:
            columns[name].append(Column(i, table.label(i), role))
        elif i in table.filled and (role.kind != "sigma" or role.quantity not in ("n", "k", "")):
            rest[i] = role
    for name, several in columns.items():
        if len(several) > 1 or not (several or name == "k" or (name == "n" and columns["k"])):
            came = " and ".join(repr(column.label) for column in several) or "none"
            refuse(
                f"of the columns {', '.join(map(table.label, range(len(table.names))))} {came} may "
                f"be the {name}. {_WANTED}.",
                table.top,
            )
    axis = columns["wavelength"][0]
    for i, what in left_out(table, rest, [axis.index], constants=False).items():
        refuse(
            f"this column ({table.came_in(i)}) is neither n nor k, but may be {what}. {_WANTED}; "
            "delete the column, or name it sigma_n or sigma_k if it holds standard errors.",
            table.top,
            table.label(i),
        )
    layout = Layout(None, axis, None, None, [], [], [], {})
    said = [s for s in evidence(source, table.preamble) if s.kind == "wavelength unit"]
    reading = Reading(table, layout, Options(), said, [])
    if axis.role.form == "wavelength" and not axis.role.unit and not reading.one("wavelength unit"):
        x, _ = reading.numbers(axis)
        low, high = _NANOMETRES
        if not (np.nanmax(x) < low or low < np.nanmin(x) <= np.nanmax(x) <= high):
            reading.refuse(
                axis,
                f"the name states no unit, and {span_of(x)} may be um, nm or angstrom. Name it "
                "wavelength_um, wavelength_nm or wavelength_angstrom.",
            )
        unit = "um" if np.nanmax(x) < low else "nm"
        reading = reading._replace(options=Options(wavelength_unit=unit))
    wavelength = wavelengths(reading)
    out = {}
    for name in ("n", "k"):
        for column in columns[name]:
            numbers, _ = reading.numbers(column)
            there = ~np.isnan(numbers)
            out[name] = wavelength[there], numbers[there]
    return out


def index_in_table(file: Path) -> dict[str, _Column]:
    """Return n, and k where there is one, from one table or two, as refractiveindex.info has them.

    Raises MeasurementError for a file that is no such table.
    """
    parts: dict[str, _Column] = {}
    with named(file.name):
        for lines in _blocks(read_lines(file).texts):
            found = _index_of(read_table(lines, Options()), file.name)
            if twice := found.keys() & parts.keys():
                refuse(f"two tables hold {min(twice)}; one was wanted.", lines[0][0])
            parts |= found
        if "n" not in parts:
            refuse(f"no column is n. {_WANTED}.")
    return parts
