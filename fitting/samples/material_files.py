"""The index of a material from a file.

    read_material("SiO2/nk/Malitson.yml")      a file of the refractiveindex.info database
    read_material("film.csv")                  a table of wavelength, n and, if wanted, k

In the text of a sample the name of a file may stand for that of a material:
``air | film.yml 110 nm | Si``. YAML is read by PyYAML, an optional dependency (extra ``yaml``): a
parser of our own would know only the part of YAML that those files use today. Tables are read as
measurements are: headers, units and cells.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array

from fitting.data.errors import MeasurementError, for_command, named, refuse
from fitting.data.units import span_of
from fitting.process.compiled import fit_settings
from fitting.reader.cells import looks_like_data, split_cells
from fitting.reader.columns import Column, Layout, left_out, roles_of
from fitting.reader.conversion import Reading, wavelengths
from fitting.reader.names import role_of
from fitting.reader.options import Options
from fitting.reader.remarks import evidence
from fitting.reader.table import Table, read_table, uncomment
from fitting.reader.text import read_lines
from fitting.samples.published_formulas import PublishedFormula
from fresnel_jax.dispersion import DispersionModel, Index, Material, Tabulated

ENDINGS = (".yml", ".yaml", ".csv", ".txt", ".dat", ".nk")
# An alias may stand for gigabytes. The largest table of the database has 61,730 rows.
_LONGEST_YAML, _DEEPEST, _MOST_PARTS = 5_000_000, 20, 10_000
# k of metals in the far infrared is some thousand: 6,100 is the most in the database.
_LARGEST = 1e6

# n or k: a model, and the wavelengths from which to which it holds.
_Part = tuple[DispersionModel, tuple[float, float]]
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


class _Both(DispersionModel):
    """n of one model and k of another."""

    n: DispersionModel
    k: DispersionModel | None

    def index(self, wavelength_um: Array) -> Index:
        eta = self.n.index(wavelength_um).eta
        k = jnp.zeros_like(eta) if self.k is None else self.k.index(wavelength_um).k
        return Index(eta, k)


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
                parts = _in_yaml("\n".join(read_lines(file, None)[0]))
        else:
            columns = index_in_table(file).items()
            parts = {name: _tabulated(*column, name) for name, column in columns}
        return _joined(parts["n"], parts.get("k"), file.stem)
    except MeasurementError as error:
        text = for_command(error)
        advice = " The file of a material takes no options: write it so." * ("--" in text)
        raise MaterialFileError(text + advice) from None
    except ValueError as error:
        raise MaterialFileError(f"{file.name}: {error}.") from None


def _in_yaml(text: str) -> dict[str, _Part]:
    """Return n, and k where there is one, of a file of the refractiveindex.info database."""
    try:
        import yaml
    except ImportError:
        raise ValueError(
            "reading YAML needs PyYAML, which is not installed. Install it (pip install pyyaml, or "
            "fresnel-jax with its extra 'yaml'), or save the index as CSV with the columns "
            "wavelength_um, n, k"
        ) from None
    if len(text) > _LONGEST_YAML:
        most = _LONGEST_YAML // 10**6
        raise ValueError(f"more than {most} MB of YAML came, the most that is read. Leave rows out")
    loader = getattr(yaml, "CBaseLoader", yaml.BaseLoader)  # values stay texts, whatever their tags
    depth = 0
    try:
        for count, event in enumerate(yaml.parse(text, loader)):
            depth += isinstance(event, yaml.CollectionStartEvent)
            depth -= isinstance(event, yaml.CollectionEndEvent)
            if isinstance(event, yaml.AliasEvent) or depth > _DEEPEST or count > _MOST_PARTS:
                raise ValueError(
                    f"the YAML has an alias (*name), more than {_DEEPEST} levels or more than "
                    f"{_MOST_PARTS} parts, which no index needs. Write it as one table of rows"
                )
        content = _plain(yaml.compose(text, loader))
    except yaml.YAMLError as error:
        reason = " ".join(str(error).split())[:90]
        raise ValueError(f"the file is not valid YAML ({reason})") from None
    entries = content.get("DATA") if isinstance(content, dict) else None
    if not isinstance(entries, list) or not all(isinstance(e, dict) for e in entries):
        raise ValueError(
            "there is no list DATA, which a file of the refractiveindex.info database has"
        )
    parts: dict[str, _Part] = {}
    for entry in entries:
        kind = " ".join(str(entry.get("type")).split())
        formula = kind.startswith("formula")
        holds = "n" if formula else kind.removeprefix("tabulated ")
        if holds not in ("n", "k", "nk"):
            continue
        if twice := set(holds) & set(parts):
            raise ValueError(f"DATA holds {min(twice)} twice; keep one of them")
        if formula:
            parts["n"] = _formula(entry, kind)
            continue
        lines = str(entry.get("data")).splitlines()
        rows = [_numbers(line, "a row of data") for line in lines if line.strip()]
        if not rows or any(len(row) != 1 + len(holds) for row in rows):
            wanted = f"rows of {1 + len(holds)} numbers each"
            raise ValueError(f"the data of {kind!r} are not {wanted}")
        wavelength, *columns = np.array(rows).T
        for name, column in zip(holds, columns, strict=True):
            parts[name] = _tabulated(wavelength, column, name)
    if "n" not in parts:
        kinds = ", ".join(str(e.get("type"))[:20] for e in entries[:8]) or "nothing"
        raise ValueError(
            f"DATA holds {kinds}, and no n (tabulated n, tabulated nk, formula 1 to 9 were wanted)"
        )
    return parts


def _plain(node: Any) -> Any:
    """Return a node of YAML as a dict, a list or a text."""
    if node is None or isinstance(node.value, str):
        return node and node.value
    if not all(isinstance(part, tuple) for part in node.value):
        return [_plain(part) for part in node.value]
    names = [str(_plain(key)) for key, _ in node.value]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"{twice[:40]!r} stands twice in one entry; write it once")
    return dict(zip(names, (_plain(value) for _, value in node.value), strict=True))


def _joined(n: _Part, k: _Part | None, name: str) -> Material:
    """Return the material with this n and k (None: 0), over the wavelengths of both."""
    low, high = n[1] if k is None else (max(n[1][0], k[1][0]), min(n[1][1], k[1][1]))
    if not low < high:
        raise ValueError(
            f"the wavelengths of n ({n[1][0]:g} to {n[1][1]:g} um) and of k do not overlap"
        )
    return Material(_Both(n[0], None if k is None else k[0]), (low, high), name)


def _formula(entry: Mapping[str, Any], kind: str) -> _Part:
    found = re.fullmatch(r"formula\s+([1-9])", kind)
    if not found:
        raise ValueError(f"an entry has the type {kind[:40]!r}; formula 1 to formula 9 were wanted")
    # older files say "range"
    limits = _numbers(entry.get("wavelength_range", entry.get("range")), "wavelength_range")
    if len(limits) != 2:
        raise ValueError(f"wavelength_range holds {len(limits)} numbers; two were wanted")
    coefficients = tuple(_numbers(entry.get("coefficients"), "coefficients"))
    model, low, high = PublishedFormula(int(found[1]), coefficients), min(limits), max(limits)
    if not 0.0 < low < high < np.inf:
        raise ValueError(f"wavelength_range is {low:g} to {high:g}; two, above 0, were wanted")
    at = np.geomspace(low, high, 101)
    try:
        with fit_settings():
            n = np.asarray(model.index(jnp.asarray(at)).eta)
    except ArithmeticError:  # a power of two coefficients
        n = np.full(len(at), np.inf)
    wrong = np.flatnonzero(~(np.isreal(n) & (n > 0.0) & (n <= _LARGEST)))
    if len(wrong):
        raise ValueError(
            f"{kind} gives n = {n[wrong[0]]:.4g} at {at[wrong[0]]:.4g} um, and from 0 to "
            f"{_LARGEST:g} was wanted. Correct the coefficients, or shorten wavelength_range"
        )
    return model, (low, high)


def _numbers(text: Any, name: str) -> list[float]:
    try:
        return [float(x.replace("_", "no number")) for x in str(text).split()]
    except ValueError:
        came = repr(str(text)[:60])
        raise ValueError(f"{name} is {came}; numbers separated by blanks were wanted") from None


def _tabulated(wavelength: np.ndarray, x: np.ndarray, name: str) -> _Part:
    """Return n (with k = 0) or k in order of wavelength, with means of repeated wavelengths."""
    each, place, count = np.unique(wavelength, return_inverse=True, return_counts=True)
    if not (np.isfinite(each).all() and each[0] > 0.0):
        raise ValueError(f"a wavelength is {each[0]:g}; numbers above 0 were wanted")
    if not (np.abs(x) <= _LARGEST).all():
        raise ValueError(f"an n or k is no number, or above {_LARGEST:g}")
    if len(each) < 2:
        raise ValueError("there is one wavelength; two or more were wanted")
    mean = np.bincount(place, x) / count
    columns = (mean, np.zeros_like(mean)) if name == "n" else (np.ones_like(mean), mean)
    return Tabulated(each, *columns), (float(each[0]), float(each[-1]))


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
        for lines in _blocks(read_lines(file, None)[0]):
            found = _index_of(read_table(lines, Options()), file.name)
            if twice := found.keys() & parts.keys():
                refuse(f"two tables hold {min(twice)}; one was wanted.", lines[0][0])
            parts |= found
        if "n" not in parts:
            refuse(f"no column is n. {_WANTED}.")
    return parts
