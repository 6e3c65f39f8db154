"""Every code block of README and docs runs as it stands, and prints what stands below it.

The blocks of a page run in its order, in one namespace and in an empty folder that has the
project's `examples`, with JAX as a newcomer has it (float32). A block of text right below a Python
block is what that block prints. Commands of shell blocks are run where their files exist; of others
the options are checked.
"""

import contextlib
import io
import os
import re
import shlex
from pathlib import Path

import jax
import pytest

from fitting.command.cli import main
from fitting.command.cli import parser as command_parser

pytestmark = pytest.mark.docs  # of `make test-docs`
ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
PYTHON = re.compile(r"^```python\n(.*?)^```\n(?:\n```text\n(.*?)^```)?", re.DOTALL | re.MULTILINE)
SHELL = re.compile(r"^```sh\n(.*?)^```", re.DOTALL | re.MULTILINE)


def name(page: Path) -> str:
    return str(page.relative_to(ROOT))


@pytest.fixture
def as_a_newcomer(tmp_path, monkeypatch):
    """An empty folder with the examples in it, and JAX's own default precision."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(ROOT))
    os.symlink(ROOT / "examples", tmp_path / "examples")
    # `cache_programs` then leaves the cache of this process as it is
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", str(tmp_path / "programs"))
    jax.config.update("jax_enable_x64", False)
    yield tmp_path
    jax.config.update("jax_enable_x64", True)


WITH_PYTHON = [p for p in PAGES if PYTHON.search(p.read_text(encoding="utf-8"))]
# How many starting points lead to the minimum depends on the processor's rounding.
STARTS = re.compile(r"\d+ of \d+ starting points")
# Tutorials that compile for a minute.
LONG = {"own_loss.md", "film.md", "path_tracer.md", "wafer_map.md", "design.md", "posterior.md"}


@pytest.mark.parametrize(
    "page",
    [
        pytest.param(p, marks=[pytest.mark.study] * (p.name in LONG), id=name(p))
        for p in WITH_PYTHON
    ],
)
@pytest.mark.filterwarnings("default")
def test_python_blocks_run_and_print_what_is_shown(page, as_a_newcomer):
    if page.name == "wafer_map.md":
        pytest.importorskip("zarr", reason="the extra maps is not installed")
    if page.name == "design.md":
        pytest.importorskip("optax", reason="the extra design is not installed")
    if page.name == "posterior.md":
        pytest.importorskip("blackjax", reason="the extra posterior is not installed")
    namespace = {"__name__": "page"}
    for code, shown in PYTHON.findall(page.read_text(encoding="utf-8")):
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            exec(compile(code, name(page), "exec"), namespace)
        if shown:
            assert STARTS.sub("", printed.getvalue()).rstrip() == STARTS.sub("", shown).rstrip()


def commands():
    """Every line with fresnel-fit of a shell block."""
    for page in PAGES:
        for block in SHELL.findall(page.read_text(encoding="utf-8")):
            for line in block.splitlines():
                if line.startswith("fresnel-fit "):
                    yield pytest.param(line, id=f"{name(page)}: {line[:50]}")


@pytest.mark.parametrize("line", list(commands()))
def test_commands_run_or_have_options_that_exist(line, as_a_newcomer, capsys):
    arguments = shlex.split(line, comments=True)[1:]
    given = command_parser().parse_args(arguments)
    if all(Path(file).exists() for file in given.file):
        assert main(arguments) == 0
        assert capsys.readouterr().out
