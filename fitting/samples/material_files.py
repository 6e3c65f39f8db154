"""The index of a material from a file.

    read_material("SiO2/nk/Malitson.yml")      a file of the refractiveindex.info database
    read_material("film.csv")                  a table of wavelength, n and, if wanted, k

In the text of a sample the name of a file may stand for that of a material:
``air | film.yml 110 nm | Si``.

YAML is read by PyYAML, an optional dependency (extra ``yaml``): a parser of our own would know only
the part of YAML that those files use today.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array

from fitting.data.errors import MeasurementError, for_command
from fitting.process.compiled import fit_settings
from fitting.reader.text import MAX_BYTES
from fitting.samples.material_tables import index_in_table
from fitting.samples.published_formulas import PublishedFormula
from fresnel_jax.dispersion import DispersionModel, Index, Material, Tabulated

ENDINGS = (".yml", ".yaml", ".csv", ".txt", ".dat", ".nk")
# An alias may stand for gigabytes. The largest table of the database has 61,730 rows.
_LONGEST_YAML, _DEEPEST, _MOST_PARTS = 5_000_000, 20, 10_000
# k of metals in the far infrared is some thousand: 6,100 is the most in the database.
_LARGEST = 1e6

# n or k: a model, and the wavelengths from which to which it holds.
_Part = tuple[DispersionModel, tuple[float, float]]


class MaterialFileError(ValueError):
    """An index cannot be read from a file; the text says where, what came, and what was wanted."""


class _Both(DispersionModel):
    """n of one model and k of another."""

    n: DispersionModel
    k: DispersionModel | None = eqx.field(default=None)

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
    if file.suffix.lower() not in (".yml", ".yaml"):
        try:
            return _from_table(file)
        except MeasurementError as error:
            text = for_command(error)
            advice = (
                " The file of a material takes no options: write it so." if "--" in text else ""
            )
            raise MaterialFileError(text + advice) from None
        except ValueError as error:
            raise MaterialFileError(f"{file.name}: {error}.") from None
    try:
        with file.open("rb") as stream:
            data = stream.read(MAX_BYTES + 1)
    except OSError as error:
        raise MaterialFileError(f"{file}: the file cannot be read ({error.strerror}).") from None
    if len(data) > MAX_BYTES:
        raise MaterialFileError(
            f"{file}: at most {MAX_BYTES // 10**6} MB are read. Leave rows out."
        )
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    try:
        return _from_yaml(text, file.stem)
    except ValueError as error:
        raise MaterialFileError(f"{file.name}: {error}.") from None


def _from_yaml(text: str, name: str) -> Material:
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
        holds = "n" if kind.startswith("formula") else kind.removeprefix("tabulated ")
        if holds not in ("n", "k", "nk"):
            continue
        if twice := set(holds) & set(parts):
            raise ValueError(f"DATA holds {min(twice)} twice; keep one of them")
        of_formula = kind.startswith("formula")
        part = _formula(entry, kind) if of_formula else _table(*_columns(entry.get("data"), kind))
        parts |= dict.fromkeys(holds, part)
    if "n" not in parts:
        kinds = ", ".join(str(e.get("type"))[:20] for e in entries[:8]) or "nothing"
        raise ValueError(
            f"DATA holds {kinds}, and no n (tabulated n, tabulated nk, formula 1 to 9 were wanted)"
        )
    return _joined(parts["n"], parts.get("k"), name)


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


def _columns(text: Any, kind: str) -> tuple[np.ndarray, ...]:
    """Return wavelength, n and k of a table of the database; an n that is absent is 1, a k is 0."""
    wanted = 3 if "nk" in kind else 2
    rows = [_numbers(line, "a row of data") for line in str(text).splitlines() if line.strip()]
    if not rows or any(len(row) != wanted for row in rows):
        raise ValueError(f"the data of {kind!r} are not rows of {wanted} numbers each")
    wavelength, first, *second = np.array(rows).T
    if second:
        return wavelength, first, *second
    blank = np.zeros_like(first)
    return (wavelength, first, blank) if kind.endswith("n") else (wavelength, blank + 1.0, first)


def _table(wavelength: np.ndarray, n: np.ndarray, k: np.ndarray) -> _Part:
    """Return a table in order of wavelength, with the mean of repeated wavelengths."""
    each, place, count = np.unique(wavelength, return_inverse=True, return_counts=True)
    if not (np.isfinite(each).all() and each[0] > 0.0):
        raise ValueError(f"a wavelength is {each[0]:g}; numbers above 0 were wanted")
    if not (np.abs([n, k]) <= _LARGEST).all():
        raise ValueError(f"an n or k is no number, or above {_LARGEST:g}")
    if len(each) < 2:
        raise ValueError("there is one wavelength; two or more were wanted")
    columns = (np.bincount(place, column) / count for column in (n, k))
    return Tabulated(each, *columns), (float(each[0]), float(each[-1]))


def _from_table(file: Path) -> Material:
    parts = index_in_table(file)
    wavelength, n = parts["n"]
    wavelength_k, k = parts.get("k", (wavelength, np.zeros_like(n)))
    if np.array_equal(wavelength, wavelength_k):
        return Material(*_table(wavelength, n, k), file.stem)
    of_k = _table(wavelength_k, np.ones_like(k), k)
    return _joined(_table(wavelength, n, np.zeros_like(n)), of_k, file.stem)
