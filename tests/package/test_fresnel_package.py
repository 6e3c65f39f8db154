"""What `import fresnel_jax` gives, and what it costs."""

import contextlib
import importlib.metadata
import inspect
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import fresnel_jax

FILES = Path(fresnel_jax.__file__).parent.glob("[a-z]*.py")
SUBMODULES = sorted([*(path.stem for path in FILES), "bsdf"])  # the one folder that is public


def in_a_new_process(code: str) -> str:
    return subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout


def test_every_submodule_is_an_attribute():
    assert set(SUBMODULES) == set(fresnel_jax._SUBMODULES)
    calls = "; ".join(f"fresnel_jax.{name}" for name in SUBMODULES)
    in_a_new_process(f"import fresnel_jax; {calls}")
    assert set(SUBMODULES) <= set(dir(fresnel_jax))
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = fresnel_jax.nothing


def test_the_import_brings_no_more_than_it_needs():
    loaded = in_a_new_process("import fresnel_jax, sys; print(*sys.modules)").split()
    for name in ("optimistix", "matplotlib", "pandas", "fitting", "fresnel_jax.bsdf",
                 "fresnel_jax.dispersion", "fresnel_jax.polarization"):  # fmt: skip
        assert name not in loaded


def test_signatures_are_short_enough_to_read():
    offered = [fresnel_jax, *(getattr(fresnel_jax, name) for name in SUBMODULES)]
    for module in offered:
        for name in module.__all__:
            if inspect.isroutine(value := getattr(module, name)) or inspect.isclass(value):
                with contextlib.suppress(ValueError):  # an enumeration has none
                    assert "Union[" not in str(inspect.signature(value)), name


def test_version_names_and_types():
    assert fresnel_jax.__version__ == importlib.metadata.version("fresnel-jax")
    assert all(hasattr(fresnel_jax, name) for name in fresnel_jax.__all__)
    assert (Path(fresnel_jax.__file__).parent / "py.typed").is_file()


def import_warns_of(code: str = "", folder: Path | None = None, **environment: str) -> str:
    """What `import fresnel_jax` prints after some code, in a process that starts in a folder."""
    done = subprocess.run(
        [sys.executable, "-c", f"{code}\nimport fresnel_jax, fresnel_jax.interface"],
        capture_output=True, text=True, check=True, cwd=folder,
        env={**os.environ, "PYTHONPATH": str(Path(fresnel_jax.__file__).parents[1]), **environment},
    )  # fmt: skip
    return done.stderr


@pytest.mark.parametrize("flags", ["", "--xla_cpu_experimental_ynn_fusion_type="])
def test_a_compiler_that_makes_wrong_programs_is_told_once(flags):
    # the flags reach the import, but not this jaxlib, which may not know them
    code = "import os, jax, jaxlib.version\njaxlib.version.__version__ = '0.10.2'\n"
    code += f"os.environ['XLA_FLAGS'] = {flags!r}"
    assert import_warns_of().count("jaxlib 0.10.2 compiles wrong programs") == 0
    assert import_warns_of(code).count("jaxlib 0.10.2 compiles wrong programs") == (not flags)
    silent = "import warnings; warnings.filterwarnings('ignore', message='jaxlib 0.10.2')\n"
    assert import_warns_of(silent + code) == ""


def test_another_module_named_fitting_is_named(tmp_path):
    (tmp_path / "fitting.py").write_text("import fresnel_jax")
    assert f"import fitting gives {tmp_path / 'fitting.py'}" in import_warns_of(folder=tmp_path)
    assert "import fitting gives" not in import_warns_of("import sys; sys.path.pop(0)", tmp_path)
    # a file of the user's that is imported as `fitting` before
    assert "import fitting gives" in import_warns_of("import fitting", tmp_path)


def test_a_package_that_another_distribution_has_replaced_is_named(tmp_path):
    shutil.copytree(Path(fresnel_jax.__file__).parent, tmp_path / "fresnel_jax")
    other = tmp_path / "fitting"
    other.mkdir()
    (other / "py.typed").write_text("")
    (other / "__init__.py").write_text('"""Another package."""')
    assert "import fitting gives" in import_warns_of(folder=tmp_path)
