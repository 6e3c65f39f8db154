"""Shared by all tests: float64 is on (float32 is tested with float32 arrays)."""

import ctypes
import gc
import re
import shutil
import sys
import tempfile
from pathlib import Path

import jax
import pytest

jax.config.update("jax_enable_x64", True)

# Traced programs are many small objects that live on: going through them again and again took a
# sixth of the time of tests that trace.
gc.set_threshold(100_000, 50, 100)

# A gigabyte of programs, of the 65,530 mappings that a process may have.
MOST_MAPPINGS = 12_000
# The workers of a run share what takes a second to compile, in a folder that is gone afterwards.
# Not what takes less: writing thousands of programs ended in a segmentation fault of jaxlib once.
LEAST_SECONDS = 1.0
PROGRAMS = pytest.StashKey[str]()


def pytest_configure(config):
    shared = getattr(config, "workerinput", {}).get("programs")
    folder = shared or tempfile.mkdtemp(prefix="programs-")
    if shared is None:
        config.stash[PROGRAMS] = folder
    jax.config.update("jax_compilation_cache_dir", folder)
    jax.config.update("jax_persistent_cache_min_compile_time_secs", LEAST_SECONDS)


@pytest.hookimpl(optionalhook=True)
def pytest_configure_node(node):
    node.workerinput["programs"] = node.config.stash[PROGRAMS]


def pytest_unconfigure(config):
    if PROGRAMS in config.stash:
        shutil.rmtree(config.stash[PROGRAMS], ignore_errors=True)


def pytest_collection_modifyitems(items):
    """The fits stand together, so that each worker compiles the programs of one half."""
    fits = {path: bool(re.search(r"^(from|import) fitting", path.read_text(), re.M))
            for path in {item.path for item in items}}  # fmt: skip
    items.sort(key=lambda item: fits[item.path])


@pytest.fixture(scope="module", autouse=True)
def _few_compiled_programs():
    """Give memory back, and forget compiled programs when there are many, for their mappings.

    What compiling used stays in pieces between the programs: half of what a worker took.
    """
    yield
    mappings = Path("/proc/self/maps")
    if mappings.exists() and len(mappings.read_bytes().splitlines()) > MOST_MAPPINGS:
        jax.clear_caches()
        gc.collect()
    if sys.platform == "linux" and hasattr(libc := ctypes.CDLL(None), "malloc_trim"):
        libc.malloc_trim(0)


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
