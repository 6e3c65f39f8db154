"""docs/sources.md tells the truth: every function, example and test that it names is there."""

import ast
import importlib
import re
from pathlib import Path

import pytest

pytestmark = pytest.mark.docs  # of `make test-docs`
ROOT = Path(__file__).resolve().parents[2]
ROWS = [
    [cell.strip() for cell in line.strip().strip("|").split(" | ")]
    for line in (ROOT / "docs" / "sources.md").read_text().splitlines()
    if line.startswith("| ") and not line.startswith(("| item |", "| no. |", "| --- |"))
]


def names(cell: str) -> list[str]:
    """The names between backticks; every row must have some."""
    found = re.findall(r"`([^`]+)`", cell)
    assert found, f"nothing is named in {cell!r}"
    return found


def defined(path: Path) -> set[str]:
    """The functions that a file of tests defines."""
    return {x.name for x in ast.parse(path.read_text()).body if isinstance(x, ast.FunctionDef)}


def test_every_row_is_there():
    # Principles, functions, both editions' classes, the notebook, our own, and the 12 errors.
    assert len(ROWS) == 10 + 11 + 5 + 7 + 6 + 6 + 12
    assert all(len(row) == 4 for row in ROWS)
    assert [row[0] for row in ROWS if row[0].isdigit()] == [str(i) for i in range(1, 13)]


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[0][:30])
def test_what_a_row_names_is_there(row):
    for name in names(row[2]):
        if name.startswith("examples/"):
            assert (ROOT / name).is_file(), name
            continue
        module, *attributes = name.split(".")
        found = importlib.import_module(f"fresnel_jax.{module}")
        for attribute in attributes:
            found = getattr(found, attribute)
        assert not callable(found) or found.__doc__, f"{name} has no docstring"
    for name in names(row[3]):
        file, _, test = name.partition("::")
        (path,) = (ROOT / "tests").rglob(f"{file}.py")
        assert test in defined(path), name
