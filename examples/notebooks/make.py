"""Writes the tutorials of docs/tutorials as notebooks beside this file: `make notebooks`.

A Python block of a page is a code cell, all else is text; outputs shown on the page are left out.
The first cell goes to the project's folder, where the data are, and keeps files out of it.
"""

import json
import re
from pathlib import Path

HERE = Path(__file__).resolve().parent
PAGES = HERE.parents[1] / "docs" / "tutorials"
FIRST = """\
# The pages of the tutorials run in a folder of their own, beside the project's examples.
import os, sys, tempfile
from pathlib import Path

root = next(p for p in [Path.cwd(), *Path.cwd().parents] if (p / "examples" / "data").is_dir())
sys.path.insert(0, str(root))
os.chdir(tempfile.mkdtemp())
os.symlink(root / "examples", "examples")"""


def cell(kind: str, text: str, number: int) -> dict:
    """A cell of a notebook, format 4.5."""
    made = {"cell_type": kind, "id": f"cell-{number}", "metadata": {},
            "source": text.strip("\n").splitlines(keepends=True)}  # fmt: skip
    return made | ({"execution_count": None, "outputs": []} if kind == "code" else {})


def notebook(page: str) -> str:
    """The notebook of a page's text, as JSON."""
    # Links and pictures of the page are relative to docs/tutorials.
    page = re.sub(r"\]\((?!http)([^)]+)\)", r"](../../docs/tutorials/\1)", page)
    page = re.sub(r"(```python\n.*?```)\n\n```text\n.*?```", r"\1", page, flags=re.DOTALL)
    parts = re.split(r"```python\n(.*?)```\n", page, flags=re.DOTALL)
    cells = [("code", FIRST)]
    cells += [("code" if i % 2 else "markdown", p) for i, p in enumerate(parts) if p.strip()]
    cells[0], cells[1] = cells[1], cells[0]
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    content = {
        "cells": [cell(*c, number) for number, c in enumerate(cells)],
        "metadata": {"kernelspec": kernel, "language_info": {"name": "python"}},
        "nbformat": 4, "nbformat_minor": 5,
    }  # fmt: skip
    return json.dumps(content, indent=1, ensure_ascii=False) + "\n"


def main() -> None:
    """Write them all."""
    for page in sorted(PAGES.glob("*.md")):
        if page.stem != "index":
            made = notebook(page.read_text(encoding="utf-8"))
            (HERE / f"{page.stem}.ipynb").write_text(made, encoding="utf-8")


if __name__ == "__main__":
    main()
