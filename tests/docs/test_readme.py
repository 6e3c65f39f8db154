"""What the README points at exists; tables of shipped scans and of the comparison are of today.

Its code is run by `test_docs_code`.
"""

import re
import subprocess
import sys

import pytest

from tests.command_line import ROOT, own_cache  # noqa: F401 (a fixture)

pytestmark = pytest.mark.docs  # of `make test-docs`
README = (ROOT / "README.md").read_text(encoding="utf-8")
DOCS = "".join(p.read_text(encoding="utf-8") for p in (ROOT / "docs").rglob("*.md"))


def test_what_the_readme_points_at_exists():
    links = re.findall(r"\]\((?!http)([^)#]+)\)", README)
    assert links
    for link in links:
        assert (ROOT / link).exists(), link


def test_make_targets_that_the_readme_names_exist():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    named = set(re.findall(r"(?:`|^)make ([a-z-]+)", README, re.MULTILINE))
    assert {"demo", "test"} <= named
    for target in named:
        assert re.search(rf"^{target}:", makefile, re.MULTILINE), target


def column(page, heading, place):
    """Name of a row -> its number in one column of a table of docs."""
    table = (ROOT / "docs" / page).read_text(encoding="utf-8").partition(f"## {heading}\n")[2]
    rows = re.findall(r"^\| (.+) \|$", table.partition("\n## ")[0], re.MULTILINE)
    cells = [[cell.strip() for cell in row.split("|")] for row in rows]
    return {row[0].removesuffix(" *"): float(row[place]) for row in cells[2:] if row[place]}


@pytest.mark.parametrize(
    ("shown", "page", "heading", "place"),
    [
        ("million points a second, one boundary, float64", "benchmarks/benchmarks.md",
         "Speed on the cpu, lossy media, 1e6 points", 1),
        ("the same in float32", "benchmarks/benchmarks.md",
         "Speed on the cpu, lossy media, 1e6 points", 6),
        ("R off by more than 0.1 %, of 6,250 hard points", "stability/stability.md",
         "All sets together, float64", 2),
        ("gradient of R off by more than 0.1 %, of 6,250 hard points", "stability/stability.md",
         "All sets together, float64", 8),
        ("gradient of R is NaN, of 6,250 hard points", "stability/stability.md",
         "All sets together, float64", 10),
    ],
)  # fmt: skip
def test_the_comparison_has_the_figures_of_the_benchmarks(shown, page, heading, place):
    (row,) = re.findall(rf"^\| {re.escape(shown)} \|(.*)\|$", DOCS, re.MULTILINE)
    names = ("reflectance", "Tmm", "TmmFast", "Tmmax", "JaxLayerLumos", "PyElli", "Mitsuba")
    measured = column(page, heading, place)
    for name, cell in zip(names, row.split("|"), strict=True):
        if cell.strip() and "float32" not in cell:  # that one is of another table
            assert float(cell) == pytest.approx(measured[name], rel=0.05), name


def test_the_comparison_has_the_figures_of_stacks_that_fail():
    text = (ROOT / "docs/stability/stacks.md").read_text(encoding="utf-8")
    head, row = (
        re.findall(rf"^\| {name} \|(.*)\|$", text, re.MULTILINE)[0].split("|")
        for name in ("stack", "silver film")
    )
    measured = {name.strip(): cell.strip() for name, cell in zip(head, row, strict=True)}
    (shown,) = re.findall(
        r"^\| largest error of a film of silver.*?\|(.*)\| \|$", DOCS, re.MULTILINE
    )
    names = ("stack", "tmm", "tmm_fast", "tmmax", "jaxlayerlumos", "elli")
    assert [cell.strip() for cell in shown.split("|")] == [measured[name] for name in names]


@pytest.mark.parametrize("scan", ["germanium_633nm_simulated", "gold_532nm"])
def test_the_tables_are_what_make_demo_prints(scan):
    (shown,) = re.findall(rf"```text\n({scan}\.csv.*?)```", DOCS, re.DOTALL)
    command = [sys.executable, "-m", "fitting", f"examples/data/{scan}.csv"]
    printed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert shown.splitlines() == printed.splitlines()
