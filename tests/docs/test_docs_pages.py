"""The documentation has every public name, page and picture, and names nothing else."""

import importlib
import importlib.util
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import fitting
import fresnel_jax

pytestmark = pytest.mark.docs  # of `make test-docs`
ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = sorted(DOCS.rglob("*.md"))
PICTURES = [p for ending in ("png", "jpg") for p in sorted(DOCS.rglob(f"*.{ending}"))]


def public_names() -> set[str]:
    """module.name of all that is public; a class that two modules offer counts for one of them."""
    offered = {f"fitting.{name}": getattr(fitting, name) for name in fitting.__all__}
    for module in (fresnel_jax, *(getattr(fresnel_jax, m) for m in fresnel_jax._SUBMODULES)):
        for name in module.__all__:
            offered[f"{module.__name__}.{name}"] = getattr(module, name)
    return set(offered)


def described() -> set[str]:
    api = "\n".join(p.read_text(encoding="utf-8") for p in (DOCS / "api").glob("*.md"))
    return set(re.findall(r"^::: (\S+)$", api, re.MULTILINE))


def value(name: str):
    module, _, attribute = name.rpartition(".")
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError:
        return getattr(importlib.import_module(module), attribute)


def test_the_reference_has_every_public_name():
    there = described()
    objects = [value(name) for name in there]
    missing = [
        name for name in sorted(public_names() - there)
        if not any(value(name) is found for found in objects)
    ]  # fmt: skip
    assert missing == []


def test_what_links_point_at_is_there():
    for page in PAGES:
        links = re.findall(r"\]\((?!http)([^)#\s]+)", page.read_text(encoding="utf-8"))
        for link in links:
            assert (page.parent / link).exists(), f"{page.name}: {link}"


def test_every_page_is_in_the_navigation():
    navigation = (ROOT / "mkdocs.yml").read_text(encoding="utf-8").partition("\nnav:")[2]
    listed = re.findall(r"([\w/]+\.md)", navigation)
    assert sorted(listed) == sorted(p.relative_to(DOCS).as_posix() for p in PAGES)


def test_numbers_have_a_leading_zero():
    for page in [*PAGES, ROOT / "README.md"]:
        prose = re.sub(
            r"^```.*?^```|`[^`\n]*`|\]\([^)]*\)", "", page.read_text(encoding="utf-8"),
            flags=re.DOTALL | re.MULTILINE,
        )  # fmt: skip
        assert re.findall(r"(?<![\w.)\]])\.\d.*", prose) == [], page


def test_the_gallery_has_every_picture_and_every_script():
    gallery = (DOCS / "gallery.md").read_text(encoding="utf-8")
    charts = (DOCS / "charts.md").read_text(encoding="utf-8")
    for picture in PICTURES:
        of_numbers = picture.parent.name in ("benchmarks", "stability")
        assert f"({picture.relative_to(DOCS).as_posix()})" in (charts if of_numbers else gallery)
    for script in (ROOT / "examples").glob("[a-z]*.py"):
        if "_picture" in script.read_text(encoding="utf-8"):
            assert script.name in gallery


def test_notebooks_are_those_of_the_pages():
    file = ROOT / "examples" / "notebooks" / "make.py"
    spec = importlib.util.spec_from_file_location("make_notebooks", file)
    assert spec is not None and spec.loader is not None
    make = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(make)
    pages = {p.stem: p for p in (DOCS / "tutorials").glob("*.md") if p.stem != "index"}
    assert {p.stem for p in file.parent.glob("*.ipynb")} == set(pages)
    for name, page in pages.items():
        made = make.notebook(page.read_text(encoding="utf-8"))
        assert (file.parent / f"{name}.ipynb").read_text(encoding="utf-8") == made, "make notebooks"
        for cell in json.loads(made)["cells"]:
            if cell["cell_type"] == "code":
                code = "".join(cell["source"])
                compile(code, name, "exec")
                for data in re.findall(r'"(\.\./[^"]+)"', code):
                    assert (file.parent / data).exists(), data


@pytest.mark.parametrize("on_the_path", [False, True])
def test_the_command_works_beside_a_fitting_of_the_users_own(tmp_path, on_the_path):
    (tmp_path / "fitting.py").write_text("raise SystemExit('the wrong fitting')\n")
    environment = os.environ | {"JAX_PLATFORMS": "cpu"}
    if on_the_path:
        environment["PYTHONPATH"] = str(tmp_path)
    start = f"import sys; sys.path.append({str(ROOT)!r}); import fresnel_fit; fresnel_fit.run()"
    done = subprocess.run(
        [sys.executable, "-P", "-c", start, "--version"], cwd=tmp_path, env=environment,
        capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip()
