"""The rooms of both packages: imports run downwards in the lists of CONTRIBUTING.md."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("fitting", "fresnel_jax")
# The most lines of each room. A number may fall; one that has to rise says that a room does more
# than it did, and then another should do less.
MOST_LINES = {
    "fitting": {
        "__main__": 90, "batch_arrays": 200, "batches": 370, "choice": 650, "command": 700,
        "data": 980, "fit_result": 140, "fits": 260, "free_films": 360, "maps": 910,
        "measured_file": 180, "misfit_causes": 220, "optics": 650, "outcomes": 2040, "output": 1850,
        "own_residuals": 270, "posterior": 120, "predictions": 170, "problem": 2100, "process": 460,
        "ratios": 190, "reader": 2710, "residuals": 610, "results": 1020, "samples": 1670,
        "searching": 2080, "uncertainty": 1690, "wavelengths": 200,
    },
    "fresnel_jax": {
        "_environment": 70, "_numerics": 1230, "approximate": 260, "boundary": 950, "bsdf": 720,
        "colour": 160, "directions": 270, "dispersion": 230, "effective_medium": 240,
        "fresnel_terms": 180, "indices": 1610, "interface": 290, "layers": 140, "materials": 230,
        "microfacet": 350, "performance": 150, "polarization": 300, "stacks": 3380,
    },
}  # fmt: skip
each_package = pytest.mark.parametrize("package", PACKAGES)


def files(package: str) -> list[Path]:
    """Return the files of a package, but for its own __init__, which exports from all rooms."""
    return [*{*(ROOT / package).rglob("*.py")} - {ROOT / package / "__init__.py"}]


def module_of(path: Path) -> str:
    """Return the name by which a file is imported."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module_of(path) for package in PACKAGES for path in files(package)}


def rooms(package: str) -> list[list[str]]:
    """Return the rooms, the highest first; modules of one line are on one level."""
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    section = text.split(f"## The rooms of `{package}`\n", 1)[1]
    listed = section.split("```text\n", 1)[1].split("```", 1)[0]
    lines = [line for line in listed.splitlines() if line and not line.startswith(" ")]
    return [re.findall(r"(\w+)(?:/|\.py)", line.split("  ")[0]) for line in lines]


def imported(path: Path) -> Iterator[str]:
    """Yield the modules of its package that a file imports: also within functions, or for types."""
    package, *folders = path.parent.relative_to(ROOT).parts
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        names = []
        if isinstance(node, ast.Import):
            names = [a.name for a in node.names]
        elif isinstance(node, ast.ImportFrom):
            above = [package, *folders][: len(folders) + 2 - node.level] if node.level else []
            module = ".".join([*above, *filter(None, [node.module])])
            names = [module, *(f"{module}.{a.name}" for a in node.names)]
        yield from (name for name in names if name in MODULES and name.split(".")[0] == package)


@each_package
def test_every_file_has_its_room(package: str) -> None:
    known = {name for line in rooms(package) for name in line}
    assert {module_of(path).split(".")[1] for path in files(package)} == known


@each_package
def test_imports_run_downwards(package: str) -> None:
    level = {name: i for i, line in enumerate(rooms(package)) for name in line}
    wrong = []
    for path in sorted(files(package)):
        room = module_of(path).split(".")[1]
        for module in imported(path):
            if level[module.split(".")[1]] < level[room]:
                wrong.append(f"{path.relative_to(ROOT)} imports {module}")
    assert wrong == []


@each_package
def test_no_files_import_each_other_in_a_circle(package: str) -> None:
    below = {module_of(path): set(imported(path)) for path in files(package)}
    while free := [name for name, own in below.items() if not own & below.keys()]:
        for name in free:
            del below[name]
    assert sorted(below) == []


@each_package
def test_no_room_grows(package: str) -> None:
    most = MOST_LINES[package]
    lines = dict.fromkeys(most, 0)
    for path in files(package):
        lines[module_of(path).split(".")[1]] += len(path.read_text(encoding="utf-8").splitlines())
    assert {room: n for room, n in lines.items() if n > most[room]} == {}


@each_package
def test_each_room_says_what_it_is_for(package: str) -> None:
    for path in (ROOT / package).rglob("__init__.py"):
        assert ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))), path


@each_package
def test_no_two_files_have_one_name(package: str) -> None:
    names = [path.name for path in files(package) if path.name != "__init__.py"]
    assert sorted(set(names)) == sorted(names)
