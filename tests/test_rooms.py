"""The rooms of `fitting`: imports run downwards in the list of CONTRIBUTING.md."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "fitting"
# The most lines of each room. A number may fall; one that has to rise says that a room does more
# than it did, and then another should do less.
MOST_LINES = {
    "__main__": 100, "bare_surface": 3920, "batches": 460, "choice": 700, "command": 600, "data":
    840, "fit_result": 100, "fits": 260, "free_films": 200, "measured_file": 140, "optics": 680,
    "outcomes": 1420, "output": 2060, "own_residuals": 260, "predictions": 180, "problem": 2640,
    "process": 460, "ratios": 200, "reader": 2760, "refused_curves": 80, "residuals": 520,
    "results": 960, "samples": 1860, "searching": 2200, "thickness_profile": 240, "uncertainty":
    1500, "wavelengths": 300,
}  # fmt: skip


def rooms() -> list[list[str]]:
    """Return the rooms, the highest first; modules of one line are on one level."""
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    listed = text.split("```text\n", 1)[1].split("```", 1)[0]
    lines = [line for line in listed.splitlines() if line and not line.startswith(" ")]
    return [re.findall(r"(\w+)(?:/|\.py)", line.split("  ")[0]) for line in lines]


def room_of(path: Path) -> str:
    """Return the room of a file: its folder below `fitting`, or its own name."""
    first, *more = path.relative_to(PACKAGE).parts
    return first if more else path.stem


def imported(tree: ast.Module) -> Iterator[str]:
    """Yield the modules of `fitting` that a file imports: also within functions, or for types."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "fitting":
            names = [f"fitting.{a.name}" for a in node.names]
            yield from [node.module] if node.module != "fitting" else names


def test_every_file_has_its_room() -> None:
    known = {name for line in rooms() for name in line}
    found = {room_of(path) for path in PACKAGE.rglob("*.py")} - {"__init__"}
    assert found == known


def test_imports_run_downwards() -> None:
    level = {name: i for i, line in enumerate(rooms()) for name in line}
    wrong = []
    for path in PACKAGE.rglob("*.py"):
        if path == PACKAGE / "__init__.py":
            continue
        for module in imported(ast.parse(path.read_text(encoding="utf-8"))):
            target = module.split(".")[1]
            if level[target] < level[room_of(path)]:
                wrong.append(f"{path.relative_to(ROOT)} imports {module}")
    assert wrong == []


def test_no_files_import_each_other_in_a_circle() -> None:
    below = {}
    for path in PACKAGE.rglob("*.py"):
        name = ".".join(path.relative_to(ROOT).with_suffix("").parts)
        below[name] = set(imported(ast.parse(path.read_text(encoding="utf-8"))))
    below.pop("fitting.__init__")
    while free := [name for name, own in below.items() if not own & below.keys()]:
        for name in free:
            del below[name]
    assert sorted(below) == []


def test_no_room_grows() -> None:
    lines = dict.fromkeys(MOST_LINES, 0)
    for path in PACKAGE.rglob("*.py"):
        if path != PACKAGE / "__init__.py":
            lines[room_of(path)] += len(path.read_text(encoding="utf-8").splitlines())
    assert {room: n for room, n in lines.items() if n > MOST_LINES[room]} == {}


def test_each_room_says_what_it_is_for() -> None:
    for path in PACKAGE.rglob("__init__.py"):
        assert ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))), path


def test_no_two_files_have_one_name() -> None:
    for package in (PACKAGE, ROOT / "fresnel_jax"):
        names = [path.name for path in package.rglob("*.py") if path.name != "__init__.py"]
        assert sorted(set(names)) == sorted(names)
