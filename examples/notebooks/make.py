"""Writes the tutorials of docs/tutorials as notebooks beside this file: `make notebooks`.

A Python block of a page is a code cell with the output that the page shows below it; all else is
text. Notebooks run in their own folder, so that the path of the data differs from that of the page.
"""

import json
import re
from pathlib import Path

HERE = Path(__file__).resolve().parent
PAGES = HERE.parents[1] / "docs" / "tutorials"
CODE = re.compile(r"^```python\n(.*?)^```\n(?:\n```text\n(.*?)^```\n)?", re.DOTALL | re.MULTILINE)


def cell(kind: str, text: str, number: int) -> dict:
    """A cell of a notebook, format 4.5."""
    return {"cell_type": kind, "id": f"cell-{number}", "metadata": {},
            "source": text.strip("\n").splitlines(keepends=True)}  # fmt: skip


def code_cell(code: str, printed: str | None, number: int) -> dict:
    """A cell of code, with what it prints."""
    lines = (printed or "").splitlines(keepends=True)
    outputs = [{"name": "stdout", "output_type": "stream", "text": lines}] if lines else []
    code = code.replace("examples/data/", "../data/")
    return cell("code", code, number) | {"execution_count": None, "outputs": outputs}


def notebook(page: str) -> str:
    """The notebook of a page's text, as JSON."""
    # Links and pictures of the page are relative to docs/tutorials.
    page = re.sub(r"\]\((?!http)([^)]+)\)", r"](../../docs/tutorials/\1)", page)
    cells, end = [], 0
    for block in [*CODE.finditer(page), None]:
        text = page[end : block.start() if block else None]
        if text.strip():
            cells.append(cell("markdown", text, len(cells)))
        if block:
            cells.append(code_cell(block[1], block[2], len(cells)))
            end = block.end()
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    content = {
        "cells": cells,
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
