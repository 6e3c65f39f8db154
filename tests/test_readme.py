"""The README's tables are those of today, and its pictures and files exist.

Its code is run by `test_docs_code`.
"""

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


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


@pytest.mark.parametrize("scan", ["germanium_633nm_simulated", "gold_532nm"])
def test_the_tables_are_what_make_demo_prints(scan):
    (shown,) = re.findall(rf"```text\n({scan}\.csv.*?)```", README, re.DOTALL)
    command = [sys.executable, "-m", "fitting", f"examples/data/{scan}.csv"]
    printed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    # The number of evaluations may depend on the processor's rounding.
    without_count = [re.sub(r"\d+ evaluations", "", text) for text in (shown, printed)]
    assert without_count[0].splitlines() == without_count[1].splitlines()
