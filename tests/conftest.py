"""Shared by all tests: float64 is on (float32 is tested with float32 arrays)."""

from pathlib import Path

import jax
import pytest

jax.config.update("jax_enable_x64", True)
# Writing thousands of programs to disk ended in a segmentation fault of jaxlib once; the cache of
# the command is tested in processes of its own.
jax.config.update("jax_enable_compilation_cache", False)

MOST_MAPPINGS = 25_000


@pytest.fixture(scope="module", autouse=True)
def _few_compiled_programs():
    """Forget compiled programs when there are many: a process may have 65,530 memory mappings."""
    yield
    mappings = Path("/proc/self/maps")
    if mappings.exists() and len(mappings.read_bytes().splitlines()) > MOST_MAPPINGS:
        jax.clear_caches()


@pytest.fixture
def set_jax():
    """A function that sets switches of jax, for all threads; they are set back after the test."""
    before = {}

    def update(**switches):
        for name, value in switches.items():
            before.setdefault(name, getattr(jax.config, name))
            jax.config.update(name, value)

    yield update
    update(**before)


@pytest.fixture(scope="session")
def cache(tmp_path_factory) -> Path:
    """The folder of programs that commands of these tests compiled; `command.own_cache` uses it."""
    return tmp_path_factory.mktemp("cache")


@pytest.fixture(scope="session")
def measured_files() -> Path:
    """The folder of measured files, which are not part of the project."""
    folder = Path(__file__).resolve().parents[2] / "shared" / "data"
    if not folder.is_dir():
        pytest.skip("the measured files (../shared/data) are not here; they are not distributed")
    return folder
